#!/usr/bin/env python3
"""Whether the links of all Markdown files lead somewhere.

    check_links.py [FOLDER]

Looks at the files that git tracks below FOLDER (here). A relative link must name a file or a
folder that git tracks too, and a fragment a heading of the file that it leads to, by GitHub's
names. Prints each link that does not; the exit code is 1 if there is one. Links to other sites
are not followed.
"""

import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
IMAGE = re.compile(r"(?:src|href)=\"([^\"]+)\"")
FENCE = re.compile(r"^\s*(```|~~~)")
HEADING = re.compile(r"^#{1,6}\s+(.*?)\s*#*\s*$")


def without_code(text):
    """The lines outside of fenced blocks, with code spans blanked."""
    fenced = False
    for line in text.splitlines():
        if FENCE.match(line):
            fenced = not fenced
        elif not fenced:
            yield line


def slugs(text):
    """The fragments that GitHub gives the headings."""
    seen = {}
    found = set()
    for line in without_code(text):
        heading = HEADING.match(line)
        if not heading:
            continue
        # Of a link the text; of markup nothing.
        title = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading.group(1))
        slug = re.sub(r"[^\w\- ]", "", title.replace("`", "").lower()).replace(" ", "-")
        count = seen.get(slug, 0)
        seen[slug] = count + 1
        found.add(slug if count == 0 else f"{slug}-{count}")
    found.update(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text))
    return found


def main(arguments):
    root = Path(arguments[0] if arguments else ".").resolve()
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True)
    files = {root / name for name in listed.stdout.decode().split("\0") if name}
    known = files | {parent for file in files for parent in file.parents}
    texts = {file: file.read_text() for file in sorted(files) if file.suffix == ".md" and file.exists()}
    headings = {file: slugs(text) for file, text in texts.items()}
    bad, count = [], 0
    for file, text in texts.items():
        for line in without_code(text):
            line = re.sub(r"`[^`]*`", "``", line)
            for target in LINK.findall(line) + IMAGE.findall(line):
                if re.match(r"[a-z][a-z0-9+.-]*:", target):
                    continue
                count += 1
                path, _, fragment = unquote(target).partition("#")
                place = (file.parent / path).resolve() if path else file
                if place not in known:
                    bad.append(f"{file.relative_to(root)}: {target}: no such file")
                elif fragment and fragment not in headings.get(place, {fragment}):
                    bad.append(f"{file.relative_to(root)}: {target}: no such heading")
    print("\n".join(bad) if bad else f"{count} links of {len(texts)} files lead somewhere")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
