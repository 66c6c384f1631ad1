#!/usr/bin/env node
// Opens reports in Chromium without a window and uses them as a person would.
//
//   cargo run --release -p neat-report --example sample_report -- FOLDER
//   node scripts/check_report.mjs FOLDER [--screenshots DIR] [--update]
//
// Any error or warning on the console, any request to the network, and anything that
// does not react as it should is a failure. Screenshots are compared, coarsely, with
// those in neat-report/tests/screenshots; --update replaces these. Needs Node 18
// and Chromium (or CHROMIUM=path), nothing else.

import assert from "node:assert/strict";
import { resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { Browser, findBrowser } from "./browser.mjs";
import { Screenshots } from "./screenshots.mjs";

const DESKTOP = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844, touch: true };
const options = process.argv.slice(2);
const flag = (name) => options.includes(name) && options.splice(options.indexOf(name), 1).length > 0;
const update = flag("--update");
const kept = options.includes("--screenshots") ? options.splice(options.indexOf("--screenshots"), 2)[1] : null;
if (options.length !== 1) {
  console.error("usage: check_report.mjs FOLDER [--screenshots DIR] [--update]");
  process.exit(2);
}
const references = fileURLToPath(new URL("../neat-report/tests/screenshots", import.meta.url));
const screenshots = new Screenshots({ references, kept, update });
const [sample, hostile, empty] = ["sample", "hostile", "empty"].map(
  (name) => pathToFileURL(resolve(options[0], `${name}.html`)).href);

/** Opens a report; what happens until `finish` must be quiet. */
async function open(browser, url, device) {
  await browser.setDevice(device);
  browser.problems.length = 0;
  browser.requests.length = 0;
  await browser.open(url);
}

function finish(browser, what) {
  assert.deepEqual(browser.problems, [], `${what}: the console must stay empty`);
  const outside = browser.requests.filter((url) => !url.startsWith("data:") && !url.startsWith("file:"));
  assert.deepEqual(outside, [], `${what}: nothing may be fetched`);
  assert.ok(browser.requests.filter((url) => url.startsWith("file:")).length <= 1, `${what}: one file is all`);
  console.log(`ok: ${what}`);
}

/** Pixels of the 3D canvas that are not background. */
const drawnPixels = (browser) => browser.evaluate(`(() => {
  // WebGL keeps its picture only until the end of this task.
  neat.viewer.draw();
  const source = neat.viewer.canvas;
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [source.width, source.height];
  const context = copy.getContext("2d");
  context.drawImage(source, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  let count = 0;
  for (let i = 3; i < data.length; i += 4) if (data[i] > 40) count++;
  return count;
})()`);

/** A segment that stands alone around its middle: [index, x, y] on the page. */
const lonelySegment = (browser) => browser.evaluate(`(() => {
  const { data, viewer, locate } = neat;
  const box = viewer.canvas.getBoundingClientRect();
  const away = ([x, y], index) => {
    const [a, b] = data.edges[index].map((end) => locate(data.points[end]));
    const t = Math.min(Math.max(((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2), 0), 1);
    return Math.hypot(a[0] + t * (b[0] - a[0]) - x, a[1] + t * (b[1] - a[1]) - y);
  };
  const middles = data.edges.map((ends) => {
    const [a, b] = ends.map((end) => data.points[end]);
    return locate([0, 1, 2].map((i) => (a[i] + b[i]) / 2));
  });
  const room = middles.map((middle, index) => (data.support[index].length < 3 ? 0
    : Math.min(...data.edges.map((_, other) => (other === index ? Infinity : away(middle, other))))));
  const index = room.indexOf(Math.max(...room));
  return [index, box.x + middles[index][0], box.y + middles[index][1]];
})()`);

const text = (browser, selector) => browser.evaluate(`document.querySelector(${JSON.stringify(selector)}).textContent`);
const state = (browser, name) => browser.evaluate(`neat.viewer.state.${name}`);
const slide = (browser, selector, value) => browser.evaluate(`(() => {
  const input = document.querySelector(${JSON.stringify(selector)});
  input.value = ${value};
  input.dispatchEvent(new Event("input"));
})()`).then(() => browser.settle());

