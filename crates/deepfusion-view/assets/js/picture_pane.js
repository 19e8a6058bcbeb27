// A picture or a depth map, with boxes. A cross marks the pointer's position in every pane, and all pictures share one zoom.

import { NOTHING, css, ofTarget, themeColour, ticks } from './colour.js';
import { BOX_EDGES, FRONT_EDGES, boxCorners, project, projectEdge } from './geometry.js';
import { fit, gestures } from './gestures.js';

export class PicturePane {
  /** `kind` is `picture` or `depth`. */
  constructor(app, run, kind) {
    this.app = app;
    this.run = run;
    this.kind = kind;
    this.element = document.createElement('section');
    this.element.className = `pane picture ${kind}`;
    this.element.innerHTML = '<canvas></canvas><div class="caption"></div><div class="problem" hidden></div>';
    this.canvas = this.element.querySelector('canvas');
    this.caption = this.element.querySelector('.caption');
    this.problem = this.element.querySelector('.problem');
    if (kind === 'depth') {
      this.legend = document.createElement('canvas');
      this.legend.className = 'legend';
      this.element.append(this.legend);
    }
    this.sheet = document.createElement('canvas');
    this.painted = null;
    gestures(this.canvas, {
      hover: (x, y, touch) => this.hover(x, y, touch),
      leave: () => app.point(null),
      drag: (dx, dy, how) => { if (how.touch && app.view.zoom === 1) this.hover(how.x, how.y, true); else this.pan(dx, dy); },
      pinch: (factor, x, y, dx, dy) => { this.pan(dx, dy); this.zoom(factor, x, y); },
      wheel: (delta, x, y) => { this.zoom(Math.exp(-delta * 0.0022), x, y); this.hover(x, y, false); },
      tap: (x, y) => app.choose(run, this.targetAt(x, y)),
      double: () => { Object.assign(app.view, { zoom: 1, x: 0.5, y: 0.5 }); app.touch('marks'); },
    });
  }

  /** Width and height of what is shown; null if nothing is known. */
  size(frame) {
    if (this.kind === 'depth' && frame?.depth) return [frame.depth.width, frame.depth.height];
    if (this.kind === 'picture' && frame?.bitmap) return [frame.bitmap.width, frame.bitmap.height];
    const size = frame?.camera ?? frame?.depth;
    return size ? [size.width, size.height] : frame?.bitmap ? [frame.bitmap.width, frame.bitmap.height] : null;
  }

