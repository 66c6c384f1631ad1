// What is drawn in 3D: strokes of the edges, the junctions and the cameras. What the
// pointer changes is apart, so that little is made anew when it moves.

/** Lines and dots (lines without length), for a renderer. */
class Strokes {
  /** Those with the larger bias are drawn over others at about the same depth; `haze`
   * says how much of the view's fog they get, and `clearance` how far before the
   * camera they vanish, as a share of the distance of its target. */
  constructor(bias, haze = 1, clearance = 0) {
    this.bias = bias;
    this.haze = haze;
    this.clearance = clearance;
    this.numbers = [];
  }

  get count() {
    return this.numbers.length / 10;
  }

  line(start, end, color, width) {
    this.numbers.push(...start, ...end, color[0] / 255, color[1] / 255, color[2] / 255, width);
  }

  dot(point, color, width) {
    this.line(point, point, color, width);
  }
}

/** With many edges, and in a small window, thick lines would hide each other. */
function thinness(edges, [width, height]) {
  const room = clamp(Math.min(width, height) / 700, 0.6, 1);
  return clamp(room * Math.sqrt(150 / Math.max(edges, 1)), 0.36, 1);
}

/** Around lines on a photograph, whatever their colour and its. */
const RIM = [18, 22, 28];
const PAPER = [255, 255, 255];

/** Colours and widths of the moment. */
function pens(viewer) {
  const { data, through, state } = viewer;
  const thin = thinness(data.edges.length, viewer.size());
  const onPhotograph = through !== null;
  const colors = theme();
  return {
    colors, thin, onPhotograph,
    ink: onPhotograph ? PAPER : colors.ink,
    edgeWidth: (onPhotograph ? 2.4 : 3) * thin,
    dotWidth: (onPhotograph ? 5 : 6.5) * thin,
    edgeColor: (edge) => edgeColor(state.measure, edge, onPhotograph),
  };
}

/** Everything but what is marked, in the order of drawing. */
function drawScene(viewer) {
  const { data, state } = viewer;
  const pen = pens(viewer);
  const cameras = new Strokes(0, 0.5, 0.3);
  const rims = new Strokes(0);
  const edges = new Strokes(1e-4);
  const dots = new Strokes(2e-4);
  const snapshot = data.evolution[state.snapshot];

  if (state.showCameras && !pen.onPhotograph) {
    const supporting = supportingViews(data, state.selection);
    data.views.forEach((view, index) => {
      if (supporting.has(index)) drawFrustum(cameras, view, pen.colors.accent, 1.4);
      else drawFrustum(cameras, view, pen.colors.muted, 1);
    });
  }
  data.edges.forEach(([a, b], index) => {
    if (!viewer.visible[index]) return;
    const color = pen.edgeColor(index);
    const shown = snapshot ? mixPoints(color, pen.colors.stage, 0.72) : color;
    edges.line(data.points[a], data.points[b], shown, pen.edgeWidth);
    if (pen.onPhotograph) rims.line(data.points[a], data.points[b], RIM, pen.edgeWidth + 1.4);
  });
  for (const points of data.arcs) {
    const shown = snapshot ? mixPoints(pen.ink, pen.colors.stage, 0.72) : pen.ink;
    points.slice(1).forEach((end, index) => {
      edges.line(points[index], end, shown, 0.7 * pen.edgeWidth);
      if (pen.onPhotograph) rims.line(points[index], end, RIM, 0.7 * pen.edgeWidth + 1.4);
    });
  }
  if (snapshot) {
    for (const point of snapshot.points) dots.dot(point, pen.colors.evolution, 6.5 * pen.thin);
  } else if (state.showJunctions) {
    data.points.forEach((point, index) => {
      if (!viewer.junctionVisible[index]) return;
      dots.dot(point, pen.ink, pen.dotWidth);
      if (pen.onPhotograph) rims.dot(point, RIM, pen.dotWidth + 2);
    });
  }
  return [cameras, rims, edges, dots];
}

/** What is chosen and what is under the pointer, over the rest. */
function drawMarked(viewer) {
  const { data, state } = viewer;
  const pen = pens(viewer);
  const rim = new Strokes(3e-4, 0.3);
  const marked = new Strokes(4e-4, 0.3);
  const mark = ({ kind, index }, accent) => {
    if (kind === "view") drawFrustum(marked, data.views[index], accent ?? pen.ink, 2);
    if (kind === "junction") marked.dot(data.points[index], accent ?? pen.ink, accent ? 13 : 11);
    if (kind === "segment") {
      const [start, end] = data.edges[index].map((junction) => data.points[junction]);
      const width = pen.edgeWidth + (accent ? 3 : 2.4);
      if (pen.onPhotograph) rim.line(start, end, RIM, width + 1.4);
      marked.line(start, end, accent ?? pen.edgeColor(index), width);
    }
  };
  const same = state.hover?.kind === state.selection?.kind && state.hover?.index === state.selection?.index;
  if (state.hover && !same) mark(state.hover, null);
  if (state.selection) mark(state.selection, pen.colors.accent);
  return [rim, marked];
}

function drawFrustum(strokes, { position, frustum: corners }, color, width) {
  corners.forEach((corner, i) => {
    strokes.line(position, corner, color, width);
    strokes.line(corner, corners[(i + 1) % 4], color, width);
  });
  // The small roof says which side of the image is its upper one.
  const [left, right, , below] = corners;
  const middle = mixPoints(left, right, 0.5);
  const tip = add(middle, scale(subtract(left, below), 0.22));
  strokes.line(mixPoints(left, right, 0.3), tip, color, width);
  strokes.line(mixPoints(left, right, 0.7), tip, color, width);
}

/** Indices of the views that support a segment, or any segment of a junction. */
function supportingViews(data, selection) {
  const views = new Set();
  if (selection?.kind === "view") return views;
  for (const edge of edgesOf(data, selection)) {
    for (const [view] of data.support[edge] ?? []) views.add(view);
  }
  return views;
}

/** The edges that a selection is about. */
function edgesOf(data, selection) {
  if (selection?.kind === "segment") return [selection.index];
  if (selection?.kind !== "junction") return [];
  return data.edges.flatMap((ends, index) => (ends.includes(selection.index) ? [index] : []));
}
