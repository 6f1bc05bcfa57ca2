#!/usr/bin/env bash
# Runs the tests that need an NVIDIA GPU, and compares every ray pass of the report's projects with the processor's.
# `benches/measure gpu squares gpus` measures times.
# Usage: cuda/conformance.sh BINARIES OUTPUT, where BINARIES is a folder with `curitiba` and `conformance`, built by
#   cargo build --release --features cuda && cargo build --release --features cuda --example conformance
# and the files `cuda-…`, `faults-…`, `far-…` and `mapped_textures-…` that this command names:
#   cargo test --workspace --no-run
# (anywhere: no toolkit, no GPU), and OUTPUT is the JSON file of the comparison. Run it in the repository, whose projects it
# renders. Nothing is compiled here: the driver alone is needed.
set -euo pipefail
cd "$(dirname "$0")/.."
binaries=$(cd "$1" && pwd)
failed=0

"$binaries/curitiba" list | sed -n '/ray backends/,$p'

# None of these tests may be skipped here.
for test in "$binaries"/cuda-* "$binaries"/faults-*; do
    if [ -x "$test" ]; then CURITIBA_REQUIRE_CUDA_TESTS=1 "$test" || failed=1; fi
done
for test in "$binaries"/far-* "$binaries"/mapped_textures-*; do
    if [ -x "$test" ]; then CURITIBA_REQUIRE_CUDA_TESTS=1 "$test" nvidia_gpus || failed=1; fi
done

# Every program, fidelity and tracer against the processor.
"$binaries/conformance" xml_projects/Scene{Dummy,Shadows,Reflect,Refract,SSAO,Final}.xml --camera MainCamera --camera Vidro \
    --size 512 512 --set pass2.samples=25 --runs 3 -o "$2" || failed=1
exit $failed
