// Occlusion rays of a warp, traced together. Of the triangles in the boxes that a ray meets few are tested at a time, and by few rays
// of a warp: they wait until there is one for each thread.
#pragma once
#include "trace_bvh.cuh"

// Tests that wait, in shared memory, and the rays that they are of.
struct Together {
    float origin[3][32], direction[3][32], shear[2][32];
    unsigned triangles[64];
    unsigned char owners[64], longest[32], blocked[32];

    DEVICE_MEMBER void put(const Query &query, unsigned ray) {
        origin[0][ray] = query.origin.x;
        origin[1][ray] = query.origin.y;
        origin[2][ray] = query.origin.z;
        direction[0][ray] = query.direction.x;
        direction[1][ray] = query.direction.y;
        direction[2][ray] = query.direction.z;
        shear[0][ray] = query.shear.x;
        shear[1][ray] = query.shear.y;
        longest[ray] = (unsigned char)query.longest;
    }
    DEVICE_MEMBER Query get(unsigned ray, float t_max) const {
        Query query;
        query.origin = vec3(origin[0][ray], origin[1][ray], origin[2][ray]);
        query.direction = vec3(direction[0][ray], direction[1][ray], direction[2][ray]);
        query.shear = vec3(shear[0][ray], shear[1][ray], 0.0f);
        query.longest = longest[ray];
        query.turn = Turn::to(query.longest);
        query.permuted_origin = query.turn(query.origin);
        query.t_min = 0.0f;
        query.t_max = t_max;
        return query;
    }
};

// Makes the first `count` of the tests that wait.
template <Accept ACCEPT> DEVICE void test_waiting(const Params &params, Together &memory, unsigned count, unsigned lane) {
    if (lane < count) {
        unsigned owner = memory.owners[lane];
        Query query = memory.get(owner, params.radius);
        Triangle triangle = load_triangle(params, memory.triangles[lane]);
        Hit hit;
        if (intersect(params, query, triangle.a, triangle.b, triangle.c, query.t_max, hit) && hit.t < query.t_max) {
            hit.triangle = triangle.id & ~TRANSPARENT;
            if (!(triangle.id & TRANSPARENT) || accepts(params, ACCEPT, hit, nullptr)) memory.blocked[owner] = 1;
        }
    }
    __syncwarp();
}

// Whether anything is in the way of a ray up to the radius, where `here`; nothing is before `beyond`, nor other than below node
// `from`.
template <Accept ACCEPT>
DEVICE bool occluded_together(const Params &params, bool here, const Ray &ray, unsigned from, float beyond, Together &memory,
                              unsigned lane) {
    Query query;
    Descent descent;
    bool more = here && params.node_count != 0 && prepare(ray, query);
    if (more) {
        memory.put(query, lane);
        descent.begin(params, query, from, beyond);
    }
    memory.blocked[lane] = 0;
    __syncwarp();
    unsigned waiting = 0;
    while (__any_sync(WHOLE_WARP, more)) {
        unsigned triangles = 0;
        if (more) {
            more = descent.advance(params, params.radius);
            triangles = descent.triangles;
        }
        unsigned mask;
        while ((mask = __ballot_sync(WHOLE_WARP, triangles != 0)) != 0) {
            if (triangles != 0) {
                unsigned place = waiting + __popc(mask & ((1u << lane) - 1u));
                memory.triangles[place] = descent.first + __ffs(triangles) - 1;
                memory.owners[place] = (unsigned char)lane;
                triangles &= triangles - 1;
            }
            waiting += __popc(mask);
            __syncwarp();
            if (waiting < 32u) continue;
            test_waiting<ACCEPT>(params, memory, min(waiting, 32u), lane);
            waiting -= min(waiting, 32u);
            if (lane < waiting) {
                memory.triangles[lane] = memory.triangles[32u + lane];
                memory.owners[lane] = memory.owners[32u + lane];
            }
            if (memory.blocked[lane]) {
                more = false;
                triangles = 0;
            }
            __syncwarp();
        }
    }
    test_waiting<ACCEPT>(params, memory, waiting, lane);
    return memory.blocked[lane] != 0;
}
