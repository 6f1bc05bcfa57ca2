// What the shadows of several lights, or of one that is a disc, leave of a surface's colour (`effects/lights.rs`).
#pragma once
#include "pass.cuh"

// The cosine of a light at a point that is shaded as the pass says.
template <class Tracer>
DEVICE float light_cosine(const Pass<Tracer> &pass, const Shade &shade, unsigned triangle, float3 position, float3 towards) {
    const Params &params = pass.params;
    const Shading &shading = pass.shading;
    if (shade.flags & SHADE_NORMAL_MAP && params.normals != nullptr) {
        Hit hit = shading.met ? shading.hit : locate(params, triangle, position);
        return fminf(cosine_to(params, shade, hit, shading.normal, towards), 1.0f);
    }
    return fminf(fmaxf(dot(towards, shading.normal), 0.0f), 1.0f);
}

// A share of a colour, where there is any.
DEVICE float share_left(float left, float whole) { return whole > 0.0f ? left / whole : 1.0f; }

// By colour, what reaches a point of a light in the direction `towards`: of a disc the mean over it. A direction from which the side is dark
// brings what is in shadow, without a ray. What cuts the point off from the round surface that its triangle stands for is asked once.
template <Accept STOPS, class Tracer, class Reaches>
DEVICE float3 light_seen(Pass<Tracer> &pass, unsigned number, float3 towards, unsigned triangle, const SurfacePoint &point, float3 facing,
                         Reaches reaches) {
    const Params &params = pass.params;
    const Light &light = params.lights[number];
    bool has_place = light.flags & LIGHT_PLACE, is_disc = params.disc_samples != 0 && !has_place;
    unsigned samples = 1;
    Basis basis = {};
    uint2 seeds = {};
    if (is_disc) {
        samples = params.disc_samples;
        basis = basis_around(towards);
        seeds = dimensions(light_key(pass.shading.key, number), HASH_DISC);
    }
    bool asked = false, open = false;
    float3 raised = splat(0.0f), sum = raised;
    // A light that is a point is not asked below the horizon: its cosine there is 0.
    float3 side = is_disc ? horizon(params, triangle, point, facing) : facing;
    for (unsigned i = 0; i < samples; ++i) {
        pass.light_direction = is_disc ? disc_direction(__ldg(params.disc + i), seeds, basis, params.disc_height) : towards;
        if (is_disc && dot(side, pass.light_direction) <= 0.0f) {
            sum = sum + splat(in_shadow(params));
            continue;
        }
        float3 origin;
        if (dot(facing, pass.light_direction) > 0.0f) {
            origin = spawn(point, pass.light_direction);
        } else {
            bool dark = equal(lifted(params, triangle, point, facing, pass.light_direction), splat(0.0f));
            if (!dark && !asked) {
                asked = true;
                open = pass.template lifted_origin<STOPS>(triangle, point, facing, raised);
            }
            if (dark || !open) {
                sum = sum + splat(in_shadow(params));
                continue;
            }
            origin = raised;
        }
        pass.light_length = INFINITY;
        if (has_place) {
            float3 way = vector_of(light.place) - origin;
            pass.light_length = sqrtf(dot(way, way)) * (1.0f - BEFORE_LIGHT);
            pass.light_direction = normalize_or(way, towards);
        }
        sum = sum + reaches(pass, origin);
    }
    if (!is_disc) return sum;
    float rays = (float)samples;
    return vec3(sum.x / rays, sum.y / rays, sum.z / rays);
}

// What shadows leave at a point of a triangle, by colour, on the side of the unit normal `facing`: the share of a single directional light, or
// of what all lights make of the surface. `reaches(pass, origin)` follows a ray to the light that is looked at, and says what of it passes;
// `STOPS`, which hits cut a point off from the round surface that its triangle stands for.
template <Accept STOPS, class Tracer, class Reaches>
static __device__ OUTLINED float3 share_of_lights(Pass<Tracer> &pass, unsigned triangle, const SurfacePoint &point, float3 facing,
                                                  Reaches reaches) {
    const Params &params = pass.params;
    const Shade &shade = shade_of(params, triangle);
    const bool alone = in_shadow(params) > 0.0f;
    float3 whole = splat(0.0f), left = whole;
    for (unsigned i = 0; i < params.light_count; ++i) {
        const Light &light = params.lights[i];
        Arriving arrives = arriving(light, point.position);
        if (arrives.factor <= 0.0f) continue;
        float3 color = splat(1.0f);
        if (!alone) {
            float cosine = light_cosine(pass, shade, triangle, point.position, arrives.towards);
            color = vector_of(light.color) * (arrives.factor * cosine);
            if (is_black(color)) continue;
            whole = whole + color;
        }
        left = left + color * light_seen<STOPS>(pass, i, arrives.towards, triangle, point, facing, reaches);
    }
    if (alone) return left;
    float3 diffuse = vector_of(shade.diffuse), ambient = AMBIENT * diffuse;
    if (shade.texture != NO_TEXTURE) {
        ambient = splat(AMBIENT);
        // What the material adds to the light that is seen on its texture.
        if (!pass.shading.met) ambient = vector_at(params.emissions, __ldg(params.materials + triangle)) + ambient;
    }
    left = ambient + diffuse * left;
    whole = ambient + diffuse * whole;
    return vec3(share_left(left.x, whole.x), share_left(left.y, whole.y), share_left(left.z, whole.z));
}
