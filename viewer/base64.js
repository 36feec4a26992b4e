// Base64, as it stands in the page and in files.

/**
 * The bytes of a text; throws where it is not base64.
 * @param {string} text
 */
export function decodeBase64(text) {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}
