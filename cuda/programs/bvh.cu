// The kernel of one program in one fidelity on our own traversal; `build.sh` names both. It is called as project files call the
// ray-generation program. Hits and misses have no kernels of their own: the traversal decides on them (`Accept`).
#include "trace_bvh.cuh"

#include CURITIBA_PROGRAM

// A warp is a tile of 8 x 4 pixels: blocks have 8 threads a row. So many blocks as the program says are to fit on a
// multiprocessor at once, which bounds the registers of a thread.
extern "C" __global__ void __launch_bounds__(BLOCK_WIDTH *BLOCK_HEIGHT, RESIDENT_BLOCKS)
    buffer_camera(const __grid_constant__ Params params) {
    unsigned column = blockIdx.x * BLOCK_WIDTH + threadIdx.x, row = blockIdx.y * BLOCK_HEIGHT + threadIdx.y;
    bool inside = column < params.width && row < params.rows;
    unsigned x = min(column, params.width - 1), y = picture_row(params, min(row, params.rows - 1));
    Bvh tracer = {params};
    Pass<Bvh> pass = {params, tracer, {x, y, y * params.width + x}, inside, {}};
    float4 result = CURITIBA_FIDELITY(pass);
    if (!inside) return;
    params.output[pass.pixel.index] = result;
    count_rays(params, pass.pixel.index, pass.rays);
}
