// The page's state, and the parts that draw it.

import * as api from './api.js';
import { CloudView, drawnBySoftware } from './cloud_view.js';
import { Colours } from './colour.js';
import * as geometry from './geometry.js';
import { help, onKey } from './help.js';
import { icons } from './icons.js';
import { Orbit } from './orbit.js';
import { metresFact } from './metres.js';
import { PicturePane, escape } from './picture_pane.js';
import { Player } from './player.js';
import { Run } from './run.js';
import { TargetList } from './table.js';
import { Timeline } from './timeline.js';
import { tip } from './tip.js';
import { showTraining } from './training.js';

const REACHES = [20, 40, 60, 80, 120, 250];
const $ = id => document.getElementById(id);

class App {
  constructor(session) {
    this.session = session;
    this.colours = new Colours(session);
    this.runs = session.runs.map((info, i) => new Run(i, info));
    this.frame = 0;
    /** The pictures' common zoom, and the position (0 to 1) at their centre. */
    this.view = { zoom: 1, x: 0.5, y: 0.5 };
    this.options = {
      picture: true, depth: true, cloud: true, list: true, boxes: true, tracks: true, labels: true, ground: true, edges: true, byTrack: false,
      surface: false, fade: false, difference: false, mode: 'picture', farthest: 60, pointScale: 1.1,
    };
    this.pointer = null;
    this.chosen = null;
    this.dirty = new Set();
    this.coarse = false;
    this.gaps = [];
    this.orbit = new Orbit(() => this.touch('scene'));
    this.player = new Player(this);
    this.timeline = new Timeline(this, $('lanes'));
    this.shownFrames = this.runs.map(() => null);
    this.software = drawnBySoftware();
    this.theme();
  }

  // Frames.

  /** The index in run `r` of the first run's frame `i`: the frame of the same name or, if no name is shared, of the same number. */
  placeOf(r, i) {
    if (r === 0) return i < this.runs[0].length ? i : undefined;
    const run = this.runs[r];
    const byName = run.places.get(this.runs[0].names[i]);
    if (byName !== undefined || this.sharesNames()) return byName;
    return i < run.length ? i : undefined;
  }

  sharesNames() {
    const versions = this.runs.map(r => r.version).join();
    if (this.sharedAt !== versions) {
      this.sharedAt = versions;
      this.shared = this.runs[0].names.some(name => this.runs[1]?.places.has(name));
    }
    return this.shared;
  }

  place(r) { return this.placeOf(r, this.frame); }

  /** The frame that run `r` shows now. */
  shown(r) { return this.shownFrames[r]; }

  /** Whether run `r` has no frame to show beside the first run's. */
  missing(r) { return r > 0 && this.runs[r].version > 0 && this.place(r) === undefined; }

  ready(i) {
    return this.runs.every((run, r) => {
      const place = this.placeOf(r, i);
      return place === undefined || run.has(place);
    });
  }

  /** Shows a frame that is loaded. */
  show(i) {
    this.frame = i;
    this.runs.forEach((run, r) => {
      const place = this.placeOf(r, i);
      this.shownFrames[r] = place === undefined ? null : run.at(place) ?? this.shownFrames[r];
      run.show(this.shownFrames[r]);
    });
    this.player.prefetch(i);
    this.touch('scene', 'time');
  }

  /** Goes to a frame. If it is not loaded, it is fetched, and shown if it is still wanted then. */
  async seek(i) {
    const n = this.runs[0].length;
    if (!n) return;
    const wanted = Math.max(0, Math.min(n - 1, i));
    this.frame = wanted;
    this.following = this.live && wanted === n - 1;
    this.touch('time');
    const frames = await Promise.all(this.runs.map((run, r) => {
      const place = this.placeOf(r, wanted);
      return place === undefined ? null : run.load(place);
    }));
    if (this.frame !== wanted) return;
    // A frame that could not be fetched is shown with its problem.
    this.shownFrames = frames.map(f => f ?? null);
    this.runs.forEach((run, r) => { run.show(this.shownFrames[r]); });
    if (frames.some(f => f?.lost)) this.lost = true;
    $('stage').setAttribute('aria-busy', 'false');
    this.player.prefetch(wanted);
    this.touch('scene', 'time');
  }

  step(by) {
    this.player.toggle(false);
    return this.seek(this.frame + by);
  }

  // The selected target and the pointer.

