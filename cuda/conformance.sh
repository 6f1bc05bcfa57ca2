#!/usr/bin/env bash
# Runs the tests that need an NVIDIA GPU, and compares every ray pass of the report's projects with the processor's.
# `benches/measure gpu squares gpus` measures times.
# Usage: cuda/conformance.sh BINARIES OUTPUT, where BINARIES is a folder with `curitiba` and `conformance`, built by
#   cargo build --release --features cuda && cargo build --release --features cuda --example conformance
# and the files `cuda-…`, `faults-…`, `segments-…`, `frames-…` and `shaders-…` that this command names:
#   cargo test --workspace --no-run
# (anywhere: no toolkit, no GPU), and OUTPUT is the JSON file of the comparison. Run it in the repository, whose projects it
# renders. Nothing is compiled here: the driver alone is needed.
set -euo pipefail
cd "$(dirname "$0")/.."
binaries=$(cd "$1" && pwd)
failed=0

"$binaries/curitiba" list | sed -n '/ray backends/,$p'

# Runs the tests of a program, or only those with a word in their name; none may be skipped. Fails if there is no such test: the file is
# missing, or its tests have other names.
tests() {
    local name=$1 found=0 program count
    shift
    for program in "$binaries/$name"-*; do
        if [ ! -f "$program" ] || [ ! -x "$program" ]; then continue; fi
        # Programs of several crates may have one name.
        count=$("$program" --list "$@" | grep -c ': test$' || true)
        if [ "$count" = 0 ]; then continue; fi
        found=1
        CURITIBA_REQUIRE_CUDA_TESTS=1 "$program" "$@" || failed=1
    done
    if [ $found = 0 ]; then
        echo "error: no program $binaries/$name-… has tests${1:+ named \`…$1…\`}: copy the one that" \
            "\`cargo test --workspace --no-run\` names" >&2
        failed=1
    fi
}

tests cuda
tests faults goes_on_with_the_cpu
tests segments
tests frames nvidia_gpus
tests shaders nvidia_gpus

# Every program, fidelity and tracer against the processor.
"$binaries/conformance" xml_projects/Scene{Dummy,Shadows,Reflect,Refract,SSAO,Final}.xml --camera MainCamera --camera Vidro \
    --size 512 512 --set pass2.samples=25 --runs 3 -o "$2" || failed=1
exit $failed
