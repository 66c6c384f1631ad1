// One thread of the program. Its memory is that of all threads; whatever else it asks of its
// system, the worker that started it answers, which has the files.

/** Whether an answer is there, and what it is. */
const answer = new Int32Array(new SharedArrayBuffer(8));

/** Asks the worker and waits: for ever where the question ends the program. The worker may wake
 * this thread for an answer that it has already taken: only the flag says that one is there. */
function ask(call, parameters) {
  Atomics.store(answer, 0, 0);
  postMessage({ call, parameters, answer });
  while (Atomics.load(answer, 0) === 0) Atomics.wait(answer, 0, 0);
  return answer[1];
}

/** What the program imports of WASI. */
function wasiOf(module) {
  const wanted = WebAssembly.Module.imports(module).filter((one) => one.module === "wasi_snapshot_preview1");
  const calls = wanted.map(({ name }) => [name, (...parameters) => ask(name, parameters)]);
  // Threads that look for work call it over and over.
  return { ...Object.fromEntries(calls), sched_yield: () => 0 };
}

onmessage = async ({ data: { module, memory, id, argument } }) => {
  try {
    const { exports } = await WebAssembly.instantiate(module, {
      env: { memory },
      wasi: { "thread-spawn": (start) => ask("thread-spawn", [start]) },
      wasi_snapshot_preview1: wasiOf(module),
    });
    if (id > 0) return exports.wasi_thread_start(id, argument);
    exports._start();
    ask("proc_exit", [0]);
  } catch (error) {
    postMessage({ call: "fail", parameters: [String(error)] });
  }
};
