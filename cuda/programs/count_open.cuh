// Counts the open rays of fans on our own traversal. The threads of a warp work together, in two steps with a kernel each: `settle` decides
// rays by the triangles near the points, `trace_shared` traces the undecided ones.
#pragma once
#include "ray_pool.cuh"

// Counters of the kernels' progress: surfaces found; next surface to be lit; next surface to be settled; groups of points with rays to
// trace; next of these groups.
enum Progress { FOUND = 0, LIT = 1, NEAR = 2, UNSETTLED = 3, TRACED = 4 };

// For settling kernels: warps on a multiprocessor. For tracing kernels: blocks on a multiprocessor, of TRACING_WARPS warps each, which
// trace the rays of 32 points. On an H100, 4 warps were faster than 2 and 8, and 7 blocks faster than 6 and 8.
constexpr unsigned SETTLING_WARPS = 16, TRACING_BLOCKS = 7;

// What is known of the rays of a point before any is traced.
struct Settled {
    uint4 rays;    // valid where `beyond` is above 0: one bit for each sample whose ray is not stopped before `beyond`
    unsigned from;  // node below which everything lies that the rays may hit; SETTLED where no ray is to be traced
    unsigned open;  // number of rays known to be open
    float beyond;  // distance before which nothing stops the undecided rays
    unsigned group; // unrelated to this point: entry n holds the nth group of 32 points of which some have rays to trace
};
static_assert(sizeof(Settled) == SETTLED_BYTES, "Settled");
constexpr unsigned SETTLED = ~0u;

// A point of which nothing is known: all its rays are to be traced from the root.
DEVICE Settled nothing_settled() { return {make_uint4(0u, 0u, 0u, 0u), 0u, 0u, 0.0f, 0u}; }
// What is known of points, kept between kernels.
DEVICE Settled *settled(const Params &params) { return (Settled *)params.settled; }
// Stores what is known of a point, if `there`. If any point of the warp has rays to trace, adds the warp's group to the list.
DEVICE void keep(const Params &params, bool there, unsigned index, const Settled &found, unsigned group, unsigned lane) {
    Settled &kept = settled(params)[index];
    if (there) {
        if (found.beyond > 0.0f) kept.rays = found.rays;
        kept.from = found.from;
        kept.open = found.open;
        kept.beyond = found.beyond;
    }
    bool traces = __any_sync(WHOLE_WARP, there && found.from != SETTLED);
    if (traces && lane == 0) settled(params)[atomicAdd(params.progress + UNSETTLED, 1u)].group = group;
}

// A warp's shared memory for settling.
struct SettlingMemory {
    SharedFan fans[32];
    uint4 rays[32]; // as `Settled::rays`
    Nearby nearby;
};

// Points no farther apart than this share of the radius have nearly the same surroundings.
constexpr float CLOSE = 0.25f;

// Distance within which triangles are gathered. If too many are within the radius, a smaller reach still finds the rays that are stopped
// near their origin, and most hits are near the surface that a ray leaves. The parts are tried in order.
DEVICE float reach_of(const Params &params, unsigned part) {
    return part == 0 ? params.radius : params.radius * (part == 1 ? 0.125f : 0.04f);
}
// Reaches below the radius are tried only for fans of at most this many rays.
constexpr unsigned REMEMBERED = 128;

