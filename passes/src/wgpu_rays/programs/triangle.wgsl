// The watertight triangle test of `trace/single/leaf_test.rs`, without 64-bit numbers: Woop, Benthin and Wald, "Watertight Ray/Triangle
// Intersection", JCGT 2(1), 2013.

// A ray prepared for the tests. `turn` permutes the axes of a vector so that the ray's longest axis is last.
struct Query {
    origin: vec3f,
    direction: vec3f,
    shear: vec2f,
    longest: u32,
    t_min: f32,
    t_max: f32,
    // Error bound for `decide`.
    doubt: f32,
    inverse: vec3f,
}

fn turn(v: vec3f, longest: u32) -> vec3f {
    return select(select(v, v.zxy, longest == 1u), v.yzx, longest == 0u);
}
// Largest distance of the scene's bounds from a point, along each axis.
fn reach_from(point: vec3f) -> vec3f { return max(abs(params.scene_low - point), abs(params.scene_high - point)); }

fn steered(d: f32) -> f32 { return select(d, with_sign(LEAST_DIRECTION, d), abs(d) < LEAST_DIRECTION); }

// Prepares `query`; false if the ray cannot hit anything.
fn prepare(ray: Ray, query: ptr<function, Query>) -> bool {
    if !(is_finite3(ray.origin) && is_finite3(ray.direction) && ray.t_min < ray.t_max && ray.t_max > 0.0) { return false; }
    let length = abs(ray.direction);
    let longest = most3(length);
    if !(longest > 1.0e-30) { return false; }
    (*query).origin = ray.origin;
    (*query).direction = ray.direction;
    let axis = select(select(2u, 1u, length.y == longest), 0u, length.x == longest);
    (*query).longest = axis;
    let d = turn(ray.direction, axis);
    // The division is done once for each ray, so that all triangles are sheared alike, whatever the rounding.
    (*query).shear = vec2f(sep(d.x / d.z), sep(d.y / d.z));
    (*query).t_min = max(ray.t_min, 0.0);
    (*query).t_max = min(ray.t_max, HUGE);
    let reach = reach_from(ray.origin);
    let units = 0.5 * DOUBT * UNIT_ROUNDOFF * (reach.x + reach.y + reach.z + (*query).t_min);
    (*query).doubt = select(HUGE, units, longest <= 1.001);
    (*query).inverse = vec3f(
        sep(1.0 / steered(ray.direction.x)), sep(1.0 / steered(ray.direction.y)), sep(1.0 / steered(ray.direction.z)));
    return true;
}

// A corner relative to the ray's origin and sheared. A shared corner has the same bits in both triangles.
fn sheared(query: ptr<function, Query>, corner: vec3f) -> vec2f {
    let p = turn(corner - (*query).origin, (*query).longest);
    return sheared_by((*query).shear, p);
}

// Whether the ray's line may pass through a triangle: no two edge functions certainly have different signs. This rejects most triangles of
// leaves, and it is the only triangle test inside the traversal loop.
fn may_pass(query: ptr<function, Query>, corners: Corners) -> bool {
    let sa = sheared(query, corners.a); let sb = sheared(query, corners.b); let sc = sheared(query, corners.c);
    let e = vec3f(edge(sc, sb), edge(sa, sc), edge(sb, sa));
    let doubt = vec3f(edge_doubt(sc, sb), edge_doubt(sa, sc), edge_doubt(sb, sa));
    let high = e + doubt; let low = e - doubt;
    return !(min(min(high.x, high.y), high.z) < 0.0 && max(max(low.x, low.y), low.z) > 0.0);
}

// The edge functions opposite to the corners, and their signs, which are exact.
struct Edges { a: f32, b: f32, c: f32, some_zero: bool, passes: bool, sa: vec2f, sb: vec2f, sc: vec2f }
fn edges_of(query: ptr<function, Query>, corners: Corners) -> Edges {
    var e: Edges;
    let sa = sheared(query, corners.a); let sb = sheared(query, corners.b); let sc = sheared(query, corners.c);
    e.sa = sa; e.sb = sb; e.sc = sc;
    e.a = edge(sc, sb);
    e.b = edge(sa, sc);
    e.c = edge(sb, sa);
    e.some_zero = abs(e.a) <= edge_doubt(sc, sb) || abs(e.b) <= edge_doubt(sa, sc) || abs(e.c) <= edge_doubt(sb, sa);
    if e.some_zero {
        let a = exact_sign(sc.x, sb.y, sc.y, sb.x);
        let b = exact_sign(sa.x, sc.y, sa.y, sc.x);
        let c = exact_sign(sb.x, sa.y, sb.y, sa.x);
        let least = min(min(a, b), c); let most = max(max(a, b), c);
        // If all three edge functions are 0, the triangle is seen edge-on and missed.
        e.passes = !(least < 0 && most > 0) && (least != 0 || most != 0);
    } else {
        let least = min(min(e.a, e.b), e.c); let most = max(max(e.a, e.b), e.c);
        e.passes = least >= 0.0 || most <= 0.0;
    }
    return e;
}

