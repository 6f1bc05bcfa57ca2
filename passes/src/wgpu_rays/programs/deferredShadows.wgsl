// `deferredShadows`: the hard shadow of a directional light, 0.5 in shadow and 1 in light.

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    let position = stored_position(pixel);
    if triangle == NO_TRIANGLE || !(position.w > 0.0) { return vec4f(1.0); }
    let start = shadow_start(triangle, position.xyz);
    return shadow_from(start.kind, start.start, start.way);
}
// The colour for a shadow ray with this start (`ShadowStart`).
fn shadow_from(kind: f32, start: vec3f, way: vec3f) -> vec4f {
    if kind == TURNED { return opaque(vec3f(SHADOWED)); }
    if kind != LIFTED { return shadow_of(start); }
    if is_cut_off(ACCEPT_COVERED, start, way) { return opaque(vec3f(SHADOWED)); }
    return shadow_of(sep3(start + way));
}
// The colour for a shadow ray from an origin.
fn shadow_of(origin: vec3f) -> vec4f {
    count(SHADOW);
    let blocked = occluded(ACCEPT_COVERED, Ray(origin, to_light(), 0.0, HUGE));
    return opaque(vec3f(select(1.0, SHADOWED, blocked)));
}
// Kinds of starts of shadow rays. TURNED: the surface is turned from the light, and there is no ray. FACING: the start is offset from the
// triangle. LIFTED: it is also moved farther along `way`.
const TURNED: f32 = 0.0;
const FACING: f32 = 1.0;
// In the list only: the pixel shows no surface.
const NOTHING: f32 = 2.0;
const LIFTED: f32 = 3.0;
struct ShadowStart { start: vec3f, kind: f32, way: vec3f }
fn shadow_start(triangle: u32, position: vec3f) -> ShadowStart {
    let point = snap(triangle, position);
    var side = params.eye - point.position;
    ⟪if is_sphere(triangle) { side = point.normal; } else ⟫if params.has_normals != 0u {
        side = normal_at(locate(triangle, point.position));
    }
    let sign = with_sign(1.0, dot3(point.normal, side));
    if dot3(point.normal, to_light()) * sign <= 0.0 {
        let facing = point.normal * sign;
        let way = lifted(triangle, point, facing);
        return ShadowStart(spawn(point, facing), select(LIFTED, TURNED, all(way == vec3f(0.0))), way);
    }
    return ShadowStart(spawn(point, to_light()), FACING, vec3f(0.0));
}

fn thesis(pixel: Pixel) -> vec4f {
    let position = stored_position(pixel);
    if position.w > 0.0 {
        count(SHADOW);
        if !thesis_sees_light(ACCEPT_ALL, position.xyz) { return vec4f(SHADOWED); }
    }
    return vec4f(1.0);
}
