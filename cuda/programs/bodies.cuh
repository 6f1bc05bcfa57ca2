// Glass as each material says (`effects/dielectric` of the Rust reference): bodies that light enters and leaves, thin walls and the
// report's panes, all of them smooth and without dispersion; light that falls straight through; and a background. `ways.cuh` follows paths
// through all other glass.
//
// The Rust reference recurses; here the tree of rays is walked with a list of the branches still to be traced, each with the weight of
// its colour. The sum is the same but for the order of its roundings.
#pragma once
#include "pass.cuh"

// The bodies that a point of a path lies in; the last fills the place (`media.rs`).
struct Media {
    unsigned list[MOST_BODIES];
    unsigned length;
};
static_assert(sizeof(Media) == MEDIA_BYTES, "Media");
DEVICE Media no_media() {
    Media media;
    for (unsigned i = 0; i < MOST_BODIES; ++i) media.list[i] = 0;
    media.length = 0;
    return media;
}
DEVICE unsigned top_of(const Media &media) { return media.length == 0 ? NO_BODY : media.list[media.length - 1]; }
DEVICE float index_in(const Params &params, const Media &media) {
    unsigned body = top_of(media);
    return body == NO_BODY ? 1.0f : params.bodies[body].index;
}
// With one body more; `fills` says whether it fills the place then, `overflows` whether there was no room for it.
DEVICE Media with_body(const Params &params, Media media, unsigned body, bool &fills, bool &overflows) {
    unsigned place = 0, priority = params.bodies[body].priority;
    while (place < media.length && params.bodies[media.list[place]].priority <= priority) ++place;
    fills = place == media.length;
    overflows = media.length == MOST_BODIES;
    if (overflows) return media;
    for (unsigned i = media.length; i > place; --i) media.list[i] = media.list[i - 1];
    media.list[place] = body;
    media.length += 1;
    return media;
}
// Without one body, the one entered last; false where there is none.
DEVICE bool without_body(Media &media, unsigned body, bool &fills) {
    unsigned place = media.length;
    while (place > 0 && media.list[place - 1] != body) --place;
    if (place == 0) return false;
    fills = place == media.length;
    for (unsigned i = place; i < media.length; ++i) media.list[i - 1] = media.list[i];
    media.length -= 1;
    media.list[media.length] = 0;
    return true;
}
// What a line that crosses the surface of a body finds.
struct Border {
    Media after;
#ifdef CURITIBA_WAYS
    // What fills the place before and behind.
    unsigned before, behind;
#endif
    // Index of refraction behind over that before; where another body fills the place on both sides there is no surface.
    float ratio;
    bool is_surface, overflows;
};
DEVICE Border cross_border(const Params &params, const Media &media, unsigned body, bool enters) {
    Border border;
    Media before = media;
    border.after = media;
    border.overflows = false;
    if (enters) {
        border.after = with_body(params, media, body, border.is_surface, border.overflows);
    } else if (!without_body(border.after, body, border.is_surface)) {
        // Who leaves a body that is not known to have been entered was in it all the same.
        before = with_body(params, media, body, border.is_surface, border.overflows);
    }
#ifdef CURITIBA_WAYS
    border.before = top_of(before);
    border.behind = top_of(border.after);
#endif
    border.ratio = border.is_surface ? index_in(params, border.after) / index_in(params, before) : 1.0f;
    return border;
}

// exp(-extinction * length) by colour; exactly 1 where nothing is absorbed, whatever the length. The exponential function of single
// precision would flush what is smallest to 0.
DEVICE float kept_of(float extinction, float length) {
    return extinction > 0.0f ? (float)exp((double)(-extinction * length)) : 1.0f;
}
DEVICE float3 transmittance(float3 extinction, float length) {
    return vec3(kept_of(extinction.x, length), kept_of(extinction.y, length), kept_of(extinction.z, length));
}
DEVICE float3 extinction_in(const Params &params, const Media &media) {
    unsigned body = top_of(media);
    return body == NO_BODY ? splat(0.0f) : vector_of(params.bodies[body].extinction);
}

