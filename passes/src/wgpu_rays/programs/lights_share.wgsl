// What the shadows of several lights leave of a surface's colour (`effects/lights.rs`). `light_reaches` of a program follows a ray to the
// light that is looked at, and says what of it passes.

// The cosine of a light at a point.
fn light_cosine(shade: Shade, triangle: u32, position: vec3f, towards: vec3f) -> f32 {
    if (shade.flags & SHADE_NORMAL_MAP) != 0u && params.has_normals != 0u {
        var hit = shading.hit;
        if !shading.is_met { hit = locate(triangle, position); }
        return min(cosine_to(shade, hit, shading.normal, towards), 1.0);
    }
    return clamp(dot3(towards, shading.normal), 0.0, 1.0);
}

// By colour, what shadows leave at a point of a triangle on the side of the unit normal `facing`. `accept` says which hits cut a point off
// from the round surface that its triangle stands for.
fn share_of_lights(accept: u32, point: SurfacePoint, facing: vec3f, triangle: u32) -> vec3f {
    let shade = shade_of(triangle);
    var whole = vec3f(0.0);
    var left = vec3f(0.0);
    for (var index = 0u; index < light_count(); index += 1u) {
        let light = light_at(index);
        let arrives = arriving(light, point.position);
        if arrives.factor <= 0.0 { continue; }
        let color = sep3(light.color * sep(arrives.factor * light_cosine(shade, triangle, point.position, arrives.towards)));
        if all(color == vec3f(0.0)) { continue; }
        whole += color;
        light_direction = arrives.towards;
        var origin: vec3f;
        if dot3(facing, arrives.towards) > 0.0 {
            origin = spawn(point, arrives.towards);
        } else {
            let way = lifted(triangle, point, facing);
            let start = spawn(point, facing);
            if all(way == vec3f(0.0)) { continue; }
            if is_cut_off(accept, start, way) { continue; }
            origin = sep3(start + way);
        }
        light_length = HUGE;
        if (light.flags & LIGHT_PLACE) != 0u {
            let way = light.place - origin;
            light_length = sep(sqrt(dot3(way, way))) * (1.0 - BEFORE_LIGHT);
            light_direction = normalize_or(way, arrives.towards);
        }
        left += sep3(color * light_reaches(origin));
    }
    var ambient = AMBIENT * shade.diffuse;
    if shade.texture != NO_TEXTURE {
        ambient = vec3f(AMBIENT);
        if !shading.is_met { ambient += emission_of(triangle); }
    }
    let seen = ambient + sep3(shade.diffuse * left);
    let all_of_it = ambient + sep3(shade.diffuse * whole);
    return select(vec3f(1.0), seen / all_of_it, all_of_it > vec3f(0.0));
}
