// The same strokes on a plain canvas, where there is no WebGL: far ones first.

class CanvasRenderer {
  constructor(canvas) {
    this.canvas = canvas;
    this.kind = "canvas";
    this.layers = new Map();
    this.triangles = [];
  }

  load(layer, batches) {
    this.layers.set(layer, batches);
  }

  loadFaces(triangles) {
    this.triangles = triangles;
  }

  draw(view) {
    const { matrix, width, height, near, fog, distance } = view;
    const context = sharpContext(this.canvas, width, height);
    context.lineCap = "round";
    this.drawFaces(context, view);
    const strokes = [];
    for (const { numbers, count, bias, haze, clearance } of [...this.layers.values()].flat()) {
      for (let i = 0; i < 10 * count; i += 10) {
        const stroke = numbers.slice(i, i + 10);
        const ends = projectSegment(matrix, stroke.slice(0, 3), stroke.slice(3, 6), width, height, Math.max(near, 1.5 * clearance * distance));
        if (!ends) continue;
        const depth = (ends[0][2] + ends[1][2]) / 2;
        const share = clamp((depth - fog[0]) / (fog[1] - fog[0]), 0, 1);
        const color = mixPoints(stroke.slice(6, 9).map((c) => c * 255), theme().stage, fog[2] * haze * share);
        strokes.push({ ends, color, width: stroke[9], order: depth - 1000 * bias });
      }
    }
    strokes.sort((a, b) => b.order - a.order);
    for (const { ends: [a, b], color, width: lineWidth } of strokes) {
      context.strokeStyle = cssColor(color);
      context.lineWidth = lineWidth;
      context.beginPath();
      context.moveTo(a[0], a[1]);
      // A line without length would not show; a dot must.
      context.lineTo(b[0] + 0.01, b[1]);
      context.stroke();
    }
  }

  /** Behind all strokes: nothing tells here what hides what. */
  drawFaces(context, { matrix, width, height, near }) {
    context.globalAlpha = FACE_OPACITY;
    for (const { corners, color } of this.triangles) {
      const [a, b, c] = corners.map((corner) => project(matrix, corner, width, height));
      if ([a, b, c].some(([, , depth]) => depth < near)) continue;
      context.fillStyle = cssColor(scale(color, 255));
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.lineTo(c[0], c[1]);
      context.fill();
    }
    context.globalAlpha = 1;
  }
}