async function checkOverflow(browser) {
  const [scrolls, page] = await browser.evaluate("[document.scrollingElement.scrollWidth, window.innerWidth]");
  assert.ok(scrolls <= page, `the page is ${scrolls} pixels wide in a window of ${page}`);
}

async function checkDesktop(browser) {
  await open(browser, sample, DESKTOP);
  assert.equal(await text(browser, "#title"), "stair-prism");
  assert.ok(await drawnPixels(browser) > 3000, "the wireframe is not drawn");
  assert.match(await browser.evaluate("neat.viewer.renderer.kind"), /WebGL/);
  await checkOverflow(browser);
  await screenshots.take(browser, "desktop-light");

  const [segment, x, y] = await lonelySegment(browser);
  await browser.click(x, y);
  assert.equal(await text(browser, "#inspector h2"), `Segment ${segment}`);
  const expected = await browser.evaluate(`neat.data.support[${segment}].map(([view]) => view).sort((a, b) => a - b)`);
  if (expected.length > 6) await browser.clickOn("#inspector .more");
  const shown = await browser.evaluate(
    "[...document.querySelectorAll('.observation')].map((card) => Number(card.dataset.view)).sort((a, b) => a - b)");
  assert.deepEqual(shown, expected, "the inspector must show the supporting views");
  const yellow = await browser.evaluate(`(() => {
    const canvas = document.querySelector(".observation canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i] > 230 && data[i + 1] > 180 && data[i + 2] < 110) count++;
    return count;
  })()`);
  assert.ok(yellow > 30, "the 2D segment is not drawn on the photograph");
  await browser.clickOn(".observation");
  assert.ok(await browser.evaluate("document.querySelector('dialog').open"), "a photograph does not enlarge");
  await browser.press("Escape");
  assert.ok(!await browser.evaluate("document.querySelector('dialog').open"), "Escape does not close the photograph");

  assert.doesNotMatch(await text(browser, "#inspector"), /null|undefined|NaN/);

  await browser.clickOn("#inspector .link");
  assert.match(await text(browser, "#inspector h2"), /^Junction \d+$/);
  finish(browser, "a picked segment shows the views that support it");
}

async function checkControls(browser) {
  await open(browser, sample, DESKTOP);
  // A face alone is lighter than what counts as drawn, but not two before each other.
  const withFaces = await drawnPixels(browser);
  assert.ok(await browser.evaluate("neat.data.faces.length") > 5, "the sample has no faces");
  const facesPressed = () => browser.evaluate("document.querySelector('#show-faces').getAttribute('aria-pressed')");
  assert.equal(await facesPressed(), "true");
  await browser.clickOn("#show-faces");
  assert.equal(await facesPressed(), "false");
  const all = await drawnPixels(browser);
  assert.ok(all < 0.5 * withFaces, "hidden faces are still drawn");
  const total = await browser.evaluate("neat.data.edges.length");
  await slide(browser, ".panel input[aria-label='Minimum probability']", 0.5);
  const shown = await browser.evaluate("neat.viewer.visibleCount");
  assert.ok(shown > 0 && shown < total, "the filter hides nothing");
  assert.equal(await text(browser, "#shown-count"), `${shown} of ${total} segments shown`);
  assert.ok(await drawnPixels(browser) < all, "hidden segments are still drawn");
  await slide(browser, ".panel input[aria-label='Minimum probability']", 0);

  await slide(browser, "#evolution input", 5);
  assert.equal(await state(browser, "snapshot"), 5);
  assert.match(await text(browser, "#evolution output"), /^step 125, 16 junctions$/);
  assert.ok(await browser.evaluate("!document.querySelector('.chart .marker').hasAttribute('hidden')"));
  await browser.clickOn("#play");
  await browser.until("neat.viewer.state.snapshot > 7", "the evolution does not play");
  await browser.clickOn("#show-result");
  assert.equal(await state(browser, "snapshot"), null);

  const measures = await browser.evaluate("neat.data.measures.length");
  for (let i = 0; i < measures; i++) {
    await browser.evaluate(`(() => {
      const select = document.querySelector("#color-by");
      select.selectedIndex = ${i};
      select.dispatchEvent(new Event("change"));
    })()`);
    await browser.settle();
    assert.ok(await drawnPixels(browser) > 3000);
  }
  finish(browser, "filter, evolution and colours");
}

