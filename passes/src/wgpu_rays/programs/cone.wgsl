// A triangle as a cone seen from one origin: four dot products decide all rays but a few (`trace/fan/cone_test.rs`). Undecided rays are
// traced, so the result is the same as tracing each ray.
//
// The processor has planes in 64 bits. Here the normal and the height are computed for each origin, in 32 bits, with their own bounds. With
// P the product of the largest components of two edges, S the largest component of their cross product, and M the largest coordinate
// relative to the origin, in units u of the last place:
//   * each component of the normal, divided by S, is off by 8 P / S + 2: differences by 1 each, products by 3, their difference by 2;
//   * the height is off by 3 M times that, by 3 M for the relative corner, and by 9 M for the sum: (24 P / S + 18) M;
//   * the product of the normal with a direction is off by PLANE_ERROR, and by 1.75 times the error of a component: 14 P / S + 4.
// A reciprocal may be off by several units, but equally for all components, so the plane is the same. The edges' bound is twice the
// processor's, whose shear has a division with 1 unit of error instead of 2.5. Fusing a product with a sum only removes an error.

// Triangles thinner than this share of P have no plane that decides anything.
const SHARPEST: f32 = 1.0 / 4096.0;
const EDGE_UNIT: f32 = 2.0 * EDGE_ERROR;

// `a`, `b`, `c`: normals of the planes through the origin and each edge, pointing towards the triangle, divided by their error bounds.
// The fourth components of `a` and `b`: `direction . normal` up to which the triangle is certainly missed, and the value from which on it
// is certainly hit if the ray passes within the edges. `normal`, the normal of the triangle, points away from the origin.
struct Facet { a: vec4f, b: vec4f, c: vec4f, normal: vec4f }

fn largest(p: vec3f) -> f32 { return most3(abs(p)); }
fn edge_plane(start: vec3f, to: vec3f, unit: f32) -> vec3f {
    return cross(start, to) * (1.0 / (unit * largest(start) * largest(to)));
}

// The volume that contains all rays of some length from an origin that go to one side of a plane through it.
struct HalfBall { origin: vec3f, facing: vec3f, square: f32, nearness: f32 }
// The distance, along each axis, by which a ray may miss a box although it hits the triangle inside by the watertight test; twice the
// processor's bound (`Way`).
fn slack_around(origin: vec3f) -> vec3f {
    let reach = reach_from(origin);
    return 2.0 * ((reach + vec3f(most3(reach))) * SLAB_ERROR + abs(origin) * SLAB_ORIGIN_ERROR);
}
// `radius` may be less than the length of the rays; triangles beyond the radius are then left out.
fn half_ball(origin: vec3f, facing: vec3f, radius: f32) -> HalfBall {
    let slack = slack_around(origin);
    let grown = radius * LONGEST * BALL_MARGIN + 2.0 * sqrt(dot(slack, slack));
    return HalfBall(origin, facing, grown * grown, 1.0 / params.radius);
}
// Whether a point, relative to a point of a plane, certainly lies behind the plane or on it.
fn is_behind(p: vec3f, normal: vec3f) -> bool {
    let height = p * normal;
    let size = abs(height) * SIDE_ERROR;
    return height.x + size.x + (height.y + size.y) + (height.z + size.z) <= 0.0;
}
fn ball_meets(ball: HalfBall, corners: Corners) -> bool {
    let a = corners.a - ball.origin; let b = corners.b - ball.origin; let c = corners.c - ball.origin;
    let away = max(max(min(min(a, b), c), -max(max(a, b), c)), vec3f(0.0));
    if ball.square <= dot(away, away) { return false; }
    return !(is_behind(a, ball.facing) && is_behind(b, ball.facing) && is_behind(c, ball.facing));
}

// The facet of a triangle that meets the half ball; false if no ray reaches its plane.
fn facet_of(triangle: Triangle, ball: HalfBall, facet: ptr<function, Facet>) -> bool {
    let a = triangle.corners.a - ball.origin; let b = triangle.corners.b - ball.origin; let c = triangle.corners.c - ball.origin;
    let ab = triangle.corners.b - triangle.corners.a; let ac = triangle.corners.c - triangle.corners.a;
    let product = cross(ab, ac);
    let size = largest(product); let sides = largest(ab) * largest(ac);
    let sa = largest(a); let sb = largest(b); let sc = largest(c); let most = max(max(sa, sb), sc);
    (*facet).a = vec4f(0.0, 0.0, 0.0, -HUGE);
    (*facet).b = vec4f(0.0, 0.0, 0.0, HUGE);
    (*facet).c = vec4f(0.0, 0.0, 0.0, 0.0);
    (*facet).normal = vec4f(0.0);
    let bounded = SMALLEST <= min(min(sa, sb), sc) && most <= LARGEST && SMALLEST * SMALLEST <= sides;
    // A degenerate triangle decides nothing.
    if !bounded || !(size > SHARPEST * sides) { return true; }
    let scale = 1.0 / size;
    let thinness = sides * scale;
    var normal = product * scale;
    var height = dot(normal, a);
    let turned = height < 0.0;
    normal = select(normal, -normal, turned);
    height = abs(height);
    let error = (24.0 * thinness + 24.0) * UNIT_ROUNDOFF * most;
    if !(error < height) { return true; }
    let plane_error = PLANE_ERROR + (16.0 * thinness + 8.0) * UNIT_ROUNDOFF;
    let at = height * ball.nearness;
    let margin = error * ball.nearness + at * (2.0 * DISTANCE_MARGIN) + plane_error;
    let broad = most * EDGE_ON <= height;
    // No direction is longer than `LONGEST`, so no ray reaches such a plane.
    if broad && sqrt(dot(normal, normal)) * (LONGEST * LONGEST * (1.0 + 16.0 * UNIT_ROUNDOFF)) <= at - margin { return false; }
    // A triangle that may have holes: each hit must be tested for coverage.
    let asked = (triangle.id & TRANSPARENT) != 0u && params.cut != 0u && (flags_of(triangle.id & ~TRANSPARENT) & SHADE_CUT) != 0u;
    let unit = select(EDGE_UNIT, -EDGE_UNIT, turned);
    (*facet).a = vec4f(edge_plane(b, c, unit), select(-plane_error, at - margin, broad));
    (*facet).b = vec4f(edge_plane(c, a, unit), select(at + margin, HUGE, asked));
    (*facet).c = vec4f(edge_plane(a, b, unit), 0.0);
    (*facet).normal = vec4f(normal, 0.0);
    return true;
}
