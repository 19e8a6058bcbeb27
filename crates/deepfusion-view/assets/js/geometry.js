// Cameras, boxes and rigid motions. Camera axes: x right, y down, z forward; metres; pixels with integer centres.

/** The same camera after its image was resized, with half-pixel centres: f' = s f, c' = s (c + 1/2) - 1/2. */
export function resizedCamera(k, width, height) {
  const sx = width / k.width, sy = height / k.height;
  return { fx: sx * k.fx, fy: sy * k.fy, cx: sx * (k.cx + 0.5) - 0.5, cy: sy * (k.cy + 0.5) - 0.5, width, height };
}

/** Pixel of a point in camera axes; null on or behind the image plane. */
export function project(k, [x, y, z]) {
  return z > 1e-3 ? [k.fx * x / z + k.cx, k.fy * y / z + k.cy] : null;
}

/** The point at camera z = depth that projects to a pixel. */
export function backProject(k, u, v, depth) {
  return [(u - k.cx) / k.fx * depth, (v - k.cy) / k.fy * depth, depth];
}

/**
 * A target's eight corners in camera axes: the bottom's four, then the top's above them. KITTI's rotation_y: the length runs along
 * (cos, 0, -sin), the width along (sin, 0, cos).
 */
export function boxCorners(target) {
  const [x, y, z] = target.center_m, [length, width, height] = target.size_m, yaw = target.yaw_rad ?? 0;
  const c = Math.cos(yaw), s = Math.sin(yaw), corners = [];
  for (const down of [height / 2, -height / 2]) {
    for (const [l, w] of [[1, 1], [1, -1], [-1, -1], [-1, 1]]) {
      const along = l * length / 2, across = w * width / 2;
      corners.push([x + c * along + s * across, y + down, z - s * along + c * across]);
    }
  }
  return corners;
}

/** Pairs of corners that an edge joins: four at the bottom, four at the top, four between them. */
export const BOX_EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/** The diagonals of the front, the side that the target's length points to. */
export const FRONT_EDGES = [[0, 5], [1, 4]];

/** The part of an edge in front of the plane z = near, as two pixels; null if all of it is behind. */
export function projectEdge(k, a, b, near = 0.1) {
  if (a[2] < near && b[2] < near) return null;
  const cut = (p, q) => {
    const t = (near - p[2]) / (q[2] - p[2]);
    return [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), near];
  };
  if (a[2] < near) a = cut(a, b);
  else if (b[2] < near) b = cut(b, a);
  return [project(k, a), project(k, b)];
}

/** A 3x4 row-major motion from JSON (nested rows or twelve numbers); null if it is not one. */
export function motion(value) {
  const m = Array.isArray(value) ? value.flat() : [];
  return (m.length === 12 || m.length === 16) && m.every(Number.isFinite) ? m.slice(0, 12) : null;
}

/** A point of the motion's source frame in its target frame. */
export function move(m, [x, y, z]) {
  return [
    m[0] * x + m[1] * y + m[2] * z + m[3],
    m[4] * x + m[5] * y + m[6] * z + m[7],
    m[8] * x + m[9] * y + m[10] * z + m[11],
  ];
}

/** The inverse of a rigid motion. */
export function inverseMotion(m) {
  const [a, b, c, tx, d, e, f, ty, g, h, i, tz] = m;
  return [
    a, d, g, -(a * tx + d * ty + g * tz),
    b, e, h, -(b * tx + e * ty + h * tz),
    c, f, i, -(c * tx + f * ty + i * tz),
  ];
}

// 4x4 matrices for WebGL: column by column.

export function perspective(fovY, aspect, near, far) {
  const f = 1 / Math.tan(fovY / 2);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
}

export function multiply(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let i = 0; i < 4; i++) sum += a[i * 4 + row] * b[column * 4 + i];
      out[column * 4 + row] = sum;
    }
  }
  return out;
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const unit = a => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };

export function lookAt(eye, target, up) {
  const back = unit(minus(eye, target)), right = unit(cross(up, back)), above = cross(back, right);
  return new Float32Array([
    right[0], above[0], back[0], 0, right[1], above[1], back[1], 0, right[2], above[2], back[2], 0,
    -dot(right, eye), -dot(above, eye), -dot(back, eye), 1,
  ]);
}

/** Position of a point in a viewport of the given size: x, y in pixels and its distance along the view; null behind the eye. */
export function toScreen(viewProjection, [x, y, z], width, height) {
  const m = viewProjection, w = m[3] * x + m[7] * y + m[11] * z + m[15];
  if (w < 0.05) return null;
  const px = (m[0] * x + m[4] * y + m[8] * z + m[12]) / w, py = (m[1] * x + m[5] * y + m[9] * z + m[13]) / w;
  return [(px * 0.5 + 0.5) * width, (0.5 - py * 0.5) * height, w];
}
