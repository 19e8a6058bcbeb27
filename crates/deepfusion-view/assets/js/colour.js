// Colours of depth (on a logarithmic scale, as in the pictures that `predict` writes), of differences and of tracks.

/** The colour of pixels without depth. */
export const NOTHING = [40, 40, 44];
const packed = ([r, g, b]) => (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;

/** Prepares look-up tables from the session's colour tables. */
export class Colours {
  constructor(session) {
    this.scale = session.depth_scale;
    this.diverging = session.colours.diverging;
    // One entry per step of 1/256 m, so that a picture needs one look-up per pixel. Bytes in memory are r, g, b, a on all current machines.
    this.bySteps = new Uint32Array(65536);
    this.bySteps[0] = packed(NOTHING);
    for (let step = 1; step < 65536; step++) this.bySteps[step] = packed(this.ofDepth(step / 256));
    this.bySigned = new Uint32Array(257);
    for (let i = 0; i < 256; i++) this.bySigned[i] = packed(this.diverging[i]);
    this.bySigned[256] = packed(NOTHING);
  }

  /** Position of a depth on the scale: 0 near, 1 far. */
  place(metres) {
    const { near_m, far_m } = this.scale;
    return Math.min(1, Math.max(0, Math.log(metres / near_m) / Math.log(far_m / near_m)));
  }

  ofDepth(metres) {
    return metres > 0 ? this.scale.colours[Math.round(255 * this.place(metres))] : NOTHING;
  }

  /** A table of 256 colours for a texture: 0 near to 255 far. */
  depthTable() {
    const bytes = new Uint8Array(256 * 4);
    this.scale.colours.forEach((c, i) => bytes.set([...c, 255], 4 * i));
    return bytes;
  }
}

/** Round numbers from near to far for a legend. */
export function ticks(near, far) {
  const all = [];
  for (let power = -1; power <= 3; power++) for (const digit of [1, 2, 5]) all.push(digit * 10 ** power);
  const inside = all.filter(t => t >= near * 0.999 && t <= far * 1.001);
  if (far > 1.3 * inside.at(-1)) inside.push(far);
  return inside;
}

/** A track's colour: distant hues for consecutive ids. */
export function ofTrack(id, light) {
  const hue = (Number(id) * 137.508 + 20) % 360;
  return rgbOfHsl(hue, 0.75, light ? 0.38 : 0.64);
}

function rgbOfHsl(hue, saturation, lightness) {
  const a = saturation * Math.min(lightness, 1 - lightness);
  const channel = n => {
    const k = (n + hue / 30) % 12;
    return Math.round(255 * (lightness - a * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return [channel(0), channel(8), channel(4)];
}

/** A custom property of the page as r, g, b. */
export function themeColour(name) {
  const theme = document.documentElement.dataset.theme;
  if (known.theme !== theme) Object.assign(known, { theme, colours: new Map() });
  let colour = known.colours.get(name);
  if (!colour) known.colours.set(name, colour = lookUp(name));
  return colour;
}

const known = { theme: null, colours: new Map() };

function lookUp(name) {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const hex = /^#(..)(..)(..)$/.exec(text);
  return hex ? hex.slice(1).map(h => parseInt(h, 16)) : [128, 128, 128];
}

export const css = ([r, g, b], alpha = 1) => `rgb(${r} ${g} ${b} / ${alpha})`;

/** A target's colour: by its track, or by whether it is dynamic. */
export function ofTarget(target, byTrack, light) {
  if (byTrack) return ofTrack(target.id ?? 0, light);
  return themeColour(target.moving === true ? '--moving' : target.moving === false ? '--static' : '--unknown');
}
