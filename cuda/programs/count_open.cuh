// How many rays of a fan are open, on our own traversal. The threads of a warp work together, in two steps, which kernels of their
// own may take: what the triangles near the points say (`settle`), then the rays of which these do not (`count_traced`).
#pragma once
#include "nearby.cuh"
#include "together.cuh"

// What is known of the rays of a point before any is traced.
struct Settled {
    uint4 rays;    // where `beyond` is above 0: one bit for each sample whose ray is not stopped before
    unsigned from;  // the node below which everything lies that they may meet; SETTLED where none is to be traced
    unsigned open;  // then this many are open
    float beyond;  // nothing nearer stops those that are left
    unsigned unused;
};
static_assert(sizeof(Settled) == SETTLED_BYTES, "Settled");
constexpr unsigned SETTLED = ~0u;

// Of a point of which nothing is known: all its rays are to be traced, from the root.
DEVICE Settled nothing_settled() { return {make_uint4(0u, 0u, 0u, 0u), 0u, 0u, 0.0f, 0u}; }
// Where what is known of points is kept, for kernels that take the two steps apart.
DEVICE Settled *settled(const Params &params) { return (Settled *)params.settled; }
// What is kept of a point, if it is `wanted`. Where nobody looked at what is near, counts its rays, as that would have.
DEVICE Settled settled_at(const Params &params, bool wanted, unsigned index, RayCounts &rays) {
    Settled found = nothing_settled();
    if (params.settled == nullptr) {
        if (wanted) rays.occlusion += params.samples;
    } else if (wanted) {
        found = settled(params)[index];
    }
    return found;
}

// What a warp has in shared memory while it looks at what is near.
struct SettlingMemory {
    Fan fans[32];
    Nearby nearby;
};

// Where there is too much in reach, a list of what is nearer than a part of the radius says at least which rays are stopped there, and
// the others need not test it: most of what a ray meets is around the surface that it leaves. The parts are tried in turn, with
// lists of so many triangles at most.
constexpr unsigned REACHES = 3;
DEVICE float reach_of(const Params &params, unsigned attempt) {
    return attempt == 0 ? params.radius : params.radius * (attempt == 1 ? 0.125f : 0.04f);
}
DEVICE unsigned most_listed(unsigned attempt) { return attempt == 0 ? NEARBY : attempt == 1 ? 192 : 512; }
// That is asked of so many rays at most.
constexpr unsigned REMEMBERED = 128;

// Looks at what is near the points of a warp. Counts their rays.
template <Accept ACCEPT>
DEVICE Settled settle(const Params &params, bool wanted, const Fan &fan, unsigned samples, SettlingMemory &memory, unsigned lane,
                      RayCounts &rays) {
    Nearby &nearby = memory.nearby;
    // In shared memory, where all threads read a fan, and no registers are held.
    if (wanted) memory.fans[lane] = fan;
    __syncwarp();
    Settled settled = nothing_settled();
    bool certain = wanted && params.node_count == 0, traces = wanted && !certain;
    // Whether too much was found around a point, but nothing that it sees.
    bool asks = false;
    unsigned left = __ballot_sync(WHOLE_WARP, traces);
    while (left != 0) {
        // Points near one of them, and that one.
        int leader = __ffs(left) - 1;
        bool candidate = left >> lane & 1u;
        const Fan &own_fan = memory.fans[candidate ? lane : leader];
        float3 to = own_fan.origin - memory.fans[leader].origin;
        float apart = NEIGHBOURS * params.radius, radius = params.radius;
        bool member = candidate && ((int)lane == leader || dot(to, to) <= apart * apart);
        unsigned members = 0, from = 0;
        int gathered = -1;
#pragma unroll 1
        for (unsigned attempt = 0; attempt < REACHES && gathered < 0; ++attempt) {
            radius = reach_of(params, attempt);
            Zone own;
            bool bounded = zone_of(params, own_fan, radius, own);
            if (attempt == 0) {
                member = member && ((int)lane == leader || bounded);
                left &= ~__ballot_sync(WHOLE_WARP, member);
                // The rays of a point of which no bounds are known are traced.
                if (!__shfl_sync(WHOLE_WARP, (int)bounded, leader)) member = false;
            }
            members = __ballot_sync(WHOLE_WARP, member);
            if (members == 0) break;
            Zone zone = zone_of_members(member, members, own, memory.fans[leader].facing);
            unsigned below = from;
            gathered = gather(params, zone, nearby, most_listed(attempt), lane, below);
            if (gathered >= 0) break;
            members = 0;
            __syncwarp();
            if (attempt != 0) continue;
            from = below;
            if (member) settled.from = from;
            asks = asks || member;
            if (samples > REMEMBERED) break;
        }
        if (members == 0) {
            __syncwarp();
            continue;
        }
        bool all = radius == params.radius;
        if (gathered == 0 && all) {
            certain = certain || member;
            traces = traces && !member;
            continue;
        }
        for (; members != 0; members &= members - 1) {
            unsigned owner = __ffs(members) - 1, sum = 0, found = 0;
            uint4 open;
            for (unsigned first = 0; first < samples && found < TOO_LONG; first += 128u) {
                unsigned count = min(samples - first, 128u);
                found = open_of<ACCEPT>(params, memory.fans[owner], radius, first, count, nearby, gathered, lane, open);
                sum += found;
            }
            if (lane != owner) continue;
            if (all) {
                certain = found == NOTHING_SEEN;
                traces = found == TOO_LONG;
                settled.open = sum;
            } else if (found != TOO_LONG) {
                traces = found != 0;
                asks = found == NOTHING_SEEN;
                settled.rays = open;
                settled.beyond = radius;
            }
        }
    }
    if (asks && traces) {
        Zone zone;
        zone_of(params, memory.fans[lane], params.radius, zone);
        certain = is_clear(params, zone, settled.from);
        traces = !certain;
    }
    if (certain) {
        rays.certain += samples;
        settled.open = samples;
    } else if (wanted) {
        rays.occlusion += samples;
    }
    if (!traces) settled.from = SETTLED;
    return settled;
}

