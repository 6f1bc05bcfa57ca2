// The triangles near the points of a warp, gathered once; the rays of a point are tested against those that it may meet alone.
// As `trace/fan/candidates.rs` of the processor, and with the same answers as if each ray were traced.
#pragma once
#include "cone_test.cuh"
#include "trace_bvh.cuh"

// Nodes that wait to be opened, at most.
constexpr unsigned WAITING = 128;
// Rounds of opening up to 32 nodes.
constexpr unsigned ROUNDS = 48;
// Facets that are tested together, one bit each; as many again may wait for the next time.
constexpr unsigned FACETS = 32;
// Points farther apart than this part of the radius have lists of their own. With half of it `ssao` takes 2.8 ms instead of 2.3.
constexpr float NEIGHBOURS = 1.0f;

// The contribution of one axis to an upper bound of the height of a box above a plane (`trace/tree/volumes.rs`).
DEVICE float height_bound(float low, float high, float origin, float normal) {
    float a = (low - origin) * normal, b = (high - origin) * normal;
    float most = fmaxf(a, b), size = fmaxf(most, -fminf(a, b));
    return most + size * SIDE_ERROR;
}

// A box, and a plane behind which nothing counts; without a normal there is no plane.
struct Zone {
    float3 low, high, origin, normal;
    bool has_plane;

    DEVICE_MEMBER bool meets(float3 least, float3 most) const {
        if (least.x > high.x || most.x < low.x || least.y > high.y || most.y < low.y || least.z > high.z || most.z < low.z) {
            return false;
        }
        return !has_plane || height_bound(least.x, most.x, origin.x, normal.x) +
                                     height_bound(least.y, most.y, origin.y, normal.y) +
                                     height_bound(least.z, most.z, origin.z, normal.z) >
                                 0.0f;
    }
    DEVICE_MEMBER bool meets(const Triangle &triangle) const {
        float3 a = triangle.a, b = triangle.b, c = triangle.c;
        if (least_of(a.x, b.x, c.x) > high.x || most_of(a.x, b.x, c.x) < low.x || least_of(a.y, b.y, c.y) > high.y ||
            most_of(a.y, b.y, c.y) < low.y || least_of(a.z, b.z, c.z) > high.z || most_of(a.z, b.z, c.z) < low.z) {
            return false;
        }
        return !has_plane || !(is_behind(a - origin, normal) && is_behind(b - origin, normal) && is_behind(c - origin, normal));
    }
    // Slots of the children of a node; empty ones are not among them.
    DEVICE_MEMBER unsigned met_slots(const Node &node, const uint4 *at) const {
        float3 corner = vec3(__uint_as_float(node.head.x), __uint_as_float(node.head.y), __uint_as_float(node.head.z));
        float3 scale = vec3(scale_of(node.head.w, 0), scale_of(node.head.w, 1), scale_of(node.head.w, 2));
        unsigned met = 0;
#pragma unroll 1
        for (unsigned slot = 0; slot < 8; ++slot) {
            if (byte_of(node.meta.z, node.meta.w, slot) == 0) continue;
            auto plane = [&](int index) {
                const unsigned short *planes = (const unsigned short *)planes_of(at, 0);
                float quantum;
                asm("cvt.f32.f16 %0, %1;" : "=f"(quantum) : "h"(__ldg(planes + 8 * index + slot)));
                return quantum;
            };
            // Rounded to nearest, as when the boxes were written: the planes are where they were found to be.
            float3 least = vec3(__fmaf_rn(plane(0), scale.x, corner.x), __fmaf_rn(plane(2), scale.y, corner.y),
                                __fmaf_rn(plane(4), scale.z, corner.z));
            float3 most = vec3(__fmaf_rn(plane(1), scale.x, corner.x), __fmaf_rn(plane(3), scale.y, corner.y),
                               __fmaf_rn(plane(5), scale.z, corner.z));
            if (meets(least, most)) met |= 1u << slot;
        }
        return met;
    }
};

