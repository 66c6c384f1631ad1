#!/usr/bin/env bash
# The container is built and reconstructs a scene: without network, without rights, with nothing
# to write to but the folder that it is given.
#
#   scripts/check_container.sh
#
# Needs podman or a docker whose daemon runs; says so where there is neither. The build takes as
# long as that of neat.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
    echo "error: $1" >&2
    exit 1
}

tool=
for name in podman docker; do
    if command -v "$name" >/dev/null && "$name" info >/dev/null 2>&1; then
        tool=$name
        break
    fi
done
if [ -z "$tool" ]; then
    echo "skipped: neither podman nor docker runs here"
    exit 0
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
image=localhost/neat:check
commit=$(git rev-parse HEAD)
"$tool" build --file Containerfile --build-arg "NEAT_COMMIT=$commit" --tag "$image" .
user=$("$tool" image inspect --format '{{.Config.User}}' "$image")
case $user in '' | 0 | root | 0:*) fail "the container runs as ${user:-root}" ;; esac
bytes=$("$tool" image inspect --format '{{.Size}}' "$image")
[ "$bytes" -lt 100000000 ] || fail "the image has $bytes bytes"

# What it writes is ours, so that it can be removed.
run=("$tool" run --rm --network none --read-only --tmpfs /tmp --cap-drop all --volume "$work:/data")
case $tool in
podman) run+=(--userns keep-id --user "$(id -u):$(id -g)") ;;
docker) run+=(--user "$(id -u):$(id -g)") ;;
esac
"${run[@]}" "$image" --version | grep -q "commit: ${commit:0:12}" || fail "it knows no commit"
"${run[@]}" "$image" demo --out demo --quiet
"${run[@]}" "$image" info demo/scene >/dev/null
[ -n "$(find "$work/demo" -name wireframe.json)" ] || fail "the demonstration left no wireframe"
echo "$image: $bytes bytes, as user $user"
