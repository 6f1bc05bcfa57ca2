// `final` in corrected fidelity on our own traversal, as kernels one after the other: glass is followed to the surfaces that are
// seen through it, which go to a list with those seen directly; then one thread a surface traces its shadow ray, one warp
// looks at what is near 32 surfaces, several trace the rays that are left of their occlusion; then each pixel sums its own. So
// threads do the same at the same time, whatever glass is seen, and each kernel has the registers that it needs. The light of several
// lights, the light of discs and the light that glass focuses are found when a surface is listed.
//
// A pixel whose surfaces do not fit into the list is computed by one thread from begin to end, with the same result.
#pragma once
#include "count_open.cuh"
#include "final.cuh"

// Four vectors a surface.
struct ListedSurface {
    float4 start;  // where its rays start, but for the step off the surface; the step, negative if it is turned from the light
    float4 facing; // and the key of its random numbers
    float4 normal; // and its weight
    float4 color;  // and the next surface of the pixel
};
static_assert(sizeof(ListedSurface) == SURFACE_BYTES, "ListedSurface");

// The first surface of a pixel: none, or too many for the list.
constexpr unsigned NO_SURFACE = ~0u, NO_ROOM = ~0u - 1u;

DEVICE ListedSurface *listed(const Params &params) { return (ListedSurface *)params.surfaces; }
// The first of the next 32 surfaces, for a warp; false when none is left.
DEVICE bool next_surfaces(const Params &params, Progress which, unsigned lane, unsigned &index, bool &here) {
    unsigned count = min(params.progress[FOUND], (unsigned)params.capacity), first = 0;
    if (lane == 0) first = atomicAdd(params.progress + which, 32u);
    first = __shfl_sync(WHOLE_WARP, first, 0);
    index = first + lane;
    here = index < count;
    return first < count;
}

// All threads of a warp call it. What they find together has 32 places of its own, so that the same surfaces are together again
// in a warp of the other kernels, however the warps of this one take turns.
DEVICE void list_surfaces(Pass<Bvh> &pass) {
    const Params &params = pass.params;
    unsigned lane = lane_of_thread(), head = NO_SURFACE, last = NO_SURFACE;
    PixelSurfaces surfaces;
    surfaces.begin(pass);
    while (true) {
        surfaces.advance(pass);
        if (!pass.tracer.any(surfaces.here)) break;
        float3 color = splat(0.0f);
        float weight = 0.0f;
        if (surfaces.here) {
            color = surfaces.color;
            weight = weigh(surfaces.end, color);
        }
        // Black stays black, without a ray.
        bool wanted = surfaces.here && head != NO_ROOM && !is_black(color);
        surfaces.here = false;
#ifdef CURITIBA_BODIES
        // A sky is not lit: its colour is added now.
        if (wanted && is_sky(params, surfaces.triangle)) {
            surfaces.walk.missed = surfaces.walk.missed + color;
            wanted = false;
        }
#endif
        unsigned mask = __ballot_sync(WHOLE_WARP, wanted), first = 0;
        if (mask == 0) continue;
        if (lane == 0) first = atomicAdd(params.progress + FOUND, 32u);
        first = __shfl_sync(WHOLE_WARP, first, 0);
        unsigned below = __popc(mask & ((1u << lane) - 1u));
        bool room = first < params.capacity;
        if (!wanted) {
            // Black is left alone.
            unsigned unused = first + __popc(mask) + lane - below;
            if (room) listed(params)[unused].color = make_float4(0.0f, 0.0f, 0.0f, __uint_as_float(NO_SURFACE));
            continue;
        }
        unsigned place = first + below;
        if (!room) {
            // What was listed of it counts no more.
            for (unsigned i = head; i != NO_SURFACE; i = __float_as_uint(listed(params)[i].color.w)) {
                listed(params)[i].color = make_float4(0.0f, 0.0f, 0.0f, listed(params)[i].color.w);
            }
            head = NO_ROOM;
            surfaces.glass = false;
            continue;
        }
        const End &end = surfaces.end;
        const Surface &surface = end.surface;
        float step = OFFSET_UNITS * surface.point.error;
#ifdef CURITIBA_LIGHTS
        // The light of several lights is found now.
        bool turned = false;
        Share light = light_share(pass, surfaces.triangle, surface, surfaces.lit_side);
        OF_SPHERES(light = light + surfaces.focused(pass, color);)
        color = color * light;
#else
        bool turned = is_turned(params, surfaces.triangle, surface.point, surfaces.lit_side, pass.to_light());
#ifdef CURITIBA_SPHERES
        // Where glass focuses light, all of the light is found now: what is left of it will be halved.
        if (params.asks & ASKS_FOCUSED) {
            Share light = light_share(pass, surfaces.triangle, surface, surfaces.lit_side) + surfaces.focused(pass, color);
            color = color * light * (1.0f / SHADOWED);
            turned = true;
        } else
#endif
        // Light on turned sides, which few have, is found now: what is left of it will be halved.
        if (turned) color = color * turned_share(pass, surfaces.triangle, surface, surfaces.lit_side) * (1.0f / SHADOWED);
#endif
        float3 start = surface.point.start, facing = surface.facing, normal = surface.normal;
        listed(params)[place] = {make_float4(start.x, start.y, start.z, turned ? -step : step),
                                 make_float4(facing.x, facing.y, facing.z, __uint_as_float(end.key)),
                                 make_float4(normal.x, normal.y, normal.z, weight),
                                 make_float4(color.x, color.y, color.z, __uint_as_float(NO_SURFACE))};
        if (head == NO_SURFACE) {
            head = place;
        } else {
            listed(params)[last].color.w = __uint_as_float(place);
        }
        last = place;
    }
#ifdef CURITIBA_BODIES
    if (pass.inside) params.output[pass.pixel.index] = shown(surfaces.walk, missed_by(surfaces.walk));
#endif
    if (head == NO_ROOM) pass.rays = {};
    if (pass.inside) params.first_surface[pass.pixel.index] = head;
}

