// Our own traversal of the wide tree that `trace/device.rs` writes, one ray a thread.
//
// The tree only leads to triangles: its boxes are quantised outwards, and the box test is conservative against the one of
// `trace/query.rs`, so the answers are those of the processor, bit for bit.
//
// Traversal by groups of children in the order of the ray's octant: Ylitie, Karras and Laine, "Efficient Incoherent Ray
// Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 4.
#pragma once
#include "triangle.cuh"

constexpr unsigned WHOLE_WARP = ~0u;

// Between the smallest reciprocal that does not overflow and the largest slope that matters: a ray that runs along an axis
// is treated as one that leaves it by this share, which no coordinate of the scene notices.
constexpr float LEAST_DIRECTION = 1.0e-25f;

// Byte `index` of two words side by side.
DEVICE unsigned byte_of(unsigned low, unsigned high, unsigned index) { return __byte_perm(low, high, index) & 0xffu; }
DEVICE float scale_of(unsigned word, int index) { return __uint_as_float(__byte_perm(word, 0u, 0x4440u + (unsigned)index) << 23); }

// A byte q as 1 + q / 2^15: one permutation puts it into the fraction of 1, where a conversion takes a pipe of half the width
// besides.
constexpr float BYTE_STEPS = 32768.0f;
DEVICE float byte_above_one(unsigned word, int index) {
    return __uint_as_float(__byte_perm(word, 0x3f800000u, 0x7604u + 0x10u * (unsigned)index));
}

// A node as it is stored: 80 bytes.
struct Node {
    uint4 head, meta, low_xy, low_z_high_x, high_yz;

    // Slots of inner children, one bit each.
    DEVICE_MEMBER unsigned inner() const { return head.w >> 24; }
    // What the leaves among some slots hold, one bit a triangle, counted from the node's first.
    DEVICE_MEMBER unsigned triangles(unsigned slots) const {
        unsigned found = 0;
        for (unsigned leaves = slots & ~inner(); leaves != 0; leaves &= leaves - 1) {
            unsigned leaf = byte_of(meta.z, meta.w, __ffs(leaves) - 1);
            found |= (leaf >> 5) << (leaf & 31u);
        }
        return found;
    }
};
DEVICE Node load_node(const Params &params, unsigned index) {
    const uint4 *n = params.nodes + 5ull * index;
    return {__ldg(n), __ldg(n + 1), __ldg(n + 2), __ldg(n + 3), __ldg(n + 4)};
}

// One axis of the box test: distance = (1 + quantum / 2^15) * step + base, with the padding of the slabs in the bases.
//
// 2^15 steps are subtracted from a base. The rounding of that, below u times (base + 2^15 steps), comes on top of the
// others': the part of the base is in the padding (`start`), and for the other bases are moved outwards by 4 u times the
// 2^15 steps, which is 1/128 of a quantum.
struct Slab {
    float near_base, far_base, near_step, far_step;
    unsigned near0, near1, far0, far1;
};
DEVICE Slab slab_of(float corner, float scale, float near_origin, float far_origin, float inverse, unsigned low0, unsigned low1,
                    unsigned high0, unsigned high1) {
    float far_inverse = inverse * (1.0f + 8.0f * UNIT_ROUNDOFF);
    bool backward = inverse < 0.0f;
    float more = backward ? 1.0f - 4.0f * UNIT_ROUNDOFF : 1.0f + 4.0f * UNIT_ROUNDOFF;
    float less = backward ? 1.0f + 4.0f * UNIT_ROUNDOFF : 1.0f - 4.0f * UNIT_ROUNDOFF;
    float steps = scale * BYTE_STEPS, near_step = steps * inverse, far_step = steps * far_inverse;
    return {__fmaf_rn(-near_step, more, (corner - near_origin) * inverse),
            __fmaf_rn(-far_step, less, (corner - far_origin) * far_inverse),
            near_step,
            far_step,
            backward ? high0 : low0,
            backward ? high1 : low1,
            backward ? low0 : high0,
            backward ? low1 : high1};
}