  point(pointer) {
    this.pointer = pointer;
    this.touch('marks');
  }

  /** The point of run `r`'s cloud under the pointer, in camera axes. */
  pointerPoint(r) {
    const metres = this.metresUnderPointer(r), frame = this.shown(r);
    if (!metres || !frame?.camera) return null;
    const k = frame.camera, { x, y, depth } = this.pixelUnderPointer(r);
    // Depth belongs to the pixel's centre.
    return geometry.backProject(geometry.resizedCamera(k, depth.width, depth.height), x, y, metres);
  }

  pixelUnderPointer(r) {
    const depth = this.shown(r)?.depth;
    if (!depth || !this.pointer) return null;
    return { x: Math.floor(this.pointer.u * depth.width), y: Math.floor(this.pointer.v * depth.height), depth };
  }

  metresUnderPointer(r) {
    const pixel = this.pixelUnderPointer(r);
    return pixel ? pixel.depth.at(pixel.x, pixel.y) : 0;
  }

  choose(run, target) {
    this.chosen = target && target.id !== undefined ? { run, id: target.id } : null;
    this.touch('scene');
  }

  isChosen(run, target) { return this.chosen !== null && this.chosen.run === run && this.chosen.id === target.id; }

  // What is shown.

  flip(option) {
    this.options[option] = !this.options[option];
    this.panes.forEach(p => { p.painted = null; p.legendState = null; });
    this.keep();
    this.tools();
    this.touch('scene', 'time');
  }

  pane(name) {
    this.options[name] = !this.options[name];
    if (!['picture', 'depth', 'cloud', 'list'].some(n => this.options[n])) this.options[name] = true;
    this.keep();
    this.build();
  }

  go(view) { this.orbit.go(view, this.shown(0)?.camera); }

  nextMode() {
    const modes = ['picture', 'depth', 'height'];
    this.options.mode = modes[(modes.indexOf(this.options.mode) + 1) % modes.length];
    this.keep();
    this.touch('scene');
  }

  reach(by) {
    const place = REACHES.indexOf(this.options.farthest) + by;
    this.options.farthest = REACHES[Math.max(0, Math.min(REACHES.length - 1, place))];
    this.touch('scene');
  }

  pointSize(by) {
    this.options.pointScale = Math.min(4, Math.max(0.3, this.options.pointScale * by));
    this.touch('scene');
  }

  resetViews() {
    Object.assign(this.view, { zoom: 1, x: 0.5, y: 0.5 });
    this.options.pointScale = 1.1;
    this.options.farthest = 60;
    this.go('chase');
  }

  repeat() {
    this.player.loop = !this.player.loop;
    this.touch('time');
  }

  nextTheme() {
    remember('theme', this.light ? 'dark' : 'light');
    this.theme();
  }

