// What is under the pointer.

/**
 * The junction, segment or camera nearest to (x, y) of the viewport, within `reach`
 * pixels; null where there is none. Junctions come before segments, and these before
 * cameras; of segments at about the same distance the nearer one to the camera wins.
 */
function pick(viewer, x, y, reach) {
  const { data, state, through } = viewer;
  const [width, height] = viewer.size();
  const { matrix, near } = viewer.navigator.view(width, height);
  let best = null;
  const offer = (kind, index, distance, depth, limit) => {
    if (distance > limit) return;
    const cost = distance + 0.5 * depth;
    if (!best || cost < best.cost) best = { kind, index, cost };
  };

  if (state.showJunctions) {
    data.points.forEach((point, index) => {
      if (!viewer.junctionVisible[index]) return;
      const [px, py, depth] = project(matrix, point, width, height);
      if (depth > near) offer("junction", index, Math.hypot(px - x, py - y), depth, 0.6 * reach);
    });
  }
  if (best) return best;
  data.edges.forEach(([a, b], index) => {
    if (!viewer.visible[index]) return;
    const ends = projectSegment(matrix, data.points[a], data.points[b], width, height, near);
    if (!ends) return;
    const { distance, depth } = distanceToSegment(x, y, ends);
    offer("segment", index, distance, depth, reach);
  });
  if (best || !state.showCameras || through !== null) return best;
  const clear = Math.max(near, 0.45 * viewer.navigator.pose.distance);
  data.views.forEach(({ position, frustum: corners }, index) => {
    corners.forEach((corner, i) => {
      for (const end of [position, corners[(i + 1) % 4]]) {
        const ends = projectSegment(matrix, corner, end, width, height, clear);
        if (!ends) continue;
        const { distance, depth } = distanceToSegment(x, y, ends);
        offer("view", index, distance, depth, 0.6 * reach);
      }
    });
  });
  return best;
}

/** Distance in pixels from (x, y) to a projected segment, and its depth there. */
function distanceToSegment(x, y, [a, b]) {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const squared = dx * dx + dy * dy;
  const t = squared > 0 ? clamp(((x - a[0]) * dx + (y - a[1]) * dy) / squared, 0, 1) : 0;
  return { distance: Math.hypot(a[0] + t * dx - x, a[1] + t * dy - y), depth: mix(a[2], b[2], t), t };
}

/** The point of the model that was picked at (x, y). */
function pickedPoint(viewer, { kind, index }, x, y) {
  const { data } = viewer;
  if (kind === "junction") return data.points[index];
  if (kind === "view") return data.views[index].position;
  const [width, height] = viewer.size();
  const { matrix, near } = viewer.navigator.view(width, height);
  const [a, b] = data.edges[index].map((end) => data.points[end]);
  const ends = projectSegment(matrix, a, b, width, height, near);
  if (!ends) return mixPoints(a, b, 0.5);
  const { t } = distanceToSegment(x, y, ends);
  // Linear on the screen is not linear in space: depths correct it.
  const s = (t / ends[1][2]) / ((1 - t) / ends[0][2] + t / ends[1][2]);
  return mixPoints(a, b, s);
}
