// Traversal of the binary tree, one ray for each thread, with the stack in private memory: on an H100 twice as fast as in workgroup memory.

// A ray meets the planes of a box at `plane * inverse - start`. For low planes, `start` belongs to the origin moved up, for high planes to the
// origin moved down. The origin is moved by the error of the triangle test plus the error of this test with any rounding, fused or not
// (`box_padding` of `cuda/programs/trace_bvh.cuh` has the same units). So no box is culled whose triangle is hit.
struct Way { inverse: vec3f, low: vec3f, high: vec3f }
fn way_of(query: ptr<function, Query>) -> Way {
    let origin = (*query).origin;
    let reach = reach_from(origin);
    let pad = (reach * 40.0 + vec3f(most3(reach) * 8.0) + abs(origin) * 34.0) * UNIT_ROUNDOFF;
    let inverse = (*query).inverse;
    return Way(inverse, (origin + pad) * inverse, (origin - pad) * inverse);
}
// Distances at which the ray enters and leaves a box.
fn enters(way: Way, low: vec3f, high: vec3f, t_min: f32, limit: f32) -> vec2f {
    let a = low * way.inverse - way.low;
    let b = high * way.inverse - way.high;
    let near = min(a, b); let far = max(a, b);
    return vec2f(max(max(near.x, near.y), max(near.z, t_min)), min(min(far.x, far.y), min(far.z, limit)) * LATER);
}
// A factor above the rounding of the reciprocals, which differs between the axes.
const LATER: f32 = 1.0 + 32.0 * UNIT_ROUNDOFF;

// The children of a node that the ray enters, the nearer one first; NONE for a child that it misses.
fn open_node(way: Way, index: u32, t_min: f32, limit: f32) -> vec2u {
    let a = bitcast<vec4f>(nodes_at(4u * index)); let b = bitcast<vec4f>(nodes_at(4u * index + 1u));
    let z = bitcast<vec4f>(nodes_at(4u * index + 2u));
    let children = nodes_at(4u * index + 3u).xy;
    let first = enters(way, vec3f(a.x, a.z, z.x), vec3f(a.y, a.w, z.y), t_min, limit);
    let second = enters(way, vec3f(b.x, b.z, z.z), vec3f(b.y, b.w, z.w), t_min, limit);
    let met = vec2u(select(NONE, children.x, first.x <= first.y), select(NONE, children.y, second.x <= second.y));
    return select(met, met.yx, met.x == NONE || (met.y != NONE && second.x < first.x));
}

// The state of a ray's traversal, from one triangle that it may hit to the next. The exact triangle test is outside of this loop: it takes
// many registers, and few triangles reach it.
struct Descent { way: Way, current: u32, depth: u32, next: u32, end: u32, t_min: f32 }
var<private> stack: array<u32, STACK>;

fn begin_descent(query: ptr<function, Query>, top: u32, t_min: f32) -> Descent {
    return Descent(way_of(query), top, 0u, 1u, 0u, t_min);
}
// The next triangle that the ray may hit before `limit`; NONE if none is left.
fn next_candidate(descent: ptr<function, Descent>, query: ptr<function, Query>, limit: f32) -> u32 {
    loop {
        while (*descent).next <= (*descent).end {
            let index = (*descent).next;
            (*descent).next += 1u;
            if may_pass(query, load_triangle(index).corners) { return index; }
        }
        if (*descent).current == NONE {
            if (*descent).depth == 0u { break; }
            (*descent).depth -= 1u;
            (*descent).current = stack[(*descent).depth];
        }
        while ((*descent).current & LEAF) == 0u {
            let met = open_node((*descent).way, (*descent).current, (*descent).t_min, limit);
            if met.y != NONE {
                stack[(*descent).depth] = met.y;
                (*descent).depth += 1u;
            }
            (*descent).current = met.x;
            if met.x == NONE && (*descent).depth > 0u {
                (*descent).depth -= 1u;
                (*descent).current = stack[(*descent).depth];
            }
        }
        let leaf = (*descent).current;
        if leaf == NONE { break; }
        (*descent).next = leaf & FIRST_OF_LEAF;
        (*descent).end = (*descent).next + (leaf >> COUNT_SHIFT & 3u);
        (*descent).current = NONE;
    }
    return NONE;
}

// The nearest accepted hit, including hits on a sky; at equal distances, the triangle with the lowest id.
fn closest(accept: u32, ray: Ray, best: ptr<function, Hit>) -> bool {
    var query: Query;
    if params.whole == NONE || !prepare(ray, &query) { return false; }
    var descent = begin_descent(&query, params.whole, query.t_min);
    var limit = query.t_max;
    var any = false;
    loop {
        let index = next_candidate(&descent, &query, limit);
        if index == NONE { break; }
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
⟪    if closest_sphere(accept, &query, limit, best) { any = true; }
⟫    return any;
}

// Whether any accepted hit exists below a node. All hits are known to lie beyond the distance `behind`; boxes that end before it are
// skipped.
fn occluded_below(accept: u32, ray: Ray, top: u32, behind: f32) -> bool {
    var query: Query;
    if top == NONE || !prepare(ray, &query) { return false; }
    var descent = begin_descent(&query, top, max(query.t_min, behind));
    let limit = query.t_max;
    loop {
        let index = next_candidate(&descent, &query, limit);
        if index == NONE { break; }
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
    return false;
}
// Whether any accepted hit exists.
fn occluded(accept: u32, ray: Ray) -> bool { return occluded_below(accept, ray, params.root, 0.0)⟪ || occluded_by_sphere(accept, ray)⟫; }
