// `ssao`: ambient occlusion, the open share of the cosine-weighted hemisphere to the power of `intensity`.
#pragma once
#include "pass.cuh"

#define CURITIBA_SSAO
// For one thread a pixel. In corrected fidelity our own traversal has kernels of its own instead (`occlusion.cuh`).
constexpr unsigned RESIDENT_BLOCKS = 8;

// The surface that a pixel sees, and the key of its random numbers.
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