// What the body that the camera is in leaves of light, by colour, on its way from the surface that a pixel shows to the eye (`eye.rs`).
template <class Tracer> DEVICE float3 kept_to_eye(const Pass<Tracer> &pass) {
    const Media *around = (const Media *)pass.params.around_eye;
    if (around == nullptr || around->length == 0) return splat(1.0f);
    float3 to = xyz(pass.position()) - pass.eye();
    return transmittance(vector_of(pass.params.bodies[around->list[around->length - 1]].extinction), sqrtf(dot(to, to)));
}

// The same of a material, whose own reflectance, if it has one, replaces Fresnel's except at total reflection (`interface_of` of `optics.rs`).
DEVICE Interface face_at(const Params &params, OF_WAYS(unsigned material, ) float cos_incident, float ratio) {
    Interface interface = interface_at(params, cos_incident, ratio);
#ifdef CURITIBA_WAYS
    const Face &face = ways_asked(params).faces[material];
    bool is_total = interface.cos_refracted == 0.0f && interface.reflectance >= 1.0f;
    if (face.exponent < 0.0f || is_total) return interface;
    float cosine = ratio < 1.0f ? interface.cos_refracted : fminf(fmaxf(cos_incident, 0.0f), 1.0f);
    interface.reflectance = face.minimum + (face.maximum - face.minimum) * (float)pow((double)(1.0f - cosine), (double)face.exponent);
#endif
    return interface;
}

// A plane-parallel wall after all reflections between its faces (`slab.rs`).
struct Wall {
    float3 reflected, transmitted;
};
DEVICE float passed_of(float r, float a) { return (1.0f - r) * (1.0f - r) * a / (1.0f - r * r * a * a); }
DEVICE Wall wall_of(float reflectance, float3 kept) {
    if (reflectance >= 1.0f) return {splat(1.0f), splat(0.0f)};
    float r = reflectance;
    float3 through = vec3(passed_of(r, kept.x), passed_of(r, kept.y), passed_of(r, kept.z));
    return {vec3(r + r * kept.x * through.x, r + r * kept.y * through.y, r + r * kept.z * through.z), through};
}
DEVICE float3 kept_across(const Body &body, float cos_refracted) {
    return transmittance(vector_of(body.extinction), body.thickness / fmaxf(cos_refracted, 1.17549435e-38f));
}

DEVICE float decoded(float encoded) {
    double value = encoded;
    return (float)(value <= 0.04045 ? value / 12.92 : pow((value + 0.055) / 1.055, 2.4));
}
// The share of the light that enters at a hit and is scattered back.
DEVICE float veil_at(const Params &params, const Body &body, const Hit &hit, float footprint) {
    if (body.transmission_texture == NO_TEXTURE OF_SPHERES(|| is_sphere(params, hit.triangle))) return body.veil;
    float clear = sample_numbers(params, body.transmission_texture, texture_coordinates(params, hit), footprint).x;
    return 1.0f - (1.0f - body.veil) * clear;
}
// The share of the light that passes, by colour, of that which is not reflected.
DEVICE float3 filter_of(const Params &params, const Body &body, const Hit &hit, float footprint) {
    float3 texel = splat(1.0f);
    if (body.filter_texture != NO_TEXTURE OF_SPHERES(&& !is_sphere(params, hit.triangle))) {
        texel = xyz(sample_texture(params, body.filter_texture, texture_coordinates(params, hit), footprint));
        // A share of light is linear whatever the colours of the pass are.
        if (params.decoded == nullptr) texel = vec3(decoded(texel.x), decoded(texel.y), decoded(texel.z));
    }
    float3 vertices = splat(1.0f);
    if (body.filter_vertex_colors != VERTEX_COLORS_NONE OF_SPHERES(&& !is_sphere(params, hit.triangle))) {
        vertices = xyz(vertex_color(params, hit));
        if (body.filter_vertex_colors == VERTEX_COLORS_DISPLAY) vertices = vec3(decoded(vertices.x), decoded(vertices.y), decoded(vertices.z));
    }
    return (1.0f - veil_at(params, body, hit, footprint)) * vector_of(body.filter) * texel * vertices;
}

