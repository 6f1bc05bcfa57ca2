// Points on surfaces, and origins of the rays that leave them (`trace/origin/surface_point.rs`), in double-word arithmetic.

// A point of a triangle, with a bound on its error along the normal. Rays start at `start`, offset along the normal.
struct SurfacePoint { position: vec3f, normal: vec3f, start: vec3f, error: f32 }

// A position of a triangle, moved along its plane away from borders nearer than `margin`, if there is room.
fn drawn_in(corners: Corners, normal: Wide3, position: Wide3, margin: f32, scale: f32) -> Wide3 {
    // Most points are far from all borders. Single-word numbers suffice to show this: they err by less than 2 of 16 units of the margin.
    var near = false;
    for (var border = 0u; border < 3u; border += 1u) {
        let start = select(select(corners.c, corners.b, border == 1u), corners.a, border == 0u);
        let to = select(select(corners.a, corners.c, border == 1u), corners.b, border == 0u);
        let inward = cross3(normal.h, (to - start) * scale);
        let height = dot3(add3(position, wide3(-start)).h, inward);
        near = near || !(height > 4.0 * margin * sqrt(dot3(inward, inward)));
    }
    if !near { return position; }
    var moved = position;
    near = false;
    // Twice, because moving away from one border at a corner may lead towards the other; the last round checks the result.
    for (var round = 0u; round < 4u; round += 1u) {
        for (var border = 0u; border < 3u; border += 1u) {
            let start = select(select(corners.c, corners.b, border == 1u), corners.a, border == 0u);
            let to = select(select(corners.a, corners.c, border == 1u), corners.b, border == 0u);
            let unit = wide_unit(wide_cross(normal, difference(to, start, scale)));
            let height = wide_dot(add3(moved, wide3(-start)), unit);
            if round == 0u {
                near = near || height.h < margin;
            } else if round == 3u {
                near = near || height.h < 0.5 * margin;
            } else {
                let short = add(wide(margin), minus(height));
                if short.h > 0.0 { moved = add3(moved, scaled3(unit, short)); }
            }
        }
        if round == 0u {
            if !near { return position; }
            near = false;
        }
    }
    if near { return position; }
    return moved;
}

// The point of a triangle with barycentric coordinates `u` and `v` of corners 1 and 2.
fn point_on(corners: Corners, u: Wide, v: Wide) -> SurfacePoint {
    let first = corners.b - corners.a; let second = corners.c - corners.a;
    let scale = scale_to_one(max(most3(abs(first)), most3(abs(second))));
    let normal = wide_unit(wide_cross(difference(corners.b, corners.a, scale), difference(corners.c, corners.a, scale)));
    let ue = scaled3(difference(corners.b, corners.a, 1.0), u);
    let ve = scaled3(difference(corners.c, corners.a, 1.0), v);
    let magnitude = abs(corners.a) + abs(ue.h) + abs(ve.h);
    let position = add3(add3(wide3(corners.a), ue), ve);
    let to_a = abs(corners.a - position.h); let to_b = abs(corners.b - position.h); let to_c = abs(corners.c - position.h);
    let reach = max(max(most3(to_a), most3(to_b)), most3(to_c));
    let error = (dot3(abs(normal.h), magnitude) + OFFSET_REACH * reach) * UNIT_ROUNDOFF;
    let margin = OFFSET_MARGIN * UNIT_ROUNDOFF * (most3(magnitude) + OFFSET_REACH * reach);
    return SurfacePoint(position.h, normal.h, drawn_in(corners, normal, position, margin, scale).h, error);
}
// The point of a triangle nearest to a stored position.
fn snap(triangle: u32, position: vec3f) -> SurfacePoint {
⟪    if is_sphere(triangle) { return on_sphere(sphere_of(triangle), position); }
⟫    let corners = positions_of(triangle);
    let first = corners.b - corners.a; let second = corners.c - corners.a;
    let scale = scale_to_one(max(most3(abs(first)), most3(abs(second))));
    let e1 = difference(corners.b, corners.a, scale); let e2 = difference(corners.c, corners.a, scale);
    let to = difference(position, corners.a, scale);
    let d11 = wide_dot(e1, e1); let d12 = wide_dot(e1, e2); let d22 = wide_dot(e2, e2);
    let d1 = wide_dot(to, e1); let d2 = wide_dot(to, e2);
    let determinant = add(mul(d11, d22), minus(mul(d12, d12)));
    var u = wide(0.0); var v = wide(0.0);
    if determinant.h != 0.0 {
        u = div(add(mul(d22, d1), minus(mul(d12, d2))), determinant);
        v = div(add(mul(d11, d2), minus(mul(d12, d1))), determinant);
        if !(is_finite(u.h) && is_finite(v.h)) {
            u = wide(0.0);
            v = wide(0.0);
        }
    }
    if u.h < 0.0 { u = wide(0.0); }
    if v.h < 0.0 { v = wide(0.0); }
    let sum = add(u, v);
    if sum.h > 1.0 || (sum.h == 1.0 && sum.l > 0.0) {
        u = div(u, sum);
        v = div(v, sum);
    }
    return point_on(corners, u, v);
}
// The origin of a ray in this direction: inside the borders, and offset from the plane to the side to which the ray goes.
fn spawn(point: SurfacePoint, direction: vec3f) -> vec3f {
    let distance = OFFSET_UNITS * point.error;
    return point.start + sep3(point.normal * select(distance, -distance, dot3(point.normal, direction) < 0.0));
}

