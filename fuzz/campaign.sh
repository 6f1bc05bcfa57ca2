#!/usr/bin/env bash
# Runs every fuzz target, or those that are named, for so many seconds, and prints the table that docs/robustness.md holds.
#   RUSTC_BOOTSTRAP=1 cargo fuzz build && [VARIABLE=VALUE…] fuzz/campaign.sh [SECONDS [TARGET…]]
# Variables, with their defaults:
#   BIN=fuzz/target/x86_64-unknown-linux-gnu/release   where the targets' binaries lie; no Rust toolchain is needed beside them
#   JOBS=1             processes for each target; they share its corpus
#   TARGETS_AT_ONCE=2  targets that run together
#   NICE=19            priority of the processes
#   CORPUS=fuzz/corpus what TARGET/ holds of it is gone on from; where that is missing, CORPUS/TARGET.tar.gz is unpacked first
#   OUT=fuzz/artifacts logs, findings (OUT/TARGET/), records of every process (OUT/records) and corpora (OUT/TARGET.tar.gz)
# Another run with the same OUT adds to the records: the table sums them. The exit code is 1 if any target has a finding.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
seconds=${1:-600}
shift || true
all=(project_xml mlib cbo obj gltf studio collada ogre texture picture shader script render)
targets=("$@")
[ $# -gt 0 ] || targets=("${all[@]}")
bin=$(realpath "${BIN:-$here/target/x86_64-unknown-linux-gnu/release}")
corpus=$(realpath -m "${CORPUS:-$here/corpus}")
out=$(realpath -m "${OUT:-$here/artifacts}")
jobs=${JOBS:-1}
started=$(date +%s)
mkdir -p "$corpus" "$out"
# A corpus of more than this is shrunk before it is packed: the machines that run campaigns pass on no larger files.
most_bytes=$((15 << 20))

# One process: its log, and a line of its executions, its processor time, and what it covered.
process() {
    local target=$1 number=$2 dictionary=$1 log
    log=$out/$target.$started.$number.log
    case $target in
    project_xml | mlib) dictionary=project ;;
    esac
    local options=(-max_len=8192 -malloc_limit_mb=512 -rss_limit_mb=2048 -timeout=25 -print_final_stats=1 -reload=1)
    [ -e "$here/dictionaries/$dictionary.dict" ] && options+=("-dict=$here/dictionaries/$dictionary.dict")
    local failed=0 TIMEFORMAT='processor %U %S'
    { time nice -n "${NICE:-19}" "$bin/$target" "${options[@]}" -max_total_time="$seconds" \
        -artifact_prefix="$out/$target/" "$corpus/$target"; } >"$log" 2>&1 || failed=1
    local last cov ft edges runs cpu
    # A process may end before it prints its coverage.
    last=$(grep -aE 'cov: [0-9]+ ft: [0-9]+ corp:' "$log" | tail -1) || true
    cov=$(sed -E 's/.* cov: ([0-9]+) .*/\1/' <<<"$last")
    ft=$(sed -E 's/.* ft: ([0-9]+) .*/\1/' <<<"$last")
    edges=$(sed -nE 's/.*Loaded 1 modules +\(([0-9]+) inline.*/\1/p' "$log")
    runs=$(sed -nE 's/^stat::number_of_executed_units: +//p' "$log")
    cpu=$(awk '/^processor / { print $2 + $3 }' "$log")
    echo "$target ${runs:-0} ${cpu:-0} ${cov:-0} ${edges:-0} ${ft:-0} $failed" >>"$out/records"
    [ $failed = 0 ] || echo "$target: a finding, see $log" >&2
}

# A target: its corpus, its processes, and its corpus again for whoever goes on.
run() {
    local target=$1 number
    mkdir -p "$corpus/$target" "$out/$target"
    if [ -z "$(ls -A "$corpus/$target")" ] && [ -e "$corpus/$target.tar.gz" ]; then
        tar -xzf "$corpus/$target.tar.gz" -C "$corpus"
    fi
    for ((number = 0; number < jobs; number++)); do process "$target" "$number" & done
    wait
    if [ "$(du -sb "$corpus/$target" | cut -f1)" -gt $most_bytes ]; then
        mkdir "$corpus/$target.small"
        if "$bin/$target" -merge=1 -max_total_time=60 "$corpus/$target.small" "$corpus/$target" >"$out/$target.merge.log" 2>&1; then
            rm -r "$corpus/$target" && mv "$corpus/$target.small" "$corpus/$target"
        else
            rm -r "$corpus/$target.small"
        fi
    fi
    tar -czf "$out/$target.tar.gz" -C "$corpus" "$target"
}

running=0
for target in "${targets[@]}"; do
    [ -x "$bin/$target" ] || { echo "there is no binary $bin/$target; build it first" >&2; exit 2; }
    if [ $((running++)) -ge "${TARGETS_AT_ONCE:-2}" ]; then wait -n; fi
    run "$target" &
done
wait

echo '| target | executions | processor time | edges covered, of all | features | corpus |'
echo '|---|---:|---:|---|---:|---|'
for target in "${targets[@]}"; do
    inputs=$(find "$corpus/$target" -type f | wc -l)
    bytes=$(du -sb "$corpus/$target" | cut -f1)
    awk -v target="$target" -v inputs="$inputs" -v bytes="$bytes" '
        $1 == target { runs += $2; cpu += $3; edges = $5; if ($4 > cov) cov = $4; if ($6 > ft) ft = $6 }
        END { printf "| `%s` | %d | %d s | %d of %d | %d | %d inputs, %.1f MB |\n", target, runs, cpu, cov, edges, ft, inputs, bytes / 1e6 }
    ' "$out/records"
done
findings=$(awk '$7 != 0' "$out/records" | wc -l)
[ "$findings" = 0 ] || { echo "$findings processes ended with a finding" >&2; exit 1; }
