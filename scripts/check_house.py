#!/usr/bin/env python3
"""What the house has promised: sizes, front doors and arrows.

    scripts/check_house.py            # the table, and every rule that is broken
    scripts/check_house.py --cycles   # the imports behind each circle

Counts production lines: Rust below `src`, without tests, comments, attributes of
documentation and blank lines. Fails if a function of a library is longer than
80 such lines, if a crate has more than a dozen public modules, if the modules of a
crate import each other in a circle, or if a crate depends on another that the list
"layers" of docs/architecture.md does not name beside it, or the other way round.
"""

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONGEST_FUNCTION = 80
MOST_PUBLIC_MODULES = 12


def stripped(text):
    """The lines of Rust source with strings, characters and comments blanked."""
    out = []
    i, n = 0, len(text)
    while i < n:
        two = text[i : i + 2]
        raw = re.compile(r'b?r(#*)"').match(text, i) if text[i] in "br" else None
        if raw and (i == 0 or not (text[i - 1].isalnum() or text[i - 1] == "_")):
            end = text.find('"' + raw.group(1), raw.end())
            end = n if end < 0 else end + 1 + len(raw.group(1))
            out.append('"' + re.sub(r"[^\n]", "s", text[i + 1 : end - 1]) + '"')
            i = end
        elif two == "//":
            end = text.find("\n", i)
            i = n if end < 0 else end
        elif two == "/*":
            depth, j = 1, i + 2
            while j < n and depth:
                if text[j : j + 2] == "/*":
                    depth, j = depth + 1, j + 2
                elif text[j : j + 2] == "*/":
                    depth, j = depth - 1, j + 2
                else:
                    j += 1
            out.append(re.sub(r"[^\n]", " ", text[i:j]))
            i = j
        elif text[i] == '"':
            j = i + 1
            while j < n and text[j] != '"':
                j += 2 if text[j] == "\\" else 1
            out.append('"' + re.sub(r"[^\n]", "s", text[i + 1 : j]) + '"')
            i = j + 1
        elif text[i] == "'" and re.compile(r"'(\\[^\n]{1,8}?|[^\\'\n])'").match(text, i):
            end = re.compile(r"'(\\[^\n]{1,8}?|[^\\'\n])'").match(text, i).end()
            out.append("'c'")
            i = end
        else:
            out.append(text[i])
            i += 1
    return "".join(out)


def closing(text, start):
    """The index behind the brace that closes the one at `start`."""
    depth = 0
    for i in range(start, len(text)):
        if text[i] == "{":
            depth += 1
        elif text[i] == "}":
            depth -= 1
            if depth == 0:
                return i + 1
    return len(text)


def without_tests(text):
    """Source without the items behind `#[cfg(test)]`."""
    while match := re.search(r"#\[cfg\(test\)\]", text):
        brace = text.find("{", match.end())
        semicolon = text.find(";", match.end())
        if semicolon >= 0 and (brace < 0 or semicolon < brace):
            end = semicolon + 1
        else:
            end = closing(text, brace) if brace >= 0 else len(text)
        text = text[: match.start()] + text[end:]
    return text


def production(path):
    return without_tests(stripped(path.read_text()))


def lines(text):
    return sum(1 for line in text.splitlines() if line.strip())


def test_modules(source):
    """Files of modules that only tests see."""
    found = set()
    for path in source.rglob("*.rs"):
        for name in re.findall(
            r"#\[cfg\(test\)\]\s*(?:pub(?:\([^)]*\))? )?mod (\w+);", stripped(path.read_text())
        ):
            base = path.parent if path.stem in ("mod", "lib", "main") else path.parent / path.stem
            found.add(base / f"{name}.rs")
            found.update((base / name).rglob("*.rs"))
    return found


def functions(text):
    for match in re.finditer(r"\bfn (\w+)", text):
        brace = re.compile(r"[{;]").search(text, match.end())
        if brace and text[brace.start()] == "{":
            body = text[match.start() : closing(text, brace.start())]
            yield match.group(1), lines(body)