  theme() {
    this.light = (stored('theme') ?? (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark')) === 'light';
    document.documentElement.dataset.theme = this.light ? 'light' : 'dark';
    this.panes?.forEach(p => { p.state = null; p.legendState = null; });
    this.touch('scene', 'time');
  }

  keep() {
    const { picture, depth, cloud, list, ...rest } = this.options;
    remember('options', JSON.stringify({ ...rest, difference: false }));
    remember(`panes-${this.shape()}`, JSON.stringify({ picture, depth, cloud, list }));
  }

  /** Panes are stored separately for each kind of screen, and for one and two runs. */
  shape() { return `${narrow() ? 'narrow' : 'wide'}-${this.runs.length}`; }

  restore() {
    // Two clouds need the list's space.
    if (this.runs.length > 1) this.options.list = false;
    for (const key of ['options', `panes-${this.shape()}`]) {
      try {
        for (const [name, value] of Object.entries(JSON.parse(stored(key) ?? '{}'))) if (typeof value === typeof this.options[name]) this.options[name] = value;
      } catch { /* stored by another version */ }
    }
  }

  /** Lays the panes out. */
  build() {
    const stage = $('stage'), { options } = this, two = this.runs.length > 1;
    this.panes ??= [];
    for (const pane of this.panes) pane.element.remove();
    this.kinds ??= this.runs.map((_, r) => ({
      picture: new PicturePane(this, r, 'picture'), depth: new PicturePane(this, r, 'depth'), cloud: new CloudView(this, r), list: new TargetList(this, r),
    }));
    const column = parts => {
      const element = document.createElement('div');
      element.className = 'column';
      element.append(...parts.map(p => p.element));
      return element;
    };
    const flat = ['picture', 'depth'].filter(n => options[n]);
    const hasTargets = this.runs.some(r => r.series.targets?.some(v => v !== null));
    const showList = options.list && hasTargets && !(narrow() && two);
    const columns = [], cloudBelow = two || narrow();
    this.panes = [];
    this.kinds.forEach(kinds => {
      const left = flat.map(n => kinds[n]);
      if (showList && !two) left.push(kinds.list);
      if (two && options.cloud) left.push(kinds.cloud);
      if (two && showList) left.push(kinds.list);
      this.panes.push(...left);
      if (left.length) columns.push(column(left));
      if (!two && options.cloud) { columns.push(column([kinds.cloud])); this.panes.push(kinds.cloud); }
      // The pictures share the remaining space if nothing else takes it.
      const greedy = !showList && !(cloudBelow && options.cloud);
      left.forEach(pane => pane.element.classList.toggle('rest', greedy && pane.kind !== undefined));
    });
    stage.className = two ? 'two' : columns.length === 1 ? `one ${options.cloud && !flat.length && !showList ? 'deep' : 'flat'}` : 'one';
    stage.replaceChildren(...columns);
    this.tools();
    this.touch('scene', 'time');
  }

  tools() {
    const bar = $('tools'), { options } = this, two = this.runs.length > 1;
    const button = (text, pressed, act, title, wide) => {
      const made = Object.assign(document.createElement('button'), { onclick: act, title });
      if (icons[text]) { made.innerHTML = icons[text]; made.setAttribute('aria-label', title); } else made.textContent = text;
      if (pressed !== null) made.setAttribute('aria-pressed', String(pressed));
      if (wide) made.classList.add('wide');
      return made;
    };
    const gap = () => Object.assign(document.createElement('span'), { className: 'gap' });
    const hasTargets = this.runs.some(r => r.series.targets?.some(v => v !== null));
    const hasSigma = this.runs.some(r => r.hasSigma?.some(Boolean));
    bar.replaceChildren(...[
      button('Picture', options.picture, () => this.pane('picture'), 'Picture (P)'),
      button('Depth', options.depth, () => this.pane('depth'), 'Depth (D)'),
      button('Cloud', options.cloud, () => this.pane('cloud'), 'Cloud (C)'),
      hasTargets && button('List', options.list, () => this.pane('list'), 'List of targets (L)'),
      gap(),
      hasTargets && button('Boxes', options.boxes, () => this.flip('boxes'), 'Boxes (B)', true),
      hasTargets && button('Tracks', options.tracks, () => this.flip('tracks'), 'Tracks (T)', true),
      hasSigma && button('Fade', options.fade, () => this.flip('fade'), 'Fade uncertain pixels (U)'),
      two && button('Difference', options.difference, () => this.flip('difference'), 'Depth relative to the first run (X)'),
      gap(),
      button('theme', null, () => this.nextTheme(), 'Dark or light (Y)'),
      button('help', null, () => help(), 'Keys (?)'),
    ].filter(Boolean));
  }

  // Drawing, at most once per screen refresh.

  touch(...what) {
    for (const w of what) this.dirty.add(w);
    if (this.drawing) return;
    this.drawing = true;
    requestAnimationFrame(now => {
      this.drawing = false;
      if (this.dirty.has('scene')) this.pace(now);
      const scene = this.dirty.has('scene'), time = this.dirty.has('time');
      this.dirty.clear();
      this.draw(scene, time);
    });
  }

  /** Draws the cloud coarsely while the view moves faster than it can be drawn, and finely again once it rests. */
  pace(now) {
    const gap = now - (this.drawnAt ?? -Infinity);
    this.drawnAt = now;
    clearTimeout(this.resting);
    if (gap > (this.player.playing ? 3000 : 350)) this.gaps = [];
    else {
      if (this.software) this.coarse = true;
      // While playing, frames are due at intervals: only later ones are slow.
      const due = this.player.playing ? 1000 / (this.player.fps * this.player.rate) : 0;
      this.gaps = [...this.gaps, gap - due].slice(-5);
      if (this.gaps.length === 5 && this.gaps.reduce((a, b) => a + b) / 5 > 45) this.coarse = true;
    }
    if (this.coarse) this.resting = setTimeout(() => { this.coarse = false; this.drawnAt = undefined; this.touch('scene'); }, 500);
  }

  draw(scene, time) {
    // Pictures first, since they set the panes' shapes.
    for (const pane of this.panes ?? []) pane.draw(scene);
    if (scene) this.facts();
    if (time || scene) this.time();
    tip(this);
    this.drawnFrame = this.shown(0)?.name;
  }

  facts() {
    const frame = this.shown(0), perceived = frame?.perceived ?? {}, facts = [];
    const add = (name, value, state = '', less = '') => facts.push(`<span class="fact ${state} ${less}">${name} <b>${value}</b></span>`);
    const number = (v, digits, unit) => `${v.toFixed(digits)} ${unit}`.trim();
    if (Number.isFinite(perceived.speed_mps)) add('Speed', number(perceived.speed_mps, 1, 'm/s'));
    const ttc = perceived.time_to_collision_s;
    if (Number.isFinite(ttc)) add('Collision in', number(ttc, 1, 's'), ttc < 2 ? 'bad' : ttc < 4 ? 'warn' : '');
    const scale = perceived.scale_monitor ?? frame?.meta?.scale_monitor;
    if (scale && Number.isFinite(scale.ratio)) add('Scale', `${scale.ratio.toFixed(3)} ${scale.state ?? ''}`, scale.state === 'drift' ? 'bad' : scale.state === 'steady' ? 'good' : '');
    if (Number.isFinite(scale?.correction) && scale.correction !== 1) add('Corrected by', scale.correction.toFixed(3), 'warn');
    if (frame?.perceived) add('Targets', String(frame.targets.length), '', 'less');
    if (Number.isFinite(perceived.latency_ms)) add('Latency', number(perceived.latency_ms, 0, 'ms'), '', 'less');
    const metres = metresFact(frame?.meta);
    if (metres) add('Metres', ...metres);
    const html = facts.join('');
    if (html !== this.shownFacts) $('facts').innerHTML = this.shownFacts = html;
  }

  time() {
    const run = this.runs[0], { player } = this, name = run.names[this.frame] ?? '';
    this.timeline.draw();
    const playing = player.playing ? 'pause' : 'play';
    if ($('play').dataset.icon !== playing) {
      $('play').dataset.icon = playing;
      $('play').innerHTML = icons[playing];
    }
    $('rate').textContent = `${player.rate}×`;
    $('loop').setAttribute('aria-pressed', String(player.loop));
    $('place').innerHTML = run.length ? `<b>${this.frame + 1}</b><i> / ${run.length}&ensp;</i>${escape(name)}` : '';
    const time = run.series.time_s?.[this.frame];
    $('stamp').textContent = Number.isFinite(time) ? `${time.toFixed(2)} s` : '';
    $('live').hidden = !this.live;
    const note = this.lost ? 'the server does not answer; trying again' : run.failure ?? (player.playing && player.measured ? `${player.measured.toFixed(1)} frames/s` : '');
    $('note').textContent = note;
    $('note').classList.toggle('bad', Boolean(this.lost || run.failure));
    if (this.hashed !== name && this.shown(0) && !player.playing) {
      this.hashed = name;
      history.replaceState(null, '', `#${encodeURIComponent(name)}`);
    }
  }

  /** Which optional data exist, which decides the buttons. */
  shownOf() {
    return this.runs.map(r => [r.series.targets?.some(v => v !== null), r.hasSigma?.some(Boolean)].map(Boolean)).join();
  }

  // Growing folders.

  async watch() {
    try {
      const name = this.runs[0].names[this.frame], key = this.runs[0].key(this.frame), before = this.runs[0].length;
      const had = this.shownOf();
      const changed = (await Promise.all(this.runs.map(run => run.refresh()))).some(Boolean);
      const wasLost = this.lost;
      this.lost = false;
      if (changed) {
        const [run] = this.runs, grown = run.length > before && before > 0;
        if (grown) this.grownAt = performance.now();
        // Stay on the same frame, whatever its index is now; follow the newest if the last one was shown.
        const follow = grown && this.live && this.following;
        this.frame = follow ? run.length - 1 : run.places.get(name) ?? Math.min(this.frame, Math.max(0, run.length - 1));
        if (this.shownOf() !== had) this.build();
        if (follow || run.key(this.frame) !== key || this.runs.length > 1) this.seek(this.frame);
      } else if (wasLost) this.seek(this.frame);
      const live = this.grownAt !== undefined && performance.now() - this.grownAt < 15_000;
      if (live && !this.live) this.following = this.frame >= before - 1 && before > 0;
      this.live = live;
      if (changed || wasLost || live) this.touch('time');
    } catch (error) {
      this.lost = true;
      this.touch('time');
    }
    const soon = this.runs.some(run => run.pending > 0) ? 200 : this.live ? 1000 : 2000;
    setTimeout(() => this.watch(), document.hidden ? 5000 : soon);
  }

  async start() {
    // Read before the first drawing, which writes the frame into the address.
    const wanted = decodeURIComponent(location.hash.slice(1));
    await Promise.all(this.runs.map(run => run.refresh()));
    this.restore();
    if (narrow() && stored(`panes-${this.shape()}`) === null) {
      // A tall picture leaves no room for a second one and the cloud.
      const { size } = await api.frame(0, this.runs[0].names[0]).then(f => ({ size: f.intrinsics ?? { width: f.picture?.size[0], height: f.picture?.size[1] } })).catch(() => ({}));
      this.options.depth = !(size?.height > 0.55 * size?.width);
      this.options.list = false;
    }
    $('time').hidden = false;
    $('runs').innerHTML = this.runs.map((run, i) => `${this.runs.length > 1 ? `<i>${'AB'[i]}</i>` : ''}${escape(run.name)}`).join(' ');
    document.title = `${this.runs.map(r => r.name).join(' and ')}: DeepFusion`;
    $('title').title = this.runs.map(r => r.path).join('\n');
    for (const [id, act] of [
      ['first', () => this.step(-Infinity)], ['back', () => this.step(-1)], ['next', () => this.step(1)], ['last', () => this.step(Infinity)],
      ['play', () => this.player.toggle()],
    ]) {
      $(id).innerHTML = icons[id];
      $(id).onclick = act;
    }
    $('rate').onclick = () => this.player.nextRate();
    $('loop').onclick = () => this.repeat();
    addEventListener('keydown', e => {
      const typing = e.target.closest?.('input, select') || (document.getElementById('help').open && e.key !== '?');
      // A focused button keeps its own Space and Enter.
      if (typing || (e.key === ' ' && e.target.closest?.('button'))) return;
      if (onKey(this, e)) e.preventDefault();
    });
    // A clicked button loses the focus, so that it does not catch keys.
    addEventListener('click', e => { if (e.detail > 0) e.target.closest?.('button')?.blur(); });
    this.build();
    let wasNarrow = narrow();
    new ResizeObserver(() => {
      if (wasNarrow !== narrow()) { wasNarrow = narrow(); this.build(); } else this.touch('scene', 'time');
    }).observe($('stage'));
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () => this.theme());
    await this.seek(this.runs[0].places.get(wanted) ?? 0);
    // The pictures have given the panes their shapes: draw again with these.
    this.touch('scene', 'time');
    setTimeout(() => this.watch(), 300);
  }
}

const narrow = () => matchMedia('(max-width: 820px), (max-aspect-ratio: 3/4)').matches && !matchMedia('(max-height: 520px) and (orientation: landscape)').matches;

// Private windows may refuse to store anything.
function remember(key, value) { try { localStorage.setItem(`deepfusion-${key}`, value); } catch { /* not stored */ } }
function stored(key) { try { return localStorage.getItem(`deepfusion-${key}`); } catch { return null; } }

function message(title, text) {
  const element = document.createElement('div');
  element.className = 'message';
  element.innerHTML = `<div><b>${escape(title)}</b>${escape(text ?? '')}</div>`;
  $('stage').replaceChildren(element);
}

/** Interface for tests and the console. */
const hook = window.deepfusion = { ready: false, geometry };

try {
  const session = await api.session();
  if (session.runs[0].kind === 'training') {
    const app = new App(session);
    $('runs').textContent = session.runs.map(r => r.name).join(', ');
    app.options.list = false;
    $('tools').innerHTML = `<button title="Dark or light" aria-label="Dark or light">${icons.theme}</button>`;
    $('tools').firstChild.onclick = () => app.nextTheme();
    await showTraining($('stage'), session.runs);
  } else {
    hook.app = new App(session);
    await hook.app.start();
  }
  hook.ready = true;
} catch (error) {
  message('Cannot show this folder', error.message);
  hook.failure = error.message;
  throw error;
}
