// A pixel of a pass, the counts of its rays, and the rays that only ask whether something is in the way
// (`effects/occlusion.rs`). Generic over the tracer, which has
//   bool closest<Accept>(ray, hit)          the nearest accepted hit; of several at one distance, the lowest triangle
//   bool has_sky()                          whether the scene has a sky, which no other query finds
//   bool closest_on_sky<Accept>(ray, hit)   the nearest accepted hit on it; without one, `hit` is left as it was
//   bool occluded<Accept>(ray, crossings)   whether any accepted hit exists
//   unsigned count_open<Accept>(wanted, fan, samples, rays)  how many rays of a fan nothing stops; counts the rays
//   bool any(value)                         whether it is true in any thread that works together with this one
#pragma once
#include "fan.cuh"
#include "lights.cuh"

struct RayCounts {
    unsigned shadow, occlusion, reflected, refracted, certain, lost;
};

// The row of the picture that a row of this launch is.
DEVICE unsigned picture_row(const Params &params, unsigned row) {
    return params.first_row + row + row / params.stripe * params.skipped;
}

struct Pixel {
    unsigned x, y, index;
};

#ifdef CURITIBA_WAYS
// What the pass asks of paths that are divided or cut off.
DEVICE const Ways &ways_asked(const Params &params) { return *(const Ways *)params.segments; }
#endif

// How many rays of a fan nothing stops, traced one after the other by one thread; counts them.
template <Accept ACCEPT, class Tracer, class Rays>
DEVICE unsigned count_open_alone(const Tracer &tracer, const Rays &fan, unsigned samples, RayCounts &rays) {
    unsigned open = 0;
    for (unsigned i = 0; i < samples; ++i) {
        Ray ray;
        if (!fan.ray(tracer.params, fan.sample_of(tracer.params, i), ray)) {
            open += 1;
            continue;
        }
        rays.occlusion += 1;
        open += !tracer.template occluded<ACCEPT>(ray, nullptr);
    }
    return open;
}

// The occlusion rays of a surface.
DEVICE Fan fan_of(const Surface &surface, unsigned key) {
    return {spawn(surface.point, surface.facing), surface.facing, surface.normal, key};
}

