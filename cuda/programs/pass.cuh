// A pixel of a pass, the counts of its rays, and the rays that only ask whether something is in the way
// (`effects/occlusion.rs`). Generic over the tracer, which has
//   bool closest<Accept>(ray, hit)          the nearest accepted hit; of several at one distance, the lowest triangle
//   bool occluded<Accept>(ray, crossings)   whether any accepted hit exists
//   int gather(origin, normal, t_max, list) how many triangles a ray to the normal's side may meet; below 0: unknown
//   bool blocked_by<Accept>(ray, list, count) whether any of them stops a ray
#pragma once
#include "surface.cuh"

struct RayCounts {
    unsigned shadow, occlusion, reflected, refracted, certain;
};

struct Pixel {
    unsigned x, y, index;
};

template <class Tracer> struct Pass {
    const Params &params;
    const Tracer &tracer;
    Pixel pixel;
    RayCounts rays;

    __device__ __forceinline__ float4 position() const { return params.position[pixel.index]; }
    __device__ __forceinline__ float3 normal() const { return xyz(params.normal[pixel.index]); }
    __device__ __forceinline__ float4 color() const { return params.color[pixel.index]; }
    __device__ __forceinline__ unsigned triangle() const { return params.triangle[pixel.index]; }
    __device__ __forceinline__ float3 eye() const { return vec3(params.eye[0], params.eye[1], params.eye[2]); }
    __device__ __forceinline__ float3 to_light() const {
        return vec3(params.to_light[0], params.to_light[1], params.to_light[2]);
    }

    // The point of a triangle that the pixel shows, and the unit direction in which it is seen.
    __device__ __forceinline__ Surface surface_at(unsigned triangle, float3 normal, float3 &view) const {
        SurfacePoint point = snap(params, triangle, xyz(position()));
        view = normalize_or(point.position - eye(), -point.normal);
        return surface_of(point, normal, view);
    }
    // The nearest surface from an origin that lies off its own.
    __device__ __forceinline__ bool closest(float3 origin, float3 direction, Hit &hit) const {
        return tracer.template closest<ACCEPT_COVERED>({origin, direction, 0.0f, INFINITY}, hit);
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

    // The share of the cosine-weighted hemisphere that is open within the radius, to the power of the intensity.
    template <Accept ACCEPT> __device__ __forceinline__ float occlusion(const Surface &surface, unsigned key) {
        unsigned samples = params.samples;
        if (samples == 0) return 1.0f;
        float3 origin = spawn(surface.point, surface.facing);
        unsigned near[GATHERED];
        int count = tracer.gather(origin, surface.facing, params.radius, near);
        if (count == 0) {
            rays.certain += samples;
            return 1.0f;
        }
        rays.occlusion += samples;
        Basis basis = basis_around(surface.normal);
        uint2 seeds = dimensions(key, HASH_SCRAMBLE);
        unsigned open = 0;
        for (unsigned i = 0; i < samples; ++i) {
            float2 point;
            if (params.strata == 0) {
                uint2 sobol = __ldg(params.sobol + i);
                point.x = unit_of(scramble_reversed(sobol.x, seeds.x));
                point.y = unit_of(scramble_reversed(sobol.y, seeds.y));
            } else {
                constexpr float ONE_BELOW = 1.0f - UNIT_ROUNDOFF;
                uint2 jitter = dimensions(key, i);
                float width = 1.0f / (float)params.strata;
                unsigned row = i / params.strata, column = i - row * params.strata;
                point.x = fminf(((float)row + unit_of(jitter.x)) * width, ONE_BELOW);
                point.y = fminf(((float)column + unit_of(jitter.y)) * width, ONE_BELOW);
            }
            float3 direction = to_world(basis, cosine_direction(point));
            float below = fminf(dot(direction, surface.facing), 0.0f);
            direction = direction - 2.0f * below * surface.facing;
            Ray ray = {origin, direction, 0.0f, params.radius};
            open += !(count > 0 ? tracer.template blocked_by<ACCEPT>(ray, near, count)
                                : tracer.template occluded<ACCEPT>(ray, nullptr));
        }
        return params.open_share[open];
    }
    template <Accept ACCEPT> __device__ __forceinline__ float thesis_occlusion(float3 position, float3 normal) {
        unsigned side = params.strata;
        if (side == 0) return 1.0f;
        Basis basis = thesis_basis(normal);
        unsigned open = 0;
        for (unsigned i = 0; i < side; ++i) {
            for (unsigned j = 0; j < side; ++j) {
                float3 direction = to_world(basis, thesis_cosine(thesis_stratum(position, i, j, side)));
                if (!(is_finite(direction) && is_finite(position))) {
                    open += 1;
                    continue;
                }
                rays.occlusion += 1;
                open += !tracer.template occluded<ACCEPT>({position, direction, THESIS_EPSILON, params.radius}, nullptr);
            }
        }
        return params.open_share[open];
    }

    // What reaches a surface of the light in `final`.
    __device__ __forceinline__ float light_share(const Surface &surface, float3 facing) {
        if (dot(facing, to_light()) <= 0.0f) return SHADOWED;
        rays.shadow += 1;
        Crossings crossings;
        crossings.stored = crossings.beyond = 0;
        Ray ray = {spawn(surface.point, to_light()), to_light(), 0.0f, INFINITY};
        if (tracer.template occluded<ACCEPT_COUNTS>(ray, &crossings)) return SHADOWED;
        return params.through_glass[min(distinct(crossings), (unsigned)THROUGH_GLASS_ENTRIES - 1)];
    }
};

DEVICE float4 opaque(float3 color) { return make_float4(color.x, color.y, color.z, 1.0f); }
DEVICE float4 splat4(float s) { return make_float4(s, s, s, s); }

// Adds a pixel's rays to the sums, which are spread so that threads seldom meet.
DEVICE void count_rays(const Params &params, unsigned index, const RayCounts &rays) {
    unsigned long long *slot = params.ray_counts + (index >> 5) % RAY_COUNT_SLOTS * RAY_COUNT_KINDS;
    const unsigned counts[RAY_COUNT_KINDS] = {rays.shadow, rays.occlusion, rays.reflected, rays.refracted, rays.certain};
#pragma unroll
    for (int kind = 0; kind < RAY_COUNT_KINDS; ++kind) {
        if (counts[kind] != 0) atomicAdd(slot + kind, (unsigned long long)counts[kind]);
    }
}
