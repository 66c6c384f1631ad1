#!/usr/bin/env node
// Prints index.html with the content security policy that the program gives.
//
//   node scripts/page_policy.mjs neat.wasm index.html

import { closeSync, mkdtempSync, openSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { WASI } from "node:wasi";

const [program, page] = process.argv.slice(2);
const work = mkdtempSync(join(tmpdir(), "page-policy-"));
const answer = join(work, "answer");
const stdout = openSync(answer, "w");
const system = new WASI({ version: "preview1", args: ["neat-web", "policy"], stdout, returnOnExit: true });
const module = await WebAssembly.compile(readFileSync(program));
const code = system.start(await WebAssembly.instantiate(module, system.getImportObject()));
closeSync(stdout);
const told = JSON.parse(readFileSync(answer, "utf8"));
rmSync(work, { recursive: true });
if (code !== 0) throw new Error(told.message);

const [before, after] = readFileSync(page, "utf8").split("{{policy}}");
process.stdout.write(before + told.policy + after);
