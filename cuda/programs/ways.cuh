// Paths through glass that may be rough, bend colours apart, have a reflectance of its own, or be cut off (`walk.rs`, `solid.rs`, `facets.rs`
// and `limits.rs` of `effects/dielectric`).
//
// As in `bodies.cuh`, the tree of rays is walked with a list of the branches still to be traced. Where a surface divides a path, into the ways
// on from rough glass or into strata of the spectrum, the meeting is kept, and its ways are taken one after the other: the next when all
// branches of the one before are traced. A path is divided once by each, so two meetings are kept at most.
#pragma once
#include "bodies.cuh"

// Stands for the stratum and the way of a path that was not divided.
constexpr unsigned NO_WAY = ~0u;

// A microfacet of a rough interface, as it is seen (`facets.rs`, which gives the sources).
struct Microfacet {
    float3 normal, surface;
    float alpha, viewer;
};
// Smith's auxiliary function of GGX for a direction of this cosine with the normal.
DEVICE float smith(float alpha, float cosine) {
    cosine = fminf(fmaxf(cosine, 1e-6f), 1.0f);
    float slope = alpha * alpha * (1.0f - cosine * cosine) / (cosine * cosine);
    return 0.5f * slope / (sqrtf(1.0f + slope) + 1.0f);
}
// That of a point of the unit square, by the distribution of visible normals.
DEVICE Microfacet facet_seen(float alpha, float3 normal, float3 view, float2 point) {
    Basis basis = basis_around(normal);
    float3 back = -view, up = vec3(0.0f, 0.0f, 1.0f);
    float3 viewer = vec3(dot(back, basis.tangent), dot(back, basis.bitangent), fmaxf(dot(back, normal), 0.0f));
    float3 stretched = normalize_or(vec3(alpha * viewer.x, alpha * viewer.y, viewer.z), up);
    float2 disk = concentric_disk(point);
    float height = 1.0f + stretched.z;
    float depth = (disk.x * disk.x + disk.y * disk.y) * height;
    float stretch = sqrtf(height * fmaxf(2.0f - depth, 0.0f));
    float3 half_vector = vec3(disk.x * stretch, disk.y * stretch, 1.0f - depth) + stretched;
    float3 local = normalize_or(vec3(alpha * half_vector.x, alpha * half_vector.y, fmaxf(half_vector.z, 0.0f)), up);
    float3 facet = to_world(basis, local);
    return {facet * length_recip(facet), normal, alpha, smith(alpha, viewer.z)};
}
// The share of what it sends in this unit direction, to either side, that no other facet stops.
DEVICE float passes_facets(const Microfacet &facet, float3 direction) {
    return (1.0f + facet.viewer) / (1.0f + facet.viewer + smith(facet.alpha, fabsf(dot(direction, facet.surface))));
}

DEVICE float greatest(float3 v) { return fmaxf(v.x, fmaxf(v.y, v.z)); }

// The tree of rays of one pixel, walked from end to end.
struct WaysWalk {
    struct Path {
        Media media;
        unsigned key, surfaces, splits;
        // The stratum of its light; NO_WAY until a body has bent colours apart.
        unsigned stratum;
        // Which of the ways on from rough glass it is; NO_WAY before.
        unsigned sample;
        // The share of the pixel's colour that depends on it; larger where it is one of few that were followed by chance.
        float importance;
        unsigned reflections, refractions;
        Cone cone;
    };
    // A ray that is still to be traced; `from` is the point of the surface that it leaves, off which it starts.
    struct Branch {
        float3 origin, direction, from, weight;
        Path path;
    };
    // A path that has come to a surface.
    struct Meeting {
        Hit hit;
        Surface surface;
        float3 view, weight;
        float footprint;
        Path path;
    };
    // How a path meets a surface: for the first time, or as one way of those into which it is divided there.
    enum Part : unsigned { WHOLE, BY_FACET, BY_COLOR };
    // A meeting whose path is divided: its next way, how many there are, and how many branches waited before. Of strata, where that goes
    // what they reflect together.
    struct Division {
        Meeting at;
        float3 together;
        Part part;
        unsigned following, ways, base;
    };
    // Both ways on from the surface of a body for light of one wavelength: the share reflected, where both go, and what other facets leave
    // of them.
    struct Onward {
        float reflectance;
        float3 mirrored, refracted;
        bool enters;
        float kept_back, kept_on;
        Cone back, on;
    };

