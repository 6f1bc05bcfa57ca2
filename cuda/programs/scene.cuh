// What is hit: rays, hits, vertex attributes, textures, materials, and where triangles are cut out.
#pragma once
#include "params.cuh"
#include "sampling.cuh"

// Hits have t_min < t < t_max.
struct Ray {
    float3 origin, direction;
    float t_min, t_max;
};
struct Hit {
    float t;
    unsigned triangle;
    float u, v;
};

DEVICE float3 vector_at(const float *values, unsigned index) {
    const float *v = values + 3ull * index;
    return vec3(__ldg(v), __ldg(v + 1), __ldg(v + 2));
}
DEVICE uint3 corners_of(const Params &params, unsigned triangle) {
    const unsigned *c = params.triangles + 3ull * triangle;
    return make_uint3(__ldg(c), __ldg(c + 1), __ldg(c + 2));
}
struct Corners {
    float3 a, b, c;
};
DEVICE Corners positions_of(const Params &params, unsigned triangle) {
    uint3 i = corners_of(params, triangle);
    return {vector_at(params.positions, i.x), vector_at(params.positions, i.y), vector_at(params.positions, i.z)};
}
DEVICE float3 normal_at(const Params &params, const Hit &hit) {
    uint3 i = corners_of(params, hit.triangle);
    float3 a = vector_at(params.normals, i.x), b = vector_at(params.normals, i.y), c = vector_at(params.normals, i.z);
    return a * (1.0f - hit.u - hit.v) + b * hit.u + c * hit.v;
}
DEVICE float2 texture_coordinates(const Params &params, const Hit &hit) {
    uint3 i = corners_of(params, hit.triangle);
    float2 a = __ldg(params.texcoords + i.x), b = __ldg(params.texcoords + i.y), c = __ldg(params.texcoords + i.z);
    float w = 1.0f - hit.u - hit.v;
    return make_float2(a.x * w + b.x * hit.u + c.x * hit.v, a.y * w + b.y * hit.u + c.y * hit.v);
}
// An attribute of four numbers a vertex.
DEVICE float4 four_between(const Params &params, const float4 *values, const Hit &hit) {
    uint3 i = corners_of(params, hit.triangle);
    float4 a = __ldg(values + i.x), b = __ldg(values + i.y), c = __ldg(values + i.z);
    float w = 1.0f - hit.u - hit.v;
    return make_float4(a.x * w + b.x * hit.u + c.x * hit.v, a.y * w + b.y * hit.u + c.y * hit.v,
                       a.z * w + b.z * hit.u + c.z * hit.v, a.w * w + b.w * hit.u + c.w * hit.v);
}
DEVICE float4 vertex_color(const Params &params, const Hit &hit) { return four_between(params, params.colors, hit); }

