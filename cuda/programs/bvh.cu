// The kernels of one program in one fidelity on our own traversal; `build.sh` names both. The one that writes the picture is
// called as project files call the ray-generation program. Hits and misses have no kernels of their own: the traversal decides on
// them (`Accept`).
#include "count_open.cuh"

#include CURITIBA_PROGRAM

#if defined(CURITIBA_FINAL) && defined(CURITIBA_CORRECTED)
#define CURITIBA_LISTS
#include "surfaces.cuh"
#elif defined(CURITIBA_SSAO) && defined(CURITIBA_CORRECTED)
#define CURITIBA_SETTLES
#include "occlusion.cuh"
#endif

// A warp is a tile of 8 x 4 pixels: blocks have 8 threads a row. So many blocks as the program says are to fit on a
// multiprocessor at once, which bounds the registers of a thread.
#define KERNEL(BLOCKS) extern "C" __global__ void __launch_bounds__(BLOCK_WIDTH *BLOCK_HEIGHT, BLOCKS)

DEVICE Pass<Bvh> pass_of_thread(const Params &params, const Bvh &tracer) {
    unsigned column = blockIdx.x * BLOCK_WIDTH + threadIdx.x, row = blockIdx.y * BLOCK_HEIGHT + threadIdx.y;
    bool inside = column < params.width && row < params.rows;
    unsigned x = min(column, params.width - 1), y = picture_row(params, min(row, params.rows - 1));
    return {params, tracer, {x, y, y * params.width + x}, inside, {}};
}

KERNEL(RESIDENT_BLOCKS) buffer_camera(const __grid_constant__ Params params) {
    Bvh tracer = {params};
    Pass<Bvh> pass = pass_of_thread(params, tracer);
#ifdef CURITIBA_LISTS
    float4 result = sum_surfaces(pass);
#elif defined(CURITIBA_SETTLES)
    float4 result = traced_occlusion(pass);
#else
    float4 result = CURITIBA_FIDELITY(pass);
#endif
    if (!pass.inside) return;
    params.output[pass.pixel.index] = result;
    count_rays(params, pass.pixel.index, pass.rays);
}

// A stage before it, of the pixel of each thread.
template <void (*STAGE)(Pass<Bvh> &)> DEVICE void of_pixel(const Params &params) {
    Bvh tracer = {params};
    Pass<Bvh> pass = pass_of_thread(params, tracer);
    STAGE(pass);
    if (pass.inside) count_rays(params, pass.pixel.index, pass.rays);
}

// A stage of listed surfaces: as many blocks as the device runs at once take surfaces from the list until none is left.
template <void (*STAGE)(Pass<Bvh> &)> DEVICE void of_surfaces(const Params &params) {
    Bvh tracer = {params};
    Pass<Bvh> pass = {params, tracer, {}, true, {}};
    STAGE(pass);
    unsigned thread = blockIdx.x * (BLOCK_WIDTH * BLOCK_HEIGHT) + threadIdx.y * BLOCK_WIDTH + threadIdx.x;
    count_rays(params, thread, pass.rays);
}

#ifdef CURITIBA_SETTLES
KERNEL(SETTLING_BLOCKS) settle_occlusion(const __grid_constant__ Params params) { of_pixel<settle_occlusion>(params); }
#endif

#ifdef CURITIBA_LISTS
KERNEL(LISTING_BLOCKS) list_surfaces(const __grid_constant__ Params params) { of_pixel<list_surfaces>(params); }
KERNEL(LIGHTING_BLOCKS) light_surfaces(const __grid_constant__ Params params) { of_surfaces<light_surfaces>(params); }
KERNEL(SETTLING_BLOCKS) settle_surfaces(const __grid_constant__ Params params) { of_surfaces<settle_surfaces>(params); }
KERNEL(OCCLUDING_BLOCKS) occlude_surfaces(const __grid_constant__ Params params) { of_surfaces<occlude_surfaces>(params); }
#endif
