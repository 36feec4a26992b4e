// JSON from a file that may be damaged.

/**
 * Whether a parsed value is a JSON object, neither a list nor null.
 * @returns {value is Object<string, any>}
 */
export function isTable(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

// Whether a parsed value holds one that lies in more than `most` lists and objects. Level by level: a deep file is no deep stack.
export function isDeep(value, most) {
  let level = [value];
  for (let depth = 0; depth <= most; depth++) {
    level = level.flatMap((outer) => (typeof outer === "object" && outer !== null ? Object.values(outer) : []));
  }
  return level.length > 0;
}
