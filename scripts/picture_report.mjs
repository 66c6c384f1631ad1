#!/usr/bin/env node
// A picture of a report, for documents.
//
//   node scripts/picture_report.mjs REPORT.html OUT.png [--dark] [--segment N]
//
// Without N the segment with the most supporting views is chosen.

import { writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { Browser, findBrowser } from "./browser.mjs";

const options = process.argv.slice(2);
const dark = options.includes("--dark");
const segment = options.includes("--segment") ? Number(options[options.indexOf("--segment") + 1]) : null;
const [report, out] = options;
const path = findBrowser();
if (!out || !path) {
  console.error("usage: picture_report.mjs REPORT.html OUT.png [--dark] [--segment N]; it needs Chromium, or CHROMIUM=path");
  process.exit(2);
}
const browser = await Browser.start(path);
try {
  await browser.setDevice({ width: 1280, height: 800, ratio: 1.5, dark });
  await browser.open(pathToFileURL(resolve(report)).href);
  await browser.evaluate(`(() => {
    const counts = neat.data.support.map((list) => list.length);
    const index = ${segment} ?? counts.indexOf(Math.max(...counts));
    if (neat.data.edges[index]) neat.viewer.select({ kind: "segment", index });
  })()`);
  // Photographs are decoded while the page is drawn.
  for (let i = 0; i < 5; i++) await browser.settle();
  writeFileSync(out, Buffer.from(await browser.screenshot(), "base64"));
} finally {
  await browser.stop();
}
