// The lines of the 3D view: rings on the ground, the camera, boxes, velocities, tracks.

import { ofTarget, ofTrack, themeColour } from './colour.js';
import { BOX_EDGES, FRONT_EDGES, boxCorners, cross, dot, inverseMotion, move, unit } from './geometry.js';

const RINGS = [5, 10, 20, 30, 40, 60, 80];
/** How many frames back a track is drawn. */
export const TRACK_FRAMES = 48;

/** Segments for the line shader: from, to, colour, width. */
export class Lines {
  constructor() {
    this.data = new Float32Array(11 * 1024);
    this.count = 0;
  }

  clear() { this.count = 0; }

  add(a, b, [red, green, blue], alpha = 1, width = 1.4) {
    if (11 * (this.count + 1) > this.data.length) {
      const larger = new Float32Array(2 * this.data.length);
      larger.set(this.data);
      this.data = larger;
    }
    this.data.set([a[0], a[1], a[2], b[0], b[1], b[2], red / 255, green / 255, blue / 255, alpha, width], 11 * this.count++);
  }
}

/** The frame's ground as {normal, offset, foot, ahead, right}: the detected one, or a level one below the camera. */
export function groundOf(frame) {
  const said = frame?.perceived?.ground;
  let normal = [0, -1, 0], offset = 1.6, measured = false;
  if (Array.isArray(said?.normal) && said.normal.length === 3 && Number.isFinite(said.offset_m)) {
    const n = Math.hypot(...said.normal);
    // The normal points up; y points down.
    const sign = said.normal[1] > 0 ? -1 : 1;
    if (n > 0) [normal, offset, measured] = [said.normal.map(c => sign * c / n), sign * said.offset_m / n, true];
  } else {
    offset = heightBelow(frame) ?? 1.6;
  }
  const foot = normal.map(c => -offset * c);
  const ahead = unit([0, 0, 1].map((c, i) => c - normal[2] * normal[i]));
  return { normal, offset, foot, ahead, right: cross(ahead, normal).map(c => -c), measured };
}

/** Metres from the camera down to the ground in front of it: the median y in the middle of the lowest rows. */
function heightBelow(frame) {
  const depth = frame?.depth, camera = frame?.cameraOfDepth;
  if (!depth || !camera) return null;
  const ys = [];
  for (let y = Math.floor(depth.height * 0.82); y < depth.height * 0.97; y += 3) {
    for (let x = Math.floor(depth.width * 0.35); x < depth.width * 0.65; x += 5) {
      const d = depth.at(x, y);
      if (d > 0) ys.push((y - camera.cy) / camera.fy * d);
    }
  }
  ys.sort((a, b) => a - b);
  const middle = ys[ys.length >> 1];
  return middle > 0.2 && middle < 6 ? middle : null;
}

const along = (ground, ahead, right) => ground.foot.map((c, i) => c + ahead * ground.ahead[i] + right * ground.right[i]);

/** Rings of equal distance, and the positions of their labels. */
export function addGround(lines, ground) {
  const colour = themeColour('--grid'), labels = [], wide = 1.05;
  for (const metres of RINGS) {
    const steps = 48;
    let before = null;
    for (let i = 0; i <= steps; i++) {
      const angle = -wide + 2 * wide * i / steps;
      const here = along(ground, metres * Math.cos(angle), metres * Math.sin(angle));
      if (before) lines.add(before, here, colour, 0.75, 1);
      before = here;
    }
    labels.push({ text: `${metres} m`, point: along(ground, metres * Math.cos(wide), metres * Math.sin(wide)) });
  }
  for (const angle of [-wide, 0, wide]) {
    lines.add(along(ground, 1.5 * Math.cos(angle), 1.5 * Math.sin(angle)), along(ground, 80 * Math.cos(angle), 80 * Math.sin(angle)), colour, 0.45, 1);
  }
  return labels;
}

/** The camera's pyramid. */
export function addCamera(lines, camera) {
  const colour = themeColour('--accent'), z = 1.1;
  const corner = (u, v) => [(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z];
  const corners = [corner(0, 0), corner(camera.width, 0), corner(camera.width, camera.height), corner(0, camera.height)];
  corners.forEach((c, i) => {
    lines.add([0, 0, 0], c, colour, 0.9, 1.4);
    lines.add(c, corners[(i + 1) % 4], colour, 0.9, 1.4);
  });
}

/** Boxes, and arrows to their positions in one second. */
export function addTargets(lines, frame, { byTrack, light, isChosen }) {
  for (const target of frame.targets) {
    const chosen = isChosen(target), corners = boxCorners(target);
    const colour = chosen ? themeColour('--accent') : ofTarget(target, byTrack, light);
    for (const [a, b] of BOX_EDGES) lines.add(corners[a], corners[b], colour, 1, chosen ? 3 : 1.9);
    for (const [a, b] of FRONT_EDGES) lines.add(corners[a], corners[b], colour, 0.55, 1);
    const velocity = target.velocity_mps;
    if (Array.isArray(velocity) && target.moving !== false && Math.hypot(...velocity) > 0.3) {
      const bottom = [0, 1, 2].map(i => (corners[0][i] + corners[2][i]) / 2);
      // Above the ground's points, which would cover it.
      bottom[1] -= 0.25;
      addArrow(lines, bottom, velocity, colour);
    }
  }
}

function addArrow(lines, from, velocity, colour) {
  const to = from.map((c, i) => c + velocity[i]), way = unit(velocity), n = Math.hypot(...velocity);
  const side = unit(cross(way, [0, -1, 0])), head = Math.min(0.8, 0.3 * n);
  lines.add(from, to, colour, 0.95, 2.4);
  for (const sign of [1, -1]) lines.add(to, to.map((c, i) => c - head * way[i] + sign * 0.5 * head * side[i]), colour, 0.95, 2.4);
}

/** Past positions of the targets and the camera, in the current camera's axes. Without the camera's motion there are none. */
export function addTracks(lines, frame, history, { byTrack, light, isChosen }) {
  if (!frame.worldFromCam) return;
  const camFromWorld = inverseMotion(frame.worldFromCam), states = new Map(frame.targets.map(t => [t.id, t]));
  const last = new Map(), accent = themeColour('--accent');
  let path = null;
  history.forEach((past, age) => {
    if (!past.world_from_cam) return;
    const fresh = (age + 1) / history.length;
    const toNow = p => move(camFromWorld, move(past.world_from_cam, p));
    const here = toNow([0, 1.2, 0]);
    if (path) lines.add(path, here, accent, 0.15 + 0.6 * fresh, 1.6);
    path = here;
    for (const [id, centre] of past.targets) {
      const point = toNow(centre), before = last.get(id), now = states.get(id);
      last.set(id, point);
      if (!before) continue;
      const chosen = now && isChosen(now);
      const colour = chosen ? accent : now && !byTrack ? ofTarget(now, false, light) : ofTrack(id, light);
      // A jump means that the number was reused for another object; it is drawn unchanged.
      lines.add(before, point, colour, (now ? 0.25 : 0.08) + 0.65 * fresh, chosen ? 2.6 : 1.6);
    }
  });
}

/** Height of a point above a ground. */
export const heightAbove = (ground, point) => dot(ground.normal, point) + ground.offset;