  /** The picture's position in the canvas, in CSS pixels. */
  layout() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const [w, h] = this.pixels ?? [16, 9];
    const scale = Math.min(width / w, height / h) * this.app.view.zoom;
    const { x, y } = this.app.view;
    // Centred if the picture is smaller than the pane.
    const left = w * scale <= width ? (width - w * scale) / 2 : Math.min(0, Math.max(width - w * scale, width / 2 - x * w * scale));
    const top = h * scale <= height ? (height - h * scale) / 2 : Math.min(0, Math.max(height - h * scale, height / 2 - y * h * scale));
    return { left, top, width: w * scale, height: h * scale, scale, pane: { width, height } };
  }

  hover(x, y, touch) {
    const at = this.layout(), u = (x - at.left) / at.width, v = (y - at.top) / at.height;
    const box = this.canvas.getBoundingClientRect();
    const inside = u >= 0 && u < 1 && v >= 0 && v < 1;
    this.app.point(inside ? { u, v, run: this.run, x: box.left + x, y: box.top + y, touch } : null);
    this.canvas.style.cursor = inside && this.targetAt(x, y) ? 'pointer' : '';
  }

  pan(dx, dy) {
    const at = this.layout(), view = this.app.view;
    this.recentre(at);
    view.x -= dx / at.width;
    view.y -= dy / at.height;
    this.clampCentre(at);
    this.app.touch('marks');
  }

  zoom(factor, x, y) {
    const before = this.layout(), view = this.app.view;
    const [u, v] = [(x - before.left) / before.width, (y - before.top) / before.height];
    view.zoom = Math.min(40, Math.max(1, view.zoom * factor));
    const after = this.layout();
    // The point under the pointer stays there.
    view.x = u - (x - before.pane.width / 2) / after.width;
    view.y = v - (y - before.pane.height / 2) / after.height;
    this.clampCentre(after);
    this.app.touch('marks');
  }

  /** Sets the view's centre to the one that is shown, if the requested one was beyond an edge. */
  recentre(at) {
    this.app.view.x = (at.pane.width / 2 - at.left) / at.width;
    this.app.view.y = (at.pane.height / 2 - at.top) / at.height;
  }

  clampCentre(at) {
    const clamp = (c, pane, size) => size <= pane ? 0.5 : Math.min(1 - pane / size / 2, Math.max(pane / size / 2, c));
    this.app.view.x = clamp(this.app.view.x, at.pane.width, at.width);
    this.app.view.y = clamp(this.app.view.y, at.pane.height, at.height);
  }

  targetAt(x, y) {
    const frame = this.app.shown(this.run);
    if (!frame?.camera || !this.app.options.boxes) return null;
    const at = this.layout(), k = frame.camera, hits = [];
    for (const target of frame.targets) {
      const points = boxCorners(target).map(c => project(k, c)).filter(Boolean);
      if (points.length < 8) continue;
      const us = points.map(p => at.left + (p[0] + 0.5) / k.width * at.width), vs = points.map(p => at.top + (p[1] + 0.5) / k.height * at.height);
      if (x >= Math.min(...us) && x <= Math.max(...us) && y >= Math.min(...vs) && y <= Math.max(...vs)) hits.push(target);
    }
    return hits.sort((a, b) => a.center_m[2] - b.center_m[2])[0] ?? null;
  }

  draw() {
    const { app, canvas } = this, frame = app.shown(this.run);
    const size = this.size(frame);
    if (size && String(size) !== String(this.pixels)) {
      this.pixels = size;
      this.element.style.aspectRatio = `${size[0]} / ${size[1]}`;
    }
    fit(canvas);
    const ctx = canvas.getContext('2d'), at = this.layout();
    ctx.setTransform(canvas.ratio, 0, 0, canvas.ratio, 0, 0);
    ctx.clearRect(0, 0, at.pane.width, at.pane.height);
    const source = this.source(frame);
    if (source) {
      // Large pixels are drawn sharp.
      ctx.imageSmoothingEnabled = at.scale * canvas.ratio < 3;
      ctx.imageSmoothingQuality = 'high';
      ctx.drawImage(source, at.left, at.top, at.width, at.height);
    }
    if (frame?.camera && app.options.boxes) this.drawBoxes(ctx, at, frame);
    if (app.pointer) this.drawCross(ctx, at);
    this.describe(frame);
    if (this.legend) this.drawLegend();
  }

  source(frame) {
    if (this.kind === 'picture') return frame?.bitmap;
    const depth = frame?.depth;
    if (!depth) return null;
    const other = this.app.options.difference && this.run > 0 ? this.app.shown(0)?.depth : null;
    const against = other && other.width === depth.width && other.height === depth.height ? other : null;
    const sigma = this.app.options.fade ? frame.sigma : null;
    const what = [depth, against, sigma];
    if (what.some((part, i) => this.painted?.[i] !== part)) {
      if (this.sheet.width !== depth.width || this.sheet.height !== depth.height || !this.pixelsOfSheet) {
        Object.assign(this.sheet, { width: depth.width, height: depth.height });
        this.pixelsOfSheet = new ImageData(depth.width, depth.height);
      }
      const pixels = new Uint32Array(this.pixelsOfSheet.data.buffer);
      if (against) depth.paintAgainst(against, pixels, this.app.colours.bySigned);
      else depth.paint(pixels, this.app.colours.bySteps);
      if (sigma) depth.fade(sigma, pixels, NOTHING);
      this.sheet.getContext('2d').putImageData(this.pixelsOfSheet, 0, 0);
      this.painted = what;
    }
    this.against = against;
    return this.sheet;
  }

  drawBoxes(ctx, at, frame) {
    const { app } = this, k = frame.camera, light = app.light, taken = [];
    const toPane = ([u, v]) => [at.left + (u + 0.5) / k.width * at.width, at.top + (v + 0.5) / k.height * at.height];
    ctx.lineJoin = ctx.lineCap = 'round';
    const nearFirst = [...frame.targets].sort((a, b) => a.center_m[2] - b.center_m[2]);
    const labels = [];
    for (const target of nearFirst.toReversed()) {
      const chosen = app.isChosen(this.run, target), corners = boxCorners(target);
      const colour = chosen ? themeColour('--accent') : ofTarget(target, app.options.byTrack, false);
      const strokes = new Path2D();
      for (const [a, b] of [...BOX_EDGES, ...FRONT_EDGES.slice(0, chosen ? 2 : 0)]) {
        const edge = projectEdge(k, corners[a], corners[b]);
        if (!edge) continue;
        strokes.moveTo(...toPane(edge[0]));
        strokes.lineTo(...toPane(edge[1]));
      }
      ctx.strokeStyle = 'rgb(0 0 0 / 0.45)';
      ctx.lineWidth = chosen ? 4 : 3;
      ctx.stroke(strokes);
      ctx.strokeStyle = css(colour);
      ctx.lineWidth = chosen ? 2.2 : 1.4;
      ctx.stroke(strokes);
      const points = corners.map(c => project(k, c)).filter(Boolean).map(toPane);
      if (points.length) labels.push({ target, colour, chosen, x: (Math.min(...points.map(p => p[0])) + Math.max(...points.map(p => p[0]))) / 2, y: Math.min(...points.map(p => p[1])) });
    }
    if (!app.options.labels) return;
    for (const label of labels.reverse().sort((a, b) => b.chosen - a.chosen)) drawLabel(ctx, label, taken, at.pane, light);
  }

  drawCross(ctx, at) {
    const { u, v } = this.app.pointer;
    const [x, y] = [at.left + u * at.width, at.top + v * at.height];
    for (const [style, width] of [['rgb(0 0 0 / 0.6)', 3], ['rgb(255 255 255 / 0.95)', 1.2]]) {
      ctx.strokeStyle = style;
      ctx.lineWidth = width;
      ctx.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        ctx.moveTo(x + dx * 4, y + dy * 4);
        ctx.lineTo(x + dx * 11, y + dy * 11);
      }
      ctx.stroke();
    }
  }

  describe(frame) {
    const { app } = this, run = app.runs[this.run];
    const name = app.runs.length > 1 ? `${'AB'[this.run]} ` : '';
    const size = this.pixels ? `${this.pixels[0]} × ${this.pixels[1]}` : '';
    const what = this.kind === 'picture' ? 'Picture' : this.against ? 'Depth, B relative to A' : 'Depth';
    const text = `${name}${what}<span>${app.runs.length > 1 ? escape(run.name) + ' ' : ''}${size}</span>`;
    if (text !== this.captioned) this.caption.innerHTML = this.captioned = text;
    const all = this.kind === 'picture'
      ? [frame?.imageProblem, ...(frame?.problems ?? []).filter(p => p !== frame.imageProblem && p !== frame.depthProblem)]
      : [frame?.depthProblem, frame && !frame.depth && !frame.depthProblem ? 'no depth for this frame' : null];
    if (app.missing(this.run)) all.unshift(`${run.name} has no frame of this name`);
    const problems = all.filter(Boolean);
    this.problem.hidden = problems.length === 0 || (app.hideProblems && !app.missing(this.run));
    this.problem.classList.toggle('bad', Boolean(this.kind === 'picture' ? frame?.imageProblem : frame?.depthProblem));
    const list = problems.join('\n');
    if (this.problem.textContent !== list) {
      this.problem.textContent = list;
      this.problem.style.whiteSpace = 'pre-line';
    }
  }

  drawLegend() {
    const canvas = this.legend, { app } = this;
    const state = `${fit(canvas)} ${canvas.width} ${app.light} ${Boolean(this.against)}`;
    if (state === this.legendState) return;
    this.legendState = `false ${canvas.width} ${app.light} ${Boolean(this.against)}`;
    const ctx = canvas.getContext('2d'), width = canvas.width / canvas.ratio;
    ctx.setTransform(canvas.ratio, 0, 0, canvas.ratio, 0, 0);
    ctx.clearRect(0, 0, width, 40);
    const left = 10, wide = width - 26;
    const stripe = (from, to, colour) => { ctx.fillStyle = css(colour); ctx.fillRect(left + from * wide, 0, (to - from) * wide + 0.7, 8); };
    const text = (t, x) => {
      ctx.font = '600 10px system-ui, sans-serif';
      ctx.textAlign = 'center';
      ctx.lineWidth = 3;
      ctx.strokeStyle = 'rgb(0 0 0 / 0.75)';
      ctx.strokeText(t, x, 19);
      ctx.fillStyle = '#fff';
      ctx.fillText(t, x, 19);
    };
    if (this.against) {
      for (let i = 0; i < 256; i++) stripe(i / 256, (i + 1) / 256, app.colours.diverging[i]);
      [['÷1.5', 0], ['=', 0.5], ['×1.5', 1]].forEach(([t, x]) => text(t, left + x * wide));
      return;
    }
    const { near_m, far_m } = app.colours.scale;
    for (let i = 0; i < 128; i++) stripe(i / 128, (i + 1) / 128, app.colours.scale.colours[2 * i]);
    // From the far end, whose label has the unit; labels that would touch the previous one are left out.
    let free = Infinity;
    for (const tick of ticks(near_m, far_m).reverse()) {
      const x = left + app.colours.place(tick) * wide;
      if (x > free) continue;
      text(tick === far_m ? `${tick} m` : String(tick), x);
      free = x - 26;
    }
  }
}

