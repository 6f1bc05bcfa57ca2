// Our own traversal of the wide tree that `trace/build/gpu_tree.rs` writes, one ray a thread.
//
// The tree only leads to triangles: its boxes are quantised outwards, and the box test is conservative against the one of
// `trace/tree/prepared_ray.rs`, so the answers are those of the processor, bit for bit.
//
// Traversal by groups of children in the order of the ray's octant: Ylitie, Karras and Laine, "Efficient Incoherent Ray
// Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 4.
#pragma once
#include "triangle.cuh"

constexpr unsigned WHOLE_WARP = ~0u;
DEVICE unsigned lane_of_thread() { return (threadIdx.y * BLOCK_WIDTH + threadIdx.x) % 32u; }

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

// The way of a ray through boxes, which are widened by `pad` along each axis.
struct Way {
    float3 origin, inverse, pad;
};

// How much that is for a ray from an origin: the padding of the reference (`slab_padding`), and as much again as the roundings of the
// quantised boxes and of their fused test may add: below 32 u times the reach, which bounds every difference of coordinates.
// More than they add, so that a ray enters the box of what it hits before it leaves it.
DEVICE float3 box_padding(const Params &params, float3 origin) {
    float3 reach = reach_from(params, origin);
    float most = most_of(reach.x, reach.y, reach.z);
    return (reach * 40.0f + splat(most * 8.0f) + absolute(origin) * 34.0f) * UNIT_ROUNDOFF;
}

DEVICE float steered(float d) { return fabsf(d) < LEAST_DIRECTION ? copysignf(LEAST_DIRECTION, d) : d; }

// One axis of the box test: distance = quantum * step + base.
struct Slab {
    float near_base, far_base, step;
    uint4 near, far;
};
DEVICE Slab slab_of(float corner, float scale, float origin, float inverse, float pad, const uint4 *planes) {
    // Chosen by the address: no instruction for each word.
    unsigned backward = inverse < 0.0f ? 1u : 0u;
    float base = (corner - origin) * inverse;
    return {__fmaf_rn(-pad, fabsf(inverse), base),
            __fmaf_rn(pad, fabsf(inverse), base),
            scale * inverse,
            __ldg(planes + backward),
            __ldg(planes + (1u - backward))};
}

// The slots of children that the ray meets between two distances; empty ones may be among them.
DEVICE unsigned met_slots(const Node &node, const uint4 *at, const Way &way, float least, float most) {
    auto slab = [&](int axis, unsigned corner, float origin, float inverse, float pad) {
        return slab_of(__uint_as_float(corner), scale_of(node.head.w, axis), origin, inverse, pad, planes_of(at, axis));
    };
    Slab x = slab(0, node.head.x, way.origin.x, way.inverse.x, way.pad.x);
    Slab y = slab(1, node.head.y, way.origin.y, way.inverse.y, way.pad.y);
    Slab z = slab(2, node.head.z, way.origin.z, way.inverse.z, way.pad.z);
    unsigned met = 0;
    // The last child first: each shifts its bit in.
#pragma unroll
    for (int pair = 3; pair >= 0; --pair) {
        auto word = [&](const uint4 &v) { return halves(pair == 0 ? v.x : pair == 1 ? v.y : pair == 2 ? v.z : v.w); };
        float2 near_x = word(x.near), near_y = word(y.near), near_z = word(z.near);
        float2 far_x = word(x.far), far_y = word(y.far), far_z = word(z.far);
        auto test = [&](float nx, float ny, float nz, float fx, float fy, float fz) {
            nx = __fmaf_rn(nx, x.step, x.near_base);
            ny = __fmaf_rn(ny, y.step, y.near_base);
            nz = __fmaf_rn(nz, z.step, z.near_base);
            fx = __fmaf_rn(fx, x.step, x.far_base);
            fy = __fmaf_rn(fy, y.step, y.far_base);
            fz = __fmaf_rn(fz, z.step, z.far_base);
            // A distance that is not a number restricts nothing: fmaxf and fminf drop it.
            float enter = fmaxf(fmaxf(nx, ny), fmaxf(nz, least));
            float leave = fminf(fminf(fx, fy), fminf(fz, most));
            // The rounding of the inverses is between the axes. Whether the difference is negative: one instruction instead of a
            // comparison and another.
            constexpr float LATER = 1.0f + 16.0f * UNIT_ROUNDOFF;
            met = __funnelshift_l(__float_as_uint(__fmaf_rn(leave, -LATER, enter)), met, 1);
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
    Way way;
    float t_min;
    unsigned octant; // 7 minus the ray's octant: children on the near side come first
    Group stack[STACK];
    int depth;
    Group group;
    // The triangles that were found last: one bit each, counted from the first.
    unsigned triangles, first;

    // Begins at the root.
    DEVICE_MEMBER void begin(const Params &params, const Query &query) {
        float3 d = vec3(steered(query.direction.x), steered(query.direction.y), steered(query.direction.z));
        way = {query.origin, vec3(1.0f / d.x, 1.0f / d.y, 1.0f / d.z), box_padding(params, query.origin)};
        octant = (d.x < 0.0f ? 0u : 1u) | (d.y < 0.0f ? 0u : 2u) | (d.z < 0.0f ? 0u : 4u);
        t_min = query.t_min;
        depth = 0;
        // One child, and no inner one before it.
        group = {0u, 0x80000000u};
    }
    // Opens the next node. False where none is left after it.
    DEVICE_MEMBER bool advance(const Params &params, float limit) {
        unsigned place = 31u - __clz(group.bits), slot = (place - 24u) ^ octant;
        unsigned index = group.base + __popc(group.bits & 0xffu & ((1u << slot) - 1u));
        group.bits &= ~(1u << place);
        if (group.bits & 0xff000000u) stack[depth++] = group;
        const uint4 *at = node_at(params, index);
        Node node = load_node(at);
        unsigned met = met_slots(node, at, way, t_min, limit);
        group.base = node.meta.x;
        group.bits = in_order(met & node.inner(), octant) << 24 | node.inner();
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
        descent.begin(params, query);
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
        OF_SPHERES(any = with_spheres<ACCEPT>(params, ray, any, best);)
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
        OF_SPHERES(blocked = blocked || occluded_by_sphere<ACCEPT>(params, ray, crossings);)
        return blocked;
    }

    __device__ __forceinline__ bool has_sky() const { return params.sky != nullptr; }
    template <Accept ACCEPT> __device__ __forceinline__ bool closest_on_sky(const Ray &ray, Hit &hit) const {
        Hit found = nearest_in<ACCEPT>(*params.sky, ray);
        if (found.triangle == NO_TRIANGLE) return false;
        hit = found;
        return true;
    }
    // The nearest hit in the tree of these parameters. Called, so that scenes without a sky do not carry it along.
    template <Accept ACCEPT> static __device__ OUTLINED Hit nearest_in(const Params &params, Ray ray) {
        Hit hit;
        if (!Bvh{params}.template closest<ACCEPT>(ray, hit)) hit.triangle = NO_TRIANGLE;
        return hit;
    }

    // Each thread alone. Where they work together, kernels of their own do (`count_open.cuh`).
    template <Accept ACCEPT, class Rays>
    DEVICE_MEMBER unsigned count_open(bool wanted, const Rays &fan, unsigned samples, RayCounts &rays) const {
        return wanted ? count_open_alone<ACCEPT>(*this, fan, samples, rays) : 0u;
    }
    static __device__ __forceinline__ bool any(bool value) { return __any_sync(WHOLE_WARP, value); }
};
