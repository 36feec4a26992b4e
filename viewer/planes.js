// Arrays as the page holds them: the first byte of all numbers, column after column, then the second, and so on. What is alike lies
// together then, so that it packs smaller.

/**
 * @param {Uint8Array} packed
 * @param {[number, number, number, number][]} arrays of each array: its first byte, its rows, its columns, and bytes a number
 * @returns {Uint8Array<ArrayBuffer>} the same bytes as they were
 */
export function unpackPlanes(packed, arrays) {
  const bytes = new Uint8Array(packed);
  for (const [start, rows, columns, width] of arrays) {
    let from = start;
    for (let b = 0; b < width; b++) {
      for (let c = 0; c < columns; c++) {
        for (let r = 0, to = start + c * width + b; r < rows; r++, to += columns * width) bytes[to] = packed[from++];
      }
    }
  }
  return bytes;
}
