// The programs that know glass as each material says, on the host: the same text with a tracer that asks all triangles. With CURITIBA_LIGHTS
// also those that know several lights; with CURITIBA_SPHERES those that know exact spheres, which are asked by their tree; with CURITIBA_WAYS
// those that follow paths through all glass.
#define CURITIBA_BODIES
#include "cuda.h"
#include "triangle.cuh"
#if defined(CURITIBA_OF_FINAL)
#include "final.cuh"
#define CURITIBA_COMPUTES bodies
#elif defined(CURITIBA_OF_SHADOWS)
#include "deferredShadows.cuh"
#define CURITIBA_COMPUTES corrected
#elif defined(CURITIBA_OF_MIRRORS)
#include "reflection.cuh"
#define CURITIBA_COMPUTES corrected
#elif defined(CURITIBA_OF_OCCLUSION)
#include "ssao.cuh"
#define CURITIBA_COMPUTES corrected
#else
#include "refraction.cuh"
#define CURITIBA_COMPUTES bodies
#endif
#ifndef CURITIBA_OF_FINAL
#include "bodies.cuh"
#endif
#include "words.h"
#include <memory>

struct AllTriangles {
    const Params &params;
    unsigned count;
    // Whether it asks those of the sky instead of all others.
    bool of_sky = false;

    bool asks(unsigned id) const { return is_sky(params, id) == of_sky; }
    bool has_sky() const { return params.sky != nullptr; }
    template <Accept ACCEPT> bool closest_on_sky(const Ray &ray, Hit &hit) const {
        return AllTriangles{*params.sky, count, true}.closest<ACCEPT>(ray, hit);
    }

    template <Accept ACCEPT> bool closest(const Ray &ray, Hit &best) const {
        Query query;
        if (!prepare(ray, query)) return false;
        float limit = query.t_max;
        bool any = false;
        for (unsigned id = 0; id < count; ++id) {
            if (!asks(id)) continue;
            Corners corners = positions_of(params, id);
            Hit hit;
            if (!intersect(params, query, corners.a, corners.b, corners.c, limit, hit) || hit.t >= limit) continue;
            hit.triangle = id;
            if (!accepts(params, ACCEPT, hit, nullptr)) continue;
            best = hit;
            limit = hit.t;
            any = true;
        }
        OF_SPHERES(any = with_spheres<ACCEPT>(params, ray, any, best);)
        return any;
    }
    template <Accept ACCEPT> bool occluded(const Ray &ray, Crossings *crossings) const {
        Query query;
        if (!prepare(ray, query)) return false;
        for (unsigned id = 0; id < count; ++id) {
            if (!asks(id)) continue;
            Corners corners = positions_of(params, id);
            Hit hit;
            float limit = query.t_max;
            if (!intersect(params, query, corners.a, corners.b, corners.c, limit, hit) || hit.t >= limit) continue;
            hit.triangle = id;
            if (accepts(params, ACCEPT, hit, crossings)) return true;
        }
        OF_SPHERES(return occluded_by_sphere<ACCEPT>(params, ray, crossings);)
        return false;
    }
    template <Accept ACCEPT, class Rays>
    unsigned count_open(bool wanted, const Rays &fan, unsigned samples, RayCounts &rays) const {
        return wanted ? count_open_alone<ACCEPT>(*this, fan, samples, rays) : 0u;
    }
    // How often from now on another thread of the warp says yes.
    static inline unsigned others = 0;
    static bool any(bool value) {
        bool other = others > 0;
        others -= other;
        return value || other;
    }
};

template <class T> static void numbers(T &values) {
    for (auto &value : values) value = number();
}

