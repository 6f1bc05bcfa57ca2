// Our own traversal of the wide tree that `trace/device.rs` writes, one ray a thread.
//
// What a ray hits, and at what distance, is decided by the watertight test of `trace/block.rs`, operation by operation; the
// tree only leads to triangles. Its boxes are quantised outwards, and the box test is conservative against the one of
// `trace/query.rs`, so the answers are those of the processor, bit for bit.
//
// Traversal by groups of children in the order of the ray's octant: Ylitie, Karras and Laine, "Efficient Incoherent Ray
// Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 4.
#pragma once
#include "pass.cuh"

constexpr unsigned WHOLE_WARP = ~0u;

// Between the smallest reciprocal that does not overflow and the largest slope that matters: a ray that runs along an axis
// is treated as one that leaves it by this share, which no coordinate of the scene notices.
constexpr float LEAST_DIRECTION = 1.0e-25f;

// A ray prepared for the triangle test.
struct Query {
    float3 origin, direction, permuted_origin, shear;
    float t_min, t_max;
    int longest;
};

DEVICE float component(float3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
// The two other axes in order, then the longest.
DEVICE float3 permute(float3 v, int longest) {
    return longest == 0 ? vec3(v.y, v.z, v.x) : longest == 1 ? vec3(v.z, v.x, v.y) : v;
}
DEVICE float flush(float d) { return fabsf(d) < 1.17549435e-38f ? d * 0.0f : d; }

// Whether the ray can hit anything; then `query` is prepared.
DEVICE bool prepare(const Ray &ray, Query &query) {
    float3 zero = ray.origin * 0.0f + ray.direction * 0.0f;
    if (!(zero.x + zero.y + zero.z == 0.0f && ray.t_min < ray.t_max && ray.t_max > 0.0f)) return false;
    query.direction = vec3(flush(ray.direction.x), flush(ray.direction.y), flush(ray.direction.z));
    float3 length = absolute(query.direction);
    float longest = fmaxf(fmaxf(length.x, length.y), length.z);
    if (longest == 0.0f) return false;
    query.longest = length.x == longest ? 0 : length.y == longest ? 1 : 2;
    query.origin = ray.origin;
    query.permuted_origin = permute(ray.origin, query.longest);
    float3 d = permute(query.direction, query.longest);
    query.shear = vec3(d.x / d.z, d.y / d.z, 1.0f / d.z);
    query.t_min = fmaxf(ray.t_min, 0.0f) + 0.0f;
    query.t_max = ray.t_max;
    return true;
}

DEVICE float3 sheared(const Query &query, float3 corner) {
    float3 p = permute(corner, query.longest) - query.permuted_origin;
    return vec3(p.x - query.shear.x * p.z, p.y - query.shear.y * p.z, p.z);
}

// How far the origin of the slabs is moved outwards along each axis, as in `Query::new`.
DEVICE float3 slab_padding(const Params &params, const Query &query) {
    float3 low = vec3(params.scene_low[0], params.scene_low[1], params.scene_low[2]);
    float3 high = vec3(params.scene_high[0], params.scene_high[1], params.scene_high[2]);
    float3 a = absolute(low - query.origin), b = absolute(high - query.origin);
    float3 reach = vec3(fminf(fmaxf(a.x, b.x), 1.0e30f), fminf(fmaxf(a.y, b.y), 1.0e30f), fminf(fmaxf(a.z, b.z), 1.0e30f));
    float along = component(reach, query.longest);
    return (reach + splat(along)) * (8.0f * UNIT_ROUNDOFF) + absolute(query.origin) * (2.0f * UNIT_ROUNDOFF);
}

// The interval in which the ray is in the bounds of a triangle, as in `Query::interval`.
DEVICE float2 interval_axis(float2 range, float origin, float direction, float pad, float a, float b, float c) {
    float inverse = 1.0f / direction;
    float toward = copysignf(pad, inverse);
    float least = fminf(fminf(a, b), c), most = fmaxf(fmaxf(a, b), c);
    bool backward = signbit(inverse);
    float near = ((backward ? most : least) - (origin + toward)) * inverse;
    float far = ((backward ? least : most) - (origin - toward)) * (inverse * (1.0f + 8.0f * UNIT_ROUNDOFF));
    return make_float2(near > range.x ? near : range.x, far < range.y ? far : range.y);
}

// Where the ray meets the triangle with t_min < t <= limit.
DEVICE bool intersect(const Params &params, const Query &query, float3 a, float3 b, float3 c, float limit, Hit &hit) {
    float3 sa = sheared(query, a), sb = sheared(query, b), sc = sheared(query, c);
    float ea = sc.x * sb.y - sc.y * sb.x, eb = sa.x * sc.y - sa.y * sc.x, ec = sb.x * sa.y - sb.y * sa.x;
    float least = fminf(fminf(ea, eb), ec), most = fmaxf(fmaxf(ea, eb), ec);
    if (!(least >= 0.0f || most <= 0.0f)) return false;
    double3 wa = wide(a), normal = cross(wide(b) - wa, wide(c) - wa);
    float t = (float)(dot(normal, wa - wide(query.origin)) / dot(normal, wide(query.direction)));
    if (!(t > query.t_min && t <= limit) && isfinite(t)) return false;
    if (ea == 0.0f || eb == 0.0f || ec == 0.0f) {
        double da = (double)sc.x * sb.y - (double)sc.y * sb.x;
        double db = (double)sa.x * sc.y - (double)sa.y * sc.x;
        double dc = (double)sb.x * sa.y - (double)sb.y * sa.x;
        double determinant = da + db + dc;
        bool negative = da < 0.0 || db < 0.0 || dc < 0.0, positive = da > 0.0 || db > 0.0 || dc > 0.0;
        if ((negative && positive) || determinant == 0.0) return false;
        hit.u = (float)(db / determinant);
        hit.v = (float)(dc / determinant);
    } else {
        float determinant = ea + eb + ec;
        hit.u = eb / determinant;
        hit.v = ec / determinant;
    }
    // The distance is kept within the triangle's own bounds: seen edge-on, the plane may be met anywhere.
    float3 pad = slab_padding(params, query);
    float2 range = make_float2(query.t_min, INFINITY);
    range = interval_axis(range, query.origin.x, query.direction.x, pad.x, a.x, b.x, c.x);
    range = interval_axis(range, query.origin.y, query.direction.y, pad.y, a.y, b.y, c.y);
    range = interval_axis(range, query.origin.z, query.direction.z, pad.z, a.z, b.z, c.z);
    t = t < range.y ? t : range.y;
    t = t < range.x ? range.x : t;
    hit.t = t;
    return t > query.t_min && t <= limit;
}

DEVICE unsigned byte_of(unsigned word, int index) { return __byte_perm(word, 0u, 0x4440u + (unsigned)index); }
DEVICE float scale_of(unsigned exponent) { return __uint_as_float(exponent << 23); }

// A node as it is stored: 80 bytes.
struct Node {
    uint4 head, meta, low_xy, low_z_high_x, high_yz;
};
DEVICE Node load_node(const Params &params, unsigned index) {
    const uint4 *n = params.nodes + 5ull * index;
    return {__ldg(n), __ldg(n + 1), __ldg(n + 2), __ldg(n + 3), __ldg(n + 4)};
}

// One axis of the box test: distance = quantum * step + base, with the padding of the slabs in the bases.
struct Slab {
    float near_base, far_base, near_step, far_step;
    unsigned near0, near1, far0, far1;
};
DEVICE Slab slab_of(float corner, float scale, float near_origin, float far_origin, float inverse, unsigned low0, unsigned low1,
                    unsigned high0, unsigned high1) {
    float far_inverse = inverse * (1.0f + 8.0f * UNIT_ROUNDOFF);
    bool backward = inverse < 0.0f;
    return {(corner - near_origin) * inverse, (corner - far_origin) * far_inverse, scale * inverse, scale * far_inverse,
            backward ? high0 : low0,          backward ? high1 : low1,           backward ? low0 : high0,
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

// The children that the ray meets up to `limit`: inner nodes in bits 24..31 by order, triangles in bits 0..23.
DEVICE unsigned met_children(const Node &node, const Traversal &walk, float t_min, float limit) {
    float3 corner = vec3(__uint_as_float(node.head.x), __uint_as_float(node.head.y), __uint_as_float(node.head.z));
    Slab x = slab_of(corner.x, scale_of(byte_of(node.head.w, 0)), walk.near_origin.x, walk.far_origin.x, walk.inverse.x,
                     node.low_xy.x, node.low_xy.y, node.low_z_high_x.z, node.low_z_high_x.w);
    Slab y = slab_of(corner.y, scale_of(byte_of(node.head.w, 1)), walk.near_origin.y, walk.far_origin.y, walk.inverse.y,
                     node.low_xy.z, node.low_xy.w, node.high_yz.x, node.high_yz.y);
    Slab z = slab_of(corner.z, scale_of(byte_of(node.head.w, 2)), walk.near_origin.z, walk.far_origin.z, walk.inverse.z,
                     node.low_z_high_x.x, node.low_z_high_x.y, node.high_yz.z, node.high_yz.w);
    unsigned met = 0;
#pragma unroll
    for (int child = 0; child < 8; ++child) {
        int byte = child & 3;
        unsigned meta = byte_of(child < 4 ? node.meta.z : node.meta.w, byte);
        auto near = [&](const Slab &s) {
            return __fmaf_rn((float)byte_of(child < 4 ? s.near0 : s.near1, byte), s.near_step, s.near_base);
        };
        auto far = [&](const Slab &s) {
            return __fmaf_rn((float)byte_of(child < 4 ? s.far0 : s.far1, byte), s.far_step, s.far_base);
        };
        // A distance that is not a number restricts nothing: fmaxf and fminf drop it.
        float enter = fmaxf(fmaxf(near(x), near(y)), fmaxf(near(z), t_min));
        float leave = fminf(fminf(far(x), far(y)), fminf(far(z), limit));
        if (enter <= leave) {
            unsigned place = meta & 31u;
            met |= (meta >> 5) << (place >= 24u ? place ^ walk.octant : place);
        }
    }
    return met;
}

// The triangles of a leaf, three vectors of four: corners, and the id in the first one's fourth.
struct Triangle {
    float3 a, b, c;
    unsigned id;
};
DEVICE Triangle load_triangle(const Params &params, unsigned index) {
    const float4 *t = params.leaves + 3ull * index;
    float4 a = __ldg(t), b = __ldg(t + 1), c = __ldg(t + 2);
    return {xyz(a), xyz(b), xyz(c), __float_as_uint(a.w)};
}

// A set of children of one node: those still to be visited.
struct Group {
    unsigned base; // of the inner children
    unsigned bits; // inner children by order in 24..31; which slots are inner children in 0..7
};

struct Bvh {
    const Params &params;

    template <class Found>
    __device__ __forceinline__ void walk(const Query &query, float &limit, Found &&found) const {
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
                index = 0;
                group.bits = 0;
                root = false;
            } else {
                unsigned slot = (place - 24u) ^ walk.octant;
                index = group.base + __popc(group.bits & 0xffu & ((1u << slot) - 1u));
                group.bits &= ~(1u << place);
            }
            if (group.bits & 0xff000000u) stack[depth++] = group;
            Node node = load_node(params, index);
            unsigned met = met_children(node, walk, query.t_min, limit);
            group.base = node.meta.x;
            group.bits = (met & 0xff000000u) | (node.head.w >> 24);
            unsigned triangles = met & 0x00ffffffu;
            while (triangles != 0) {
                unsigned offset = __ffs(triangles) - 1;
                triangles &= triangles - 1;
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

    template <Accept ACCEPT> __device__ __forceinline__ bool occluded(const Ray &ray, Crossings *crossings) const {
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

    // Whether any of the gathered triangles stops the ray.
    template <Accept ACCEPT> __device__ __forceinline__ bool blocked_by(const Ray &ray, const unsigned *found, int count) const {
        Query query;
        if (!prepare(ray, query)) return false;
        for (int i = 0; i < count; ++i) {
            Triangle triangle = load_triangle(params, found[i]);
            Hit hit;
            if (!intersect(params, query, triangle.a, triangle.b, triangle.c, query.t_max, hit)) continue;
            hit.triangle = triangle.id & ~TRANSPARENT;
            if (hit.t < query.t_max && (!(triangle.id & TRANSPARENT) || accepts(params, ACCEPT, hit, nullptr))) return true;
        }
        return false;
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

// The contribution of one axis to an upper bound of the height of a box above a plane (`trace/clear.rs`).
DEVICE float height_bound(float low, float high, float origin, float normal) {
    float a = (low - origin) * normal, b = (high - origin) * normal;
    float most = fmaxf(a, b), size = fmaxf(most, -fminf(a, b));
    return most + size * (8.0f * UNIT_ROUNDOFF);
}

// Looks into a few nodes; giving up is never wrong. What is left out is met by no ray to the normal's side.
__device__ __forceinline__ int search(const Params &params, float3 origin, float3 normal, float radius,
                                      unsigned *found) {
    if (params.node_count == 0) return 0;
    float3 low, high;
    {
        auto side = [&](float o, float n, float &least, float &most) {
            float rim = sqrtf(fmaxf(1.0f - n * n, 0.0f)) + 4.0f * 2.44140625e-4f;
            rim = fminf(rim, 1.0f);
            float pad = (radius + fabsf(o)) * (32.0f * UNIT_ROUNDOFF);
            least = o - radius * (n >= 0.0f ? rim : 1.0f) - pad;
            most = o + radius * (n >= 0.0f ? 1.0f : rim) + pad;
        };
        side(origin.x, normal.x, low.x, high.x);
        side(origin.y, normal.y, low.y, high.y);
        side(origin.z, normal.z, low.z, high.z);
    }
    if (!(is_finite(low) && is_finite(high))) return -1;
    // What lies in the box and not certainly below the plane may be hit.
    auto reached = [&](float3 least, float3 most) {
        if (least.x > high.x || most.x < low.x || least.y > high.y || most.y < low.y || least.z > high.z || most.z < low.z) {
            return false;
        }
        return height_bound(least.x, most.x, origin.x, normal.x) + height_bound(least.y, most.y, origin.y, normal.y) +
                   height_bound(least.z, most.z, origin.z, normal.z) >
               0.0f;
    };
    unsigned pending[CLEAR_VISITS];
    int count = 1, gathered = 0;
    pending[0] = 0;
    for (unsigned visit = 0; visit < CLEAR_VISITS; ++visit) {
        Node node = load_node(params, pending[--count]);
        float3 corner = vec3(__uint_as_float(node.head.x), __uint_as_float(node.head.y), __uint_as_float(node.head.z));
        float3 scale = vec3(scale_of(byte_of(node.head.w, 0)), scale_of(byte_of(node.head.w, 1)), scale_of(byte_of(node.head.w, 2)));
        unsigned inner = 0;
#pragma unroll
        for (int child = 0; child < 8; ++child) {
            int byte = child & 3;
            bool first = child < 4;
            unsigned meta = byte_of(first ? node.meta.z : node.meta.w, byte);
            if (meta == 0) continue;
            auto plane = [&](unsigned word0, unsigned word1) { return (float)byte_of(first ? word0 : word1, byte); };
            // Rounded to nearest, as when the boxes were written: the planes are where they were found to be.
            float3 least = vec3(__fmaf_rn(plane(node.low_xy.x, node.low_xy.y), scale.x, corner.x),
                                __fmaf_rn(plane(node.low_xy.z, node.low_xy.w), scale.y, corner.y),
                                __fmaf_rn(plane(node.low_z_high_x.x, node.low_z_high_x.y), scale.z, corner.z));
            float3 most = vec3(__fmaf_rn(plane(node.low_z_high_x.z, node.low_z_high_x.w), scale.x, corner.x),
                               __fmaf_rn(plane(node.high_yz.x, node.high_yz.y), scale.y, corner.y),
                               __fmaf_rn(plane(node.high_yz.z, node.high_yz.w), scale.z, corner.z));
            if (!reached(least, most)) continue;
            unsigned place = meta & 31u;
            if (place >= 24u) {
                inner |= 1u << (place - 24u);
                continue;
            }
            for (unsigned k = 0; k < (unsigned)__popc(meta >> 5); ++k) {
                Triangle triangle = load_triangle(params, node.meta.y + place + k);
                float3 a = triangle.a, b = triangle.b, c = triangle.c;
                float3 from = vec3(fminf(fminf(a.x, b.x), c.x), fminf(fminf(a.y, b.y), c.y), fminf(fminf(a.z, b.z), c.z));
                float3 to = vec3(fmaxf(fmaxf(a.x, b.x), c.x), fmaxf(fmaxf(a.y, b.y), c.y), fmaxf(fmaxf(a.z, b.z), c.z));
                bool outside = from.x > high.x || to.x < low.x || from.y > high.y || to.y < low.y || from.z > high.z || to.z < low.z;
                auto above = [&](float3 p) {
                    return height_bound(p.x, p.x, origin.x, normal.x) + height_bound(p.y, p.y, origin.y, normal.y) +
                               height_bound(p.z, p.z, origin.z, normal.z) >
                           0.0f;
                };
                if (outside || !(above(a) || above(b) || above(c))) continue;
                if (gathered == GATHERED) return -1;
                found[gathered++] = node.meta.y + place + k;
            }
        }
        unsigned mask = node.head.w >> 24;
        while (inner != 0) {
            unsigned slot = __ffs(inner) - 1;
            inner &= inner - 1;
            if (count == CLEAR_VISITS) return -1;
            pending[count++] = node.meta.x + __popc(mask & ((1u << slot) - 1u));
        }
        if (count == 0) return gathered;
    }
    return -1;
}

// A fan of a block, where all threads of a warp see it.
struct SharedFan {
    Fan fan;
    int count;                // of the triangles below; below 0: too many, the tree is searched
    unsigned found[GATHERED]; // triangles that may stop a ray
};

// Bits `from` to `to` of a word, where they exist.
DEVICE unsigned bits_between(long long from, long long to) {
    if (from >= 32 || to <= 0) return 0u;
    unsigned below = from > 0 ? (1u << from) - 1u : 0u;
    return (to < 32 ? (1u << to) - 1u : ~0u) & ~below;
}

// The rays of all fans of a warp are dealt to its threads: those of one fan side by side, since they start at one point and
// may be tested against one list.
template <Accept ACCEPT>
__device__ __forceinline__ unsigned Bvh::count_open(bool wanted, const Fan &fan, unsigned samples, RayCounts &rays) const {
    __shared__ SharedFan fans[BLOCK_WIDTH * BLOCK_HEIGHT];
    __shared__ unsigned char order[BLOCK_WIDTH * BLOCK_HEIGHT];
    unsigned thread = threadIdx.y * BLOCK_WIDTH + threadIdx.x, lane = thread % 32u, warp = thread - lane;
    unsigned open = 0;
    int count = 0;
    if (wanted) {
        count = search(params, fan.origin, fan.facing, params.radius, fans[thread].found);
        if (count == 0) {
            rays.certain += samples;
            open = samples;
        } else {
            rays.occlusion += samples;
            fans[thread].fan = fan;
            fans[thread].count = count;
        }
    }
    // First the fans with few triangles, then the others, so that threads do the same.
#pragma unroll
    for (int few = 1; few >= 0; --few) {
        bool traces = few == 1 ? count > 0 : count < 0;
        unsigned mask = __ballot_sync(WHOLE_WARP, traces);
        unsigned place = __popc(mask & ((1u << lane) - 1u)), total = __popc(mask) * samples;
        if (traces) order[warp + place] = (unsigned char)lane;
        __syncwarp();
        for (unsigned first = 0; first < total; first += 32u) {
            unsigned index = first + lane;
            bool clear = false;
            if (index < total) {
                unsigned owner = index / samples, sample = index - owner * samples;
                const SharedFan &shared = fans[warp + order[warp + owner]];
                Ray ray;
                shared.fan.ray(params, sample, ray);
                clear = !(few == 1 ? blocked_by<ACCEPT>(ray, shared.found, shared.count) : occluded<ACCEPT>(ray, nullptr));
            }
            // The part of the 32 rays that is of this thread's own fan.
            long long from = (long long)place * samples - first;
            unsigned own = traces ? bits_between(from, from + samples) : 0u;
            open += __popc(__ballot_sync(WHOLE_WARP, clear) & own);
        }
        __syncwarp();
    }
    return open;
}
