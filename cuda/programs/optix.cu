// The programs of one effect for OptiX; `build.sh` names the effect. Their names are those that project files give them, as
// far as a file can: what decides in the report's any-hit programs is passed to one program here.
#define CURITIBA_OPTIX
#include "trace_optix.cuh"

#include CURITIBA_PROGRAM

extern "C" __global__ void __closesthit__closest_hit() {
    Hit hit = current_hit();
    set_payload<0>(1u);
    set_payload<3>(__float_as_uint(hit.t));
    set_payload<4>(hit.triangle);
    set_payload<5>(__float_as_uint(hit.u));
    set_payload<6>(__float_as_uint(hit.v));
}

// Runs on transparent materials only: the others have it switched off.
extern "C" __global__ void __anyhit__any_hit() {
    Crossings *crossings = (Crossings *)(payload<1>() | (unsigned long long)payload<2>() << 32);
    if (!accepts(params, (Accept)payload<0>(), current_hit(), crossings)) ignore_intersection();
}

extern "C" __global__ void __miss__miss() {
    set_payload<0>(0u);
    set_payload<3>(Optix::MISSED);
}

#define RAY_GENERATION(FIDELITY)                                                                                       \
    extern "C" __global__ void __raygen__##FIDELITY() {                                                                \
        unsigned x = launch_x(), y = picture_row(params, launch_y());                                                  \
        Optix tracer = {params};                                                                                       \
        Pass<Optix> pass = {params, tracer, {x, y, y * params.width + x}, true, {}};                                   \
        params.output[pass.pixel.index] = FIDELITY(pass);                                                              \
        count_rays(params, pass.pixel.index, pass.rays);                                                                       \
    }
RAY_GENERATION(corrected)
RAY_GENERATION(thesis)
