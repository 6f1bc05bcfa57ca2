// Glass that reflects and refracts, shared by `refraction` and `final`. In thesis fidelity `Shader` gives the colour of everything else;
// threads without a hit call it too:
//   float3 thesis(pass, here, ray, hit)
//
// The Rust reference recurses. Here a loop walks the tree of rays with a list of pending branches, each with the weight of its colour. The
// sum is the same up to the order of its roundings.
#pragma once
#include "pass.cuh"

// A ray that is still to be traced. While one branch is followed, at most one a bounce waits.
struct Branch {
    float3 origin, direction;
    float weight;
    unsigned key, bounces;
};

// A surface at which a path through glass ends, and the weight of its colour.
struct GlassEnd {
    Hit hit;
    Surface surface;
    float weight;
    unsigned key;
};

// The tree of rays of one pixel, walked from end to end.
struct GlassWalk {
    Branch waiting[MAX_DEPTH + 1];
    unsigned count = 0;
    Branch next;
    bool follows = false, splits = false;
    // The glass at which the path splits next.
    Surface surface;
    float3 view;
    float weight;
    unsigned key, bounces;

    // Starts at a pixel that shows glass.
    template <class Tracer>
    DEVICE_MEMBER void enter_pixel(Pass<Tracer> &, unsigned, const Surface &at, float3 direction, unsigned path) {
        enter(at, direction, path, 1.0f, 0);
    }
    // Starts at glass that is seen along `direction`.
    DEVICE_MEMBER void enter(const Surface &at, float3 direction, unsigned path, float share, unsigned bounce) {
        surface = at;
        view = direction;
        key = path;
        weight = share;
        bounces = bounce;
        splits = true;
    }

    // Splits the light that the glass sends along `view` into a reflected and a refracted ray.
    template <class Tracer> DEVICE_MEMBER void split(Pass<Tracer> &pass) {
        const Params &params = pass.params;
        float3 normal = interface_normal(surface, view);
        Interface interface = interface_of(params, -dot(normal, view));
        float3 refracted;
        bool enters = refract(interface, view, normal, params.index, refracted);
        if (enters && dot(refracted, surface.facing) >= 0.0f) {
            normal = surface.facing;
            interface = interface_of(params, -dot(normal, view));
            enters = refract(interface, view, normal, params.index, refracted);
        }
        follows = false;
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
        splits = false;
    }

    // Advances to the next end that is not glass; false when none is left.
    template <class Tracer> DEVICE_MEMBER bool advance(Pass<Tracer> &pass, GlassEnd &end) {
        const Params &params = pass.params;
        while (true) {
            if (splits) split(pass);
            if (!follows) {
                if (count == 0) return false;
                next = waiting[--count];
            }
            follows = false;
            Hit hit;
            if (!pass.closest(next.origin, next.direction, hit)) continue;
            bool glass = is_glass(params, hit.triangle);
            if (glass && next.bounces >= params.depth) continue;
            Surface met = surface_hit(params, next.direction, hit);
            if (!glass) {
                end = {hit, met, next.weight, next.key};
                return true;
            }
            enter(met, next.direction, next.key, GLASS_BOUNCE * next.weight, next.bounces + 1);
        }
    }
};

// The hit at which a radiance ray of the report ends.
struct ThesisEnd {
    Ray ray;
    Hit hit;
    float weight;
};

// The bounces of a radiance ray of the report: a chain, since its glass keeps only the reflected colour. Returns whether the chain ends on
// a surface.
template <class Tracer>
DEVICE bool thesis_chain(Pass<Tracer> &pass, float3 origin, float3 direction, float t_min, bool refracted, ThesisEnd &end) {
    const Params &params = pass.params;
    float weight = 1.0f;
    for (unsigned bounce = 0; bounce <= params.depth; ++bounce) {
        if (bounce == 0 && refracted) {
            pass.rays.refracted += 1;
        } else {
            pass.rays.reflected += 1;
        }
        Hit hit;
        if (!pass.thesis_closest(origin, direction, t_min, hit)) return false;
        Ray ray = {origin, direction, t_min, INFINITY};
        if (!is_glass(params, hit.triangle)) {
            end = {ray, hit, weight};
            return true;
        }
        ThesisNormals normals = thesis_normals(params, hit);
        float3 normal = face_forward(normals.shading, -direction, normals.geometric);
        float3 unused;
        if (thesis_refract(direction, normal, params.index, unused)) weight = weight * GLASS_BOUNCE;
        origin = hit_position(ray, hit);
        direction = reflect(direction, normal);
        t_min = THESIS_EPSILON;
    }
    return false;
}

// The glass branch of the report's `buffer_camera`, where `wanted`. All threads call `Shader` together.
template <class Shader, class Tracer> DEVICE float3 thesis_glass(Pass<Tracer> &pass, bool wanted) {
    const Params &params = pass.params;
    float3 position = xyz(pass.position()), normal = pass.normal();
    float3 view = thesis_view(params, position);
    float3 direction = reflect(view, normal), colors[2] = {splat(0.0f), splat(0.0f)};
    float t_min = THESIS_EPSILON;
    bool goes = wanted;
    // One loop, so that the chain and everything inlined in it is compiled once.
#pragma unroll 1
    for (int branch = 0; branch < 2; ++branch) {
        ThesisEnd end;
        bool here = goes && thesis_chain(pass, position, direction, t_min, branch == 1, end);
        float3 color = Shader::thesis(pass, here, end.ray, end.hit);
        if (here) colors[branch] = end.weight * color;
        if (branch == 0) {
            goes = goes && thesis_refract(view, normal, params.index, direction);
            t_min = THESIS_REFRACTED_EPSILON;
        }
    }
    if (!goes) return colors[0];
    float weight = thesis_coefficient(params.index, normal, view);
    return weight * colors[1] + (1.0f - weight) * colors[0];
}
