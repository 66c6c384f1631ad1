#!/usr/bin/env bash
# Makes a site of docs/, to be put on a server.
#
#   scripts/make_book.sh OUT
#
# Needs mdBook (`cargo install mdbook`) and Python 3. Links to files outside of docs/ become plain
# text, as the site does not have them, and formulas are written as mdBook wants them (MathJax
# shows them, which the page loads from the network).
set -euo pipefail
cd "$(dirname "$0")/.."

out=$(realpath -m "${1:?usage: make_book.sh OUT}")
command -v mdbook >/dev/null || {
    echo "make_book.sh: there is no mdbook: cargo install mdbook" >&2
    exit 1
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -r book.toml docs "$work"
python3 - "$work"/docs/*.md <<'END'
import re
import sys
from pathlib import Path


def formula(match):
    """Markdown must find no markup in it: what might be some is escaped."""
    block, inline = match.groups()
    escaped = re.sub(r"([\\_*{}\[\]()])", r"\\\1", block or inline)
    return f"\\\\[{escaped}\\\\]" if block else f"\\\\({escaped}\\\\)"


for name in sys.argv[1:]:
    text = re.sub(r"\[([^\]]*)\]\(\.\./[^)]*\)", r"\1", Path(name).read_text())
    parts = re.split(r"(```.*?```|`[^`\n]*`)", text, flags=re.DOTALL)
    # Every other part is code.
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"\$\$(.+?)\$\$|\$([^$\n]+)\$", formula, parts[k], flags=re.DOTALL)
    Path(name).write_text("".join(parts))
END
rm -rf "$out"
mdbook build --dest-dir "$out" "$work"
[ -f "$out/index.html" ]
echo "$out/index.html"
