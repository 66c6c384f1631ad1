#!/usr/bin/env node
// Uses the page of neat in Chromium without a window as a person would, and compares its
// wireframes with those of the command.
//
//   scripts/make_page.sh PAGE
//   node scripts/check_page.mjs PAGE NEAT [--scene FOLDER] [--picture FILE]
//
// NEAT is the command. Of FOLDER, another scene, the times of both are told, and where it holds
// truth/ their F1 of creases. All is done twice: with a plain server, and with
// scripts/serve_page.py, whose headers let the page have threads. The page is served until its
// synthetic scene is done, and then no more: what follows must work without the network. Any error
// or warning on the console, any request to somewhere else, and a number that differs by more than
// 1e-9 is a failure. Needs Node 18, Python 3.9 and Chromium (or CHROMIUM=path), nothing else.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { Browser, findBrowser } from "./browser.mjs";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm" };
const DESKTOP = { width: 1280, height: 900 };
const MINUTES = 60_000;
const ISOLATING_SERVER = fileURLToPath(new URL("serve_page.py", import.meta.url));
/** As `neat-web synthesise` makes it. */
const BUNDLED = ["--views", "48", "--image-size", "400"];
/** What only runs of the command say. */
const OF_RUNS = ["backend", "distill", "preset", "seed", "steps"];

const options = process.argv.slice(2);
const option = (name) => (options.includes(name) ? options.splice(options.indexOf(name), 2)[1] : null);
const picture = option("--picture");
const given = option("--scene");
const another = given && resolve(given);
if (options.length !== 2) {
  console.error("usage: check_page.mjs PAGE NEAT [--scene FOLDER] [--picture FILE]");
  process.exit(2);
}
const [page, neat] = options.map((path) => resolve(path));
const work = mkdtempSync(join(tmpdir(), "check-page-"));
const downloads = join(work, "downloads");
const command = (...args) => execFileSync(neat, args, { stdio: ["ignore", "ignore", "pipe"] });

