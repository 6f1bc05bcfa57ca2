// Rays traced by OptiX. Its device functions are calls that the driver resolves when it compiles a module; declared here
// are those that are used (OptiX 8.1 programming guide and its public headers name them).
//
// Payload: 0 to 3 what was met: triangle, or `NO_TRIANGLE` written by the miss program; distance and barycentric coordinates,
// written by the closest-hit program. 4 and 5 where crossed glass is noted; 0 for nowhere.
#pragma once
#include "pass.cuh"

extern "C" { __constant__ Params params; }

DEVICE unsigned launch_x() {
    unsigned x;
    asm("call (%0), _optix_get_launch_index_x, ();" : "=r"(x) :);
    return x;
}
DEVICE unsigned launch_y() {
    unsigned y;
    asm("call (%0), _optix_get_launch_index_y, ();" : "=r"(y) :);
    return y;
}
template <int SLOT> DEVICE unsigned payload() {
    unsigned value;
    asm volatile("call (%0), _optix_get_payload, (%1);" : "=r"(value) : "r"(SLOT) :);
    return value;
}
template <int SLOT> DEVICE void set_payload(unsigned value) {
    asm volatile("call _optix_set_payload, (%0, %1);" : : "r"(SLOT), "r"(value) :);
}
DEVICE void ignore_intersection() { asm volatile("call _optix_ignore_intersection, ();"); }
DEVICE int exception_code() {
    int code;
    asm("call (%0), _optix_get_exception_code, ();" : "=r"(code) :);
    return code;
}
DEVICE Hit current_hit() {
    Hit hit;
    asm("call (%0), _optix_get_ray_tmax, ();" : "=f"(hit.t) :);
    asm("call (%0), _optix_read_primitive_idx, ();" : "=r"(hit.triangle) :);
    asm("call (%0, %1), _optix_get_triangle_barycentrics, ();" : "=f"(hit.u), "=f"(hit.v) :);
    return hit;
}

constexpr unsigned RAY_TERMINATE_ON_FIRST_HIT = 1u << 2, RAY_DISABLE_CLOSEST_HIT = 1u << 3;
// Rays of radiance (`Phong` in project files) and of shadow have miss records and, for each material, hit records of their
// own, in this order.
enum RayType : unsigned { RADIANCE = 0, SHADOW = 1 };

DEVICE void report_hit(const Hit &hit) {
    set_payload<0>(hit.triangle);
    set_payload<1>(__float_as_uint(hit.t));
    set_payload<2>(__float_as_uint(hit.u));
    set_payload<3>(__float_as_uint(hit.v));
}
DEVICE void report_miss() { set_payload<0>(NO_TRIANGLE); }
DEVICE Crossings *asked_crossings() { return (Crossings *)(payload<4>() | (unsigned long long)payload<5>() << 32); }

