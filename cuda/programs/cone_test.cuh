// A triangle as a cone seen from one origin: four dot products decide all rays but a few (`trace/fan/cone_test.rs` derives the error
// bounds, which hold with and without fused operations). Undecided rays go to the watertight test, so the result is the same, bit for bit,
// as testing each ray by itself.
#pragma once
#include "triangle.cuh"

// The bounds are those of `trace/rounding.rs`, which writes them to `params.cuh`. The processor computes one height for all origins; here
// the normal and the height are computed for each origin, in double precision.

// `a`, `b`, `c`: normals of the planes through the origin and each edge, pointing towards the triangle, divided by their error bounds.
// Their fourth components: `direction . normal` up to which the triangle is certainly missed; the value from which on it is certainly hit
// if the ray passes within the edges; the index of the triangle in the tree. NaN where nothing is certain. `normal`, the normal of the
// triangle, points away from the origin; its largest component is about 1.
struct Facet {
    float4 a, b, c, normal;
};

// The volume that contains all rays of some length from an origin that go to one side of a plane through it.
struct HalfBall {
    float3 origin, facing;
    float square, nearness; // square of the radius, with a margin; 1 / radius of the rays

    // Whether a ray may come near a triangle.
    DEVICE_MEMBER bool meets(const Triangle &triangle) const;
};

// By how much, along each axis, a ray may miss a box although it hits the triangle inside by the watertight test (`slack` of
// `trace/tree/volumes.rs`).
DEVICE float3 slack_around(const Params &params, float3 origin) {
    float3 reach = reach_from(params, origin);
    float most = most_of(reach.x, reach.y, reach.z);
    return (reach + splat(most)) * SLAB_ERROR + absolute(origin) * SLAB_ORIGIN_ERROR;
}
// `radius` may be less than the length of the rays; then triangles beyond it are left out.
DEVICE HalfBall half_ball(const Params &params, float3 origin, float3 facing, float radius) {
    float3 slack = slack_around(params, origin);
    float grown = radius * LONGEST * BALL_MARGIN + 2.0f * sqrtf(dot(slack, slack));
    return {origin, facing, grown * grown, 1.0f / params.radius};
}

DEVICE float least_of(float a, float b, float c) { return fminf(fminf(a, b), c); }
DEVICE float largest(float3 p) { return most_of(fabsf(p.x), fabsf(p.y), fabsf(p.z)); }
DEVICE double largest(double3 p) { return fmax(fmax(fabs(p.x), fabs(p.y)), fabs(p.z)); }

// Whether a point, relative to a point of a plane, certainly lies behind the plane or on it.
DEVICE bool is_behind(float3 p, float3 normal) {
    float x = p.x * normal.x, y = p.y * normal.y, z = p.z * normal.z;
    return __fmaf_rn(fabsf(x), SIDE_ERROR, x) + __fmaf_rn(fabsf(y), SIDE_ERROR, y) + __fmaf_rn(fabsf(z), SIDE_ERROR, z) <= 0.0f;
}

DEVICE float4 edge_plane(float3 from, float3 to, float unit, float fourth) {
    // The division errs by a few units in the last place, which the error bound allows for.
    float3 normal = cross(from, to) * __fdividef(1.0f, unit * largest(from) * largest(to));
    return make_float4(normal.x, normal.y, normal.z, fourth);
}

DEVICE_MEMBER bool HalfBall::meets(const Triangle &triangle) const {
    float3 a = triangle.a - origin, b = triangle.b - origin, c = triangle.c - origin;
    auto away = [](float least, float most) { return fmaxf(fmaxf(least, -most), 0.0f); };
    float x = away(least_of(a.x, b.x, c.x), most_of(a.x, b.x, c.x));
    float y = away(least_of(a.y, b.y, c.y), most_of(a.y, b.y, c.y));
    float z = away(least_of(a.z, b.z, c.z), most_of(a.z, b.z, c.z));
    if (square <= __fmaf_rn(z, z, __fmaf_rn(y, y, x * x))) return false;
    return !(is_behind(a, facing) && is_behind(b, facing) && is_behind(c, facing));
}

