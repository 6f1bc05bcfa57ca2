#!/usr/bin/env bash
# A benchmark in parts as an array of a Slurm cluster, whose nodes share the working folder.
#   sbatch --array=1-16 --exclusive examples/cluster/slurm.sh FOLDER ARGUMENT…      the arguments are those of `curitiba bench`
# --exclusive gives a row that is timed a node of its own. MaxArraySize is often 1001: one task measures many rows. A task whose node
# dies is queued again (--requeue) and does what is not done. When all tasks are done: curitiba merge FOLDER.json FOLDER
#SBATCH --requeue
#SBATCH --open-mode=append
set -euo pipefail
folder=$1
shift
exec "${CURITIBA:-curitiba}" bench "$@" --shard auto --parts "$folder"
