// Elements of the page. Text is always set as text: nothing of a report is markup.

const byId = (id) => document.getElementById(id);

function build(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined) node.setAttribute(name, value);
  }
  // Strings become text nodes.
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

const element = (tag, attributes = {}, ...children) =>
  build(document.createElement(tag), attributes, children);

const svgElement = (tag, attributes = {}, ...children) =>
  build(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);

/** A part of the side panel: its section, and the box for the content. */
function panel(title, { open = true, collapsible = false } = {}) {
  const content = element("div", { class: "content" });
  const heading = element("h2", {}, title);
  const section = collapsible
    ? element("details", { class: "panel", open }, element("summary", {}, heading), content)
    : element("section", { class: "panel" }, heading, content);
  return { section, content, heading };
}

/** Pairs of label and value. */
function definitions(rows) {
  const list = element("dl", { class: "facts" });
  for (const [label, value] of rows) {
    list.append(element("div", {}, element("dt", {}, label), element("dd", {}, value)));
  }
  return list;
}

/** A slider with its label and the value in words. */
function slider(label, { min, max, step, value, words, oninput }) {
  const output = element("output", {}, words(value));
  const input = element("input", {
    type: "range", min, max, step, value, "aria-label": label, "aria-valuetext": words(value),
    oninput: () => {
      const now = Number(input.value);
      output.textContent = words(now);
      input.setAttribute("aria-valuetext", words(now));
      oninput(now);
    },
  });
  const row = element("label", { class: "slider" }, element("span", {}, label), output, input);
  return { row, input, output };
}

/** A number with so many digits as are of use. */
function formatNumber(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(Math.max(digits - 2, 1));
  if (Number.isInteger(value)) return String(value);
  return String(Number(value.toPrecision(Math.max(digits, Math.ceil(Math.log10(size))))));
}

const countOf = (count, one, many = `${one}s`) => `${count} ${count === 1 ? one : many}`;

/** Fits the pixels of a canvas to its size on the screen; returns its context. */
function sharpContext(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.max(Math.round(width * ratio), 1);
  canvas.height = Math.max(Math.round(height * ratio), 1);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}
