// Random numbers without state and directions of a hemisphere: the same integers and, step by step, the same floats as
// `passes/src/sampling`, which names the sources of each formula.
#pragma once
#include "vector.cuh"

DEVICE uint4 pcg4d(uint4 v) {
    v.x = v.x * 1664525u + 1013904223u;
    v.y = v.y * 1664525u + 1013904223u;
    v.z = v.z * 1664525u + 1013904223u;
    v.w = v.w * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v.x ^= v.x >> 16;
    v.y ^= v.y >> 16;
    v.z ^= v.z >> 16;
    v.w ^= v.w >> 16;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}
DEVICE unsigned pixel_key(unsigned x, unsigned y, unsigned seed) { return pcg4d(make_uint4(x, y, seed, HASH_PIXEL)).w; }
DEVICE unsigned path_key(unsigned key, unsigned branch) { return pcg4d(make_uint4(key, branch, 0u, HASH_PATH)).w; }
// The key for a light of a pass, by its number.
DEVICE unsigned light_key(unsigned key, unsigned number) { return number == 0 ? key : path_key(key, BRANCH_LIGHTS + number); }
DEVICE uint2 dimensions(unsigned key, unsigned counter) {
    uint4 v = pcg4d(make_uint4(key, counter, 0u, HASH_DIMENSIONS));
    return make_uint2(v.z, v.w);
}
DEVICE float unit_of(unsigned bits) { return (float)(bits >> 8) * (1.0f / 16777216.0f); }

DEVICE unsigned scramble_reversed(unsigned v, unsigned seed) {
    v += seed;
    v ^= v * 0x6c50b47cu;
    v ^= v * 0xb82f1e52u;
    v ^= v * 0xc7afe638u;
    v ^= v * 0x8d22f6e6u;
    return __brev(v);
}
// Both dimensions of a point of the Sobol sequence, bits reversed.
DEVICE uint2 reversed_sobol(unsigned index) {
    unsigned second = 0u, column = 1u;
    for (unsigned digits = index; digits != 0u; digits >>= 1) {
        if (digits & 1u) second ^= column;
        column ^= column << 1;
    }
    return make_uint2(index, second);
}
// A number in a shuffled order, in which each aligned block of 2^k numbers stays a block.
DEVICE unsigned shuffled(unsigned number, unsigned order) { return scramble_reversed(__brev(number), order); }
// The lowest digits, the first ones, of what `scramble_reversed` would take to these, before it reverses them.
DEVICE unsigned unscramble_reversed(unsigned v, unsigned seed, unsigned digits) {
    // Each step v ^= v * c with an even c leaves digits to the lower ones, and so is undone digit by digit.
    auto undo = [&](unsigned v, unsigned c) {
        unsigned before = v;
        for (unsigned digit = 1; digit < digits; ++digit) before = v ^ before * c;
        return before;
    };
    return undo(undo(undo(undo(v, 0x8d22f6e6u), 0xc7afe638u), 0xb82f1e52u), 0x6c50b47cu) - seed;
}
// Bits 0, 2, 4 and so on, side by side; and the way back.
DEVICE unsigned even_bits(unsigned v) {
    v &= 0x55555555u;
    v = (v | v >> 1) & 0x33333333u;
    v = (v | v >> 2) & 0x0f0f0f0fu;
    v = (v | v >> 4) & 0x00ff00ffu;
    return (v | v >> 8) & 0x0000ffffu;
}
DEVICE unsigned spread_bits(unsigned v) {
    v = (v | v << 8) & 0x00ff00ffu;
    v = (v | v << 4) & 0x0f0f0f0fu;
    v = (v | v << 2) & 0x33333333u;
    return (v | v << 1) & 0x55555555u;
}

struct Basis {
    float3 tangent, bitangent, normal;
};
DEVICE float3 to_world(const Basis &basis, float3 v) {
    return basis.tangent * v.x + basis.bitangent * v.y + basis.normal * v.z;
}
DEVICE Basis basis_around(float3 n) {
    float sign = copysignf(1.0f, n.z);
    float a = -1.0f / (sign + n.z);
    float b = n.x * n.y * a;
    return {vec3(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x), vec3(b, sign + n.y * n.y * a, -n.y), n};
}

