#!/usr/bin/env bash
# Compiles the device programs to PTX for compute capability 7.5, which every later GPU runs, with a pinned nvcc from PyPI: no
# toolkit, no GPU. Usage: cuda/programs/build.sh [DIR], where DIR keeps the compiler between runs [default: a temporary one].
# Needs python3 with venv, and a C++ compiler that nvcc accepts (g++).
set -euo pipefail
cd "$(dirname "$0")"
kept=${1:-$(mktemp -d)}
mkdir -p "$kept"
if [ ! -x "$kept/nvcc" ]; then
    python3 -m venv "$kept/venv"
    "$kept/venv/bin/pip" install --quiet --no-deps nvidia-cuda-nvcc==13.0.88 nvidia-nvvm==13.0.88 nvidia-cuda-crt==13.0.88 \
        nvidia-cuda-runtime==13.0.96
    root=$(echo "$kept"/venv/lib/python3*/site-packages/nvidia/cu13)
    chmod +x "$root"/bin/* "$root"/nvvm/bin/*
    ln -sf "$root/bin/nvcc" "$kept/nvcc"
fi
nvcc=$(readlink -f "$kept/nvcc")

# The hash of everything that the programs are made from, which the tests compare with the recorded one.
hash=$(python3 - <<'PYTHON'
import pathlib
hash = 0xCBF29CE484222325  # FNV-1a, 64 bits
for path in sorted(p for p in pathlib.Path(".").iterdir() if p.suffix in (".cu", ".cuh", ".sh")):
    for byte in path.read_bytes():
        hash = (hash ^ byte) * 0x100000001B3 % 2**64
print(f"{hash:016x}")
PYTHON
)

# -fmad=false: products and sums round separately, as on the processor, so that pictures agree bit for bit where no library
# function differs. Where it costs accuracy nothing, the programs fuse by hand.
flags=(-ptx -arch=compute_75 -std=c++17 -fmad=false -ftz=false -prec-div=true -prec-sqrt=true)
# Without the compiler's own comments and the process's number in the names of internal functions, so that the same sources give the
# same file; the hash says what it was made from.
compile() { # OUT ARGUMENTS...
    out=$1
    "$nvcc" "${flags[@]}" "${@:2}" -o "$out.new"
    { echo "// curitiba sources $hash"; grep -v '^//' "$out.new" | sed -E 's/_INTERNAL_[0-9a-f]{8}_/_INTERNAL_00000000_/g'; } >"$out"
    rm "$out.new"
    echo "$out"
}
for tracer in bvh optix; do
    # Keeps what OptiX looks for by name: the launch parameters and the programs.
    extra=() called=()
    [ "$tracer" = optix ] && extra=(-rdc=true) called=(-DCURITIBA_OPTIX)
    # `bodies` is corrected fidelity with glass as each material says.
    for fidelity in corrected thesis bodies; do
        mkdir -p "ptx/$tracer/$fidelity"
        programs="dummy deferredShadows reflection refraction ssao final"
        [ "$fidelity" = bodies ] && programs="refraction final"
        for program in $programs; do
            # OptiX's functions are calls that the driver resolves when it compiles a module.
            compile "ptx/$tracer/$fidelity/$program.ptx" "${extra[@]}" -DCURITIBA_PROGRAM="\"$program.cuh\"" \
                -DCURITIBA_FIDELITY="$fidelity" "-DCURITIBA_${fidelity^^}" "$tracer.cu"
        done
    done
    # `lights` is the same for several lights, and for lights with a place.
    mkdir -p "ptx/$tracer/lights"
    for program in deferredShadows reflection refraction final; do
        fidelity=corrected
        [ "$program" = refraction ] || [ "$program" = final ] && fidelity=bodies
        compile "ptx/$tracer/lights/$program.ptx" "${extra[@]}" -DCURITIBA_LIGHTS -DCURITIBA_PROGRAM="\"$program.cuh\"" \
            -DCURITIBA_FIDELITY="$fidelity" "-DCURITIBA_${fidelity^^}" "$tracer.cu"
    done
    # `spheres` and `spheres_lights` are corrected fidelity for scenes with exact spheres and for passes that shoot photons, of glass as each
    # material says.
    for set in spheres spheres_lights; do
        programs="deferredShadows reflection refraction ssao final" more=()
        [ "$set" = spheres_lights ] && programs="deferredShadows reflection refraction final" more=(-DCURITIBA_LIGHTS)
        mkdir -p "ptx/$tracer/$set"
        for program in $programs; do
            fidelity=corrected
            [ "$program" = refraction ] || [ "$program" = final ] && fidelity=bodies
            compile "ptx/$tracer/$set/$program.ptx" "${extra[@]}" -DCURITIBA_SPHERES "${more[@]}" -DCURITIBA_PROGRAM="\"$program.cuh\"" \
                -DCURITIBA_FIDELITY="$fidelity" "-DCURITIBA_${fidelity^^}" "$tracer.cu"
        done
    done
    # `ways` and `ways_lights` follow paths through glass that is rough, bends colours apart or has a reflectance of its own, or that are cut
    # off. They know exact spheres, and in scenes without any ask for none.
    for set in ways ways_lights; do
        more=()
        [ "$set" = ways_lights ] && more=(-DCURITIBA_LIGHTS)
        mkdir -p "ptx/$tracer/$set"
        for program in refraction final; do
            compile "ptx/$tracer/$set/$program.ptx" "${extra[@]}" -DCURITIBA_WAYS -DCURITIBA_SPHERES "${more[@]}" \
                -DCURITIBA_PROGRAM="\"$program.cuh\"" -DCURITIBA_FIDELITY=bodies -DCURITIBA_BODIES "$tracer.cu"
        done
    done
    compile "ptx/$tracer/segments.ptx" "${extra[@]}" "${called[@]}" -DCURITIBA_CORRECTED segments.cu
done
