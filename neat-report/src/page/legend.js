// What the colours mean, and which edges are shown.

const LEGEND_WIDTH = 220;
const LEGEND_BINS = 22;

function makeLegend(viewer) {
  const { data, state } = viewer;
  const box = byId("legend");
  if (!data.measures.length) {
    box.hidden = true;
    return;
  }
  const choice = element("select", {
    id: "color-by",
    onchange: () => viewer.change({ measure: data.measures[choice.selectedIndex] }),
  }, ...data.measures.map((measure) => element("option", { value: measure.key }, measure.label)));
  const picture = svgElement("svg", { class: "scale", viewBox: `0 0 ${LEGEND_WIDTH} 40`, role: "img" });
  const low = element("span");
  const high = element("span");
  box.append(
    element("label", {}, "Colour ", choice), picture,
    element("div", { class: "ends" }, low, high));
  const draw = () => {
    const { measure } = state;
    const digits = measure.whole ? 6 : 3;
    const beyond = (test) => measure.values.some((value) => value !== null && test(value));
    const [from, to] = measure.range;
    low.textContent = (beyond((value) => value < from) ? "≤ " : "") + formatNumber(from, digits);
    high.textContent = (beyond((value) => value > to) ? "≥ " : "") + formatNumber(to, digits);
    picture.setAttribute("aria-label",
      `${measure.label} from ${low.textContent} to ${high.textContent}, and how often each value occurs`);
    picture.replaceChildren(...histogram(measure, scaleOf(measure, viewer.through !== null)));
  };
  viewer.onChange((keys) => { if (keys.includes("measure") || keys.includes("through")) draw(); });
  darkScheme.addEventListener("change", draw);
  draw();
}

/** Bars over a band of colours: how many edges have which value. */
function histogram(measure, colors) {
  const [low, high] = measure.range;
  const counts = new Array(LEGEND_BINS).fill(0);
  for (const value of measure.values) {
    if (!Number.isFinite(value)) continue;
    const bin = Math.floor(((value - low) / (high - low)) * LEGEND_BINS);
    counts[clamp(bin, 0, LEGEND_BINS - 1)]++;
  }
  const most = Math.max(...counts);
  const step = LEGEND_WIDTH / LEGEND_BINS;
  return counts.flatMap((count, bin) => {
    const fill = cssColor(ramp(colors, (bin + 0.5) / LEGEND_BINS));
    const height = count ? Math.max((24 * count) / most, 1.5) : 0;
    return [
      svgElement("rect", { x: bin * step + 0.5, y: 27 - height, width: step - 1, height, fill, opacity: 0.85 }),
      // Neighbours overlap: no seams.
      svgElement("rect", { x: bin * step, y: 30, width: step + (bin < LEGEND_BINS - 1 ? 0.6 : 0), height: 9, fill }),
    ];
  });
}

/** What hides edges of which little is known or that are no structure, or null if nothing is. */
function makeFilter(viewer) {
  const { data } = viewer;
  const { section, content } = panel("Filter");
  const { probability } = data.edgeFields;
  if (probability) {
    content.append(slider("Minimum probability", {
      min: 0, max: 1, step: 0.01, value: 0, words: (x) => x.toFixed(2),
      oninput: (minProbability) => viewer.change({ minProbability }),
    }).row);
  }
  if (data.supportCounts) {
    const most = data.supportCounts.reduce((a, b) => Math.max(a, b), 0);
    content.append(slider("Minimum supporting views", {
      min: 0, max: most, step: 1, value: 0, words: (x) => String(x),
      oninput: (minViews) => viewer.change({ minViews }),
    }).row);
  }
  if (data.structure) {
    const box = element("input", {
      type: "checkbox", id: "only-structure",
      onchange: () => viewer.change({ onlyStructure: box.checked }),
    });
    content.append(element("label", { class: "check" }, box, " Only structure, no paint and shadows"));
  }
  if (!content.childElementCount || !data.edges.length) return null;
  const count = element("p", { class: "quiet", id: "shown-count", role: "status" });
  content.append(count);
  const show = () => {
    count.textContent = `${viewer.visibleCount} of ${countOf(data.edges.length, "segment")} shown`;
  };
  viewer.onChange((keys) => { if (keys.some(filters)) show(); });
  show();
  return section;
}
