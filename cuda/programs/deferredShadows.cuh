// `deferredShadows`: the shadow of a directional light, 0.5 in shadow and 1 in light; or what the shadows of several lights leave of the
// colour, by colour.
#pragma once
#ifdef CURITIBA_LIGHTS
#include "light_share.cuh"
#else
#include "pass.cuh"
#endif

// The fastest of 1, 6, 8, 10, 12 and 16 on an H100.
constexpr unsigned RESIDENT_BLOCKS = 10;

#ifdef CURITIBA_LIGHTS

// The shading normal of a point that the camera sees, which the program is not handed. Normal maps are read at level 0.
DEVICE float3 normal_seen(const Params &params, const Hit &hit, float3 vertices, float3 flat) {
    bool bumps = shade_of(params, hit.triangle).flags & SHADE_NORMAL_MAP && params.tangents != nullptr;
    if (!bumps || !(dot(vertices, vertices) > LEAST_SQUARE)) return normalize_or_zero(vertices);
    return bent_normal(params, hit, vertices, flat, NO_FOOTPRINT);
}

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    unsigned triangle = pass.triangle();
    float4 position = pass.position();
    if (triangle == NO_TRIANGLE || !(position.w > 0.0f)) return splat4(1.0f);
    SurfacePoint point = snap(params, triangle, xyz(position));
    float3 side = pass.eye() - point.position, normal = point.normal;
    OF_SPHERES(if (is_sphere(params, triangle)) side = point.normal; else)
    if (params.normals != nullptr) {
        Hit hit = locate(params, triangle, point.position);
        side = normal_at(params, hit);
        normal = normal_seen(params, hit, side, point.normal);
    }
    pass.shaded_as_seen(normal, pixel_key(pass.pixel.x, pass.pixel.y, params.seed));
    float3 facing = point.normal * copysignf(1.0f, dot(point.normal, side));
    return opaque(share_of_lights<ACCEPT_COVERED>(pass, triangle, point, facing, [](Pass<Tracer> &pass, float3 origin) {
        pass.rays.shadow += 1;
        Ray ray = {origin, pass.to_light(), 0.0f, pass.light_end()};
        return splat(pass.tracer.template occluded<ACCEPT_COVERED>(ray, nullptr) ? in_shadow(pass.params) : 1.0f);
    }));
}

#else

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    unsigned triangle = pass.triangle();
    float4 position = pass.position();
    if (triangle == NO_TRIANGLE || !(position.w > 0.0f)) return splat4(1.0f);
    SurfacePoint point = snap(params, triangle, xyz(position));
    float3 side;
    OF_SPHERES(if (is_sphere(params, triangle)) side = point.normal; else)
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

#endif

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    float4 position = pass.position();
    if (position.w > 0.0f) {
        pass.rays.shadow += 1;
        if (!pass.template thesis_sees_light<ACCEPT_ALL>(xyz(position))) return splat4(SHADOWED);
    }
    return splat4(1.0f);
}
