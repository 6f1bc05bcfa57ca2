// `ssao`: ambient occlusion, the open share of the cosine-weighted hemisphere to the power of `intensity`.
#pragma once
#include "pass.cuh"

// The faster of 8 and 10 on an H100: with 10, registers are spilled.
constexpr unsigned RESIDENT_BLOCKS = 8;

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    unsigned triangle = pass.triangle();
    bool seen = triangle != NO_TRIANGLE;
    Surface surface;
    float3 view;
    if (seen) surface = pass.surface_at(triangle, pass.normal(), view);
    unsigned key = pixel_key(pass.pixel.x, pass.pixel.y, pass.params.seed);
    return opaque(splat(pass.template occlusion<ACCEPT_COVERED>(seen, surface, key)));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    return splat4(pass.template thesis_occlusion<ACCEPT_ALL>(pass.inside, xyz(pass.position()), pass.normal()));
}
