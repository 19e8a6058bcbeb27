// The viewpoint of the cloud, which orbits about a point. Both runs share it.

import { lookAt, multiply, perspective } from './geometry.js';

const VIEWS = {
  chase: { target: [0, 0.3, 15], distance: 25, yaw: 0, pitch: 0.36, fov: 0.9 },
  top: { target: [0, 0, 26], distance: 62, yaw: 0, pitch: 1.5, fov: 0.9 },
  side: { target: [0, 0.5, 20], distance: 38, yaw: 1.15, pitch: 0.32, fov: 0.9 },
};

export class Orbit {
  constructor(changed) {
    this.changed = changed;
    this.set(VIEWS.chase, 'chase');
  }

  set(view, name) {
    this.name = name;
    Object.assign(this, structuredClone(view));
  }

  /** A named view, reached in a fifth of a second; `eye` is the camera's own. */
  go(name, camera) {
    let view = VIEWS[name];
    if (name === 'eye') {
      const fov = camera ? 2 * Math.atan(camera.height / 2 / camera.fy) : 0.9;
      view = { target: [0, 0, 12], distance: 12, yaw: 0, pitch: 0, fov: Math.min(1.6, fov * 1.04) };
    }
    this.glide(view, name);
  }

  /** Orbits about another point. */
  focus(point) { this.glide({ target: point, distance: Math.min(this.distance, 18), yaw: this.yaw, pitch: this.pitch, fov: this.fov }, 'free'); }

  glide(to, name) {
    const from = { target: [...this.target], distance: this.distance, yaw: this.yaw, pitch: this.pitch, fov: this.fov };
    const begin = performance.now(), turn = (this.turn = (this.turn ?? 0) + 1);
    const quick = matchMedia('(prefers-reduced-motion: reduce)').matches;
    const step = () => {
      if (turn !== this.turn) return;
      const t = quick ? 1 : Math.min(1, (performance.now() - begin) / 220), s = t * t * (3 - 2 * t);
      const mix = (a, b) => a + (b - a) * s;
      this.set({
        target: from.target.map((c, i) => mix(c, to.target[i])), distance: Math.exp(mix(Math.log(from.distance), Math.log(to.distance))),
        yaw: mix(from.yaw, to.yaw), pitch: mix(from.pitch, to.pitch), fov: mix(from.fov, to.fov),
      }, name);
      this.changed();
      if (t < 1) requestAnimationFrame(step);
    };
    step();
  }

  rotate(dx, dy) {
    this.stop();
    this.yaw -= dx * 0.0055;
    this.pitch = Math.min(1.54, Math.max(-0.4, this.pitch + dy * 0.0055));
    this.changed();
  }

  pan(dx, dy, height) {
    this.stop();
    const { right, above } = this.axes(), scale = 2 * this.distance * Math.tan(this.fov / 2) / height;
    for (let i = 0; i < 3; i++) this.target[i] += (-dx * right[i] + dy * above[i]) * scale;
    this.changed();
  }

  zoom(factor) {
    this.stop();
    this.distance = Math.min(400, Math.max(0.4, this.distance * factor));
    this.changed();
  }

  stop() {
    this.turn = (this.turn ?? 0) + 1;
    this.name = 'free';
  }

  /** Position of the eye, in camera axes. At pitch 0 it looks horizontally, at 90° straight down; at yaw 0 along z. */
  eye() {
    const flat = Math.cos(this.pitch) * this.distance;
    return [
      this.target[0] - Math.sin(this.yaw) * flat, this.target[1] - Math.sin(this.pitch) * this.distance, this.target[2] - Math.cos(this.yaw) * flat,
    ];
  }

  axes() {
    const view = lookAt(this.eye(), this.target, [0, -1, 0]);
    return { right: [view[0], view[4], view[8]], above: [view[1], view[5], view[9]] };
  }

  viewProjection(aspect) {
    // In a tall window the field of view applies to the width; otherwise only a slit would be visible.
    const fov = aspect < 1 && this.name !== 'eye' ? 2 * Math.atan(Math.tan(this.fov / 2) / Math.max(aspect, 0.55)) : this.fov;
    return multiply(perspective(fov, aspect, 0.1, 600), lookAt(this.eye(), this.target, [0, -1, 0]));
  }
}