// The barycentric coordinates of a point in the plane of a triangle, as a hit at distance 0. Spheres have none.
DEVICE Hit located(const Params &params, unsigned triangle, float3 point) {
    OF_SPHERES(if (is_sphere(params, triangle)) return Hit{0.0f, triangle, 0.0f, 0.0f};)
    Corners corners = positions_of(params, triangle);
    double3 a = wide(corners.a), e1 = wide(corners.b) - a, e2 = wide(corners.c) - a, to = wide(point) - a;
    double3 normal = cross(e1, e2);
    double area = dot(normal, normal);
    return {0.0f, triangle, (float)(dot(cross(to, e2), normal) / area), (float)(dot(cross(e1, to), normal) / area)};
}

// Whether a surface is seen from the side of the counter-clockwise winding: of a body, from outside.
DEVICE bool is_front(const Surface &surface) {
    float3 n = surface.point.normal, f = surface.facing;
    return f.x == n.x && f.y == n.y && f.z == n.z;
}

// A ray that is still to be traced.
struct BodyBranch {
    float3 origin, direction;
    // The point of the surface that it leaves: the ray starts a little off it.
    float3 from;
    float3 weight;
    Media media;
    unsigned key, surfaces, splits;
    Cone cone;
};

// Where a ray through glass ends, and what its colour weighs.
struct BodyEnd {
    Hit hit;
    Surface surface;
    float3 weight;
    unsigned key;
    float footprint;
};

// The tree of rays of one pixel, walked from end to end.
struct BodyWalk {
    // One for each split on the way.
    BodyBranch waiting[MAX_DEPTH + 1];
    unsigned count = 0;
    BodyBranch next;
    bool follows = false, veiled = false;
    // What the glass that was met last scatters back.
    BodyEnd veil;
    // What the background adds where rays leave the scene.
    float3 missed = {0.0f, 0.0f, 0.0f};

    // A path that has come to a surface.
    struct Path {
        float3 weight;
        Media media;
        unsigned key, surfaces, splits;
        Cone cone;
    };
    struct Met {
        const Hit &hit;
        const Surface &surface;
        float3 view;
        float footprint;
    };

    // Starts at a pixel that shows glass, of whose light the share `kept` reaches the eye.
    template <class Tracer>
    DEVICE_MEMBER void enter_pixel(Pass<Tracer> &pass, unsigned triangle, const Surface &surface, float3 view, unsigned key, float3 kept) {
        const Params &params = pass.params;
        Hit hit = located(params, triangle, xyz(pass.position()));
        Path path = {kept, params.around_eye ? *(const Media *)params.around_eye : no_media(), key, 0, 0, pass.cone_at(surface)};
        enter(pass, {hit, surface, view, footprint_of(params, path.cone, triangle, view)}, path);
    }

    // What glass does with a ray that meets it.
    template <class Tracer> __device__ OUTLINED void enter(Pass<Tracer> &pass, const Met &met, const Path &path) {
        const Params &params = pass.params;
        if (path.surfaces >= MOST_SURFACES) {
            pass.rays.lost += 1;
            return;
        }
        if (params.bodies == nullptr) return pane(pass, met, path);
        unsigned material = __ldg(params.materials + met.hit.triangle);
        switch (params.bodies[material].shape) {
        case SHAPE_SOLID: return solid(pass, met, material, path);
        case SHAPE_THIN: return thin(pass, met, params.bodies[material], path);
        default: return pane(pass, met, path);
        }
    }

