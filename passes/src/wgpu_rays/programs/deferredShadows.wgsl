// `deferredShadows`: the hard shadow of a directional light, 0.5 in shadow and 1 in light.

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    let position = stored_position(pixel);
    if triangle == NO_TRIANGLE || !(position.w > 0.0) { return vec4f(1.0); }
    let point = snap(triangle, position.xyz);
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
    if towards <= 0.0 { return opaque(vec3f(SHADOWED)); }
    count(SHADOW);
    let blocked = occluded(ACCEPT_COVERED, Ray(spawn(point, params.to_light), params.to_light, 0.0, HUGE));
    return opaque(vec3f(select(1.0, SHADOWED, blocked)));
}

fn thesis(pixel: Pixel) -> vec4f {
    let position = stored_position(pixel);
    if position.w > 0.0 {
        count(SHADOW);
        if !thesis_sees_light(ACCEPT_ALL, position.xyz) { return vec4f(SHADOWED); }
    }
    return vec4f(1.0);
}
