// A curve of an FBX animation: its keys and its value at a time between them, as the tools that write FBX draw it.

const FBX_CONSTANT = 0x2, FBX_CUBIC = 0x8;
// Of a constant key: its span has the next key's value.
const FBX_NEXT = 0x100;
// Where the slopes of a cubic key come from, and how those that are found are held back.
const FBX_TCB = 0x200, FBX_USER = 0x400, FBX_CLAMP = 0x1000, FBX_EVEN_TIME = 0x2000, FBX_PROGRESSIVE = 0x4000;
// How a curve goes on before its first and after its last key, by a letter's code; else it stays.
const FBX_ON = 75, FBX_AGAIN = 82, FBX_AGAIN_FROM_THERE = 65, FBX_TO_AND_FRO = 77;
const FBX_WEIGHT_RIGHT = 0x1000000, FBX_WEIGHT_NEXT_LEFT = 0x2000000;

/** @typedef {{how: number, count: number}} Beyond how a curve goes on beyond its keys, and how often; -1: for ever */

export class FbxCurve {
  /**
   * @param {ArrayLike<number>} times [K] s, ascending
   * @param {ArrayLike<number>} values [K]
   * @param {ArrayLike<number>} flags [A] of each run of keys that are alike
   * @param {Float32Array} data [A * 4] their slopes, 1/s, and weights
   * @param {ArrayLike<number>} runs [A] keys in each run
   * @param {Beyond[]} beyond before the first key and after the last one
   */
  constructor(times, values, flags, data, runs, beyond) {
    const K = times.length, weights = new Uint32Array(data.buffer);
    this.times = times;
    this.values = values;
    this.beyond = beyond;
    // Of the span after each key: its flags, the slopes at its two ends, and the length of its two handles as a share of it.
    this.flags = new Uint32Array(K);
    this.leaving = new Float64Array(K);
    this.arriving = new Float64Array(K);
    this.out = new Float64Array(K).fill(1 / 3);
    this.into = new Float64Array(K).fill(1 / 3);
    for (let k = 0, a = 0, left = runs[0]; k < K; k++, left--) {
      for (; left <= 0 && a + 1 < runs.length; left = runs[a]) a++;
      const flag = this.flags[k] = flags[a];
      if (flag & FBX_CONSTANT) continue;
      if (!(flag & FBX_CUBIC)) {
        this.leaving[k] = this.arriving[k] = this.slopes(k)[1];
        continue;
      }
      this.leaving[k] = data[4 * a];
      this.arriving[k] = data[4 * a + 1];
      if (flag & FBX_TCB) this.bend(k, data[4 * a], data[4 * a + 1], data[4 * a + 2]);
      if (flag & FBX_WEIGHT_RIGHT) this.out[k] = (weights[4 * a + 2] & 0xffff) / 1e4;
      if (flag & FBX_WEIGHT_NEXT_LEFT) this.into[k] = (weights[4 * a + 2] >>> 16) / 1e4;
      if (!(flag & (FBX_TCB | FBX_USER))) this.smooth(k);
    }
  }

  // Slopes from the key before and to the key after; 0 where there is none.
  slopes(k) {
    const { times, values } = this, slope = (a) => (a >= 0 && times[a + 1] > times[a]
      ? (values[a + 1] - values[a]) / (times[a + 1] - times[a]) : 0);
    return [slope(k - 1), slope(k)];
  }

  // A key with tension, continuity and bias.
  bend(k, tension, continuity, bias) {
    const [before, after] = this.slopes(k), inside = k > 0 && k + 1 < this.times.length, share = (inside ? 0.5 : 1) * (1 - tension);
    const slope = (c) => share * ((1 + bias) * (1 - c) * before + (1 - bias) * (1 + c) * after);
    this.leaving[k] = slope(-continuity);
    this.arriving[k] = 0;
    if (k) this.arriving[k - 1] = slope(continuity);
  }

  // A key whose slopes are found from its neighbours. What the file has for them leans them to one side, in percent.
  smooth(k) {
    const lean = this.leaving[k];
    this.leaving[k] = this.smoothSlope(k, lean);
    if (k) this.arriving[k - 1] = this.smoothSlope(k, -this.arriving[k - 1]);
  }

