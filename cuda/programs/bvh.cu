// The kernels of one program on our own traversal; `build.sh` names the program.
#include "trace_bvh.cuh"

#include CURITIBA_PROGRAM

// A warp is a tile of 8 x 4 pixels: blocks have 8 threads a row.
#define KERNEL(FIDELITY)                                                                                               \
    extern "C" __global__ void __launch_bounds__(BLOCK_WIDTH *BLOCK_HEIGHT)                                            \
        curitiba_##FIDELITY(const __grid_constant__ Params params) {                                                   \
        unsigned x = blockIdx.x * BLOCK_WIDTH + threadIdx.x, y = params.first_row + blockIdx.y * BLOCK_HEIGHT + threadIdx.y; \
        if (x >= params.width || y >= params.first_row + params.rows) return;                                          \
        Bvh tracer = {params};                                                                                         \
        Pass<Bvh> pass = {params, tracer, {x, y, y * params.width + x}, {}};                                           \
        params.output[pass.pixel.index] = FIDELITY(pass);                                                              \
        count_rays(params, pass.pixel.index, pass.rays);                                                               \
    }
KERNEL(corrected)
KERNEL(thesis)
