// The data of the report, with what follows from them. *Model* coordinates have the
// wireframe around the origin with radius 1, so that 32 bits suffice to draw it,
// wherever and however large it is in the frame of the files.

/** Reads the report's JSON from the page. */
function readData() {
  const data = JSON.parse(byId("data").textContent);
  data.frame = modelFrame(data);
  const toModel = (p) => scale(subtract(p, data.frame.center), 1 / data.frame.radius);
  data.toModel = toModel;
  data.points = data.junctions.map(toModel);
  data.arcs = data.arcs.map((points) => points.map(toModel));
  data.within = data.within.map(toModel);
  data.faces = lightFaces(data);
  data.degrees = data.junctions.map(() => 0);
  for (const ends of data.edges) for (const end of ends) data.degrees[end]++;
  data.lengths = data.edges.map(([a, b]) => norm(subtract(data.junctions[a], data.junctions[b])));
  for (const view of data.views) Object.assign(view, viewAxes(view), { position: toModel(view.center) });
  const size = frustumSize(data.views);
  for (const view of data.views) view.frustum = frustum(view, size);
  /** Everything that is drawn is nearer to the origin than this. */
  data.extent = data.points.concat(data.views.map((view) => view.position))
    .reduce((most, point) => Math.max(most, norm(point)), 1) + 1;
  data.up = upDirection(data);
  data.structure = structureOf(data);
  data.supportCounts = supportCounts(data);
  data.measures = edgeMeasures(data);
  for (const snapshot of data.evolution) snapshot.points = decodePoints(snapshot.junctions, toModel);
  return data;
}

/** Centre and radius of the bulk of the junctions: a stray one must not shrink the rest. */
function modelFrame(data) {
  const points = data.junctions.length ? data.junctions : data.views.map((view) => view.center);
  if (!points.length) return { center: [0, 0, 0], radius: 1 };
  const axes = [0, 1, 2].map((axis) => points.map((p) => p[axis]).sort((a, b) => a - b));
  const center = axes.map((x) => (quantile(x, 0.02) + quantile(x, 0.98)) / 2);
  const distances = points.map((p) => norm(subtract(p, center))).sort((a, b) => a - b);
  return { center, radius: quantile(distances, 0.98) || 1 };
}

/** The camera's axes in the world: the columns of its rotation. */
function viewAxes({ rotation: r }) {
  const column = (i) => [r[0][i], r[1][i], r[2][i]];
  return { right: column(0), down: column(1), forward: column(2) };
}

/** A third of the usual distance between neighbouring cameras, within reason. */
function frustumSize(views) {
  const nearest = views.map((view) => {
    const others = views.filter((other) => other !== view);
    return Math.min(...others.map((other) => norm(subtract(other.position, view.position))));
  });
  const usual = quantile(nearest.filter(Number.isFinite).sort((a, b) => a - b), 0.5);
  return clamp((usual ?? 0.5) / 3, 0.05, 0.2);
}

/** The four corners of a camera's image at depth `size`, in model coordinates. */
function frustum({ size: [width, height], intrinsics, position, right, down, forward }, size) {
  const [fx, fy, cx, cy, skew] = intrinsics;
  return [[0, 0], [width, 0], [width, height], [0, height]].map(([u, v]) => {
    const y = (v - cy) / fy;
    const x = (u - cx - skew * y) / fx;
    const direction = add(add(scale(right, x), scale(down, y)), forward);
    return add(position, scale(direction, size));
  });
}

const cosine = (degrees) => Math.cos((degrees * Math.PI) / 180);

/**
 * Where up is: about what is up in the photographs. A coordinate axis that is almost
 * that, or else the direction of the most edges near it, stands upright. Cameras that
 * cancel out leave +z.
 */