DEVICE float2 sin_cos_eighth(float angle) {
    float square = angle * angle;
    float sine = ((-1.9515296e-4f * square + 8.332161e-3f) * square - 1.6666655e-1f) * square * angle + angle;
    float cosine = ((2.4433157e-5f * square - 1.3887316e-3f) * square + 4.1666646e-2f) * square * square;
    return make_float2(sine, cosine - 0.5f * square + 1.0f);
}
DEVICE float2 concentric_disk(float2 point) {
    constexpr float QUARTER_PI = 0.785398163397448309615660845819875721f;
    float x = 2.0f * point.x - 1.0f, y = 2.0f * point.y - 1.0f;
    if (fabsf(x) > fabsf(y)) {
        float2 sc = sin_cos_eighth(QUARTER_PI * (y / x));
        return make_float2(x * sc.y, x * sc.x);
    }
    if (y != 0.0f) {
        float2 sc = sin_cos_eighth(QUARTER_PI * (x / y));
        return make_float2(y * sc.x, y * sc.y);
    }
    return make_float2(0.0f, 0.0f);
}
DEVICE float3 cosine_direction(float2 point) {
    float2 disk = concentric_disk(point);
    return vec3(disk.x, disk.y, sqrtf(fmaxf(1.0f - (disk.x * disk.x + disk.y * disk.y), 0.0f)));
}

// Uniform in the solid angle of a cone around z whose spherical cap has this height.
DEVICE float3 in_cone(float2 point, float height) {
    float2 disk = concentric_disk(point);
    float below = (disk.x * disk.x + disk.y * disk.y) * height, stretch = sqrtf(height * (2.0f - below));
    return vec3(disk.x * stretch, disk.y * stretch, 1.0f - below);
}
// A direction to the disc of a light, whose centre is the basis's normal.
DEVICE float3 disc_direction(uint2 point, uint2 seeds, const Basis &basis, float height) {
    float2 square = make_float2(unit_of(scramble_reversed(point.x, seeds.x)), unit_of(scramble_reversed(point.y, seeds.y)));
    return to_world(basis, in_cone(square, height));
}

// The report's noise and its hemisphere, for thesis fidelity. Sines are taken in double precision and rounded once.
DEVICE float thesis_rand(float x, float y) {
    float angle = x * 12.9898f + y * 78.233f;
    float sine = (float)sin((double)angle);
    float product = (float)((double)sine * 43758.5453);
    return product - truncf(product);
}
DEVICE float2 thesis_stratum(float3 p, unsigned i, unsigned j, unsigned side) {
    float a = (float)(i + 1), b = (float)(j + 1);
    float rand1 = thesis_rand(p.x * a, p.y * b);
    float rand2 = thesis_rand(p.x * b, p.z * a);
    float rand3 = thesis_rand(p.y * a, p.z * b);
    float rand4 = thesis_rand(rand1 * b, rand2 * a);
    float rand5 = thesis_rand(rand3 * a, rand4 * b);
    float width = 1.0f / (float)side;
    return make_float2(((float)i + rand5) * width, ((float)j + rand4) * width);
}
DEVICE float3 thesis_cosine(float2 point) {
    constexpr float PI = 3.14159265358979323846264338327950288f;
    float radius = sqrtf(point.x);
    double sine, cosine;
    sincos((double)(2.0f * PI * point.y), &sine, &cosine);
    float x = radius * (float)cosine, y = radius * (float)sine;
    return vec3(x, y, sqrtf(fmaxf(1.0f - x * x - y * y, 0.0f)));
}
DEVICE Basis thesis_basis(float3 n) {
    float3 b = fabsf(n.x) > fabsf(n.z) ? vec3(-n.y, n.x, 0.0f) : vec3(0.0f, -n.z, n.y);
    b = b * length_recip(b);
    return {cross(b, n), b, n};
}
