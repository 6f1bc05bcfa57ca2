// Points on surfaces, origins of the rays that leave them, and smooth interfaces (`trace/origin/surface_point.rs`, `effects/surface.rs`,
// `effects/optics.rs`).
#pragma once
#include "ray_cone.cuh"
#include "spheres.cuh"

// Whether a position is within a margin of a border, given the inward direction, as long as the border.
DEVICE bool near_border(double3 position, double3 from, double3 inward, double margin) {
    double area = dot(position - from, inward);
    return area < 0.0 || area * area < margin * margin * dot(inward, inward);
}
// A position of a triangle moved along its plane, away from borders nearer than `margin`, where there is room for that.
DEVICE double3 drawn_in(const double3 (&from)[3], double3 normal, double3 position, double margin) {
    double3 inward[3];
    bool near = false;
#pragma unroll
    for (int border = 0; border < 3; ++border) {
        inward[border] = cross(normal, from[(border + 1) % 3] - from[border]);
        near = near || near_border(position, from[border], inward[border], margin);
    }
    if (!near) return position;
    double3 moved = position;
    // Twice, because leaving one border of a corner may lead back to the other.
#pragma unroll 1
    for (int round = 0; round < 2; ++round) {
#pragma unroll
        for (int border = 0; border < 3; ++border) {
            double3 unit = normalize_or_zero(inward[border]);
            moved = moved + fmax(margin - dot(moved - from[border], unit), 0.0) * unit;
        }
    }
    near = false;
#pragma unroll
    for (int border = 0; border < 3; ++border) {
        near = near || near_border(moved, from[border], inward[border], 0.5 * margin);
    }
    return near ? position : moved;
}

DEVICE SurfacePoint point_on(const Corners &corners, double u, double v) {
    double3 a = wide(corners.a), e1 = wide(corners.b) - a, e2 = wide(corners.c) - a;
    double3 normal = normalize_or_zero(cross(e1, e2));
    double3 ue = u * e1, ve = v * e2;
    double3 magnitude = absolute(a) + absolute(ue) + absolute(ve);
    double3 position = a + ue + ve;
    double reach = 0.0;
    double3 from[3] = {a, wide(corners.b), wide(corners.c)};
    double3 distances[3] = {absolute(a - position), absolute(from[1] - position), absolute(from[2] - position)};
#pragma unroll
    for (int corner = 0; corner < 3; ++corner) {
        reach = fmax(reach, fmax(fmax(distances[corner].x, distances[corner].y), distances[corner].z));
    }
    float error = (float)(dot(absolute(normal), magnitude) + (double)OFFSET_REACH * reach) * UNIT_ROUNDOFF;
    double largest = fmax(fmax(magnitude.x, magnitude.y), magnitude.z);
    double margin = (double)OFFSET_MARGIN * (double)UNIT_ROUNDOFF * (largest + (double)OFFSET_REACH * reach);
    return {narrow(position), narrow(normal), narrow(drawn_in(from, normal, position, margin)), error};
}
// The point of a triangle or sphere nearest to a stored position.
DEVICE SurfacePoint snap(const Params &params, unsigned triangle, float3 position) {
    OF_SPHERES(if (is_sphere(params, triangle)) return on_sphere(sphere_of(params, triangle), position);)
    Corners corners = positions_of(params, triangle);
    double3 a = wide(corners.a), e1 = wide(corners.b) - a, e2 = wide(corners.c) - a, to = wide(position) - a;
    double d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2), d1 = dot(to, e1), d2 = dot(to, e2);
    double determinant = d11 * d22 - d12 * d12;
    double u = (d22 * d1 - d12 * d2) / determinant, v = (d11 * d2 - d12 * d1) / determinant;
    if (!isfinite(u + v)) u = v = 0.0;
    u = fmax(u, 0.0);
    v = fmax(v, 0.0);
    double sum = fmax(u + v, 1.0);
    return point_on(corners, u / sum, v / sum);
}
// Where a ray in this direction starts: inside the borders, and off the plane to the side to which it goes.
DEVICE float3 spawn(const SurfacePoint &point, float3 direction) {
    float distance = OFFSET_UNITS * point.error;
    return point.start + point.normal * (dot(point.normal, direction) < 0.0f ? -distance : distance);
}

