// The avatar's name: it stands in the page's own address, as the folder of its run or as what `gsac view` serves it under.

// Folders that say nothing: of exports, and the cache's, which are digests.
const NAMELESS = /^(export|[0-9a-f]{2}|[0-9a-f]{32,}|objects)$/i;

/**
 * @param {string} path of the page's address
 * @returns {string} the name, or an empty one where the path has none
 */
export function readName(path) {
  const folders = path.split("/").slice(0, -1).map(decodePart);
  const folder = folders.findLast((part) => part && part !== "export") ?? "";
  return NAMELESS.test(folder) ? "" : folder.replace(/-avatar$/, "");
}

function decodePart(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