def imports(text):
    """The top-level modules of its own crate that source names."""
    return set(re.findall(r"\bcrate::(\w+)", re.sub(r"crate::\{", "crate::", text))) | {
        name
        for group in re.findall(r"\bcrate::\{([^;]*?)\};", text)
        for name in re.findall(r"(?:^|,)\s*(\w+)", re.sub(r"\{[^{}]*\}", "", group))
    }


def circles(graph):
    """Strongly connected components of more than one module."""
    order, low, stack, found, count = {}, {}, [], [], [0]

    def visit(node):
        order[node] = low[node] = count[0]
        count[0] += 1
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in order:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], order[other])
        if low[node] == order[node]:
            part = []
            while True:
                part.append(stack.pop())
                if part[-1] == node:
                    break
            if len(part) > 1:
                found.append(sorted(part))

    for node in sorted(graph):
        if node not in order:
            visit(node)
    return found


def layers():
    """What the documentation and the manifests say differently of who depends on whom."""
    text = (ROOT / "docs/architecture.md").read_text()
    block = re.search(r"```text\n(neat-core\n.*?)```", text, re.S)
    if not block:
        return ["docs/architecture.md has no list of crates that begins with neat-core"]
    told, seen, broken = {}, set(), []
    for line in block.group(1).splitlines():
        crate, _, below = line.partition("→")
        crate = crate.strip()
        told[crate] = set(below.split())
        for other in sorted(told[crate] - seen):
            broken.append(f"docs/architecture.md lists {crate} above {other}")
        seen.add(crate)
    for manifest in sorted(ROOT.glob("neat-*/Cargo.toml")):
        crate = manifest.parent.name
        names = tomllib.loads(manifest.read_text()).get("dependencies", {})
        real = {name for name in names if name.startswith("neat-")}
        for other in sorted(real - told.get(crate, set())):
            broken.append(f"{crate} depends on {other}: not in docs/architecture.md")
        for other in sorted(told.get(crate, set()) - real):
            broken.append(f"{crate} does not depend on {other}: docs/architecture.md says so")
    return broken


def main():
    broken, total = layers(), 0
    print(f"{'crate':16} {'lines':>6} {'files':>5} {'public modules':>14}  longest function")
    for source in sorted(ROOT.glob("neat-*/src")):
        crate = source.parent.name
        tests = test_modules(source)
        files = {
            path: production(path)
            for path in sorted(source.rglob("*.rs"))
            if path not in tests and path.name != "tests.rs" and "tests" not in path.parts
        }
        count = sum(lines(text) for text in files.values())
        total += count
        root = source / ("lib.rs" if (source / "lib.rs").is_file() else "main.rs")
        doors = len(re.findall(r"^pub mod \w+", files[root], re.M))
        found = [
            (length, name, path.relative_to(ROOT))
            for path, text in files.items()
            for name, length in functions(text)
        ]
        length, name, path = max(found)
        print(f"{crate:16} {count:6} {len(files):5} {doors:14}  {length} {name}")
        if root.name == "lib.rs":
            if doors > MOST_PUBLIC_MODULES:
                broken.append(f"{crate} has {doors} public modules")
            for length, name, path in sorted(found, reverse=True):
                if length > LONGEST_FUNCTION:
                    broken.append(f"{path}: {name} has {length} lines")
        modules = {
            path.relative_to(source).parts[0].removesuffix(".rs")
            for path in files
            if path.name not in ("lib.rs", "main.rs") or path.parent != source
        }
        graph = {module: set() for module in modules}
        why = {}
        for path, text in files.items():
            module = path.relative_to(source).parts[0].removesuffix(".rs")
            if module in graph:
                for other in imports(text) & modules - {module}:
                    graph[module].add(other)
                    why.setdefault((module, other), []).append(path.relative_to(ROOT))
        for circle in circles(graph):
            broken.append(f"{crate}: {', '.join(circle)} import each other in a circle")
            if "--cycles" in sys.argv:
                for (module, other), paths in sorted(why.items()):
                    if module in circle and other in circle:
                        broken.append(f"    {module} -> {other}: {paths[0]}")
    print(f"{'all':16} {total:6}")
    for sentence in broken:
        print(f"broken: {sentence}")
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
