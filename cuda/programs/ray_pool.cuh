// Occlusion rays traced together. Pending work (nodes to open, triangles to test) is kept in shared memory, and any thread of the warp may
// take it, whichever ray it belongs to. So no thread waits for the longest ray, and few wait during triangle tests, although few rays have
// triangles to test at a time.
#pragma once
#include "candidates.cuh"

// Rays of a warp that are traced together. On an H100, 96 took longer: less memory is left for the cache.
constexpr unsigned RAYS = 64;
// Greatest number of nodes that wait to be opened, and a reserve for the nodes that opening them one by one may add.
constexpr unsigned OPENABLE = 128, RESERVE = 7 * STACK;
// Greatest number of triangles that wait to be tested.
constexpr unsigned TESTABLE = 128;
// Triangles that pass the first half of the triangle test (the edge functions) wait until there are this many: they are few, so the second
// half (the distance) is then done by a full warp. Until then, rays that they would stop go on.
constexpr unsigned LIKELY = 24;

// Points whose rays the warps of a block trace.
struct Points {
    float4 origins[32]; // w: the distance before which nothing is hit
    SharedFan fans[32];
    uint4 rays[32];   // valid where that distance is above 0: one bit for each sample whose ray is to be traced
    unsigned from[32]; // node below which everything lies that the rays may hit
    unsigned open[32]; // number of rays found open
    unsigned char order[32];
    unsigned count;       // number of points
    unsigned next, end;   // next ray to be traced here, and the end of these rays
    bool close;           // whether all points are close to each other
    bool more;            // whether there are points to trace
    float3 pad;           // by which boxes are widened
};

// A warp's shared memory for tracing rays.
struct TracingMemory {
    float4 inverse[RAYS];   // reciprocals of the directions; w: point + 32 * longest axis
    float4 direction[RAYS]; // w: first shear coefficient
    float shear[RAYS];      // second shear coefficient
    unsigned queue[64];     // rays to be prepared: point + 32 * sample
    // Pending nodes, triangles and likely hit triangles, each with its ray.
    unsigned nodes[OPENABLE + RESERVE], triangles[TESTABLE], likely[64];
    unsigned char node_rays[OPENABLE + RESERVE], triangle_rays[TESTABLE], likely_rays[64];
    unsigned char blocked[RAYS];

    DEVICE_MEMBER unsigned owner(unsigned ray) const { return __float_as_uint(inverse[ray].w); }
    DEVICE_MEMBER Query query(const Points &points, unsigned ray, float t_max) const {
        Query query;
        float4 d = direction[ray];
        unsigned of = owner(ray);
        query.origin = xyz(points.origins[of & 31u]);
        query.direction = xyz(d);
        query.shear = vec3(d.w, shear[ray], 0.0f);
        query.longest = (int)(of >> 5);
        query.turn = Turn::to(query.longest);
        query.permuted_origin = query.turn(query.origin);
        query.t_min = 0.0f;
        query.t_max = t_max;
        return query;
    }
};

// Inclusive prefix sum over the threads of a warp.
DEVICE unsigned sum_up_to(unsigned value) {
#pragma unroll
    for (int step = 1; step < 32; step <<= 1) {
        asm volatile("{.reg .pred there; .reg .b32 before;"
                     "shfl.sync.up.b32 before|there, %0, %1, 0, -1; @there add.u32 %0, %0, before;}"
                     : "+r"(value)
                     : "r"(step));
    }
    return value;
}

// Finishes the tests of the first `count` likely hit triangles.
template <Accept ACCEPT>
DEVICE void test_likely(const Params &params, const Points &points, TracingMemory &memory, unsigned count, unsigned lane) {
    if (lane < count) {
        unsigned ray = memory.likely_rays[lane];
        Query query = memory.query(points, ray, params.radius);
        Triangle triangle = load_triangle(params, memory.likely[lane]);
        Hit hit;
        if (intersect(params, query, triangle.a, triangle.b, triangle.c, query.t_max, hit) && hit.t < query.t_max) {
            hit.triangle = triangle.id & ~TRANSPARENT;
            if (!(triangle.id & TRANSPARENT) || accepts(params, ACCEPT, hit, nullptr)) memory.blocked[ray] = 1;
        }
    }
    __syncwarp();
}

