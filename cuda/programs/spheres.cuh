// Exact spheres (`trace/spheres`, `trace/origin/sphere_point.rs`): the test of a ray, a tree over many, and points on them, with the
// numbers of the processor, step by step.
#pragma once
#include "scene.cuh"

// A point of a surface, with what is known of its error along the normal. Rays start off `start`.
struct SurfacePoint {
    float3 position, normal, start;
    float error;
};

// The point of a sphere in a direction from its centre. Its normal points outwards.
DEVICE SurfacePoint point_towards(const Sphere &sphere, double3 direction) {
    double reciprocal = 1.0 / sqrt(dot(direction, direction));
    bool has_direction = isfinite(reciprocal) && reciprocal > 0.0;
    double3 normal = has_direction ? reciprocal * direction : make_double3(0.0, 1.0, 0.0);
    float3 center = vector_of(sphere.center);
    float3 position = narrow(wide(center) + (double)sphere.radius * normal);
    float reach = fmaxf(fmaxf(fabsf(center.x), fabsf(center.y)), fabsf(center.z)) + sphere.radius;
    return {position, narrow(normal), position, UNIT_ROUNDOFF * reach * (SPHERE_OFFSET / OFFSET_UNITS)};
}
// The point of a sphere nearest to a stored position.
DEVICE SurfacePoint on_sphere(const Sphere &sphere, float3 position) {
    return point_towards(sphere, wide(position) - wide(vector_of(sphere.center)));
}
// The point at which a ray meets a sphere at about the distance `t`, which only selects one of two.
DEVICE SurfacePoint met_on_sphere(const Sphere &sphere, float3 origin, float3 direction, float t) {
    double3 from = wide(origin) - wide(vector_of(sphere.center)), unit = normalize_or_zero(wide(direction));
    double b = -dot(from, unit), radius = (double)sphere.radius;
    double3 nearest = from + b * unit;
    double half = sqrt(fmax(radius * radius - dot(nearest, nearest), 0.0));
    return point_towards(sphere, nearest + ((double)t < b ? -half : half) * unit);
}

// The distances at which a ray's line meets a sphere, the lower first; false if it misses (`roots` of `sphere.rs`, which gives the source).
DEVICE bool roots_of(float3 origin, float3 direction, const Sphere &sphere, float &low, float &high) {
    float3 from = origin - vector_of(sphere.center);
    float b = -dot(from, direction);
    float3 nearest = from + b * direction;
    float discriminant = sphere.radius * sphere.radius - dot(nearest, nearest);
    if (!(discriminant >= 0.0f)) return false;
    float half = sqrtf(discriminant), distance = sqrtf(dot(from, from));
    float product = (distance - sphere.radius) * (distance + sphere.radius);
    float q = b < 0.0f ? b - half : b + half;
    // 0 only if the origin is on the sphere and the direction tangent to it: then both roots are 0.
    float other = q == 0.0f ? 0.0f : product / q;
    low = b < 0.0f ? q : other;
    high = b < 0.0f ? other : q;
    return true;
}

// The numbers next to a finite one.
DEVICE float next_below(float x) {
    unsigned bits = __float_as_uint(x);
    if (bits << 1 == 0u) return __uint_as_float(0x80000001u);
    return __uint_as_float(x > 0.0f ? bits - 1u : bits + 1u);
}
DEVICE float next_above(float x) { return -next_below(-x); }

// A ray against boxes. Those of spheres are tested as on the processor, in double precision, since a sphere is met only where its box is. Those
// of nodes are tested in single precision, widened by `pad`, which errs on the side of opening a node.
struct Boxes {
    float3 origin, inverse, pad;
    double3 reciprocal;
    float t_min;

