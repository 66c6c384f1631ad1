// Puts the page together.

function start() {
  const data = readData();
  byId("title").textContent = data.title || "Untitled scene";
  byId("summary").textContent = [
    countOf(data.junctions.length, "junction"),
    countOf(data.edges.length, "segment"),
    countOf(data.views.length, "view"),
  ].join(" · ");
  const viewer = new Viewer(data);
  makeToolbar(viewer);
  makeThroughBar(viewer);
  makeLegend(viewer);
  const panels = [
    makeWarnings(data), makeInspector(viewer), makeFilter(viewer), makeEvolution(viewer),
    makeCameras(viewer), makeCharts(viewer), makeFacts(data), makeConfiguration(data),
  ];
  byId("panels").append(...panels.filter(Boolean));
  if (!data.edges.length) viewer.notice("The wireframe has no segments.");
  // For tests and for curious people at the console.
  window.neat = {
    data, viewer,
    /** Where a point in model coordinates is in the 3D view, in pixels. */
    locate(point) {
      const [width, height] = viewer.size();
      return project(viewer.navigator.view(width, height).matrix, point, width, height);
    },
  };
}

try {
  start();
} catch (error) {
  const notice = byId("notice");
  notice.textContent = `This browser cannot show the report: ${error.message}`;
  notice.hidden = false;
  throw error;
}
