// How many rays of a fan are open, on our own traversal. The threads of a warp work together.
#pragma once
#include "nearby.cuh"

// What a warp has in shared memory: its fans, where their rays are traced the order of those, and what is near.
struct WarpMemory {
    Fan fans[32];
    unsigned from[32]; // the nodes below which all lies that the fans may meet
    unsigned open[32];
    unsigned char order[32];
    Nearby nearby;
};

// Points no farther apart than this part of the radius have much the same around them.
constexpr float CLOSE = 0.25f;

// Traces the rays of some fans of a warp, dealt to its threads so that those which are traced together go the same way. From
// points close to each other these are rays to the same part of the hemisphere, first of every fan to one, then to the next;
// else those of one fan side by side.
template <Accept ACCEPT>
DEVICE unsigned count_traced(const Bvh &tracer, bool traces, unsigned samples, WarpMemory &memory, unsigned lane) {
    unsigned mask = __ballot_sync(WHOLE_WARP, traces), fans = __popc(mask), total = fans * samples;
    if (mask == 0) return 0;
    if (traces) memory.order[__popc(mask & ((1u << lane) - 1u))] = (unsigned char)lane;
    memory.open[lane] = 0;
    const Params &params = tracer.params;
    float3 origin = memory.fans[traces ? lane : (unsigned)__ffs(mask) - 1u].origin;
    bool close = largest(most_of_warp(origin) - least_of_warp(origin)) <= CLOSE * params.radius;
    __syncwarp();
    for (unsigned index = lane; index < total; index += 32u) {
        unsigned per = close ? fans : samples, major = index / per, minor = index - major * per;
        unsigned owner = memory.order[close ? minor : major];
        const Fan &fan = memory.fans[owner];
        Ray ray;
        fan.ray(params, close ? fan.sample_of(params, major) : fan.neighbour(params, minor), ray);
        if (!tracer.occluded<ACCEPT>(ray, nullptr, memory.from[owner])) atomicAdd(memory.open + owner, 1u);
    }
    __syncwarp();
    return traces ? memory.open[lane] : 0u;
}

template <Accept ACCEPT>
__device__ __forceinline__ unsigned Bvh::count_open(bool wanted, const Fan &fan, unsigned samples, RayCounts &rays) const {
    __shared__ WarpMemory memories[BLOCK_WIDTH * BLOCK_HEIGHT / 32];
    unsigned thread = threadIdx.y * BLOCK_WIDTH + threadIdx.x, lane = thread % 32u;
    WarpMemory &memory = memories[thread / 32u];
    Nearby &nearby = memory.nearby;
    // In shared memory, where all threads read a fan, and no registers are held.
    if (wanted) memory.fans[lane] = fan;
    memory.from[lane] = 0;
    __syncwarp();
    unsigned open = 0;
    bool certain = wanted && params.node_count == 0, traces = wanted && !certain;
    unsigned left = samples < FEW_SAMPLES ? 0u : __ballot_sync(WHOLE_WARP, traces);
    while (left != 0) {
        // Points near one of them, and that one.
        int leader = __ffs(left) - 1;
        bool candidate = left >> lane & 1u;
        float3 to = memory.fans[candidate ? lane : leader].origin - memory.fans[leader].origin;
        float apart = NEIGHBOURS * params.radius;
        Zone own;
        bool bounded = zone_of(params, memory.fans[candidate ? lane : leader], own);
        bool member = candidate && ((int)lane == leader || (bounded && dot(to, to) <= apart * apart));
        unsigned members = __ballot_sync(WHOLE_WARP, member);
        left &= ~members;
        // The rays of a point of which no bounds are known are traced.
        if (!__shfl_sync(WHOLE_WARP, (int)bounded, leader)) continue;
        Zone zone = zone_of_members(member, members, own, memory.fans[leader].facing);
        unsigned from;
        int gathered = gather(params, zone, nearby, lane, from);
        if (gathered < 0) {
            if (member) memory.from[lane] = from;
            if (member && is_clear(params, own, from)) {
                certain = true;
                traces = false;
            }
            __syncwarp();
            continue;
        }
        if (member) traces = false;
        if (gathered == 0) {
            certain = certain || member;
            continue;
        }
        for (; members != 0; members &= members - 1) {
            unsigned owner = __ffs(members) - 1, sum = 0, found = 0;
            for (unsigned first = 0; first < samples && found < TOO_LONG; first += 128u) {
                unsigned count = min(samples - first, 128u);
                found = open_of<ACCEPT>(params, memory.fans[owner], first, count, nearby, gathered, lane);
                sum += found;
            }
            if (lane == owner) {
                certain = found == NOTHING_SEEN;
                traces = found == TOO_LONG;
                open = sum;
            }
        }
    }
    if (certain) {
        rays.certain += samples;
        open = samples;
    } else if (wanted) {
        rays.occlusion += samples;
    }
    unsigned traced = count_traced<ACCEPT>(*this, traces, samples, memory, lane);
    return traces ? traced : open;
}
