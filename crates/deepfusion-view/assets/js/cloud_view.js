// The cloud in 3D, with boxes and tracks.

import { css, ofTarget, themeColour } from './colour.js';
import { FADE } from './depth.js';
import { backProject, boxCorners, resizedCamera, toScreen } from './geometry.js';
import { fit, gestures } from './gestures.js';
import { drawLabel } from './picture_pane.js';
import { Lines, TRACK_FRAMES, addCamera, addGround, addTargets, addTracks, groundOf } from './scene.js';
import { LINES, POINTS, program } from './shaders.js';

const MOST_POINTS = matchMedia('(pointer: coarse)').matches ? 400_000 : 1_200_000;
const MOST_PATCHES = MOST_POINTS / 3;
/** Most points while the view moves on a machine that cannot draw all of them fast enough. */
const COARSE_POINTS = 60_000;
const MODES = { picture: 0, depth: 1, height: 2 };
const VIEW_NAMES = { chase: 'Chase', top: 'Top', side: 'Side', eye: 'Camera' };

/** Whether WebGL runs without a GPU: edges are then not smoothed, and a moving view is drawn coarsely. */
export function drawnBySoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  const info = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class CloudView {
  constructor(app, run) {
    this.app = app;
    this.run = run;
    this.lines = new Lines();
    this.element = document.createElement('section');
    this.element.className = 'pane cloud';
    this.element.innerHTML = '<canvas class="scene"></canvas><canvas class="over"></canvas><div class="caption"></div><div class="views"></div><div class="problem" hidden></div>';
    [this.canvas, this.over] = this.element.querySelectorAll('canvas');
    this.caption = this.element.querySelector('.caption');
    this.problem = this.element.querySelector('.problem');
    this.buttons();
    this.open();
    this.canvas.addEventListener('webglcontextlost', e => { e.preventDefault(); this.gl = null; });
    this.canvas.addEventListener('webglcontextrestored', () => { this.open(); app.touch('scene'); });
    const { orbit } = app;
    gestures(this.canvas, {
      hover: (x, y, touch) => this.hover(x, y, touch),
      leave: () => app.point(null),
      drag: (dx, dy, how) => how.secondary ? orbit.pan(dx, dy, this.height) : orbit.rotate(dx, dy),
      pinch: (factor, x, y, dx, dy) => { orbit.pan(dx, dy, this.height); orbit.zoom(1 / factor); },
      wheel: delta => orbit.zoom(Math.exp(delta * 0.0013)),
      tap: (x, y) => app.choose(run, this.targetAt(x, y)),
      double: (x, y) => { const hit = this.pick(x, y); if (hit) orbit.focus(hit.point); },
    });
  }

  buttons() {
    const bar = this.element.querySelector('.views');
    for (const [name, text] of Object.entries(VIEW_NAMES)) {
      const button = Object.assign(document.createElement('button'), { textContent: text });
      button.dataset.view = name;
      button.onclick = () => this.app.go(name);
      bar.append(button);
    }
    this.surfaceButton = Object.assign(document.createElement('button'), { title: 'Points or a closed surface (S)', className: 'apart' });
    this.surfaceButton.onclick = () => this.app.flip('surface');
    this.modeButton = Object.assign(document.createElement('button'), { title: 'Colour of the points (M)' });
    this.modeButton.onclick = () => this.app.nextMode();
    bar.append(this.surfaceButton, this.modeButton);
  }

  open() {
    const gl = this.canvas.getContext('webgl2', { antialias: !this.app.software, alpha: false, powerPreference: 'high-performance' });
    this.gl = gl;
    this.uploaded = null;
    if (!gl) return;
    this.points = program(gl, POINTS);
    this.strokes = program(gl, LINES);
    this.textures = {};
    for (const [unit, name] of ['depth', 'picture', 'table', 'sigma'].entries()) {
      this.textures[name] = gl.createTexture();
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.textures[name]);
      const filter = name === 'depth' || name === 'sigma' ? gl.NEAREST : gl.LINEAR;
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    }
    gl.activeTexture(gl.TEXTURE2);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, this.app.colours.depthTable());
    this.empty = gl.createVertexArray();
    this.segments = gl.createVertexArray();
    this.buffer = gl.createBuffer();
    gl.bindVertexArray(this.segments);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    for (const [place, count, offset] of [[0, 3, 0], [1, 3, 12], [2, 4, 24], [3, 1, 40]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 44, offset);
      gl.vertexAttribDivisor(place, 1);
    }
  }

  /** The frame's depth and picture as textures. */
  upload(frame) {
    const { gl } = this;
    if (this.uploaded === frame) return;
    this.uploaded = frame;
    const { depth, sigma, bitmap } = frame;
    gl.activeTexture(gl.TEXTURE0);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, depth.width, depth.height, 0, gl.RED, gl.FLOAT, depth.metres());
    gl.activeTexture(gl.TEXTURE1);
    if (bitmap) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    this.hasPicture = Boolean(bitmap);
    gl.activeTexture(gl.TEXTURE3);
    if (sigma) gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, sigma.width, sigma.height, 0, gl.RED, gl.FLOAT, sigma.metres());
  }

  draw(scene) {
    const { app, canvas } = this, frame = app.shown(this.run);
    const resized = fit(canvas, app.coarse ? 1 : 2);
    fit(this.over);
    [this.width, this.height] = [canvas.width / canvas.ratio, canvas.height / canvas.ratio];
    this.viewProjection = app.orbit.viewProjection(canvas.width / canvas.height);
    if (frame && frame.camera && frame.depth && !frame.cameraOfDepth) frame.cameraOfDepth = resizedCamera(frame.camera, frame.depth.width, frame.depth.height);
    if (frame && !frame.ground) frame.ground = groundOf(frame);
    if (scene || resized) this.drawScene(frame);
    this.drawOver(frame);
    this.describe(frame);
  }

  drawScene(frame) {
    const { gl, app, canvas } = this;
    if (!gl) return;
    const [r, g, b] = themeColour('--sky');
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(r / 255, g / 255, b / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    if (frame?.depth && frame.cameraOfDepth) this.drawPoints(frame);
    this.drawLines(frame);
  }

  drawPoints(frame) {
    const { gl, app, canvas } = this, { made, at } = this.points, { depth, cameraOfDepth: k } = frame, { options } = app;
    this.upload(frame);
    const most = options.surface ? MOST_PATCHES : MOST_POINTS;
    const stride = Math.max(1, Math.ceil(Math.sqrt(depth.width * depth.height / (app.coarse ? Math.min(most, COARSE_POINTS) : most))));
    gl.useProgram(made);
    gl.bindVertexArray(this.empty);
    gl.uniform1i(at.depth, 0);
    gl.uniform1i(at.picture, 1);
    gl.uniform1i(at.table, 2);
    gl.uniform1i(at.sigma, 3);
    gl.uniform1i(at.fades, options.fade && frame.sigma ? 1 : 0);
    gl.uniform2f(at.fade, ...FADE);
    gl.uniform3f(at.background, ...themeColour('--sky').map(c => c / 255));
    gl.uniformMatrix4fv(at.viewProjection, false, this.viewProjection);
    gl.uniform4f(at.camera, k.fx, k.fy, k.cx, k.cy);
    gl.uniform2i(at.size, depth.width, depth.height);
    gl.uniform1i(at.stride, stride);
    gl.uniform1i(at.mode, options.mode === 'picture' && !this.hasPicture ? 1 : MODES[options.mode]);
    gl.uniform2f(at.range, app.colours.scale.near_m, app.colours.scale.far_m);
    gl.uniform1f(at.farthest, options.farthest);
    // The ground is the plane that passes closest to the camera; anything much steeper is not a surface.
    const closest = 0.55 * Math.max(0.1, frame.ground.offset);
    gl.uniform1f(at.steepest, options.edges ? 1 / closest : 0);
    gl.uniform1f(at.tear, 1 / closest);
    gl.uniform1i(at.surface, options.surface ? 1 : 0);
    gl.uniform1f(at.pixelScale, canvas.height / 2 / Math.tan(app.orbit.fov / 2));
    gl.uniform1f(at.pointScale, options.pointScale);
    gl.uniform4f(at.ground, ...frame.ground.normal, frame.ground.offset);
    const columns = Math.ceil(depth.width / stride), rows = Math.ceil(depth.height / stride);
    if (options.surface) gl.drawArrays(gl.TRIANGLES, 0, 6 * columns * rows);
    else gl.drawArrays(gl.POINTS, 0, columns * rows);
    this.drawn = columns * rows;
  }

  drawLines(frame) {
    const { gl, app, canvas, lines } = this, { made, at } = this.strokes, { options } = app;
    const style = { byTrack: options.byTrack, light: app.light, isChosen: t => app.isChosen(this.run, t) };
    lines.clear();
    this.ringLabels = frame && options.ground ? addGround(lines, frame.ground) : [];
    if (frame?.camera) addCamera(lines, frame.camera);
    if (frame && options.tracks && frame.worldFromCam) {
      const history = app.runs[this.run].history(app.place(this.run), TRACK_FRAMES, () => app.touch('scene'));
      addTracks(lines, frame, history, style);
    }
    if (frame && options.boxes) addTargets(lines, frame, style);
    if (!lines.count) return;
    gl.useProgram(made);
    gl.bindVertexArray(this.segments);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, lines.data.subarray(0, 11 * lines.count), gl.DYNAMIC_DRAW);
    gl.uniformMatrix4fv(at.viewProjection, false, this.viewProjection);
    gl.uniform2f(at.viewport, canvas.width / canvas.ratio, canvas.height / canvas.ratio);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ZERO, gl.ONE);
    gl.drawArraysInstanced(gl.TRIANGLES, 0, 6, lines.count);
    gl.disable(gl.BLEND);
  }

  /** Text and the pointer's point, over the scene. */
  drawOver(frame) {
    const { app, over } = this, ctx = over.getContext('2d'), pane = { width: this.width, height: this.height };
    ctx.setTransform(over.ratio, 0, 0, over.ratio, 0, 0);
    ctx.clearRect(0, 0, pane.width, pane.height);
    const screen = point => toScreen(this.viewProjection, point, pane.width, pane.height);
    ctx.font = '10.500px system-ui, sans-serif';
    ctx.textAlign = 'left';
    for (const { text, point } of this.ringLabels ?? []) {
      const at = screen(point);
      if (!at) continue;
      ctx.fillStyle = css(themeColour('--dim'));
      ctx.fillText(text, at[0] + 5, at[1] + 4);
    }
    if (frame && app.options.boxes && app.options.labels) {
      const taken = [], labels = [];
      for (const target of frame.targets) {
        const tops = boxCorners(target).map(screen).filter(Boolean);
        if (!tops.length) continue;
        const chosen = app.isChosen(this.run, target);
        labels.push({
          target, chosen, colour: chosen ? themeColour('--accent') : ofTarget(target, app.options.byTrack, false), depth: Math.min(...tops.map(t => t[2])),
          x: tops.reduce((sum, t) => sum + t[0], 0) / tops.length, y: Math.min(...tops.map(t => t[1])),
        });
      }
      labels.sort((a, b) => b.chosen - a.chosen || a.depth - b.depth);
      for (const label of labels) drawLabel(ctx, label, taken, pane);
    }
    const point = app.pointerPoint(this.run), at = point && screen(point);
    if (at) {
      for (const [style, width] of [['rgb(0 0 0 / 0.7)', 4], ['#fff', 2]]) {
        ctx.strokeStyle = style;
        ctx.lineWidth = width;
        ctx.beginPath();
        ctx.arc(at[0], at[1], 6, 0, 7);
        ctx.stroke();
      }
    }
  }

  describe(frame) {
    const { app } = this, { options } = app;
    const letter = app.runs.length > 1 ? `${'AB'[this.run]} ` : '';
    const count = frame?.depth && frame.cameraOfDepth ? `<span>${Math.round((this.drawn ?? 0) / 1000)}k pixels, to ${options.farthest} m</span>` : '';
    const text = `${letter}Cloud${count}`;
    if (text !== this.captioned) this.caption.innerHTML = this.captioned = text;
    for (const button of this.element.querySelectorAll('[data-view]')) button.setAttribute('aria-pressed', String(app.orbit.name === button.dataset.view));
    this.surfaceButton.textContent = options.surface ? 'Surface' : 'Points';
    this.modeButton.textContent = { picture: 'Colour', depth: 'Depth', height: 'Height' }[options.mode];
    const problem = !this.gl ? 'This browser has no WebGL 2, which the cloud needs. Picture and depth work without it.'
      : frame && frame.depth && !frame.camera ? 'No cloud: the camera is unknown.' : null;
    this.problem.hidden = !problem;
    if (problem) this.problem.textContent = problem;
  }

  hover(x, y, touch) {
    const hit = touch ? null : this.pick(x, y), box = this.canvas.getBoundingClientRect();
    this.app.point(hit ? { u: hit.u, v: hit.v, run: this.run, x: box.left + x, y: box.top + y, touch } : null);
  }

  /** The nearest point of the cloud within a few pixels of a place on the screen. */
  pick(x, y) {
    const frame = this.app.shown(this.run);
    if (!frame?.depth || !frame.cameraOfDepth || !this.viewProjection) return null;
    const { depth, cameraOfDepth: k } = frame, { farthest } = this.app.options, m = this.viewProjection;
    const stride = Math.max(1, Math.ceil(Math.sqrt(depth.width * depth.height / 60_000)));
    const [halfWidth, halfHeight] = [this.width / 2, this.height / 2];
    let best = null, bestScore = Infinity;
    for (let v = 0; v < depth.height; v += stride) {
      for (let u = 0; u < depth.width; u += stride) {
        const d = depth.at(u, v);
        if (!(d > 0 && d <= farthest)) continue;
        const px = (u - k.cx) / k.fx * d, py = (v - k.cy) / k.fy * d;
        const w = m[3] * px + m[7] * py + m[11] * d + m[15];
        if (w < 0.1) continue;
        const sx = (m[0] * px + m[4] * py + m[8] * d + m[12]) / w * halfWidth + halfWidth - x;
        const sy = halfHeight - (m[1] * px + m[5] * py + m[9] * d + m[13]) / w * halfHeight - y;
        const off = sx * sx + sy * sy;
        if (off > 81) continue;
        // Points near the eye hide those behind them.
        const score = w * (1 + off / 60);
        if (score < bestScore) [best, bestScore] = [{ u, v, d }, score];
      }
    }
    return best && { u: (best.u + 0.5) / depth.width, v: (best.v + 0.5) / depth.height, point: backProject(k, best.u, best.v, best.d) };
  }

  targetAt(x, y) {
    const frame = this.app.shown(this.run), hits = [];
    if (!frame || !this.app.options.boxes) return null;
    for (const target of frame.targets) {
      const points = boxCorners(target).map(c => toScreen(this.viewProjection, c, this.width, this.height));
      if (points.some(p => !p)) continue;
      const us = points.map(p => p[0]), vs = points.map(p => p[1]);
      if (x >= Math.min(...us) - 3 && x <= Math.max(...us) + 3 && y >= Math.min(...vs) - 3 && y <= Math.max(...vs) + 3) hits.push([points[0][2], target]);
    }
    return hits.sort((a, b) => a[0] - b[0])[0]?.[1] ?? null;
  }
}