    template <class Tracer> DEVICE_MEMBER void solid(Pass<Tracer> &pass, const Met &met, unsigned material, const Path &path) {
        const Params &params = pass.params;
        const Body &body = params.bodies[material];
        Border border = cross_border(params, path.media, material, is_front(met.surface));
        pass.rays.lost += border.overflows;
        if (!border.is_surface) {
            follow_refracted(pass, met.surface, path, met.view, splat(1.0f), border.after, 0, path.cone);
            return;
        }
        float3 filter = filter_of(params, body, met.hit, met.footprint);
        if (border.ratio == 1.0f) {
            follow_refracted(pass, met.surface, path, met.view, filter, border.after, 0, path.cone);
            scatter_back(params, met, body, splat(1.0f), path);
            return;
        }
        float3 normal, refracted;
        Interface interface;
        bool enters = bend(params, met, border.ratio, normal, interface, refracted);
        split(pass, met.surface, path, reflect(met.view, normal), splat(interface.reflectance), enters, refracted,
              (1.0f - interface.reflectance) * filter, border.after, cones_of(params, met, path, normal, interface, border.ratio));
        scatter_back(params, met, body, splat(1.0f - interface.reflectance), path);
    }

    template <class Tracer> DEVICE_MEMBER void thin(Pass<Tracer> &pass, const Met &met, const Body &body, const Path &path) {
        const Params &params = pass.params;
        float3 normal = interface_normal(met.surface, met.view);
        Interface interface = interface_at(params, -dot(normal, met.view), body.index / index_in(params, path.media));
        Wall wall = wall_of(interface.reflectance, kept_across(body, interface.cos_refracted));
        split(pass, met.surface, path, reflect(met.view, normal), wall.reflected, true, met.view,
              wall.transmitted * filter_of(params, body, met.hit, met.footprint), path.media,
              // Its two faces undo each other's bending.
              {cones_of(params, met, path, normal, interface, 1.0f).mirrored, path.cone});
        scatter_back(params, met, body, wall.transmitted, path);
    }

    // The report's pane: light enters it at every bounce, and those after the first dim it.
    template <class Tracer> DEVICE_MEMBER void pane(Pass<Tracer> &pass, const Met &met, const Path &path) {
        float3 normal, refracted;
        Interface interface;
        bool enters = bend(pass.params, met, pass.params.index, normal, interface, refracted);
        float kept = path.surfaces > 0 ? GLASS_BOUNCE : 1.0f;
        split(pass, met.surface, path, reflect(met.view, normal), splat(kept * interface.reflectance), enters, refracted,
              splat(kept * (1.0f - interface.reflectance)), path.media,
              cones_of(pass.params, met, path, normal, interface, pass.params.index));
    }

    // The cones of what a surface mirrors by this normal, and of what it lets through.
    struct Cones {
        Cone mirrored, refracted;
    };
    DEVICE_MEMBER Cones cones_of(const Params &params, const Met &met, const Path &path, float3 normal, const Interface &interface, float ratio) {
        float curvature = curvature_of(params, met.hit.triangle, met.surface.facing OF_SPHERES(, met.surface.point.position)), cosine = -dot(normal, met.view);
        return {cone_mirrored(path.cone, curvature, cosine), cone_refracted(path.cone, curvature, cosine, interface.cos_refracted, ratio)};
    }

    // By the normal that bends light, or the flat surface's where that would send refracted light back to the viewer's side.
    DEVICE_MEMBER bool bend(const Params &params, const Met &met, float ratio, float3 &normal, Interface &interface, float3 &refracted) {
        normal = interface_normal(met.surface, met.view);
        interface = interface_at(params, -dot(normal, met.view), ratio);
        bool enters = refract(interface, met.view, normal, ratio, refracted);
        if (!(enters && dot(refracted, met.surface.facing) >= 0.0f)) return enters;
        normal = met.surface.facing;
        interface = interface_at(params, -dot(normal, met.view), ratio);
        return refract(interface, met.view, normal, ratio, refracted);
    }

