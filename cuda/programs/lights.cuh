// What arrives of lights at a surface (`effects/lights.rs` and `backend/light.rs`). Programs for one directional light that is a point and those
// for several lights, for lights with a place and for discs are compiled from the same texts; CURITIBA_LIGHTS tells them apart.
#pragma once
#include "surface.cuh"

// The share of a spot light at an angle of this cosine from its axis.
DEVICE float cone_share(const Light &light, float cosine) {
    float share = 0.0f;
    if (cosine >= light.inner) {
        share = 1.0f;
    } else if (cosine > light.outer) {
        share = (cosine - light.outer) / (light.inner - light.outer);
    }
    float edge = share * share;
    if (light.exponent == 0.0f) return edge;
    // The power of single precision takes small numbers for 0.
    return edge * (float)pow((double)fmaxf(cosine, 0.0f), (double)light.exponent);
}
// What of a light arrives at a point: the unit direction to it, and the share of its colour. At the light's own place nothing does.
struct Arriving {
    float3 towards;
    float factor;
};
DEVICE Arriving arriving(const Light &light, float3 point) {
    float3 axis = vector_of(light.direction);
    if (!(light.flags & LIGHT_PLACE)) return {-axis, 1.0f};
    float3 way = vector_of(light.place) - point;
    float squared = dot(way, way);
    if (!(squared > 0.0f && squared < INFINITY)) return {splat(0.0f), 0.0f};
    float distance = sqrtf(squared);
    float3 towards = way * (1.0f / distance);
    float divisor = light.attenuation[0] + light.attenuation[1] * distance + light.attenuation[2] * squared;
    float near = distance / light.range;
    float window = fmaxf(1.0f - near * near * near * near, 0.0f);
    float cone = light.flags & LIGHT_CONE ? cone_share(light, -dot(towards, axis)) : 1.0f;
    return {towards, window * cone / fmaxf(divisor, LEAST_DIVISOR)};
}

#ifdef CURITIBA_LIGHTS
// What arrives of a light where something opaque is in the way: above 0 of a single directional light.
DEVICE float in_shadow(const Params &params) { return params.in_shadow; }

// The colour of a surface that a ray met.
DEVICE float3 met_color(const Params &params, const Hit &hit, float footprint, const Surface &surface) {
    const Shade &shade = shade_of(params, hit.triangle);
    float3 sum = splat(0.0f);
    for (unsigned i = 0; i < params.light_count; ++i) {
        const Light &light = params.lights[i];
        Arriving arrives = arriving(light, surface.point.position);
        sum = sum + vector_of(light.color) * (arrives.factor * cosine_to(params, shade, hit, surface.normal, arrives.towards));
    }
    return shining_color(params, hit, footprint, shade, sum);
}

// By which normal a surface is shaded whose light is asked for, and the key of its random numbers; and where a ray met it, or else the camera
// sees it.
struct Shading {
    float3 normal;
    unsigned key;
    bool met;
    Hit hit;
};
#else
DEVICE float in_shadow(const Params &) { return SHADOWED; }

DEVICE float3 met_color(const Params &params, const Hit &hit, float footprint, const Surface &surface) {
    return lit_color(params, hit, footprint, surface.normal);
}
#endif
