// Glass that reflects and refracts, shared by `refraction` and `final`. In thesis fidelity `Shader` gives the colour of
// everything else, and is asked by threads that met nothing too:
//   float3 thesis(pass, here, ray, hit)
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
    Cone cone;
};

// Where a ray through glass ends, and what its colour weighs.
struct GlassEnd {
    Hit hit;
    Surface surface;
    float weight;
    unsigned key;
    float footprint;
};

// The tree of rays of one pixel, walked from end to end.
struct GlassWalk {
    Branch waiting[MAX_DEPTH + 1];
    unsigned count = 0;
    Branch next;
    bool follows = false, splits = false;
    // The glass on which a ray splits next.
    Surface surface;
    float3 view;
    float weight;
    unsigned key, bounces, triangle;
    Cone cone;

    // Starts at a pixel that shows glass.
    template <class Tracer>
    DEVICE_MEMBER void enter_pixel(Pass<Tracer> &pass, unsigned shown, const Surface &at, float3 direction, unsigned path) {
        enter(shown, at, direction, pass.cone_at(at), path, 1.0f, 0);
    }
    // Starts at glass that is seen in a direction.
    DEVICE_MEMBER void enter(unsigned met, const Surface &at, float3 direction, Cone by, unsigned path, float share, unsigned bounce) {
        triangle = met;
        surface = at;
        cone = by;
        view = direction;
        key = path;
        weight = share;
        bounces = bounce;
        splits = true;
    }

    // The light that the glass sends along `view` splits.
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
        float curvature = curvature_of(params, triangle, surface.facing OF_SPHERES(, surface.point.position)), cosine = -dot(normal, view);
        follows = false;
        if (enters) {
            pass.rays.refracted += 1;
            next = {spawn(surface.point, refracted), refracted, weight * (1.0f - interface.reflectance),
                    path_key(key, BRANCH_REFRACTED), bounces,
                    cone_refracted(cone, curvature, cosine, interface.cos_refracted, params.index)};
            follows = true;
        }
        if (interface.reflectance > 0.0f) {
            pass.rays.reflected += 1;
            if (follows) waiting[count++] = next;
            float3 direction = reflect(view, normal);
            next = {spawn(surface.point, direction), direction, weight * interface.reflectance,
                    path_key(key, BRANCH_REFLECTED), bounces, cone_mirrored(cone, curvature, cosine)};
            follows = true;
        }
        splits = false;
    }

    // Goes on to the next end that is not glass; false when there is none left.
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
            Cone there = cone_along(next.cone, hit.t);
            float footprint = footprint_of(params, there, hit.triangle, next.direction);
            Surface met = surface_hit(params, OF_SPHERES(next.origin, ) next.direction, hit, footprint);
            if (!glass) {
                end = {hit, met, next.weight, next.key, footprint};
                return true;
            }
            enter(hit.triangle, met, next.direction, there, next.key, GLASS_BOUNCE * next.weight, next.bounces + 1);
        }
    }
};

// Where a radiance ray of the report ends.
struct ThesisEnd {
    Ray ray;
    Hit hit;
    float weight;
};

// The bounces of a radiance ray of the report: a chain, since its glass keeps the reflected colour only. Whether it ends on
// anything.
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

// The glass branch of the report's `buffer_camera`, where it is wanted. `Shader` is asked by all threads together.
template <class Shader, class Tracer> DEVICE float3 thesis_glass(Pass<Tracer> &pass, bool wanted) {
    const Params &params = pass.params;
    float3 position = xyz(pass.position()), normal = pass.normal();
    float3 view = thesis_view(params, position);
    float3 direction = reflect(view, normal), colors[2] = {splat(0.0f), splat(0.0f)};
    float t_min = THESIS_EPSILON;
    bool goes = wanted;
    // One loop, so that the chain and all that it inlines is compiled once.
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
