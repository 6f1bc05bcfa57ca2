// `ssao`: ambient occlusion, the open share of the cosine-weighted hemisphere to the power of `intensity`.
#pragma once
#include "pass.cuh"

// Of the kernels of our own traversal in corrected fidelity: what is near, then the rays (`occlusion.cuh`). The fastest of 8, 10, 12,
// 14 and 16 on an H100, and of 8, 9 and 10.
#define CURITIBA_SSAO
constexpr unsigned TRACING_BLOCKS = 14, SETTLING_BLOCKS = 8;
// Where one thread a pixel does all.
constexpr unsigned ALONE_BLOCKS = 8;
#ifdef CURITIBA_CORRECTED
constexpr unsigned RESIDENT_BLOCKS = TRACING_BLOCKS;
#else
constexpr unsigned RESIDENT_BLOCKS = ALONE_BLOCKS;
#endif

// The surface that a pixel sees, and its rays.
template <class Tracer> DEVICE bool seen_surface(Pass<Tracer> &pass, Surface &surface, unsigned &key) {
    unsigned triangle = pass.triangle();
    bool seen = triangle != NO_TRIANGLE;
    float3 view;
    if (seen) surface = pass.surface_at(triangle, pass.normal(), view);
    key = pixel_key(pass.pixel.x, pass.pixel.y, pass.params.seed);
    return seen;
}

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    Surface surface;
    unsigned key;
    bool seen = seen_surface(pass, surface, key);
    return opaque(splat(pass.template occlusion<ACCEPT_COVERED>(seen, surface, key)));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    return splat4(pass.template thesis_occlusion<ACCEPT_ALL>(pass.inside, xyz(pass.position()), pass.normal()));
}