// The barycentric coordinates of a point in the plane of a triangle, as a hit at distance 0.
fn locate(triangle: u32, position: vec3f) -> Hit {
    let corners = positions_of(triangle);
    let e1 = difference(corners.b, corners.a, 1.0); let e2 = difference(corners.c, corners.a, 1.0);
    let to = difference(position, corners.a, 1.0);
    let normal = wide_cross(e1, e2);
    let area = wide_dot(normal, normal);
    var at = Hit(0.0, triangle, 0.0, 0.0);
    if area.h > 0.0 {
        at.u = div(wide_dot(wide_cross(to, e2), normal), area).h;
        at.v = div(wide_dot(wide_cross(e1, to), normal), area).h;
    }
    return at;
}
// The vector by which a point below the plane through a corner is lifted onto the plane.
fn lift(position: vec3f, corner: vec3f, normal: vec3f) -> vec3f {
    return sep3(normal * max(0.0, -dot3(position - corner, normal)));
}
// The normals at a triangle's corners, turned to the side of `facing`; `is_round` is false where the triangle does not stand for a round surface
// (`effects/terminator.rs`).
struct Round { a: vec3f, b: vec3f, c: vec3f, is_round: bool }
fn round_normals(triangle: u32, facing: vec3f) -> Round {
    var normals = Round(facing, facing, facing, false);
    if params.has_normals == 0u⟪ || is_sphere(triangle)⟫ { return normals; }
    let i = corners_of(triangle) * 3u + vec3u(params.normals_at);
    let na = vector_at(i.x); let nb = vector_at(i.y); let nc = vector_at(i.z);
    if all(na == nb) && all(nb == nc) { return normals; }
    let cosines = vec3f(dot3(na, facing), dot3(nb, facing), dot3(nc, facing));
    if all(cosines >= vec3f(ROUND)) { normals = Round(na, nb, nc, true); }
    if all(-cosines >= vec3f(ROUND)) { normals = Round(-na, -nb, -nc, true); }
    return normals;
}
fn weighed_normals(normals: Round, at: Hit) -> vec3f { return weighed(normals.a, normals.b, normals.c, at); }
// The normal that decides which light reaches a side: that of the round surface that the triangle stands for, else `facing`.
fn horizon(triangle: u32, point: SurfacePoint, facing: vec3f) -> vec3f {
    let normals = round_normals(triangle, facing);
    if !normals.is_round { return facing; }
    return weighed_normals(normals, locate(triangle, point.position));
}
// Whether a side of a triangle gets no light at a point: the side, or the round surface that the triangle stands for, is turned away from
// the light.
fn is_turned(triangle: u32, point: SurfacePoint, facing: vec3f) -> bool {
    if dot3(facing, to_light()) <= 0.0 { return true; }
    let normals = round_normals(triangle, facing);
    if !normals.is_round { return false; }
    // If all corners are lit, all points between them are.
    if dot3(normals.a, to_light()) > 0.0 && dot3(normals.b, to_light()) > 0.0 && dot3(normals.c, to_light()) > 0.0 { return false; }
    return dot3(weighed_normals(normals, locate(triangle, point.position)), to_light()) <= 0.0;
}
// For a point of a triangle that is turned away from the light: the vector to the round surface; 0 where no light falls there.
fn lifted(triangle: u32, point: SurfacePoint, facing: vec3f) -> vec3f {
    let normals = round_normals(triangle, facing);
    if !normals.is_round { return vec3f(0.0); }
    let at = locate(triangle, point.position);
    if dot3(weighed_normals(normals, at), to_light()) <= 0.0 { return vec3f(0.0); }
    let corners = positions_of(triangle);
    let a = lift(point.position, corners.a, normals.a);
    let b = lift(point.position, corners.b, normals.b);
    let way = sep3(weighed(a, b, lift(point.position, corners.c, normals.c), at));
    return select(vec3f(0.0), way, is_finite3(way));
}

// A point seen from one side: the geometric normal towards the viewer, and the shading normal on the same side.
struct Surface { point: SurfacePoint, facing: vec3f, normal: vec3f }
fn surface_of(point: SurfacePoint, stored: vec3f, view: vec3f) -> Surface {
    let facing = select(point.normal, -point.normal, dot3(point.normal, view) > 0.0);
    let normal = normalize_or(stored, facing);
    return Surface(point, facing, select(normal, -normal, dot3(normal, facing) < 0.0));
}
// The surface at a ray's hit.
fn surface_hit(direction: vec3f, hit: Hit⟪, origin: vec3f⟫⟨, footprint: f32⟩) -> Surface {
⟪    if is_sphere(hit.triangle) {
        let outside = met_on_sphere(sphere_of(hit.triangle), origin, direction, hit.t);
        return surface_of(outside, outside.normal, direction);
    }
⟫    let point = point_on(positions_of(hit.triangle), wide(hit.u), wide(hit.v));
    return surface_of(point, bent_normal(hit, normal_at(hit), point.normal⟨, footprint⟩), direction);
}
