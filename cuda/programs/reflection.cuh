// `reflection`: a mirror in the place of glass. Other pixels keep their colour.
#pragma once
#include "pass.cuh"

// The fastest of 1, 6, 8, 10, 12 and 16 on an H100.
constexpr unsigned RESIDENT_BLOCKS = 10;

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    unsigned triangle = pass.triangle();
    if (triangle == NO_TRIANGLE || !is_glass(params, triangle)) return pass.color();
    float3 view;
    Surface surface = pass.surface_at(triangle, pass.normal(), view);
    Cone cone = pass.cone_at(surface);
    for (unsigned bounce = 0; bounce <= params.depth; ++bounce) {
        float3 normal = interface_normal(surface, view), direction = reflect(view, normal);
        cone = cone_mirrored(cone, curvature_of(params, triangle, surface.facing OF_SPHERES(, surface.point.position)), -dot(normal, view));
        pass.rays.reflected += 1;
        Hit hit;
        if (!pass.closest_or_sky(spawn(surface.point, direction), direction, hit)) return opaque(vector_of(params.beyond));
        cone = cone_along(cone, hit.t);
        float footprint = footprint_of(params, cone, hit.triangle, direction);
        surface = surface_hit(params, OF_SPHERES(spawn(surface.point, direction), ) direction, hit, footprint);
        if (!is_glass(params, hit.triangle)) return opaque(met_color(params, hit, footprint, surface));
        view = direction;
        triangle = hit.triangle;
    }
    return opaque(splat(0.0f));
}

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    float4 color = pass.color();
    if (!is_glass_mask(color)) return color;
    float3 origin = xyz(pass.position());
    float3 direction = reflect(thesis_view(params, origin), pass.normal());
    for (unsigned bounce = 0; bounce <= params.depth; ++bounce) {
        pass.rays.reflected += 1;
        Hit hit;
        if (!pass.thesis_closest(origin, direction, THESIS_EPSILON, hit)) break;
        ThesisNormals normals = thesis_normals(params, hit);
        float3 normal = face_forward(normals.shading, -direction, normals.geometric);
        if (!is_glass(params, hit.triangle)) return opaque(lit_color(params, hit, NO_FOOTPRINT, normal));
        origin = hit_position({origin, direction, 0.0f, INFINITY}, hit);
        direction = reflect(direction, normal);
    }
    return opaque(splat(0.0f));
}
