// The time line: a lane for each number of the frames, the loaded frames, and the playhead.

import { css, themeColour } from './colour.js';
import { fit } from './gestures.js';

const LANES = [
  { key: 'speed_mps', text: 'Speed', unit: 'm/s', low: 0 },
  { key: 'nearest_m', text: 'Nearest target', unit: 'm', low: 0 },
  { key: 'time_to_collision_s', text: 'Time to collision', unit: 's', low: 0, most: 12 },
  { key: 'scale_ratio', text: 'Scale ratio', unit: '', around: 1 },
  { key: 'targets', text: 'Targets', unit: '', low: 0 },
  { key: 'latency_ms', text: 'Latency', unit: 'ms', low: 0 },
  { key: 'near_m', text: 'Nearest depth', unit: 'm', low: 0 },
  { key: 'far_m', text: 'Farthest depth', unit: 'm', low: 0 },
];

export class Timeline {
  constructor(app, canvas) {
    this.app = app;
    this.canvas = canvas;
    const seek = e => app.seek(this.frameAt(e.clientX));
    canvas.addEventListener('pointerdown', e => {
      try { canvas.setPointerCapture(e.pointerId); } catch { /* a synthetic event */ }
      this.dragging = true;
      seek(e);
    });
    canvas.addEventListener('pointermove', e => {
      this.over = this.frameAt(e.clientX);
      if (this.dragging) seek(e);
      else app.touch('time');
    });
    for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, () => { this.dragging = false; });
    canvas.addEventListener('pointerleave', () => { this.over = null; app.touch('time'); });
    canvas.addEventListener('wheel', e => { e.preventDefault(); app.step(Math.sign(e.deltaY || e.deltaX)); }, { passive: false });
  }

  frameAt(clientX) {
    const box = this.canvas.getBoundingClientRect(), n = this.app.runs[0].length;
    const place = (clientX - box.left - this.gutter) / Math.max(1, box.width - this.gutter - 8);
    return Math.max(0, Math.min(n - 1, Math.floor(place * n)));
  }

  /** Lanes that have numbers, as many as fit. */
  lanes(room) {
    const { series } = this.app.runs[0];
    if (this.lanesOf !== series) {
      this.lanesOf = series;
      this.all = LANES.filter(lane => series[lane.key]?.some(v => v !== null));
    }
    return this.all.slice(0, Math.max(1, Math.floor(room / 19)));
  }

  draw() {
    const { app, canvas } = this, n = app.runs[0].length;
    fit(canvas);
    const ctx = canvas.getContext('2d'), width = canvas.width / canvas.ratio, height = canvas.height / canvas.ratio;
    ctx.setTransform(canvas.ratio, 0, 0, canvas.ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const narrow = width < 700;
    this.gutter = narrow ? 8 : 164;
    if (!n) return;
    const [text, dim, line, accent] = ['--text', '--dim', '--line', '--accent'].map(c => css(themeColour(c)));
    const span = width - this.gutter - 8, x = i => this.gutter + (i + 0.5) / n * span;
    const foot = height - 14, lanes = this.lanes(foot - 4), tall = (foot - 4) / Math.max(1, lanes.length);
    lanes.forEach((lane, row) => {
      const top = 3 + row * tall;
      ctx.fillStyle = line;
      ctx.fillRect(this.gutter, Math.round(top + tall) - 1, span, 0.5);
      this.drawLane(ctx, lane, top, tall, x, span, n, narrow, { text, dim, accent });
    });
    this.drawFoot(ctx, foot, x, span, n, { dim, line, accent });
    const at = x(app.frame);
    ctx.fillStyle = css(themeColour('--text'), 0.9);
    ctx.fillRect(at - 0.75, 0, 1.5, height - 9);
    ctx.beginPath();
    ctx.moveTo(at - 5, 0);
    ctx.lineTo(at + 5, 0);
    ctx.lineTo(at, 7);
    ctx.fill();
    if (this.over !== null && this.over !== undefined && this.over < n) {
      ctx.fillStyle = css(themeColour('--text'), 0.25);
      ctx.fillRect(x(this.over) - 0.5, 0, 1, height);
    }
    canvas.setAttribute('aria-valuemax', String(n));
    canvas.setAttribute('aria-valuenow', String(app.frame + 1));
    canvas.setAttribute('aria-valuetext', app.runs[0].names[app.frame] ?? '');
  }

  drawLane(ctx, lane, top, tall, x, span, n, narrow, colours) {
    const { app } = this, values = app.runs.map(run => run.series[lane.key] ?? []);
    const all = values.flat().filter(v => v !== null);
    let low = lane.low ?? Math.min(...extent(all)), high = Math.min(lane.most ?? Infinity, extent(all)[1]);
    if (lane.around) {
      const off = Math.max(0.05, ...extent(all).map(v => Math.abs(v - lane.around)));
      [low, high] = [lane.around - off, lane.around + off];
    }
    if (!(high > low)) high = low + 1;
    const y = v => top + tall - 3 - (Math.min(high, Math.max(low, v)) - low) / (high - low) * (tall - 6);
    values.forEach((column, run) => {
      ctx.strokeStyle = run ? css(themeColour('--warn')) : colours.accent;
      ctx.fillStyle = css(themeColour(run ? '--warn' : '--accent'), 0.13);
      ctx.lineWidth = 1.2;
      // If there are more frames than pixels, each column of pixels shows its lowest and highest value.
      const step = Math.max(1, Math.ceil(n / (span * 1.5)));
      const path = new Path2D(), area = new Path2D();
      let open = null;
      for (let i = 0; i < n; i += step) {
        const piece = [];
        for (let j = i; j < Math.min(n, i + step); j++) {
          const at = run ? app.placeOf(run, j) : j;
          if (at !== undefined && column[at] !== null && column[at] !== undefined) piece.push(column[at]);
        }
        if (!piece.length) {
          if (open !== null) area.lineTo(open, top + tall - 1);
          open = null;
          continue;
        }
        const [least, most] = extent(piece), here = x(Math.min(n - 1, i + (step - 1) / 2));
        if (open === null) {
          path.moveTo(here, y(least));
          area.moveTo(here, top + tall - 1);
        } else path.lineTo(here, y(least));
        area.lineTo(here, y(most));
        if (most > least) path.lineTo(here, y(most));
        open = here;
      }
      if (open !== null) area.lineTo(open, top + tall - 1);
      if (!run) ctx.fill(area);
      ctx.stroke(path);
    });
    const now = values[0][this.over ?? app.frame];
    const value = now === null || now === undefined ? '–' : `${now.toFixed(Math.abs(now) < 10 ? (lane.key === 'targets' ? 0 : 2) : lane.key === 'targets' ? 0 : 1)}${lane.unit ? ' ' + lane.unit : ''}`;
    ctx.textBaseline = 'middle';
    ctx.font = '10.500px system-ui, sans-serif';
    ctx.textAlign = 'left';
    if (narrow) {
      ctx.font = '600 10.500px system-ui, sans-serif';
      const both = `${lane.text}  ${value}`;
      ctx.lineWidth = 3;
      ctx.strokeStyle = css(themeColour('--panel'), 0.85);
      ctx.strokeText(both, 10, top + 8);
      ctx.fillStyle = colours.text;
      ctx.fillText(both, 10, top + 8);
    } else {
      ctx.fillStyle = colours.dim;
      ctx.fillText(lane.text, 10, top + tall / 2);
      // The text must end before the lanes begin.
      ctx.fillStyle = colours.text;
      ctx.textAlign = 'right';
      const free = this.gutter - 14 - ctx.measureText(lane.text).width - 6;
      if (ctx.measureText(value).width <= free) ctx.fillText(value, this.gutter - 8, top + tall / 2);
    }
    ctx.textBaseline = 'alphabetic';
  }

  drawFoot(ctx, foot, x, span, n, { dim, line, accent }) {
    const { app } = this, run = app.runs[0], step = Math.max(1, Math.ceil(n / span)), wide = Math.max(1, span / n * step + 0.3);
    ctx.fillStyle = line;
    ctx.fillRect(this.gutter, foot, span, 3);
    for (let i = 0; i < n; i += step) {
      let [loaded, bad, moving] = [false, false, false];
      for (let j = i; j < Math.min(n, i + step); j++) {
        loaded ||= run.has(j);
        bad ||= Boolean(run.series.problem?.[j]);
        moving ||= run.series.scale_state?.[j] === 'drift';
      }
      const left = x(i) - span / n / 2;
      if (loaded) { ctx.fillStyle = accent; ctx.fillRect(left, foot, wide, 3); }
      if (moving) { ctx.fillStyle = css(themeColour('--warn')); ctx.fillRect(left, foot + 3, wide, 2); }
      if (bad) { ctx.fillStyle = css(themeColour('--bad')); ctx.fillRect(left, foot - 3, Math.max(2, wide), 8); }
    }
    ctx.font = '9.500px system-ui, sans-serif';
    ctx.fillStyle = dim;
    const every = niceStep(n / Math.max(2, span / 90));
    const times = run.series.time_s ?? [], begin = times.find(t => t !== null);
    for (let i = 0; i < n; i += every) {
      const label = times[i] !== null && times[i] !== undefined ? `${(times[i] - begin).toFixed(1)} s` : String(i + 1);
      ctx.textAlign = i === 0 ? 'left' : 'center';
      ctx.fillText(label, i === 0 ? this.gutter : x(i), foot + 13);
    }
  }
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const v of values) { if (v < low) low = v; if (v > high) high = v; }
  return [low, high];
}

function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(Math.max(1, rough)));
  return [1, 2, 5, 10].map(d => d * power).find(s => s >= rough) ?? power;
}