// What contains all rays of a fan up to a distance; false where it overflows.
DEVICE bool zone_of(const Params &params, const SharedFan &fan, float distance, Zone &zone) {
    float radius = distance * LONGEST;
    float3 slack = slack_around(params, fan.origin);
    auto side = [&](float o, float n, float slack, float &least, float &most) {
        // The farthest point of the half ball against the normal lies on its rim.
        float rim = sqrtf(fmaxf(1.0f - n * n, 0.0f)) + RIM_ERROR;
        rim = fminf(rim, 1.0f);
        float pad = (radius + fabsf(o)) * END_ERROR + slack;
        least = o - radius * (n >= 0.0f ? rim : 1.0f) - pad;
        most = o + radius * (n >= 0.0f ? 1.0f : rim) + pad;
    };
    side(fan.origin.x, fan.facing.x, slack.x, zone.low.x, zone.high.x);
    side(fan.origin.y, fan.facing.y, slack.y, zone.low.y, zone.high.y);
    side(fan.origin.z, fan.facing.z, slack.z, zone.low.z, zone.high.z);
    zone.origin = fan.origin;
    zone.normal = fan.facing;
    zone.has_plane = true;
    return is_finite(zone.low) && is_finite(zone.high);
}

// Nodes that the search for a clear hemisphere opens at most.
constexpr unsigned CLEAR_VISITS = 32;

// Whether certainly nothing is in reach of a fan, where all that is lies below a node. Giving up is never wrong.
DEVICE bool is_clear(const Params &params, const Zone &zone, unsigned from) {
    unsigned pending[CLEAR_VISITS];
    unsigned count = 1;
    pending[0] = from;
    for (unsigned visit = 0; visit < CLEAR_VISITS; ++visit) {
        const uint4 *at = node_at(params, pending[--count]);
        Node node = load_node(at);
        unsigned met = zone.met_slots(node, at);
        for (unsigned triangles = node.triangles(met); triangles != 0; triangles &= triangles - 1) {
            if (zone.meets(load_triangle(params, node.meta.y + __ffs(triangles) - 1))) return false;
        }
        for (unsigned inner = met & node.inner(); inner != 0; inner &= inner - 1) {
            if (count == CLEAR_VISITS) return false;
            unsigned slot = __ffs(inner) - 1;
            pending[count++] = node.meta.x + __popc(node.inner() & ((1u << slot) - 1u));
        }
        if (count == 0) return true;
    }
    return false;
}

DEVICE float least_of_warp(float value) {
    for (int step = 16; step > 0; step >>= 1) value = fminf(value, __shfl_xor_sync(WHOLE_WARP, value, step));
    return value;
}
DEVICE float3 least_of_warp(float3 v) { return vec3(least_of_warp(v.x), least_of_warp(v.y), least_of_warp(v.z)); }
DEVICE float3 most_of_warp(float3 v) { return -least_of_warp(-v); }

// Triangles that one point sees within the radius, or within a part of it, at most: beyond, tracing its rays takes less time.
constexpr unsigned SEEN = 128, SEEN_NEARER = 96;

// What a warp has in shared memory while it counts open rays.
struct Nearby {
    unsigned list[LISTED]; // triangles, by their places in the tree
    unsigned waiting[SEEN > WAITING ? SEEN : WAITING]; // nodes; then triangles that one point sees
    float4 facets[4][2 * FACETS];
};

// The zone of all members. Where they face the same way, what lies behind all of them is left out.
DEVICE Zone zone_of_members(bool member, unsigned members, const Zone &own, float3 facing) {
    Zone zone;
    zone.low = least_of_warp(member ? own.low : splat(INFINITY));
    zone.high = most_of_warp(member ? own.high : splat(-INFINITY));
    bool same = own.normal.x == facing.x && own.normal.y == facing.y && own.normal.z == facing.z;
    zone.has_plane = (__ballot_sync(WHOLE_WARP, same) & members) == members;
    zone.normal = facing;
    if (zone.has_plane) {
        float3 sign = vec3(facing.x >= 0.0f ? 1.0f : -1.0f, facing.y >= 0.0f ? 1.0f : -1.0f, facing.z >= 0.0f ? 1.0f : -1.0f);
        float3 o = own.origin;
        float3 turned = member ? vec3(sign.x * o.x, sign.y * o.y, sign.z * o.z) : splat(INFINITY);
        turned = least_of_warp(turned);
        zone.origin = vec3(sign.x * turned.x, sign.y * turned.y, sign.z * turned.z);
    }
    return zone;
}

