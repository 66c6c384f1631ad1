// The 3D view: its state, and who draws it when.

/** Whether a change of this part of the state hides or shows edges. */
const filters = (key) => ["minProbability", "minViews", "onlyStructure"].includes(key);

class Viewer {
  constructor(data) {
    this.data = data;
    this.stage = byId("stage");
    this.canvas = byId("scene");
    this.background = byId("photograph");
    this.listeners = [];
    this.state = {
      /** Index of the view that is looked through, or null. */
      through: null,
      measure: data.measures[0],
      minProbability: 0,
      minViews: 0,
      onlyStructure: false,
      showCameras: data.views.length > 0,
      showJunctions: true,
      showFaces: data.faces.length > 0,
      showSegments: false,
      /** { kind: "segment" | "junction" | "view", index } or null. */
      selection: null,
      hover: null,
      /** Index into the evolution of the junctions, or null. */
      snapshot: null,
    };
    this.frame = 0;
    /** Whether the strokes must be made anew: all, or those of what is marked. */
    this.stale = true;
    this.markedStale = true;
    this.orbit = new Orbit(data, () => this.redraw());
    this.navigator = this.orbit;
    this.filter();
    this.renderer = this.chooseRenderer();
    controlCamera(this.canvas, this);
    new ResizeObserver(() => this.change({})).observe(this.stage);
    darkScheme.addEventListener("change", () => this.change({}));
  }

  chooseRenderer() {
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.renderer.layers.clear();
      this.renderer.prepare();
      this.change({});
    });
    try {
      return new WebglRenderer(this.canvas);
    } catch {
      // A canvas that has once tried WebGL cannot draw in 2D.
      const canvas = this.canvas.cloneNode();
      this.canvas.replaceWith(canvas);
      this.canvas = canvas;
      this.notice("This browser offers no WebGL: the wireframe is drawn without it, more slowly.");
      return new CanvasRenderer(canvas);
    }
  }

  notice(text) {
    const notice = byId("notice");
    notice.textContent = text;
    notice.hidden = !text;
  }

  get through() {
    return this.state.through;
  }

  size() {
    return [this.stage.clientWidth, this.stage.clientHeight];
  }

  /** Calls back after every change of the state, with the names of what changed. */
  onChange(listener) {
    this.listeners.push(listener);
  }

  /** Changes the state. */
  change(changes) {
    Object.assign(this.state, changes);
    const keys = Object.keys(changes);
    if (keys.some(filters)) this.filter();
    this.stale ||= !(keys.length === 1 && keys[0] === "hover");
    this.markedStale = true;
    this.redraw();
    for (const listener of this.listeners) listener(keys);
  }

  /** Which edges and junctions pass the filter. */
  filter() {
    const { data, state } = this;
    const probability = data.edgeFields.probability;
    this.visible = data.edges.map((_, edge) =>
      (!probability || probability[edge] >= state.minProbability) &&
      (!data.supportCounts || data.supportCounts[edge] >= state.minViews) &&
      (!state.onlyStructure || data.structure[edge] >= 0.5));
    this.junctionVisible = data.points.map((_, index) => data.degrees[index] === 0);
    data.edges.forEach((ends, edge) => {
      if (this.visible[edge]) for (const end of ends) this.junctionVisible[end] = true;
    });
    this.visibleCount = this.visible.filter(Boolean).length;
  }

  /** Draws before the next frame of the screen. */
  redraw() {
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      this.draw();
    });
  }

  draw() {
    const [width, height] = this.size();
    if (!width || !height) return;
    if (this.stale) {
      this.renderer.loadFaces(drawFaces(this));
      this.renderer.load("scene", drawScene(this));
    }
    if (this.stale || this.markedStale) this.renderer.load("marked", drawMarked(this));
    this.stale = this.markedStale = false;
    this.renderer.draw(this.navigator.view(width, height));
    this.drawAxes();
    this.drawBackground(width, height);
  }

  /** The photograph behind the wireframe. */
  async drawBackground(width, height) {
    const index = this.through;
    if (index === null) return;
    const image = await photographOf(this.data, index);
    if (index !== this.through) return;
    const context = sharpContext(this.background, width, height);
    const view = this.data.views[index];
    const transform = this.navigator.transform(width, height);
    drawImage(context, view, image, transform);
    if (this.state.showSegments || !image) drawSegments(context, view, transform, OBSERVATION_COLOR, 1.4);
  }

  /** The axes of the user's frame in a corner. */
  drawAxes() {
    const svg = byId("axes");
    svg.toggleAttribute("hidden", this.through !== null);
    if (this.through !== null) return;
    const { right, down, forward } = this.orbit.camera();
    const axes = ["X", "Y", "Z"].map((name, i) => ({
      name, x: right[i] * 24, y: down[i] * 24, depth: forward[i],
    }));
    axes.sort((a, b) => b.depth - a.depth);
    svg.replaceChildren(...axes.flatMap(({ name, x, y }) => [
      svgElement("line", { x2: x, y2: y, class: `axis ${name}` }),
      svgElement("text", { x: x * 1.32, y: y * 1.32, class: name }, name),
    ]));
  }

  select(selection) {
    this.change({ selection });
  }

  clicked(x, y, reach) {
    const picked = pick(this, x, y, reach);
    if (picked?.kind === "view") this.lookThrough(picked.index);
    else this.select(picked && { kind: picked.kind, index: picked.index });
  }

  doubleClicked(x, y) {
    if (this.through !== null) return;
    const picked = pick(this, x, y, 24);
    if (picked) this.orbit.center(pickedPoint(this, picked, x, y));
  }

  hovered(x, y) {
    const picked = pick(this, x, y, 9);
    const before = this.state.hover;
    this.canvas.classList.toggle("over", picked !== null);
    if (picked?.kind === before?.kind && picked?.index === before?.index) return;
    this.change({ hover: picked });
  }

  left() {
    if (this.state.hover) this.change({ hover: null });
  }

  /** Shows the selection, or everything. */
  fit() {
    const { data, state } = this;
    if (this.through !== null) return this.navigator.reset();
    const edge = state.selection?.kind === "segment" ? data.edges[state.selection.index] : null;
    if (edge) {
      const [a, b] = edge.map((end) => data.points[end]);
      return this.orbit.fit(mixPoints(a, b, 0.5), Math.max(norm(subtract(a, b)) * 0.75, 0.02));
    }
    if (state.selection?.kind === "junction") {
      return this.orbit.fit(data.points[state.selection.index], 0.3);
    }
    return this.orbit.fit([0, 0, 0], 1);
  }

  /** Chooses the next or the previous segment that passes the filter. */
  step(by) {
    const count = this.data.edges.length;
    const { selection } = this.state;
    let index = selection?.kind === "segment" ? selection.index : by > 0 ? -1 : 0;
    for (let tries = 0; tries < count; tries++) {
      index = (index + by + count) % count;
      if (this.visible[index]) return this.select({ kind: "segment", index });
    }
  }

  /** Looks through a camera, or from outside for null. */
  lookThrough(index) {
    this.orbit.stop();
    this.stage.classList.toggle("through-camera", index !== null);
    this.navigator = index === null ? this.orbit : new ThroughCamera(this.data.views[index], this.data.extent, () => this.redraw());
    this.change({ through: index, hover: null });
  }

  stepThrough(by) {
    const count = this.data.views.length;
    this.lookThrough((this.through + by + count) % count);
  }

  escape() {
    if (this.through !== null) this.lookThrough(null);
    else this.select(null);
  }
}
