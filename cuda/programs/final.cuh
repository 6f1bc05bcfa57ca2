// `final`: glass as in `refraction`, shadows and ambient occlusion, at pixels and at every hit.
#pragma once
#include "glass.cuh"
#ifdef CURITIBA_BODIES
#include "bodies.cuh"
#endif
#ifdef CURITIBA_WAYS
#include "ways.cuh"
#endif
#ifdef CURITIBA_SPHERES
#include "focus.cuh"
#endif
#ifdef CURITIBA_LIGHTS
#include "light_share.cuh"
#endif

// The fastest of 1, 8, 10, 12 and 16 on an H100.
constexpr unsigned RESIDENT_BLOCKS = 8;
// Of the kernels of `final_stages.cuh`, which our own traversal calls in corrected fidelity.
#define CURITIBA_FINAL
constexpr unsigned LISTING_BLOCKS = 8, LIGHTING_BLOCKS = 10;

// What glass is: what each material says, with shares of light by colour, or the report's panes.
#ifdef CURITIBA_BODIES
#ifdef CURITIBA_WAYS
using Walk = WaysWalk;
#else
using Walk = BodyWalk;
#endif
using End = BodyEnd;
using Share = float3;
DEVICE Share share_of(float value) { return splat(value); }
template <class Tracer> DEVICE Share light_from(Pass<Tracer> &pass, float3 origin) { return light_through_bodies(pass, origin); }
// The part of a surface's weight that is not in its colour.
DEVICE float weigh(const End &end, float3 &color) {
    color = end.weight * color;
    return 1.0f;
}
DEVICE float3 missed_by(const Walk &walk) { return walk.missed; }
// The weight of the surface that a pixel shows, and the walk from one of glass.
template <class Tracer> DEVICE Share weight_to_eye(const Pass<Tracer> &pass) { return kept_to_eye(pass); }
template <class Tracer> DEVICE void enter_glass(Walk &walk, Pass<Tracer> &pass, unsigned triangle, const End &seen, float3 view) {
    walk.enter_pixel(pass, triangle, seen.surface, view, seen.key, seen.weight);
}
#else
using Walk = GlassWalk;
using End = GlassEnd;
using Share = float;
DEVICE Share share_of(float value) { return value; }
template <class Tracer> DEVICE Share light_from(Pass<Tracer> &pass, float3 origin) { return pass.light_at(origin); }
DEVICE float weigh(const End &end, float3 &) { return end.weight; }
template <class Tracer> DEVICE Share weight_to_eye(const Pass<Tracer> &) { return 1.0f; }
template <class Tracer> DEVICE void enter_glass(Walk &walk, Pass<Tracer> &pass, unsigned triangle, const End &seen, float3 view) {
    walk.enter_pixel(pass, triangle, seen.surface, view, seen.key);
}
#endif

#ifdef CURITIBA_LIGHTS
// What the shadows of several lights or of a disc leave of a surface's colour, on the side to which it is lit. Shares are by colour: these programs know
// what each material says.
template <class Tracer>
DEVICE Share light_share(Pass<Tracer> &pass, unsigned triangle, const Surface &surface, float3 lit_side) {
    return share_of_lights<ACCEPT_STOPS>(pass, triangle, surface.point, lit_side, [](Pass<Tracer> &pass, float3 origin) {
        pass.rays.shadow += 1;
        return light_from(pass, origin);
    });
}
#else
// What reaches a surface of the light, on a side that is turned away.
template <class Tracer>
DEVICE Share turned_share(Pass<Tracer> &pass, unsigned triangle, const Surface &surface, float3 lit_side) {
    float3 origin;
    if (!pass.template lifted_origin<ACCEPT_STOPS>(triangle, surface.point, lit_side, origin)) return share_of(SHADOWED);
    pass.rays.shadow += 1;
    return light_from(pass, origin);
}
// The same on the side to which it is lit, whichever that is.
template <class Tracer>
DEVICE Share light_share(Pass<Tracer> &pass, unsigned triangle, const Surface &surface, float3 lit_side) {
    if (is_turned(pass.params, triangle, surface.point, lit_side, pass.to_light())) return turned_share(pass, triangle, surface, lit_side);
    pass.rays.shadow += 1;
    return light_from(pass, spawn(surface.point, pass.to_light()));
}
#endif

// Whether a surface keeps its colour without a ray: black, and a sky. Where glass is panes there is no sky (`Variant` of the processor).
DEVICE bool keeps_color(const Params &params, float3 color, unsigned triangle) {
#ifdef CURITIBA_BODIES
    return is_black(color) || is_sky(params, triangle);
#else
    return is_black(color);
#endif
}

// A colour times the light's share and ambient occlusion, but for colours that are kept. `focused` is the light that glass focuses. All threads of
// a warp call it together, those that have no surface with black.
template <class Tracer>
static __device__ OUTLINED float3 visible(Pass<Tracer> &pass, float3 color, unsigned triangle, const Surface &surface,
                                              float3 lit_side, unsigned key OF_SPHERES(, float3 focused)) {
    bool kept = keeps_color(pass.params, color, triangle);
    Share light = kept ? share_of(0.0f) : light_share(pass, triangle, surface, lit_side);
    OF_SPHERES(light = light + focused;)
    float open = pass.template occlusion<ACCEPT_STOPS>(!kept, surface, key);
    return kept ? color : color * light * open;
}

