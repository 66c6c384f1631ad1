// Runs the program `neat-web` with a file system in memory. Its lines of JSON go to the page
// as they are; `done` ends a command, with `failure` where it failed.

import { ConsoleStdout, Directory, File, Inode, OpenFile, PreopenDirectory, WASI, wasi } from "./wasi/index.js";
import { runInThreads, threadCount } from "./threads.js";

/** A file of the user, which is read each time the program opens it: memory holds one at a time. */
class LocalFile extends Inode {
  constructor(file) {
    super();
    this.file = file;
  }

  stat() {
    return new wasi.Filestat(this.ino, wasi.FILETYPE_REGULAR_FILE, BigInt(this.file.size));
  }

  path_open(oflags, rights, flags) {
    const bytes = new FileReaderSync().readAsArrayBuffer(this.file);
    return new File(bytes, { readonly: true }).path_open(oflags, rights, flags);
  }
}

const threads = threadCount();
const file = threads > 1 ? "neat-threads.wasm" : "neat.wasm";
const program = fetch(new URL(file, import.meta.url)).then((answer) => {
  if (!answer.ok) throw new Error(`${file}: ${answer.status} ${answer.statusText}`);
  return answer.arrayBuffer();
}).then((bytes) => WebAssembly.compile(bytes));
// Each command awaits it, and is told.
program.catch(() => {});

const SCENE = "/scene";
const RESULTS = "/results";
const OUT_OF_MEMORY = "The memory that a browser gives a page, 4 GiB at most, does not hold this scene: take fewer images, or smaller ones.";

const root = new Map();

/** Puts a file at a path below the root. */
function place(path, file) {
  const names = path.split("/").filter((name) => name !== "");
  const last = names.pop();
  let contents = root;
  for (const name of names) {
    if (!contents.has(name)) contents.set(name, new Directory(new Map()));
    contents = contents.get(name).contents;
  }
  contents.set(last, new LocalFile(file));
}

/** The bytes of a result. */
function written(path) {
  let found = { contents: root };
  for (const name of `${RESULTS}/${path}`.split("/").slice(1)) found = found.contents.get(name);
  return found.data;
}

/** Runs a program to its end: its exit code, and how many bytes of memory it had. */
async function runAlone(module, system) {
  const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: system.wasiImport });
  return { code: system.start(instance), bytes: instance.exports.memory.buffer.byteLength };
}

/** Runs the program to its end: its `failure`, if it failed, and how many bytes of memory it had. */
async function run(...parameters) {
  const errors = [];
  const stdin = new OpenFile(new File(new ArrayBuffer(0)));
  const stdout = ConsoleStdout.lineBuffered((line) => {
    const told = JSON.parse(line);
    if (told.event === "error") errors.push(told.message);
    else postMessage(told);
  });
  const stderr = ConsoleStdout.lineBuffered((line) => errors.push(line));
  const descriptors = [stdin, stdout, stderr, new PreopenDirectory("/", root)];
  const environment = [`RAYON_NUM_THREADS=${threads}`];
  const system = new WASI(["neat-web", ...parameters], environment, descriptors, { debug: false });
  try {
    const end = await (threads > 1 ? runInThreads : runAlone)(await program, system);
    if (end.code === 0) return end;
  } catch (error) {
    // A program that ends itself has said why.
    if (errors.length === 0) errors.push(String(error));
  }
  const text = errors.join("\n");
  return { failure: text.startsWith("memory allocation") ? OUT_OF_MEMORY : text };
}

const COMMANDS = {
  async reconstruct({ name, files }) {
    root.clear();
    const scene = `${SCENE}/${name}`;
    if (files) {
      for (const { path, file } of files) place(`${scene}/${path}`, file);
    } else {
      const { failure } = await run("synthesise", scene);
      if (failure) return { failure };
    }
    const end = await run("reconstruct", scene, RESULTS);
    return end.failure ? end : { ...end, report: written("report.html") };
  },

  async export({ format, ending }) {
    const end = await run("export", `${RESULTS}/wireframe.json`, format, `${RESULTS}/exported`);
    return end.failure ? end : { name: `wireframe.${ending}`, content: written("exported") };
  },

  formats: () => run("formats"),
};

onmessage = async ({ data }) => {
  try {
    postMessage({ event: "done", command: data.command, ...await COMMANDS[data.command](data) });
  } catch (error) {
    postMessage({ event: "done", command: data.command, failure: error.message });
  }
};