struct Traversal {
    float3 inverse, near_origin, far_origin;
    unsigned octant; // 7 minus the ray's octant: children on the near side come first
};

DEVICE Traversal start(const Params &params, const Query &query) {
    // The padding of the reference, and as much again as the roundings of the quantised boxes and of their fused test may
    // add: below 32 u times the reach, which bounds every difference of coordinates.
    float3 low = vec3(params.scene_low[0], params.scene_low[1], params.scene_low[2]);
    float3 high = vec3(params.scene_high[0], params.scene_high[1], params.scene_high[2]);
    float3 a = absolute(low - query.origin), b = absolute(high - query.origin);
    float3 reach = vec3(fmaxf(a.x, b.x), fmaxf(a.y, b.y), fmaxf(a.z, b.z));
    float3 pad = slab_padding(params, query) + (reach + absolute(query.origin)) * (32.0f * UNIT_ROUNDOFF);
    auto steer = [](float d) { return fabsf(d) < LEAST_DIRECTION ? copysignf(LEAST_DIRECTION, d) : d; };
    float3 d = vec3(steer(query.direction.x), steer(query.direction.y), steer(query.direction.z));
    Traversal walk;
    walk.inverse = vec3(1.0f / d.x, 1.0f / d.y, 1.0f / d.z);
    float3 toward = vec3(copysignf(pad.x, d.x), copysignf(pad.y, d.y), copysignf(pad.z, d.z));
    walk.near_origin = query.origin + toward;
    walk.far_origin = query.origin - toward;
    walk.octant = (d.x < 0.0f ? 0u : 1u) | (d.y < 0.0f ? 0u : 2u) | (d.z < 0.0f ? 0u : 4u);
    return walk;
}

// The slots of children that the ray meets up to `limit`; empty ones may be among them.
DEVICE unsigned met_slots(const Node &node, const Traversal &walk, float t_min, float limit) {
    float3 corner = vec3(__uint_as_float(node.head.x), __uint_as_float(node.head.y), __uint_as_float(node.head.z));
    Slab x = slab_of(corner.x, scale_of(node.head.w, 0), walk.near_origin.x, walk.far_origin.x, walk.inverse.x, node.low_xy.x,
                     node.low_xy.y, node.low_z_high_x.z, node.low_z_high_x.w);
    Slab y = slab_of(corner.y, scale_of(node.head.w, 1), walk.near_origin.y, walk.far_origin.y, walk.inverse.y, node.low_xy.z,
                     node.low_xy.w, node.high_yz.x, node.high_yz.y);
    Slab z = slab_of(corner.z, scale_of(node.head.w, 2), walk.near_origin.z, walk.far_origin.z, walk.inverse.z,
                     node.low_z_high_x.x, node.low_z_high_x.y, node.high_yz.z, node.high_yz.w);
    unsigned met = 0;
#pragma unroll
    for (int child = 0; child < 8; ++child) {
        int byte = child & 3;
        auto near = [&](const Slab &s) {
            return __fmaf_rn(byte_above_one(child < 4 ? s.near0 : s.near1, byte), s.near_step, s.near_base);
        };
        auto far = [&](const Slab &s) {
            return __fmaf_rn(byte_above_one(child < 4 ? s.far0 : s.far1, byte), s.far_step, s.far_base);
        };
        // A distance that is not a number restricts nothing: fmaxf and fminf drop it.
        float enter = fmaxf(fmaxf(near(x), near(y)), fmaxf(near(z), t_min));
        float leave = fminf(fminf(far(x), far(y)), fminf(far(z), limit));
        if (enter <= leave) met |= 1u << child;
    }
    return met;
}

// Slots by the order in which a ray visits them, `slot ^ octant`.
DEVICE unsigned in_order(unsigned slots, unsigned octant) {
    if (octant & 1u) slots = (slots >> 1 & 0x55u) | (slots & 0x55u) << 1;
    if (octant & 2u) slots = (slots >> 2 & 0x33u) | (slots & 0x33u) << 2;
    if (octant & 4u) slots = slots >> 4 | (slots & 0x0fu) << 4;
    return slots;
}

