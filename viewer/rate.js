// How smoothly the page draws: frames a second over the last second, and the 95th percentile of the time between frames.

export class FrameRate {
  // Frames that the percentile is taken over.
  static KEPT = 300;

  constructor() {
    // When the last frames were drawn and the rate was last given, ms.
    /** @type {number[]} */
    this.times = [];
    this.told = 0;
  }

  // Counts a frame; now: ms. Returns {fps, p95}, p95 in ms, every quarter of a second, else null.
  frame(now) {
    const { times } = this;
    times.push(now);
    if (times.length > FrameRate.KEPT) times.shift();
    if (times.length < 3 || now - this.told < 250) return null;
    const recent = times.findIndex((t) => t > now - 1000), first = Math.min(Math.max(recent - 1, 0), times.length - 2);
    if (now === times[first]) return null; // a clock that stands still, as a screenshot's does
    this.told = now;
    const lengths = times.slice(1).map((t, i) => t - times[i]).sort((a, b) => a - b);
    return { fps: 1000 * (times.length - 1 - first) / (now - times[first]), p95: lengths[Math.ceil(0.95 * lengths.length) - 1] };
  }

  reset() {
    this.times.length = 0;
  }
}
