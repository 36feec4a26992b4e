// Bytes as letters of a page: two of 91 letters hold 13 bits, in less room than base64. letters.py writes them.

/** @param {string} text */
export function decodeLetters(text) {
  // A letter's number: # to } in order, but ~ stands for < and ! for &.
  const values = Uint8Array.from({ length: 128 }, (_, code) => ({ 126: 60, 33: 38 }[code] ?? code) - 35);
  const letters = new TextEncoder().encode(text), pairs = letters.length >> 1, single = letters.length & 1;
  const bytes = new Uint8Array(pairs * 13 + single * 6 >> 3);
  let at = 0, held = 0, bits = 0;
  for (let i = 0; i < letters.length; i += 2) {
    const pair = i >> 1 < pairs;
    held |= values[letters[i]] + (pair ? 91 * values[letters[i + 1]] : 0) << bits;
    for (bits += pair ? 13 : 6; bits >= 8; bits -= 8, held >>>= 8) bytes[at++] = held;
  }
  return bytes;
}
