// Shader programs.

/** Computes the points from the depth texture, so no vertices are uploaded: from pixel and depth to camera axes, then to the screen. */
export const POINTS = {
  vertex: `#version 300 es
precision highp float; precision highp sampler2D;
uniform sampler2D depth; uniform sampler2D picture; uniform sampler2D table; uniform sampler2D sigma;
uniform mat4 viewProjection;
uniform vec4 camera;           // fx, fy, cx, cy in depth pixels
uniform ivec2 size;            // of the depth
uniform int stride, mode;      // mode 0: picture, 1: depth, 2: height
uniform vec2 range;            // near and far of the colour scale
uniform float farthest, steepest, tear, pixelScale, pointScale;
uniform vec4 ground;           // plane: normal, offset
out vec3 colour;
uniform bool surface;          // patches between pixels instead of points
uniform bool fades;            // uncertain pixels fade into the background
uniform vec2 fade;             // sigma / depth at which fading begins and ends
uniform vec3 background;
float at(ivec2 p) { return texelFetch(depth, clamp(p, ivec2(0), size - 1), 0).r; }
float opacity(ivec2 p, float d) { return clamp((fade.y - texelFetch(sigma, p, 0).r / d) / (fade.y - fade.x), 0.0, 1.0); }
bool shown(float d) { return d > 0.0 && d <= farthest; }
// Difference in disparity from a neighbour; 0 if the neighbour has no depth.
float fall(float d, ivec2 p) { float n = at(p); return n > 0.0 ? abs(1.0 / n - 1.0 / d) : 0.0; }
void main() {
  int columns = (size.x + stride - 1) / stride;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = 1.0;
  colour = vec3(0.0);
  ivec2 p, whole;
  if (surface) {
    int cell = gl_VertexID / 6, corner = gl_VertexID % 6;
    ivec2 first = ivec2(cell % columns, cell / columns) * stride;
    whole = first;
    if (any(greaterThanEqual(first + stride, size))) return;
    float a = at(first), b = at(first + ivec2(stride, 0)), c = at(first + ivec2(0, stride)), e = at(first + stride);
    if (!(shown(a) && shown(b) && shown(c) && shown(e))) return;
    // A patch is left out where its disparity changes faster than on any plane that passes the camera at 1 / tear metres.
    float low = min(min(1.0 / a, 1.0 / b), min(1.0 / c, 1.0 / e)), high = max(max(1.0 / a, 1.0 / b), max(1.0 / c, 1.0 / e));
    if ((high - low) * camera.x > 1.5 * float(stride) * tear) return;
    p = first + stride * ivec2(corner == 1 || corner >= 4 ? 1 : 0, corner == 2 || corner == 3 || corner == 5 ? 1 : 0);
  } else {
    p = whole = ivec2(gl_VertexID % columns, gl_VertexID / columns) * stride;
  }
  float d = at(p);
  if (!shown(d)) return;
  if (steepest > 0.0 && !surface) {
    // Between a near object and its background a network predicts points that belong to neither: there, disparity changes on both sides faster
    // than on any plane that passes the camera at 1 / steepest metres (|gradient| = f / distance).
    vec2 g = vec2(min(fall(d, p - ivec2(1, 0)), fall(d, p + ivec2(1, 0))), min(fall(d, p - ivec2(0, 1)), fall(d, p + ivec2(0, 1)))) * camera.xy;
    if (dot(g, g) > steepest * steepest) return;
  }
  vec3 point = vec3((vec2(p) - camera.zw) / camera.xy * d, d);
  gl_Position = viewProjection * vec4(point, 1.0);
  // As large as the distance to the point below, within limits, so that slanted surfaces have no gaps either.
  float patchSize = d / camera.x * float(stride);
  float below = at(p + ivec2(0, stride));
  float way = below > 0.0 ? clamp(0.75 * abs(below - d), patchSize, 4.0 * patchSize) : patchSize;
  gl_PointSize = clamp(pointScale * way * pixelScale / gl_Position.w, 1.3, 14.0);
  if (mode == 1) {
    float t = log(d / range.x) / log(range.y / range.x);
    colour = texture(table, vec2(clamp(t, 0.002, 0.998), 0.5)).rgb;
  } else if (mode == 2) {
    float height = dot(ground.xyz, point) + ground.w;
    colour = texture(table, vec2(clamp(1.0 - (height + 0.5) / 4.5, 0.002, 0.998), 0.5)).rgb;
  } else {
    colour = texture(picture, (vec2(p) + 0.5) / vec2(size)).rgb;
  }
  if (fades) {
    colour = mix(background, colour, opacity(p, d));
    // A patch is hidden completely: the remaining corners of an uncertain patch would cover what is behind it.
    if (opacity(whole, at(whole)) < 0.15) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  }
}`,
  fragment: `#version 300 es
precision mediump float;
in vec3 colour; out vec4 result;
void main() { result = vec4(colour, 1.0); }`,
};

/** Lines of any width, as one quad each. */
export const LINES = {
  vertex: `#version 300 es
precision highp float;
layout(location = 0) in vec3 from; layout(location = 1) in vec3 to;
layout(location = 2) in vec4 tint; layout(location = 3) in float width;
uniform mat4 viewProjection; uniform vec2 viewport;
out vec4 colour; out float across;
void main() {
  vec4 a = viewProjection * vec4(from, 1.0), b = viewProjection * vec4(to, 1.0);
  const float near = 0.06;
  colour = tint;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  across = 0.0;
  if (a.w < near && b.w < near) return;
  if (a.w < near) a = mix(a, b, (near - a.w) / (b.w - a.w));
  else if (b.w < near) b = mix(b, a, (near - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * viewport;
  float n = length(along);
  vec2 side = n > 1e-5 ? vec2(-along.y, along.x) / n : vec2(0.0, 1.0);
  // Two triangles: corners 0 1 2 and 3 4 5.
  bool end = gl_VertexID == 1 || gl_VertexID >= 4;
  across = gl_VertexID == 2 || gl_VertexID == 3 || gl_VertexID == 5 ? 1.0 : -1.0;
  vec4 c = end ? b : a;
  c.xy += side * across * (width + 1.0) / viewport * c.w;
  gl_Position = c;
}`,
  fragment: `#version 300 es
precision mediump float;
in vec4 colour; in float across; out vec4 result;
void main() { result = vec4(colour.rgb, colour.a * smoothstep(1.0, 0.55, abs(across))); }`,
};

export function program(gl, { vertex, fragment }) {
  const made = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
  const places = {};
  for (let i = 0; i < (gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS) ?? 0); i++) {
    const { name } = gl.getActiveUniform(made, i);
    places[name] = gl.getUniformLocation(made, name);
  }
  return { made, at: places };
}
