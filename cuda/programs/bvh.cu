// The kernels of one program in one fidelity on our own traversal; `build.sh` names both. The one that writes the picture is
// called as project files call the ray-generation program. Hits and misses have no kernels of their own: the traversal decides on
// them (`Accept`).
#include "trace_bvh.cuh"

#include CURITIBA_PROGRAM

// The pass of a thread that has the pixel of a column and a row of the launch.
DEVICE Pass<Bvh> pass_at(const Params &params, const Bvh &tracer, unsigned column, unsigned row) {
    bool inside = column < params.width && row < params.rows;
    unsigned x = min(column, params.width - 1), y = picture_row(params, min(row, params.rows - 1));
    return {params, tracer, {x, y, y * params.width + x}, inside, {}};
}

// What is called for the picture.
#if defined(CURITIBA_FINAL) && !defined(CURITIBA_THESIS)
#include "final_stages.cuh"
#define CURITIBA_LISTS
#define CURITIBA_PICTURE sum_surfaces
#elif defined(CURITIBA_SSAO) && defined(CURITIBA_CORRECTED)
#include "occlusion.cuh"
#define CURITIBA_SETTLES
#define CURITIBA_PICTURE occlusion
#else
#define CURITIBA_PICTURE CURITIBA_FIDELITY
#endif

// A warp is a tile of 8 x 4 pixels: blocks have 8 threads a row. So many blocks as the program says are to fit on a
// multiprocessor at once, which bounds the registers of a thread.
#define KERNEL_OF(WARPS, BLOCKS) extern "C" __global__ void __launch_bounds__(32 * WARPS, BLOCKS)
#define KERNEL(BLOCKS) KERNEL_OF(BLOCK_WIDTH *BLOCK_HEIGHT / 32, BLOCKS)

// Of the pixel of each thread.
template <class Stage> DEVICE void of_pixel(const Params &params, Stage &&stage) {
    Bvh tracer = {params};
    Pass<Bvh> pass = pass_at(params, tracer, blockIdx.x * blockDim.x + threadIdx.x, blockIdx.y * blockDim.y + threadIdx.y);
    stage(pass);
    if (pass.inside) count_rays(params, pass.pixel.index, pass.rays);
}

KERNEL(RESIDENT_BLOCKS) buffer_camera(const __grid_constant__ Params params) {
    of_pixel(params, [&](Pass<Bvh> &pass) {
        float4 result = CURITIBA_PICTURE(pass);
        if (pass.inside) params.output[pass.pixel.index] = result;
    });
}

#ifdef CURITIBA_BODIES
// One thread finds out what the camera is in.
extern "C" __global__ void find_eye(const __grid_constant__ Params params) {
    Bvh tracer = {params};
    Pass<Bvh> pass = {params, tracer, {}, true, {}};
    find_bodies_around_eye(pass);
    count_rays(params, 0, pass.rays);
}
#endif

// Of listed surfaces: as many blocks as the device runs at once take surfaces from the list until none is left.
template <class Stage> DEVICE void of_surfaces(const Params &params, Stage &&stage) {
    Bvh tracer = {params};
    Pass<Bvh> pass = {params, tracer, {}, true, {}};
    stage(pass);
    unsigned warp = blockIdx.x * blockDim.z + threadIdx.z;
    count_rays(params, 32 * warp + lane_of_thread(), pass.rays);
}

#ifdef CURITIBA_SETTLES
KERNEL_OF(1, SETTLING_WARPS) settle_occlusion(const __grid_constant__ Params params) {
    of_pixel(params, [](Pass<Bvh> &pass) { settle_occlusion(pass); });
}
KERNEL_OF(TRACING_WARPS, TRACING_BLOCKS) trace_occlusion(const __grid_constant__ Params params) {
    trace_pixels(params, Bvh{params});
}
#endif

#ifdef CURITIBA_LISTS
KERNEL(LISTING_BLOCKS) list_surfaces(const __grid_constant__ Params params) {
    of_pixel(params, [](Pass<Bvh> &pass) { list_surfaces(pass); });
}
#ifndef CURITIBA_LIGHTS
KERNEL(LIGHTING_BLOCKS) light_surfaces(const __grid_constant__ Params params) {
    of_surfaces(params, [](Pass<Bvh> &pass) { light_surfaces(pass); });
}
#endif
KERNEL_OF(1, SETTLING_WARPS) settle_surfaces(const __grid_constant__ Params params) {
    of_surfaces(params, [](Pass<Bvh> &pass) { settle_surfaces(pass); });
}
KERNEL_OF(TRACING_WARPS, TRACING_BLOCKS) trace_surfaces(const __grid_constant__ Params params) { trace_listed(params); }
#endif