    // One branch a split may wait, one that colours share, and one that they do not.
    Branch waiting[MAX_DEPTH + 3];
    Division divisions[2];
    unsigned count = 0, divided = 0;
    Branch next;
    Meeting now;
    Part part = WHOLE;
    float3 together;
    bool follows = false, meets = false, veiled = false;
    // What the glass that was met last scatters back.
    BodyEnd veil;
    // What the background adds where rays leave the scene, or are not followed.
    float3 missed = {0.0f, 0.0f, 0.0f};
    // Of a sample (`Sample` of `ways.rs`): the number of the first way, how many ways a path is divided into, and the events that it met
    // (MET_CHANCE, MET_DIVIDED).
    unsigned first = 0, taken = 1, met = 0;

    // Starts at a pixel that shows glass, of whose light the share `kept` reaches the eye.
    template <class Tracer>
    DEVICE_MEMBER void enter_pixel(Pass<Tracer> &pass, unsigned triangle, const Surface &surface, float3 view, unsigned key, float3 kept) {
        const Params &params = pass.params;
        if (ways_asked(params).samples != nullptr) {
            uint4 sample = __ldg(ways_asked(params).samples + pass.pixel.index);
            first = sample.y;
            taken = sample.z;
        }
        now.hit = located(params, triangle, xyz(pass.position()));
        now.surface = surface;
        now.view = view;
        now.weight = kept;
        now.path = {params.around_eye ? *(const Media *)params.around_eye : no_media(), key, 0, 0, NO_WAY, NO_WAY, 1.0f, 0, 0, pass.cone_at(surface)};
        now.footprint = footprint_of(params, now.path.cone, triangle, view);
        part = WHOLE;
        meets = true;
    }

    // The key of what a path meets where it ends.
    DEVICE_MEMBER unsigned own_key(const Path &path) const {
        // A path that was not divided has a key for each time that it is followed.
        unsigned way = path.sample == NO_WAY && first > 0 ? first : path.sample;
        return way == NO_WAY ? path.key : path_key(path.key, BRANCH_SCATTERED + way);
    }
    // Whether the path is a sample of some ways, and not of all.
    DEVICE_MEMBER bool is_sample(const Params &params) const { return (ways_asked(params).asks & WAYS_SAMPLED) != 0u; }
    // The number of ways on from rough glass.
    DEVICE_MEMBER unsigned facet_ways(const Params &params) const { return is_sample(params) ? taken : ways_asked(params).facet_count; }
    DEVICE_MEMBER float4 stratum_of(const Params &params, unsigned stratum) const { return __ldg(ways_asked(params).strata + stratum); }
    // The index of what fills a place, for light of a path's wavelength.
    DEVICE_MEMBER float index_for(const Params &params, unsigned body, unsigned stratum) const {
        if (body == NO_BODY) return 1.0f;
        float index = params.bodies[body].index;
        if (stratum == NO_WAY) return index;
        float wavelength = stratum_of(params, stratum).w, spread = ways_asked(params).faces[body].spread;
        return fmaxf(index + spread * (CAUCHY / (wavelength * wavelength) - CAUCHY_AT_D), 1.0f);
    }
    DEVICE_MEMBER bool disperses(const Params &params, unsigned body) const {
        return body != NO_BODY && ways_asked(params).faces[body].spread > 0.0f;
    }
    // The width of the distribution of microfacets where the path is; 0 where the surface is smooth.
    DEVICE_MEMBER float alpha_here(const Params &params, const Face &face) const {
        if (face.alpha <= 0.0f || face.roughness_texture == NO_TEXTURE OF_SPHERES(|| is_sphere(params, now.hit.triangle))) return face.alpha;
        float roughness = sample_numbers(params, face.roughness_texture, texture_coordinates(params, now.hit), now.footprint).y;
        float alpha = face.alpha * roughness * roughness;
        return alpha < SMOOTH_ALPHA ? 0.0f : alpha;
    }

