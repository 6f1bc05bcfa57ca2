// Runs functions of the device headers on the host. Reads a table of words of 32 bits from standard input, writes one to standard
// output; `main.rs` says what is in them, and compares.
#include "cuda.h"
#include "cone_test.cuh"
#include "fan.cuh"
#include "lights.cuh"
#include "words.h"

// The nearest hit of each ray among all triangles; of several at one distance, the first.
static void intersections() {
    Scene scene(word());
    while (place < input.size()) {
        Ray ray = {vector(), vector(), 0.0f, 0.0f};
        ray.t_min = number();
        ray.t_max = number();
        Query query;
        Hit best = {0.0f, NO_TRIANGLE, 0.0f, 0.0f};
        float limit = ray.t_max;
        for (unsigned id = 0; prepare(ray, query) && id < scene.count(); ++id) {
            Corners corners = positions_of(scene.params, id);
            Hit hit;
            if (intersect(scene.params, query, corners.a, corners.b, corners.c, limit, hit) && hit.t < limit) {
                hit.triangle = id;
                best = hit;
                limit = hit.t;
            }
        }
        put(best.triangle);
        put(best.t);
        put(best.u);
        put(best.v);
    }
}

// Points of triangles near positions, and where rays from there start.
static void points() {
    Scene scene(word());
    while (place < input.size()) {
        unsigned triangle = word();
        float3 position = vector(), direction = vector();
        SurfacePoint point = snap(scene.params, triangle, position);
        put(point.position);
        put(point.normal);
        put(point.error);
        put(spawn(point, direction));
    }
}

// From points of triangles near positions onto the round surfaces that these stand for.
static void lifts() {
    Scene scene(word());
    scene.read_normals();
    while (place < input.size()) {
        unsigned triangle = word();
        float3 position = vector(), to_light = vector();
        SurfacePoint point = snap(scene.params, triangle, position);
        float3 facing = point.normal * (dot(point.normal, to_light) > 0.0f ? -1.0f : 1.0f);
        put(lifted(scene.params, triangle, point, facing, to_light));
        // The side that the light falls on.
        put(horizon(scene.params, triangle, point, -facing));
        put((unsigned)is_turned(scene.params, triangle, point, -facing, to_light));
    }
}

// Normals that texels bend.
static void bumps() {
    while (place < input.size()) {
        float3 texel = vector(), normal = vector(), along = vector(), flat = vector();
        float scale = number(), side = number();
        put(bent(texel, scale, normal, make_float4(along.x, along.y, along.z, side), flat));
    }
}

// Random numbers, directions of a hemisphere, and weights of an interface of glass.
static void samples() {
    while (place < input.size()) {
        unsigned x = word(), y = word(), seed = word();
        unsigned key = pixel_key(x, y, seed);
        uint2 bits = dimensions(key, x);
        put(key);
        put(path_key(key, y));
        put(bits.x);
        put(bits.y);
        put(scramble_reversed(x, seed));
        float2 point = make_float2(unit_of(bits.x), unit_of(bits.y));
        float3 direction = cosine_direction(point);
        put(direction);
        put(to_world(basis_around(vector()), direction));
        float cosine = number(), index = number();
        Interface exact = fresnel(cosine, index, FRESNEL_EXACT), rough = schlick(cosine, index);
        put(exact.reflectance);
        put(exact.cos_refracted);
        put(rough.reflectance);
        put(rough.cos_refracted);
        put(fresnel(cosine, index, FRESNEL_S).reflectance);
        put(fresnel(cosine, index, FRESNEL_P).reflectance);
    }
}

// The points of a fan in the two orders in which warps take them.
static void turns() {
    Params params = {};
    params.samples = word();
    unsigned key = word();
    std::vector<uint2> table = read_sobol_table();
    params.sobol = table.data();
    SharedFan fan = {};
    fan.seeds = scrambling_of(key);
    for (unsigned turn = 0; turn < params.samples; ++turn) {
        for (unsigned sample : {fan.sample_of(params, turn), fan.neighbour(params, turn)}) {
            float2 point = scrambled_point(params, sample, fan.seeds);
            put(point.x);
            put(point.y);
        }
    }
}

