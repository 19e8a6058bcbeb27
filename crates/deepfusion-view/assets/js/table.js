// The frame's targets as a list.

import { css, ofTarget } from './colour.js';
import { escape } from './picture_pane.js';

const HEAD = '<tr><th>Track</th><th title="From the camera to the centre of the box">Distance</th><th title="Over ground">Speed</th><th title="Length × width × height">Size, m</th><th>Confidence</th></tr>';

export class TargetList {
  constructor(app, run) {
    this.app = app;
    this.run = run;
    this.element = document.createElement('section');
    this.element.className = 'list';
    this.element.addEventListener('click', e => {
      const row = e.target.closest('tr[data-i]'), target = row && this.rows?.[Number(row.dataset.i)];
      if (target) app.choose(run, app.isChosen(run, target) ? null : target);
    });
  }

  draw() {
    const { app } = this, frame = app.shown(this.run);
    const state = `${frame?.name} ${frame?.meta?.revision} ${app.chosen?.id} ${app.chosen?.run} ${app.options.byTrack} ${app.light}`;
    if (state === this.state) return;
    this.state = state;
    if (!frame?.perceived) {
      this.rows = [];
      this.element.innerHTML = '<div class="empty">No targets for this frame. <code>deepfusion perceive</code> finds them.</div>';
      return;
    }
    this.rows = [...frame.targets].sort((a, b) => distance(a) - distance(b));
    const rows = this.rows.map((t, i) => {
      const speed = Array.isArray(t.velocity_mps) ? Math.hypot(...t.velocity_mps) : null;
      const motion = t.moving === true ? 'moving' : t.moving === false ? 'static' : 'dim';
      const confidence = Number.isFinite(t.confidence) ? `${t.confidence.toFixed(2)}<span class="meter"><i style="width:${100 * Math.min(1, t.confidence)}%"></i></span>` : '–';
      const colour = css(ofTarget(t, app.options.byTrack, app.light));
      return `<tr data-i="${i}" class="${app.isChosen(this.run, t) ? 'chosen' : ''}"><td><i class="swatch" style="background:${colour}"></i>${escape(String(t.id ?? '–'))}</td>`
        + `<td>${distance(t).toFixed(1)} m</td><td class="${motion}">${speed === null ? '–' : t.moving === false ? 'static' : `${speed.toFixed(1)} m/s`}</td>`
        + `<td>${t.size_m.map(s => s.toFixed(1)).join(' × ')}</td><td>${confidence}</td></tr>`;
    });
    this.element.innerHTML = this.rows.length ? `<table><thead>${HEAD}</thead><tbody>${rows.join('')}</tbody></table>` : '<div class="empty">No targets in this frame.</div>';
  }
}

const distance = t => t.distance_m ?? Math.hypot(...t.center_m);