async function checkMouse(browser) {
  await open(browser, sample, DESKTOP);
  const pose = () => browser.evaluate("({ ...neat.viewer.orbit.pose })");
  const drag = async (from, to, extra) => {
    await browser.mouse("mouseMoved", ...from);
    await browser.mouse("mousePressed", ...from, { clickCount: 1, ...extra });
    for (const t of [0.3, 0.6, 1]) {
      await browser.mouse("mouseMoved", from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]), extra);
    }
    await browser.mouse("mouseReleased", ...to, { clickCount: 1, ...extra });
    await browser.settle();
  };
  const first = await pose();
  await drag([300, 250], [420, 280], { button: "left", buttons: 1 });
  const turned = await pose();
  assert.ok(turned.yaw !== first.yaw && turned.pitch > first.pitch, "dragging does not turn");
  assert.equal(await state(browser, "selection"), null, "a drag is no click");
  await drag([300, 250], [360, 280], { button: "right", buttons: 2 });
  const shifted = await pose();
  assert.deepEqual([shifted.yaw, shifted.pitch], [turned.yaw, turned.pitch]);
  assert.notDeepEqual(shifted.target, turned.target, "the right button does not move");
  await browser.mouse("mouseWheel", 450, 400, { deltaX: 0, deltaY: -200 });
  await browser.settle();
  assert.ok((await pose()).distance < shifted.distance, "the wheel does not zoom");
  await browser.clickOn("#reset");
  const [segment, x, y] = await lonelySegment(browser);
  await browser.click(x, y, 2);
  const { target } = await pose();
  const [a, b] = await browser.evaluate(`neat.data.edges[${segment}].map((end) => neat.data.points[end])`);
  const along = b.map((c, i) => c - a[i]);
  const away = target.map((c, i) => c - a[i]);
  const dot = (u, v) => u.reduce((sum, c, i) => sum + c * v[i], 0);
  const t = dot(away, along) / dot(along, along);
  assert.ok(t > 0 && t < 1 && Math.hypot(...away.map((c, i) => c - t * along[i])) < 1e-6,
    "a double click does not bring the point into the middle");
  finish(browser, "the mouse");
}

async function checkKeys(browser) {
  await open(browser, sample, DESKTOP);
  for (let i = 0; i < 3 && await browser.evaluate("document.activeElement.id") !== "scene"; i++) {
    await browser.press("Tab");
  }
  assert.equal(await browser.evaluate("document.activeElement.id"), "scene", "Tab does not reach the 3D view");
  const pose = () => browser.evaluate("({ ...neat.viewer.orbit.pose })");
  const first = await pose();
  await browser.press("ArrowRight");
  await browser.press("ArrowUp");
  await browser.press("+", "Equal");
  const moved = await pose();
  assert.ok(moved.yaw !== first.yaw && moved.pitch > first.pitch && moved.distance < first.distance);
  await browser.press("0", "Digit0");
  assert.deepEqual(await pose(), first, "0 does not lead back to the first view");
  await browser.press("n", "KeyN");
  assert.equal(await text(browser, "#inspector h2"), "Segment 0");
  await browser.press("f", "KeyF");
  assert.ok((await pose()).distance < first.distance, "F does not show the selection");
  await browser.press("Escape");
  assert.equal(await text(browser, "#inspector h2"), "Selection");
  finish(browser, "the keyboard alone");
}

