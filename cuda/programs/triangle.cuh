// The watertight triangle test of `trace/single/leaf_test.rs`, operation by operation: hits and their distances are those of the processor,
// bit for bit.
#pragma once
#include "pass.cuh"

// The longest axis of a ray, as two byte selections. Conditions would become branches, in which rays of a warp diverge.
struct Turn {
    unsigned x, y; // SECOND if x (y) is the longest axis, else FIRST

    static constexpr unsigned FIRST = 0x3210u, SECOND = 0x7654u;
    static DEVICE_MEMBER Turn to(int longest) { return {longest == 0 ? SECOND : FIRST, longest == 1 ? SECOND : FIRST}; }
    static DEVICE_MEMBER float choose(float first, float second, unsigned which) {
        return __uint_as_float(__byte_perm(__float_as_uint(first), __float_as_uint(second), which));
    }
    // The other two axes in cyclic order, then the longest.
    DEVICE_MEMBER float3 operator()(float3 v) const {
        return vec3(choose(choose(v.x, v.y, x), v.z, y), choose(choose(v.y, v.z, x), v.x, y),
                    choose(choose(v.z, v.x, x), v.y, y));
    }
};

// A ray prepared for the triangle test.
struct Query {
    float3 origin, direction, permuted_origin, shear;
    float t_min, t_max;
    int longest;
    Turn turn;
};

DEVICE float component(float3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
DEVICE float flush(float d) { return fabsf(d) < 1.17549435e-38f ? d * 0.0f : d; }

// Prepares `query`; false if the ray cannot hit anything.
DEVICE bool prepare(const Ray &ray, Query &query) {
    float3 zero = ray.origin * 0.0f + ray.direction * 0.0f;
    if (!(zero.x + zero.y + zero.z == 0.0f && ray.t_min < ray.t_max && ray.t_max > 0.0f)) return false;
    query.direction = vec3(flush(ray.direction.x), flush(ray.direction.y), flush(ray.direction.z));
    float3 length = absolute(query.direction);
    float longest = fmaxf(fmaxf(length.x, length.y), length.z);
    if (longest == 0.0f) return false;
    query.longest = length.x == longest ? 0 : length.y == longest ? 1 : 2;
    query.origin = ray.origin;
    query.turn = Turn::to(query.longest);
    query.permuted_origin = query.turn(ray.origin);
    float3 d = query.turn(query.direction);
    query.shear = vec3(d.x / d.z, d.y / d.z, 1.0f / d.z);
    query.t_min = fmaxf(ray.t_min, 0.0f) + 0.0f;
    query.t_max = ray.t_max;
    return true;
}

DEVICE float3 sheared(const Query &query, float3 corner) {
    float3 p = query.turn(corner) - query.permuted_origin;
    return vec3(p.x - query.shear.x * p.z, p.y - query.shear.y * p.z, p.z);
}

DEVICE float most_of(float a, float b, float c) { return fmaxf(fmaxf(a, b), c); }
// Largest distance of the scene's bounds from a point, along each axis.
DEVICE float3 reach_from(const Params &params, float3 point) {
    float3 low = vec3(params.scene_low[0], params.scene_low[1], params.scene_low[2]);
    float3 high = vec3(params.scene_high[0], params.scene_high[1], params.scene_high[2]);
    float3 a = absolute(low - point), b = absolute(high - point);
    return vec3(fmaxf(a.x, b.x), fmaxf(a.y, b.y), fmaxf(a.z, b.z));
}

// How far the origin of the slabs is moved outwards along each axis, as in `PreparedRay::new`.
DEVICE float3 slab_padding(const Params &params, const Query &query) {
    float3 reach = reach_from(params, query.origin);
    reach = vec3(fminf(reach.x, LARGEST_REACH), fminf(reach.y, LARGEST_REACH), fminf(reach.z, LARGEST_REACH));
    float along = component(reach, query.longest);
    return (reach + splat(along)) * SLAB_ERROR + absolute(query.origin) * SLAB_ORIGIN_ERROR;
}

// One axis of the interval in which the ray is inside the bounds of a triangle, as in `PreparedRay::span`.
DEVICE float2 interval_axis(float2 range, float origin, float direction, float pad, float a, float b, float c) {
    float inverse = 1.0f / direction;
    float toward = copysignf(pad, inverse);
    float least = fminf(fminf(a, b), c), most = fmaxf(fmaxf(a, b), c);
    bool backward = signbit(inverse);
    float near = ((backward ? most : least) - (origin + toward)) * inverse;
    float far = ((backward ? least : most) - (origin - toward)) * (inverse * FAR_PLANES);
    return make_float2(near > range.x ? near : range.x, far < range.y ? far : range.y);
}

// The corners relative to the ray's origin and sheared, and the edge functions opposite to them.
struct Edges {
    float3 a, b, c;
    float of_a, of_b, of_c;
};
DEVICE Edges edges_of(const Query &query, float3 a, float3 b, float3 c) {
    float3 sa = sheared(query, a), sb = sheared(query, b), sc = sheared(query, c);
    return {sa, sb, sc, sc.x * sb.y - sc.y * sb.x, sa.x * sc.y - sa.y * sc.x, sb.x * sa.y - sb.y * sa.x};
}
// Whether the ray's line misses the triangle.
DEVICE bool passes_by(const Edges &edges) {
    float least = fminf(fminf(edges.of_a, edges.of_b), edges.of_c), most = fmaxf(fmaxf(edges.of_a, edges.of_b), edges.of_c);
    return !(least >= 0.0f || most <= 0.0f);
}

// The hit of the ray on the triangle with t_min < t <= limit; false if there is none.
DEVICE bool intersect(const Params &params, const Query &query, float3 a, float3 b, float3 c, float limit, Hit &hit) {
    Edges edges = edges_of(query, a, b, c);
    if (passes_by(edges)) return false;
    float3 sa = edges.a, sb = edges.b, sc = edges.c;
    float ea = edges.of_a, eb = edges.of_b, ec = edges.of_c;
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
    // The distance is clamped to the triangle's own bounds: for a triangle seen edge-on, the plane may be met anywhere.
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

// A triangle of a leaf: three vectors of four, the corners, with the id in the fourth component of the first.
struct Triangle {
    float3 a, b, c;
    unsigned id;
};
DEVICE Triangle load_triangle(const Params &params, unsigned index) {
    const float4 *t = params.leaves + 3ull * index;
    float4 a = __ldg(t), b = __ldg(t + 1), c = __ldg(t + 2);
    return {xyz(a), xyz(b), xyz(c), __float_as_uint(a.w)};
}