    // By what a branch of this weight counts that is followed as `path`: 1, or more where it was followed by chance; 0 where chance left it
    // out, -1 where it is cut off.
    DEVICE_MEMBER float kept(const Params &params, float3 weight, unsigned kind, Path &path) {
        const Ways &ways = ways_asked(params);
        if ((ways.asks & WAYS_CUT) == 0u) return 1.0f;
        bool mirrors = kind == BRANCH_REFLECTED;
        path.reflections += mirrors;
        path.refractions += !mirrors;
        if (mirrors ? path.reflections > ways.reflections : path.refractions > ways.refractions) return -1.0f;
        // Weights of wavelengths may be negative.
        path.importance = path.importance * greatest(absolute(weight));
        if (path.importance >= ways.cutoff) return 1.0f;
        if ((ways.asks & WAYS_ROULETTE) == 0u) return -1.0f;
        if (is_sample(params)) met |= MET_CHANCE;
        float chance = path.importance / ways.cutoff;
        unsigned wavelength = path.stratum == NO_WAY ? 0u : __float_as_uint(stratum_of(params, path.stratum).w);
        unsigned key = path_key(path_key(own_key(path), wavelength), ways.chances);
        path.importance = ways.cutoff;
        return unit_of(dimensions(key, HASH_ROULETTE).x) < chance ? 1.0f / chance : 0.0f;
    }
    // The next way on; the one before waits.
    template <class Tracer>
    DEVICE_MEMBER void follow(Pass<Tracer> &pass, float3 direction, float3 weight, const Media &media, unsigned kind, unsigned deeper, Cone cone) {
        const Params &params = pass.params;
        Path path = now.path;
        path.media = media;
        path.cone = cone;
        path.surfaces += 1;
        path.splits += deeper;
        path.key = path_key(path.key, kind);
        float3 whole = now.weight * weight;
        float more = kept(params, weight, kind, path);
        if (more <= 0.0f) {
            if (more < 0.0f && (ways_asked(params).asks & WAYS_BACKGROUND) != 0u) missed = missed + whole * vector_of(params.beyond);
            return;
        }
        (kind == BRANCH_REFLECTED ? pass.rays.reflected : pass.rays.refracted) += 1;
        wait();
        next = {spawn(now.surface.point, direction), direction, now.surface.point.position, more * whole, path};
        follows = true;
    }
    DEVICE_MEMBER void wait() {
        if (follows) waiting[count++] = next;
        follows = false;
    }
    // Both ways on, or beyond the depth the one through the surface, where there is one. A way that brings nothing is not taken.
    template <class Tracer>
    DEVICE_MEMBER void split(Pass<Tracer> &pass, float3 mirrored, float3 mirrored_weight, bool enters, float3 refracted,
                             float3 refracted_weight, const Media &after, Cone back_cone, Cone on_cone) {
        bool back = !is_black(mirrored_weight), through = enters && !is_black(refracted_weight);
        unsigned deeper = back && through && splits(pass.params) ? 1 : 0;
        if (back && through && deeper == 0) {
            refracted_weight = mirrored_weight + refracted_weight;
            back = false;
        }
        if (through) follow(pass, refracted, refracted_weight, after, BRANCH_REFRACTED, deeper, on_cone);
        if (back) follow(pass, mirrored, mirrored_weight, now.path.media, BRANCH_REFLECTED, deeper, back_cone);
    }
    // Whether both ways on are followed.
    DEVICE_MEMBER bool splits(const Params &params) const { return now.path.splits < params.depth; }
    // Keeps the meeting, whose path is divided.
    DEVICE_MEMBER void divide(Part by, float3 reflected, unsigned ways) { divisions[divided++] = {now, reflected, by, 0, ways, count}; }
    DEVICE_MEMBER void divide_by_facet(const Params &params) {
        if (is_sample(params)) met |= MET_DIVIDED;
        divide(BY_FACET, splat(0.0f), facet_ways(params));
    }
    // Takes the next way of the meeting that was divided last, or leaves it behind.
    DEVICE_MEMBER void go_on(const Params &params) {
        Division &last = divisions[divided - 1];
        unsigned way = last.following++;
        if (way == last.ways) {
            divided -= 1;
            return;
        }
        now = last.at;
        part = last.part;
        together = last.together;
        meets = true;
        if (part == BY_FACET) {
            now.path.sample = first + way;
            // Cut-offs of a sample do not depend on the number of its ways.
            if (!is_sample(params)) now.path.importance = now.path.importance / (float)last.ways;
            now.weight = now.weight / (float)last.ways;
        } else if (is_sample(params)) {
            now.path.stratum = sampled_stratum(params, now.path, way);
            if (way > 0) now.path.sample = color_way(now.path, way);
        } else {
            now.path.stratum = way;
        }
    }

