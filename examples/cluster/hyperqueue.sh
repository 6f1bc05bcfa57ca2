#!/usr/bin/env bash
# A benchmark in parts as a task array of HyperQueue, whose workers share the working folder.
#   examples/cluster/hyperqueue.sh SHARDS FOLDER ARGUMENT…      the arguments are those of `curitiba bench`
# Each task takes all cores of its worker: rows that are timed side by side disturb each other.
set -euo pipefail
shards=$1 folder=$2
shift 2
hq submit --wait --array "1-$shards" --cpus all -- \
    "${CURITIBA:-curitiba}" bench "$@" --shard "auto/$shards" --parts "$folder"
"${CURITIBA:-curitiba}" merge "$folder.json" "$folder"