// Lists the triangles that meet a zone; below 0 if they are too many or too hard to find. Each thread of the warp opens a
// node at a time. What is found, and whether it is, does not depend on the order in which threads run. Begins at node `from`,
// which becomes the one below which everything lies that meets the zone.
DEVICE int gather(const Params &params, const Zone &zone, Nearby &nearby, unsigned most, unsigned lane, unsigned &from) {
    unsigned waiting = 1, found = 0;
    bool alone = true;
    if (lane == 0) nearby.waiting[0] = from;
    __syncwarp();
    for (unsigned round = 0; waiting > 0; ++round) {
        if (round == ROUNDS) return -1;
        unsigned opened = min(waiting, 32u), inner = 0, triangles = 0, children = 0, first = 0, slots = 0;
        waiting -= opened;
        if (lane < opened) {
            const uint4 *at = node_at(params, nearby.waiting[waiting + lane]);
            Node node = load_node(at);
            unsigned met = zone.met_slots(node, at);
            slots = node.inner();
            inner = met & slots;
            triangles = node.triangles(met);
            children = node.meta.x;
            first = node.meta.y;
        }
        unsigned own = __popc(inner) | __popc(triangles) << 16, sum = own;
#pragma unroll
        for (unsigned step = 1; step < 32; step <<= 1) {
            unsigned below = __shfl_up_sync(WHOLE_WARP, sum, step);
            if (lane >= step) sum += below;
        }
        unsigned all = __shfl_sync(WHOLE_WARP, sum, 31), before = sum - own;
        if (waiting + (all & 0xffffu) > WAITING || found + (all >> 16) > most) return -1;
        unsigned place = waiting + (before & 0xffffu);
        for (; inner != 0; inner &= inner - 1) {
            unsigned slot = __ffs(inner) - 1;
            nearby.waiting[place++] = children + __popc(slots & ((1u << slot) - 1u));
        }
        place = found + (before >> 16);
        for (; triangles != 0; triangles &= triangles - 1) nearby.list[place++] = first + __ffs(triangles) - 1;
        __syncwarp();
        // The boxes of the leaves were met; the triangles themselves may not be.
        unsigned kept = found;
        for (unsigned base = found; base < found + (all >> 16); base += 32) {
            bool listed = base + lane < found + (all >> 16);
            unsigned triangle = listed ? nearby.list[base + lane] : 0;
            bool met = listed && zone.meets(load_triangle(params, triangle));
            unsigned mask = __ballot_sync(WHOLE_WARP, met);
            if (met) nearby.list[kept + __popc(mask & ((1u << lane) - 1u))] = triangle;
            kept += __popc(mask);
        }
        waiting += all & 0xffffu;
        found = kept;
        __syncwarp();
        alone = alone && all == 1u;
        if (alone) {
            from = nearby.waiting[0];
            __syncwarp();
        }
    }
    return (int)found;
}

// Up to 128 rays of one fan: three whole slots, one ray a thread each, and a slot whose `rest` rays are each tested by
// several threads against a part of the facets, so that no thread idles.
struct Rays {
    float3 direction[4];
    unsigned whole, rest, parts; // parts: threads a ray of the last slot, as the logarithm
    unsigned blocked;            // one bit a slot
};