  smoothSlope(k, lean) {
    const { times, values } = this, flag = this.flags[k], [before, after] = this.slopes(k);
    const steps = [k - 1, k + 1].filter((other) => other >= 0 && other < times.length && times[other] !== times[k]);
    if (flag & FBX_CLAMP && steps.some((other) => values[other] === values[k])) return 0;
    if (steps.length < 2) return flag & FBX_PROGRESSIVE ? 0 : before + after;
    const span = times[k + 1] - times[k - 1];
    let slope = (values[k + 1] - values[k - 1]) / span;
    if (!(flag & FBX_EVEN_TIME)) {
      const place = (times[k] - times[k - 1]) / span, weight = Math.abs(lean) / 100;
      slope = (slope + before * (1 - place) + after * place) / 2;
      if (weight > 1e-4) slope += weight * ((lean > 0 ? after : before) - slope);
    }
    if (!(flag & FBX_PROGRESSIVE)) return slope;
    // No handle goes beyond a neighbour's value.
    const sign = slope >= 0 ? 1 : -1, limit = (rise, handle) => Math.max(handle > 0 ? sign * rise / handle : 0, 0);
    return sign * Math.min(sign * slope, limit(before, this.into[k - 1]), limit(after, this.out[k]));
  }

  // The value at a time, s.
  at(time) {
    const { times, values } = this, last = times.length - 1;
    if (time < times[0] || time > times[last]) return this.outside(time);
    if (time === times[last]) return values[last];
    let k = 0;
    for (let high = last; high - k > 1;) {
      const middle = (k + high) >> 1;
      if (times[middle] <= time) k = middle;
      else high = middle;
    }
    const flag = this.flags[k], from = values[k], to = values[k + 1];
    if (flag & FBX_CONSTANT) return flag & FBX_NEXT && time > times[k] ? to : from;
    const span = times[k + 1] - times[k], share = (time - times[k]) / span;
    if (!(flag & FBX_CUBIC)) return from + share * (to - from);
    const t = bezierShare(this.out[k], 1 - this.into[k], share), u = 1 - t;
    return u * u * u * from + 3 * u * u * t * (from + this.leaving[k] * this.out[k] * span)
      + 3 * u * t * t * (to - this.arriving[k] * this.into[k] * span) + t * t * t * to;
  }

  // The value before the first key or after the last one.
  outside(time) {
    const { times, values } = this, last = times.length - 1, early = time < times[0], edge = early ? 0 : last;
    const { how, count } = this.beyond[early ? 0 : 1], length = times[last] - times[0], far = Math.abs(time - times[edge]);
    const slope = early ? this.leaving[0] : this.arriving[Math.max(last - 1, 0)];
    if (how === FBX_ON) return values[edge] + (time - times[edge]) * slope;
    if (![FBX_AGAIN, FBX_AGAIN_FROM_THERE, FBX_TO_AND_FRO].includes(how) || !count || !(length > 0)) return values[edge];
    let round = Math.floor(far / length), rest = far - round * length;
    if (count > 0 && round >= count) {
      round = count - 1;
      rest = length;
    }
    if ((how === FBX_TO_AND_FRO && round % 2 === 0) !== early) rest = length - rest;
    const shift = how === FBX_AGAIN_FROM_THERE ? (round + 1) * (values[last] - values[0]) : 0;
    return this.at(Math.min(times[0] + Math.max(rest, 0), times[last])) + (early ? -shift : shift);
  }
}

// t in 0..1 at which the cubic Bezier of 0, a, b, 1 has the value x.
function bezierShare(a, b, x) {
  if (Math.abs(a - 1 / 3) < 1e-4 && Math.abs(b - 2 / 3) < 1e-4) return x;
  let low = 0, high = 1;
  for (let k = 0; k < 40; k++) {
    const t = (low + high) / 2, u = 1 - t;
    if (3 * u * u * t * a + 3 * u * t * t * b + t * t * t < x) low = t;
    else high = t;
  }
  return (low + high) / 2;
}
