// `deferredShadows` with several lights, and with lights with a place: the share of the colour that shadows leave, by colour. With a single
// light that is a disc: its share, 0.5 where the whole disc is hidden.

fn light_reaches(origin: vec3f) -> vec3f {
    count(SHADOW);
    let blocked = occluded(ACCEPT_COVERED, Ray(origin, to_light(), 0.0, light_end()));
    return vec3f(select(1.0, in_shadow(), blocked));
}
// The shading normal of a point that the camera sees; the program does not get it as input. Normal maps are read at level 0.
fn normal_of(point: SurfacePoint, hit: Hit) -> vec3f {
    return normalize_or(bent_normal(hit, normal_at(hit), point.normal⟨, NO_FOOTPRINT⟩), vec3f(0.0));
}

fn corrected(pixel: Pixel) -> vec4f {
    let triangle = stored_triangle(pixel);
    let position = stored_position(pixel);
    if triangle == NO_TRIANGLE || !(position.w > 0.0) { return vec4f(1.0); }
    let point = snap(triangle, position.xyz);
    var side = params.eye - point.position;
    var normal = point.normal;
    ⟪if is_sphere(triangle) { side = point.normal; } else ⟫if params.has_normals != 0u {
        let hit = locate(triangle, point.position);
        side = normal_at(hit);
        normal = normal_of(point, hit);
    }
    shaded_as_seen(normal, pixel_key(pixel));
    let facing = point.normal * with_sign(1.0, dot3(point.normal, side));
    return opaque(share_of_lights(ACCEPT_COVERED, point, facing, triangle));
}
