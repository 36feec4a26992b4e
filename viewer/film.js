// Pictures of the canvas as it is seen: one as PNG, or a film of what moves.

// What a browser may write, the best first.
const FILM_TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
const FILM_FPS = 30;
const BITS_PER_S = 8e6;

/**
 * @param {import("./viewer.js").Viewer} viewer
 * @returns {Promise<Blob>} the picture as PNG
 */
export function takePicture(viewer) {
  viewer.draw();
  return new Promise((done, fail) => {
    viewer.canvas.toBlob((blob) => (blob ? done(blob) : fail(new Error("the browser gave no picture"))), "image/png");
  });
}

/**
 * Begins a film of what is seen. It ends by `stop`.
 * @param {import("./viewer.js").Viewer} viewer
 * @returns {{stop: () => void, done: Promise<Blob>}} done: the film, as WebM where the browser writes it, else as MP4
 */
export function beginFilm(viewer) {
  const type = globalThis.MediaRecorder && FILM_TYPES.find((kind) => MediaRecorder.isTypeSupported(kind));
  if (!type || !viewer.canvas.captureStream) throw new Error("this browser writes no films; take pictures, or use `gsac render`");
  const stream = viewer.canvas.captureStream(FILM_FPS);
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: BITS_PER_S });
  const parts = [];
  const done = new Promise((end, fail) => {
    recorder.addEventListener("dataavailable", (e) => parts.push(e.data));
    recorder.addEventListener("error", () => fail(new Error("the browser could not go on with the film")));
    recorder.addEventListener("stop", () => end(new Blob(parts, { type: type.split(";")[0] })));
  }).finally(() => {
    viewer.filmed = false;
    for (const track of stream.getTracks()) track.stop();
  });
  recorder.start(500);
  viewer.filmed = true;
  return { stop: () => recorder.state !== "inactive" && recorder.stop(), done };
}