// Begins the tests of `count` pending triangles from `first` on. Those that pass the edge functions become likely hits and wait.
template <Accept ACCEPT>
DEVICE void test_triangles(const Params &params, const Points &points, TracingMemory &memory, unsigned first, unsigned count,
                           unsigned &likely, unsigned lane) {
    bool met = false;
    unsigned ray = 0, place = 0;
    if (lane < count) {
        ray = memory.triangle_rays[first + lane];
        place = memory.triangles[first + lane];
        Triangle triangle = load_triangle(params, place);
        met = !memory.blocked[ray] &&
              !passes_by(edges_of(memory.query(points, ray, params.radius), triangle.a, triangle.b, triangle.c));
    }
    unsigned mask = __ballot_sync(WHOLE_WARP, met);
    if (met) {
        unsigned at = likely + __popc(mask & ((1u << lane) - 1u));
        memory.likely[at] = place;
        memory.likely_rays[at] = (unsigned char)ray;
    }
    likely += __popc(mask);
    __syncwarp();
    if (likely < LIKELY) return;
    count = min(likely, 32u);
    test_likely<ACCEPT>(params, points, memory, count, lane);
    likely -= count;
    if (lane < likely) {
        memory.likely[lane] = memory.likely[32u + lane];
        memory.likely_rays[lane] = memory.likely_rays[32u + lane];
    }
    __syncwarp();
}

// Traces the rays with `nodes` pending nodes, until it is known which are blocked.
template <Accept ACCEPT>
DEVICE void trace_together(const Params &params, const Points &points, unsigned nodes, TracingMemory &memory, unsigned lane) {
    unsigned triangles = 0, likely = 0;
    while (nodes > 0) {
        unsigned taken = min(nodes, 32u), ray = 0;
        unsigned inner = 0, slots = 0, children = 0, leaves = 0, first = 0;
        if (lane < taken) {
            const uint4 *at = node_at(params, memory.nodes[nodes - 1u - lane]);
            ray = memory.node_rays[nodes - 1u - lane];
            if (!memory.blocked[ray]) {
                float4 inverse = memory.inverse[ray], origin = points.origins[__float_as_uint(inverse.w) & 31u];
                Node node = load_node(at);
                unsigned met = met_slots(node, at, {xyz(origin), xyz(inverse), points.pad}, origin.w, params.radius);
                slots = node.inner();
                inner = met & slots;
                children = node.meta.x;
                leaves = node.triangles(met);
                first = node.meta.y;
            }
        }
        // Low 16 bits: number of nodes; high 16 bits: number of triangles.
        unsigned own = __popc(inner) | __popc(leaves) << 16, sum = sum_up_to(own), all = __shfl_sync(WHOLE_WARP, sum, 31);
        if (nodes - taken + (all & 0xffffu) > OPENABLE || triangles + (all >> 16) > TESTABLE) {
            // Nodes whose children do not fit are opened later. The children of one node always fit: the reserve holds what opening one by
            // one adds.
            bool room = nodes - 1u - lane + (sum & 0xffffu) <= OPENABLE && triangles + (sum >> 16) <= TESTABLE;
            unsigned none = ~__ballot_sync(WHOLE_WARP, lane < taken && room);
            taken = max(min((unsigned)__ffs(none) - 1u, taken), 1u);
            if (lane >= taken) inner = leaves = 0;
            all = __shfl_sync(WHOLE_WARP, sum, taken - 1u);
        }
        nodes -= taken;
        __syncwarp();
        unsigned place = nodes + ((sum - own) & 0xffffu);
        for (; inner != 0; inner &= inner - 1) {
            unsigned slot = __ffs(inner) - 1;
            memory.nodes[place] = children + __popc(slots & ((1u << slot) - 1u));
            memory.node_rays[place++] = (unsigned char)ray;
        }
        place = triangles + (sum - own >> 16);
        for (; leaves != 0; leaves &= leaves - 1) {
            memory.triangles[place] = first + __ffs(leaves) - 1;
            memory.triangle_rays[place++] = (unsigned char)ray;
        }
        nodes += all & 0xffffu;
        triangles += all >> 16;
        __syncwarp();
        while (triangles >= 32u) {
            triangles -= 32u;
            test_triangles<ACCEPT>(params, points, memory, triangles, 32u, likely, lane);
        }
    }
    test_triangles<ACCEPT>(params, points, memory, 0u, triangles, likely, lane);
    test_likely<ACCEPT>(params, points, memory, likely, lane);
}
