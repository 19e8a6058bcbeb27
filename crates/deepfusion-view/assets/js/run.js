// A folder of results: its list of frames, and the frames that are loaded.

import * as api from './api.js';
import { Cache } from './cache.js';
import { Depth } from './depth.js';
import { motion } from './geometry.js';

// Phones have less memory; both limits are far below what a page may use.
const FRAME_BYTES = (matchMedia('(pointer: coarse)').matches ? 96 : 320) << 20;
const TRACK_CHUNK = 64;
const TRACK_CHUNKS = 24;

export class Run {
  constructor(number, info) {
    this.number = number;
    this.name = info.name;
    this.path = info.path;
    this.version = 0;
    this.names = [];
    this.revisions = [];
    this.series = {};
    this.places = new Map();
    this.frames = new Cache(FRAME_BYTES, frame => { if (frame !== this.shown) frame.bitmap?.close(); });
    this.coming = new Map();
    this.chunks = new Cache(TRACK_CHUNKS);
    this.chunksComing = new Set();
    this.shown = null;
  }

  get length() { return this.names.length; }

  /** The frame on screen keeps its picture even after the cache dropped it; the previous frame's is then freed. */
  show(frame) {
    const before = this.shown;
    this.shown = frame;
    if (before && before !== frame && this.frames.entries.get(before.key)?.value !== before) before.bitmap?.close();
  }

  /** Fetches the list of frames. Returns whether it changed. */
  async refresh() {
    const index = await api.index(this.number, this.version);
    this.failure = index.failure;
    if (index.unchanged) return false;
    const changed = index.names.findIndex((name, i) => name !== this.names[i] || index.revisions[i] !== this.revisions[i]);
    // Tracks from the first changed frame on are requested again; until then the old ones are shown.
    const first = changed >= 0 ? changed : Math.min(this.length, index.names.length);
    if (first < Math.max(this.length, index.names.length)) for (const [key, { value }] of this.chunks.entries) if (Number(key) >= Math.floor(first / TRACK_CHUNK)) value.stale = true;
    Object.assign(this, { version: index.version, names: index.names, revisions: index.revisions, series: index.series });
    this.pending = index.pending;
    this.hasDepth = index.has_depth;
    this.hasSigma = index.has_sigma;
    this.places = new Map(this.names.map((name, i) => [name, i]));
    return true;
  }

  /** Key that distinguishes a frame's current files from earlier ones. */
  key(i) { return i >= 0 && i < this.length ? `${this.names[i]}@${this.revisions[i]}` : ''; }

  /** A frame that is loaded; undefined otherwise. */
  at(i) { return this.frames.get(this.key(i)); }

  has(i) { return this.frames.has(this.key(i)); }

  /** A frame, fetched if necessary. This never fails: what cannot be read is listed in its `problems`. */
  load(i) {
    const key = this.key(i);
    if (!key) return Promise.resolve(undefined);
    const there = this.frames.get(key);
    if (there) return Promise.resolve(there);
    let coming = this.coming.get(key);
    if (!coming) {
      coming = this.fetch(this.names[i], this.hasDepth[i], this.hasSigma[i]).then(frame => {
        frame.key = key;
        // A failed request is retried, not cached.
        if (!frame.lost) this.frames.set(key, frame, frame.bytes);
        return frame;
      }).finally(() => this.coming.delete(key));
      this.coming.set(key, coming);
    }
    return coming;
  }

  async fetch(name, hasDepth, hasSigma) {
    const frame = { name, problems: [], targets: [], depth: null, sigma: null, bitmap: null, camera: null, bytes: 4096, lost: false };
    const failed = error => {
      if (error instanceof api.Problem) return error;
      frame.lost = true;
      return new api.Problem('the server does not answer', 'check that `deepfusion view` is still running');
    };
    const attempt = promise => promise.catch(error => failed(error));
    const [meta, depth, sigma, blob] = await Promise.all([
      attempt(api.frame(this.number, name)), hasDepth ? attempt(api.depth(this.number, name)) : null,
      hasDepth && hasSigma ? attempt(api.sigma(this.number, name)) : null, attempt(api.image(this.number, name)),
    ]);
    if (meta instanceof api.Problem) frame.problems.push(meta.message);
    else {
      frame.meta = meta;
      frame.camera = meta.intrinsics ?? null;
      frame.problems.push(...(meta.problems ?? []));
      frame.targets = meta.targets?.targets ?? [];
      frame.perceived = meta.targets ?? null;
      frame.worldFromCam = motion(meta.targets?.camera_motion);
    }
    if (depth instanceof api.Problem) {
      // Data that does not exist is already among the frame's problems.
      if (depth.status !== 404) frame.depthProblem = depth.message;
    } else if (depth) {
      try {
        frame.depth = new Depth(depth);
        frame.bytes += frame.depth.bytes;
      } catch (error) { frame.depthProblem = error.message; }
    }
    if (sigma instanceof api.Problem) frame.problems.push(sigma.message);
    else if (sigma && frame.depth) {
      try {
        const map = new Depth(sigma);
        if (map.width !== frame.depth.width || map.height !== frame.depth.height) throw new Error(`${name}: sigma is ${map.width}x${map.height}, depth ${frame.depth.width}x${frame.depth.height}`);
        frame.sigma = map;
        frame.bytes += map.bytes;
      } catch (error) { frame.problems.push(error.message); }
    }
    if (blob instanceof api.Problem) frame.imageProblem = blob.message;
    else {
      try {
        frame.bitmap = await createImageBitmap(blob);
        frame.bytes += 4 * frame.bitmap.width * frame.bitmap.height;
      } catch { frame.imageProblem = `${name}: the picture cannot be decoded`; }
    }
    return frame;
  }

  /** Targets of the loaded frames up to `i`, the newest last. Those that are not loaded yet are requested. */
  history(i, count, arrived) {
    const found = [];
    for (let j = Math.max(0, i - count + 1); j <= i; j++) {
      const chunk = Math.floor(j / TRACK_CHUNK), key = String(chunk);
      const there = this.chunks.get(key);
      if (there) found.push(there[j - chunk * TRACK_CHUNK] ?? null);
      if (!there || there.stale) this.fetchChunk(chunk, arrived);
    }
    return found.filter(Boolean);
  }

  async fetchChunk(chunk, arrived) {
    const chunks = this.chunks, version = `${this.version}:${chunk}`;
    if (this.chunksComing.has(version)) return;
    this.chunksComing.add(version);
    try {
      const { tracks } = await api.tracks(this.number, chunk * TRACK_CHUNK, TRACK_CHUNK);
      for (const frame of tracks) if (frame) frame.world_from_cam = motion(frame.world_from_cam);
      chunks.set(String(chunk), tracks, 1);
      arrived();
    } catch { /* requested again with the next frame */ } finally { this.chunksComing.delete(version); }
  }
}
