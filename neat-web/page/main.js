// The page: takes a scene, shows how far the worker has come, then its results.

import { chosenFolder, droppedFolder } from "./scene_folder.js";
import { thumbnail } from "./thumbnail.js";

const $ = (id) => document.getElementById(id);
const STAGES = {
  load: "Reading images and cameras",
  detect: "Detecting 2D segments",
  examine: "Examining whether images and cameras agree",
  distill: "Assembling the wireframe",
};

let worker = null;
let reportUrl = null;
/** The content of the report. */
let report = null;
/** When the work on a scene began, in milliseconds. */
let began = 0;

// A worker of a file of its own would have the policy of that file, which a plain server does not
// give: one of a blob has the page's.
const WORKER = URL.createObjectURL(new Blob(
  [`import ${JSON.stringify(new URL("worker.js", import.meta.url))};`], { type: "text/javascript" }));

function startWorker() {
  worker?.terminate();
  worker = new Worker(WORKER, { type: "module" });
  worker.onmessage = ({ data }) => HEARD[data.event]?.(data);
  worker.onerror = (event) => {
    event.preventDefault();
    fail(`The program cannot be loaded: ${event.message ?? "its files are not where the page is"}.`);
  };
}

/** What the program and the worker tell, by `event`. What is not shown is not here. */
const HEARD = {
  formats: ({ formats }) => $("format").replaceChildren(...formats.map(({ name, ending, explanation }) => {
    const option = new Option(`${name}: ${explanation}`, name);
    option.dataset.ending = ending;
    return option;
  })),
  stage_started: ({ stage }) => {
    $("stage").textContent = STAGES[stage] ?? stage;
    $("bar").removeAttribute("value");
  },
  stage_progress: ({ fraction }) => { $("bar").value = fraction; },
  detected: (event) => {
    $("views").hidden = false;
    $("thumbnails").append(thumbnail(event));
  },
  decision: ({ setting, value, reason }) => note(`${setting}: ${value}, ${reason}`),
  warning: ({ message }) => note(message, "warning"),
  note: ({ message }) => note(message),
  exported: ({ remarks }) => { $("remarks").textContent = remarks.join(" "); },
  done: (answer) => FINISHED[answer.command](answer),
};

/** What follows a command. */
const FINISHED = {
  formats: ({ failure }) => { if (failure) fail(failure); },
  reconstruct: ({ failure, bytes, report: page }) => {
    busy(false);
    const seconds = ((performance.now() - began) / 1000).toFixed(1);
    const mebibytes = Math.ceil(bytes / 2 ** 20);
    $("stage").textContent = failure ? "Stopped" : `Done in ${seconds} s with ${mebibytes} MiB of memory`;
    $("bar").value = failure ? 0 : 1;
    if (failure) return fail(failure);
    report = new Blob([page], { type: "text/html" });
    reportUrl = URL.createObjectURL(report);
    $("report").src = reportUrl;
    $("result").hidden = false;
  },
  export: ({ failure, name, content }) => {
    $("download").disabled = false;
    if (failure) return fail(failure);
    save(new Blob([content]), name);
  },
};

function note(text, kind) {
  const item = document.createElement("li");
  item.textContent = text;
  if (kind) item.className = kind;
  $("notes").append(item);
}

function fail(text) {
  $("problem").textContent = text;
  $("problem").hidden = false;
}

/** Nothing else begins while a scene is worked on. */
function busy(isBusy) {
  for (const id of ["choose", "synthetic"]) $(id).disabled = isBusy;
  $("stop").hidden = !isBusy;
}

const isBusy = () => $("choose").disabled;

/** Forgets the results of an earlier scene. */
function clear() {
  for (const id of ["problem", "result", "views", "progress"]) $(id).hidden = true;
  for (const id of ["notes", "thumbnails"]) $(id).replaceChildren();
  $("remarks").textContent = "";
  $("download").disabled = false;
  $("report").removeAttribute("src");
  if (reportUrl) URL.revokeObjectURL(reportUrl);
  reportUrl = null;
}

/** Works on a folder, or on the synthetic scene where there are no files. */
function begin({ name, files }) {
  clear();
  busy(true);
  $("progress").hidden = false;
  $("stage").textContent = "Starting";
  began = performance.now();
  worker.postMessage({ command: "reconstruct", name, files });
}

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  // Some browsers read it a little later.
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

$("synthetic").onclick = () => begin({ name: "synthetic" });
$("choose").onclick = () => $("folder").click();
$("folder").onchange = () => {
  const folder = chosenFolder($("folder"));
  // The same folder may be chosen again.
  $("folder").value = "";
  if (folder) begin(folder);
};
$("stop").onclick = () => {
  startWorker();
  clear();
  busy(false);
};
$("download").onclick = () => {
  const option = $("format").selectedOptions[0];
  $("download").disabled = true;
  $("problem").hidden = true;
  worker.postMessage({ command: "export", format: option.value, ending: option.dataset.ending });
};
$("download-report").onclick = () => save(report, "report.html");

addEventListener("dragover", (event) => {
  event.preventDefault();
  $("drop").classList.add("over");
});
addEventListener("dragleave", () => $("drop").classList.remove("over"));
addEventListener("drop", async (event) => {
  event.preventDefault();
  $("drop").classList.remove("over");
  if (isBusy()) return;
  try {
    const folder = await droppedFolder(event.dataTransfer);
    if (folder) begin(folder);
    else fail("That is not a folder: drop the one folder that holds images and cameras.");
  } catch (error) {
    fail(`The folder cannot be read: ${error.message}`);
  }
});

startWorker();
worker.postMessage({ command: "formats" });