// The rays from `first` on; false if one is longer than the facets' bounds allow, or not made of numbers.
DEVICE bool make_rays(const Params &params, const SharedFan &fan, unsigned first, unsigned count, unsigned lane, Rays &rays) {
    rays.whole = min(count / 32u, 3u);
    rays.rest = count - 32u * rays.whole;
    rays.parts = rays.rest == 0 ? 0 : min((unsigned)__clz(rays.rest - 1u), 32u) - 27u;
    rays.blocked = 0;
    bool longer = false;
#pragma unroll
    for (int slot = 0; slot < 4; ++slot) rays.direction[slot] = splat(0.0f);
    // One loop, so that all that makes a direction is in the instruction cache once.
#pragma unroll 1
    for (unsigned slot = rays.whole > 0 ? 0 : 3; slot < 4; slot = slot + 1 < rays.whole ? slot + 1 : slot < 3 ? 3 : 4) {
        unsigned within = slot < 3 ? 32u * slot + lane : 32u * rays.whole + (lane & (32u >> rays.parts) - 1u);
        if (slot == 3 && rays.rest == 0) break;
        float3 d = fan.ray(params, first + min(within, count - 1u)).direction;
        longer = longer || !(__fmaf_rn(d.z, d.z, __fmaf_rn(d.y, d.y, d.x * d.x)) <= LONGEST);
        if (slot == 0) rays.direction[0] = d;
        if (slot == 1) rays.direction[1] = d;
        if (slot == 2) rays.direction[2] = d;
        if (slot == 3) rays.direction[3] = d;
    }
    return !__any_sync(WHOLE_WARP, longer);
}

// Tests the rays against facets `begin` to `begin + count`, at most 32.
template <Accept ACCEPT>
DEVICE void test_rays(const Params &params, const SharedFan &fan, const Nearby &nearby, unsigned begin, unsigned count, unsigned lane,
                      Rays &rays) {
    unsigned undecided[4] = {0, 0, 0, 0};
    auto facet_at = [&](unsigned f) -> Facet {
        return {nearby.facets[0][begin + f], nearby.facets[1][begin + f], nearby.facets[2][begin + f], nearby.facets[3][begin + f]};
    };
    auto test = [&](const Facet &facet, unsigned f, int slot) {
        bool hit, miss;
        judge(facet, rays.direction[slot], hit, miss);
        if (hit) rays.blocked |= 1u << slot;
        if (!hit && !miss) undecided[slot] |= 1u << f;
    };
    if (rays.whole == 3) {
        for (unsigned f = 0; f < count; ++f) {
            Facet facet = facet_at(f);
            test(facet, f, 0);
            test(facet, f, 1);
            test(facet, f, 2);
        }
    } else if (rays.whole > 0) {
        for (unsigned f = 0; f < count; ++f) {
            Facet facet = facet_at(f);
            test(facet, f, 0);
            if (rays.whole > 1) test(facet, f, 1);
        }
    }
    unsigned within = 32u >> rays.parts, part = lane / within;
    bool whole_or_rest = (lane & (within - 1u)) < rays.rest;
    if (whole_or_rest) {
        for (unsigned f = part; f < count; f += 1u << rays.parts) test(facet_at(f), f, 3);
    }
#pragma unroll
    for (int slot = 0; slot < 4; ++slot) {
        for (unsigned left = undecided[slot]; left != 0 && !(rays.blocked >> slot & 1u); left &= left - 1) {
            unsigned place = __float_as_uint(nearby.facets[2][begin + __ffs(left) - 1].w);
            if (stopped_by<ACCEPT>(params, fan.origin, rays.direction[slot], place)) rays.blocked |= 1u << slot;
        }
    }
}

// One bit for each ray of a slot that nothing stopped.
DEVICE unsigned open_rays(const Rays &rays, int slot) {
    unsigned blocked = __ballot_sync(WHOLE_WARP, rays.blocked >> slot & 1u);
    if (slot < 3) return slot < (int)rays.whole ? ~blocked : 0u;
    for (unsigned within = 16u; within >= 32u >> rays.parts && within > 0u; within >>= 1) blocked |= blocked >> within;
    return rays.rest == 0 ? 0u : ~blocked & (~0u >> (32u - rays.rest));
}
DEVICE unsigned count_of(const Rays &rays) {
    return __popc(open_rays(rays, 0)) + __popc(open_rays(rays, 1)) + __popc(open_rays(rays, 2)) + __popc(open_rays(rays, 3));
}

