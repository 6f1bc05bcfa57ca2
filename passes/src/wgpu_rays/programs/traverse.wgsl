// The way of a ray down the binary tree, one ray a thread, its stack in private memory: on an H100 twice as fast as in workgroup memory.

// A ray runs from plane to plane of a box at `plane * inverse - start`: the low planes begin at the origin moved up, the high ones at
// the origin moved down. Moved by the error of the triangle test and by that of this test in any order of rounding, fused or not
// (`box_padding` of `cuda/programs/trace_bvh.cuh` has the same units), so that no box is left out whose triangle is hit.
struct Way { inverse: vec3f, low: vec3f, high: vec3f }
fn way_of(query: ptr<function, Query>) -> Way {
    let origin = (*query).origin;
    let reach = reach_from(origin);
    let pad = (reach * 40.0 + vec3f(most3(reach) * 8.0) + abs(origin) * 34.0) * UNIT_ROUNDOFF;
    let inverse = (*query).inverse;
    return Way(inverse, (origin + pad) * inverse, (origin - pad) * inverse);
}
// Where the ray enters and leaves a box.
fn enters(way: Way, low: vec3f, high: vec3f, t_min: f32, limit: f32) -> vec2f {
    let a = low * way.inverse - way.low;
    let b = high * way.inverse - way.high;
    let near = min(a, b); let far = max(a, b);
    return vec2f(max(max(near.x, near.y), max(near.z, t_min)), min(min(far.x, far.y), min(far.z, limit)) * LATER);
}
// Above the rounding of the inverses, which is between the axes.
const LATER: f32 = 1.0 + 32.0 * UNIT_ROUNDOFF;

// The children of a node that the ray meets, the nearer one first; NONE where there is none.
fn open_node(way: Way, index: u32, t_min: f32, limit: f32) -> vec2u {
    let a = bitcast<vec4f>(nodes[4u * index]); let b = bitcast<vec4f>(nodes[4u * index + 1u]);
    let z = bitcast<vec4f>(nodes[4u * index + 2u]);
    let children = nodes[4u * index + 3u].xy;
    let first = enters(way, vec3f(a.x, a.z, z.x), vec3f(a.y, a.w, z.y), t_min, limit);
    let second = enters(way, vec3f(b.x, b.z, z.z), vec3f(b.y, b.w, z.w), t_min, limit);
    let met = vec2u(select(NONE, children.x, first.x <= first.y), select(NONE, children.y, second.x <= second.y));
    return select(met, met.yx, met.x == NONE || (met.y != NONE && second.x < first.x));
}

// The nearest accepted hit; of several at one distance, that of the lowest triangle.
fn closest(accept: u32, ray: Ray, best: ptr<function, Hit>) -> bool {
    var query: Query;
    if params.root == NONE || !prepare(ray, &query) { return false; }
    let way = way_of(&query);
    var limit = query.t_max;
    var any = false;
    var stack: array<u32, STACK>;
    var depth = 0u;
    var current = params.root;
    loop {
        if (current & LEAF) == 0u {
            let met = open_node(way, current, query.t_min, limit);
            if met.y != NONE {
                stack[depth] = met.y;
                depth += 1u;
            }
            if met.x != NONE {
                current = met.x;
                continue;
            }
        } else {
            let end = (current & FIRST_OF_LEAF) + (current >> COUNT_SHIFT & 3u);
            for (var index = current & FIRST_OF_LEAF; index <= end; index += 1u) {
                let triangle = load_triangle(index);
                let e = edges_of(&query, triangle.corners);
                if !e.passes || decide(&query, triangle.corners, limit) == MISSES { continue; }
                var hit: Hit;
                if !solve(&query, triangle.corners, e, limit, &hit) { continue; }
                hit.triangle = triangle.id & ~TRANSPARENT;
                let nearer = select(hit.t < limit, hit.t < (*best).t || (hit.t == (*best).t && hit.triangle < (*best).triangle), any);
                if nearer && ((triangle.id & TRANSPARENT) == 0u || accepts(accept, hit)) {
                    limit = hit.t;
                    *best = hit;
                    any = true;
                }
            }
        }
        if depth == 0u { break; }
        depth -= 1u;
        current = stack[depth];
    }
    return any;
}

// Whether any accepted hit exists.
fn occluded(accept: u32, ray: Ray) -> bool {
    var query: Query;
    if params.root == NONE || !prepare(ray, &query) { return false; }
    let way = way_of(&query);
    let limit = query.t_max;
    var stack: array<u32, STACK>;
    var depth = 0u;
    var current = params.root;
    loop {
        if (current & LEAF) == 0u {
            let met = open_node(way, current, query.t_min, limit);
            if met.y != NONE {
                stack[depth] = met.y;
                depth += 1u;
            }
            if met.x != NONE {
                current = met.x;
                continue;
            }
        } else {
            let end = (current & FIRST_OF_LEAF) + (current >> COUNT_SHIFT & 3u);
            for (var index = current & FIRST_OF_LEAF; index <= end; index += 1u) {
                let triangle = load_triangle(index);
                let e = edges_of(&query, triangle.corners);
                if !e.passes { continue; }
                let verdict = decide(&query, triangle.corners, limit);
                if verdict == MISSES { continue; }
                let transparent = (triangle.id & TRANSPARENT) != 0u;
                if verdict == HITS && !e.some_zero && !transparent { return true; }
                var hit: Hit;
                if !solve(&query, triangle.corners, e, limit, &hit) { continue; }
                hit.triangle = triangle.id & ~TRANSPARENT;
                if hit.t < limit && (!transparent || accepts(accept, hit)) { return true; }
            }
        }
        if depth == 0u { return false; }
        depth -= 1u;
        current = stack[depth];
    }
    return false;
}