// What a warp has in shared memory while it traces rays of its fans.
struct TracingMemory {
    Fan fans[32];
    uint4 rays[32];
    unsigned from[32];
    float beyond[32];
    unsigned open[32];
    unsigned queue[64]; // rays to be traced: a fan, and 32 times a sample
    unsigned char order[32];
    Together together;
};

// Points no farther apart than this part of the radius have much the same around them.
constexpr float CLOSE = 0.25f;

// Traces the rays of some fans of a warp, dealt to its threads so that those which are traced together go the same way. From
// points close to each other these are rays to the same part of the hemisphere, first of every fan to one, then to the next;
// else those of one fan side by side.
template <Accept ACCEPT>
DEVICE unsigned count_traced(const Bvh &tracer, bool wanted, const Fan &own, const Settled &settled, unsigned samples,
                             TracingMemory &memory, unsigned lane) {
    bool traces = wanted && settled.from != SETTLED;
    unsigned mask = __ballot_sync(WHOLE_WARP, traces), fans = __popc(mask), total = fans * samples;
    if (mask == 0) return settled.open;
    if (traces) {
        memory.fans[lane] = own;
        memory.rays[lane] = settled.rays;
        memory.from[lane] = settled.from;
        memory.beyond[lane] = settled.beyond;
        memory.order[__popc(mask & ((1u << lane) - 1u))] = (unsigned char)lane;
    }
    memory.open[lane] = 0;
    __syncwarp();
    const Params &params = tracer.params;
    float3 origin = memory.fans[traces ? lane : (unsigned)__ffs(mask) - 1u].origin;
    bool close = largest(most_of_warp(origin) - least_of_warp(origin)) <= CLOSE * params.radius;
    unsigned queued = 0;
    for (unsigned first = 0; first < total; first += 32u) {
        unsigned index = first + lane, entry = 0;
        bool here = index < total;
        if (here) {
            unsigned per = close ? fans : samples, major = index / per, minor = index - major * per;
            unsigned owner = memory.order[close ? minor : major];
            unsigned sample = close ? memory.fans[owner].sample_of(params, major) : memory.fans[owner].neighbour(params, minor);
            entry = owner | sample << 5;
            if (memory.beyond[owner] > 0.0f) {
                here = ((const unsigned *)(memory.rays + owner))[sample >> 5] >> (sample & 31u) & 1u;
            }
        }
        mask = __ballot_sync(WHOLE_WARP, here);
        if (here) memory.queue[queued + __popc(mask & ((1u << lane) - 1u))] = entry;
        queued += __popc(mask);
        __syncwarp();
        // Whole warps, and at the end what is left.
        while (queued >= 32u || (queued > 0 && first + 32u >= total)) {
            bool traced = lane < queued;
            entry = traced ? memory.queue[lane] : 0u;
            unsigned owner = entry & 31u;
            Ray ray;
            if (traced) memory.fans[owner].ray(params, entry >> 5, ray);
            bool blocked = occluded_together<ACCEPT>(params, traced, ray, memory.from[owner], memory.beyond[owner],
                                                     memory.together, lane);
            if (traced && !blocked) atomicAdd(memory.open + owner, 1u);
            __syncwarp();
            queued -= min(queued, 32u);
            if (lane < queued) memory.queue[lane] = memory.queue[32u + lane];
            __syncwarp();
        }
    }
    return traces ? memory.open[lane] : settled.open;
}

template <Accept ACCEPT>
__device__ __forceinline__ unsigned Bvh::count_open(bool wanted, const Fan &fan, unsigned samples, RayCounts &rays) const {
    __shared__ SettlingMemory settling[BLOCK_WIDTH * BLOCK_HEIGHT / 32];
    __shared__ TracingMemory tracing[BLOCK_WIDTH * BLOCK_HEIGHT / 32];
    unsigned lane = lane_of_thread(), warp = warp_of_thread();
    Settled settled = settle<ACCEPT>(params, wanted, fan, samples, settling[warp], lane, rays);
    return count_traced<ACCEPT>(*this, wanted, fan, settled, samples, tracing[warp], lane);
}
