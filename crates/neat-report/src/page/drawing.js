// What is drawn in 3D: strokes of the edges, the junctions and the cameras.

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

/** Everything, in the order of drawing. */
function drawScene(viewer) {
  const { data, state, through } = viewer;
  const cameras = new Strokes(0, 0.5, 0.3);
  const rims = new Strokes(0);
  const edges = new Strokes(1e-4);
  const dots = new Strokes(2e-4);
  const marked = new Strokes(4e-4, 0.3);
  const colors = theme();
  const onPhotograph = through !== null;
  const ink = onPhotograph ? PAPER : colors.ink;
  const thin = thinness(data.edges.length, viewer.size());
  const snapshot = data.evolution[state.snapshot];
  const chosen = (kind, index) => (item) => item?.kind === kind && item.index === index;
  const is = (item, kind, index) => chosen(kind, index)(item);

  if (state.showCameras && !onPhotograph) {
    const supporting = supportingViews(data, state.selection);
    data.views.forEach((view, index) => {
      const picked = is(state.selection, "view", index);
      const hot = picked || is(state.hover, "view", index);
      const color = picked || supporting.has(index) ? colors.accent : hot ? colors.ink : colors.muted;
      drawFrustum(cameras, view, color, hot ? 2 : supporting.has(index) ? 1.4 : 1);
    });
  }
  data.edges.forEach(([a, b], index) => {
    if (!viewer.visible[index]) return;
    const [start, end] = [data.points[a], data.points[b]];
    const picked = is(state.selection, "segment", index);
    const hot = is(state.hover, "segment", index);
    let color = edgeColor(state.measure, index, onPhotograph);
    if (snapshot && !picked) color = mixPoints(color, colors.stage, 0.72);
    const width = (onPhotograph ? 2.4 : 3) * thin;
    if (onPhotograph) rims.line(start, end, RIM, (picked ? width + 3 : width) + 1.4);
    if (picked) marked.line(start, end, colors.accent, width + 3);
    else (hot ? marked : edges).line(start, end, color, hot ? width + 2.4 : width);
  });
  if (snapshot) {
    for (const point of snapshot.points) dots.dot(point, colors.evolution, 6.5 * thin);
  }
  data.points.forEach((point, index) => {
    const picked = is(state.selection, "junction", index);
    const hot = is(state.hover, "junction", index);
    if (picked || hot) marked.dot(point, picked ? colors.accent : ink, picked ? 13 : 11);
    else if (state.showJunctions && !snapshot && viewer.junctionVisible[index]) {
      const width = (onPhotograph ? 5 : 6.5) * thin;
      if (onPhotograph) rims.dot(point, RIM, width + 2);
      dots.dot(point, ink, width);
    }
  });
  return [cameras, rims, edges, dots, marked];
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