const UNDECIDED: u32 = 0u;
const HITS: u32 = 1u;
const MISSES: u32 = 2u;
// The certain verdict on a ray whose line passes through a triangle: `decide` of `trace/single/leaf_test.rs`, which derives the bound. The
// bound holds in any order of rounding, fused or not.
fn decide(query: ptr<function, Query>, corners: Corners, limit: f32) -> u32 {
    let first = corners.b - corners.a; let second = corners.c - corners.a;
    let to = corners.a - (*query).origin;
    let square = dot(first, first) + dot(second, second);
    let normal = first.yzx * second.zxy - first.zxy * second.yzx;
    let height = normal.x * to.x + normal.y * to.y + normal.z * to.z;
    let d = (*query).direction;
    let slope = normal.x * d.x + normal.y * d.y + normal.z * d.z;
    let shortness = select(0.0, 1.0 / limit, limit < 1.0e30);
    let p = height - (*query).t_min * slope;
    let q = slope - height * shortness;
    // Twice the processor's bound: a reciprocal may be off by more here.
    let parallel = square * (DOUBT * UNIT_ROUNDOFF);
    let of_p = square * (2.0 * (*query).doubt);
    let of_q = 2.0 * (of_p * shortness + parallel);
    let bounded = square >= SMALLEST_SQUARE && of_p >= SMALLEST_SQUARE && of_p <= LARGEST_SQUARE;
    if !bounded { return UNDECIDED; }
    let hit = (p >= of_p && q >= of_q) || (p <= -of_p && q <= -of_q);
    let miss = ((p >= of_p && q <= -of_q) || (p <= -of_p && q >= of_q)) && abs(slope) >= parallel;
    return select(select(UNDECIDED, MISSES, miss), HITS, hit);
}

// The interval in which the ray is inside the bounds of a triangle, as in `PreparedRay::span`.
fn span(query: ptr<function, Query>, corners: Corners) -> vec2f {
    let reach = min(reach_from((*query).origin), vec3f(LARGEST_REACH));
    let along = turn(reach, (*query).longest).z;
    let pad = (reach + vec3f(along)) * SLAB_ERROR + abs((*query).origin) * SLAB_ORIGIN_ERROR;
    let least = min(min(corners.a, corners.b), corners.c); let most = max(max(corners.a, corners.b), corners.c);
    let inverse = (*query).inverse;
    let from_least = (least - ((*query).origin + pad)) * inverse;
    let from_most = (most - ((*query).origin - pad)) * inverse;
    let near = min(from_least, from_most);
    let far = max(from_least, from_most) * FAR_PLANES;
    return vec2f(max(max(max(near.x, near.y), near.z), (*query).t_min), min(min(far.x, far.y), far.z));
}

// The hit of a ray whose line passes through the triangle, with t_min < t <= limit; false if there is none.
fn solve(query: ptr<function, Query>, corners: Corners, e: Edges, limit: f32, hit: ptr<function, Hit>) -> bool {
    let first = corners.b - corners.a; let second = corners.c - corners.a;
    let scale = scale_to_one(max(most3(abs(first)), most3(abs(second))));
    let normal = wide_cross(difference(corners.b, corners.a, scale), difference(corners.c, corners.a, scale));
    let height = wide_dot(normal, difference(corners.a, (*query).origin, 1.0));
    let slope = wide_dot(normal, wide3((*query).direction));
    var t = select(-HUGE, HUGE, height.h >= 0.0);
    if slope.h != 0.0 {
        let quotient = div(height, slope).h;
        // The quotient overflows where the ray is nearly parallel to the plane. Then t stays HUGE or -HUGE, and is clamped to
        // the triangle's bounds below.
        if is_finite(quotient) {
            if !(quotient > (*query).t_min && quotient <= limit) { return false; }
            t = quotient;
        }
    }
    if e.some_zero {
        let b = add(exact_product(e.sa.x, e.sc.y), minus(exact_product(e.sa.y, e.sc.x)));
        let c = add(exact_product(e.sb.x, e.sa.y), minus(exact_product(e.sb.y, e.sa.x)));
        let a = add(exact_product(e.sc.x, e.sb.y), minus(exact_product(e.sc.y, e.sb.x)));
        let determinant = add(add(a, b), c);
        (*hit).u = 0.0;
        (*hit).v = 0.0;
        if determinant.h != 0.0 {
            (*hit).u = div(b, determinant).h;
            (*hit).v = div(c, determinant).h;
        }
    } else {
        let determinant = sep(e.a + e.b) + e.c;
        (*hit).u = e.b / determinant;
        (*hit).v = e.c / determinant;
    }
    // The distance is clamped to the triangle's own bounds: for a triangle seen edge-on, the plane may be met anywhere.
    let range = span(query, corners);
    t = select(range.y, t, t < range.y);
    t = select(t, range.x, t < range.x);
    (*hit).t = t;
    return t > (*query).t_min && t <= limit;
}

struct Triangle { corners: Corners, id: u32 }
fn load_triangle(index: u32) -> Triangle {
    let a = leaves_at(3u * index); let b = leaves_at(3u * index + 1u); let c = leaves_at(3u * index + 2u);
    return Triangle(Corners(bitcast<vec3f>(a.xyz), bitcast<vec3f>(b.xyz), bitcast<vec3f>(c.xyz)), a.w);
}
