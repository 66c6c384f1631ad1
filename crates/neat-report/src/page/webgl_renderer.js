// Thick, smooth lines by WebGL 2, or WebGL 1 with instances: every stroke is one
// rectangle on the screen whose pixels know how far from the line they are.

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

const STROKE_ATTRIBUTES = [["start", 3, 0], ["end", 3, 12], ["color", 3, 24], ["width", 1, 36]];
const STROKE_BYTES = 40;

class WebglRenderer {
  /** Throws where there is no WebGL with instances. */
  constructor(canvas) {
    const options = { alpha: true, antialias: false, premultipliedAlpha: true };
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", options);
    this.kind = "WebGL 2";
    if (this.gl) {
      this.setDivisor = (location, divisor) => this.gl.vertexAttribDivisor(location, divisor);
      this.drawInstances = (count) => this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, count);
    } else {
      this.gl = canvas.getContext("webgl", options);
      const instances = this.gl?.getExtension("ANGLE_instanced_arrays");
      if (!instances) throw new Error("no WebGL with instanced drawing");
      this.kind = "WebGL 1";
      this.setDivisor = (location, divisor) => instances.vertexAttribDivisorANGLE(location, divisor);
      this.drawInstances = (count) => instances.drawArraysInstancedANGLE(this.gl.TRIANGLE_STRIP, 0, 4, count);
    }
    this.batches = [];
    this.prepare();
  }

  /** Everything that lives in the graphics memory, again after it was lost. */
  prepare() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`the shaders do not work here: ${gl.getProgramInfoLog(program)}`);
    }
    gl.useProgram(program);
    this.program = program;
    this.uniforms = {};
    for (const name of ["clipFromModel", "size", "ratio", "near", "bias", "fog", "clearance", "background", "fringe"]) {
      this.uniforms[name] = gl.getUniformLocation(program, name);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]), gl.STATIC_DRAW);
    const corner = gl.getAttribLocation(program, "corner");
    gl.enableVertexAttribArray(corner);
    gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Takes what is to be drawn, a list of Strokes. */
  load(batches) {
    const { gl } = this;
    for (const { buffer } of this.batches) gl.deleteBuffer(buffer);
    this.batches = batches.filter((strokes) => strokes.count > 0).map((strokes) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(strokes.numbers), gl.DYNAMIC_DRAW);
      const { count, bias, haze, clearance } = strokes;
      return { buffer, count, bias, haze, clearance };
    });
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
    gl.uniformMatrix4fv(uniforms.clipFromModel, false, new Float32Array(view.matrix));
    gl.uniform2f(uniforms.size, width, height);
    gl.uniform1f(uniforms.ratio, ratio);
    gl.uniform1f(uniforms.near, view.near);
    gl.uniform3fv(uniforms.background, theme().stage.map((c) => c / 255));
    for (const fringe of [0, 1]) {
      gl.uniform1f(uniforms.fringe, fringe);
      gl.depthMask(!fringe);
      for (const batch of this.batches) this.drawBatch(batch, view);
    }
  }

  drawBatch({ buffer, count, bias, haze, clearance }, { fog: [begins, ends, strength], distance }) {
    const { gl, program } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    for (const [name, size, offset] of STROKE_ATTRIBUTES) {
      const location = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, STROKE_BYTES, offset);
      this.setDivisor(location, 1);
    }
    gl.uniform1f(this.uniforms.bias, bias);
    gl.uniform3f(this.uniforms.fog, begins, ends, strength * haze);
    gl.uniform2f(this.uniforms.clearance, clearance * distance - 1e-6, 2 * clearance * distance);
    this.drawInstances(count);
  }
}
