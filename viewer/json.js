// JSON from a file that may be damaged.

// Whether a parsed value is a JSON object, neither a list nor null.
export function isTable(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