// The coordinates of a point in the plane of a triangle, as a hit at distance 0.
DEVICE Hit locate(const Params &params, unsigned triangle, float3 position) {
    Corners corners = positions_of(params, triangle);
    double3 a = wide(corners.a), e1 = wide(corners.b) - a, e2 = wide(corners.c) - a, to = wide(position) - a;
    double3 normal = cross(e1, e2);
    double area = dot(normal, normal);
    return {0.0f, triangle, (float)(dot(cross(to, e2), normal) / area), (float)(dot(cross(e1, to), normal) / area)};
}
// By how much a point below the plane through a corner is lifted onto it.
DEVICE float3 lift(float3 position, float3 corner, float3 normal) {
    return normal * fmaxf(0.0f, -dot(position - corner, normal));
}
// The normals at a triangle's corners, turned to the side of `facing`; false where the triangle stands for no round surface
// (`effects/terminator.rs`).
struct Round {
    float3 a, b, c;
};
DEVICE float3 weighed(const Round &of, const Hit &at) { return of.a * (1.0f - at.u - at.v) + of.b * at.u + of.c * at.v; }
DEVICE bool round_normals(const Params &params, unsigned triangle, float3 facing, Round &normals) {
    OF_SPHERES(if (is_sphere(params, triangle)) return false;)
    if (params.normals == nullptr) return false;
    uint3 i = corners_of(params, triangle);
    float3 na = vector_at(params.normals, i.x), nb = vector_at(params.normals, i.y), nc = vector_at(params.normals, i.z);
    if (equal(na, nb) && equal(nb, nc)) return false;
    float a = dot(na, facing), b = dot(nb, facing), c = dot(nc, facing);
    bool above = a >= ROUND && b >= ROUND && c >= ROUND, below = -a >= ROUND && -b >= ROUND && -c >= ROUND;
    normals = below ? Round{-na, -nb, -nc} : Round{na, nb, nc};
    return above || below;
}
// The normal that decides what light reaches a side: that of the round surface that the triangle stands for, else `facing`.
DEVICE float3 horizon(const Params &params, unsigned triangle, const SurfacePoint &point, float3 facing) {
    Round normals;
    if (!round_normals(params, triangle, facing, normals)) return facing;
    return weighed(normals, locate(params, triangle, point.position));
}
// Whether a side gets no light at points like this: the triangle is turned away from it, or the round surface is that it stands for.
DEVICE bool is_turned(const Params &params, unsigned triangle, const SurfacePoint &point, float3 facing, float3 to_light) {
    if (dot(facing, to_light) <= 0.0f) return true;
    Round normals;
    if (!round_normals(params, triangle, facing, normals)) return false;
    // Where all corners are lit, so is what lies between.
    if (dot(normals.a, to_light) > 0.0f && dot(normals.b, to_light) > 0.0f && dot(normals.c, to_light) > 0.0f) return false;
    return dot(weighed(normals, locate(params, triangle, point.position)), to_light) <= 0.0f;
}
// From a point of a triangle that is turned away from the light, on the side of normal `facing`, onto the round surface; 0 where no light
// falls there.
DEVICE float3 lifted(const Params &params, unsigned triangle, const SurfacePoint &point, float3 facing, float3 to_light) {
    const float3 none = splat(0.0f);
    Round normals;
    if (!round_normals(params, triangle, facing, normals)) return none;
    Hit at = locate(params, triangle, point.position);
    if (dot(weighed(normals, at), to_light) <= 0.0f) return none;
    Corners corners = positions_of(params, triangle);
    Round lifts = {lift(point.position, corners.a, normals.a), lift(point.position, corners.b, normals.b),
                   lift(point.position, corners.c, normals.c)};
    float3 way = weighed(lifts, at);
    return is_finite(way) ? way : none;
}

// A point seen from one side: the geometric normal towards the viewer, and the shading normal on the same side.
struct Surface {
    SurfacePoint point;
    float3 facing, normal;
};
DEVICE Surface surface_of(const SurfacePoint &point, float3 normal, float3 view) {
    float3 facing = dot(point.normal, view) > 0.0f ? -point.normal : point.normal;
    normal = normalize_or(normal, facing);
    return {point, facing, dot(normal, facing) < 0.0f ? -normal : normal};
}

DEVICE float3 reflect(float3 i, float3 n) { return i - 2.0f * n * dot(n, i); }

DEVICE float3 interface_normal(const Surface &surface, float3 view) {
    bool usable = dot(surface.normal, view) < 0.0f && dot(reflect(view, surface.normal), surface.facing) > 0.0f;
    return usable ? surface.normal : surface.facing;
}