DEVICE float4 lerp(float4 a, float4 b, float s) {
    float r = 1.0f - s;
    return make_float4(a.x * r + b.x * s, a.y * r + b.y * s, a.z * r + b.z * s, a.w * r + b.w * s);
}
// The texel in the place of one up to two beyond the sides: from the other side, or the one at the edge. Of a side of one texel it is that texel.
DEVICE int beyond(int x, int count, unsigned wrap) {
    if (wrap != WRAP_REPEAT) return x < 0 ? 0 : x >= count ? count - 1 : x;
    return x < 0 ? x + count : x >= count ? min(x - count, count - 1) : x;
}
// Where a coordinate lies, as a share of the side.
DEVICE float share_of_side(float t, unsigned wrap) {
    if (wrap == WRAP_CLAMP) return fminf(fmaxf(t, 0.0f), 1.0f);
    if (wrap == WRAP_REPEAT) return t - floorf(t);
    float halved = 0.5f * t;
    float twice = 2.0f * (halved - floorf(halved));
    return twice > 1.0f ? 2.0f - twice : twice;
}
// `decoded` has the values of the codes of colours; none where texels are read as stored.
DEVICE float4 texel(const Params &params, const TextureInfo &info, const float *decoded, int x, int y) {
    int width = (int)info.width, height = (int)info.height;
    x = beyond(x, width, info.wrap_u);
    y = beyond(y, height, info.wrap_v);
    uchar4 t = params.texels[info.first + (unsigned long long)y * info.width + x];
    if (decoded) {
        return make_float4(__ldg(decoded + t.x), __ldg(decoded + t.y), __ldg(decoded + t.z), (float)t.w / 255.0f);
    }
    return make_float4((float)t.x / 255.0f, (float)t.y / 255.0f, (float)t.z / 255.0f, (float)t.w / 255.0f);
}
// Bilinear filtering of a level; `v = 0` is the bottom row.
DEVICE float4 sample_level(const Params &params, const TextureInfo &info, float2 uv, const float *decoded) {
    if (!(isfinite(uv.x) && isfinite(uv.y))) return texel(params, info, decoded, 0, 0);
    float x = share_of_side(uv.x, info.wrap_u) * (float)info.width - 0.5f;
    float y = (1.0f - share_of_side(uv.y, info.wrap_v)) * (float)info.height - 0.5f;
    // At whole numbers one texel has all of the weight.
    if (info.nearest) x = floorf(x + 0.5f), y = floorf(y + 0.5f);
    float left = floorf(x), top = floorf(y);
    float fx = x - left, fy = y - top;
    int l = (int)left, t = (int)top;
    float4 upper = lerp(texel(params, info, decoded, l, t), texel(params, info, decoded, l + 1, t), fx);
    float4 lower = lerp(texel(params, info, decoded, l, t + 1), texel(params, info, decoded, l + 1, t + 1), fx);
    return lerp(upper, lower, fy);
}

// The logarithm of `texture.rs`, of a positive, normal number.
DEVICE float log2_of(float value) {
    constexpr unsigned ROOT_OF_HALF = 0x3f3504f3u;
    int exponent = (int)(__float_as_uint(value) - ROOT_OF_HALF) >> 23;
    double m = (double)__uint_as_float(__float_as_uint(value) - ((unsigned)exponent << 23));
    double t = (m - 1.0) / (m + 1.0), square = t * t, sum = 1.0 / 15.0;
    sum = sum * square + 1.0 / 13.0;
    sum = sum * square + 1.0 / 11.0;
    sum = sum * square + 1.0 / 9.0;
    sum = sum * square + 1.0 / 7.0;
    sum = sum * square + 1.0 / 5.0;
    sum = sum * square + 1.0 / 3.0;
    sum = sum * square + 1.0;
    return (float)((double)exponent + 2.0 * 1.4426950408889634 * t * sum);
}
// The level of detail of a lookup that covers this area in texture coordinates.
DEVICE float level_of(const TextureInfo &info, float footprint) {
    float area = footprint * ((float)info.width * (float)info.height);
    if (!(area > 1.0f)) return 0.0f;
    float last = (float)(31 - __clz(info.width > info.height ? info.width : info.height));
    return fminf(0.5f * log2_of(area), last);
}
// The next smaller level, which follows in memory.
DEVICE TextureInfo next_level(TextureInfo info) {
    info.first += (unsigned long long)info.width * info.height;
    info.width = info.width > 1 ? info.width / 2 : 1;
    info.height = info.height > 1 ? info.height / 2 : 1;
    return info;
}
// Trilinear filtering; a footprint of 0 reads level 0.
DEVICE float4 sample_numbers(const Params &params, unsigned texture, float2 uv, float footprint, const float *decoded = nullptr) {
    TextureInfo info = params.textures[texture];
    float blend = 0.0f;
    if (footprint > 0.0f) {
        float lod = level_of(info, footprint);
        unsigned fine = (unsigned)lod;
        blend = lod - (float)fine;
        if (lod > 0.0f) info.nearest = 0u;
        for (unsigned level = 0; level < fine; ++level) info = next_level(info);
    }
    // One text for both levels, which is long.
    float4 first = make_float4(0.0f, 0.0f, 0.0f, 0.0f);
#pragma unroll 1
    for (bool again = false;; again = true) {
        float4 color = sample_level(params, info, uv, decoded);
        if (again) return lerp(first, color, blend);
        if (blend == 0.0f) return color;
        first = color;
        info = next_level(info);
    }
}
// The same of colours.
DEVICE float4 sample_texture(const Params &params, unsigned texture, float2 uv, float footprint) {
    return sample_numbers(params, texture, uv, footprint, params.decoded);
}