function upDirection({ views, edges, points }) {
  const sum = views.reduce((total, { down }) => subtract(total, down), [0, 0, 0]);
  if (norm(sum) < 0.05 * views.length || !views.length) return [0, 0, 1];
  const up = normalize(sum);
  for (const axis of [0, 1, 2]) {
    if (Math.abs(up[axis]) > cosine(10)) {
      return [0, 1, 2].map((i) => (i === axis ? Math.sign(up[axis]) : 0));
    }
  }
  // Photographs of an object on a table look down on it, and so are tilted.
  const steep = edges.map(([a, b]) => subtract(points[b], points[a]))
    .map((edge) => (dot(edge, up) < 0 ? scale(edge, -1) : edge))
    .filter((edge) => dot(edge, up) > cosine(35) * norm(edge))
    .sort((a, b) => norm(b) - norm(a)).slice(0, 400);
  const along = (direction) => steep.filter((edge) => dot(edge, direction) > cosine(3) * norm(edge))
    .reduce(add, [0, 0, 0]);
  const best = steep.map((edge) => along(normalize(edge)))
    .reduce((most, bundle) => (norm(bundle) > norm(most) ? bundle : most), [0, 0, 0]);
  // A few parallel edges may be anything.
  const total = steep.reduce((length, edge) => length + norm(edge), 0);
  return norm(best) > 0.3 * total && steep.length >= 6 ? normalize(best) : up;
}

/** How likely each edge is of the shape of things and not on it; null where nobody says. */
function structureOf({ edgeFields: { crease, boundary } }) {
  return crease && boundary ? crease.map((value, edge) => value + boundary[edge]) : null;
}

/** In how many views each edge has support; null where nothing is known of it. */
function supportCounts({ edgeFields, support }) {
  if (edgeFields.supporting_views) return edgeFields.supporting_views;
  if (!support.length) return null;
  return support.map((list) => new Set(list.map(([view]) => view)).size);
}

/**
 * What can colour the edges: `good` says which end of the scale deserves trust, and
 * `range` which values the scale spans.
 */
function edgeMeasures(data) {
  const { edges, edgeFields, support, sigmas, degrees, lengths, supportCounts } = data;
  const measures = [];
  const offer = (key, label, values, options = {}) => {
    if (!values || !values.length || !values.some(Number.isFinite)) return;
    measures.push({ key, label, values, range: options.range ?? spread(values), ...options });
  };
  offer("probability", "Probability", edgeFields.probability, { good: "high", range: [0, 1] });
  offer("structure", "Structure, not paint or shadow", data.structure, { good: "high", range: [0, 1] });
  offer("support", "Supporting views", supportCounts, { good: "high", whole: true });
  const residuals = edgeFields.residual_in_pixels ?? support.map(rootMeanSquare);
  offer("residual", "Residual in pixels", residuals, { good: "low" });
  const known = ([a, b]) => Number.isFinite(sigmas[a]) && Number.isFinite(sigmas[b]);
  const sigmaOf = ([a, b]) => (known([a, b]) ? Math.max(sigmas[a], sigmas[b]) : null);
  offer("sigma", "Uncertainty of the ends (σ)", sigmas.length ? edges.map(sigmaOf) : null, { good: "low" });
  offer("degree", "Edges at its ends", edges.map(([a, b]) => Math.min(degrees[a], degrees[b])), { whole: true });
  offer("length", "Length", lengths);
  const named = ["probability", "supporting_views", "residual_in_pixels"];
  for (const [name, values] of Object.entries(edgeFields)) {
    if (!named.includes(name)) offer(`field ${name}`, name.replaceAll("_", " "), values);
  }
  return measures;
}

function rootMeanSquare(list) {
  if (!list.length) return null;
  return Math.sqrt(list.reduce((sum, [, , residual]) => sum + residual * residual, 0) / list.length);
}

/** The range of a scale: most values; a few that are far off would leave one colour to
 * all others. */
function spread(values) {
  const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
  const [low, high] = [quantile(sorted, 0.02), quantile(sorted, 0.93)];
  return [low, high > low ? high : low + 1e-9 + Math.abs(low) * 1e-6];
}

/** Little-endian 32-bit floats in base64, as points in model coordinates. */
function decodePoints(base64, toModel) {
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const numbers = new DataView(bytes.buffer);
  const points = [];
  for (let offset = 0; offset + 12 <= bytes.length; offset += 12) {
    const point = [0, 4, 8].map((i) => numbers.getFloat32(offset + i, true));
    if (point.every(Number.isFinite)) points.push(toModel(point));
  }
  return points;
}
