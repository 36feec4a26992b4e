// The arrays of avatar.gsac as the page holds them, so that they pack small: numbers less what is foretold of them, in planes of
// bytes. arrays.py packs them.

// The whole number that stands for 1: of a quaternion, and of a vertex's weights together.
const WHOLE_QUAT = 32767;
const WHOLE_WEIGHT = 65535;

/**
 * Of an array: its first byte, its rows, its columns, bytes a number, and the rule by which its numbers are foretold.
 * @typedef {[number, number, number, number, string]} PackedArray
 */

/**
 * @param {Uint8Array} packed
 * @param {PackedArray[]} arrays
 * @returns {Uint8Array<ArrayBuffer>} the bytes of avatar.gsac
 */
export function unpackArrays(packed, arrays) {
  const bytes = new Uint8Array(packed);
  for (const [start, rows, columns, width, rule] of arrays) {
    joinPlanes(bytes, packed, start, rows, columns, width);
    const Type = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[width];
    const numbers = new Type(bytes.buffer, start, rows * columns);
    if (rule === "rise") sumUp(numbers, columns);
    if (rule === "share") addShares(numbers, columns);
    if (rule === "turn") addTurns(numbers);
  }
  return bytes;
}

// Puts the bytes of each number together: in `packed` stands the first of all numbers, column after column, then the second.
function joinPlanes(bytes, packed, start, rows, columns, width) {
  let from = start;
  for (let b = 0; b < width; b++) {
    for (let c = 0; c < columns; c++) {
      for (let r = 0, to = start + c * width + b; r < rows; r++, to += columns * width) bytes[to] = packed[from++];
    }
  }
}

// 0, 1, 2, 3 stand for 0, -1, 1, -2.
function unfold(number) {
  return number >>> 1 ^ -(number & 1);
}

// To each number comes the one above it.
function sumUp(numbers, columns) {
  for (let i = 0; i < numbers.length; i++) numbers[i] = unfold(numbers[i]) + (i < columns ? 0 : numbers[i - columns]);
}

// To the first weight of each row comes what the others leave of the whole.
function addShares(weights, columns) {
  for (let i = 0; i < weights.length; i += columns) {
    let left = WHOLE_WEIGHT;
    for (let c = 1; c < columns; c++) left -= weights[i + c];
    weights[i] = unfold(weights[i]) + left;
  }
}

// To the length of each quaternion's first number, whose lowest bit is its sign, comes what the others leave of the whole.
function addTurns(quats) {
  for (let i = 0; i < quats.length; i += 4) {
    let left = WHOLE_QUAT ** 2;
    for (let c = 1; c < 4; c++) left -= (quats[i + c] << 16 >> 16) ** 2;
    const length = unfold(quats[i] >>> 1) + Math.floor(Math.sqrt(Math.max(left, 0)) + 0.5);
    quats[i] = quats[i] & 1 ? -length : length;
  }
}
