// Runs functions of the device's header of the refraction by a sphere on the host. Reads a table of words from standard input, writes one to
// standard output; `caustics.rs` says what is in them, and compares.
#include "cuda.h"
#include "ball.cuh"
#include "words.h"

static void put(double value) {
    unsigned words[2];
    std::memcpy(words, &value, sizeof value);
    put(words[0]);
    put(words[1]);
}
static void put(const Turned &ray) {
    for (double number : {ray.sin, ray.cos, ray.inner, ray.direction[0], ray.direction[1], ray.rate}) put(number);
}

// The rays of a sphere's angles of incidence, and where they meet the sphere and leave it.
static void rays() {
    double index = wide_number();
    while (place < input.size()) {
        Turned ray = turned_at(wide_number(), index);
        put(ray);
        double2 ends[] = {entry_of(ray), exit_of(ray)};
        for (double2 end : ends) {
            put(end.x);
            put(end.y);
        }
    }
}

// The bundles that reach each point, after their number.
static void bundles() {
    double index = wide_number();
    LensesOfWords lenses;
    Ball ball = {lenses.nodes.data(), lenses.points.data(), index};
    auto kept = [](const Turned &ray) { return make_double3(ray.cos, ray.inner, 0.5 * ray.sin); };
    while (place < input.size()) {
        double distance = wide_number(), along_axis = wide_number(), width = wide_number();
        Bundles<decltype(kept)> found(ball, kept, distance, along_axis, width);
        size_t counted = output.size();
        put(0u);
        Bundle bundle;
        while (found.next(bundle)) {
            output[counted] += 1;
            put(bundle.ray);
            for (double number : {bundle.side, bundle.strength.x, bundle.strength.y, bundle.strength.z}) put(number);
        }
    }
}

int main(int count, char **arguments) {
    read_all();
    std::string what = count > 1 ? arguments[1] : "";
    if (what == "rays") rays();
    else if (what == "bundles") bundles();
    else return 1;
    return write_all();
}
