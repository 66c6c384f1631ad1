// Photographs, the view through a camera, and pictures of what a view saw of an edge.

const photographs = new Map();

/** The decoded photograph of a view as a promise, or null where there is none. */
function photographOf(data, index) {
  const { photograph } = data.views[index];
  if (!photograph) return null;
  if (!photographs.has(index)) {
    const image = new Image();
    image.src = `data:image/jpeg;base64,${photograph}`;
    photographs.set(index, image.decode().then(() => image, () => null));
  }
  return photographs.get(index);
}

/** A point in model coordinates → pixels of a view from its corner, with the depth. */
function projectIntoView({ intrinsics: [fx, fy, cx, cy, skew], position, right, down, forward }, point) {
  const offset = subtract(point, position);
  const [x, y, depth] = [dot(right, offset), dot(down, offset), dot(forward, offset)];
  return [(fx * x + skew * y) / depth + cx, (fy * y) / depth + cy, depth];
}

/** An edge as a view sees it, cut off behind the camera: [[x, y], [x, y]] or null. */
function edgeInView(data, view, edge) {
  let [a, b] = data.edges[edge].map((end) => data.points[end]);
  const depth = (point) => dot(view.forward, subtract(point, view.position));
  const near = 1e-3;
  if (depth(a) < near && depth(b) < near) return null;
  const cut = mixPoints(a, b, (near - depth(a)) / (depth(b) - depth(a)));
  if (depth(a) < near) a = cut;
  else if (depth(b) < near) b = cut;
  return [projectIntoView(view, a), projectIntoView(view, b)];
}

/** Draws a view's image, or grey, where pixel (u, v) of the image is to appear at
 * `zoom · (u, v) + offset`. */
function drawImage(context, view, image, { zoom, offset }) {
  const [width, height] = view.size;
  const box = [offset[0], offset[1], width * zoom, height * zoom];
  context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--blank");
  context.fillRect(...box);
  if (image) context.drawImage(image, ...box);
}

/** A line between two points of the image, with a dark rim so that it shows on any
 * photograph; a dashed one without, so that it does not cover what is below. */
function drawLine(context, { zoom, offset }, [a, b], color, width, dash = []) {
  const rim = ["rgb(0 0 0 / 0.55)", width + Math.min(width, 2)];
  context.lineCap = dash.length ? "butt" : "round";
  context.setLineDash(dash);
  for (const [style, lineWidth] of dash.length ? [[color, width]] : [rim, [color, width]]) {
    context.strokeStyle = style;
    context.lineWidth = lineWidth;
    context.beginPath();
    context.moveTo(a[0] * zoom + offset[0], a[1] * zoom + offset[1]);
    context.lineTo(b[0] * zoom + offset[0], b[1] * zoom + offset[1]);
    context.stroke();
  }
  context.setLineDash([]);
}

/** All 2D segments of a view. */
function drawSegments(context, view, transform, color, width) {
  for (const [x0, y0, x1, y1] of view.segments) {
    drawLine(context, transform, [[x0, y0], [x1, y1]], color, width);
  }
}

const OBSERVATION_COLOR = "#ffd23e";

/**
 * Draws what a view saw of an edge: the image around it, the 2D segment, and the edge
 * projected. `whole` shows the image whole instead of the part around the edge.
 */
async function drawObservation(canvas, data, viewIndex, edge, observed, whole) {
  const { width, height } = canvas.getBoundingClientRect();
  if (!width || !height) return;
  const view = data.views[viewIndex];
  const image = await photographOf(data, viewIndex);
  const context = sharpContext(canvas, width, height);
  const projected = edgeInView(data, view, edge);
  const segments = [observed, projected].filter(Boolean);
  const transform = whole
    ? fitBox([0, 0, ...view.size], width, height, 0)
    : fitBox(cropAround(segments, view.size), width, height, 0);
  drawImage(context, view, image, transform);
  if (!image) drawSegments(context, view, transform, OBSERVATION_COLOR, 1);
  if (observed) drawLine(context, transform, observed, OBSERVATION_COLOR, whole ? 3 : 4);
  if (projected) drawLine(context, transform, projected, cssColor(theme().accent), 2, [7, 5]);
}

/** The box of the segments with a margin, not tiny and not larger than the image. */
function cropAround(segments, [width, height]) {
  const points = segments.flat();
  const xs = points.map((p) => clamp(p[0], 0, width));
  const ys = points.map((p) => clamp(p[1], 0, height));
  const box = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  const least = Math.max(width, height) / 6;
  const margin = 0.14 * Math.max(box[2] - box[0], box[3] - box[1], least);
  const grow = (low, high) => {
    const extra = Math.max(margin, (least - (high - low)) / 2);
    return [low - extra, high + extra];
  };
  const [x, y] = [grow(box[0], box[2]), grow(box[1], box[3])];
  return [x[0], y[0], x[1], y[1]];
}

/** Zoom and offset that bring a box of the image into the middle of a canvas. */
function fitBox([x0, y0, x1, y1], width, height, margin) {
  const zoom = Math.min((width - 2 * margin) / (x1 - x0), (height - 2 * margin) / (y1 - y0));
  const offset = [width / 2 - (zoom * (x0 + x1)) / 2, height / 2 - (zoom * (y0 + y1)) / 2];
  return { zoom, offset };
}

/** Looking through a camera of the report: the image stays flat, so that turning
 * moves it. */
class ThroughCamera {
  constructor(view, extent, changed) {
    this.camera = view;
    this.far = norm(view.position) + extent;
    this.changed = changed;
    this.magnification = 1;
    this.shift = [0, 0];
  }

  /** Where the image is in a viewport. */
  transform(width, height) {
    const whole = fitBox([0, 0, ...this.camera.size], width, height, 12);
    const zoom = whole.zoom * this.magnification;
    const place = (i, extent) => extent / 2 + this.shift[i] - (zoom * this.camera.size[i]) / 2;
    return { zoom, offset: [place(0, width), place(1, height)] };
  }

  view(width, height) {
    const { intrinsics: [fx, fy, cx, cy, skew], position, right, down, forward } = this.camera;
    const { zoom, offset } = this.transform(width, height);
    const pinhole = {
      fx: fx * zoom, fy: fy * zoom, skew: skew * zoom,
      cx: cx * zoom + offset[0], cy: cy * zoom + offset[1],
    };
    const projection = pinholeProjection(pinhole, width, height, 1e-3, this.far);
    const matrix = multiply(projection, cameraFromWorld(right, down, forward, position));
    return { matrix, width, height, near: 1e-3, distance: 0, fog: [0, 1, 0] };
  }

  move(dx, dy) {
    this.shift = [this.shift[0] + dx, this.shift[1] + dy];
    this.changed();
  }

  turn(dx, dy) {
    this.move(dx, dy);
  }

  zoom(factor, x, y, width, height) {
    const before = this.magnification;
    this.magnification = clamp(before * factor, 0.5, 40);
    const by = this.magnification / before;
    const about = [x - width / 2, y - height / 2];
    this.shift = [0, 1].map((i) => about[i] - (about[i] - this.shift[i]) * by);
    this.changed();
  }

  reset() {
    this.magnification = 1;
    this.shift = [0, 0];
    this.changed();
  }
}