    // The ways of a sample at a surface that bends colours apart: light of the reference wavelength is way 0, and each further one has the
    // number `color_way` and one stratum (`sampled_spectrum` of `solid.rs`). The table of strata ends with the reference.
    DEVICE_MEMBER unsigned colors_taken(const Path &path) const { return path.sample == NO_WAY ? taken : 1u; }
    DEVICE_MEMBER unsigned color_way(const Path &path, unsigned way) const { return (path.sample == NO_WAY ? first : path.sample) + way - 1u; }
    DEVICE_MEMBER unsigned sampled_stratum(const Params &params, const Path &path, unsigned way) const {
        const Ways &ways = ways_asked(params);
        if (way == 0u) return ways.stratum_count;
        uint2 seeds = dimensions(path.key, HASH_SPECTRUM);
        unsigned place = scramble_reversed(shuffled(ways.offset + color_way(path, way), seeds.y), seeds.x);
        return (unsigned)((unsigned long long)place * ways.stratum_count >> 32);
    }
    // What light of a stratum counts; of a sample, whose path is divided into this number of colours and the reference, which has what they leave.
    DEVICE_MEMBER float3 weight_of(const Params &params, unsigned stratum, unsigned colors) const {
        unsigned count = ways_asked(params).stratum_count;
        if (!is_sample(params)) return xyz(stratum_of(params, stratum));
        float scale = (float)count / (float)colors;
        if (stratum < count) return xyz(stratum_of(params, stratum)) * scale;
        float3 rest = splat(1.0f);
        for (unsigned way = 1; way <= colors; ++way) {
            rest = rest - xyz(stratum_of(params, sampled_stratum(params, now.path, way))) * scale;
        }
        return rest;
    }

    // Whether the path meets a microfacet; then it is `facet`.
    DEVICE_MEMBER bool meets_facet(const Params &params, const Face &face, Microfacet &facet) const {
        if (now.path.sample == NO_WAY) return false;
        float alpha = alpha_here(params, face);
        if (alpha <= 0.0f) return false;
        const Ways &ways = ways_asked(params);
        uint2 seeds = dimensions(now.path.key, HASH_FACETS);
        uint2 place = is_sample(params)
                          ? reversed_sobol(shuffled(ways.offset + now.path.sample, dimensions(now.path.key, HASH_FACET_ORDER).x))
                          : __ldg(ways.facets + now.path.sample);
        float2 point = make_float2(unit_of(scramble_reversed(place.x, seeds.x)), unit_of(scramble_reversed(place.y, seeds.y)));
        facet = facet_seen(alpha, interface_normal(now.surface, now.view), now.view, point);
        return true;
    }
    // On which side of the surface a direction goes, as a whole and of the triangle; 0 where they differ.
    DEVICE_MEMBER float side_of(float3 direction) const {
        float flat = dot(direction, now.surface.facing);
        return dot(direction, interface_normal(now.surface, now.view)) * flat > 0.0f ? copysignf(1.0f, flat) : 0.0f;
    }
    // Where the surface of a body sends light; `ratio` is the index behind it over that before.
    DEVICE_MEMBER Onward onward(const Params &params, unsigned material, float ratio) const {
        float3 view = now.view, normal;
        Microfacet facet;
        bool is_rough = meets_facet(params, ways_asked(params).faces[material], facet);
        normal = is_rough ? facet.normal : interface_normal(now.surface, view);
        Interface interface = face_at(params, material, -dot(normal, view), ratio);
        float3 refracted = view;
        bool enters = refract(interface, view, normal, ratio, refracted);
        // Refracted back to the viewer's side, which a bent normal can do: the flat surface serves.
        if (!is_rough && enters && dot(refracted, now.surface.facing) >= 0.0f) {
            normal = now.surface.facing;
            interface = face_at(params, material, -dot(normal, view), ratio);
            enters = refract(interface, view, normal, ratio, refracted);
        }
        Onward on;
        on.reflectance = interface.reflectance;
        on.mirrored = reflect(view, normal);
        on.kept_back = on.kept_on = 1.0f;
        // What a facet would send to the wrong side of the surface is lost.
        if (is_rough) {
            enters = enters && side_of(refracted) < 0.0f;
            on.kept_back = side_of(on.mirrored) > 0.0f ? passes_facets(facet, on.mirrored) : 0.0f;
            on.kept_on = enters ? passes_facets(facet, refracted) : 0.0f;
        }
        on.refracted = refracted;
        on.enters = enters;
        float curvature = curvature_here(params), cosine = -dot(normal, view);
        on.back = cone_mirrored(now.path.cone, curvature, cosine);
        on.on = cone_refracted(now.path.cone, curvature, cosine, interface.cos_refracted, ratio);
        return on;
    }
    DEVICE_MEMBER float curvature_here(const Params &params) const {
        return curvature_of(params, now.hit.triangle, now.surface.facing OF_SPHERES(, now.surface.point.position));
    }