async function checkThroughCamera(browser) {
  await open(browser, sample, DESKTOP);
  const [view, x, y] = await browser.evaluate(`(() => {
    const { data, viewer, locate } = neat;
    const box = viewer.canvas.getBoundingClientRect();
    const [width, height] = viewer.size();
    for (const [index, { frustum }] of data.views.entries()) {
      const [px, py, depth] = locate(frustum[0]);
      const free = px > 300 && px < width - 100 && py > 100 && py < height - 40;
      if (!free || depth < 0.5) continue;
      const found = pickable(px, py);
      if (found === index) return [index, box.x + px, box.y + py];
    }
    function pickable(px, py) {
      viewer.hovered(px, py);
      const hover = viewer.state.hover;
      return hover?.kind === "view" ? hover.index : null;
    }
  })()`);
  await browser.click(x, y);
  assert.equal(await browser.evaluate("neat.viewer.through"), view, "a click on a camera does not look through it");
  // The strokes must lie where the camera of the report projects the junctions.
  const error = await browser.evaluate(`(() => {
    const { data, viewer, locate } = neat;
    const { intrinsics: [fx, fy, cx, cy, skew], rotation: r, center } = data.views[viewer.through];
    const { zoom, offset } = viewer.navigator.transform(...viewer.size());
    return Math.max(...data.junctions.map((junction, index) => {
      const d = junction.map((c, i) => c - center[i]);
      const [u, v, w] = [0, 1, 2].map((column) => d.reduce((sum, c, row) => sum + r[row][column] * c, 0));
      const pixel = [(fx * u + skew * v) / w + cx, (fy * v) / w + cy];
      const [px, py] = locate(data.points[index]);
      return Math.hypot(px - (pixel[0] * zoom + offset[0]), py - (pixel[1] * zoom + offset[1]));
    }));
  })()`);
  assert.ok(error < 0.01, `the wireframe is ${error} pixels off the photograph`);
  await browser.press("ArrowRight");
  assert.notEqual(await browser.evaluate("neat.viewer.through"), view);
  await browser.evaluate("neat.viewer.lookThrough(neat.data.views.findIndex((view) => view.photograph))");
  await browser.settle();
  await screenshots.take(browser, "through-camera");
  await browser.evaluate("neat.viewer.canvas.focus()");
  await browser.press("Escape");
  assert.equal(await browser.evaluate("neat.viewer.through"), null);
  finish(browser, "the view through a camera");
}

async function checkDark(browser) {
  await open(browser, sample, { ...DESKTOP, dark: true });
  await browser.evaluate("neat.viewer.select({ kind: 'segment', index: 3 })");
  await browser.settle();
  await screenshots.take(browser, "desktop-dark-picked");
  finish(browser, "the dark page");
}

async function checkPhone(browser) {
  await open(browser, sample, PHONE);
  await checkOverflow(browser);
  await screenshots.take(browser, "phone");
  const [segment, x, y] = await lonelySegment(browser);
  const touch = (type, touchPoints) => browser.send("Input.dispatchTouchEvent", { type, touchPoints });
  await touch("touchStart", [{ x, y }]);
  await touch("touchEnd", []);
  await browser.settle();
  assert.equal(await text(browser, "#inspector h2"), `Segment ${segment}`, "a tap does not pick");
  await checkOverflow(browser);
  const distance = () => browser.evaluate("neat.viewer.orbit.pose.distance");
  const before = await distance();
  const fingers = (apart) => [{ x: 195 - apart, y: 300, id: 0 }, { x: 195 + apart, y: 300, id: 1 }];
  await touch("touchStart", fingers(30));
  for (const apart of [40, 50, 60]) await touch("touchMove", fingers(apart));
  await touch("touchEnd", []);
  await browser.settle();
  assert.ok(await distance() < 0.7 * before, "a pinch does not zoom");
  finish(browser, "the page on a phone");
}

