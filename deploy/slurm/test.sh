#!/usr/bin/env bash
# A batch of 8 small scenes as a job array on a Slurm of one node, which is killed in
# the middle of the work and comes back.
#
#   deploy/slurm/test.sh [NEAT]        as root; NEAT is target/release/neat by default
#
# Slurm and munge come from the distribution's packages (apt-get install slurmctld
# slurmd slurm-client munge); both run from a temporary folder, on ports of their own,
# and end with the script. The script fails unless every scene is finished, some task
# was started again, and every result has the bytes of a run without Slurm.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
neat=$(realpath "${1:-$here/../../target/release/neat}")
arguments=(--train --backend flex --steps "${STEPS:-300}" --no-cache --no-doctor)
solids=(box l-prism stair-prism hexagonal-prism t-prism u-prism wedge truncated-pyramid)

work=$(mktemp -d)
say() { printf '[%4d s] %s\n' "$SECONDS" "$1"; }
fail() {
    echo "error: $1" >&2
    tail -n 20 "$work"/slurmctld.log "$work"/slurmd.log >&2 || true
    exit 1
}

# Ends the daemons that were started, by their numbers.
clean_up() {
    local file
    scancel --user root --full --signal KILL >/dev/null 2>&1 || true
    for file in slurmd slurmctld munged; do
        if [ -s "$work/$file.pid" ]; then
            kill -KILL "$(cat "$work/$file.pid")" 2>/dev/null || true
        fi
    done
    kill_steps
    rm -rf "$work"
}
trap clean_up EXIT

# The processes of the tasks on this node, their shepherds (slurmstepd) included.
step_processes() {
    local pid parent
    for pid in $(scontrol listpids 2>/dev/null | awk 'NR > 1 && $1 > 0 { print $1 }'); do
        echo "$pid"
        parent=$(ps -o ppid= -p "$pid" | tr -d ' ')
        if [ -n "$parent" ] && ps -o comm= -p "$parent" | grep -q slurmstepd; then
            echo "$parent"
        fi
    done | sort -u
}
kill_steps() {
    local pids
    pids=$(step_processes)
    [ -z "$pids" ] || kill -KILL $pids 2>/dev/null || true
}

# wait_for SECONDS COMMAND...: until the command succeeds.
wait_for() {
    local end=$((SECONDS + $1))
    shift
    until "$@"; do
        [ "$SECONDS" -lt "$end" ] || return 1
        sleep 0.5
    done
}

start_node() {
    slurmd -f "$SLURM_CONF" || fail "slurmd does not start"
}

for program in munged slurmctld slurmd sbatch; do
    command -v "$program" >/dev/null || PATH=$PATH:/usr/sbin
    command -v "$program" >/dev/null || fail "$program is not installed"
done
[ "$(id -u)" = 0 ] || fail "slurmd and slurmctld need root here"

# --- Slurm ---------------------------------------------------------------------------

node=$(hostname -s)
export SLURM_CONF=$work/slurm.conf
chmod 755 "$work"
mkdir "$work"/{munge,state,spool}
cat >"$SLURM_CONF" <<END
ClusterName=neat-test
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=${SLURMCTLD_PORT:-16817}
SlurmdPort=${SLURMD_PORT:-16818}
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
# A node is dead that is silent for 10 seconds; it may come back.
SlurmdTimeout=10
ReturnToService=2
JobRequeue=1
KillWait=5
NodeName=$node NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=test Nodes=$node Default=YES MaxTime=INFINITE State=UP
END

mungekey --create --keyfile "$work/munge/key"
munged --force --socket "$work/munge/socket" --key-file "$work/munge/key" \
    --pid-file "$work/munged.pid" --log-file "$work/munged.log" \
    --seed-file "$work/munge/seed" || fail "munged does not start"
slurmctld -f "$SLURM_CONF" || fail "slurmctld does not start"
start_node
node_is() { sinfo --noheader --format %T 2>/dev/null | grep -qE "^($1)"; }
wait_for 60 node_is 'idle' || fail "the node does not come up"
say "Slurm $(sinfo --version | cut -d' ' -f2) with the node $node"

# --- Scenes, and their results without Slurm -----------------------------------------

for solid in "${solids[@]}"; do
    "$neat" synth --out "$work/scenes/$solid" --solid "$solid" --views 12 --image-size 128 \
        --detection-rate 1 >/dev/null
