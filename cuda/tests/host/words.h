// The words that a program reads and writes, and a scene of triangles that it reads. Included after a device header.
#pragma once
#include <cstdio>
#include <string>
#include <vector>

static std::vector<unsigned> input, output;
static size_t place = 0;
static unsigned word() { return input[place++]; }
static float number() { return __uint_as_float(word()); }
static float3 vector() { float x = number(), y = number(), z = number(); return vec3(x, y, z); }
[[maybe_unused]] static void put(unsigned value) { output.push_back(value); }
[[maybe_unused]] static void put(float value) { put(__float_as_uint(value)); }
[[maybe_unused]] static void put(float3 v) { put(v.x); put(v.y); put(v.z); }

[[maybe_unused]] static double wide_number() {
    unsigned words[2] = {word(), word()};
    double value;
    std::memcpy(&value, words, sizeof value);
    return value;
}

[[maybe_unused]] static Light read_light() {
    Light light;
    unsigned words[sizeof light / sizeof(unsigned)];
    for (unsigned &each : words) each = word();
    std::memcpy(&light, words, sizeof light);
    return light;
}

// A scene of triangles with corners of their own.
struct Scene {
    std::vector<float> positions, normals;
    std::vector<unsigned> triangles;
    Params params = {};

    explicit Scene(unsigned count) {
        for (unsigned i = 0; i < 9 * count; ++i) positions.push_back(number());
        for (unsigned i = 0; i < 3 * count; ++i) triangles.push_back(i);
        params.positions = positions.data();
        params.triangles = triangles.data();
        bound([](unsigned) { return true; });
    }
    // Takes the bounds of some triangles for those of the scene.
    template <class Counts> void bound(Counts &&counts) {
        for (int axis = 0; axis < 3; ++axis) {
            params.scene_low[axis] = INFINITY;
            params.scene_high[axis] = -INFINITY;
            for (unsigned i = axis; i < positions.size(); i += 3) {
                if (!counts(i / 9)) continue;
                params.scene_low[axis] = fminf(params.scene_low[axis], positions[i]);
                params.scene_high[axis] = fmaxf(params.scene_high[axis], positions[i]);
            }
        }
    }
    void read_normals() {
        for (unsigned i = 0; i < positions.size(); ++i) normals.push_back(number());
        params.normals = normals.data();
    }
    unsigned count() const { return (unsigned)triangles.size() / 3; }
};

// Exact spheres: the nodes of their tree, the spheres in its order, and the id of the first.
struct SpheresOfWords {
    std::vector<SphereNode> nodes;
    std::vector<Sphere> list;
    Spheres described = {};

    template <class T> static void read(std::vector<T> &values) {
        values.resize(word());
        for (T &value : values) {
            unsigned words[sizeof value / sizeof(unsigned)];
            for (unsigned &each : words) each = word();
            std::memcpy(&value, words, sizeof value);
        }
    }
    SpheresOfWords() {
        read(nodes);
        read(list);
        described.first = word();
        describe();
    }
    // Takes what is in the lists.
    void describe() {
        described.nodes = nodes.data();
        described.list = list.data();
        described.node_count = (unsigned)nodes.size();
        std::memcpy(described.low, nodes[0].low, sizeof described.low);
        std::memcpy(described.high, nodes[0].high, sizeof described.high);
    }
};

// The spheres that focus light: the spheres, the rays of their indices, the points of the quadratures and which spheres they are; then numbers
// that are the same for all.
struct LensesOfWords {
    std::vector<Lens> list;
    std::vector<Turned> nodes;
    std::vector<double2> points;
    std::vector<unsigned> by_sphere;
    Focused described = {};

    LensesOfWords() {
        SpheresOfWords::read(list);
        SpheresOfWords::read(nodes);
        SpheresOfWords::read(points);
        SpheresOfWords::read(by_sphere);
        for (double &each : described.axis) each = wide_number();
        for (double &each : described.across) each = wide_number();
        described.blur = wide_number();
        described.list = list.data();
        described.nodes = nodes.data();
        described.points = points.data();
        described.by_sphere = by_sphere.data();
        described.count = (unsigned)list.size();
    }
};

// The photons of each target, after the number of targets: the corners of their bounds, the radius of the discs, the number of cells per scene
// unit, the kernel's greatest weight, the table of cells, and the photons.
struct PhotonsOfWords {
    std::vector<PhotonCloud> clouds;
    std::vector<std::vector<unsigned>> starts;
    std::vector<std::vector<Photon>> photons;

    PhotonsOfWords() {
        unsigned count = word();
        clouds.resize(count);
        starts.resize(count);
        photons.resize(count);
        for (unsigned i = 0; i < count; ++i) {
            PhotonCloud &cloud = clouds[i];
            for (float &each : cloud.low) each = number();
            for (float &each : cloud.high) each = number();
            cloud.radius = number();
            cloud.cells = number();
            cloud.weight = number();
            SpheresOfWords::read(starts[i]);
            SpheresOfWords::read(photons[i]);
            cloud.entries = (unsigned)starts[i].size() - 1;
            cloud.starts = starts[i].data();
            cloud.photons = photons[i].data();
        }
    }
};

// The table of the Sobol points of occlusion (`sobol_table.rs`), after its number of words.
[[maybe_unused]] static std::vector<uint2> read_sobol_table() {
    unsigned words = word();
    std::vector<uint2> table((words + 1) / 2);
    std::memcpy(table.data(), input.data() + place, words * sizeof(unsigned));
    place += words;
    return table;
}

// Reads all of standard input.
static void read_all() {
    unsigned value;
    while (std::fread(&value, sizeof value, 1, stdin) == 1) input.push_back(value);
}
// Writes what was put.
static int write_all() { return std::fwrite(output.data(), 4, output.size(), stdout) == output.size() ? 0 : 1; }
