// Screenshots of a report, compared with stored ones.

import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

// Rasterisers differ, and for the page fonts, too: the mean colours of cells of about
// so many pixels hide that. Most cells of the 3D view are empty, and none holds text.
const CELL_PIXELS = 20;
const PAGE_TOLERANCE = { mean: 4, cell: 45, share: 0.02 };
const LINES_TOLERANCE = { mean: 1, cell: 16, share: 0.01 };

/** Pictures that were taken, to be compared when all are there. */
export class Screenshots {
  /** `references` is the folder of the stored pictures, which `update` replaces by
   * those taken; `kept` is where these go in full size, or null. */
  constructor({ references, kept, update }) {
    Object.assign(this, { references, kept, update, taken: [] });
  }

  /** Takes a picture of the page and one of its lines alone. */
  async take(browser, name, reference = name) {
    // The pointer must not lie on anything.
    await browser.mouse("mouseMoved", 2, 2);
    await browser.settle();
    this.taken.push({ name, reference, png: await browser.screenshot(), tolerance: PAGE_TOLERANCE });
    // WebGL keeps its picture only until the end of this task.
    const lines = await browser.evaluate("(neat.viewer.draw(), neat.viewer.canvas.toDataURL())");
    this.taken.push({
      name: `${name}-lines`, reference: `${reference}-lines`, png: lines.split(",")[1], tolerance: LINES_TOLERANCE,
    });
  }

  /** Compares all pictures; the browser must not be needed for anything else. */
  async compare(browser) {
    await browser.open("about:blank");
    const inPage = (png, body) => browser.evaluate(`(async () => {
      const bytes = Uint8Array.from(atob("${png}"), (c) => c.charCodeAt(0));
      const blob = new Blob([bytes], { type: "image/png" });
      const canvas = document.createElement("canvas");
      const draw = async (options) => {
        const image = await createImageBitmap(blob, options);
        [canvas.width, canvas.height] = [image.width, image.height];
        const context = canvas.getContext("2d");
        context.fillStyle = "white";
        context.fillRect(0, 0, image.width, image.height);
        context.drawImage(image, 0, 0);
        return context.getImageData(0, 0, image.width, image.height);
      };
      ${body}
    })()`);
    /** The mean colours of the cells, as many as are given or else as fit. */
    const cells = (png, grid = null) => inPage(png, `
      const { data, width, height } = await draw();
      const [columns, rows] = ${JSON.stringify(grid)} ?? [width, height].map((x) => Math.round(x / ${CELL_PIXELS}));
      const sums = new Array(3 * columns * rows).fill(0);
      const counts = new Array(columns * rows).fill(0);
      for (let y = 0; y < height; y++) {
        for (let x = 0; x < width; x++) {
          const cell = Math.floor((y * rows) / height) * columns + Math.floor((x * columns) / width);
          counts[cell]++;
          for (let c = 0; c < 3; c++) sums[3 * cell + c] += data[4 * (y * width + x) + c];
        }
      }
      return { grid: [columns, rows], means: sums.map((sum, i) => sum / counts[Math.floor(i / 3)]) };`);
    mkdirSync(this.references, { recursive: true });
    for (const { name, reference, png, tolerance } of this.taken) {
      if (this.kept) {
        mkdirSync(this.kept, { recursive: true });
        writeFileSync(join(this.kept, `${name}.png`), Buffer.from(png, "base64"));
      }
      const path = join(this.references, `${reference}.png`);
      if (this.update && name === reference) {
        const half = await inPage(png, `
          const { width } = await draw();
          await draw({ resizeWidth: Math.round(width / 2), resizeQuality: "high" });
          return canvas.toDataURL().split(",")[1];`);
        writeFileSync(path, Buffer.from(half, "base64"));
      }
      const found = await cells(png);
      const expected = await cells(readFileSync(path).toString("base64"), found.grid);
      const differences = found.means.map((value, i) => Math.abs(value - expected.means[i]));
      const mean = differences.reduce((sum, d) => sum + d, 0) / differences.length;
      const bad = differences.filter((d) => d > tolerance.cell).length / differences.length;
      console.log(`${name}: mean difference ${mean.toFixed(2)} of 255, ${(100 * bad).toFixed(2)} % of the cells far off`);
      assert.ok(mean < tolerance.mean && bad < tolerance.share,
        `${name} looks unlike ${path}: look at it with --screenshots DIR; if it is right, store it with --update`);
    }
  }
}
