// Curves over the steps of the training: one small chart each.

const CHART = { width: 300, height: 132, left: 46, right: 8, top: 8, bottom: 20 };

function makeCharts(viewer) {
  const { data } = viewer;
  const curves = data.curves.filter((curve) => curve.points.some(([, value]) => value !== null));
  if (!curves.length) return null;
  const { section, content } = panel("Training", { collapsible: true });
  section.id = "charts";
  const charts = curves.map(makeChart);
  content.append(element("div", { class: "charts" }, ...charts.map((chart) => chart.figure)));
  viewer.onChange((keys) => {
    if (!keys.includes("snapshot")) return;
    const snapshot = data.evolution[viewer.state.snapshot];
    for (const chart of charts) chart.mark(snapshot ? snapshot.step : null);
  });
  return section;
}

function makeChart(curve) {
  const points = curve.points.filter(([, value]) => value !== null);
  const values = points.map(([, value]) => value);
  const logarithmic = Math.min(...values) > 0 && Math.max(...values) > 50 * Math.min(...values);
  const height = logarithmic ? Math.log10 : (x) => x;
  const x = axis(points.map(([step]) => step), CHART.left, CHART.width - CHART.right);
  const y = axis(values.map(height), CHART.height - CHART.bottom, CHART.top);
  const marker = svgElement("line", { class: "marker", y1: CHART.top, y2: CHART.height - CHART.bottom, hidden: true });
  const dot = svgElement("circle", { class: "dot", r: 3.5, hidden: true });
  const value = element("output");
  const svg = svgElement("svg", {
    viewBox: `0 0 ${CHART.width} ${CHART.height}`, role: "img",
    "aria-label": `${curve.name}: from ${formatNumber(values[0], 3)} to ${formatNumber(values.at(-1), 3)}`,
  }, ...axisLines(x, y, logarithmic),
  svgElement("path", { class: "curve", d: path(curve.points, x, (v) => y.place(height(v))) }), marker, dot);
  const figure = element("figure", { class: "chart" },
    element("figcaption", {}, element("span", {}, curve.name + (logarithmic ? " (log scale)" : "")), value), svg);

  const show = (step) => {
    const [at, v] = nearest(points, step);
    value.textContent = `${formatNumber(v, 3)} at step ${at}`;
    dot.setAttribute("cx", x.place(at));
    dot.setAttribute("cy", y.place(height(v)));
  };
  const mark = (step) => {
    marker.toggleAttribute("hidden", step === null);
    dot.toggleAttribute("hidden", step === null);
    show(step ?? points.at(-1)[0]);
    if (step === null) return;
    marker.setAttribute("x1", x.place(step));
    marker.setAttribute("x2", x.place(step));
  };
  svg.addEventListener("pointermove", (event) => {
    const box = svg.getBoundingClientRect();
    dot.removeAttribute("hidden");
    show(x.value(((event.clientX - box.left) / box.width) * CHART.width));
  });
  svg.addEventListener("pointerleave", () => mark(null));
  mark(null);
  return { figure, mark };
}

/** Numbers spread between two places of a chart. */
function axis(numbers, from, to) {
  const low = Math.min(...numbers);
  const high = Math.max(...numbers);
  const range = high - low || 1;
  return {
    low, high,
    place: (number) => from + ((number - low) / range) * (to - from),
    value: (place) => low + ((place - from) / (to - from)) * range,
  };
}

function axisLines(x, y, logarithmic) {
  const label = (number) => formatNumber(logarithmic ? 10 ** number : number, 3);
  const bottom = CHART.height - CHART.bottom;
  const lines = [[y.low, bottom], [y.high, CHART.top]].flatMap(([number, place]) => [
    svgElement("line", { class: "grid", x1: CHART.left, x2: CHART.width - CHART.right, y1: place, y2: place }),
    svgElement("text", { class: "tick", x: CHART.left - 6, y: place + 3.5, "text-anchor": "end" }, label(number)),
  ]);
  const steps = [[x.low, CHART.left, "start"], [x.high, CHART.width - CHART.right, "end"]];
  return lines.concat(steps.map(([step, place, anchor]) =>
    svgElement("text", { class: "tick", x: place, y: CHART.height - 6, "text-anchor": anchor }, String(step))));
}

/** A path that breaks where a value is missing. */
function path(points, x, place) {
  let pen = "M";
  return points.map(([step, value]) => {
    if (value === null) {
      pen = "M";
      return "";
    }
    const command = `${pen}${x.place(step).toFixed(1)} ${place(value).toFixed(1)}`;
    pen = "L";
    return command;
  }).join("");
}

function nearest(points, step) {
  return points.reduce((best, point) => (Math.abs(point[0] - step) < Math.abs(best[0] - step) ? point : best));
}
