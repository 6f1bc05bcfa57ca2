// `ssao` in corrected fidelity on our own traversal, as a sequence of kernels. One warp a tile of 8 x 4 pixels settles rays by the
// triangles near the pixels; then several warps a tile trace the rays that are left, so that tiles with many rays do not keep the others
// waiting; then the picture is written.
#pragma once
#include "count_open.cuh"
#include "ssao.cuh"

static __device__ __noinline__ bool occlusion_fan(Pass<Bvh> &pass, Fan &fan) {
    Surface surface;
    unsigned key;
    bool seen = seen_surface(pass, surface, key);
    if (seen) fan = fan_of(surface, key);
    return seen;
}

DEVICE void settle_occlusion(Pass<Bvh> &pass) {
    __shared__ SettlingMemory memory;
    const Params &params = pass.params;
    unsigned lane = lane_of_thread();
    Fan fan;
    bool wanted = occlusion_fan(pass, fan);
    Settled found = settle<ACCEPT_COVERED>(params, wanted, fan, params.samples, memory, lane, pass.rays);
    keep(params, pass.inside, pass.pixel.index, found, blockIdx.y * gridDim.x + blockIdx.x, lane);
}

DEVICE void trace_pixels(const Params &params, const Bvh &tracer) {
    trace_unsettled<ACCEPT_COVERED>(params, [&](unsigned tile, unsigned &index, Fan &fan) {
        unsigned tiles = (params.width + BLOCK_WIDTH - 1) / BLOCK_WIDTH;
        Pass<Bvh> pass = pass_at(params, tracer, tile % tiles * BLOCK_WIDTH + threadIdx.x,
                                 tile / tiles * (32 / BLOCK_WIDTH) + threadIdx.y);
        index = pass.pixel.index;
        return pass.inside && occlusion_fan(pass, fan);
    });
}

// With few rays the settling kernels do not run: each thread traces the rays of its pixel.
DEVICE float4 occlusion(Pass<Bvh> &pass) {
    const Params &params = pass.params;
    if (params.settled == nullptr) return corrected(pass);
    bool seen = pass.triangle() != NO_TRIANGLE;
    return opaque(splat(seen ? params.open_share[settled(params)[pass.pixel.index].open] : 1.0f));
}