// Whether an id is that of a sphere, which follow those of the triangles.
DEVICE bool is_sphere(const Params &params, unsigned id) {
    return params.spheres != nullptr && id >= params.spheres->first;
}
DEVICE const Sphere &sphere_of(const Params &params, unsigned id) {
    const Spheres &spheres = *params.spheres;
    return spheres.list[spheres.list[id - spheres.first].place];
}

#ifdef CURITIBA_SPHERES
// Spheres have neither texture coordinates nor vertex colours nor bumps. Nothing is cut out of them, and none is a sky.
DEVICE Shade shade_of(const Params &params, unsigned id) {
    Shade shade = params.shades[__ldg(params.materials + id)];
    if (is_sphere(params, id)) {
        shade.flags &= ~(SHADE_CUT | SHADE_VERTEX_COLORS | SHADE_NORMAL_MAP | SHADE_SKY);
        shade.texture = shade.glow_texture = NO_TEXTURE;
    }
    return shade;
}
#else
DEVICE const Shade &shade_of(const Params &params, unsigned triangle) {
    return params.shades[__ldg(params.materials + triangle)];
}
#endif
DEVICE bool is_glass(const Params &params, unsigned triangle) { return shade_of(params, triangle).flags & SHADE_GLASS; }
// Whether it shows as it is, without shadows and occlusion.
DEVICE bool is_sky(const Params &params, unsigned triangle) { return shade_of(params, triangle).flags & SHADE_SKY; }
DEVICE bool passes_light(const Params &params, unsigned triangle) {
    return shade_of(params, triangle).flags & SHADE_SHADOW_GLASS;
}
// A lookup that reads level 0.
constexpr float NO_FOOTPRINT = 0.0f;
// Whether there is a surface at this point of the triangle.
DEVICE bool covers(const Params &params, const Hit &hit) {
    if (!params.cut) return true;
    const Shade &shade = shade_of(params, hit.triangle);
    if (!(shade.flags & SHADE_CUT)) return true;
    bool colored = shade.flags & SHADE_VERTEX_COLORS;
    if (shade.texture == NO_TEXTURE) return !colored || vertex_color(params, hit).w >= shade.cutoff;
    float alpha = sample_texture(params, shade.texture, texture_coordinates(params, hit), NO_FOOTPRINT).w;
    if (colored) alpha = alpha * vertex_color(params, hit).w;
    return alpha >= shade.cutoff;
}

