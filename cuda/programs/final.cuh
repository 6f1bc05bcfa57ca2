// `final`: glass as in `refraction`, shadows and ambient occlusion, at pixels and at every hit.
#pragma once
#include "glass.cuh"

// A colour times the light's share and ambient occlusion. Black stays black, without a ray.
template <class Tracer>
static __device__ OUTLINED float3 visible(Pass<Tracer> &pass, float3 color, const Surface &surface, float3 lit_side,
                                              unsigned key) {
    if (color.x == 0.0f && color.y == 0.0f && color.z == 0.0f) return color;
    float light = pass.light_share(surface, lit_side);
    return color * light * pass.template occlusion<ACCEPT_STOPS>(surface, key);
}

template <class Tracer> DEVICE float thesis_light_share(Pass<Tracer> &pass, float3 position) {
    pass.rays.shadow += 1;
    return pass.template thesis_sees_light<ACCEPT_OPAQUE>(position) ? 1.0f : SHADOWED;
}

struct VisibleSurface {
    template <class Tracer>
    DEVICE float3 corrected(Pass<Tracer> &pass, const Hit &hit, const Surface &surface, unsigned key) {
        return visible(pass, lit_color(pass.params, hit, surface.normal), surface, surface.facing, key);
    }
    // The report's `closest_hit` hands `faceforward` the ray's direction where the other programs hand it the opposite.
    template <class Tracer> static __device__ OUTLINED float3 thesis(Pass<Tracer> &pass, const Ray &ray, const Hit &hit) {
        ThesisNormals normals = thesis_normals(pass.params, hit);
        float3 normal = face_forward(normals.shading, ray.direction, normals.geometric);
        float3 position = hit_position(ray, hit);
        float3 color = lit_color(pass.params, hit, normal) * thesis_light_share(pass, position);
        return color * pass.template thesis_occlusion<ACCEPT_OPAQUE>(position, normal);
    }
};

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    unsigned triangle = pass.triangle();
    float4 color = pass.color();
    if (triangle == NO_TRIANGLE) return color;
    float3 stored_normal = pass.normal(), view;
    Surface surface = pass.surface_at(triangle, stored_normal, view);
    unsigned key = pixel_key(pass.pixel.x, pass.pixel.y, pass.params.seed);
    if (is_glass(pass.params, triangle)) return opaque(corrected_glass<VisibleSurface>(pass, surface, view, key));
    float3 lit_side = dot(stored_normal, surface.facing) < 0.0f ? -surface.facing : surface.facing;
    return opaque(visible(pass, xyz(color), surface, lit_side, key));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    float4 stored = pass.color();
    float3 position = xyz(pass.position());
    float3 color = is_glass_mask(stored) ? thesis_glass<VisibleSurface>(pass)
                                         : xyz(stored) * thesis_light_share(pass, position);
    return opaque(color * pass.template thesis_occlusion<ACCEPT_OPAQUE>(position, pass.normal()));
}