#ifdef CURITIBA_OF_FINAL
// Leaves words on the stack that are not numbers, nor ids.
[[gnu::noinline]] static void spoil_stack() {
    volatile unsigned words[1 << 14];
    for (volatile unsigned &word : words) word = ~0u;
}
// Whether a thread without a pixel traces nothing, while another thread of its warp finds surfaces, and whatever its memory holds.
static bool idles(const AllTriangles &tracer) {
    spoil_stack();
    AllTriangles::others = 3;
    Pass<AllTriangles> pass = {tracer.params, tracer, {0, 0, 0}, false, {}};
    corrected(pass);
    const RayCounts &rays = pass.rays;
    return AllTriangles::others == 0 && rays.shadow + rays.occlusion + rays.reflected + rays.refracted + rays.lost == 0;
}
#endif

int main() {
    read_all();
    Scene scene(word());
    Params &params = scene.params;
    std::vector<float> normals(9 * scene.count());
    numbers(normals);
    std::vector<float2> texcoords(3 * scene.count());
    for (float2 &texcoord : texcoords) {
        texcoord.x = number();
        texcoord.y = number();
    }
    std::vector<unsigned> materials(scene.count());
    for (unsigned &material : materials) material = word();
    TextureInfo info = {0, word(), word(), WRAP_REPEAT, WRAP_REPEAT};
    std::vector<uchar4> texels(word());
    for (uchar4 &texel : texels) {
        unsigned codes = word();
        std::memcpy(&texel, &codes, sizeof codes);
    }
    params.texcoords = texcoords.data();
    params.textures = &info;
    params.texels = texels.data();
    std::vector<Body> bodies(word());
    std::vector<Shade> shades(bodies.size());
    for (size_t i = 0; i < bodies.size(); ++i) {
        bodies[i].shape = word();
        bodies[i].index = number();
        numbers(bodies[i].extinction);
        numbers(bodies[i].filter);
        bodies[i].filter_texture = NO_TEXTURE;
        bodies[i].veil = number();
        bodies[i].thickness = number();
        bodies[i].priority = word();
        bodies[i].transmission_texture = word();
        shades[i] = {};
        numbers(shades[i].diffuse);
        shades[i].texture = word();
        shades[i].flags = word();
        shades[i].cutoff = number();
        params.cut |= (unsigned)((shades[i].flags & SHADE_CUT) != 0u);
        numbers(shades[i].glow);
        shades[i].glow_texture = word();
    }
    params.normals = normals.data();
    params.materials = materials.data();
    params.bodies = bodies.data();
    params.shades = shades.data();
    scene.bound([&](unsigned id) { return !is_sky(params, id); });
    params.index = number();
    params.depth = word();
    params.fresnel = word();
    params.asks = word();
    params.cone_width = number();
    params.cone_spread = number();
    numbers(params.beyond);
    numbers(params.eye);
    numbers(params.to_light);
    numbers(params.light_color);
    std::vector<Light> lights(word());
    for (Light &light : lights) light = read_light();
    std::vector<float> emissions(3 * bodies.size());
    numbers(emissions);
    params.lights = lights.data();
    params.light_count = lights.size();
    params.emissions = emissions.data();
    params.in_shadow = number();
    params.disc_height = number();
    params.disc_samples = word();
    std::vector<uint2> disc(params.disc_samples);
    for (uint2 &point : disc) {
        point.x = word();
        point.y = word();
    }
    params.disc = disc.data();
    params.width = word();
    params.height = word();
    unsigned pixels = params.width * params.height;
    std::vector<float4> position(pixels), normal(pixels), color(pixels);
    std::vector<unsigned> triangle(pixels);
    for (unsigned i = 0; i < pixels; ++i) {
        float3 p = vector(), n = vector(), c = vector();
        position[i] = make_float4(p.x, p.y, p.z, 1.0f);
        normal[i] = make_float4(n.x, n.y, n.z, 0.0f);
        color[i] = make_float4(c.x, c.y, c.z, 1.0f);
        triangle[i] = word();
    }
    params.position = position.data();
    params.normal = normal.data();
    params.color = color.data();
    params.triangle = triangle.data();
    if (word() == 0) params.bodies = nullptr;
    params.samples = word();
    params.strata = word();
    params.radius = number();
    std::vector<uint2> sobol = read_sobol_table();
    params.sobol = sobol.data();
    std::vector<float> open_share(params.samples + 1);
    numbers(open_share);
    params.open_share = open_share.data();
#ifdef CURITIBA_WAYS
    params.seed = word();
    std::vector<Face> faces(bodies.size());
    for (Face &face : faces) {
        face.spread = number();
        face.alpha = number();
        face.roughness_texture = word();
        numbers(face.mirrors);
        face.minimum = number();
        face.maximum = number();
        face.exponent = number();
    }
    std::vector<float4> strata(word());
    for (float4 &stratum : strata) {
        float3 weight = vector();
        stratum = make_float4(weight.x, weight.y, weight.z, number());
    }
    std::vector<uint2> facets(word());
    for (uint2 &facet : facets) {
        facet.x = word();
        facet.y = word();
    }
    // The last one is the wavelength at which materials state their index.
    unsigned stratum_count = strata.empty() ? 0u : (unsigned)strata.size() - 1u;
    Ways ways = {faces.data(), strata.data(), facets.data(), nullptr, stratum_count, (unsigned)facets.size()};
    ways.asks = word();
    ways.cutoff = number();
    ways.reflections = word();
    ways.refractions = word();
    ways.chances = word();
    ways.offset = word();
    std::vector<uint4> samples(word());
    for (uint4 &sample : samples) {
        unsigned key = word(), first = word(), count = word();
        sample = make_uint4(key, first, count, word());
    }
    if (!samples.empty()) ways.samples = samples.data();
    params.segments = (const float4 *)&ways;
#endif
#ifdef CURITIBA_SPHERES
    // A word says whether there are spheres; it is left out where there are neither spheres nor focused light.
    std::unique_ptr<SpheresOfWords> spheres;
    if (place < input.size() && word() != 0u) {
        spheres = std::make_unique<SpheresOfWords>();
        for (unsigned count = word(); count > 0; --count) materials.push_back(word());
        params.materials = materials.data();
        params.spheres = &spheres->described;
    }
    std::unique_ptr<LensesOfWords> lenses;
    std::unique_ptr<PhotonsOfWords> photons;
    if (params.asks & ASKS_FOCUSED) {
        lenses = std::make_unique<LensesOfWords>();
        photons = std::make_unique<PhotonsOfWords>();
        lenses->described.clouds = photons->clouds.data();
        lenses->described.cloud_count = (unsigned)photons->clouds.size();
        params.focused = &lenses->described;
    }
#endif
    std::vector<float> through(THROUGH_GLASS_ENTRIES);
    for (size_t i = 0; i < through.size(); ++i) through[i] = std::pow(THROUGH_GLASS, (float)i);
    params.through_glass = through.data();
    Media around_eye;
    if (params.bodies != nullptr) params.around_eye = &around_eye;
    Scene around = scene;
    around.params.spheres = nullptr;
    around.bound([&](unsigned id) { return is_sky(params, id); });
    if (around.params.scene_low[0] <= around.params.scene_high[0]) params.sky = &around.params;
    AllTriangles tracer = {params, scene.count()};
    Pass<AllTriangles> eye = {params, tracer, {}, true, {}};
    if (params.around_eye != nullptr) find_bodies_around_eye(eye);
    for (unsigned i = 0; i < pixels; ++i) {
        Pass<AllTriangles> pass = {params, tracer, {i % params.width, i / params.width, i}, true, {}};
        float4 color = ::CURITIBA_COMPUTES(pass);
        put(xyz(color));
        put(color.w);
        put(pass.rays.reflected);
        put(pass.rays.refracted);
        put(pass.rays.lost);
        put(pass.rays.shadow);
    }
#ifdef CURITIBA_OF_FINAL
    if (!idles(tracer)) return 1;
#endif
    return write_all();
}
