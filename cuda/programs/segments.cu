// Whether anything is in the way of segments between triangles: `SegmentTracer` of `passes/src/trace/segments.rs`, on our own traversal and,
// with CURITIBA_OPTIX, on OptiX. A segment's own two triangles do not block, nor do those of materials that are not opaque.
#ifdef CURITIBA_OPTIX
#include "trace_optix.cuh"
#else
#include "trace_bvh.cuh"
#endif

// Two vectors a segment: where it starts and how long it is; its direction and its pair.
DEVICE Ray segment_at(const Params &params, unsigned long long index, uint2 &own) {
    float4 from = __ldg(params.segments + 2 * index), along = __ldg(params.segments + 2 * index + 1);
    own = __ldg(params.own + __float_as_uint(along.w));
    return {xyz(from), xyz(along), 0.0f, from.w};
}

#ifndef CURITIBA_OPTIX

extern "C" __global__ void __launch_bounds__(SEGMENT_THREADS) segments(const __grid_constant__ Params params) {
    unsigned long long index = (unsigned long long)blockIdx.x * SEGMENT_THREADS + threadIdx.x;
    bool blocked = false;
    if (index < params.segment_count) {
        uint2 own;
        Ray ray = segment_at(params, index, own);
        Query query;
        if (prepare(ray, query)) {
            float limit = query.t_max;
            Bvh{params}.walk(query, limit, [&](const Hit &hit, bool see_through) {
                blocked = hit.t < query.t_max && !see_through && hit.triangle != own.x && hit.triangle != own.y;
                return blocked;
            });
        }
    }
    unsigned word = __ballot_sync(WHOLE_WARP, blocked);
    if (threadIdx.x % 32u == 0u && index < params.segment_count) params.blocked[index / 32] = word;
}

#else

extern "C" __global__ void __raygen__segments() {
    unsigned long long index = launch_x();
    uint2 own;
    Ray ray = segment_at(params, index, own);
    // Payloads 1 and 2: the triangles that do not block. Nothing but the miss program writes payload 0.
    unsigned p[PAYLOADS] = {0, own.x, own.y, 0, 0, 0};
    trace(params.handle, ray, RADIANCE, RAY_TERMINATE_ON_FIRST_HIT | RAY_DISABLE_CLOSEST_HIT, p);
    if (p[0] != NO_TRIANGLE) atomicOr(params.blocked + index / 32, 1u << index % 32);
}
// On opaque materials.
extern "C" __global__ void __anyhit__other() {
    Hit hit = current_hit();
    if (hit.triangle == payload<1>() || hit.triangle == payload<2>()) ignore_intersection();
}
// On the others.
extern "C" __global__ void __anyhit__see_through() { ignore_intersection(); }
extern "C" __global__ void __miss__segments() { report_miss(); }
extern "C" __global__ void __exception__exception() { params.ray_counts[EXCEPTION_SLOT] = exception_code(); }

#endif
