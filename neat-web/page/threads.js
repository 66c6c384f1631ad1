// Runs a program in threads, each a worker with the same memory. They compute; this worker
// answers what they ask of their system, one call after the other.

import { WASIProcExit } from "./wasi/index.js";

/** Pages of 64 KiB: what the program begins with, and the most that 32 bits can name. */
const PAGES = { initial: 256, maximum: 65536 };

// Loaded once: threads that start later need no network. A blob has the policy of the page.
const source = globalThis.crossOriginIsolated
  ? fetch(new URL("thread.js", import.meta.url)).then((answer) => answer.blob())
  : null;
source?.catch(() => {});

const sharedMemory = () => new WebAssembly.Memory({ ...PAGES, shared: true });

/** How many threads there can be: one where the page is not isolated, or small devices have no
 * room for the addresses of shared memory. */
export function threadCount() {
  if (!source) return 1;
  try {
    sharedMemory();
    return navigator.hardwareConcurrency;
  } catch {
    return 1;
  }
}

/** Runs a program to its end: its exit code, and how many bytes of memory it had. */
export async function runInThreads(module, system) {
  const memory = sharedMemory();
  // The program of `system` runs in the threads.
  system.inst = { exports: { memory } };
  const script = URL.createObjectURL(new Blob([await source], { type: "text/javascript" }));
  const workers = [];
  try {
    return await new Promise((ended, failed) => {
      const calls = {
        ...system.wasiImport,
        "thread-spawn": start,
        fail: (reason) => failed(new Error(reason)),
      };
      /** Starts a thread, and returns its number; the first is the program's main thread. */
      function start(argument) {
        const id = workers.length;
        const worker = new Worker(script, { type: "module" });
        worker.onmessage = ({ data }) => answer(data);
        worker.onerror = (event) => {
          event.preventDefault();
          failed(new Error(event.message ?? "a thread cannot be loaded"));
        };
        worker.postMessage({ module, memory, id, argument });
        workers.push(worker);
        return id;
      }
      function answer({ call, parameters, answer: place }) {
        try {
          const result = calls[call](...parameters);
          if (!place) return;
          place[1] = result;
          Atomics.store(place, 0, 1);
          Atomics.notify(place, 0);
        } catch (error) {
          if (error instanceof WASIProcExit) ended({ code: error.code, bytes: memory.buffer.byteLength });
          else failed(error);
        }
      }
      start();
    });
  } finally {
    for (const worker of workers) worker.terminate();
    URL.revokeObjectURL(script);
  }
}
