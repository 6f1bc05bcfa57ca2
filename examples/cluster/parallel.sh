#!/usr/bin/env bash
# A benchmark in parts, run by GNU parallel on this machine; with --sshlogin on several that share the folder.
#   examples/cluster/parallel.sh SHARDS FOLDER ARGUMENT…      the arguments are those of `curitiba bench`
# JOBS=1 unless it is set: rows that are timed side by side disturb each other. Run again after a failure, it does what is not done.
set -euo pipefail
shards=$1 folder=$2
shift 2
mkdir -p "$folder"
# Nothing of the log of jobs is needed to go on: rows that are in the folder are not measured again.
seq "$shards" | parallel -j "${JOBS:-1}" --retries 3 --joblog "$folder/jobs.log" \
    "${CURITIBA:-curitiba}" bench "$@" --shard "{}/$shards" --parts "$folder"
"${CURITIBA:-curitiba}" merge "$folder.json" "$folder"
