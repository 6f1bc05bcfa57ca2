// The programs of one effect in one fidelity for OptiX; `build.sh` names both. They are called as project files call them:
// `RAY_PROGRAMS` of the pipeline says which a project may name for which rays.
#define CURITIBA_OPTIX
#include "trace_optix.cuh"

#include CURITIBA_PROGRAM

extern "C" __global__ void __raygen__buffer_camera() {
    unsigned x = launch_x(), y = picture_row(params, launch_y());
    Optix tracer = {params};
#ifdef CURITIBA_BODIES
    if ((params.asks & ASKS_EYE) != 0u) {
        Pass<Optix> pass = {params, tracer, {}, true, {}};
        find_bodies_around_eye(pass);
        count_rays(params, 0, pass.rays);
        return;
    }
#endif
    Pass<Optix> pass = {params, tracer, {x, y, y * params.width + x}, true, {}};
    params.output[pass.pixel.index] = CURITIBA_FIDELITY(pass);
    count_rays(params, pass.pixel.index, pass.rays);
}

// Glass or not, the hit is reported: the ray-generation program, which traces one ray after the other, goes on from there.
extern "C" __global__ void __closesthit__closest_hit() { report_hit(current_hit()); }
extern "C" __global__ void __closesthit__closest_hit_glass() { report_hit(current_hit()); }

// Any-hit programs run on materials that let some rays through; the others have them switched off, and stop every ray.
extern "C" __global__ void __anyhit__any_hit_shadow() {
    if (!covers(params, current_hit())) ignore_intersection();
}
// Lets shadow rays pass, and notes the surface where the ray asks for it. A surface that focuses light stops the ray.
extern "C" __global__ void __anyhit__any_hit_shadow_glass() {
    Hit hit = current_hit();
    Crossings *crossings = asked_crossings();
    if (crossings != nullptr && covers(params, hit)) {
        OF_SPHERES(if ((params.asks & ASKS_FOCUSED) && focuses(params, hit.triangle, crossings->origin)) return;)
        add_crossing(*crossings, hit);
    }
    ignore_intersection();
}
// For radiance rays; no project names it, since the material says by itself that it has holes.
extern "C" __global__ void __anyhit__alpha_test() {
    if (!covers(params, current_hit())) ignore_intersection();
}

extern "C" __global__ void __miss__miss() { report_miss(); }
extern "C" __global__ void __miss__miss_shadow() { report_miss(); }

// What OptiX stopped is told to the host: no picture comes of it.
extern "C" __global__ void __exception__exception() { params.ray_counts[EXCEPTION_SLOT] = exception_code(); }
