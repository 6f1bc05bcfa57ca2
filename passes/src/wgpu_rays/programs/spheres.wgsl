// Exact spheres (`trace/spheres`, `trace/origin/sphere_point.rs`): the test of a ray, a tree over many, and points on them. Other texts
// have their code for spheres between ⟪ and ⟫; it is left out where the scene has none.
//
// The test has the processor's numbers step by step. Drivers may round roots and quotients in any way, so these are corrected. Whether a sphere is
// hit, and whether a ray that starts on it leaves it, then does not depend on the driver.

struct Sphere { center: vec3f, radius: f32 }
// Two vectors for each sphere, in the order of the tree. The first: centre and radius. The second: the id, with TRANSPARENT; and, in entry n, the
// place of the sphere whose id is `first_sphere` + n.
fn load_sphere(place: u32) -> Sphere {
    let v = bitcast<vec4f>(leaves_at(params.spheres_at + 2u * place));
    return Sphere(v.xyz, v.w);
}
fn sphere_id(place: u32) -> u32 { return leaves_at(params.spheres_at + 2u * place + 1u).x; }
// Ids of spheres follow those of the triangles. They have neither texture coordinates nor vertex colours nor normal maps nor cut-outs.
fn is_sphere(id: u32) -> bool { return id >= params.first_sphere; }
fn sphere_of(id: u32) -> Sphere { return load_sphere(leaves_at(params.spheres_at + 2u * (id - params.first_sphere) + 1u).y); }
const OF_VERTICES: u32 = SHADE_CUT | SHADE_VERTEX_COLORS | SHADE_NORMAL_MAP;

// The square root of a number that is not negative, and a quotient by a number that is not 0, rounded to nearest as on the processor. The driver's
// result is corrected by the residual. It is then compared exactly with the midpoints to the next numbers on either side. Numbers below 2^-90 stay
// as the driver finds them.
fn rounded_root(x: f32) -> f32 {
    let found = sep(sqrt(x));
    if !(found > LEAST_ROUNDED && is_finite(found)) { return found; }
    let more = add(wide(x), minus(exact_product(found, found)));
    let root = sep(found + sep(0.5 * sep(more.h / found)));
    let above = next_number(root, 1u); let below = next_number(root, 0xffffffffu);
    let rest = add(wide(x), minus(exact_product(root, root)));
    if add(rest, wide(-sep(root * sep(above - root)))).h > 0.0 { return above; }
    return select(root, below, add(rest, wide(sep(root * sep(root - below)))).h <= 0.0);
}
fn rounded_quotient(a: f32, b: f32) -> f32 {
    let dividend = abs(a); let divisor = abs(b);
    let found = sep(dividend / divisor);
    var quotient = found;
    if found > LEAST_ROUNDED && is_finite(found) {
        let more = add(wide(dividend), minus(exact_product(found, divisor)));
        quotient = sep(found + sep(more.h / divisor));
        let above = next_number(quotient, 1u); let below = next_number(quotient, 0xffffffffu);
        let rest = add(wide(dividend), minus(exact_product(quotient, divisor)));
        let up = add(rest, wide(-sep(divisor * sep(0.5 * sep(above - quotient)))));
        let down = add(rest, wide(sep(divisor * sep(0.5 * sep(quotient - below)))));
        quotient = select(select(quotient, below, down.h < 0.0), above, up.h > 0.0);
    }
    return select(quotient, -quotient, (a < 0.0) != (b < 0.0));
}
const LEAST_ROUNDED: f32 = 8.0e-28;
fn next_number(x: f32, by: u32) -> f32 { return bitcast<f32>(bitcast<u32>(x) + by); }

// The distances at which a ray's line meets a sphere, the lower first (`roots` of `sphere.rs`, which gives the source).
struct Roots { meets: bool, low: f32, high: f32 }
fn roots_of(origin: vec3f, direction: vec3f, sphere: Sphere) -> Roots {
    let apart = sep3(origin - sphere.center);
    let b = -sep(dot3(apart, direction));
    let nearest = sep3(apart + sep3(b * direction));
    let discriminant = sep(sep(sphere.radius * sphere.radius) - sep(dot3(nearest, nearest)));
    if !(discriminant >= 0.0 && is_finite(discriminant)) { return Roots(false, 0.0, 0.0); }
    // Both roots are computed in a loop, because drivers inline every call of a function.
    var half = 0.0;
    var distance = 0.0;
    var square = discriminant;
    for (var root = 0u; root < 2u; root += 1u) {
        half = distance;
        distance = rounded_root(square);
        square = sep(dot3(apart, apart));
    }
    let product = sep(sep(distance - sphere.radius) * sep(distance + sphere.radius));
    let q = sep(select(b + half, b - half, b < 0.0));
    // 0 only if the origin is on the sphere and the direction tangent to it: then both roots are 0.
    var other = 0.0;
    if q != 0.0 { other = rounded_quotient(product, q); }
    if b < 0.0 { return Roots(true, q, other); }
    return Roots(true, other, q);
}

