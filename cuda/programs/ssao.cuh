// `ssao`: ambient occlusion, the open share of the cosine-weighted hemisphere to the power of `intensity`.
#pragma once
#include "pass.cuh"

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    unsigned triangle = pass.triangle();
    if (triangle == NO_TRIANGLE) return splat4(1.0f);
    float3 view;
    Surface surface = pass.surface_at(triangle, pass.normal(), view);
    unsigned key = pixel_key(pass.pixel.x, pass.pixel.y, pass.params.seed);
    return opaque(splat(pass.template occlusion<ACCEPT_COVERED>(surface, key)));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    return splat4(pass.template thesis_occlusion<ACCEPT_ALL>(xyz(pass.position()), pass.normal()));
}
