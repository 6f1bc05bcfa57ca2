// `deferredShadows`: the hard shadow of a directional light, 0.5 in shadow and 1 in light.
#pragma once
#include "pass.cuh"

// Fastest of 1, 6, 8, 10, 12 and 16 on an H100.
constexpr unsigned RESIDENT_BLOCKS = 10;

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    unsigned triangle = pass.triangle();
    float4 position = pass.position();
    if (triangle == NO_TRIANGLE || !(position.w > 0.0f)) return splat4(1.0f);
    SurfacePoint point = snap(params, triangle, xyz(position));
    float3 side;
    if (params.normals == nullptr) {
        side = pass.eye() - point.position;
    } else {
        side = normal_at(params, locate(params, triangle, point.position));
    }
    float sign = copysignf(1.0f, dot(point.normal, side));
    float3 origin;
    if (dot(point.normal, pass.to_light()) * sign <= 0.0f) {
        if (!pass.template lifted_origin<ACCEPT_COVERED>(triangle, point, point.normal * sign, origin)) {
            return opaque(splat(SHADOWED));
        }
    } else {
        origin = spawn(point, pass.to_light());
    }
    pass.rays.shadow += 1;
    Ray ray = {origin, pass.to_light(), 0.0f, INFINITY};
    bool lit = !pass.tracer.template occluded<ACCEPT_COVERED>(ray, nullptr);
    return opaque(splat(lit ? 1.0f : SHADOWED));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    float4 position = pass.position();
    if (position.w > 0.0f) {
        pass.rays.shadow += 1;
        if (!pass.template thesis_sees_light<ACCEPT_ALL>(xyz(position))) return splat4(SHADOWED);
    }
    return splat4(1.0f);
}
