// Runs functions of the device's header of exact spheres on the host, as `functions.cpp` those of the others. Reads a table of words from
// standard input, writes one to standard output; `spheres.rs` says what is in them, and compares.
#define CURITIBA_SPHERES
#include "cuda.h"
#include "surface.cuh"
#include "words.h"

static Ray ray_of_words() {
    Ray ray = {vector(), vector(), 0.0f, 0.0f};
    ray.t_min = number();
    ray.t_max = number();
    return ray;
}

// The nearest hit of a ray, and whether it meets any sphere.
static void put_met(const Params &params, const Ray &ray) {
    Hit hit = closest_sphere<ACCEPT_ALL>(params, ray);
    put(hit.triangle);
    put(hit.triangle == NO_TRIANGLE ? 0.0f : hit.t);
    put((unsigned)occluded_by_sphere<ACCEPT_ALL>(params, ray, nullptr));
}

// What each ray meets.
static void rays() {
    SpheresOfWords spheres;
    Params params = {};
    params.spheres = &spheres.described;
    while (place < input.size()) put_met(params, ray_of_words());
}

// Whether rays of a length may meet a sphere.
static void near() {
    SpheresOfWords spheres;
    Params params = {};
    params.spheres = &spheres.described;
    while (place < input.size()) {
        float3 origin = vector();
        put((unsigned)is_near_sphere(params, origin, number()));
    }
}

// For a sphere of its own, the nearest hit of each ray, the points near a position and where the ray meets it, and where rays from there start.
static void alone() {
    while (place < input.size()) {
        Sphere sphere = {};
        for (float &each : sphere.center) each = number();
        sphere.radius = number();
        SphereNode node = {};
        node.count = 1;
        for (int axis = 0; axis < 3; ++axis) {
            node.low[axis] = next_below(sphere.center[axis] - sphere.radius);
            node.high[axis] = next_above(sphere.center[axis] + sphere.radius);
        }
        Spheres spheres = {&node, &sphere, 1, 0, {node.low[0], node.low[1], node.low[2]}, {node.high[0], node.high[1], node.high[2]}};
        Params params = {};
        params.spheres = &spheres;
        Ray ray = ray_of_words();
        put_met(params, ray);
        SurfacePoint points[] = {on_sphere(sphere, ray.origin), met_on_sphere(sphere, ray.origin, ray.direction, number())};
        for (const SurfacePoint &point : points) {
            put(point.position);
            put(point.normal);
            put(point.error);
            put(spawn(point, ray.direction));
        }
    }
}

int main(int count, char **arguments) {
    read_all();
    std::string what = count > 1 ? arguments[1] : "";
    if (what == "rays") rays();
    else if (what == "near") near();
    else if (what == "alone") alone();
    else return 1;
    return write_all();
}
