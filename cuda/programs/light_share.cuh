// What the shadows of several lights leave of a surface's colour (`effects/lights.rs`).
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

// What shadows leave at a point of a triangle, by colour, on the side of the unit normal `facing`. `reaches(pass, origin)` follows a ray to
// the light that is looked at, and says what of it passes; `STOPS`, which hits cut a point off from the round surface that its triangle
// stands for.
template <Accept STOPS, class Tracer, class Reaches>
static __device__ OUTLINED float3 share_of_lights(Pass<Tracer> &pass, unsigned triangle, const SurfacePoint &point, float3 facing,
                                                  Reaches reaches) {
    const Params &params = pass.params;
    const Shade &shade = shade_of(params, triangle);
    float3 whole = splat(0.0f), left = whole;
    for (unsigned long long i = 0; i < params.light_count; ++i) {
        const Light &light = params.lights[i];
        Arriving arrives = arriving(light, point.position);
        if (arrives.factor <= 0.0f) continue;
        float cosine = light_cosine(pass, shade, triangle, point.position, arrives.towards);
        float3 color = vector_of(light.color) * (arrives.factor * cosine);
        if (is_black(color)) continue;
        whole = whole + color;
        pass.light_direction = arrives.towards;
        float3 origin;
        if (dot(facing, arrives.towards) > 0.0f) {
            origin = spawn(point, arrives.towards);
        } else if (!pass.template lifted_origin<STOPS>(triangle, point, facing, origin)) {
            continue;
        }
        pass.light_length = INFINITY;
        if (light.flags & LIGHT_PLACE) {
            float3 way = vector_of(light.place) - origin;
            pass.light_length = sqrtf(dot(way, way)) * (1.0f - BEFORE_LIGHT);
            pass.light_direction = normalize_or(way, arrives.towards);
        }
        left = left + color * reaches(pass, origin);
    }
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
