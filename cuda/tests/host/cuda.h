// What the device headers take from CUDA, for a compiler of the host: vectors and the intrinsics that have one meaning.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>

#define __device__
#define __forceinline__ inline
#define __noinline__

using std::isfinite;
using std::isnan;
using std::signbit;

struct float2 { float x, y; };
struct float3 { float x, y, z; };
struct alignas(16) float4 { float x, y, z, w; };
struct alignas(16) double2 { double x, y; };
struct double3 { double x, y, z; };
struct uint2 { unsigned x, y; };
struct uint3 { unsigned x, y, z; };
struct alignas(16) uint4 { unsigned x, y, z, w; };
struct uchar4 { unsigned char x, y, z, w; };
inline float2 make_float2(float x, float y) { return {x, y}; }
inline float3 make_float3(float x, float y, float z) { return {x, y, z}; }
inline float4 make_float4(float x, float y, float z, float w) { return {x, y, z, w}; }
inline double2 make_double2(double x, double y) { return {x, y}; }
inline double3 make_double3(double x, double y, double z) { return {x, y, z}; }
inline uint2 make_uint2(unsigned x, unsigned y) { return {x, y}; }
inline uint3 make_uint3(unsigned x, unsigned y, unsigned z) { return {x, y, z}; }
inline uint4 make_uint4(unsigned x, unsigned y, unsigned z, unsigned w) { return {x, y, z, w}; }

template <class T> inline T __ldg(const T *value) { return *value; }
inline float __fmaf_rn(float a, float b, float c) { return std::fma(a, b, c); }
// On a device it is off by its last bits; what uses it allows for that.
inline float __fdividef(float a, float b) { return a / b; }
inline unsigned __float_as_uint(float value) { unsigned bits; std::memcpy(&bits, &value, 4); return bits; }
inline float __uint_as_float(unsigned bits) { float value; std::memcpy(&value, &bits, 4); return value; }
inline unsigned __brev(unsigned v) {
    unsigned reversed = 0;
    for (int bit = 0; bit < 32; ++bit) reversed |= (v >> bit & 1u) << (31 - bit);
    return reversed;
}
inline int __clz(unsigned v) {
    int zeros = 0;
    for (; zeros < 32 && !(v >> (31 - zeros) & 1u); ++zeros) {}
    return zeros;
}
inline unsigned __byte_perm(unsigned a, unsigned b, unsigned selector) {
    // Whole words, which are chosen for each triangle.
    if (selector == 0x3210u) return a;
    if (selector == 0x7654u) return b;
    std::uint64_t bytes = (std::uint64_t)b << 32 | a;
    unsigned result = 0;
    for (int place = 0; place < 4; ++place) result |= (unsigned)(bytes >> 8 * (selector >> 4 * place & 7u) & 255u) << 8 * place;
    return result;
}
inline void sincos(double angle, double *sine, double *cosine) { *sine = std::sin(angle); *cosine = std::cos(angle); }
inline unsigned long long atomicAdd(unsigned long long *sum, unsigned long long value) { *sum += value; return *sum - value; }
inline unsigned min(unsigned a, unsigned b) { return a < b ? a : b; }
