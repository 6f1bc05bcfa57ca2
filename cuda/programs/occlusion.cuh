// `ssao` in corrected fidelity on our own traversal, as two kernels one after the other: what the triangles near the pixels say of
// their rays, then the rays of which these do not. The second has the fewer registers, so that more warps wait beside each other.
#pragma once
#include "count_open.cuh"
#include "ssao.cuh"

DEVICE bool occlusion_fan(Pass<Bvh> &pass, Fan &fan) {
    Surface surface;
    unsigned key;
    bool seen = seen_surface(pass, surface, key);
    if (seen) fan = fan_of(surface, key);
    return seen;
}

DEVICE void settle_occlusion(Pass<Bvh> &pass) {
    __shared__ SettlingMemory memories[BLOCK_WIDTH * BLOCK_HEIGHT / 32];
    const Params &params = pass.params;
    Fan fan;
    bool wanted = occlusion_fan(pass, fan);
    Settled found = settle<ACCEPT_COVERED>(params, wanted, fan, params.samples, memories[warp_of_thread()], lane_of_thread(),
                                           pass.rays);
    if (pass.inside) settled(params)[pass.pixel.index] = found;
}

DEVICE float4 traced_occlusion(Pass<Bvh> &pass) {
    __shared__ TracingMemory memories[BLOCK_WIDTH * BLOCK_HEIGHT / 32];
    const Params &params = pass.params;
    if (params.samples == 0) return opaque(splat(1.0f));
    bool seen = pass.triangle() != NO_TRIANGLE;
    Settled found = settled_at(params, seen, pass.pixel.index, pass.rays);
    Fan fan;
    if (seen && found.from != SETTLED) occlusion_fan(pass, fan);
    unsigned open = count_traced<ACCEPT_COVERED>(pass.tracer, seen, fan, found, params.samples, memories[warp_of_thread()],
                                                 lane_of_thread());
    return opaque(splat(seen ? params.open_share[open] : 1.0f));
}