    // What a surface scatters back of the light of which it takes the share `entering`.
    DEVICE_MEMBER void scatter_back(const Params &params, const Met &met, const Body &body, float3 entering, const Path &path) {
        float scattered = veil_at(params, body, met.hit, met.footprint);
        if (scattered <= 0.0f) return;
        veil = {met.hit, met.surface, path.weight * (scattered * entering), path.key, met.footprint};
        veiled = true;
    }

    // Both ways on, or beyond the depth the one through the surface, where there is one. A way that brings nothing is not taken.
    template <class Tracer>
    DEVICE_MEMBER void split(Pass<Tracer> &pass, const Surface &surface, const Path &path, float3 mirrored, float3 mirrored_weight,
                             bool enters, float3 refracted, float3 refracted_weight, const Media &after, const Cones &cones) {
        bool back = !is_black(mirrored_weight), through = enters && !is_black(refracted_weight);
        // Where all glass is panes, what lies deeper is black, as in the report.
        bool panes = pass.params.bodies == nullptr, splits = panes || path.splits < pass.params.depth;
        unsigned deeper = panes || (back && through && splits) ? 1 : 0;
        if (back && through && !splits) {
            refracted_weight = mirrored_weight + refracted_weight;
            back = false;
        }
        if (through) follow_refracted(pass, surface, path, refracted, refracted_weight, after, deeper, cones.refracted);
        if (!back) return;
        if (follows) waiting[count++] = next;
        pass.rays.reflected += 1;
        next = {spawn(surface.point, mirrored), mirrored, surface.point.position, path.weight * mirrored_weight, path.media,
                path_key(path.key, BRANCH_REFLECTED), path.surfaces + 1, path.splits + deeper, cones.mirrored};
        follows = true;
    }

    template <class Tracer>
    DEVICE_MEMBER void follow_refracted(Pass<Tracer> &pass, const Surface &surface, const Path &path, float3 direction, float3 weight,
                                        const Media &after, unsigned deeper, Cone cone) {
        pass.rays.refracted += 1;
        next = {spawn(surface.point, direction), direction, surface.point.position, path.weight * weight, after,
                path_key(path.key, BRANCH_REFRACTED), path.surfaces + 1, path.splits + deeper, cone};
        follows = true;
    }

    // Goes on to the next end that is not glass, or is what glass scatters back; false when there is none left.
    template <class Tracer> DEVICE_MEMBER bool advance(Pass<Tracer> &pass, BodyEnd &end) {
        const Params &params = pass.params;
        while (true) {
            if (veiled) {
                veiled = false;
                end = veil;
                return true;
            }
            if (!follows) {
                if (count == 0) return false;
                next = waiting[--count];
            }
            follows = false;
            float3 extinction = extinction_in(params, next.media);
            Hit hit;
            if (!pass.closest_or_sky(next.origin, next.direction, hit)) {
                missed = missed + next.weight * transmittance(extinction, INFINITY) * vector_of(params.beyond);
                continue;
            }
            bool glass = is_glass(params, hit.triangle);
            if (glass && params.bodies == nullptr && next.splits > params.depth) continue;
            Cone cone = cone_along(next.cone, hit.t);
            float footprint = footprint_of(params, cone, hit.triangle, next.direction);
            Surface met = surface_hit(params, OF_SPHERES(next.origin, ) next.direction, hit, footprint);
            float length = fmaxf(dot(met.point.position - next.from, next.direction), 0.0f);
            float3 weight = next.weight * transmittance(extinction, length);
            if (!glass) {
                end = {hit, met, weight, next.key, footprint};
                return true;
            }
            Path path = {weight, next.media, next.key, next.surfaces, next.splits, cone};
            enter(pass, {hit, met, next.direction, footprint}, path);
        }
    }
};

