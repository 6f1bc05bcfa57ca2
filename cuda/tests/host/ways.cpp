// Runs functions of `ways.cuh` on the host; `ways.rs` says what they read and write.
#define CURITIBA_BODIES
#define CURITIBA_WAYS
#include "cuda.h"
#include "ways.cuh"
#include "words.h"

// For each width, normal, view, point and direction: the facet's normal, and what other facets leave of the direction.
static void facets() {
    while (place < input.size()) {
        float alpha = number();
        float3 normal = vector(), view = vector();
        float x = number();
        Microfacet facet = facet_seen(alpha, normal, view, make_float2(x, number()));
        put(facet.normal);
        put(passes_facets(facet, vector()));
    }
}

// For each index, spread, wavelength, curve, cosine, ratio and kind of weights: the index at the wavelength, and the interface.
static void indices() {
    Body body = {};
    Face face = {};
    float4 stratum = {};
    Ways ways = {&face, &stratum, nullptr, nullptr, 1};
    Params params = {};
    params.bodies = &body;
    params.segments = (const float4 *)&ways;
    WaysWalk walk;
    while (place < input.size()) {
        body.index = number();
        face.spread = number();
        stratum.w = number();
        face.minimum = number();
        face.maximum = number();
        face.exponent = number();
        float cosine = number(), ratio = number();
        params.fresnel = word();
        put(walk.index_for(params, 0, 0));
        Interface interface = face_at(params, 0, cosine, ratio);
        put(interface.reflectance);
        put(interface.cos_refracted);
    }
}

int main(int count, char **arguments) {
    if (count != 2) return 2;
    read_all();
    std::string(arguments[1]) == "facets" ? facets() : indices();
    return write_all();
}