// The point that a ray from an origin meets; its bumps are read at the level of the footprint.
DEVICE Surface surface_hit(const Params &params, OF_SPHERES(float3 origin, ) float3 direction, const Hit &hit, float footprint) {
    OF_SPHERES(if (is_sphere(params, hit.triangle)) {
        SurfacePoint point = met_on_sphere(sphere_of(params, hit.triangle), origin, direction, hit.t);
        return surface_of(point, point.normal, direction);
    })
    SurfacePoint point = point_on(positions_of(params, hit.triangle), (double)hit.u, (double)hit.v);
    return surface_of(point, bent_normal(params, hit, normal_at(params, hit), point.normal, footprint), direction);
}

struct Interface {
    float reflectance, cos_refracted;
};
// Of light that is polarised across the plane of incidence (FRESNEL_S), in it (FRESNEL_P), or not at all.
DEVICE Interface fresnel(float cos_incident, float index_of_pane, unsigned weights) {
    double cos_in = (double)fminf(fmaxf(cos_incident, 0.0f), 1.0f), index = (double)index_of_pane;
    double discriminant = index * index - 1.0 + cos_in * cos_in;
    if (discriminant <= 0.0) return {1.0f, 0.0f};
    double cos_out = sqrt(discriminant) / index;
    double perpendicular = (cos_in - index * cos_out) / (cos_in + index * cos_out);
    double parallel = (index * cos_in - cos_out) / (index * cos_in + cos_out);
    double reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    if (weights == FRESNEL_S) reflectance = perpendicular * perpendicular;
    if (weights == FRESNEL_P) reflectance = parallel * parallel;
    return {(float)reflectance, (float)cos_out};
}
DEVICE Interface schlick(float cos_incident, float index) {
    float cos_in = fminf(fmaxf(cos_incident, 0.0f), 1.0f);
    float discriminant = (index - 1.0f) * (index + 1.0f) + cos_in * cos_in;
    if (discriminant <= 0.0f) return {1.0f, 0.0f};
    float cos_out = fminf(sqrtf(discriminant) / index, 1.0f);
    float root = (index - 1.0f) / (index + 1.0f), zero = root * root;
    float away = 1.0f - (index < 1.0f ? cos_out : cos_in), square = away * away;
    return {fminf(zero + (1.0f - zero) * (square * square * away), 1.0f), cos_out};
}
DEVICE Interface interface_at(const Params &params, float cos_incident, float ratio) {
    unsigned weights = params.fresnel;
    return weights == FRESNEL_SCHLICK ? schlick(cos_incident, ratio) : fresnel(cos_incident, ratio, weights);
}
DEVICE Interface interface_of(const Params &params, float cos_incident) { return interface_at(params, cos_incident, params.index); }
DEVICE bool refract(const Interface &interface, float3 i, float3 n, float index, float3 &out) {
    if (interface.reflectance >= 1.0f) return false;
    float3 along = i - n * dot(n, i);
    return try_normalize(along / index - n * interface.cos_refracted, out);
}

// What the report's device code takes from OptiX, for thesis fidelity.
DEVICE bool is_glass_mask(float4 color) { return color.x > 0.0f && color.y == 0.0f && color.z > 0.0f && color.w == 0.0f; }
DEVICE bool thesis_refract(float3 i, float3 n, float index, float3 &out) {
    float cosine = dot(i, n), eta = 1.0f / index;
    if (cosine > 0.0f) {
        n = -n;
        cosine = -cosine;
        eta = index;
    }
    float k = 1.0f - eta * eta * (1.0f - cosine * cosine);
    if (k < 0.0f) return false;
    float3 refracted = eta * i - (eta * cosine + sqrtf(k)) * n;
    out = refracted * length_recip(refracted);
    return true;
}
DEVICE float3 face_forward(float3 n, float3 i, float3 reference) { return n * copysignf(1.0f, dot(i, reference)); }
DEVICE float thesis_coefficient(float index, float3 n, float3 d) {
    float cosine = dot(n, -d);
    return 1.0f - index * index * (1.0f - cosine * cosine);
}
DEVICE float3 thesis_view(const Params &params, float3 position) {
    float3 direction = position - vec3(params.eye[0], params.eye[1], params.eye[2]);
    return direction * length_recip(direction);
}
struct ThesisNormals {
    float3 geometric, shading;
};
DEVICE ThesisNormals thesis_normals(const Params &params, const Hit &hit) {
    Corners corners = positions_of(params, hit.triangle);
    return {normalize_or_zero(cross(corners.b - corners.a, corners.c - corners.a)),
            normalize_or_zero(normal_at(params, hit))};
}
DEVICE float3 hit_position(const Ray &ray, const Hit &hit) { return ray.origin + hit.t * ray.direction; }
