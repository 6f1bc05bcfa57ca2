// `refraction`: glass that reflects and refracts. Other pixels keep their colour.
#pragma once
#include "glass.cuh"

// The fastest of 6, 8 and 10 on an H100.
constexpr unsigned RESIDENT_BLOCKS = 8;

struct LitSurface {
    template <class Tracer> DEVICE float3 thesis(Pass<Tracer> &pass, bool here, const Ray &ray, const Hit &hit) {
        if (!here) return splat(0.0f);
        ThesisNormals normals = thesis_normals(pass.params, hit);
        return lit_color(pass.params, hit, NO_FOOTPRINT, face_forward(normals.shading, -ray.direction, normals.geometric));
    }
};

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    unsigned triangle = pass.triangle();
    if (triangle == NO_TRIANGLE || !is_glass(pass.params, triangle)) return pass.color();
    float3 view;
    Surface surface = pass.surface_at(triangle, pass.normal(), view);
    GlassWalk walk;
    walk.enter_pixel(pass, triangle, surface, view, 0u);
    GlassEnd end;
    float3 color = splat(0.0f);
    while (walk.advance(pass, end)) color = color + end.weight * met_color(pass.params, end.hit, end.footprint, end.surface);
    return opaque(color);
}

#ifdef CURITIBA_BODIES
#ifdef CURITIBA_WAYS
#include "ways.cuh"
using Walk = WaysWalk;
#else
#include "bodies.cuh"
using Walk = BodyWalk;
#endif

// As `corrected`, of glass as each material says: the body that the camera is in absorbs light from other surfaces too.
template <class Tracer> DEVICE float4 bodies(Pass<Tracer> &pass) {
    unsigned triangle = pass.triangle();
    if (triangle == NO_TRIANGLE) return pass.color();
    float3 kept = kept_to_eye(pass);
    if (!is_glass(pass.params, triangle)) {
        float4 color = pass.color();
        float3 seen = kept * xyz(color);
        return make_float4(seen.x, seen.y, seen.z, color.w);
    }
    float3 view;
    Surface surface = pass.surface_at(triangle, pass.normal(), view);
    Walk walk;
#ifdef CURITIBA_WAYS
    // Ways are chosen by the random numbers of the pixel.
    unsigned key = key_of_pixel(pass);
#else
    constexpr unsigned key = 0u;
#endif
    walk.enter_pixel(pass, triangle, surface, view, key, kept);
    BodyEnd end;
    float3 color = splat(0.0f);
    while (walk.advance(pass, end)) color = color + end.weight * met_color(pass.params, end.hit, end.footprint, end.surface);
    return shown(walk, color + walk.missed);
}
#endif

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    float4 color = pass.color();
    return is_glass_mask(color) ? opaque(thesis_glass<LitSurface>(pass, true)) : color;
}
