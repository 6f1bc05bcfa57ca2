#!/usr/bin/env bash
# The frames of a camera path, run by GNU parallel.
#   examples/cluster/frames.sh SHARDS ARGUMENT…      the arguments are those of `curitiba render`, with --path
# Frames may share a machine where their times do not matter: JOBS=4 runs four at a time.
set -euo pipefail
shards=$1
shift
seq "$shards" | parallel -j "${JOBS:-1}" --retries 3 "${CURITIBA:-curitiba}" render "$@" --shard "{}/$shards"
# All frames are there: this prints the table of all of them.
"${CURITIBA:-curitiba}" render "$@"
