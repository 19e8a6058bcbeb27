// A frame's depth: the file's own numbers.

/** Standard deviation over depth at which a pixel starts to fade, and at which it is invisible. */
export const FADE = [0.2, 0.6];

/** Opacity of a pixel: 1 where depth is certain, 0 where it is not. */
export function opacity(depth, sigma) {
  if (!(depth > 0 && sigma >= 0)) return 0;
  return Math.min(1, Math.max(0, (FADE[1] - sigma / depth) / (FADE[1] - FADE[0])));
}

/** Depth as the server sends it: "DFD1", width, height, code (0: u16 steps of 1/256 m; 1: f32 metres), values row by row. */
export class Depth {
  constructor(buffer) {
    const head = new DataView(buffer);
    if (buffer.byteLength < 16 || head.getUint32(0) !== 0x44464431) throw new Error('the server did not send a depth map');
    this.width = head.getUint32(4, true);
    this.height = head.getUint32(8, true);
    const steps = head.getUint32(12, true) === 0;
    this.values = steps ? new Uint16Array(buffer, 16) : new Float32Array(buffer, 16);
    this.perMetre = steps ? 256 : 1;
    if (this.values.length !== this.width * this.height) throw new Error('the depth map from the server is truncated');
    this.bytes = buffer.byteLength;
  }

  /** Metres at a pixel; 0 if it has no depth. */
  at(x, y) {
    if (!(x >= 0 && y >= 0 && x < this.width && y < this.height)) return 0;
    const value = this.values[Math.floor(y) * this.width + Math.floor(x)] / this.perMetre;
    return value > 0 && Number.isFinite(value) ? value : 0;
  }

  /** All metres, in a buffer that is reused. */
  metres() {
    if (this.perMetre === 1) return this.values;
    const out = scratchFloats(this.values.length);
    for (let i = 0; i < out.length; i++) out[i] = this.values[i] / 256;
    return out;
  }

  /** Colours of all pixels. */
  paint(pixels, table) {
    const values = this.values;
    if (this.perMetre === 256) {
      for (let i = 0; i < values.length; i++) pixels[i] = table[values[i]];
      return;
    }
    for (let i = 0; i < values.length; i++) {
      const step = values[i] * 256;
      // NaN and values that are not positive mean no depth; any depth is at least one step.
      pixels[i] = table[step > 0 ? Math.min(65535, Math.max(1, Math.round(step))) : 0];
    }
  }

  /** Fades uncertain pixels into `background` (r, g, b). */
  fade(sigma, pixels, background) {
    const channels = new Uint8ClampedArray(pixels.buffer), rescale = this.perMetre / sigma.perMetre;
    for (let i = 0; i < this.values.length; i++) {
      const alpha = opacity(this.values[i], sigma.values[i] * rescale);
      if (alpha === 1) continue;
      for (let c = 0; c < 3; c++) channels[4 * i + c] = background[c] + (channels[4 * i + c] - background[c]) * alpha;
    }
  }

  /** Colours of ln(this / other): `table`'s middle where they are equal, its ends from a factor of `most` on. */
  paintAgainst(other, pixels, table, most = 1.5) {
    const a = this.values, b = other.values, factor = 127.5 / Math.log(most), rescale = other.perMetre / this.perMetre;
    for (let i = 0; i < a.length; i++) {
      const ratio = a[i] / b[i] * rescale;
      const place = 127.5 + factor * Math.log(ratio);
      pixels[i] = table[a[i] > 0 && b[i] > 0 && Number.isFinite(ratio) ? Math.min(255, Math.max(0, Math.round(place))) : 256];
    }
  }
}

let floats = new Float32Array(0);
function scratchFloats(length) {
  if (floats.length !== length) floats = new Float32Array(length);
  return floats;
}