#ifdef CURITIBA_SPHERES
// The outward normal of a sphere where a line crosses it.
DEVICE float3 sphere_normal(const Params &params, const Crossings &crossings, float3 direction, const Hit &hit) {
    return met_on_sphere(sphere_of(params, hit.triangle), crossings.origin, direction, hit.t).normal;
}
#endif
// The side of a body's surface that a line meets, by the geometric normal.
DEVICE bool line_enters(const Params &params, float3 direction, unsigned triangle) {
    Corners corners = positions_of(params, triangle);
    double3 a = wide(corners.a);
    return dot(cross(wide(corners.b) - a, wide(corners.c) - a), wide(direction)) < 0.0;
}
DEVICE bool is_solid(const Params &params, unsigned triangle) {
    return params.bodies[__ldg(params.materials + triangle)].shape == SHAPE_SOLID;
}

// The media at the start of a line of which all crossings are known, in their order: a body that is left without having been entered
// holds the start, the one left first innermost. `material` and `enters` are asked by the number of the crossing; `counts` tells
// which of them are crossings of bodies.
template <class Counts, class Material, class Enters>
DEVICE Media media_at_start(const Params &params, unsigned crossings, Counts &&counts, Material &&material, Enters &&enters) {
    Media media = no_media();
    for (unsigned last = crossings; last-- > 0;) {
        if (!counts(last) || enters(last)) continue;
        // Whether one of the same body before it was entered and not left.
        unsigned body = material(last), inside = 0;
        for (unsigned i = 0; i < last; ++i) {
            if (!counts(i) || material(i) != body) continue;
            inside = enters(i) ? inside + 1 : inside > 0 ? inside - 1 : 0;
        }
        bool fills, overflows;
        if (inside == 0) media = with_body(params, media, body, fills, overflows);
    }
    return media;
}

// Finds the bodies that the camera is in: those that a line from it leaves without having entered them (`eye.rs`).
template <class Tracer> DEVICE void find_bodies_around_eye(Pass<Tracer> &pass) {
    const Params &params = pass.params;
    constexpr unsigned MOST_STEPS = 4096, MOST_KEPT = 64;
    unsigned materials[MOST_KEPT], kept = 0;
    bool entered[MOST_KEPT];
    float3 direction = normalize_or(vec3(0.352071f, 0.631593f, 0.690733f), splat(0.0f)), origin = pass.eye();
    for (unsigned step = 0; step < MOST_STEPS; ++step) {
        Hit hit;
        if (!pass.closest_or_sky(origin, direction, hit)) break;
        Surface surface = surface_hit(params, OF_SPHERES(origin, ) direction, hit, NO_FOOTPRINT);
        if (is_solid(params, hit.triangle)) {
            unsigned material = __ldg(params.materials + hit.triangle);
            bool enters = is_front(surface);
            // A body that is entered and left at once holds nothing.
            if (kept > 0 && !enters && entered[kept - 1] && materials[kept - 1] == material) {
                kept -= 1;
            } else if (kept < MOST_KEPT) {
                materials[kept] = material;
                entered[kept++] = enters;
            } else {
                pass.rays.lost += 1;
            }
        }
        origin = spawn(surface.point, direction);
    }
    *(Media *)params.around_eye = media_at_start(
        params, kept, [](unsigned) { return true; }, [&](unsigned i) { return materials[i]; },
        [&](unsigned i) { return entered[i]; });
}

