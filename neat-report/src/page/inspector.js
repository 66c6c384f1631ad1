// The panel about what was chosen.

/** So many photographs of a segment are shown at once. */
const FIRST_OBSERVATIONS = 6;

function makeInspector(viewer) {
  const { section, content, heading } = panel("Selection");
  section.id = "inspector";
  section.setAttribute("aria-live", "polite");
  let shown;
  const show = () => {
    const { selection } = viewer.state;
    if (shown === selection) return;
    shown = selection;
    const kinds = { segment: inspectSegment, junction: inspectJunction };
    const inspect = kinds[selection?.kind];
    heading.textContent = inspect ? `${selection.kind === "segment" ? "Segment" : "Junction"} ${selection.index}` : "Selection";
    content.replaceChildren(...(inspect ? inspect(viewer, selection.index) : [hint(viewer)]));
    drawObservations(viewer, content);
  };
  viewer.onChange(show);
  darkScheme.addEventListener("change", () => drawObservations(viewer, content));
  show();
  return section;
}

function hint({ data }) {
  const text = data.views.length
    ? "Click a segment or a junction to see what speaks for it, or a camera to look through it."
    : "Click a segment or a junction to see what is known about it.";
  return element("p", { class: "quiet" }, text);
}

const formatPoint = (point) => point.map((x) => formatNumber(x)).join(", ");

function junctionLink(viewer, index) {
  return element("button", {
    type: "button", class: "link", onclick: () => viewer.select({ kind: "junction", index }),
  }, `Junction ${index}`);
}

function inspectSegment(viewer, edge) {
  const { data } = viewer;
  const rows = [["Length", formatNumber(data.lengths[edge])]];
  for (const measure of data.measures) {
    if (measure.key === "length" || measure.key === "degree") continue;
    rows.push([measure.label, formatNumber(measure.values[edge], 3)]);
  }
  const ends = data.edges[edge].map((junction) =>
    element("li", {}, junctionLink(viewer, junction), ` (${formatPoint(data.junctions[junction])})`));
  return [
    definitions(rows),
    element("h3", {}, "Ends"),
    element("ul", { class: "ends" }, ...ends),
    ...observations(viewer, edge),
  ];
}

function inspectJunction(viewer, index) {
  const { data } = viewer;
  const rows = [["Position", formatPoint(data.junctions[index])]];
  const sigma = data.sigmas[index];
  if (Number.isFinite(sigma)) rows.push(["Uncertainty (σ)", formatNumber(sigma, 3)]);
  for (const [name, values] of Object.entries(data.junctionFields)) {
    if (name !== "sigma") rows.push([name.replaceAll("_", " "), formatNumber(values[index], 3)]);
  }
  const edges = edgesOf(data, { kind: "junction", index }).map((edge) =>
    element("li", {}, element("button", {
      type: "button", class: "link", onclick: () => viewer.select({ kind: "segment", index: edge }),
    }, `Segment ${edge}`), ` (length ${formatNumber(data.lengths[edge])})`));
  return [
    definitions(rows),
    element("h3", {}, countOf(edges.length, "segment")),
    element("ul", { class: "ends" }, ...edges),
  ];
}

/** The photographs in which a segment was seen, those with a photograph and with a
 * small residual first. */
function observations(viewer, edge) {
  const { data } = viewer;
  const list = [...(data.support[edge] ?? [])];
  if (!list.length) {
    const text = data.support.length
      ? "No detected 2D segment supports this one."
      : "This report does not say which 2D segments support it.";
    return [element("h3", {}, "Supporting views"), element("p", { class: "quiet" }, text)];
  }
  const withoutImage = ([view]) => (data.views[view].photograph ? 0 : 1);
  list.sort((a, b) => withoutImage(a) - withoutImage(b) || a[2] - b[2]);
  const cards = element("div", { class: "observations" });
  const showMore = (count) => {
    const next = list.slice(cards.childElementCount, count);
    cards.append(...next.map((item) => observationCard(viewer, edge, item)));
    drawObservations(viewer, cards);
  };
  showMore(FIRST_OBSERVATIONS);
  const more = [];
  if (list.length > FIRST_OBSERVATIONS) {
    const showAll = () => {
      showMore(list.length);
      more[0].remove();
    };
    more.push(element("button", { type: "button", class: "more", onclick: showAll }, `Show all ${list.length}`));
  }
  const views = new Set(list.map(([view]) => view)).size;
  return [
    element("h3", {}, countOf(views, "supporting view")),
    element("p", { class: "key" },
      element("span", { class: "swatch observed" }), "2D segment ",
      element("span", { class: "swatch projected" }), "this edge projected"),
    cards, ...more,
  ];
}

function observationCard(viewer, edge, [viewIndex, [x0, y0, x1, y1], residual]) {
  const view = viewer.data.views[viewIndex];
  const canvas = element("canvas", { "data-view": viewIndex, "data-edge": edge });
  canvas.observed = [[x0, y0], [x1, y1]];
  return element("button", {
    type: "button", class: "observation", "data-view": viewIndex,
    "aria-label": `Enlarge view ${view.name}, residual ${formatNumber(residual, 2)} pixels`,
    onclick: () => enlarge(viewer, edge, viewIndex, canvas.observed),
  }, canvas, element("span", { class: "name" }, view.name),
  element("span", { class: "residual" }, `${formatNumber(residual, 2)} px`));
}

/** Draws the pictures below an element, once they have a size on the page. */
function drawObservations(viewer, parent) {
  requestAnimationFrame(() => {
    for (const canvas of parent.querySelectorAll("canvas[data-edge]")) {
      const { view, edge } = canvas.dataset;
      drawObservation(canvas, viewer.data, Number(view), Number(edge), canvas.observed, false);
    }
  });
}

/** Shows the whole image of an observation above the page. */
function enlarge(viewer, edge, viewIndex, observed) {
  const { data } = viewer;
  const dialog = byId("enlarged");
  const view = data.views[viewIndex];
  const canvas = element("canvas", { role: "img", "aria-label": `Segment ${edge} in view ${view.name}` });
  const close = () => dialog.close();
  dialog.replaceChildren(
    element("header", {},
      element("h2", { id: "enlarged-name" }, view.name),
      element("button", { type: "button", onclick: () => { close(); viewer.lookThrough(viewIndex); } }, "Look through this camera"),
      element("button", { type: "button", onclick: close }, "Close")),
    canvas);
  dialog.onclick = (event) => { if (event.target === dialog) close(); };
  dialog.showModal();
  const [width, height] = view.size;
  const room = Math.min((window.innerWidth * 0.92) / width, (window.innerHeight * 0.8) / height);
  canvas.style.width = `${Math.round(width * room)}px`;
  canvas.style.height = `${Math.round(height * room)}px`;
  drawObservation(canvas, data, viewIndex, edge, observed, true);
}
