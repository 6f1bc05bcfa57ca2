// `deferredShadows`: the hard shadow of a directional light, 0.5 in shadow and 1 in light.

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    let position = stored_position(pixel);
    if triangle == NO_TRIANGLE || !(position.w > 0.0) { return vec4f(1.0); }
    let start = shadow_start(triangle, position.xyz);
    if start.w == 0.0 { return opaque(vec3f(SHADOWED)); }
    return shadow_of(start.xyz);
}
// The light or the shadow of a ray towards the light.
fn shadow_of(origin: vec3f) -> vec4f {
    count(SHADOW);
    let blocked = occluded(ACCEPT_COVERED, Ray(origin, params.to_light, 0.0, HUGE));
    return opaque(vec3f(select(1.0, SHADOWED, blocked)));
}
// Where a ray towards the light starts; the fourth number is 0 where the surface is turned from the light, and 1 elsewhere.
fn shadow_start(triangle: u32, position: vec3f) -> vec4f {
    let point = snap(triangle, position);
    var side = params.eye - point.position;
    if params.has_normals != 0u {
        let corners = positions_of(triangle);
        let e1 = difference(corners.b, corners.a, 1.0); let e2 = difference(corners.c, corners.a, 1.0);
        let to = difference(point.position, corners.a, 1.0);
        let normal = wide_cross(e1, e2);
        let area = wide_dot(normal, normal);
        var at = Hit(0.0, triangle, 0.0, 0.0);
        if area.h > 0.0 {
            at.u = div(wide_dot(wide_cross(to, e2), normal), area).h;
            at.v = div(wide_dot(wide_cross(e1, to), normal), area).h;
        }
        side = normal_at(at);
    }
    let towards = dot3(point.normal, params.to_light) * with_sign(1.0, dot3(point.normal, side));
    if towards <= 0.0 { return vec4f(0.0); }
    return vec4f(spawn(point, params.to_light), 1.0);
}

fn thesis(pixel: Pixel) -> vec4f {
    let position = stored_position(pixel);
    if position.w > 0.0 {
        count(SHADOW);
        if !thesis_sees_light(ACCEPT_ALL, position.xyz) { return vec4f(SHADOWED); }
    }
    return vec4f(1.0);
}