done
# alone SOLID...: one after the other.
alone() {
    local solid
    for solid; do
        "$neat" --quiet --threads 1 reconstruct "$work/scenes/$solid" --out "$work/single/$solid" \
            "${arguments[@]}" >"$work/single-$solid.log" 2>&1 || return
    done
}
alone "${solids[@]:0:4}" &
alone "${solids[@]:4}" || fail "a scene alone fails: $(cat "$work"/single-*.log)"
wait $! || fail "a scene alone fails: $(cat "$work"/single-*.log)"
say "8 scenes, each reconstructed alone"

# --- The batch -----------------------------------------------------------------------

job=$(cd "$work" && NEAT=$neat sbatch --parsable --array=1-8 --cpus-per-task=1 --mem=0 \
    --time=60 --oversubscribe "$here/neat-batch.sbatch" \
    "$work/scenes/*" --out "$work/out" -- "${arguments[@]}")
say "job array $job"

running() { [ "$(squeue --noheader --states R --format %i | wc -l)" -ge 2 ]; }
trains() { [ "$(cat "$work"/out/*/run/metrics.jsonl 2>/dev/null | wc -l)" -gt 0 ]; }
wait_for 120 running || fail "no two tasks run"
wait_for 120 trains || fail "no scene is trained"
killed=$(squeue --noheader --states R --format %K | sort -n | tr '\n' ' ')

pids=$(step_processes)
# Some end with others that were killed before them.
kill -KILL "$(cat "$work/slurmd.pid")" $pids 2>/dev/null || true
say "killed slurmd and the $(wc -w <<<"$pids") processes of tasks $killed"
wait_for 120 node_is 'down' || fail "nobody notices that the node is dead"
say "the node is $(sinfo --noheader --format %T)"
requeued() { [ -z "$(squeue --noheader --states R --format %i)" ]; }
wait_for 60 requeued || fail "tasks of a dead node still run"
restarts() { scontrol show job "$1" 2>/dev/null | grep -o 'Restarts=[0-9]*' | cut -d= -f2; }
squeue --format '%.12i %.10T %.20S %r' | head -12
start_node
wait_for 60 node_is 'idle|mix|alloc' || fail "the node does not come back"
say "the node is back"
# Slurm leaves a dead node two minutes to clean up; this one is clean.
for task in $killed; do
    scontrol update jobid="${job}_$task" StartTime=now || true
done

declare -A restarted
all_done() {
    local task count
    for task in 1 2 3 4 5 6 7 8; do
        count=$(restarts "${job}_$task" | head -1)
        restarted[$task]=${count:-${restarted[$task]:-0}}
    done
    [ -z "$(squeue --noheader --format %i)" ]
}
wait_for 1800 all_done || fail "the batch does not end"
say "the batch has ended"

"$neat" batch "$work/scenes/*" --out "$work/out" --summary-only -- "${arguments[@]}" >"$work/summary" \
    || { cat "$work/summary" "$work"/neat-*.txt; fail "not all scenes are finished"; }

# --- The table -----------------------------------------------------------------------

echo
echo "| task | scene | restarts by Slurm | attempts | wireframe.json |"
echo "| --: | --- | --: | --: | --- |"
different=0
again=0
task=0
for solid in $(printf '%s\n' "${solids[@]}" | LC_ALL=C sort); do
    task=$((task + 1))
    attempts=$(grep -c '"outcome"' "$work/out/$solid/job.json")
    again=$((again + restarted[$task]))
    verdict="the same bytes"
    if ! cmp -s "$work/out/$solid/run/wireframe.json" "$work/single/$solid/wireframe.json"; then
        verdict=DIFFERENT
        different=$((different + 1))
    fi
    echo "| $task | $solid | ${restarted[$task]} | $attempts | $verdict |"
done
echo
cat "$work/summary"
echo
# Bytes of wireframes, not of nothing.
awk -F, 'NR > 1 && $7 < 6 { few = 1 } END { exit few }' "$work/out/summary.csv" \
    || fail "a wireframe has fewer than 6 edges"
[ "$different" = 0 ] || fail "$different results differ from those without Slurm"
[ "$again" -ge 1 ] || fail "no task was started again"
say "8 of 8 results, $again tasks started again after the node was killed"