// What is found instead of a number: triangles to look at, a ray that is too long, or nothing in the way of any.
constexpr unsigned TOO_MANY = ~0u - 2u, TOO_LONG = ~0u - 1u, NOTHING_SEEN = ~0u;

// How many rays of a fan, from `first` on, none of the gathered triangles stops within a radius. `open` has a bit
// for each that is not stopped.
template <Accept ACCEPT>
DEVICE unsigned open_of(const Params &params, const SharedFan &fan, float radius, unsigned first, unsigned count, Nearby &nearby,
                        unsigned gathered, unsigned lane, uint4 &open) {
    HalfBall ball = half_ball(params, fan.origin, fan.facing, radius);
    // Few of those near some points are near this one.
    unsigned near = 0, most = radius == params.radius ? SEEN : SEEN_NEARER;
    for (unsigned base = 0; base < gathered; base += 32) {
        unsigned place = base + lane < gathered ? nearby.list[base + lane] : 0;
        bool meets = base + lane < gathered && ball.meets(load_triangle(params, place));
        unsigned mask = __ballot_sync(WHOLE_WARP, meets), at = near + __popc(mask & ((1u << lane) - 1u));
        near += __popc(mask);
        if (near > most) {
            // Other threads write there next.
            __syncwarp();
            return TOO_MANY;
        }
        if (meets) nearby.waiting[at] = place;
    }
    __syncwarp();
    Rays rays;
    bool seen = false, made = false;
    unsigned facets = 0;
    for (unsigned base = 0; base < near; base += 32) {
        Facet facet;
        unsigned place = base + lane < near ? nearby.waiting[base + lane] : 0;
        Triangle triangle = load_triangle(params, place);
        bool met = base + lane < near && facet_of(params, triangle, place, ball, facet);
        seen = seen || __any_sync(WHOLE_WARP, met);
        // Glass that occlusion rays pass stops none.
        if (ACCEPT == ACCEPT_STOPS && met && (triangle.id & TRANSPARENT)) {
            met = !passes_light(params, triangle.id & ~TRANSPARENT);
        }
        unsigned mask = __ballot_sync(WHOLE_WARP, met);
        if (met) {
            unsigned slot = facets + __popc(mask & ((1u << lane) - 1u));
            nearby.facets[0][slot] = facet.a;
            nearby.facets[1][slot] = facet.b;
            nearby.facets[2][slot] = facet.c;
            nearby.facets[3][slot] = facet.normal;
        }
        facets += __popc(mask);
        __syncwarp();
        if (facets > FACETS || (facets > 0 && base + 32 >= near)) {
            if (!made && !make_rays(params, fan, first, count, lane, rays)) return TOO_LONG;
            made = true;
            // Once whole and once what is left: the same instructions.
#pragma unroll 1
            for (unsigned begin = 0; begin < facets; begin += FACETS) {
                test_rays<ACCEPT>(params, fan, nearby, begin, min(facets - begin, FACETS), lane, rays);
            }
            facets = 0;
            __syncwarp();
            if (count_of(rays) == 0) {
                open = make_uint4(0u, 0u, 0u, 0u);
                return 0;
            }
        }
    }
    open = make_uint4(~0u, ~0u, ~0u, ~0u);
    if (!made) return seen ? count : NOTHING_SEEN;
    unsigned rest = open_rays(rays, 3);
    open.x = rays.whole > 0 ? open_rays(rays, 0) : rest;
    open.y = rays.whole > 1 ? open_rays(rays, 1) : rest;
    open.z = rays.whole > 2 ? open_rays(rays, 2) : rest;
    open.w = rest;
    return count_of(rays);
}
