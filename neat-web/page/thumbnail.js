// An image with the 2D segments over it.

const SVG = "http://www.w3.org/2000/svg";

function element(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

/** A list item for a `detected` event of the program. */
export function thumbnail({ view, segments: count, picture: { width, height, segments, jpeg } }) {
  const label = `${view}: ${count} segments`;
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
  if (jpeg) svg.append(element("image", { width, height, href: `data:image/jpeg;base64,${jpeg}` }));
  for (const [x1, y1, x2, y2] of segments) svg.append(element("line", { x1, y1, x2, y2 }));
  const caption = document.createElement("figcaption");
  caption.textContent = label;
  const figure = document.createElement("figure");
  figure.append(svg, caption);
  const item = document.createElement("li");
  item.append(figure);
  return item;
}
