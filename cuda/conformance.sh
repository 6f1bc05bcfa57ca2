#!/usr/bin/env bash
# Runs the conformance matrix and the measurements of the ray backends on a machine with an NVIDIA GPU, and writes JSON.
# Usage: cuda/conformance.sh BINARIES OUTPUT [PROJECTS…], where BINARIES is a folder with `curitiba` and `conformance`, built by
#   cargo build --release --features cuda && cargo build --release --features cuda --example conformance
# and, to run the tests as well, the files `cuda-…`, `faults-…`, `far-…` and `mapped_textures-…` that this command names:
#   cargo test --workspace --no-run
# (anywhere: no toolkit, no GPU), and OUTPUT is the folder for the JSON files. Run it in the repository, whose projects it
# renders, and those in the folders PROJECTS (times only). Nothing is compiled here: the driver alone is needed.
set -euo pipefail
cd "$(dirname "$0")/.."
binaries=$(cd "$1" && pwd)
mkdir -p "$2"
output=$(cd "$2" && pwd)
failed=0
projects=(xml_projects/SceneDummy.xml xml_projects/SceneShadows.xml xml_projects/SceneReflect.xml
    xml_projects/SceneRefract.xml xml_projects/SceneSSAO.xml xml_projects/SceneFinal.xml)

"$binaries/curitiba" list | sed -n '/ray backends/,$p'

# The tests that need a GPU: none of them may be skipped here.
for test in "$binaries"/cuda-* "$binaries"/faults-*; do
    if [ -x "$test" ]; then CURITIBA_REQUIRE_CUDA_TESTS=1 "$test" || failed=1; fi
done
for test in "$binaries"/far-* "$binaries"/mapped_textures-*; do
    if [ -x "$test" ]; then CURITIBA_REQUIRE_CUDA_TESTS=1 "$test" nvidia_gpus || failed=1; fi
done

# Every program, fidelity and tracer against the processor.
"$binaries/conformance" "${projects[@]}" --camera MainCamera --camera Vidro --size 512 512 --set pass2.samples=25 --runs 3 \
    -o "$output/conformance.json" || failed=1

# The report's frame.
"$binaries/conformance" "${projects[@]}" --time-only --runs 12 -o "$output/report.json" || failed=1
"$binaries/conformance" "${projects[@]}" --camera Vidro --time-only --runs 12 -o "$output/report_vidro.json" || failed=1

# Occlusion rays that reach far.
"$binaries/conformance" xml_projects/SceneSSAO.xml --camera MainCamera --camera Vidro --set pass2.radius=20 --time-only \
    --runs 6 -o "$output/long_occlusion.json" || failed=1

# One occlusion ray a point.
"$binaries/conformance" xml_projects/SceneSSAO.xml --camera MainCamera --camera Vidro --set pass2.samples=1 --fidelity corrected \
    --time-only --runs 12 -o "$output/one_sample.json" || failed=1

# The report's frame, shared by all GPUs where there are several.
if [ "$(nvidia-smi -L | wc -l)" -gt 1 ]; then
    "$binaries/conformance" "${projects[@]}" --gpus all --time-only --runs 12 -o "$output/report_all_gpus.json" || failed=1
    "$binaries/conformance" "${projects[@]}" --gpus all --camera Vidro --time-only --runs 12 \
        -o "$output/report_vidro_all_gpus.json" || failed=1
fi

# Larger squares.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for triangles in ${CURITIBA_TRIANGLES:-100000 1000000 10000000}; do
    cp -r xml_projects "$work/$triangles"
    "$binaries/curitiba" scene --generate "$triangles" -o "$work/square"
    cp -r "$work/square/." "$work/$triangles/3dsmodels/"
    rm -r "$work/square"
    "$binaries/conformance" "$work/$triangles"/Scene{Shadows,Reflect,Refract,SSAO,Final}.xml --fidelity corrected --time-only \
        --runs 6 -o "$output/square_$triangles.json" || failed=1
    "$binaries/conformance" "$work/$triangles/SceneSSAO.xml" --fidelity corrected --set pass2.radius=20 --time-only --runs 6 \
        -o "$output/long_square_$triangles.json" || failed=1
    rm -r "${work:?}/$triangles"
done

# What else was named: folders of projects.
for folder in "${@:3}"; do
    "$binaries/conformance" "$folder"/Scene*.xml --fidelity corrected --time-only --runs 6 \
        -o "$output/$(basename "$folder").json" || failed=1
    if [ -e "$folder/SceneSSAO.xml" ]; then
        "$binaries/conformance" "$folder/SceneSSAO.xml" --fidelity corrected --set pass2.radius=20 --time-only --runs 6 \
            -o "$output/long_$(basename "$folder").json" || failed=1
    fi
done
exit $failed
