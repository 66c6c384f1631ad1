// Chromium without a window, spoken to in the Chrome DevTools Protocol through a pipe:
// Node alone suffices, no packages.

import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const BROWSERS = [
  process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome",
];
// A software rasteriser, so that pictures are about the same everywhere.
const ARGUMENTS = [
  "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
  "--remote-debugging-pipe", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--hide-scrollbars", "--force-color-profile=srgb",
  "--font-render-hinting=none", "--disable-dev-shm-usage",
];
const ANSWER_MILLISECONDS = 60_000;

/** The browser's path, or undefined where there is none. */
export const findBrowser = () => BROWSERS.find((path) => path && existsSync(path));

/** A running browser with one page. */
export class Browser {
  static async start(path) {
    const browser = new Browser();
    browser.profile = mkdtempSync(join(tmpdir(), "check-report-"));
    browser.process = spawn(path, [...ARGUMENTS, `--user-data-dir=${browser.profile}`, "about:blank"], {
      stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
    });
    [, , , browser.input, browser.output] = browser.process.stdio;
    browser.waiting = new Map();
    browser.lastId = 0;
    browser.problems = [];
    browser.requests = [];
    browser.listen();
    const { targetInfos } = await browser.send("Target.getTargets", {}, null);
    const { targetId } = targetInfos.find(({ type }) => type === "page");
    const { sessionId } = await browser.send("Target.attachToTarget", { targetId, flatten: true }, null);
    browser.session = sessionId;
    for (const domain of ["Page", "Runtime", "Log", "Network"]) await browser.send(`${domain}.enable`);
    return browser;
  }

  listen() {
    let text = "";
    this.output.setEncoding("utf8");
    this.output.on("data", (chunk) => {
      text += chunk;
      const messages = text.split("\0");
      text = messages.pop();
      for (const message of messages) this.receive(JSON.parse(message));
    });
    this.process.on("exit", () => {
      for (const { reject } of this.waiting.values()) reject(new Error("the browser has ended"));
    });
  }

  receive({ id, method, params, result, error }) {
    if (id) {
      const { resolve, reject } = this.waiting.get(id);
      this.waiting.delete(id);
      return error ? reject(new Error(error.message)) : resolve(result);
    }
    if (method === "Runtime.exceptionThrown") {
      const { exception, text } = params.exceptionDetails;
      this.problems.push(exception?.description ?? text);
    } else if (method === "Runtime.consoleAPICalled" && ["error", "warning"].includes(params.type)) {
      this.problems.push(params.args.map((argument) => argument.value ?? argument.description).join(" "));
    } else if (method === "Log.entryAdded" && ["error", "warning"].includes(params.entry.level)) {
      // Reading pixels, as the checks do, is slow: so says the driver, and is right.
      if (!params.entry.text.includes("GL Driver Message")) this.problems.push(params.entry.text);
    } else if (method === "Network.requestWillBeSent") {
      this.requests.push(params.request.url);
    }
  }

  send(method, params = {}, session = this.session) {
    const id = ++this.lastId;
    const message = session ? { id, method, params, sessionId: session } : { id, method, params };
    this.input.write(`${JSON.stringify(message)}\0`);
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error(`${method}: no answer`)), ANSWER_MILLISECONDS);
      timer.unref();
      this.waiting.set(id, { resolve, reject });
    });
  }

  /** Size of the page, and what its style sheet may ask for. */
  async setDevice({ width, height, dark = false, ratio = 1, touch = false }) {
    await this.send("Emulation.setDeviceMetricsOverride", {
      width, height, deviceScaleFactor: ratio, mobile: touch,
    });
    await this.send("Emulation.setTouchEmulationEnabled", { enabled: touch });
    await this.send("Emulation.setEmulatedMedia", {
      features: [
        { name: "prefers-color-scheme", value: dark ? "dark" : "light" },
        { name: "prefers-reduced-motion", value: "reduce" },
      ],
    });
  }

  /** Opens an address and waits until it has loaded. */
  async open(url) {
    await this.send("Page.navigate", { url });
    await this.until("document.readyState === 'complete'", "the page does not load");
    await this.settle();
  }

  /** The value of an expression of the page. */
  async evaluate(expression) {
    const answer = await this.send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (answer.exceptionDetails) {
      throw new Error(`${expression}: ${answer.exceptionDetails.exception?.description}`);
    }
    return answer.result.value;
  }

  /** Waits until an expression of the page is true. */
  async until(expression, otherwise, milliseconds = ANSWER_MILLISECONDS) {
    const end = Date.now() + milliseconds;
    while (Date.now() < end) {
      if (await this.evaluate(expression)) return;
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    throw new Error(otherwise);
  }

  /** Waits for two frames, so that what was changed is drawn. */
  settle() {
    return this.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 60))))");
  }

  async mouse(type, x, y, extra = {}) {
    await this.send("Input.dispatchMouseEvent", { type, x, y, button: "none", ...extra });
  }

  async click(x, y, count = 1) {
    await this.mouse("mouseMoved", x, y);
    for (let clickCount = 1; clickCount <= count; clickCount++) {
      await this.mouse("mousePressed", x, y, { button: "left", clickCount });
      await this.mouse("mouseReleased", x, y, { button: "left", clickCount });
    }
    await this.settle();
  }

  /** Clicks the middle of the first element of a selector. */
  async clickOn(selector) {
    const [x, y] = await this.evaluate(`(() => {
      const found = document.querySelector(${JSON.stringify(selector)});
      found.scrollIntoView({ block: "center" });
      const box = found.getBoundingClientRect();
      return [box.x + box.width / 2, box.y + box.height / 2];
    })()`);
    await this.click(x, y);
  }

  async press(key, code = key) {
    const text = key.length === 1 ? key : undefined;
    // What the browser itself does with a key goes by this number.
    const windowsVirtualKeyCode = { Escape: 27, Tab: 9 }[key];
    const event = { key, code, windowsVirtualKeyCode };
    await this.send("Input.dispatchKeyEvent", { ...event, type: "keyDown", text });
    await this.send("Input.dispatchKeyEvent", { ...event, type: "keyUp" });
    await this.settle();
  }

  /** The page as PNG in base64. */
  async screenshot() {
    return (await this.send("Page.captureScreenshot", { format: "png" })).data;
  }

  async stop() {
    await this.send("Browser.close", {}, null).catch(() => {});
    if (this.process.exitCode === null) {
      await new Promise((resolve) => {
        this.process.once("exit", resolve);
        setTimeout(() => this.process.kill("SIGKILL"), 5000).unref();
      });
    }
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5 });
  }
}
