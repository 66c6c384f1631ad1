// Thick, smooth lines by WebGL 2 or 1: every stroke is one rectangle on the screen whose
// pixels know how far from the line they are. Its six vertices are written out: drawing
// instances of one rectangle is many times slower where there is no graphics processor.

const VERTEX_SHADER = `
precision highp float;
attribute vec2 corner;            // along: 0 or 1, across: -1 or 1
attribute vec3 start, end, color;
attribute float width;            // in pixels of the page
uniform mat4 clipFromModel;
uniform vec2 size;                // of the canvas, in its pixels
uniform float ratio;              // canvas pixels per pixel of the page
uniform float near, bias;
uniform vec3 fog;                 // begins, ends, strength
uniform vec2 clearance;           // nearer than the first nothing, from the second on all
uniform vec3 background;
varying vec3 shade;
varying vec2 place;               // along from the start, across
varying float len, radius, opacity;

void main() {
  vec4 a = clipFromModel * vec4(start, 1.0);
  vec4 b = clipFromModel * vec4(end, 1.0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (a.w < near && b.w < near) return;
  vec4 cut = mix(a, b, clamp((near - a.w) / (b.w - a.w), 0.0, 1.0));
  if (a.w < near) a = cut; else if (b.w < near) b = cut;
  vec2 from = 0.5 * size * a.xy / a.w;
  vec2 to = 0.5 * size * b.xy / b.w;
  len = distance(from, to);
  vec2 along = len > 1e-3 ? (to - from) / len : vec2(1.0, 0.0);
  vec2 across = vec2(-along.y, along.x);
  radius = 0.5 * width * ratio;
  float reach = radius + 1.0;
  place = vec2(mix(-reach, len + reach, corner.x), corner.y * reach);
  vec2 point = from + along * place.x + across * place.y;
  vec4 at = corner.x < 0.5 ? a : b;
  shade = mix(color, background, fog.z * smoothstep(fog.x, fog.y, at.w));
  opacity = clamp((at.w - clearance.x) / (clearance.y - clearance.x), 0.0, 1.0);
  // w = 1: place is linear on the screen, not in space.
  gl_Position = vec4(point / (0.5 * size), at.z / at.w - bias, 1.0);
}`;

const FRAGMENT_SHADER = `
#ifdef GL_FRAGMENT_PRECISION_HIGH
precision highp float;
#else
precision mediump float;
#endif
uniform float fringe;
varying vec3 shade;
varying vec2 place;
varying float len, radius, opacity;

void main() {
  float beyond = max(max(-place.x, place.x - len), 0.0);
  float coverage = clamp(radius + 0.5 - length(vec2(beyond, place.y)), 0.0, 1.0);
  // First the bodies, which hide what is behind; then their soft rims.
  if (coverage <= 0.0 || (coverage >= 0.5) == (fringe > 0.5)) discard;
  gl_FragColor = vec4(shade, 1.0) * coverage * opacity;
}`;

/** Attributes of a vertex with their numbers of floats, in the order of the buffer. */
const ATTRIBUTES = [["corner", 2], ["start", 3], ["end", 3], ["color", 3], ["width", 1]];
const VERTEX_FLOATS = 12;
/** Two triangles. */
const CORNERS = [[0, -1], [1, -1], [0, 1], [0, 1], [1, -1], [1, 1]];

/** A program of two shaders. Throws where they do not work. */
function linkedProgram(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(`the shaders do not work here: ${gl.getProgramInfoLog(program)}`);
  }
  return program;
}

/** The vertices of strokes, see Strokes. */
function strokeVertices({ numbers, count }) {
  const vertices = new Float32Array(count * CORNERS.length * VERTEX_FLOATS);
  let offset = 0;
  for (let i = 0; i < 10 * count; i += 10) {
    for (const corner of CORNERS) {
      vertices.set(corner, offset);
      for (let k = 0; k < 10; k++) vertices[offset + 2 + k] = numbers[i + k];
      offset += VERTEX_FLOATS;
    }
  }
  return vertices;
}

class WebglRenderer {
  /** Throws where there is no WebGL. */
  constructor(canvas) {
    const options = { alpha: true, antialias: false, premultipliedAlpha: true };
    this.canvas = canvas;
    this.kind = "WebGL 2";
    this.gl = canvas.getContext("webgl2", options);
    if (!this.gl) {
      this.kind = "WebGL 1";
      this.gl = canvas.getContext("webgl", options);
    }
    if (!this.gl) throw new Error("no WebGL");
    this.layers = new Map();
    this.prepare();
  }

  /** Everything that lives in the graphics memory, again after it was lost. */
  prepare() {
    const { gl } = this;
    const program = linkedProgram(gl, VERTEX_SHADER, FRAGMENT_SHADER);
    this.program = program;
    this.faces = new FacePainter(gl);
    this.uniforms = {};
    for (const name of ["clipFromModel", "size", "ratio", "near", "bias", "fog", "clearance", "background", "fringe"]) {
      this.uniforms[name] = gl.getUniformLocation(program, name);
    }
    this.attributes = ATTRIBUTES.map(([name, size]) => {
      const location = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(location);
      return { location, size };
    });
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Takes what a layer is to show, a list of Strokes. */
  load(layer, batches) {
    const { gl } = this;
    for (const { buffer } of this.layers.get(layer) ?? []) gl.deleteBuffer(buffer);
    this.layers.set(layer, batches.filter((strokes) => strokes.count > 0).map((strokes) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, strokeVertices(strokes), gl.DYNAMIC_DRAW);
      const { count, bias, haze, clearance } = strokes;
      return { buffer, count, bias, haze, clearance };
    }));
  }

  /** Takes the triangles of the faces to show, see drawFaces. */
  loadFaces(triangles) {
    this.faces.load(triangles);
  }

  /** Draws for a view, see Orbit.view. */
  draw(view) {
    const { gl, uniforms, canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(view.width * ratio), Math.round(view.height * ratio)];
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(uniforms.clipFromModel, false, new Float32Array(view.matrix));
    gl.uniform2f(uniforms.size, width, height);
    gl.uniform1f(uniforms.ratio, ratio);
    gl.uniform1f(uniforms.near, view.near);
    gl.uniform3fv(uniforms.background, theme().stage.map((c) => c / 255));
    for (const fringe of [0, 1]) {
      if (fringe) this.faces.draw(view);
      gl.useProgram(this.program);
      gl.uniform1f(uniforms.fringe, fringe);
      gl.depthMask(!fringe);
      for (const batch of [...this.layers.values()].flat()) this.drawBatch(batch, view);
    }
  }

  drawBatch({ buffer, count, bias, haze, clearance }, { fog: [begins, ends, strength], distance }) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    let offset = 0;
    for (const { location, size } of this.attributes) {
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, 4 * VERTEX_FLOATS, 4 * offset);
      offset += size;
    }
    gl.uniform1f(this.uniforms.bias, bias);
    gl.uniform3f(this.uniforms.fog, begins, ends, strength * haze);
    gl.uniform2f(this.uniforms.clearance, clearance * distance - 1e-6, 2 * clearance * distance);
    gl.drawArrays(gl.TRIANGLES, 0, CORNERS.length * count);
  }
}