    // Distance at which the ray enters the box of a node; INFINITY if it misses it before `most`.
    DEVICE_MEMBER float enters(const SphereNode &node, float most) const {
        float enter = t_min, leave = most;
        auto axis = [&](float low, float high, float o, float inverse, float pad) {
            float a = (low - pad - o) * inverse, b = (high + pad - o) * inverse;
            enter = fmaxf(enter, fminf(a, b));
            leave = fminf(leave, fmaxf(a, b));
        };
        axis(node.low[0], node.high[0], origin.x, inverse.x, pad.x);
        axis(node.low[1], node.high[1], origin.y, inverse.y, pad.y);
        axis(node.low[2], node.high[2], origin.z, inverse.z, pad.z);
        return enter <= leave ? enter : INFINITY;
    }
    // Whether the ray meets the box of a sphere up to `most`.
    DEVICE_MEMBER bool meets(const Sphere &sphere, float most) const {
        double enter = (double)t_min, leave = (double)most;
        auto axis = [&](float center, float o, double by) {
            double a = ((double)next_below(center - sphere.radius) - (double)o) * by;
            double b = ((double)next_above(center + sphere.radius) - (double)o) * by;
            enter = fmax(enter, fmin(a, b));
            leave = fmin(leave, fmax(a, b));
        };
        axis(sphere.center[0], origin.x, reciprocal.x);
        axis(sphere.center[1], origin.y, reciprocal.y);
        axis(sphere.center[2], origin.z, reciprocal.z);
        return enter <= leave;
    }
};

// By how much boxes of nodes are widened along each axis: above what the test of an axis errs by, which is u times the coordinates of the
// origin, and 4 u times the distance of the farthest plane from it. A direction below LEAST_SLOPE is taken for that, which moves the ray by
// less than any distance that matters.
DEVICE float3 sphere_padding(const Spheres &spheres, float3 origin) {
    float3 a = absolute(vector_of(spheres.low) - origin), b = absolute(vector_of(spheres.high) - origin);
    float3 reach = vec3(fmaxf(a.x, b.x), fmaxf(a.y, b.y), fmaxf(a.z, b.z));
    return (reach * 16.0f + absolute(origin) * 8.0f) * UNIT_ROUNDOFF;
}
constexpr float LEAST_SLOPE = 1.0e-25f;
DEVICE float inverse_slope(float d) { return 1.0f / (fabsf(d) < LEAST_SLOPE ? copysignf(LEAST_SLOPE, d) : d); }
// In the place of the reciprocal of 0, as on the processor.
DEVICE double reciprocal_of(float d) { return d == 0.0f ? 1e300 : 1.0 / (double)d; }

// Whether the ray can meet anything; then `boxes` is prepared.
DEVICE bool prepare(const Spheres &spheres, const Ray &ray, Boxes &boxes) {
    float3 d = ray.direction;
    bool has_direction = d.x != 0.0f || d.y != 0.0f || d.z != 0.0f;
    if (!(is_finite(ray.origin) && is_finite(d) && has_direction && ray.t_min < ray.t_max)) return false;
    boxes.origin = ray.origin;
    boxes.inverse = vec3(inverse_slope(d.x), inverse_slope(d.y), inverse_slope(d.z));
    boxes.pad = sphere_padding(spheres, ray.origin);
    boxes.reciprocal = make_double3(reciprocal_of(d.x), reciprocal_of(d.y), reciprocal_of(d.z));
    boxes.t_min = ray.t_min;
    return true;
}

// Hands the spheres that the line of a ray meets to `each(sphere, low, high)`, which may lower `limit`, and ends when it returns true.
template <class Each> DEVICE void visit_spheres(const Spheres &spheres, const Ray &ray, float &limit, Each &&each) {
    Boxes boxes;
    if (spheres.node_count == 0 || !prepare(spheres, ray, boxes)) return;
    unsigned stack[SPHERE_STACK], waiting = 0, place = 0;
    if (boxes.enters(spheres.nodes[0], limit) == INFINITY) return;
    while (true) {
        const SphereNode &node = spheres.nodes[place];
        if (node.count == 0) {
            unsigned first = node.first;
            float one = boxes.enters(spheres.nodes[first], limit), other = boxes.enters(spheres.nodes[first + 1], limit);
            bool swaps = other < one;
            if (fminf(one, other) != INFINITY) {
                place = swaps ? first + 1 : first;
                if (fmaxf(one, other) != INFINITY) stack[waiting++] = swaps ? first : first + 1;
                continue;
            }
        }
        for (unsigned i = node.first; i < node.first + node.count; ++i) {
            const Sphere &sphere = spheres.list[i];
            float low, high;
            if (!roots_of(ray.origin, ray.direction, sphere, low, high) || !boxes.meets(sphere, limit)) continue;
            if (each(sphere, low, high)) return;
        }
        if (waiting == 0) return;
        place = stack[--waiting];
    }
}