/** Serves the page on a port of this machine: its address, and how to end that. */
async function servePlainly() {
  const server = createServer((request, answer) => {
    const name = request.url === "/" ? "/index.html" : new URL(request.url, "http://page").pathname;
    const path = join(page, name);
    if (!existsSync(path)) return answer.writeHead(404).end();
    answer.writeHead(200, { "content-type": TYPES[extname(path)] ?? "text/plain" }).end(readFileSync(path));
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  const stop = () => new Promise((done) => {
    server.close(done);
    server.closeAllConnections();
  });
  return { address: `http://127.0.0.1:${server.address().port}/`, stop };
}

/** The same with the headers that isolate it. */
async function serveIsolated() {
  const server = spawn("python3", [ISOLATING_SERVER, page, "0"], { stdio: ["ignore", "pipe", "ignore"] });
  process.once("exit", () => server.kill());
  const end = once(server, "exit");
  const address = await Promise.race([once(server.stdout, "data"), end.then(() => null)]);
  assert.ok(address, "scripts/serve_page.py ends at once");
  const stop = () => {
    server.kill();
    return end;
  };
  return { address: String(address[0]).trim(), stop };
}

/** The largest difference of two numbers at the same place, relative where they are above 1. */
function difference(a, b, where = "") {
  if (typeof a === "number" && typeof b === "number") return Math.abs(a - b) / Math.max(1, Math.abs(a));
  if (a && b && typeof a === "object" && typeof b === "object") {
    assert.deepEqual(Object.keys(a).sort(), Object.keys(b).sort(), `${where} has other parts`);
    return Math.max(0, ...Object.keys(a).map((key) => difference(a[key], b[key], `${where}/${key}`)));
  }
  assert.equal(a, b, where);
  return 0;
}

/** The wireframe of the command for a scene, and the seconds that it took. */
function expected(scene, run) {
  const start = Date.now();
  command("reconstruct", scene, "--out", run, "--threads", "1", "--no-cache", "--quiet");
  const seconds = (Date.now() - start) / 1000;
  const document = JSON.parse(readFileSync(join(run, "wireframe.json")));
  for (const key of OF_RUNS) delete document.metadata[key];
  return { document, seconds };
}

/** What the page says when it is done. */
const stage = (browser) => browser.evaluate(`document.getElementById("stage").textContent`);

/** Fails where a wireframe of the page is not that of the command. */
function compare(what, told, truth, document) {
  const worst = difference(truth.document, document);
  assert.ok(worst < 1e-9, `${what}: the page differs from the command by ${worst}`);
  console.log(`ok: ${what}: ${told}, the command in ${truth.seconds.toFixed(1)} s; ${worst.toExponential(1)} between them`);
}

const isShown = (id) => `!document.getElementById("${id}").hidden`;

/** Waits for the first image of a scene. */
async function started(browser) {
  await browser.until(`${isShown("views")} || ${isShown("problem")}`, "no image is shown", 5 * MINUTES);
  assert.equal(await problemOf(browser), null);
}

/** The sentence with which the page refuses a scene. */
const problemOf = (browser) =>
  browser.evaluate(`${isShown("problem")} ? document.getElementById("problem").textContent : null`);

/** Waits for the result of a scene; its sentence if it is refused. */
async function finished(browser) {
  await browser.until(`${isShown("result")} || ${isShown("problem")}`, "nothing comes out", 10 * MINUTES);
  const problem = await problemOf(browser);
  // What is on the page moves until the report is there: clicks would miss.
  if (problem === null) {
    const isOpen = `document.getElementById("report").contentWindow?.neat?.viewer`;
    await browser.until(`Boolean(${isOpen})`, "the report does not open", MINUTES);
  }
  return problem;
}

/** Chooses a format and downloads it. */
async function download(browser, format, name) {
  await browser.evaluate(`document.getElementById("format").value = ${JSON.stringify(format)}`);
  await browser.clickOn("#download");
  const path = join(downloads, name);
  const end = Date.now() + MINUTES;
  while (!existsSync(path)) {
    assert.ok(Date.now() < end, `${name} is not downloaded`);
    await browser.settle();
  }
  const bytes = readFileSync(path);
  rmSync(path);
  return bytes;
}

async function drop(browser, folder) {
  const [x, y] = await browser.evaluate(`(() => {
    const drop = document.getElementById("drop");
    drop.scrollIntoView({ block: "center" });
    const box = drop.getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2];
  })()`);
  const data = { items: [], files: [folder], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver", "drop"]) {
    await browser.send("Input.dispatchDragEvent", { type, x, y, data });
  }
  await browser.settle();
}

/** A segment of the report in the frame, clicked: what the inspector says of it. */
async function pickSegment(browser) {
  await browser.evaluate(`document.getElementById("report").scrollIntoView({ block: "center" })`);
  await browser.settle();
  const [index, x, y] = await browser.evaluate(`(() => {
    const frame = document.getElementById("report");
    const { data, viewer, locate } = frame.contentWindow.neat;
    const outer = frame.getBoundingClientRect();
    const box = viewer.canvas.getBoundingClientRect();
    const middle = ([a, b]) => locate([0, 1, 2].map((i) => (data.points[a][i] + data.points[b][i]) / 2));
    const middles = data.edges.map(middle);
    const room = middles.map(([x, y], index) => Math.min(
      ...middles.map(([u, v], other) => (other === index ? Infinity : Math.hypot(u - x, v - y)))));
    const index = room.indexOf(Math.max(...room));
    return [index, outer.x + box.x + middles[index][0], outer.y + box.y + middles[index][1]];
  })()`);
  await browser.click(x, y);
  const heading = await browser.evaluate(
    `document.getElementById("report").contentDocument.querySelector("#inspector h2")?.textContent`);
  assert.match(heading ?? "nothing", /^Segment \d+$/, `a click on segment ${index} picks ${heading}`);
}

async function checkStopped(browser) {
  await browser.clickOn("#synthetic");
  await started(browser);
  await browser.clickOn("#stop");
  assert.ok(await browser.evaluate(`!(${isShown("progress")}) && !document.getElementById("choose").disabled`));
  console.log("ok: a scene is given up");
}

async function checkSynthetic(browser, truth) {
  await browser.clickOn("#synthetic");
  await started(browser);
  assert.equal(await finished(browser), null);
  const told = await stage(browser);
  const [images, lines] = await browser.evaluate(
    `[document.querySelectorAll("#thumbnails image").length, document.querySelectorAll("#thumbnails line").length]`);
  assert.equal(images, Number(BUNDLED[1]), "an image for every view");
  assert.ok(lines > 5 * images, `${lines} segments in ${images} images`);
  await pickSegment(browser);
  await checkPhone(browser);
  if (picture) writeFileSync(picture, Buffer.from(await browser.screenshot(), "base64"));
  const document = JSON.parse(await download(browser, "json", "wireframe.json"));
  document.metadata.scene = truth.document.metadata.scene;
  compare("the synthetic scene", told, truth, document);
  assert.match((await download(browser, "dxf", "wireframe.dxf")).toString(), /SECTION/);
  assert.equal((await download(browser, "colmap", "wireframe.zip")).subarray(0, 2).toString(), "PK");
}

async function checkDropped(browser, scene, truth) {
  await drop(browser, scene);
  assert.equal(await finished(browser), null);
  const told = await stage(browser);
  compare(scene, told, truth, JSON.parse(await download(browser, "json", "wireframe.json")));
}

/** F1 of creases at each threshold, where the scene holds its truth. */
function scores(scene, wireframe) {
  if (!existsSync(join(scene, "truth"))) return "no truth";
  const report = JSON.parse(execFileSync(neat, ["eval", "--pred", wireframe, "--truth", scene, "--format", "json"]));
  const { thresholds } = [report].flat()[0].scores;
  const f1 = (p, r) => (p + r > 0 ? 2 * p * r / (p + r) : 0);
  return "F1 " + thresholds.map((row) =>
    `${f1(row.length_on_crease ?? 0, row.completeness ?? 0).toFixed(3)} at ${row.threshold}`).join(", ");
}

/** Photographs have segments at the limits of what is one: the last digit of a sine decides. */
async function measure(browser, scene, truth) {
  await drop(browser, scene);
  assert.equal(await finished(browser), null);
  const told = await stage(browser);
  const wireframe = join(work, "of-page.json");
  writeFileSync(wireframe, await download(browser, "json", "wireframe.json"));
  const { edges } = JSON.parse(readFileSync(wireframe));
  console.log(`${scene}: ${told}, ${edges.length} edges, ${scores(scene, wireframe)}`);
  console.log(`  the command in ${truth.seconds.toFixed(1)} s, ${truth.document.edges.length} edges, `
    + scores(scene, join(work, "measured", "wireframe.json")));
}

async function checkPhone(browser) {
  await browser.setDevice({ width: 390, height: 844, touch: true, dark: true });
  const [scrolls, page] = await browser.evaluate("[document.scrollingElement.scrollWidth, window.innerWidth]");
  assert.ok(scrolls <= page, `the page is ${scrolls} pixels wide in a window of ${page}`);
  await browser.setDevice(DESKTOP);
}

async function checkRefused(browser) {
  const empty = join(work, "no-scene");
  mkdirSync(empty, { recursive: true });
  writeFileSync(join(empty, "readme.txt"), "nothing");
  await drop(browser, empty);
  assert.match(await finished(browser), /no-scene/);
  assert.ok(await browser.evaluate(`!document.getElementById("synthetic").disabled`), "the page goes on");
  console.log("ok: a folder that is no scene is refused in words");
}

/** All that a person does, with a page that has threads or not. */
async function check(browser, isolated, scene, truth, measured) {
  const server = await (isolated ? serveIsolated() : servePlainly());
  await browser.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: downloads }, null);
  await browser.setDevice(DESKTOP);
  await browser.open(server.address);
  const threads = await browser.evaluate("crossOriginIsolated ? navigator.hardwareConcurrency : 1");
  assert.equal(await browser.evaluate("crossOriginIsolated"), isolated);
  console.log(`threads: ${threads}`);
  await browser.until(`document.querySelectorAll("#format option").length > 5`, "the program does not start");
  await checkStopped(browser);
  await checkSynthetic(browser, truth);
  await server.stop();
  await checkDropped(browser, scene, truth);
  if (another) await measure(browser, another, measured);
  await checkRefused(browser);
  assert.deepEqual(browser.problems, [], "the console must stay empty");
  const own = ["data:", "blob:", server.address];
  const outside = browser.requests.filter((url) => !own.some((begin) => url.startsWith(begin)));
  assert.deepEqual(outside, [], "nothing may be fetched from elsewhere");
  console.log("ok: nothing from elsewhere, and nothing on the console");
}

async function main(chromium) {
  const scene = join(work, "dropped");
  command("synth", "--out", join(work, "synthetic"), ...BUNDLED);
  command("convert", join(work, "synthetic"), "--to", "colmap", "--out", scene, "--quiet");
  rmSync(join(scene, "hawp"), { recursive: true });
  const truth = expected(scene, join(work, "run"));
  const measured = another && expected(another, join(work, "measured"));
  for (const isolated of [false, true]) {
    const browser = await Browser.start(chromium);
    try {
      await check(browser, isolated, scene, truth, measured);
    } finally {
      await browser.stop();
    }
  }
}

const found = findBrowser();
if (!found) {
  console.error("error: there is no Chromium; set CHROMIUM to its path");
  process.exit(2);
}
mkdirSync(downloads);
try {
  await main(found);
} finally {
  rmSync(work, { recursive: true, force: true });
}