template <class Tracer> DEVICE float thesis_light_share(Pass<Tracer> &pass, float3 position) {
    pass.rays.shadow += 1;
    return pass.template thesis_sees_light<ACCEPT_OPAQUE>(position) ? 1.0f : SHADOWED;
}

struct VisibleSurface {
    // The report's `closest_hit` hands `faceforward` the ray's direction where the other programs hand it the opposite.
    template <class Tracer>
    static __device__ OUTLINED float3 thesis(Pass<Tracer> &pass, bool here, const Ray &ray, const Hit &hit) {
        float3 color = splat(0.0f), normal = color, position = color;
        if (here) {
            ThesisNormals normals = thesis_normals(pass.params, hit);
            normal = face_forward(normals.shading, ray.direction, normals.geometric);
            position = hit_position(ray, hit);
            color = lit_color(pass.params, hit, NO_FOOTPRINT, normal) * thesis_light_share(pass, position);
        }
        return color * pass.template thesis_occlusion<ACCEPT_OPAQUE>(here, position, normal);
    }
};

// The surfaces whose light and occlusion a pixel's colour is made of, in the order in which their colours are summed: its own,
// or, where it shows glass, those that are seen through it.
struct PixelSurfaces {
    bool glass, here;
    float3 color, lit_side;
    unsigned triangle;
    Walk walk;
    End end;

    template <class Tracer> DEVICE_MEMBER void begin(Pass<Tracer> &pass) {
        const Params &params = pass.params;
        triangle = pass.triangle();
        here = triangle != NO_TRIANGLE;
        glass = false;
        color = lit_side = splat(0.0f);
        if (!here) return;
        float3 stored_normal = pass.normal(), view;
        color = xyz(pass.color());
        end.surface = pass.surface_at(triangle, stored_normal, view);
        end.key = key_of_pixel(pass);
        end.weight = weight_to_eye(pass);
        lit_side = dot(stored_normal, end.surface.facing) < 0.0f ? -end.surface.facing : end.surface.facing;
        pass.shaded_as_seen(stored_normal, end.key);
        glass = is_glass(params, triangle);
        if (glass) enter_glass(walk, pass, triangle, end, view);
        here = !glass;
    }
    // Finds the next surface of glass; the others have one, found already.
    template <class Tracer> DEVICE_MEMBER void advance(Pass<Tracer> &pass) {
        if (!glass || here) return;
        here = walk.advance(pass, end);
        if (!here) return;
        color = met_color(pass.params, end.hit, end.footprint, end.surface);
        pass.shaded_as_met(end.hit, end.surface, end.key);
        lit_side = end.surface.facing;
        triangle = end.hit.triangle;
    }
#ifdef CURITIBA_SPHERES
    // The light that glass focuses on the surface that was found, which has this colour.
    template <class Tracer> DEVICE_MEMBER float3 focused(Pass<Tracer> &pass, float3 seen) const {
        const Params &params = pass.params;
        if (!(params.asks & ASKS_FOCUSED) || keeps_color(params, seen, triangle)) return splat(0.0f);
        const Shade &shade = shade_of(params, triangle);
        Lit lit;
        lit.tint = shade.texture != NO_TEXTURE ? vector_of(shade.diffuse) : splat(1.0f);
        if (glass) {
            lit.normal = end.surface.normal;
            lit.cosine = cosine_to(params, shade, end.hit, lit.normal, vector_of(params.to_light));
        } else {
            lit.normal = normalize_or(pass.normal(), lit_side);
            lit.cosine = fmaxf(pass.position().w, 0.0f);
        }
        return (1.0f - SHADOWED) * focused_light(pass, end.surface.point, lit_side, lit) +
               (1.0f - SHADOWED) * photon_light(params, end.surface.point.position, lit_side, lit);
    }
#endif
};

template <class Tracer> DEVICE float4 corrected(Pass<Tracer> &pass) {
    float3 sum = splat(0.0f);
    PixelSurfaces surfaces;
    surfaces.begin(pass);
    while (true) {
        surfaces.advance(pass);
        if (!pass.tracer.any(surfaces.here)) break;
        bool here = surfaces.here;
        const End &end = surfaces.end;
        // A thread without a surface, beside others of its warp that have one, has nothing in `end`.
        float3 color = splat(0.0f);
        float weight = 0.0f;
        if (here) {
            color = surfaces.color;
            weight = weigh(end, color);
        }
        float3 share = visible(pass, color, surfaces.triangle, end.surface, surfaces.lit_side,
                               end.key OF_SPHERES(, surfaces.focused(pass, color)));
        if (here) sum = surfaces.glass ? sum + weight * share : share;
        surfaces.here = false;
    }
#ifdef CURITIBA_BODIES
    sum = sum + missed_by(surfaces.walk);
#endif
    return pass.triangle() != NO_TRIANGLE ? shown(surfaces.walk, sum) : pass.color();
}
#ifdef CURITIBA_BODIES
template <class Tracer> DEVICE float4 bodies(Pass<Tracer> &pass) { return corrected(pass); }
#endif

template <class Tracer> DEVICE float4 thesis(Pass<Tracer> &pass) {
    float4 stored = pass.color();
    float3 position = xyz(pass.position());
    bool glass = pass.inside && is_glass_mask(stored);
    float3 color = thesis_glass<VisibleSurface>(pass, glass);
    if (!glass) color = xyz(stored) * thesis_light_share(pass, position);
    return opaque(color * pass.template thesis_occlusion<ACCEPT_OPAQUE>(pass.inside, position, pass.normal()));
}
