// How many rays of fans are open, on our own traversal. The threads of a warp work together, in two steps, which kernels of their
// own take: what the triangles near the points say (`settle`), then the rays of which these do not (`trace_shared`).
#pragma once
#include "ray_pool.cuh"

// How far kernels have come: how many surfaces were found; the next that is to be lit, and the next of which is asked what is near;
// groups of points that have rays to be traced, and the next of them.
enum Progress { FOUND = 0, LIT = 1, NEAR = 2, UNSETTLED = 3, TRACED = 4 };

// Of kernels for the one step: warps on a multiprocessor. For the other: blocks on one, of TRACING_WARPS each, which trace the rays of
// 32 points. On an H100 4 warps were faster than 2 and 8, and 7 blocks than 6 and 8.
constexpr unsigned SETTLING_WARPS = 16, TRACING_BLOCKS = 7;

// What is known of the rays of a point before any is traced.
struct Settled {
    uint4 rays;    // where `beyond` is above 0: one bit for each sample whose ray is not stopped before
    unsigned from;  // the node below which everything lies that they may meet; SETTLED where none is to be traced
    unsigned open;  // this many are known to be open
    float beyond;  // nothing nearer stops those that are left
    unsigned group; // not of this point: at the place n, the nth group of 32 points of which some have rays to be traced
};
static_assert(sizeof(Settled) == SETTLED_BYTES, "Settled");
constexpr unsigned SETTLED = ~0u;

// Of a point of which nothing is known: all its rays are to be traced, from the root.
DEVICE Settled nothing_settled() { return {make_uint4(0u, 0u, 0u, 0u), 0u, 0u, 0.0f, 0u}; }
// Where what is known of points is kept between kernels.
DEVICE Settled *settled(const Params &params) { return (Settled *)params.settled; }
// Keeps what is known of a point, if it is there, and where rays are to be traced the warp's group.
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

// What a warp has in shared memory while it looks at what is near.
struct SettlingMemory {
    SharedFan fans[32];
    uint4 rays[32]; // of `Settled`
    Nearby nearby;
};

// Points no farther apart than this part of the radius have much the same around them.
constexpr float CLOSE = 0.25f;

// Where there is too much in reach, what is nearer than a part of the radius says at least which rays are stopped there, and the others
// need not test it: most of what a ray meets is around the surface that it leaves. The parts are tried in turn.
DEVICE float reach_of(const Params &params, unsigned part) {
    return part == 0 ? params.radius : params.radius * (part == 1 ? 0.125f : 0.04f);
}
// That is asked of so many rays at most.
constexpr unsigned REMEMBERED = 128;

// Settles the rays of the points of a warp from the triangles near them, as far as these tell, and counts the rays.
//
// With R the radius and r_0 = R > r_1 > r_2 the reaches (`reach_of`), until no point is left:
//   1. The first point left is the leader L. Members are the points p with |p - L| <= NEIGHBOURS R: they share a list.
//   2. For k = 0, 1, 2 the triangles in reach r_k of any member are gathered; the first list that is not too long is taken. It holds
//      every triangle that a ray of a member may meet before r_k.
//   3. Each member tests its rays against the list, all threads together, up to r_k; if the member sees too many triangles, up to the
//      next reach.
//        r = R: the count of open rays is exact, and nothing is left to trace.
//        r < R: rays that were stopped are stopped; the others are open before r (`beyond`), and are traced from there.
//   4. No list for any reach: all rays are traced.
// At the end, points that saw no triangle within a smaller reach ask once whether their whole half ball is clear (`is_clear`).
template <Accept ACCEPT>
DEVICE Settled settle(const Params &params, bool wanted, const Fan &fan, unsigned samples, SettlingMemory &memory, unsigned lane,
                      RayCounts &rays) {
    Nearby &nearby = memory.nearby;
    // In shared memory, where all threads read a fan, and no registers are held.
    if (wanted) memory.fans[lane] = SharedFan::of(fan);
    __syncwarp();
    Settled settled = nothing_settled();
    // The rays of points that a sphere is in reach of are traced.
    OF_SPHERES(bool has_sphere = wanted && is_near_sphere(params, fan.origin, params.radius);)
    bool certain = wanted && params.node_count == 0 OF_SPHERES(&& !has_sphere), traces = wanted && !certain;
    // Whether too much was found around a point, but nothing that it sees.
    bool asks = false;
    unsigned left = __ballot_sync(WHOLE_WARP, traces OF_SPHERES(&& !has_sphere));
    while (left != 0) {
        // Points near one of them, and that one.
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
                // The rays of a point of which no bounds are known are traced.
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
            // Where one point sees too much, what is nearer is on the list, too.
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

// Hands points to the warps that trace their rays, or one of so many parts of these: for each thread, whether its point has any.
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
        points.close = false;
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

// Makes the first `count` rays of the queue, behind `ready` others.
DEVICE void make_ready(const Params &params, const Points &points, TracingMemory &memory, unsigned count, unsigned ready,
                       unsigned &nodes, unsigned lane) {
    bool able = false;
    unsigned owner = 0, ray = ready + lane;
    if (lane < count) {
        unsigned queued = memory.queue[lane];
        owner = queued & 31u;
        Query query;
        query.longest = 0;
        // A ray that is not made of numbers meets no sphere either.
        OF_SPHERES(query.direction = splat(0.0f);)
        able = prepare(points.fans[owner].ray(params, queued >> 5), query);
        float3 d = query.direction;
        // Off by its last bits, which the box test allows for.
        auto inverse = [](float d) { return __fdividef(1.0f, steered(d)); };
        unsigned of = owner | (unsigned)query.longest << 5;
        memory.inverse[ray] = make_float4(inverse(d.x), inverse(d.y), inverse(d.z), __uint_as_float(of));
        memory.direction[ray] = make_float4(d.x, d.y, d.z, query.shear.x);
        memory.shear[ray] = query.shear.y;
        memory.blocked[ray] = 0;
        OF_SPHERES(able = able && params.node_count != 0;)
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

// Traces rays of shared points until none is left, dealt to the threads so that those which are traced together go the same way.
// From points close to each other these are rays to the same part of the hemisphere, first of every point to one, then to the
// next; else those of one point after the other.
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
        // Whole warps, and at the end what is left.
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
#ifdef CURITIBA_SPHERES
            float3 origin = xyz(points.origins[memory.owner(ray) & 31u]), direction = xyz(memory.direction[ray]);
            if (!memory.blocked[ray] && occluded_by_sphere<ACCEPT>(params, {origin, direction, 0.0f, params.radius}, nullptr)) continue;
#endif
            if (!memory.blocked[ray]) atomicAdd(points.open + (memory.owner(ray) & 31u), 1u);
        }
        __syncwarp();
        ready = nodes = 0;
    }
}

// Parts of the rays of a group, at most.
constexpr unsigned MOST_PARTS = 8;

// Traces the rays of groups of points until there are none left, and keeps how many are open. All warps of a block call it, and trace
// the rays of a group together. `fan_at(group, index, fan)` tells whether this thread of a warp has a point of it, where it is kept,
// and what its rays are; only the first warp asks.
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
            // Where there are few groups, several blocks take a part of the rays each.
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
