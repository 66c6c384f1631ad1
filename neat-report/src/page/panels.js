// The other panels: warnings, cameras, facts and the configuration.

function makeWarnings({ warnings }) {
  if (!warnings.length) return null;
  const { section, content } = panel(countOf(warnings.length, "warning"));
  section.classList.add("warnings");
  content.append(element("ul", {}, ...warnings.map((warning) => element("li", {}, warning))));
  return section;
}

/** Small pictures of all cameras; each leads to the view through it. */
function makeCameras(viewer) {
  const { data } = viewer;
  if (!data.views.length) return null;
  const { section, content } = panel(countOf(data.views.length, "camera"));
  section.id = "cameras";
  const buttons = data.views.map((view, index) => element("button", {
    type: "button", class: "camera", "aria-pressed": "false",
    "aria-label": `Look through camera ${view.name}`, title: view.name,
    onclick: () => viewer.lookThrough(index),
  }, element("canvas"), element("span", {}, view.name)));
  content.append(element("div", { class: "strip" }, ...buttons));

  const draw = async (index) => {
    const canvas = buttons[index].firstChild;
    const { width, height } = canvas.getBoundingClientRect();
    const view = data.views[index];
    const image = await photographOf(data, index);
    const context = sharpContext(canvas, width, height);
    const transform = fitBox([0, 0, ...view.size], width, height, 0);
    drawImage(context, view, image, transform);
    if (!image) drawSegments(context, view, transform, OBSERVATION_COLOR, 0.7);
  };
  // Only what is scrolled into view is decoded.
  const watcher = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      watcher.unobserve(target);
      draw(buttons.indexOf(target));
    }
  });
  for (const button of buttons) watcher.observe(button);
  viewer.onChange(() => {
    const supporting = supportingViews(data, viewer.state.selection);
    buttons.forEach((button, index) => {
      button.setAttribute("aria-pressed", String(viewer.through === index));
      button.classList.toggle("supporting", supporting.has(index));
    });
  });
  return section;
}

function makeFacts({ facts }) {
  if (!facts.length) return null;
  const { section, content } = panel("Facts", { collapsible: true });
  for (const [heading, rows] of facts) {
    content.append(element("h3", {}, heading), definitions(rows));
  }
  return section;
}

function makeConfiguration({ configuration }) {
  if (!configuration) return null;
  const { section, content } = panel("Configuration", { collapsible: true, open: false });
  content.append(element("pre", { tabindex: 0 }, configuration));
  return section;
}

/** The bar above the picture of a camera that is looked through. */
function makeThroughBar(viewer) {
  const bar = byId("through");
  byId("through-previous").addEventListener("click", () => viewer.stepThrough(-1));
  byId("through-next").addEventListener("click", () => viewer.stepThrough(1));
  byId("through-close").addEventListener("click", () => {
    viewer.lookThrough(null);
    viewer.canvas.focus();
  });
  byId("through-segments").addEventListener("click", () => {
    viewer.change({ showSegments: !viewer.state.showSegments });
  });
  viewer.onChange(() => {
    bar.hidden = viewer.through === null;
    const view = viewer.data.views[viewer.through];
    const name = byId("through-name");
    const missing = view && !view.photograph ? " (photograph not embedded)" : "";
    const text = view ? view.name + missing : "";
    if (name.textContent !== text) name.textContent = text;
    byId("through-segments").setAttribute("aria-pressed", String(viewer.state.showSegments));
  });
}

/** The buttons above the 3D view. */
function makeToolbar(viewer) {
  const zoom = (factor) => () => {
    const [width, height] = viewer.size();
    viewer.navigator.zoom(factor, width / 2, height / 2, width, height);
  };
  byId("zoom-in").addEventListener("click", zoom(1.3));
  byId("zoom-out").addEventListener("click", zoom(1 / 1.3));
  byId("frame").addEventListener("click", () => viewer.fit());
  byId("reset").addEventListener("click", () => viewer.navigator.reset());
  for (const [id, key] of [["show-cameras", "showCameras"], ["show-junctions", "showJunctions"], ["show-faces", "showFaces"]]) {
    const button = byId(id);
    const show = () => button.setAttribute("aria-pressed", String(viewer.state[key]));
    button.addEventListener("click", () => viewer.change({ [key]: !viewer.state[key] }));
    viewer.onChange(show);
    show();
  }
  byId("show-cameras").hidden = !viewer.data.views.length;
  byId("show-faces").hidden = !viewer.data.faces.length;
  const [help, keys] = [byId("show-help"), byId("keys")];
  help.addEventListener("click", () => {
    keys.hidden = !keys.hidden;
    help.setAttribute("aria-expanded", String(!keys.hidden));
  });
}
