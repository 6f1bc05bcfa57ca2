#!/usr/bin/env bash
# A benchmark in parts as a task array of HyperQueue, whose workers share the working folder.
#   examples/cluster/hyperqueue.sh SHARDS FOLDER ARGUMENT…      the arguments are those of `curitiba bench`
# Each task takes all cores of its worker: rows that are timed side by side disturb each other. Run again after a failure, it does what is
# not done.
set -euo pipefail
shards=$1 folder=$2
shift 2
job=$(hq --output-mode quiet submit --array "1-$shards" --cpus all -- \
    "${CURITIBA:-curitiba}" bench "$@" --shard "auto/$shards" --parts "$folder")
hq job wait "$job"
# Waiting succeeds although tasks failed: what these printed is shown here, and `merge` fails for the rows that are missing.
if [ -n "$(hq job task-ids --filter failed "$job")" ]; then
    hq job cat --task-status failed --print-task-header "$job" stderr >&2
fi
"${CURITIBA:-curitiba}" merge "$folder.json" "$folder"