// The share of the light along a ray that passes these surfaces of glass, by colour, though they bend nothing (`shadow.rs`).
template <class Tracer> static __device__ OUTLINED float3 straight_through(Pass<Tracer> &pass, const Ray &ray, Crossings &crossings) {
    const Params &params = pass.params;
    float3 direction = ray.direction;
    constexpr float ROUNDING = 16.0f * UNIT_ROUNDOFF;
    auto material = [&](unsigned i) { return __ldg(params.materials + crossings.met[i].triangle); };
    auto enters = [&](unsigned i) {
        OF_SPHERES(const Hit &hit = crossings.met[i];
                   if (is_sphere(params, hit.triangle)) return dot(sphere_normal(params, crossings, direction, hit), direction) < 0.0f;)
        return line_enters(params, direction, crossings.met[i].triangle);
    };
    unsigned kept = 0;
    for (unsigned i = 0; i < crossings.stored; ++i) {
        if (kept > 0) {
            float t = crossings.met[i].t;
            bool same = t - crossings.met[kept - 1].t <= ROUNDING * t && material(i) == material(kept - 1) &&
                        enters(i) == enters(kept - 1);
            if (same) continue;
        }
        crossings.met[kept++] = crossings.met[i];
    }
    pass.rays.lost += crossings.beyond > 0;
    Media media = media_at_start(
        params, kept, [&](unsigned i) { return is_solid(params, crossings.met[i].triangle); }, material, enters);
    float3 passes = splat(1.0f);
    float from = 0.0f;
    for (unsigned i = 0; i < kept; ++i) {
        const Hit &hit = crossings.met[i];
        passes = passes * transmittance(extinction_in(params, media), hit.t - from);
        from = hit.t;
        const Body &body = params.bodies[material(i)];
#ifdef CURITIBA_SPHERES
        float3 normal = is_sphere(params, hit.triangle) ? sphere_normal(params, crossings, direction, hit)
                                                        : normalize_or_zero(normal_at(params, hit));
        float cosine = fabsf(dot(normal, direction));
#else
        float cosine = fabsf(dot(normalize_or_zero(normal_at(params, hit)), direction));
#endif
        if (body.shape == SHAPE_SOLID) {
            Border border = cross_border(params, media, material(i), enters(i));
            pass.rays.lost += border.overflows;
            media = border.after;
            if (border.is_surface) {
                Interface face = face_at(params, OF_WAYS(material(i), ) cosine, fmaxf(border.ratio, 1.0f / border.ratio));
                passes = passes * ((1.0f - face.reflectance) * filter_of(params, body, hit, NO_FOOTPRINT));
            }
        } else if (body.shape == SHAPE_THIN) {
            float ratio = body.index / index_in(params, media);
            Interface face = face_at(params, OF_WAYS(material(i), ) cosine, fmaxf(ratio, 1.0f / ratio));
            passes = passes * (wall_of(face.reflectance, kept_across(body, face.cos_refracted)).transmitted * filter_of(params, body, hit, NO_FOOTPRINT));
        } else {
            passes = passes * THROUGH_GLASS;
        }
    }
    return passes * transmittance(extinction_in(params, media), ray.t_max - from);
}

#ifdef CURITIBA_SPHERES
// The share of light that comes along a ray, by colour, as if the sphere `without` were not there.
template <class Tracer> DEVICE float3 straight_along(Pass<Tracer> &pass, const Ray &ray, unsigned without) {
    Crossings crossings;
    crossings.stored = crossings.beyond = 0;
    crossings.origin = ray.origin;
    crossings.without = without;
    if (pass.tracer.template occluded<ACCEPT_COUNTS>(ray, &crossings)) return splat(0.0f);
    return straight_through(pass, ray, crossings);
}
#endif

// What reaches an origin off its surface of the light.
template <class Tracer> DEVICE float3 light_through_bodies(Pass<Tracer> &pass, float3 origin) {
    if ((pass.params.asks & ASKS_STRAIGHT) == 0u) return splat(pass.light_at(origin));
    Crossings crossings;
    crossings.stored = crossings.beyond = 0;
    OF_SPHERES(crossings.origin = origin; crossings.without = NO_TRIANGLE;)
    Ray ray = {origin, pass.to_light(), 0.0f, pass.light_end()};
    if (pass.tracer.template occluded<ACCEPT_COUNTS>(ray, &crossings)) return splat(in_shadow(pass.params));
    return splat(in_shadow(pass.params)) + (1.0f - in_shadow(pass.params)) * straight_through(pass, ray, crossings);
}