    // What light of one stratum does at the surface of a body that bends colours apart, and what its ways count there; of what enters without
    // the filter.
    struct Stratum {
        Onward on;
        float3 weight, back, through;
    };
    DEVICE_MEMBER Stratum stratum_at(const Params &params, unsigned material, const Border &border, unsigned index, unsigned colors) const {
        unsigned color = index < ways_asked(params).stratum_count ? index : NO_WAY;
        Stratum stratum;
        stratum.on = onward(params, material, index_for(params, border.behind, color) / index_for(params, border.before, color));
        stratum.weight = weight_of(params, index, colors);
        stratum.back = stratum.weight * (stratum.on.reflectance * stratum.on.kept_back) * vector_of(ways_asked(params).faces[material].mirrors);
        stratum.through = stratum.weight * ((1.0f - stratum.on.reflectance) * stratum.on.kept_on);
        return stratum;
    }
    // Takes all of them: what is reflected stays together, and waits; then each goes on by its own index. Returns the share that enters.
    template <class Tracer> DEVICE_MEMBER float3 disperse(Pass<Tracer> &pass, unsigned material, const Border &border) {
        const Params &params = pass.params;
        float3 direction = now.view, reflected = splat(0.0f), entering = reflected;
        Cone cone = now.path.cone;
        bool sampled = is_sample(params);
        unsigned colors = colors_taken(now.path), deeper = 0, strata = sampled ? colors + 1u : ways_asked(params).stratum_count;
        if (sampled) met |= MET_DIVIDED;
#pragma unroll 1
        for (unsigned i = 0; i < strata; ++i) {
            Stratum stratum = stratum_at(params, material, border, sampled ? sampled_stratum(params, now.path, i) : i, colors);
            const Onward &on = stratum.on;
            if (i == 0) {
                direction = on.mirrored;
                cone = on.back;
            }
            // Of a sample, what counts nothing is not followed.
            if (sampled && is_black(stratum.weight)) continue;
            entering = entering + stratum.weight * (1.0f - on.reflectance);
            // Beyond the depth light goes through, with the weight of both.
            bool goes_on = on.enters && !splits(params);
            if (on.enters && !goes_on && !is_black(stratum.back)) deeper = 1;
            if (equal(on.mirrored, direction) && !goes_on) reflected = reflected + stratum.back;
        }
        if (!is_black(reflected)) follow(pass, direction, reflected, now.path.media, BRANCH_REFLECTED, deeper, cone);
        wait();
        divide(BY_COLOR, direction, strata);
        return entering;
    }
    // Takes one.
    template <class Tracer> DEVICE_MEMBER void follow_stratum(Pass<Tracer> &pass, unsigned material, const Border &border, float3 filter) {
        // The division that is followed is the last one.
        Stratum stratum = stratum_at(pass.params, material, border, now.path.stratum, divisions[divided - 1].ways - 1u);
        const Onward &on = stratum.on;
        if (is_sample(pass.params)) {
            if (is_black(stratum.weight)) return;
            // Cut-offs do not depend on the number of wavelengths.
            now.path.importance = now.path.importance / greatest(absolute(stratum.weight));
        }
        bool both = splits(pass.params), goes_on = on.enters && !both;
        float3 through = stratum.through * filter;
        if (goes_on) through = stratum.back + through;
        if (on.enters) follow(pass, on.refracted, through, border.after, BRANCH_REFRACTED, both ? 1 : 0, on.on);
        // By another normal, which few surfaces have.
        bool apart = !equal(on.mirrored, together) && !goes_on;
        if (apart && !is_black(stratum.back)) follow(pass, on.mirrored, stratum.back, now.path.media, BRANCH_REFLECTED, 0, on.back);
    }

