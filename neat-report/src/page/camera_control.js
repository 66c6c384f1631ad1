// Mouse, touch and keys on the 3D view. A *navigator* (an Orbit, or the view through
// a camera) knows what turning, moving and zooming mean.

const CLICK_MOVES = 5;

/**
 * Listens on a canvas. `viewer` gives `navigator`, `size()`, and is told of
 * `clicked(x, y)`, `doubleClicked(x, y)`, `hovered(x, y)` and `left()`.
 */
function controlCamera(canvas, viewer) {
  const pointers = new Map();
  let moved = 0;
  let dragButton = 0;

  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const middle = (points) => [
    points.reduce((sum, p) => sum + p[0], 0) / points.length,
    points.reduce((sum, p) => sum + p[1], 0) / points.length,
  ];

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, place(event));
    // A gesture of two fingers never ends as a click.
    moved = pointers.size > 1 ? CLICK_MOVES + 1 : 0;
    dragButton = event.button;
  });

  canvas.addEventListener("pointermove", (event) => {
    const now = place(event);
    const before = pointers.get(event.pointerId);
    if (!before) {
      if (event.pointerType === "mouse") viewer.hovered(...now);
      return;
    }
    const { navigator } = viewer;
    const [width, height] = viewer.size();
    const earlier = [...pointers.values()];
    pointers.set(event.pointerId, now);
    const points = [...pointers.values()];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    moved += Math.hypot(dx, dy);
    if (points.length === 1) {
      if (moved <= CLICK_MOVES) return;
      if (dragButton !== 0 || event.shiftKey) navigator.move(dx, dy, width, height);
      else navigator.turn(dx, dy, width, height);
    } else if (points.length === 2) {
      const apart = ([a, b]) => Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 1);
      const [from, to] = [middle(earlier), middle(points)];
      navigator.move(to[0] - from[0], to[1] - from[1], width, height);
      navigator.zoom(apart(points) / apart(earlier), ...to, width, height);
    }
  });

  const released = (event) => {
    const known = pointers.delete(event.pointerId);
    if (known && event.type === "pointerup" && moved <= CLICK_MOVES && event.button === 0) {
      viewer.clicked(...place(event), event.pointerType === "touch" ? 22 : 12);
    }
  };
  canvas.addEventListener("pointerup", released);
  canvas.addEventListener("pointercancel", released);
  canvas.addEventListener("pointerleave", () => viewer.left());
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", (event) => viewer.doubleClicked(...place(event)));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : 1;
    const factor = Math.exp(-clamp(event.deltaY * lines, -240, 240) * 0.0016);
    viewer.navigator.zoom(factor, ...place(event), ...viewer.size());
  }, { passive: false });

  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const [width, height] = viewer.size();
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const arrow = arrows[event.key];
    const zoom = (factor) => viewer.navigator.zoom(factor, width / 2, height / 2, width, height);
    const actions = {
      "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), "_": () => zoom(1 / 1.2),
      0: () => viewer.navigator.reset(), f: () => viewer.fit(), n: () => viewer.step(1),
      p: () => viewer.step(-1), Escape: () => viewer.escape(),
    };
    if (arrow && viewer.through !== null && !event.shiftKey && arrow[0]) viewer.stepThrough(arrow[0]);
    else if (arrow && event.shiftKey) viewer.navigator.move(-30 * arrow[0], -30 * arrow[1], width, height);
    else if (arrow) viewer.navigator.turn(-18 * arrow[0], -18 * arrow[1], width, height);
    else if (actions[event.key]) actions[event.key]();
    else return;
    event.preventDefault();
  });
}
