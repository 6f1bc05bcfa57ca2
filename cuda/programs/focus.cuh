// The light that glass focuses on surfaces, with the numbers of the processor, step by step: exact spheres (`caustic.rs`), and meshes, whose
// photons the processor has shot (`photon_map.rs`).
#pragma once
#include "ball.cuh"
#include "bodies.cuh"

DEVICE double3 vector_of(const double (&v)[3]) { return make_double3(v[0], v[1], v[2]); }

// How a surface reflects light, and how much of the light its colour contains.
struct Lit {
    // The unit normal by which it was lit.
    float3 normal;
    // The cosine of the light that its colour contains, and that light's factor by colour, without AMBIENT.
    float cosine;
    float3 tint;

    DEVICE_MEMBER float3 taken(float3 light, float cosine) const { return tint * light * cosine + splat(AMBIENT); }
    // The colour that a light of colour `light` from a unit direction would give the surface, as a share of the surface's own colour.
    DEVICE_MEMBER float3 share(float3 light, float3 towards) const {
        float3 its = taken(light, fmaxf(dot(normal, towards), 0.0f)), own = taken(light, cosine);
        return vec3(its.x / own.x, its.y / own.y, its.z / own.z);
    }
};

// The plane of a point, a sphere's centre and the light.
struct LightPlane {
    // Away from the axis, towards the point; and the direction in which the light travels.
    double3 side, axis;

    // A vector of the plane; its first coordinate is on the side of a bundle.
    DEVICE_MEMBER double3 vector(const Bundle &bundle, double x, double y) const { return bundle.side * x * side + y * axis; }
};

// The share of light that a ray keeps in a sphere, by colour.
struct KeptInLens {
    const Params &params;
    const Lens &lens;

    DEVICE_MEMBER double3 operator()(const Turned &ray) const {
        const Body &body = params.bodies[lens.material];
        float3 face = (1.0f - body.veil) * vector_of(body.filter);
        double3 faces = wide(face * face);
        double passes = 1.0 - (double)face_at(params, OF_WAYS(lens.material, ) (float)ray.cos, body.index).reflectance;
        float length = (float)(2.0 * (double)lens.radius * ray.inner);
        double3 inside = wide(transmittance(vector_of(body.extinction), length)), kept = passes * passes * faces;
        return make_double3(kept.x * inside.x, kept.y * inside.y, kept.z * inside.z);
    }
};

DEVICE Ray segment_to(float3 origin, float3 end) {
    float3 way = end - origin;
    return {origin, normalize_or(way, vec3(0.0f, 0.0f, 1.0f)), 0.0f, sqrtf(dot(way, way))};
}

// The light of one bundle, as far as it passes on its way: from the surface to the sphere, inside the sphere, and on to the light.
template <class Tracer>
DEVICE float3 bundle_light(Pass<Tracer> &pass, const SurfacePoint &point, const Lit &lit, const Lens &lens, const LightPlane &plane,
                           const Bundle &bundle) {
    const Params &params = pass.params;
    float3 to_sphere = -narrow(plane.vector(bundle, bundle.ray.direction[0], bundle.ray.direction[1]));
    auto place = [&](double2 at) {
        return narrow(wide(vector_of(lens.center)) + (double)lens.radius * plane.vector(bundle, at.x, at.y));
    };
    float3 exit = place(exit_of(bundle.ray)), entry = place(entry_of(bundle.ray));
    float3 light = lit.share(vector_of(params.light_color), to_sphere) * narrow(bundle.strength);
#pragma unroll 1
    for (unsigned way = 0; way < 3 && !is_black(light); ++way) {
        Ray ray = {entry, vector_of(params.to_light), 0.0f, INFINITY};
        if (way == 0) ray = segment_to(spawn(point, to_sphere), exit);
        if (way == 1) ray = segment_to(exit, entry);
        pass.rays.shadow += 1;
        light = light * straight_along(pass, ray, lens.id);
    }
    return light;
}