#ifndef CURITIBA_LIGHTS
// Multiplies the colours of listed surfaces by what reaches them of the light.
DEVICE void light_surfaces(Pass<Bvh> &pass) {
    const Params &params = pass.params;
    unsigned index;
    bool here;
    while (next_surfaces(params, LIT, lane_of_thread(), index, here)) {
        if (!here) continue;
        float4 color = listed(params)[index].color;
        float4 start = listed(params)[index].start, facing = listed(params)[index].facing;
        if (is_black(xyz(color))) continue;
        Share light = share_of(SHADOWED);
        if (!signbit(start.w)) {
            pass.rays.shadow += 1;
            float3 to_light = pass.to_light();
            float step = dot(xyz(facing), to_light) < 0.0f ? -start.w : start.w;
            light = light_from(pass, xyz(start) + xyz(facing) * step);
        }
        float3 lit = xyz(color) * light;
        listed(params)[index].color = make_float4(lit.x, lit.y, lit.z, color.w);
    }
}
#endif

// The occlusion rays of a listed surface; false where there are none.
DEVICE bool listed_fan(const Params &params, unsigned index, bool here, Fan &fan, float3 &lit) {
    lit = splat(0.0f);
    if (!here) return false;
    const ListedSurface &surface = listed(params)[index];
    float4 start = surface.start, facing = surface.facing;
    lit = xyz(surface.color);
    fan = {xyz(start) + xyz(facing) * fabsf(start.w), xyz(facing), xyz(surface.normal), __float_as_uint(facing.w)};
    return params.samples != 0 && !is_black(lit);
}

// Writes what is near listed surfaces.
DEVICE void settle_surfaces(Pass<Bvh> &pass) {
    __shared__ SettlingMemory memory;
    const Params &params = pass.params;
    unsigned index, lane = lane_of_thread();
    bool here;
    while (next_surfaces(params, NEAR, lane, index, here)) {
        Fan fan;
        float3 lit;
        bool wanted = listed_fan(params, index, here, fan, lit);
        Settled found = settle<ACCEPT_STOPS>(params, wanted, fan, params.samples, memory, lane, pass.rays);
        keep(params, here, index, found, index / 32, lane);
    }
}

// Traces the rays of listed surfaces of which what is near does not tell.
DEVICE void trace_listed(const Params &params) {
    trace_unsettled<ACCEPT_STOPS>(params, [&](unsigned group, unsigned &index, Fan &fan) {
        index = 32 * group + lane_of_thread();
        float3 lit;
        return listed_fan(params, index, index < min(params.progress[FOUND], (unsigned)params.capacity), fan, lit);
    });
}

// The sum of a pixel's surfaces.
DEVICE float4 sum_surfaces(Pass<Bvh> &pass) {
    const Params &params = pass.params;
    unsigned surface = pass.inside ? params.first_surface[pass.pixel.index] : NO_SURFACE;
    bool seen = pass.triangle() != NO_TRIANGLE, no_room = surface == NO_ROOM;
    float4 result;
    if (pass.tracer.any(no_room)) {
        bool inside = pass.inside;
        pass.inside = no_room;
        result = corrected(pass);
        pass.inside = inside;
    }
    if (no_room) return result;
    if (!seen) return pass.color();
    float3 sum = splat(0.0f);
    while (surface != NO_SURFACE) {
        Fan fan;
        float3 lit;
        float share = 1.0f;
        if (listed_fan(params, surface, true, fan, lit)) {
            // Where rays are few, nobody looked at what is near them.
            unsigned open = params.settled != nullptr
                                ? settled(params)[surface].open
                                : count_open_alone<ACCEPT_STOPS>(pass.tracer, fan, params.samples, pass.rays);
            share = params.open_share[open];
        }
        sum = sum + listed(params)[surface].normal.w * (lit * share);
        surface = __float_as_uint(listed(params)[surface].color.w);
    }
#ifdef CURITIBA_BODIES
    float4 missed = params.output[pass.pixel.index];
    sum = sum + xyz(missed);
    return make_float4(sum.x, sum.y, sum.z, missed.w);
#else
    return opaque(sum);
#endif
}
