// Colours of the theme, and the scales that turn numbers into colours.

/** From doubtful to certain, for a light and for a dark ground: told apart by people
 * who do not see red or green, too. */
const TRUST = {
  light: [[190, 48, 20], [214, 138, 0], [30, 150, 150], [28, 84, 178]],
  dark: [[255, 106, 77], [255, 196, 84], [84, 208, 196], [112, 168, 255]],
};
/** From low to high, where neither is better. */
const NEUTRAL = {
  light: [[92, 58, 170], [24, 118, 168], [70, 150, 40]],
  dark: [[158, 132, 255], [78, 190, 230], [172, 226, 98]],
};

const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");

/** The colour of a share from 0 to 1 on a list of colours. */
function ramp(colors, share) {
  const place = clamp(share, 0, 1) * (colors.length - 1);
  const index = Math.min(Math.floor(place), colors.length - 2);
  return mixPoints(colors[index], colors[index + 1], place - index);
}

/** The colours of a measure from its lowest to its highest value; `bright` for lines
 * on a photograph. */
function scaleOf(measure, bright) {
  const scheme = bright || darkScheme.matches ? "dark" : "light";
  if (!measure.good) return NEUTRAL[scheme];
  return measure.good === "high" ? TRUST[scheme] : [...TRUST[scheme]].reverse();
}

/** The colour of an edge by a measure; grey where nothing is known. */
function edgeColor(measure, edge, bright) {
  const value = measure?.values[edge];
  if (value === null || value === undefined) return theme().muted;
  const [low, high] = measure.range;
  return ramp(scaleOf(measure, bright), (value - low) / (high - low));
}

const cssColor = ([r, g, b]) => `rgb(${Math.round(r)} ${Math.round(g)} ${Math.round(b)})`;

let knownTheme = null;
darkScheme.addEventListener("change", () => { knownTheme = null; });

/** The colours that the style sheet gives, as numbers. */
function theme() {
  if (knownTheme) return knownTheme;
  const style = getComputedStyle(document.documentElement);
  const read = (name) => {
    const hex = style.getPropertyValue(name).trim().slice(1);
    return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16));
  };
  knownTheme = {
    stage: read("--stage"),
    ink: read("--ink"),
    muted: read("--camera"),
    accent: read("--accent"),
    face: read("--face"),
    evolution: read("--evolution"),
  };
  return knownTheme;
}