// The light that spheres focus on a point of a surface, as a share of its colour, on the side with the unit normal `facing`. Each bundle of rays
// counts as a light of the bundle's direction and strength.
template <class Tracer>
static __device__ OUTLINED float3 focused_light(Pass<Tracer> &pass, const SurfacePoint &point, float3 facing, const Lit &lit) {
    const Params &params = pass.params;
    const Focused &focused = *params.focused;
    double3 axis = vector_of(focused.axis);
    float3 light = splat(0.0f);
#pragma unroll 1
    for (unsigned i = 0; i < focused.count; ++i) {
        const Lens &lens = focused.list[i];
        double radius = (double)lens.radius;
        double3 to = wide(point.position) - wide(vector_of(lens.center));
        double3 from = make_double3(to.x / radius, to.y / radius, to.z / radius);
        double squared = dot(from, from);
        // In the sphere no light is focused.
        if (squared <= 1.0) continue;
        double place = dot(from, axis);
        double3 across = from - place * axis;
        double distance = sqrt(dot(across, across)), reciprocal = 1.0 / distance;
        bool has_side = isfinite(reciprocal) && reciprocal > 0.0;
        LightPlane plane = {has_side ? reciprocal * across : vector_of(focused.across), axis};
        Ball ball = {focused.nodes + lens.node, focused.points, (double)lens.index};
        KeptInLens kept = {params, lens};
        // For another point of the light's disc the rays are turned about the sphere's centre, so the blur grows with the distance from it.
        Bundles<KeptInLens> bundles(ball, kept, distance, place, fmax(LENS_WIDTH, sqrt(squared) * focused.blur));
        Bundle bundle;
        while (bundles.next(bundle)) {
            float3 direction = narrow(plane.vector(bundle, bundle.ray.direction[0], bundle.ray.direction[1]));
            if (dot(facing, direction) < 0.0f) light = light + bundle_light(pass, point, lit, lens, plane, bundle);
        }
    }
    return light;
}

// The entry of a cell in a table of photons whose length is a power of two.
DEVICE unsigned entry_of_cell(int x, int y, int z, unsigned entries) {
    unsigned mixed = (unsigned)x * 73856093u ^ (unsigned)y * 19349663u ^ (unsigned)z * 83492791u;
    return (mixed ^ mixed >> 15) & (entries - 1u);
}

// Adds the light of the photons from one entry of a cloud's table, at a point of a surface whose lit side has the unit normal `facing`.
DEVICE void add_photons(float3 &light, const PhotonCloud &cloud, unsigned entry, float3 position, float3 facing, const Lit &lit,
                        float3 color) {
    float square = cloud.radius * cloud.radius;
    unsigned end = __ldg(cloud.starts + entry + 1);
#pragma unroll 1
    for (unsigned i = __ldg(cloud.starts + entry); i < end; ++i) {
        const Photon &photon = cloud.photons[i];
        float3 from = vector_of(photon.position) - position, normal = vector_of(photon.normal), direction = vector_of(photon.direction);
        float height = dot(from, facing);
        float distance = dot(from, from) - height * height;
        bool same = dot(normal, facing) >= PHOTON_ALIKE && dot(direction, facing) < 0.0f;
        if (!(distance < square && fabsf(height) <= PHOTON_FLAT * cloud.radius && same)) continue;
        float weight = cloud.weight * (1.0f - fmaxf(distance, 0.0f) / square);
        float cosine = fmaxf(-dot(direction, normal), PHOTON_GRAZING);
        light = light + (weight / cosine) * vector_of(photon.power) * lit.share(color, -direction);
    }
}

// The light that photons add at a point of a surface, as a share of its colour, on the side with the unit normal `facing`.
static __device__ OUTLINED float3 photon_light(const Params &params, float3 position, float3 facing, const Lit &lit) {
    const Focused &focused = *params.focused;
    float3 light = splat(0.0f), color = vector_of(params.light_color);
#pragma unroll 1
    for (unsigned number = 0; number < focused.cloud_count; ++number) {
        const PhotonCloud &cloud = focused.clouds[number];
        float3 radius = splat(cloud.radius), low = position - radius, high = position + radius;
        float3 first = vector_of(cloud.low) - radius, last = vector_of(cloud.high) + radius;
        bool outside = position.x < first.x || position.y < first.y || position.z < first.z || position.x > last.x ||
                       position.y > last.y || position.z > last.z;
        if (outside) continue;
        int cells[2][3] = {{(int)floorf(low.x * cloud.cells), (int)floorf(low.y * cloud.cells), (int)floorf(low.z * cloud.cells)},
                           {(int)floorf(high.x * cloud.cells), (int)floorf(high.y * cloud.cells), (int)floorf(high.z * cloud.cells)}};
        // Two cells may share an entry of the table; its photons count once.
        unsigned seen[8], count = 0;
#pragma unroll 1
        for (unsigned corner = 0; corner < 8; ++corner) {
            unsigned entry = entry_of_cell(cells[corner & 1][0], cells[corner >> 1 & 1][1], cells[corner >> 2][2], cloud.entries);
            bool again = false;
            for (unsigned i = 0; i < count; ++i) again = again || seen[i] == entry;
            if (again) continue;
            seen[count++] = entry;
            add_photons(light, cloud, entry, position, facing, lit, color);
        }
    }
    return light;
}