// The normal that a texel makes of the one between the corners, on a triangle of unit normal `flat` on either side, as
// `normal_map::bent` of the pipeline has it.
DEVICE float3 bent(float3 texel, float scale, float3 normal, float4 tangent, float3 flat) {
    float x = (2.0f * texel.x - 1.0f) * scale, y = (2.0f * texel.y - 1.0f) * scale, height = 2.0f * texel.z - 1.0f;
    float z = height > LEAST_HEIGHT ? height : LEAST_HEIGHT;
    float3 along = xyz(tangent), across = cross(normal, along) * tangent.w, turned;
    if (!try_normalize(along * x + across * y + normal * z, turned)) turned = normal * length_recip(normal);
    float3 side = dot(flat, normal) < 0.0f ? -flat : flat;
    float cosine = dot(turned, side);
    if (!(cosine < LEAST_COSINE)) return turned;
    float3 raised;
    if (!try_normalize(turned + side * (LEAST_COSINE - cosine), raised)) raised = side * length_recip(side);
    return raised;
}
// The normal at a hit, bent by the normal map of its material if it has one; `vertices` is the one between the corners.
DEVICE float3 bent_normal(const Params &params, const Hit &hit, float3 vertices, float3 flat, float footprint) {
    const Shade &shade = shade_of(params, hit.triangle);
    if (!(shade.flags & SHADE_NORMAL_MAP) || !(dot(vertices, vertices) > LEAST_SQUARE)) return vertices;
    float3 texel = xyz(sample_numbers(params, shade.normal_texture, texture_coordinates(params, hit), footprint));
    return bent(texel, shade.normal_scale, vertices, four_between(params, params.tangents, hit), flat);
}
// Whether the normal between the corners faces a light, on the side of the triangle on which a bent normal is.
DEVICE bool vertices_face_light(const Params &params, const Hit &hit, float3 bent, float3 to_light) {
    Corners corners = positions_of(params, hit.triangle);
    float3 flat = cross(corners.b - corners.a, corners.c - corners.a), vertices = normal_at(params, hit);
    bool turned = (dot(flat, vertices) < 0.0f) != (dot(flat, bent) < 0.0f);
    float cosine = dot(vertices, to_light);
    return (turned ? -cosine : cosine) > 0.0f;
}

// The cosine of a light on a surface with this unit normal; 0 where the surface is turned away.
DEVICE float cosine_to(const Params &params, const Shade &shade, const Hit &hit, float3 normal, float3 to_light) {
    float cosine = fmaxf(dot(to_light, normal), 0.0f);
    if (shade.flags & SHADE_NORMAL_MAP && !vertices_face_light(params, hit, normal, to_light)) cosine = 0.0f;
    return cosine;
}

// Diffuse light, ambient light and texture, read at the level of the footprint, times the vertex colour, and the light that the surface
// sends out. `lights` is the diffuse light on white.
DEVICE float3 shining_color(const Params &params, const Hit &hit, float footprint, const Shade &shade, float3 lights) {
    float3 diffuse = vec3(shade.diffuse[0], shade.diffuse[1], shade.diffuse[2]);
    float3 lit = diffuse * lights;
    float3 reflected = lit + AMBIENT * diffuse;
    if (shade.texture != NO_TEXTURE) {
        reflected = (lit + splat(AMBIENT)) * xyz(sample_texture(params, shade.texture, texture_coordinates(params, hit), footprint));
    }
    if (shade.flags & SHADE_VERTEX_COLORS) reflected = reflected * xyz(vertex_color(params, hit));
    if (!(shade.flags & SHADE_GLOW)) return reflected;
    float3 glow = vec3(shade.glow[0], shade.glow[1], shade.glow[2]);
    if (shade.glow_texture == NO_TEXTURE) return reflected + glow;
    return reflected + glow * xyz(sample_texture(params, shade.glow_texture, texture_coordinates(params, hit), footprint));
}
// The same in the light of one directional light, with this unit normal.
DEVICE float3 lit_color(const Params &params, const Hit &hit, float footprint, float3 normal) {
    const Shade &shade = shade_of(params, hit.triangle);
    float3 to_light = vec3(params.to_light[0], params.to_light[1], params.to_light[2]);
    float3 light = vec3(params.light_color[0], params.light_color[1], params.light_color[2]);
    return shining_color(params, hit, footprint, shade, light * cosine_to(params, shade, hit, normal, to_light));
}

// Which candidate hits on transparent materials count, as the ray asks; in OptiX the materials' any-hit programs decide the
// same (`optix.cu`).
enum Accept : unsigned {
    ACCEPT_ALL = 0,     // every one
    ACCEPT_COVERED = 1, // where the triangle is not cut out
    ACCEPT_STOPS = 2,   // covered, and not glass that shadow rays pass
    ACCEPT_OPAQUE = 3,  // not glass that shadow rays pass (thesis: nothing is cut out)
    ACCEPT_COUNTS = 4,  // as ACCEPT_STOPS; the covered glass on the way is counted
};

