// Glass that reflects and refracts, shared by `refraction` and `final`. `Shader` gives the colour of everything else:
//   float3 corrected(pass, hit, surface, key)
//   float3 thesis(pass, ray, hit)
//
// The Rust reference recurses; here the tree of rays is walked with a list of the branches still to be traced, each with
// the weight of its colour. The sum is the same but for the order of its roundings.
#pragma once
#include "pass.cuh"

// A ray that is still to be traced. At most one a bounce waits while another is followed.
struct Branch {
    float3 origin, direction;
    float weight;
    unsigned key, bounces;
};

template <class Shader, class Tracer>
DEVICE float3 corrected_glass(Pass<Tracer> &pass, Surface surface, float3 view, unsigned key) {
    const Params &params = pass.params;
    float3 color = splat(0.0f);
    Branch waiting[MAX_DEPTH + 1];
    unsigned count = 0;
    float weight = 1.0f;
    unsigned bounces = 0;
    while (true) {
        // The light that this surface sends along `view` splits.
        float3 normal = interface_normal(surface, view);
        Interface interface = interface_of(params, -dot(normal, view));
        float3 refracted;
        bool enters = refract(interface, view, normal, params.index, refracted);
        if (enters && dot(refracted, surface.facing) >= 0.0f) {
            normal = surface.facing;
            interface = interface_of(params, -dot(normal, view));
            enters = refract(interface, view, normal, params.index, refracted);
        }
        Branch next = {surface.point.position, view, 0.0f, key, bounces};
        bool follows = false;
        if (enters) {
            pass.rays.refracted += 1;
            next = {spawn(surface.point, refracted), refracted, weight * (1.0f - interface.reflectance),
                    path_key(key, BRANCH_REFRACTED), bounces};
            follows = true;
        }
        if (interface.reflectance > 0.0f) {
            pass.rays.reflected += 1;
            if (follows) waiting[count++] = next;
            float3 direction = reflect(view, normal);
            next = {spawn(surface.point, direction), direction, weight * interface.reflectance,
                    path_key(key, BRANCH_REFLECTED), bounces};
            follows = true;
        }
        // Follows rays until one ends on glass that splits it again.
        bool split = false;
        while (!split) {
            if (!follows) {
                if (count == 0) return color;
                next = waiting[--count];
            }
            follows = false;
            Hit hit;
            if (!pass.closest(next.origin, next.direction, hit)) continue;
            bool glass = is_glass(params, hit.triangle);
            if (glass && next.bounces >= params.depth) continue;
            surface = surface_hit(params, next.direction, hit);
            if (glass) {
                weight = GLASS_BOUNCE * next.weight;
                view = next.direction;
                key = next.key;
                bounces = next.bounces + 1;
                split = true;
            } else {
                color = color + next.weight * Shader::corrected(pass, hit, surface, next.key);
            }
        }
    }
}

// The bounces of a radiance ray of the report: a chain, since its glass keeps the reflected colour only.
template <class Shader, class Tracer>
DEVICE float3 thesis_chain(Pass<Tracer> &pass, float3 origin, float3 direction, float t_min, bool refracted) {
    const Params &params = pass.params;
    float weight = 1.0f;
    for (unsigned bounce = 0; bounce <= params.depth; ++bounce) {
        if (bounce == 0 && refracted) {
            pass.rays.refracted += 1;
        } else {
            pass.rays.reflected += 1;
        }
        Hit hit;
        if (!pass.thesis_closest(origin, direction, t_min, hit)) break;
        Ray ray = {origin, direction, t_min, INFINITY};
        if (!is_glass(params, hit.triangle)) return weight * Shader::thesis(pass, ray, hit);
        ThesisNormals normals = thesis_normals(params, hit);
        float3 normal = face_forward(normals.shading, -direction, normals.geometric);
        float3 unused;
        if (thesis_refract(direction, normal, params.index, unused)) weight = weight * GLASS_BOUNCE;
        origin = hit_position(ray, hit);
        direction = reflect(direction, normal);
        t_min = THESIS_EPSILON;
    }
    return splat(0.0f);
}

// The glass branch of the report's `buffer_camera`.
template <class Shader, class Tracer> DEVICE float3 thesis_glass(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    float3 position = xyz(pass.position()), normal = pass.normal();
    float3 view = thesis_view(params, position);
    float3 direction = reflect(view, normal), colors[2] = {splat(0.0f), splat(0.0f)};
    float t_min = THESIS_EPSILON;
    // One loop, so that the chain and all that it inlines is compiled once.
#pragma unroll 1
    for (int branch = 0; branch < 2; ++branch) {
        float3 color = thesis_chain<Shader>(pass, position, direction, t_min, branch == 1);
        if (branch == 0) {
            colors[0] = color;
            if (!thesis_refract(view, normal, params.index, direction)) return color;
            t_min = THESIS_REFRACTED_EPSILON;
        } else {
            colors[1] = color;
        }
    }
    float weight = thesis_coefficient(params.index, normal, view);
    return weight * colors[1] + (1.0f - weight) * colors[0];
}