export const escape = text => text.replace(/[&<>"]/g, c => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]);

/** A target's short label: its number, metres, and its speed if it moves. */
export function labelOf(target) {
  const distance = target.distance_m ?? Math.hypot(...target.center_m);
  const speed = target.moving && target.velocity_mps ? `  ${Math.hypot(...target.velocity_mps).toFixed(1)} m/s` : '';
  return `${target.id ?? ''}  ${distance.toFixed(1)} m${speed}`.trim();
}

/** A label above a box, unless it would overlap another one. */
export function drawLabel(ctx, { target, colour, chosen, x, y }, taken, pane) {
  const text = labelOf(target);
  ctx.font = `${chosen ? 600 : 500} 11px system-ui, sans-serif`;
  const width = ctx.measureText(text).width + 10, height = 16;
  const left = Math.max(2, Math.min(pane.width - width - 2, x - width / 2)), top = Math.max(2, y - height - 3);
  if (x < -20 || x > pane.width + 20 || y > pane.height || y < -40) return;
  const overlaps = taken.some(t => left < t[0] + t[2] && left + width > t[0] && top < t[1] + height && top + height > t[1]);
  if (overlaps && !chosen) return;
  taken.push([left, top, width]);
  ctx.fillStyle = 'rgb(12 14 18 / 0.82)';
  ctx.beginPath();
  ctx.roundRect(left, top, width, height, 4);
  ctx.fill();
  ctx.fillStyle = css(colour);
  ctx.fillRect(left, top + 3, 2.5, height - 6);
  ctx.fillStyle = '#f2f4f7';
  ctx.textAlign = 'left';
  ctx.textBaseline = 'alphabetic';
  ctx.fillText(text, left + 6, top + 12);
}
