// Vectors with the operation order of the Rust reference: nothing is fused or reassociated (the build passes -fmad=false).
#pragma once
#include "params.cuh"

#define DEVICE static __device__ __forceinline__
#define DEVICE_MEMBER __device__ __forceinline__
// OptiX traces from inlined functions only.
#ifdef CURITIBA_OPTIX
#define OUTLINED __forceinline__
#else
#define OUTLINED __noinline__
#endif
// What is theirs of programs that know exact spheres, and is not there in the others.
#ifdef CURITIBA_SPHERES
#define OF_SPHERES(...) __VA_ARGS__
#else
#define OF_SPHERES(...)
#endif
// The same of programs that follow paths through all glass.
#ifdef CURITIBA_WAYS
#define OF_WAYS(...) __VA_ARGS__
#else
#define OF_WAYS(...)
#endif

DEVICE float3 vec3(float x, float y, float z) { return make_float3(x, y, z); }
DEVICE float3 splat(float s) { return make_float3(s, s, s); }
DEVICE float3 vector_of(const float (&v)[3]) { return make_float3(v[0], v[1], v[2]); }
DEVICE float3 xyz(float4 v) { return make_float3(v.x, v.y, v.z); }
DEVICE float3 operator+(float3 a, float3 b) { return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }
DEVICE float3 operator-(float3 a, float3 b) { return vec3(a.x - b.x, a.y - b.y, a.z - b.z); }
DEVICE float3 operator*(float3 a, float3 b) { return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }
DEVICE float3 operator*(float3 a, float s) { return vec3(a.x * s, a.y * s, a.z * s); }
DEVICE float3 operator*(float s, float3 a) { return vec3(s * a.x, s * a.y, s * a.z); }
DEVICE float3 operator/(float3 a, float s) { return vec3(a.x / s, a.y / s, a.z / s); }
DEVICE float3 operator-(float3 a) { return vec3(-a.x, -a.y, -a.z); }
DEVICE float dot(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
DEVICE float3 cross(float3 a, float3 b) {
    return vec3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
}
DEVICE float3 absolute(float3 a) { return vec3(fabsf(a.x), fabsf(a.y), fabsf(a.z)); }
DEVICE float length_recip(float3 a) { return 1.0f / sqrtf(dot(a, a)); }
DEVICE bool is_black(float3 a) { return a.x == 0.0f && a.y == 0.0f && a.z == 0.0f; }
DEVICE bool is_finite(float3 a) { return isfinite(a.x) && isfinite(a.y) && isfinite(a.z); }

DEVICE bool equal(float3 a, float3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

// Whether a unit vector of this direction exists; then `out` is it.
DEVICE bool try_normalize(float3 a, float3 &out) {
    float reciprocal = length_recip(a);
    if (!(isfinite(reciprocal) && reciprocal > 0.0f)) return false;
    out = a * reciprocal;
    return true;
}
DEVICE float3 normalize_or(float3 a, float3 fallback) {
    float3 out;
    return try_normalize(a, out) ? out : fallback;
}
DEVICE float3 normalize_or_zero(float3 a) { return normalize_or(a, splat(0.0f)); }

DEVICE double3 wide(float3 a) { return make_double3(a.x, a.y, a.z); }
DEVICE float3 narrow(double3 a) { return make_float3((float)a.x, (float)a.y, (float)a.z); }
DEVICE double3 operator+(double3 a, double3 b) { return make_double3(a.x + b.x, a.y + b.y, a.z + b.z); }
DEVICE double3 operator-(double3 a, double3 b) { return make_double3(a.x - b.x, a.y - b.y, a.z - b.z); }
DEVICE double3 operator*(double s, double3 a) { return make_double3(s * a.x, s * a.y, s * a.z); }
DEVICE double dot(double3 a, double3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
DEVICE double3 cross(double3 a, double3 b) {
    return make_double3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
}
DEVICE double3 absolute(double3 a) { return make_double3(fabs(a.x), fabs(a.y), fabs(a.z)); }
DEVICE double3 normalize_or_zero(double3 a) {
    double reciprocal = 1.0 / sqrt(dot(a, a));
    if (!(isfinite(reciprocal) && reciprocal > 0.0)) return make_double3(0.0, 0.0, 0.0);
    return reciprocal * a;
}
