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
DEVICE unsigned lane_of_thread() { return (threadIdx.y * BLOCK_WIDTH + threadIdx.x) % 32u; }
DEVICE unsigned warp_of_thread() { return (threadIdx.y * BLOCK_WIDTH + threadIdx.x) / 32u; }

// Between the smallest reciprocal that does not overflow and the largest slope that matters: a ray that runs along an axis
// is treated as one that leaves it by this share, which no coordinate of the scene notices.
constexpr float LEAST_DIRECTION = 1.0e-25f;

// Byte `index` of two words side by side.
DEVICE unsigned byte_of(unsigned low, unsigned high, unsigned index) { return __byte_perm(low, high, index) & 0xffu; }
DEVICE float scale_of(unsigned word, int index) { return __uint_as_float(__byte_perm(word, 0u, 0x4440u + (unsigned)index) << 23); }

// A node as `src/nodes.rs` writes it, 128 bytes, without its planes.
struct Node {
    uint4 head, meta;

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
DEVICE const uint4 *node_at(const Params &params, unsigned index) { return params.nodes + 8ull * index; }
DEVICE Node load_node(const uint4 *node) { return {__ldg(node), __ldg(node + 1)}; }
// Where its low planes of an axis are; the high ones follow.
DEVICE const uint4 *planes_of(const uint4 *node, int axis) { return node + 2 + 2 * axis; }

// Two halves as numbers: one conversion each, on a pipe that is not the one that bounds traversal.
DEVICE float2 halves(unsigned word) {
    float2 numbers;
    asm("{.reg .b16 low, high; mov.b32 {low, high}, %2; cvt.f32.f16 %0, low; cvt.f32.f16 %1, high;}"
        : "=f"(numbers.x), "=f"(numbers.y)
        : "r"(word));
    return numbers;
}

// One axis of the box test: distance = quantum * step + base, with the padding of the slabs in the bases.
struct Slab {
    float near_base, far_base, near_step, far_step;
    uint4 near, far;
};
DEVICE Slab slab_of(float corner, float scale, float near_origin, float far_origin, float inverse, const uint4 *planes) {
    float far_inverse = inverse * (1.0f + 8.0f * UNIT_ROUNDOFF);
    // Chosen by the address: no instruction for each word.
    unsigned backward = inverse < 0.0f ? 1u : 0u;
    return {(corner - near_origin) * inverse,
            (corner - far_origin) * far_inverse,
            scale * inverse,
            scale * far_inverse,
            __ldg(planes + backward),
            __ldg(planes + (1u - backward))};
}

struct Traversal {
    float3 inverse, near_origin, far_origin;
    unsigned octant; // 7 minus the ray's octant: children on the near side come first
};

DEVICE Traversal start(const Params &params, const Query &query) {
    // The padding of the reference, and as much again as the roundings of the quantised boxes and of their fused test may
    // add: below 32 u times the reach, which bounds every difference of coordinates. More than they add, so that a ray enters
    // the box of what it hits before it leaves it.
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
DEVICE unsigned met_slots(const Node &node, const uint4 *at, const Traversal &walk, float t_min, float limit) {
    float3 corner = vec3(__uint_as_float(node.head.x), __uint_as_float(node.head.y), __uint_as_float(node.head.z));
    auto slab = [&](int axis, float corner, float near_origin, float far_origin, float inverse) {
        return slab_of(corner, scale_of(node.head.w, axis), near_origin, far_origin, inverse, planes_of(at, axis));
    };
    Slab x = slab(0, corner.x, walk.near_origin.x, walk.far_origin.x, walk.inverse.x);
    Slab y = slab(1, corner.y, walk.near_origin.y, walk.far_origin.y, walk.inverse.y);
    Slab z = slab(2, corner.z, walk.near_origin.z, walk.far_origin.z, walk.inverse.z);
    unsigned met = 0;
    // The last child first: each shifts its bit in.
#pragma unroll
    for (int pair = 3; pair >= 0; --pair) {
        auto word = [&](const uint4 &v) { return halves(pair == 0 ? v.x : pair == 1 ? v.y : pair == 2 ? v.z : v.w); };
        float2 near_x = word(x.near), near_y = word(y.near), near_z = word(z.near);
        float2 far_x = word(x.far), far_y = word(y.far), far_z = word(z.far);
        auto test = [&](float nx, float ny, float nz, float fx, float fy, float fz) {
            nx = __fmaf_rn(nx, x.near_step, x.near_base);
            ny = __fmaf_rn(ny, y.near_step, y.near_base);
            nz = __fmaf_rn(nz, z.near_step, z.near_base);
            fx = __fmaf_rn(fx, x.far_step, x.far_base);
            fy = __fmaf_rn(fy, y.far_step, y.far_base);
            fz = __fmaf_rn(fz, z.far_step, z.far_base);
            // A distance that is not a number restricts nothing: fmaxf and fminf drop it.
            float enter = fmaxf(fmaxf(nx, ny), fmaxf(nz, t_min));
            float leave = fminf(fminf(fx, fy), fminf(fz, limit));
            // Whether it is negative: one instruction instead of a comparison and another.
            met = __funnelshift_l(__float_as_uint(enter - leave), met, 1);
        };
        test(near_x.y, near_y.y, near_z.y, far_x.y, far_y.y, far_z.y);
        test(near_x.x, near_y.x, near_z.x, far_x.x, far_y.x, far_z.x);
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

// The way of a ray down the tree.
struct Descent {
    Traversal walk;
    float t_min;
    Group stack[STACK];
    int depth;
    Group group;
    // The triangles that were found last: one bit each, counted from the first.
    unsigned triangles, first;

    // Begins at node `from`. Boxes that the ray leaves before `beyond` are passed over.
    DEVICE_MEMBER void begin(const Params &params, const Query &query, unsigned from, float beyond) {
        walk = start(params, query);
        t_min = fmaxf(query.t_min, beyond);
        depth = 0;
        // One child, and no inner one before it.
        group = {from, 0x80000000u};
    }
    // Opens the next node. False where none is left after it.
    DEVICE_MEMBER bool advance(const Params &params, float limit) {
        unsigned place = 31u - __clz(group.bits), slot = (place - 24u) ^ walk.octant;
        unsigned index = group.base + __popc(group.bits & 0xffu & ((1u << slot) - 1u));
        group.bits &= ~(1u << place);
        if (group.bits & 0xff000000u) stack[depth++] = group;
        const uint4 *at = node_at(params, index);
        Node node = load_node(at);
        unsigned met = met_slots(node, at, walk, t_min, limit);
        group.base = node.meta.x;
        group.bits = in_order(met & node.inner(), walk.octant) << 24 | node.inner();
        triangles = node.triangles(met);
        first = node.meta.y;
        if (group.bits & 0xff000000u) return true;
        if (depth == 0) return false;
        group = stack[--depth];
        return true;
    }
};

struct Bvh {
    const Params &params;

    template <class Found> __device__ __forceinline__ void walk(const Query &query, float &limit, Found &&found) const {
        if (params.node_count == 0) return;
        Descent descent;
        descent.begin(params, query, 0u, 0.0f);
        bool more = true;
        while (more) {
            more = descent.advance(params, limit);
            for (unsigned triangles = descent.triangles; triangles != 0; triangles &= triangles - 1) {
                Triangle triangle = load_triangle(params, descent.first + __ffs(triangles) - 1);
                Hit hit;
                if (intersect(params, query, triangle.a, triangle.b, triangle.c, limit, hit)) {
                    hit.triangle = triangle.id & ~TRANSPARENT;
                    if (found(hit, (triangle.id & TRANSPARENT) != 0)) return;
                }
            }
        }
    }

    template <Accept ACCEPT> __device__ __forceinline__ bool closest(const Ray &ray, Hit &best) const {
        Query query;
        if (!prepare(ray, query)) return false;
        float limit = query.t_max;
        bool any = false;
        walk(query, limit, [&](const Hit &hit, bool transparent) {
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

    template <Accept ACCEPT>
    __device__ __forceinline__ bool occluded(const Ray &ray, Crossings *crossings) const {
        Query query;
        if (!prepare(ray, query)) return false;
        float limit = query.t_max;
        bool blocked = false;
        walk(query, limit, [&](const Hit &hit, bool transparent) {
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
