// The rays of one ambient-occlusion estimate, which leave one point. A fan has
//   bool ray(params, sample, ray)   makes a ray; false where the report's arithmetic gives none, which counts as open
#pragma once
#include "surface.cuh"

// The points of a fan in the unit square. With Sobol points, samples are numbered in the host's sorted order.
DEVICE uint2 scrambling_of(unsigned key) { return dimensions(key, HASH_SCRAMBLE); }
DEVICE float2 scrambled_point(const Params &params, unsigned sample, uint2 seeds) {
    uint2 sobol = __ldg(params.sobol + sample);
    return make_float2(unit_of(scramble_reversed(sobol.x, seeds.x)), unit_of(scramble_reversed(sobol.y, seeds.y)));
}
DEVICE float2 jittered_point(const Params &params, unsigned sample, unsigned key) {
    constexpr float ONE_BELOW = 1.0f - UNIT_ROUNDOFF;
    uint2 jitter = dimensions(key, sample);
    float width = 1.0f / (float)params.strata;
    unsigned row = sample / params.strata, column = sample - row * params.strata;
    return make_float2(fminf(((float)row + unit_of(jitter.x)) * width, ONE_BELOW),
                       fminf(((float)column + unit_of(jitter.y)) * width, ONE_BELOW));
}
// The sample at position `turn` of an order in which rays of any two fans at the same position go to the same part of their hemispheres, as
// far as the points are spread. The order does not change how many rays are open.
//
// The table has blocks of 4^m points (see `sobol_table.rs`), one in each of 4^m squares of the unit square. The scrambling permutes the
// first m digits among themselves, so its inverse finds the point that it moves into a given square.
DEVICE unsigned sample_of_turn(const Params &params, unsigned turn, uint2 seeds) {
    unsigned digits = (31u - (unsigned)__clz(params.samples)) / 2u, first = 0;
    while (turn >= first + (1u << 2u * digits)) {
        first += 1u << 2u * digits;
        while (1u << 2u * digits > params.samples - first) digits -= 1;
    }
    if (digits == 0) return first;
    // The first digits change slowest from turn to turn.
    unsigned square = __brev(turn - first) >> (32u - 2u * digits), low = (1u << digits) - 1u;
    unsigned x = unscramble_reversed(even_bits(square), seeds.x, digits) & low;
    unsigned y = unscramble_reversed(even_bits(square >> 1), seeds.y, digits) & low;
    return first + (spread_bits(x) | spread_bits(y) << 1);
}
// The ray for a point of the unit square.
DEVICE Ray ray_of_point(const Params &params, float2 point, float3 origin, float3 facing, const Basis &basis) {
    float3 direction = to_world(basis, cosine_direction(point));
    float below = fminf(dot(direction, facing), 0.0f);
    return {origin, direction - 2.0f * below * facing, 0.0f, params.radius};
}

// Rays into the cosine-weighted hemisphere of a surface.
struct Fan {
    float3 origin, facing, normal;
    unsigned key;

    DEVICE_MEMBER unsigned sample_of(const Params &params, unsigned turn) const {
        return params.strata != 0 ? turn : sample_of_turn(params, turn, scrambling_of(key));
    }
    DEVICE_MEMBER bool ray(const Params &params, unsigned sample, Ray &ray) const {
        float2 point = params.strata == 0 ? scrambled_point(params, sample, scrambling_of(key)) : jittered_point(params, sample, key);
        ray = ray_of_point(params, point, origin, facing, basis_around(normal));
        return true;
    }
};

// A fan with what its rays have in common precomputed, for threads that share it: the same rays, bit for bit.
struct SharedFan {
    float3 origin, facing;
    Basis basis;
    uint2 seeds;
    unsigned key;

    static DEVICE_MEMBER SharedFan of(const Fan &fan) {
        return {fan.origin, fan.facing, basis_around(fan.normal), scrambling_of(fan.key), fan.key};
    }
    DEVICE_MEMBER unsigned sample_of(const Params &params, unsigned turn) const {
        return params.strata != 0 ? turn : sample_of_turn(params, turn, seeds);
    }
    // The sample at position `turn` of an order in which successive rays have similar directions. The table of points is followed by the
    // sample numbers in that order.
    DEVICE_MEMBER unsigned neighbour(const Params &params, unsigned turn) const {
        return params.strata != 0 ? turn : __ldg((const unsigned *)(params.sobol + params.samples) + turn);
    }
    DEVICE_MEMBER Ray ray(const Params &params, unsigned sample) const {
        float2 point = params.strata == 0 ? scrambled_point(params, sample, seeds) : jittered_point(params, sample, key);
        return ray_of_point(params, point, origin, facing, basis);
    }
};

// The report's fan, whose noise comes from the position.
struct ThesisFan {
    float3 origin, normal;

    DEVICE_MEMBER unsigned sample_of(const Params &, unsigned turn) const { return turn; }
    DEVICE_MEMBER bool ray(const Params &params, unsigned sample, Ray &ray) const {
        unsigned row = sample / params.strata, column = sample - row * params.strata;
        float3 direction =
            to_world(thesis_basis(normal), thesis_cosine(thesis_stratum(origin, row, column, params.strata)));
        ray = {origin, direction, THESIS_EPSILON, params.radius};
        return is_finite(direction) && is_finite(origin);
    }
};