// Traces a ray through a structure; `p` are the payloads, as written by the programs that ran.
DEVICE void trace(unsigned long long handle, const Ray &ray, RayType type, unsigned flags, unsigned (&p)[PAYLOADS]) {
    // The function takes and returns 32 payloads, used or not.
    unsigned none = 0, types = RAY_TYPES;
    [[maybe_unused]] unsigned rest[32 - PAYLOADS];
    // OptiX wants numbers.
    float t_max = fminf(ray.t_max, 3.402823466e38f);
    asm volatile("call (" "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, %16, %17, %18, %19, %20, %21, "
                 "%22, %23, %24, %25, %26, %27, %28, %29, %30, %31"
                 "), _optix_trace_typed_32, ("
                 "%32, %33, %34, %35, %36, %37, %38, %39, %40, %41, %42, %43, %44, %45, %46, %47, %48, %49, %50, %51, "
                 "%52, %53, %54, %55, %56, %57, %58, %59, %60, %61, %62, %63, %64, %65, %66, %67, %68, %69, %70, %71, "
                 "%72, %73, %74, %75, %76, %77, %78, %79, %80"
                 ");"
                 : "=r"(p[0]), "=r"(p[1]), "=r"(p[2]), "=r"(p[3]), "=r"(p[4]), "=r"(p[5]), "=r"(rest[25]),
                   "=r"(rest[0]), "=r"(rest[1]), "=r"(rest[2]), "=r"(rest[3]), "=r"(rest[4]), "=r"(rest[5]),
                   "=r"(rest[6]), "=r"(rest[7]), "=r"(rest[8]), "=r"(rest[9]), "=r"(rest[10]), "=r"(rest[11]),
                   "=r"(rest[12]), "=r"(rest[13]), "=r"(rest[14]), "=r"(rest[15]), "=r"(rest[16]),
                   "=r"(rest[17]), "=r"(rest[18]), "=r"(rest[19]), "=r"(rest[20]), "=r"(rest[21]),
                   "=r"(rest[22]), "=r"(rest[23]), "=r"(rest[24])
                 : "r"(none), "l"(handle), "f"(ray.origin.x), "f"(ray.origin.y), "f"(ray.origin.z),
                   "f"(ray.direction.x), "f"(ray.direction.y), "f"(ray.direction.z), "f"(ray.t_min),
                   "f"(t_max), "f"(0.0f), "r"(255u), "r"(flags), "r"((unsigned)type), "r"(types),
                   "r"((unsigned)type), "r"(PAYLOADS), "r"(p[0]), "r"(p[1]), "r"(p[2]), "r"(p[3]), "r"(p[4]), "r"(p[5]),
                   "r"(none),
                   "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none),
                   "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none),
                   "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none), "r"(none),
                   "r"(none)
                 :);
}

// Which hits on triangles count is not asked by the ray (`Accept`) but decided by the programs of the materials. OptiX's structures hold
// triangles alone: exact spheres are searched after it, as on our own traversal (`spheres.cuh`).
struct Optix {
    const Params &params;

    template <Accept ACCEPT> __device__ __forceinline__ bool closest(const Ray &ray, Hit &hit) const {
        unsigned p[PAYLOADS] = {NO_TRIANGLE, 0, 0, 0, 0, 0};
        trace(params.handle, ray, RADIANCE, 0, p);
        hit = {__uint_as_float(p[1]), p[0], __uint_as_float(p[2]), __uint_as_float(p[3])};
        bool any = p[0] != NO_TRIANGLE;
        OF_SPHERES(any = with_spheres<ACCEPT>(params, ray, any, hit);)
        return any;
    }
    __device__ __forceinline__ bool has_sky() const { return params.sky_handle != 0; }
    template <Accept> __device__ __forceinline__ bool closest_on_sky(const Ray &ray, Hit &hit) const {
        unsigned p[PAYLOADS] = {NO_TRIANGLE, 0, 0, 0, 0, 0};
        trace(params.sky_handle, ray, RADIANCE, 0, p);
        float t = __uint_as_float(p[1]);
        // Whether OptiX takes a hit at the end of a ray for one is not said.
        if (p[0] == NO_TRIANGLE || !(t < ray.t_max)) return false;
        hit = {t, p[0], __uint_as_float(p[2]), __uint_as_float(p[3])};
        return true;
    }
    template <Accept ACCEPT> __device__ __forceinline__ bool occluded(const Ray &ray, Crossings *crossings) const {
        unsigned long long where = (unsigned long long)crossings;
        unsigned p[PAYLOADS] = {0, 0, 0, 0, (unsigned)where, (unsigned)(where >> 32)};
        // Nothing but the miss program writes the answer, and where something stopped the ray it does not run.
        trace(params.handle, ray, SHADOW, RAY_TERMINATE_ON_FIRST_HIT | RAY_DISABLE_CLOSEST_HIT, p);
        bool blocked = p[0] != NO_TRIANGLE;
        OF_SPHERES(blocked = blocked || occluded_by_sphere<ACCEPT>(params, ray, crossings);)
        return blocked;
    }
    template <Accept ACCEPT, class Rays>
    DEVICE_MEMBER unsigned count_open(bool wanted, const Rays &fan, unsigned samples, RayCounts &rays) const {
        return wanted ? count_open_alone<ACCEPT>(*this, fan, samples, rays) : 0u;
    }
    // OptiX may move threads from warp to warp: each works alone.
    static __device__ __forceinline__ bool any(bool value) { return value; }
};