template <class Tracer> struct Pass {
    const Params &params;
    const Tracer &tracer;
    // Threads beyond the last row or column repeat a pixel, so that warps are whole; they see nothing.
    Pixel pixel;
    bool inside;
    RayCounts rays;
#ifdef CURITIBA_LIGHTS
    // The light that is looked at: the unit direction to it, and where rays to it end.
    float3 light_direction;
    float light_length;
    Shading shading;
#endif

    __device__ __forceinline__ float4 position() const { return params.position[pixel.index]; }
    __device__ __forceinline__ float3 normal() const { return xyz(params.normal[pixel.index]); }
    __device__ __forceinline__ float4 color() const { return params.color[pixel.index]; }
    __device__ __forceinline__ unsigned triangle() const { return inside ? params.triangle[pixel.index] : NO_TRIANGLE; }
    __device__ __forceinline__ float3 eye() const { return vec3(params.eye[0], params.eye[1], params.eye[2]); }
#ifdef CURITIBA_LIGHTS
    __device__ __forceinline__ float3 to_light() const { return light_direction; }
    // Where rays to the light end.
    __device__ __forceinline__ float light_end() const { return light_length; }
    // By which normal the next surface is shaded whose light is asked for.
    __device__ __forceinline__ void shaded_as_seen(float3 normal, unsigned key) {
        shading.normal = normal;
        shading.key = key;
        shading.met = false;
    }
    __device__ __forceinline__ void shaded_as_met(const Hit &hit, const Surface &surface, unsigned key) {
        shading = {surface.normal, key, true, hit};
    }
#else
    __device__ __forceinline__ float3 to_light() const {
        return vec3(params.to_light[0], params.to_light[1], params.to_light[2]);
    }
    __device__ __forceinline__ float light_end() const { return INFINITY; }
    // With one light a surface's colour says by which normal it is shaded.
    __device__ __forceinline__ void shaded_as_seen(float3, unsigned) {}
    __device__ __forceinline__ void shaded_as_met(const Hit &, const Surface &, unsigned) {}
#endif

    // The point of a triangle that the pixel shows, and the unit direction in which it is seen.
    __device__ __forceinline__ Surface surface_at(unsigned triangle, float3 normal, float3 &view) const {
        SurfacePoint point = snap(params, triangle, xyz(position()));
        view = normalize_or(point.position - eye(), -point.normal);
        return surface_of(point, normal, view);
    }
    // The cone of the pixel at the surface that it shows.
    __device__ __forceinline__ Cone cone_at(const Surface &surface) const {
        float3 to = surface.point.position - eye();
        return cone_of_pixel(params, sqrtf(dot(to, to)));
    }
    // The nearest surface from an origin that lies off its own.
    __device__ __forceinline__ bool closest(float3 origin, float3 direction, Hit &hit) const {
        return tracer.template closest<ACCEPT_COVERED>({origin, direction, 0.0f, INFINITY}, hit);
    }
    // The same of mirrors and glass, which show a sky as well; of equal distances, that of all else.
    __device__ __forceinline__ bool closest_or_sky(float3 origin, float3 direction, Hit &hit) const {
        bool found = closest(origin, direction, hit);
        if (!tracer.has_sky()) return found;
        float t_max = found ? hit.t : INFINITY;
        return tracer.template closest_on_sky<ACCEPT_COVERED>({origin, direction, 0.0f, t_max}, hit) || found;
    }
    // The first hit farther than `t_min`. A ray that is not made of numbers meets nothing.
    __device__ __forceinline__ bool thesis_closest(float3 origin, float3 direction, float t_min, Hit &hit) const {
        if (!(is_finite(origin) && is_finite(direction))) return false;
        return tracer.template closest<ACCEPT_ALL>({origin, direction, t_min, INFINITY}, hit);
    }
    template <Accept ACCEPT> __device__ __forceinline__ bool thesis_sees_light(float3 position) const {
        if (!is_finite(position)) return true;
        return !tracer.template occluded<ACCEPT>({position, to_light(), THESIS_EPSILON, INFINITY}, nullptr);
    }

    // The share of the cosine-weighted hemisphere that is open within the radius, to the power of the intensity; 1 where
    // it is not wanted. All threads of a warp call it together: they share their rays.
    template <Accept ACCEPT> __device__ __forceinline__ float occlusion(bool wanted, const Surface &surface, unsigned key) {
        unsigned samples = params.samples;
        if (samples == 0) return 1.0f;
        Fan fan;
        if (wanted) fan = fan_of(surface, key);
        unsigned open = tracer.template count_open<ACCEPT>(wanted, fan, samples, rays);
        return wanted ? params.open_share[open] : 1.0f;
    }
    template <Accept ACCEPT>
    __device__ __forceinline__ float thesis_occlusion(bool wanted, float3 position, float3 normal) {
        if (params.strata == 0) return 1.0f;
        ThesisFan fan = {position, normal};
        unsigned open = tracer.template count_open<ACCEPT>(wanted, fan, params.strata * params.strata, rays);
        return wanted ? params.open_share[open] : 1.0f;
    }

    // Where the ray to the light starts of a point whose triangle is turned away; false where it is dark without it.
    template <Accept ACCEPT>
    __device__ __forceinline__ bool lifted_origin(unsigned triangle, const SurfacePoint &point, float3 facing, float3 &origin) {
        float3 way = lifted(params, triangle, point, facing, to_light());
        if (way.x == 0.0f && way.y == 0.0f && way.z == 0.0f) return false;
        rays.shadow += 1;
        float3 start = spawn(point, facing);
        float length = sqrtf(dot(way, way));
        // What lies between the triangle and the point lets no light through.
        if (tracer.template occluded<ACCEPT>({start, way * (1.0f / length), 0.0f, length}, nullptr)) return false;
        origin = start + way;
        return true;
    }
    // What reaches an origin off its surface of the light in `final`, where each surface of glass dims it alike.
    __device__ __forceinline__ float light_at(float3 origin) const {
        Crossings crossings;
        crossings.stored = crossings.beyond = 0;
        OF_SPHERES(crossings.origin = origin; crossings.without = NO_TRIANGLE;)
        Ray ray = {origin, to_light(), 0.0f, light_end()};
        if (tracer.template occluded<ACCEPT_COUNTS>(ray, &crossings)) return in_shadow(params);
        return params.through_glass[min(distinct(crossings), (unsigned)THROUGH_GLASS_ENTRIES - 1)];
    }
};

DEVICE float4 opaque(float3 color) { return make_float4(color.x, color.y, color.z, 1.0f); }
// The key of a pixel's random numbers; of a sample of ways, that of its half.
template <class Tracer> DEVICE unsigned key_of_pixel(const Pass<Tracer> &pass) {
#ifdef CURITIBA_WAYS
    const uint4 *samples = ways_asked(pass.params).samples;
    if (samples != nullptr) return __ldg(samples + pass.pixel.index).x;
#endif
    return pixel_key(pass.pixel.x, pass.pixel.y, pass.params.seed);
}
// What a pixel shows whose glass was walked.
template <class Walk> DEVICE float4 shown(const Walk &, float3 color) { return opaque(color); }
DEVICE float4 splat4(float s) { return make_float4(s, s, s, s); }

// Adds a pixel's rays to the sums, which are spread so that threads seldom meet.
DEVICE void count_rays(const Params &params, unsigned index, const RayCounts &rays) {
    unsigned long long *slot = params.ray_counts + (index >> 5) % RAY_COUNT_SLOTS * RAY_COUNT_KINDS;
    const unsigned counts[RAY_COUNT_KINDS] = {rays.shadow,    rays.occlusion, rays.reflected,
                                              rays.refracted, rays.certain,   rays.lost};
#pragma unroll
    for (int kind = 0; kind < RAY_COUNT_KINDS; ++kind) {
        if (counts[kind] != 0) atomicAdd(slot + kind, (unsigned long long)counts[kind]);
    }
}