// Settles the rays of the points of a warp by the triangles near them, as far as possible, and counts the rays.
//
// Let R be the radius and r_0 = R > r_1 > r_2 the reaches (`reach_of`). Until no point is left:
//   1. The first point left is the leader L. Members are the points p with |p - L| <= NEIGHBOURS R; they share a list.
//   2. For k = 0, 1, 2, the triangles within r_k of any member are gathered; the first list that is not too long is taken. It holds
//      every triangle that a ray of a member may hit before r_k.
//   3. Each member tests its rays against the list up to r_k, with all threads; if it sees too many triangles, up to the
//      next smaller reach r.
//        r = R: the number of open rays is exact, and nothing is left to trace.
//        r < R: rays that were stopped are blocked; the others are open before r (`beyond`), and are traced from there.
//   4. If no list is short enough, all rays are traced.
// At the end, points that saw no triangle within a smaller reach test once whether their whole half ball is clear (`is_clear`).
template <Accept ACCEPT>
DEVICE Settled settle(const Params &params, bool wanted, const Fan &fan, unsigned samples, SettlingMemory &memory, unsigned lane,
                      RayCounts &rays) {
    Nearby &nearby = memory.nearby;
    // In shared memory, where all threads can read a fan and it takes no registers.
    if (wanted) memory.fans[lane] = SharedFan::of(fan);
    __syncwarp();
    Settled settled = nothing_settled();
    bool certain = wanted && params.node_count == 0, traces = wanted && !certain;
    // Whether too many triangles were gathered around the point, but it sees none within a smaller reach.
    bool asks = false;
    unsigned left = __ballot_sync(WHOLE_WARP, traces);
    while (left != 0) {
        // The leader, and the members near it.
        int leader = __ffs(left) - 1;
        bool candidate = left >> lane & 1u;
        const SharedFan &own_fan = memory.fans[candidate ? lane : leader];
        float3 to = own_fan.origin - memory.fans[leader].origin;
        float apart = NEIGHBOURS * params.radius, radius = params.radius;
        bool member = candidate && ((int)lane == leader || dot(to, to) <= apart * apart);
        unsigned members = 0, from = 0;
        int gathered = -1;
        unsigned attempt = 0;
#pragma unroll 1
        for (;; ++attempt) {
            radius = reach_of(params, attempt);
            Zone own;
            bool bounded = zone_of(params, own_fan, radius, own);
            if (attempt == 0) {
                member = member && ((int)lane == leader || bounded);
                left &= ~__ballot_sync(WHOLE_WARP, member);
                // A point without finite bounds: its rays are traced.
                if (!__shfl_sync(WHOLE_WARP, (int)bounded, leader)) member = false;
                members = __ballot_sync(WHOLE_WARP, member);
                if (members == 0) break;
            }
            Zone zone = zone_of_members(member, members, own, memory.fans[leader].facing);
            unsigned below = from;
            gathered = gather(params, zone, nearby, attempt == 0 ? LISTED : params.listed[attempt - 1], lane, below);
            if (attempt == 0) {
                from = below;
                if (member) settled.from = from;
            }
            if (gathered >= 0) break;
            __syncwarp();
            asks = asks || member;
            if (samples > REMEMBERED || attempt + 1 == REACHES) {
                members = 0;
                break;
            }
        }
        if (members == 0) {
            __syncwarp();
            continue;
        }
        if (gathered == 0 && attempt == 0) {
            certain = certain || member;
            traces = traces && !member;
            continue;
        }
        for (; members != 0; members &= members - 1) {
            unsigned owner = __ffs(members) - 1, sum, found;
            uint4 open;
            // If a point sees too many triangles, the same list serves for a smaller reach.
            for (unsigned part = attempt; part < REACHES; ++part) {
                radius = reach_of(params, part);
                sum = found = 0;
                for (unsigned first = 0; first < samples && found < TOO_MANY; first += 128u) {
                    unsigned count = min(samples - first, 128u);
                    found = open_of<ACCEPT>(params, memory.fans[owner], radius, first, count, nearby, gathered, lane, open);
                    sum += found;
                }
                if (found != TOO_MANY || samples > REMEMBERED) break;
            }
            if (lane != owner || found == TOO_MANY || found == TOO_LONG) continue;
            if (radius == params.radius) {
                certain = found == NOTHING_SEEN;
                traces = false;
                settled.open = sum;
            } else {
                traces = found != 0;
                asks = found == NOTHING_SEEN;
                memory.rays[lane] = open;
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
    if (settled.beyond > 0.0f) settled.rays = memory.rays[lane];
    return settled;
}

// Rays that a warp takes at a time.
constexpr unsigned TAKEN = 64;

// Puts points into shared memory for the warps that trace their rays (part `part` of `parts`). `traces`: whether this thread's point has
// any.
DEVICE void share(const Params &params, bool traces, const Fan &fan, const Settled &settled, unsigned part, unsigned parts,
                  Points &points, unsigned lane) {
    unsigned mask = __ballot_sync(WHOLE_WARP, traces);
    if (traces) {
        points.fans[lane] = SharedFan::of(fan);
        points.origins[lane] = make_float4(fan.origin.x, fan.origin.y, fan.origin.z, settled.beyond);
        points.rays[lane] = settled.rays;
        points.from[lane] = settled.from;
        points.order[__popc(mask & ((1u << lane) - 1u))] = (unsigned char)lane;
    }
    points.open[lane] = 0;
    if (lane == 0) {
        unsigned total = __popc(mask) * params.samples, each = (total + TAKEN * parts - 1) / (TAKEN * parts) * TAKEN;
        points.count = __popc(mask);
        points.next = part * each;
        points.end = min(points.next + each, total);
    }
    __syncwarp();
    if (mask == 0) return;
    float3 origin = xyz(points.origins[traces ? lane : (unsigned)__ffs(mask) - 1u]);
    float3 pad = most_of_warp(box_padding(params, origin));
    bool close = largest(most_of_warp(origin) - least_of_warp(origin)) <= CLOSE * params.radius;
    if (lane == 0) {
        points.pad = pad;
        points.close = close;
    }
}

// Prepares the first `count` rays of the queue, behind `ready` prepared ones.
DEVICE void make_ready(const Params &params, const Points &points, TracingMemory &memory, unsigned count, unsigned ready,
                       unsigned &nodes, unsigned lane) {
    bool able = false;
    unsigned owner = 0, ray = ready + lane;
    if (lane < count) {
        unsigned queued = memory.queue[lane];
        owner = queued & 31u;
        Query query;
        query.longest = 0;
        able = prepare(points.fans[owner].ray(params, queued >> 5), query);
        float3 d = query.direction;
        // The division errs by a few units in the last place, which the box test allows for.
        auto inverse = [](float d) { return __fdividef(1.0f, steered(d)); };
        unsigned of = owner | (unsigned)query.longest << 5;
        memory.inverse[ray] = make_float4(inverse(d.x), inverse(d.y), inverse(d.z), __uint_as_float(of));
        memory.direction[ray] = make_float4(d.x, d.y, d.z, query.shear.x);
        memory.shear[ray] = query.shear.y;
        memory.blocked[ray] = 0;
    }
    unsigned mask = __ballot_sync(WHOLE_WARP, able);
    if (able) {
        unsigned place = nodes + __popc(mask & ((1u << lane) - 1u));
        memory.nodes[place] = points.from[owner];
        memory.node_rays[place] = (unsigned char)ray;
    }
    nodes += __popc(mask);
    __syncwarp();
}

// Traces rays of shared points until none is left. Rays are dealt to the threads so that rays traced together are similar: for points close
// to each other, rays to the same part of the hemisphere, from every point in turn; otherwise, one point's rays after the other's.
template <Accept ACCEPT>
DEVICE void trace_shared(const Params &params, Points &points, unsigned samples, TracingMemory &memory, unsigned lane) {
    unsigned end = points.end, per = points.close ? points.count : samples;
    unsigned queued = 0, ready = 0, nodes = 0, first = 0, taken = 0;
    while (true) {
        if (taken == 0) {
            if (lane == 0) first = atomicAdd(&points.next, TAKEN);
            first = __shfl_sync(WHOLE_WARP, first, 0);
            taken = TAKEN;
        }
        bool last = first >= end;
        if (last && queued + ready == 0) return;
        unsigned index = first + lane, entry = 0;
        bool here = index < end;
        if (here) {
            unsigned major = index / per, minor = index - major * per, owner = points.order[points.close ? minor : major];
            const SharedFan &fan = points.fans[owner];
            unsigned sample = points.close ? fan.sample_of(params, major) : fan.neighbour(params, minor);
            entry = owner | sample << 5;
            if (points.origins[owner].w > 0.0f) {
                here = ((const unsigned *)(points.rays + owner))[sample >> 5] >> (sample & 31u) & 1u;
            }
        }
        first += 32u;
        taken -= 32u;
        unsigned mask = __ballot_sync(WHOLE_WARP, here);
        if (here) memory.queue[queued + __popc(mask & ((1u << lane) - 1u))] = entry;
        queued += __popc(mask);
        __syncwarp();
        // Full warps, and at the end the rest.
        if (queued < 32u && !last) continue;
        unsigned count = min(queued, 32u);
        make_ready(params, points, memory, count, ready, nodes, lane);
        ready += count;
        queued -= count;
        if (lane < queued) memory.queue[lane] = memory.queue[32u + lane];
        __syncwarp();
        if (ready < RAYS && !(last && queued == 0)) continue;
        trace_together<ACCEPT>(params, points, nodes, memory, lane);
        for (unsigned ray = lane; ray < ready; ray += 32u) {
            if (!memory.blocked[ray]) atomicAdd(points.open + (memory.owner(ray) & 31u), 1u);
        }
        __syncwarp();
        ready = nodes = 0;
    }
}

// Greatest number of parts into which the rays of a group are split.
constexpr unsigned MOST_PARTS = 8;

// Traces the rays of groups of points until no group is left, and stores how many are open. All warps of a block call it, and trace the
// rays of a group together. `fan_at(group, index, fan)` returns whether this thread has a point of the group, with the point's index and
// fan; only the first warp calls it.
template <Accept ACCEPT, class FanAt> DEVICE void trace_unsettled(const Params &params, FanAt &&fan_at) {
    __shared__ Points points;
    __shared__ TracingMemory memories[TRACING_WARPS];
    unsigned lane = lane_of_thread();
    while (true) {
        unsigned index = 0;
        bool traces = false;
        if (threadIdx.z == 0) {
            unsigned next = 0;
            if (lane == 0) next = atomicAdd(params.progress + TRACED, 1u);
            next = __shfl_sync(WHOLE_WARP, next, 0);
            // If there are few groups, several blocks trace a part of each group's rays.
            unsigned groups = params.progress[UNSETTLED], parts = min(max(gridDim.x / 4 / max(groups, 1u), 1u), MOST_PARTS);
            bool more = next < groups * parts;
            if (more) {
                Fan fan;
                Settled found = nothing_settled();
                traces = fan_at(settled(params)[next / parts].group, index, fan);
                if (traces) found = settled(params)[index];
                traces = traces && found.from != SETTLED;
                share(params, traces, fan, found, next % parts, parts, points, lane);
            }
            if (lane == 0) points.more = more;
        }
        __syncthreads();
        if (!points.more) return;
        trace_shared<ACCEPT>(params, points, params.samples, memories[threadIdx.z], lane);
        __syncthreads();
        if (traces) atomicAdd(&settled(params)[index].open, points.open[lane]);
    }
}