// A set of children of one node: those still to be visited.
struct Group {
    unsigned base; // of the inner children
    unsigned bits; // inner children by order in 24..31; which slots are inner children in 0..7
};

struct Bvh {
    const Params &params;

    // Begins at node `from`, the root or one below which everything lies that the ray may hit.
    template <class Found>
    __device__ __forceinline__ void walk(const Query &query, unsigned from, float &limit, Found &&found) const {
        if (params.node_count == 0) return;
        Traversal walk = start(params, query);
        Group stack[STACK];
        int depth = 0;
        Group group = {0u, 0x80000000u};
        bool root = true;
        while (true) {
            unsigned place = 31u - __clz(group.bits);
            unsigned index;
            if (root) {
                index = from;
                group.bits = 0;
                root = false;
            } else {
                unsigned slot = (place - 24u) ^ walk.octant;
                index = group.base + __popc(group.bits & 0xffu & ((1u << slot) - 1u));
                group.bits &= ~(1u << place);
            }
            if (group.bits & 0xff000000u) stack[depth++] = group;
            Node node = load_node(params, index);
            unsigned met = met_slots(node, walk, query.t_min, limit);
            group.base = node.meta.x;
            group.bits = in_order(met & node.inner(), walk.octant) << 24 | node.inner();
            for (unsigned triangles = node.triangles(met); triangles != 0; triangles &= triangles - 1) {
                unsigned offset = __ffs(triangles) - 1;
                Triangle triangle = load_triangle(params, node.meta.y + offset);
                Hit hit;
                if (intersect(params, query, triangle.a, triangle.b, triangle.c, limit, hit)) {
                    hit.triangle = triangle.id & ~TRANSPARENT;
                    if (found(hit, (triangle.id & TRANSPARENT) != 0)) return;
                }
            }
            if (!(group.bits & 0xff000000u)) {
                if (depth == 0) return;
                group = stack[--depth];
            }
        }
    }

    template <Accept ACCEPT> __device__ __forceinline__ bool closest(const Ray &ray, Hit &best) const {
        Query query;
        if (!prepare(ray, query)) return false;
        float limit = query.t_max;
        bool any = false;
        walk(query, 0u, limit, [&](const Hit &hit, bool transparent) {
            bool nearer = any ? hit.t < best.t || (hit.t == best.t && hit.triangle < best.triangle) : hit.t < limit;
            if (nearer && (!transparent || accepts(params, ACCEPT, hit, nullptr))) {
                limit = hit.t;
                best = hit;
                any = true;
            }
            return false;
        });
        return any;
    }

    template <Accept ACCEPT> __device__ __forceinline__ bool occluded(const Ray &ray, Crossings *crossings,
                                                                              unsigned from = 0) const {
        Query query;
        if (!prepare(ray, query)) return false;
        float limit = query.t_max;
        bool blocked = false;
        walk(query, from, limit, [&](const Hit &hit, bool transparent) {
            blocked = hit.t < query.t_max && (!transparent || accepts(params, ACCEPT, hit, crossings));
            return blocked;
        });
        return blocked;
    }

    template <Accept ACCEPT>
    __device__ __forceinline__ unsigned count_open(bool wanted, const Fan &fan, unsigned samples, RayCounts &rays) const;
    // Without a list there is nothing that the rays of a point have in common, and neighbouring pixels go the same way.
    template <Accept ACCEPT>
    DEVICE_MEMBER unsigned count_open(bool wanted, const ThesisFan &fan, unsigned samples, RayCounts &rays) const {
        return wanted ? count_open_alone<ACCEPT>(*this, fan, samples, rays) : 0u;
    }
    static __device__ __forceinline__ bool any(bool value) { return __any_sync(WHOLE_WARP, value); }
};