// The facet of a triangle that meets the half ball; `place` is its index in the tree. False if no ray reaches its plane.
DEVICE bool facet_of(const Params &params, const Triangle &triangle, unsigned place, const HalfBall &ball, Facet &facet) {
    float3 a = triangle.a - ball.origin, b = triangle.b - ball.origin, c = triangle.c - ball.origin;
    double3 wa = wide(triangle.a), ab = wide(triangle.b) - wa, ac = wide(triangle.c) - wa, cross_product = cross(ab, ac);
    double size = largest(cross_product);
    bool trusted = size > DEVICE_SHARPEST * largest(ab) * largest(ac);
    double scale = trusted ? (double)(1.0f / (float)size) : NAN;
    float3 normal = narrow(scale * cross_product);
    float height = (float)(scale * dot(cross_product, wa - wide(ball.origin)));
    bool turned = height < 0.0f;
    if (turned) normal = -normal;
    height = fabsf(height);

    float sa = largest(a), sb = largest(b), sc = largest(c), most = most_of(sa, sb, sc);
    bool bounded = SMALLEST <= least_of(sa, sb, sc) && most <= LARGEST;
    float error = __fmaf_rn(height, DEVICE_HEIGHT_ERROR, most * DEVICE_NORMAL_ERROR);
    bool sided = error < height, broad = sided && most * EDGE_ON <= height;
    float at = height * ball.nearness;
    float margin = __fmaf_rn(error, ball.nearness, __fmaf_rn(at, DISTANCE_MARGIN, PLANE_ERROR));
    // No direction is longer than `LONGEST`, so no ray reaches such a plane.
    float reach = sqrtf(dot(normal, normal)) * (LONGEST * LONGEST * (1.0f + 8.0f * UNIT_ROUNDOFF));
    if (broad && reach <= at - margin) return false;
    float unit = bounded && sided ? (turned ? -EDGE_ERROR : EDGE_ERROR) : NAN;
    // A triangle that may have holes: each hit must be tested for coverage.
    bool asked = (triangle.id & TRANSPARENT) && params.cut && (shade_of(params, triangle.id & ~TRANSPARENT).flags & SHADE_CUT);
    facet.a = edge_plane(b, c, unit, broad ? at - margin : sided ? -PLANE_ERROR : NAN);
    facet.b = edge_plane(c, a, unit, asked ? NAN : at + margin);
    facet.c = edge_plane(a, b, unit, __uint_as_float(place));
    facet.normal = make_float4(normal.x, normal.y, normal.z, 0.0f);
    return true;
}

DEVICE float along(float3 d, float4 normal) { return __fmaf_rn(d.z, normal.z, __fmaf_rn(d.y, normal.y, d.x * normal.x)); }

// What is certain of a ray. Comparisons with NaN are false, so they decide nothing.
DEVICE void judge(const Facet &facet, float3 direction, bool &hit, bool &miss) {
    float least = least_of(along(direction, facet.a), along(direction, facet.b), along(direction, facet.c));
    float depth = along(direction, facet.normal);
    miss = least <= -1.0f || depth <= facet.a.w;
    hit = least >= 1.0f && depth >= facet.b.w;
}

// Whether the triangle at index `place` of the tree stops a ray, by the watertight test. Rarely called, so kept out of the loops.
template <Accept ACCEPT>
static __device__ __noinline__ bool stopped_by(const Params &params, float3 origin, float3 direction, unsigned place) {
    Query query;
    if (!prepare({origin, direction, 0.0f, params.radius}, query)) return false;
    Triangle triangle = load_triangle(params, place);
    Hit hit;
    if (!intersect(params, query, triangle.a, triangle.b, triangle.c, query.t_max, hit)) return false;
    hit.triangle = triangle.id & ~TRANSPARENT;
    return hit.t < query.t_max && (!(triangle.id & TRANSPARENT) || accepts(params, ACCEPT, hit, nullptr));
}
