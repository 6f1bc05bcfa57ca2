#!/usr/bin/env bash
# Runs every fuzz target for SECONDS_EACH (600 unless given), two at a time and with the lowest priority (NICE=19 unless
# given), and prints the table that docs/robustness.md holds. Logs and findings stay in fuzz/artifacts; the corpus is kept, so
# that another run goes on from it.
#   RUSTC_BOOTSTRAP=1 cargo fuzz build && [NICE=0] fuzz/campaign.sh [SECONDS_EACH]
set -euo pipefail
cd "$(dirname "$0")"
seconds=${1:-600}
binaries=target/x86_64-unknown-linux-gnu/release

run() {
    local target=$1 dictionary=$1
    case $target in
    project_xml | mlib) dictionary=project ;;
    esac
    local options=(-max_len=8192 -malloc_limit_mb=512 -rss_limit_mb=2048 -timeout=25 -print_final_stats=1)
    [ -e "dictionaries/$dictionary.dict" ] && options+=("-dict=dictionaries/$dictionary.dict")
    mkdir -p "corpus/$target" "artifacts/$target"
    { time nice -n "${NICE:-19}" "$binaries/$target" "${options[@]}" -max_total_time="$seconds" \
        -artifact_prefix="artifacts/$target/" "corpus/$target"; } >"artifacts/$target.log" 2>&1 ||
        echo "$target: a finding, see artifacts/$target.log" >&2
}

pair() { for target in "$@"; do run "$target" & done; wait; }

pair project_xml mlib
pair cbo obj
pair gltf texture

echo '| target | executions | processor time | edges covered, of all | features | corpus |'
echo '|---|---|---|---|---|---|'
for target in project_xml mlib cbo obj gltf texture; do
    log=artifacts/$target.log
    last=$(grep -E 'cov: [0-9]+ ft: [0-9]+ corp:' "$log" | tail -1)
    field() { sed -E "s/.* $1: ([^ ]+).*/\1/" <<<"$last"; }
    edges=$(sed -nE 's/.*Loaded 1 modules +\(([0-9]+) inline.*/\1/p' "$log")
    runs=$(sed -nE 's/^stat::number_of_executed_units: +//p' "$log")
    user=$(sed -nE 's/^user[[:space:]]+//p' "$log")
    echo "| \`$target\` | $runs | $user | $(field cov) of $edges | $(field ft) | $(field corp) |"
done
