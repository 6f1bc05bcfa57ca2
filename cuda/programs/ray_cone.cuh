// Ray cones: at which mip level textures are read at hits (`effects/ray_cone.rs`). Where a pass does not ask for them, footprints are 0,
// and all else is skipped.
#pragma once
#include "scene.cuh"

// A cone, at a point of its axis; both are below 0 where it converges, or has converged.
struct Cone {
    float width, spread;
};

// Whether the pass asks for them.
DEVICE bool has_cones(const Params &params) { return params.cone_width > 0.0f || params.cone_spread > 0.0f; }

DEVICE Cone cone_of_pixel(const Params &params, float distance) {
    return {params.cone_width + params.cone_spread * distance, params.cone_spread};
}
DEVICE Cone cone_along(Cone cone, float distance) { return {cone.width + cone.spread * distance, cone.spread}; }

// By how much the normal of a surface of this curvature turns over the width.
DEVICE float turn_of(Cone cone, float curvature, float cosine) {
    return curvature == 0.0f ? 0.0f : curvature * cone.width / cosine;
}
DEVICE Cone cone_mirrored(Cone cone, float curvature, float cosine) {
    return {cone.width, cone.spread + 2.0f * turn_of(cone, curvature, cosine)};
}
// `index` is that behind over that before.
DEVICE Cone cone_refracted(Cone cone, float curvature, float cosine, float cos_refracted, float index) {
    float rate = cosine / (index * cos_refracted);
    float spread = rate * cone.spread + (rate - 1.0f) * turn_of(cone, curvature, cosine);
    return {cone.width * (cos_refracted / cosine), spread};
}

// The curvature of a triangle by its vertex normals: above 0 where these spread.
DEVICE float curvature_by(const Corners &corners, float3 na, float3 nb, float3 nc) {
    float3 a = normalize_or_zero(na), b = normalize_or_zero(nb), c = normalize_or_zero(nc);
    float3 ab = corners.b - corners.a, bc = corners.c - corners.b, ca = corners.a - corners.c;
    float turn = dot(b - a, ab) + dot(c - b, bc) + dot(a - c, ca);
    float length = dot(ab, ab) + dot(bc, bc) + dot(ca, ca);
    return length > 0.0f ? turn / length : 0.0f;
}
// The same as seen from the side of `facing`; of a sphere by its radius, at a position on it.
DEVICE float curvature_of(const Params &params, unsigned triangle, float3 facing OF_SPHERES(, float3 position)) {
    if (!has_cones(params)) return 0.0f;
    OF_SPHERES(if (is_sphere(params, triangle)) {
        const Sphere &sphere = sphere_of(params, triangle);
        return copysignf(1.0f / sphere.radius, dot(position - vector_of(sphere.center), facing));
    })
    uint3 i = corners_of(params, triangle);
    float3 a = vector_at(params.normals, i.x), b = vector_at(params.normals, i.y), c = vector_at(params.normals, i.z);
    float curvature = curvature_by(positions_of(params, triangle), a, b, c);
    return dot(a + b + c, facing) < 0.0f ? -curvature : curvature;
}

// What a cone covers of the textures of a triangle that it meets in a unit direction: the area of the square of its longer side, in
// texture coordinates. Spheres have none.
DEVICE float footprint_of(const Params &params, Cone cone, unsigned triangle, float3 direction) {
    if (!has_cones(params) || params.texcoords == nullptr OF_SPHERES(|| is_sphere(params, triangle))) return NO_FOOTPRINT;
    Corners corners = positions_of(params, triangle);
    uint3 i = corners_of(params, triangle);
    float2 a = __ldg(params.texcoords + i.x), b = __ldg(params.texcoords + i.y), c = __ldg(params.texcoords + i.z);
    float3 normal = cross(corners.b - corners.a, corners.c - corners.a);
    float side = cone.width / dot(normal, direction);
    float area = fabsf((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
    return area * sqrtf(dot(normal, normal)) * (side * side);
}