// The searches trace no ray of OptiX, so they are functions there too, and a program has each of them once.

// The nearest accepted hit on a sphere; of several at one distance, the one of the lowest id. NO_TRIANGLE if there is none.
template <Accept ACCEPT> static __device__ __noinline__ Hit closest_sphere(const Params &params, Ray ray) {
    Hit best = {ray.t_max, NO_TRIANGLE, 0.0f, 0.0f};
    const Spheres *spheres = params.spheres;
    if (spheres == nullptr) return best;
    float limit = ray.t_max;
    visit_spheres(*spheres, ray, limit, [&](const Sphere &sphere, float low, float high) {
        for (unsigned way = 0; way < 2; ++way) {
            Hit hit = {way == 0 ? low : high, sphere.id & ~TRANSPARENT, 0.0f, 0.0f};
            bool nearer = best.triangle == NO_TRIANGLE || hit.t < best.t || (hit.t == best.t && hit.triangle < best.triangle);
            if (!(hit.t > ray.t_min && hit.t < ray.t_max && nearer)) continue;
            if (sphere.id & TRANSPARENT && !accepts(params, ACCEPT, hit, nullptr)) continue;
            best = hit;
            limit = hit.t;
            break;
        }
        return false;
    });
    return best;
}

// Completes what a ray met of the triangles by the spheres: `best` where `met` is true. Whether the ray met anything.
template <Accept ACCEPT> DEVICE bool with_spheres(const Params &params, const Ray &ray, bool met, Hit &best) {
    Hit sphere = closest_sphere<ACCEPT>(params, {ray.origin, ray.direction, ray.t_min, met ? best.t : ray.t_max});
    if (sphere.triangle == NO_TRIANGLE) return met;
    best = sphere;
    return true;
}

// Whether there is any accepted hit on a sphere.
template <Accept ACCEPT> static __device__ __noinline__ bool occluded_by_sphere(const Params &params, Ray ray, Crossings *crossings) {
    const Spheres *spheres = params.spheres;
    if (spheres == nullptr) return false;
    float limit = ray.t_max;
    bool blocked = false;
    visit_spheres(*spheres, ray, limit, [&](const Sphere &sphere, float low, float high) {
        for (unsigned way = 0; way < 2 && !blocked; ++way) {
            Hit hit = {way == 0 ? low : high, sphere.id & ~TRANSPARENT, 0.0f, 0.0f};
            if (!(hit.t > ray.t_min && hit.t < ray.t_max)) continue;
            blocked = !(sphere.id & TRANSPARENT) || accepts(params, ACCEPT, hit, crossings);
        }
        return blocked;
    });
    return blocked;
}

// Whether a ray of this length may meet a sphere, whatever its direction. Errs on the side of true: the margin is above what the ray's own
// length and the roots of a sphere err by (16 u times the distance of its centre).
static __device__ __noinline__ bool is_near_sphere(const Params &params, float3 origin, float length) {
    const Spheres *spheres = params.spheres;
    if (spheres == nullptr || spheres->node_count == 0) return false;
    float3 pad = sphere_padding(*spheres, origin);
    float reach = length * 1.001f + 2.0f * fmaxf(fmaxf(pad.x, pad.y), pad.z);
    auto apart = [](float o, float low, float high) { return fmaxf(fmaxf(low - o, o - high), 0.0f); };
    unsigned stack[SPHERE_STACK], waiting = 1;
    stack[0] = 0;
    while (waiting > 0) {
        const SphereNode &node = spheres->nodes[stack[--waiting]];
        float x = apart(origin.x, node.low[0], node.high[0]), y = apart(origin.y, node.low[1], node.high[1]);
        // Written so that what is not a number counts as near.
        if (x > reach || y > reach || apart(origin.z, node.low[2], node.high[2]) > reach) continue;
        if (node.count == 0) {
            stack[waiting++] = node.first;
            stack[waiting++] = node.first + 1;
        }
        for (unsigned i = node.first; i < node.first + node.count; ++i) {
            float3 from = origin - vector_of(spheres->list[i].center);
            if (!(fabsf(sqrtf(dot(from, from)) - spheres->list[i].radius) > reach)) return true;
        }
    }
    return false;
}
