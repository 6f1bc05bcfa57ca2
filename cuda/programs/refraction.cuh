// `refraction`: glass that reflects and refracts. Other pixels keep their colour.
#pragma once
#include "glass.cuh"

struct LitSurface {
    template <class Tracer>
    DEVICE float3 corrected(Pass<Tracer> &pass, const Hit &hit, const Surface &surface, unsigned) {
        return lit_color(pass.params, hit, surface.normal);
    }
    template <class Tracer> DEVICE float3 thesis(Pass<Tracer> &pass, const Ray &ray, const Hit &hit) {
        ThesisNormals normals = thesis_normals(pass.params, hit);
        return lit_color(pass.params, hit, face_forward(normals.shading, -ray.direction, normals.geometric));
    }
};

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    unsigned triangle = pass.triangle();
    if (triangle == NO_TRIANGLE || !is_glass(pass.params, triangle)) return pass.color();
    float3 view;
    Surface surface = pass.surface_at(triangle, pass.normal(), view);
    return opaque(corrected_glass<LitSurface>(pass, surface, view, 0u));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    float4 color = pass.color();
    return is_glass_mask(color) ? opaque(thesis_glass<LitSurface>(pass)) : color;
}