// As `way_of`, for boxes of spheres. By its rounding, `roots_of` accepts a line that passes the centre at up to the radius plus 16 u times
// the distance of the centre, which is at most 1.74 times the reach along the worst axis. The test of a box errs by less than 10 u times that
// reach. So a ray that hits a sphere never misses its box.
const SPHERE_PADDING: f32 = 64.0 * UNIT_ROUNDOFF;
fn sphere_padding(origin: vec3f) -> vec3f {
    return vec3f(SPHERE_PADDING * most3(reach_from(origin))) + abs(origin) * (34.0 * UNIT_ROUNDOFF);
}
fn sphere_way_of(query: ptr<function, Query>) -> Way {
    let origin = (*query).origin;
    let pad = sphere_padding(origin);
    let inverse = (*query).inverse;
    return Way(inverse, (origin + pad) * inverse, (origin - pad) * inverse);
}

// The state of a ray's traversal of the tree over spheres. It shares the stack with the traversal of triangles, which has ended or not yet begun.
struct SphereDescent { way: Way, current: u32, depth: u32 }
// The next leaf whose box a ray hits before `limit`; NONE if none is left.
fn next_sphere_leaf(descent: ptr<function, SphereDescent>, t_min: f32, limit: f32) -> u32 {
    loop {
        if (*descent).current == NONE {
            if (*descent).depth == 0u { return NONE; }
            (*descent).depth -= 1u;
            (*descent).current = stack[(*descent).depth];
        }
        let node = (*descent).current;
        (*descent).current = NONE;
        if (node & LEAF) != 0u { return node; }
        let met = open_node((*descent).way, node, t_min, limit);
        if met.y != NONE {
            stack[(*descent).depth] = met.y;
            (*descent).depth += 1u;
        }
        (*descent).current = met.x;
    }
    return NONE;
}

// Whether a candidate hit on a sphere of a transparent material counts (`accepts`). Spheres have no cut-outs.
fn accepts_sphere(accept: u32, hit: Hit) -> bool {
⦃    if accept == ACCEPT_COUNTS && hit.triangle == left_out { return false; }
    if accept == ACCEPT_COUNTS && focuses(hit.triangle) { return true; }
⦄    let passes = accept != ACCEPT_ALL && accept != ACCEPT_COVERED && passes_light(hit.triangle);
    if passes && accept == ACCEPT_COUNTS { add_crossing(hit); }
    return !passes;
}

// The nearest accepted hit on a sphere with t_min < t < before; at equal distances, the one with the lowest id.
fn closest_sphere(accept: u32, query: ptr<function, Query>, before: f32, best: ptr<function, Hit>) -> bool {
    var descent = SphereDescent(sphere_way_of(query), params.sphere_root, 0u);
    var limit = before;
    var any = false;
    loop {
        let leaf = next_sphere_leaf(&descent, (*query).t_min, limit);
        if leaf == NONE { break; }
        let first = leaf & FIRST_OF_LEAF;
        for (var place = first; place <= first + (leaf >> COUNT_SHIFT & 3u); place += 1u) {
            let roots = roots_of((*query).origin, (*query).direction, load_sphere(place));
            if !roots.meets { continue; }
            let t = select(roots.high, roots.low, roots.low > (*query).t_min);
            let id = sphere_id(place);
            let hit = Hit(t, id & ~TRANSPARENT, 0.0, 0.0);
            let nearer = t < limit || (any && t == limit && hit.triangle < (*best).triangle);
            if t > (*query).t_min && nearer && ((id & TRANSPARENT) == 0u || accepts_sphere(accept, hit)) {
                limit = t;
                *best = hit;
                any = true;
            }
        }
    }
    return any;
}
// Whether any accepted hit on a sphere exists.
fn occluded_by_sphere(accept: u32, ray: Ray) -> bool {
    var query: Query;
    if !prepare(ray, &query) { return false; }
    var descent = SphereDescent(sphere_way_of(&query), params.sphere_root, 0u);
    loop {
        let leaf = next_sphere_leaf(&descent, query.t_min, query.t_max);
        if leaf == NONE { break; }
        let first = leaf & FIRST_OF_LEAF;
        for (var place = first; place <= first + (leaf >> COUNT_SHIFT & 3u); place += 1u) {
            let roots = roots_of(query.origin, query.direction, load_sphere(place));
            if !roots.meets { continue; }
            let id = sphere_id(place);
            for (var way = 0u; way < 2u; way += 1u) {
                let t = select(roots.low, roots.high, way == 1u);
                let within = t > query.t_min && t < query.t_max;
                if within && ((id & TRANSPARENT) == 0u || accepts_sphere(accept, Hit(t, id & ~TRANSPARENT, 0.0, 0.0))) { return true; }
            }
        }
    }
    return false;
}

