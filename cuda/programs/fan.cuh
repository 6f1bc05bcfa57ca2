// The rays of one ambient-occlusion estimate, which leave one point. A fan has
//   bool ray(params, sample, ray)   a ray; false where the report's arithmetic gives none, which counts as open
#pragma once
#include "surface.cuh"

// Into the cosine-weighted hemisphere of a surface.
struct Fan {
    float3 origin, facing, normal;
    unsigned key;

    // With Sobol points the samples are numbered as the host sorted the table, so that neighbours go the same way; how many
    // are open does not depend on it.
    DEVICE_MEMBER bool ray(const Params &params, unsigned sample, Ray &ray) const {
        float2 point;
        if (params.strata == 0) {
            uint2 sobol = __ldg(params.sobol + sample), seeds = dimensions(key, HASH_SCRAMBLE);
            point.x = unit_of(scramble_reversed(sobol.x, seeds.x));
            point.y = unit_of(scramble_reversed(sobol.y, seeds.y));
        } else {
            constexpr float ONE_BELOW = 1.0f - UNIT_ROUNDOFF;
            uint2 jitter = dimensions(key, sample);
            float width = 1.0f / (float)params.strata;
            unsigned row = sample / params.strata, column = sample - row * params.strata;
            point.x = fminf(((float)row + unit_of(jitter.x)) * width, ONE_BELOW);
            point.y = fminf(((float)column + unit_of(jitter.y)) * width, ONE_BELOW);
        }
        float3 direction = to_world(basis_around(normal), cosine_direction(point));
        float below = fminf(dot(direction, facing), 0.0f);
        ray = {origin, direction - 2.0f * below * facing, 0.0f, params.radius};
        return true;
    }
};

// The report's, whose noise comes from the position.
struct ThesisFan {
    float3 origin, normal;

    DEVICE_MEMBER bool ray(const Params &params, unsigned sample, Ray &ray) const {
        unsigned row = sample / params.strata, column = sample - row * params.strata;
        float3 direction =
            to_world(thesis_basis(normal), thesis_cosine(thesis_stratum(origin, row, column, params.strata)));
        ray = {origin, direction, THESIS_EPSILON, params.radius};
        return is_finite(direction) && is_finite(origin);
    }
};