// Directions to a disc.
static void discs() {
    while (place < input.size()) {
        unsigned key = word(), number_of_light = word();
        float height = number();
        Basis basis = basis_around(vector());
        uint2 seeds = dimensions(light_key(key, number_of_light), HASH_DISC);
        for (unsigned points = word(); points > 0; --points) {
            uint2 point = {word(), 0};
            point.y = word();
            put(disc_direction(point, seeds, basis, height));
        }
    }
}

// What arrives of lights at points.
static void lights() {
    while (place < input.size()) {
        Light light = read_light();
        Arriving found = arriving(light, vector());
        put(found.towards);
        put(found.factor);
    }
}

// Cones of rays: a step along, after a mirror and after an interface; the curvature of a triangle, what of its texture is covered, and the
// level of that.
static void ray_cones() {
    Scene scene(word());
    scene.read_normals();
    std::vector<float2> texcoords(3 * scene.count());
    for (float2 &texcoord : texcoords) {
        texcoord.x = number();
        texcoord.y = number();
    }
    scene.params.texcoords = texcoords.data();
    scene.params.cone_spread = 1.0f;
    while (place < input.size()) {
        unsigned triangle = word();
        float3 direction = vector(), facing = vector();
        Cone cone;
        cone.width = number();
        cone.spread = number();
        float distance = number(), cosine = number(), cos_refracted = number(), index = number();
        TextureInfo info = {0, word(), word(), WRAP_REPEAT, WRAP_REPEAT};
        float curvature = curvature_of(scene.params, triangle, facing);
        Cone along = cone_along(cone, distance), back = cone_mirrored(cone, curvature, cosine);
        Cone on = cone_refracted(cone, curvature, cosine, cos_refracted, index);
        for (Cone found : {along, back, on}) {
            put(found.width);
            put(found.spread);
        }
        float footprint = footprint_of(scene.params, cone, triangle, direction);
        put(curvature);
        put(footprint);
        put(level_of(info, footprint));
    }
}

// Texture lookups, each with the area that it covers.
static void lookups() {
    unsigned width = word(), height = word(), wrap_u = word(), wrap_v = word(), nearest = word();
    TextureInfo info = {0, width, height, wrap_u, wrap_v, nearest, 0};
    std::vector<uchar4> texels(word());
    for (uchar4 &texel : texels) {
        unsigned codes = word();
        std::memcpy(&texel, &codes, sizeof codes);
    }
    Params params = {};
    params.textures = &info;
    params.texels = texels.data();
    while (place < input.size()) {
        float u = number(), v = number();
        float4 color = sample_numbers(params, 0, make_float2(u, v), number());
        for (float channel : {color.x, color.y, color.z, color.w}) put(channel);
    }
}

// What the cone test of a triangle says of rays from an origin (1: stopped, 2: not), and what the watertight test does (4: stopped).
static void cones() {
    Scene scene(word());
    scene.params.radius = number();
    while (place < input.size()) {
        unsigned id = word();
        float3 origin = vector(), facing = vector(), direction = vector();
        Corners corners = positions_of(scene.params, id);
        Triangle triangle = {corners.a, corners.b, corners.c, id};
        HalfBall ball = half_ball(scene.params, origin, facing, scene.params.radius);
        Facet facet;
        bool hit = false, miss = true;
        if (ball.meets(triangle) && facet_of(scene.params, triangle, id, ball, facet)) judge(facet, direction, hit, miss);
        Query query;
        Hit found;
        bool stopped = prepare({origin, direction, 0.0f, scene.params.radius}, query) &&
                       intersect(scene.params, query, triangle.a, triangle.b, triangle.c, query.t_max, found) &&
                       found.t < query.t_max;
        put((unsigned)hit | (unsigned)miss << 1 | (unsigned)stopped << 2);
    }
}

int main(int count, char **arguments) {
    read_all();
    std::string what = count > 1 ? arguments[1] : "";
    if (what == "intersections") intersections();
    else if (what == "points") points();
    else if (what == "lifts") lifts();
    else if (what == "bumps") bumps();
    else if (what == "samples") samples();
    else if (what == "turns") turns();
    else if (what == "lights") lights();
    else if (what == "discs") discs();
    else if (what == "cones") cones();
    else if (what == "ray_cones") ray_cones();
    else if (what == "lookups") lookups();
    else return 1;
    return write_all();
}