    // What glass does with the path that meets it.
    template <class Tracer> __device__ OUTLINED void meet(Pass<Tracer> &pass) {
        const Params &params = pass.params;
        if (now.path.surfaces >= MOST_SURFACES) {
            pass.rays.lost += 1;
            return;
        }
        const Ways &ways = ways_asked(params);
        unsigned material = __ldg(params.materials + now.hit.triangle);
        const Body &body = params.bodies[material];
        const Face &face = ways.faces[material];
        bool scatters = now.path.sample == NO_WAY && ways.facet_count > 0 && alpha_here(params, face) > 0.0f;
        if (body.shape != SHAPE_SOLID) {
            if (body.shape != SHAPE_THIN) return pane(pass);
            if (scatters) return divide_by_facet(params);
            return thin(pass, material);
        }
        Border border = cross_border(params, now.path.media, material, is_front(now.surface));
        // Who comes again is not lost again.
        if (part == WHOLE) pass.rays.lost += border.overflows;
        if (!border.is_surface) return follow(pass, now.view, splat(1.0f), border.after, BRANCH_REFRACTED, 0, now.path.cone);
        float3 filter = filter_of(params, body, now.hit, now.footprint);
        if (part == BY_COLOR) return follow_stratum(pass, material, border, filter);
        bool bends_apart = now.path.stratum == NO_WAY && ways.stratum_count > 0 &&
                           (disperses(params, border.before) || disperses(params, border.behind));
        float ratio = index_for(params, border.behind, now.path.stratum) / index_for(params, border.before, now.path.stratum);
        if (ratio == 1.0f && !bends_apart) {
            follow(pass, now.view, filter, border.after, BRANCH_REFRACTED, 0, now.path.cone);
            return scatter_back(params, body, splat(1.0f));
        }
        if (scatters) return divide_by_facet(params);
        if (bends_apart) return scatter_back(params, body, disperse(pass, material, border));
        Onward on = onward(params, material, ratio);
        split(pass, on.mirrored, on.reflectance * on.kept_back * vector_of(face.mirrors), on.enters, on.refracted,
              (1.0f - on.reflectance) * on.kept_on * filter, border.after, on.back, on.on);
        scatter_back(params, body, splat(1.0f - on.reflectance));
    }

    template <class Tracer> DEVICE_MEMBER void thin(Pass<Tracer> &pass, unsigned material) {
        const Params &params = pass.params;
        const Body &body = params.bodies[material];
        const Face &face = ways_asked(params).faces[material];
        float3 view = now.view, facing = now.surface.facing;
        Microfacet facet;
        bool is_rough = meets_facet(params, face, facet);
        float3 normal = is_rough ? facet.normal : interface_normal(now.surface, view);
        Interface interface = face_at(params, material, -dot(normal, view), body.index / index_for(params, top_of(now.path.media), now.path.stratum));
        Wall wall = wall_of(interface.reflectance, kept_across(body, interface.cos_refracted));
        float3 mirrored = reflect(view, normal), behind = view;
        float3 back = wall.reflected * vector_of(face.mirrors), through = wall.transmitted * filter_of(params, body, now.hit, now.footprint);
        bool stays = true, enters = true;
        if (is_rough) {
            // What passes goes as what is mirrored would behind the wall.
            float share = passes_facets(facet, mirrored);
            bool above = dot(mirrored, facet.surface) > 0.0f;
            behind = reflect(mirrored, facet.surface);
            back = back * share;
            through = through * share;
            stays = above && dot(mirrored, facing) > 0.0f;
            enters = above && dot(behind, facing) < 0.0f;
        }
        // Its two faces undo each other's bending.
        split(pass, mirrored, stays ? back : splat(0.0f), enters, behind, through, now.path.media,
              cone_mirrored(now.path.cone, curvature_here(params), -dot(normal, view)), now.path.cone);
        scatter_back(params, body, wall.transmitted);
    }