// Whether a ray of this length may hit a sphere in any direction. Errs on the side of `true`.
fn is_near_sphere(origin: vec3f, length: f32) -> bool {
    let reach = length * 1.001 + 2.0 * most3(sphere_padding(origin));
    var current = params.sphere_root;
    var depth = 0u;
    loop {
        if current == NONE {
            if depth == 0u { break; }
            depth -= 1u;
            current = stack[depth];
        }
        let node = current;
        current = NONE;
        if (node & LEAF) != 0u {
            let first = node & FIRST_OF_LEAF;
            for (var place = first; place <= first + (node >> COUNT_SHIFT & 3u); place += 1u) {
                let sphere = load_sphere(place);
                let apart = origin - sphere.center;
                if !(abs(sqrt(dot3(apart, apart)) - sphere.radius) > reach) { return true; }
            }
            continue;
        }
        let a = bitcast<vec4f>(nodes_at(4u * node)); let b = bitcast<vec4f>(nodes_at(4u * node + 1u));
        let z = bitcast<vec4f>(nodes_at(4u * node + 2u));
        let children = nodes_at(4u * node + 3u).xy;
        let to_first = origin - clamp(origin, vec3f(a.x, a.z, z.x), vec3f(a.y, a.w, z.y));
        let to_second = origin - clamp(origin, vec3f(b.x, b.z, z.z), vec3f(b.y, b.w, z.w));
        if !(most3(abs(to_second)) > reach) {
            stack[depth] = children.y;
            depth += 1u;
        }
        if !(most3(abs(to_first)) > reach) { current = children.x; }
    }
    return false;
}

// The square root of a number that is not negative.
fn wide_root(x: Wide) -> Wide {
    let root = sep(sqrt(x.h));
    if !(root > 0.0) { return wide(0.0); }
    let rest = add(x, minus(exact_product(root, root)));
    return quick_sum(root, sep(0.5 * sep(rest.h / root)));
}
// The point of a sphere in a direction from its centre; its normal points outwards.
fn point_towards(sphere: Sphere, direction: Wide3) -> SurfacePoint {
    var normal = wide_unit(direction);
    if all(normal.h == vec3f(0.0)) { normal = wide3(vec3f(0.0, 1.0, 0.0)); }
    let position = add3(wide3(sphere.center), scaled3(normal, wide(sphere.radius)));
    let error = UNIT_ROUNDOFF * (most3(abs(sphere.center)) + sphere.radius) * (SPHERE_OFFSET / OFFSET_UNITS);
    return SurfacePoint(position.h, normal.h, position.h, error);
}
// The point of a sphere nearest to a stored position.
fn on_sphere(sphere: Sphere, position: vec3f) -> SurfacePoint {
    return point_towards(sphere, exact_sum3(position, -sphere.center));
}
// The point at which a ray hits a sphere at about the distance `t`, which only selects one of the two crossings.
fn met_on_sphere(sphere: Sphere, origin: vec3f, direction: vec3f, t: f32) -> SurfacePoint {
    let apart = exact_sum3(origin, -sphere.center);
    let unit = wide_unit(wide3(direction));
    let b = minus(wide_dot(apart, unit));
    let nearest = add3(apart, scaled3(unit, b));
    let square = add(exact_product(sphere.radius, sphere.radius), minus(wide_dot(nearest, nearest)));
    var half = wide(0.0);
    if square.h > 0.0 { half = wide_root(square); }
    if t < b.h || (t == b.h && b.l > 0.0) { half = minus(half); }
    return point_towards(sphere, add3(nearest, scaled3(unit, half)));
}
