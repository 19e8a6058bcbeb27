// Plays frames at their recorded times, each only once it is loaded, and fetches the next ones ahead.

const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const AT_ONCE = 4;

export class Player {
  constructor(app) {
    this.app = app;
    this.playing = false;
    this.rate = 1;
    this.loop = false;
    /** Times at which frames were shown, for the measured frame rate. */
    this.shownAt = [];
    this.waited = 0;
  }

  /** Frames per second of the recording; 10 if no times are known. */
  get fps() {
    const times = this.app.runs[0].series.time_s ?? [];
    if (this.timesOf !== times) {
      this.timesOf = times;
      const gaps = [];
      for (let i = 1; i < times.length; i++) if (times[i] !== null && times[i - 1] !== null && times[i] > times[i - 1]) gaps.push(times[i] - times[i - 1]);
      gaps.sort((a, b) => a - b);
      this.known = gaps.length ? Math.min(120, Math.max(0.2, 1 / gaps[gaps.length >> 1])) : 10;
    }
    return this.known;
  }

  toggle(on = !this.playing) {
    const { app } = this;
    this.playing = on;
    if (on && app.frame >= app.runs[0].length - 1) app.seek(0);
    this.due = performance.now() + 1000 / (this.fps * this.rate);
    this.shownAt = [];
    if (on) requestAnimationFrame(now => this.tick(now));
    app.touch('time');
  }

  faster(by) {
    const place = RATES.indexOf(this.rate) + by;
    this.rate = RATES[Math.max(0, Math.min(RATES.length - 1, place))];
    this.app.touch('time');
  }

  /** The next faster rate; after the fastest useful one, the slowest. */
  nextRate() {
    this.rate = this.rate >= 4 ? 0.25 : RATES.find(rate => rate > this.rate);
    this.app.touch('time');
  }

  tick(now) {
    if (!this.playing) return;
    requestAnimationFrame(later => this.tick(later));
    const { app } = this, period = 1000 / (this.fps * this.rate), n = app.runs[0].length;
    if (now < this.due) return;
    let next = app.frame + 1;
    if (next >= n) {
      if (!this.loop) { if (!app.live) this.toggle(false); return; }
      next = 0;
    }
    if (!app.ready(next)) { this.waited++; this.prefetch(app.frame); return; }
    // In step with the clock, but without catching up after a wait.
    this.due = Math.max(this.due + period, now - period);
    app.show(next);
    this.shownAt.push(now);
    while (this.shownAt[0] < now - 1500) this.shownAt.shift();
  }

  /** Frames per second that are actually shown. */
  get measured() {
    const shown = this.shownAt;
    return shown.length > 2 ? 1000 * (shown.length - 1) / (shown.at(-1) - shown[0]) : null;
  }

  /** Fetches the next frames, the nearest first, a few at once. */
  prefetch(from) {
    const { app } = this;
    for (const [number, run] of app.runs.entries()) {
      const shown = app.shown(number), room = shown?.bytes > 5000 ? Math.floor(run.frames.most / 3 / shown.bytes) : 4;
      const ahead = Math.max(1, Math.min(this.playing ? 16 : 3, room));
      for (let step = 1; step <= ahead && run.coming.size < AT_ONCE; step++) {
        let next = from + step;
        if (next >= app.runs[0].length) { if (!this.loop) break; next -= app.runs[0].length; }
        const place = app.placeOf(number, next);
        if (place === undefined || run.has(place) || run.coming.has(run.key(place))) continue;
        run.load(place).then(() => { app.touch('time'); this.prefetch(app.frame); });
      }
    }
  }
}
