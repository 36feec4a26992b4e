// JSON from a file that may be damaged.

/**
 * Whether a parsed value is a JSON object, neither a list nor null.
 * @returns {value is Object<string, any>}
 */
export function isTable(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
