// Faces: translucent triangles between the edges, lit so that planes differ.

const FACE_OPACITY = 0.13;
/** Where the light comes from, in the world: planes of a box get three shades. */
const LIGHT = normalize([0.35, 0.55, 0.76]);

/** Corners and shades of the triangles of each face, and its edges. */
function lightFaces({ points, arcs, within, faces }) {
  // As the triangles count: behind the junctions those of the arcs and splines, a closed one's first once,
  // and then those along rims of domes and within faces.
  const isClosed = (arc) => norm(subtract(arc[0], arc[arc.length - 1])) === 0;
  const vertices = points.concat(...arcs.map((arc) => (isClosed(arc) ? arc.slice(0, -1) : arc)), within);
  return faces.map(({ edges, triangles }) => ({
    edges,
    triangles: triangles.map((triangle) => {
      const corners = triangle.map((vertex) => vertices[vertex]);
      const [a, b, c] = corners;
      const normal = normalize(cross(subtract(b, a), subtract(c, a)));
      return { corners, shade: Math.abs(dot(normal, LIGHT)) };
    }),
  }));
}

/** The triangles for a renderer, with colours from 0 to 1, of the faces all of whose edges are
 * shown. */
function drawFaces(viewer) {
  const { data, state, through, visible } = viewer;
  if (!state.showFaces || through !== null || state.snapshot !== null) return [];
  const { face, stage } = theme();
  return data.faces.filter(({ edges }) => edges.every((edge) => visible[edge]))
    .flatMap(({ triangles }) => triangles.map(({ corners, shade }) => ({
      corners,
      color: scale(mixPoints(face, stage, 0.5 * shade), 1 / 255),
    })));
}

const FACE_VERTEX_SHADER = `
attribute vec3 position, tint;
uniform mat4 clipFromModel;
varying vec3 shade;

void main() {
  shade = tint;
  gl_Position = clipFromModel * vec4(position, 1.0);
}`;

const FACE_FRAGMENT_SHADER = `
precision mediump float;
uniform float opacity;
varying vec3 shade;

void main() {
  gl_FragColor = vec4(shade, 1.0) * opacity;
}`;

/** Faces by WebGL, between the bodies of the strokes, which hide them, and their rims. */
class FacePainter {
  constructor(gl) {
    this.gl = gl;
    this.program = linkedProgram(gl, FACE_VERTEX_SHADER, FACE_FRAGMENT_SHADER);
    this.attributes = ["position", "tint"].map((name) => gl.getAttribLocation(this.program, name));
    [this.clipFromModel, this.opacity] = ["clipFromModel", "opacity"]
      .map((name) => gl.getUniformLocation(this.program, name));
    this.buffer = gl.createBuffer();
    this.count = 0;
  }

  load(triangles) {
    const { gl } = this;
    const numbers = triangles.flatMap(({ corners, color }) => corners.flatMap((corner) => [...corner, ...color]));
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    this.count = 3 * triangles.length;
  }

  draw(view) {
    if (!this.count) return;
    const { gl } = this;
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(this.clipFromModel, false, new Float32Array(view.matrix));
    gl.uniform1f(this.opacity, FACE_OPACITY);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    this.attributes.forEach((location, index) => {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, 3, gl.FLOAT, false, 24, 12 * index);
    });
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLES, 0, this.count);
  }
}