// The distances of the glass surfaces that a shadow ray crosses. A tracer may show a hit twice, and a ray through the edge
// between two triangles meets both: distances no farther apart than the rounding of their computation are one surface.
// Beyond MAX_CROSSINGS distances, each counts as a surface of its own; light has less than 3 percent left there.
#ifdef CURITIBA_BODIES
// Where light falls straight through glass, what it meets counts as well.
using Crossing = Hit;
DEVICE Crossing crossing_of(const Hit &hit) { return hit; }
DEVICE float distance_of(const Crossing &crossing) { return crossing.t; }
DEVICE bool is_before(const Crossing &a, const Crossing &b) { return a.t < b.t || (a.t == b.t && a.triangle < b.triangle); }
#else
using Crossing = float;
DEVICE Crossing crossing_of(const Hit &hit) { return hit.t; }
DEVICE float distance_of(Crossing crossing) { return crossing; }
DEVICE bool is_before(Crossing a, Crossing b) { return a < b; }
#endif
struct Crossings {
    Crossing met[MAX_CROSSINGS];
    unsigned stored, beyond;
    // Where the ray starts: which side of a sphere it crosses is seen by the point that it meets. With ASKS_FOCUSED, the id of a sphere that
    // the ray does not meet.
    OF_SPHERES(float3 origin; unsigned without;)
};
DEVICE void add_crossing(Crossings &crossings, const Hit &hit) {
    if (crossings.stored == MAX_CROSSINGS) {
        crossings.beyond += 1;
        return;
    }
    Crossing crossing = crossing_of(hit);
    unsigned slot = crossings.stored++;
    for (; slot > 0 && is_before(crossing, crossings.met[slot - 1]); --slot) crossings.met[slot] = crossings.met[slot - 1];
    crossings.met[slot] = crossing;
}
DEVICE unsigned distinct(const Crossings &crossings) {
    constexpr float ROUNDING = 16.0f * UNIT_ROUNDOFF;
    unsigned count = crossings.beyond + (crossings.stored > 0);
    for (unsigned i = 1; i < crossings.stored; ++i) {
        float t = distance_of(crossings.met[i]);
        count += t - distance_of(crossings.met[i - 1]) > ROUNDING * t;
    }
    return count;
}

#ifdef CURITIBA_SPHERES
// Whether light through this triangle or sphere does not go straight on to `to`: a sphere focuses it, or photons carry it.
DEVICE bool focuses(const Params &params, unsigned id, float3 to) {
    const Focused &focused = *params.focused;
    if (!is_sphere(params, id)) {
        if (focused.cloud_count == 0u) return false;
        const Body &body = params.bodies[__ldg(params.materials + id)];
        return body.shape == SHAPE_SOLID && body.index > 1.0f;
    }
    if (__ldg(focused.by_sphere + (id - params.spheres->first)) == 0u) return false;
    const Sphere &sphere = sphere_of(params, id);
    float3 from = vector_of(sphere.center) - to;
    return dot(from, from) > sphere.radius * sphere.radius;
}
#endif

DEVICE bool accepts(const Params &params, Accept accept, const Hit &hit, Crossings *crossings) {
    switch (accept) {
    case ACCEPT_ALL: return true;
    case ACCEPT_COVERED: return covers(params, hit);
    case ACCEPT_STOPS: return !passes_light(params, hit.triangle) && covers(params, hit);
    case ACCEPT_OPAQUE: return !passes_light(params, hit.triangle);
    default:
        OF_SPHERES(const bool focused = (params.asks & ASKS_FOCUSED) != 0u;)
        OF_SPHERES(if (focused && hit.triangle == crossings->without) return false;)
        if (!covers(params, hit)) return false;
        OF_SPHERES(if (focused && focuses(params, hit.triangle, crossings->origin)) return true;)
        if (!passes_light(params, hit.triangle)) return true;
        add_crossing(*crossings, hit);
        return false;
    }
}