    // The report's pane: light enters it at every bounce, and those after the first dim it.
    template <class Tracer> DEVICE_MEMBER void pane(Pass<Tracer> &pass) {
        const Params &params = pass.params;
        float3 view = now.view, normal = interface_normal(now.surface, view), refracted = view;
        Interface interface = interface_at(params, -dot(normal, view), params.index);
        bool enters = refract(interface, view, normal, params.index, refracted);
        if (enters && dot(refracted, now.surface.facing) >= 0.0f) {
            normal = now.surface.facing;
            interface = interface_at(params, -dot(normal, view), params.index);
            enters = refract(interface, view, normal, params.index, refracted);
        }
        float share = now.path.surfaces > 0 ? GLASS_BOUNCE : 1.0f;
        float curvature = curvature_here(params), cosine = -dot(normal, view);
        split(pass, reflect(view, normal), splat(share * interface.reflectance), enters, refracted,
              splat(share * (1.0f - interface.reflectance)), now.path.media, cone_mirrored(now.path.cone, curvature, cosine),
              cone_refracted(now.path.cone, curvature, cosine, interface.cos_refracted, params.index));
    }

    // What a surface scatters back of the light of which it takes the share `entering`.
    DEVICE_MEMBER void scatter_back(const Params &params, const Body &body, float3 entering) {
        float scattered = veil_at(params, body, now.hit, now.footprint);
        if (scattered <= 0.0f) return;
        veil = {now.hit, now.surface, now.weight * (scattered * entering), own_key(now.path), now.footprint};
        veiled = true;
    }

    // Goes on to the next end that is not glass, or is what glass scatters back; false when there is none left.
    template <class Tracer> DEVICE_MEMBER bool advance(Pass<Tracer> &pass, BodyEnd &end) {
        const Params &params = pass.params;
        while (true) {
            if (meets) {
                meets = false;
                meet(pass);
                part = WHOLE;
            }
            if (veiled) {
                veiled = false;
                end = veil;
                return true;
            }
            if (!follows && divided > 0 && count == divisions[divided - 1].base) {
                go_on(params);
                continue;
            }
            if (!follows) {
                if (count == 0) return false;
                next = waiting[--count];
            }
            follows = false;
            float3 extinction = extinction_in(params, next.path.media);
            Hit hit;
            if (!pass.closest_or_sky(next.origin, next.direction, hit)) {
                missed = missed + next.weight * transmittance(extinction, INFINITY) * vector_of(params.beyond);
                continue;
            }
            Cone cone = cone_along(next.path.cone, hit.t);
            float footprint = footprint_of(params, cone, hit.triangle, next.direction);
            Surface met = surface_hit(params, OF_SPHERES(next.origin, ) next.direction, hit, footprint);
            float3 left = transmittance(extinction, fmaxf(dot(met.point.position - next.from, next.direction), 0.0f));
            now = {hit, met, next.direction, next.weight * left, footprint, next.path};
            now.path.cone = cone;
            if (is_glass(params, hit.triangle)) {
                now.path.importance = now.path.importance * greatest(left);
                meets = true;
                continue;
            }
            end = {hit, met, now.weight, own_key(now.path), footprint};
            return true;
        }
    }
};
// Beside the colour of a sample, what it met.
DEVICE float4 shown(const WaysWalk &walk, float3 color) { return make_float4(color.x, color.y, color.z, 1.0f + (float)walk.met); }