async function checkHostile(browser) {
  for (const device of [DESKTOP, PHONE]) {
    await open(browser, hostile, device);
    const title = await browser.evaluate("neat.data.title");
    assert.match(title, /<\/script><img/);
    assert.equal(await text(browser, "#title"), title);
    assert.equal(await browser.evaluate("document.title.includes('onerror')"), true);
    assert.equal(await browser.evaluate("document.images.length + document.querySelectorAll('iframe, object, embed').length"), 0);
    assert.equal(await browser.evaluate("document.scripts.length"), 2);
    assert.equal(await browser.evaluate("Object.keys(Object.prototype).length + Object.keys({}.__proto__).length"), 0);
    assert.deepEqual(await browser.evaluate("['__proto__', 'constructor'].map((name) => Object.hasOwn(neat.data.edgeFields, name))"), [true, true]);
    await browser.evaluate("neat.viewer.select({ kind: 'segment', index: 3 })");
    await browser.evaluate("neat.viewer.lookThrough(0)");
    await browser.settle();
    await checkOverflow(browser);
    finish(browser, `hostile texts at ${device.width} pixels`);
  }
}

/** Nothing was reconstructed; there is one camera to look through. */
async function checkEmpty(browser) {
  await open(browser, empty, DESKTOP);
  assert.match(await text(browser, "#notice"), /no segments/);
  assert.ok(await browser.evaluate("document.querySelector('#show-faces').hidden"));
  assert.equal(await browser.evaluate("document.querySelector('#evolution, #charts')"), null);
  for (const [key, code] of [["n", "KeyN"], ["f", "KeyF"], ["0", "Digit0"]]) {
    await browser.evaluate("neat.viewer.canvas.focus()");
    await browser.press(key, code);
  }
  await browser.clickOn(".camera");
  assert.equal(await browser.evaluate("neat.viewer.through"), 0);
  await checkOverflow(browser);
  finish(browser, "a report on nothing");
}

/** Browsers that lack a kind of drawing draw the same lines by another. */
async function checkFallback(browser, missing, kind) {
  const { identifier } = await browser.send("Page.addScriptToEvaluateOnNewDocument", {
    source: `{
      const { getContext } = HTMLCanvasElement.prototype;
      HTMLCanvasElement.prototype.getContext = function (type, ...rest) {
        return ${JSON.stringify(missing)}.includes(type) ? null : getContext.call(this, type, ...rest);
      };
    }`,
  });
  await open(browser, sample, DESKTOP);
  assert.equal(await browser.evaluate("neat.viewer.renderer.kind"), kind);
  assert.equal(/no WebGL/.test(await text(browser, "#notice")), kind === "canvas");
  assert.ok(await drawnPixels(browser) > 3000, "the wireframe is not drawn");
  const [segment, x, y] = await lonelySegment(browser);
  await browser.click(x, y);
  assert.equal(await text(browser, "#inspector h2"), `Segment ${segment}`);
  // The pictures of all kinds are compared with the same reference.
  await browser.evaluate("neat.viewer.select(null)");
  await screenshots.take(browser, `desktop-light-${kind.replaceAll(" ", "-")}`, "desktop-light");
  await browser.send("Page.removeScriptToEvaluateOnNewDocument", { identifier });
  finish(browser, `drawn by ${kind}`);
}

const path = findBrowser();
if (!path) {
  console.error("no Chromium: install it or set CHROMIUM");
  process.exit(2);
}
const browser = await Browser.start(path);
try {
  await checkDesktop(browser);
  await checkControls(browser);
  await checkMouse(browser);
  await checkKeys(browser);
  await checkThroughCamera(browser);
  await checkDark(browser);
  await checkPhone(browser);
  await checkHostile(browser);
  await checkEmpty(browser);
  await checkFallback(browser, ["webgl2"], "WebGL 1");
  await checkFallback(browser, ["webgl2", "webgl"], "canvas");
  await screenshots.compare(browser);
} finally {
  await browser.stop();
}
