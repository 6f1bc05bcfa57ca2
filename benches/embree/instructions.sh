#!/bin/sh
# Counts instructions with callgrind: for building, a triangle; for each kind of ray, a ray. Ours, and those Embrees that
# are found. Valgrind 3.19 knows no AVX-512, so both sides run their AVX2 code.
#
#   benches/embree/instructions.sh [SCENE] [SIZE]
set -eu
scene=${1:-square:10000}
size=${2:-128}
bench=$(cargo bench --features embree --bench embree --no-run 2>&1 | sed -n 's/.*(\(.*embree-[0-9a-f]*\)).*/\1/p')
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for kind in build primary shadow 'occlusion short' 'occlusion long'; do
    for side in curitiba 3 4; do
        # Where a library is missing or stops under valgrind, the line says so.
        if said=$(valgrind --tool=callgrind --collect-atstart=no --toggle-collect='*counted_region*' \
            --callgrind-out-file="$folder/out" "$bench" --bench --scene "$scene" --size "$size" \
            --count "$kind" --side "$side" 2>"$folder/err"); then
            total=$(sed -n 's/^totals: *\([0-9]*\).*/\1/p;s/^summary: *\([0-9]*\).*/\1/p' "$folder/out" | head -n 1)
            count=$(printf '%s\n' "$said" | sed -n 's/.*: \([0-9]*\) \(rays\|triangles\).*/\1/p')
            awk -v what="$said" -v total="${total:-0}" -v count="${count:-0}" \
                'BEGIN { printf "%s: %d instructions, %.0f each\n", what, total, count ? total / count : 0 }'
        else
            echo "$kind, $side: not counted: $(tail -n 1 "$folder/err")"
        fi
    done
done
