// The share of a surface's colour that the shadows of several lights leave (`effects/lights.rs`). A program's `light_reaches` follows a ray
// to the current light, and returns the share of that light that passes.

// By colour, the share of a light that reaches a point from the direction `towards`; for a disc, the mean over it. A direction from which
// the side is dark gives the value for shadow, without a ray. The test whether the point is cut off from its triangle's round surface is
// made once.
fn light_seen(accept: u32, point: SurfacePoint, facing: vec3f, triangle: u32, light: Light, towards: vec3f, number: u32) -> vec3f {
    let has_place = (light.flags & LIGHT_PLACE) != 0u;
    let is_disc = disc_samples() > 0u && !has_place;
    var samples = 1u;
    var basis: Basis;
    var seeds: vec2u;
    if is_disc {
        samples = disc_samples();
        basis = basis_around(towards);
        seeds = dimensions(light_key(number), HASH_DISC);
    }
    var is_asked = false;
    var is_open = false;
    var raised = vec3f(0.0);
    var sum = vec3f(0.0);
    // The horizon is not tested for lights that are points, because their cosine below it is 0.
    var side = facing;
    if is_disc { side = horizon(triangle, point, facing); }
    for (var sample = 0u; sample < samples; sample += 1u) {
        light_direction = towards;
        if is_disc {
            light_direction = disc_direction(sample, seeds, basis);
            if dot3(side, light_direction) <= 0.0 {
                sum += vec3f(in_shadow());
                continue;
            }
        }
        var origin = raised;
        if dot3(facing, light_direction) > 0.0 {
            origin = spawn(point, light_direction);
        } else {
            let way = lifted(triangle, point, facing);
            let is_dark = all(way == vec3f(0.0));
            if !is_dark && !is_asked {
                let start = spawn(point, facing);
                is_asked = true;
                is_open = !is_cut_off(accept, start, way);
                raised = sep3(start + way);
            }
            if is_dark || !is_open {
                sum += vec3f(in_shadow());
                continue;
            }
            origin = raised;
        }
        light_length = HUGE;
        if has_place {
            let way = light.place - origin;
            light_length = sep(sqrt(dot3(way, way))) * (1.0 - BEFORE_LIGHT);
            light_direction = normalize_or(way, towards);
        }
        sum += light_reaches(origin);
    }
    if !is_disc { return sum; }
    note_cut_loops();
    return sum / f32(samples);
}

// By colour, the share that shadows leave at a point of a triangle, on the side of the unit normal `facing`: of a single directional light, or of
// the surface's colour by all lights. `accept` gives the hits that cut a point off from the round surface that its triangle stands for.
fn share_of_lights(accept: u32, point: SurfacePoint, facing: vec3f, triangle: u32) -> vec3f {
    let is_alone = in_shadow() > 0.0;
    let shade = shade_of(triangle);
    var whole = vec3f(0.0);
    var left = vec3f(0.0);
    for (var index = 0u; index < light_count(); index += 1u) {
        let light = light_at(index);
        let arrives = arriving(light, point.position);
        if arrives.factor <= 0.0 { continue; }
        var color = vec3f(1.0);
        if !is_alone {
            color = sep3(light.color * sep(arrives.factor * light_cosine(shade, triangle, point.position, arrives.towards)));
            if all(color == vec3f(0.0)) { continue; }
            whole += color;
        }
        left += sep3(color * light_seen(accept, point, facing, triangle, light, arrives.towards, index));
    }
    if is_alone { return left; }
    var ambient = AMBIENT * shade.diffuse;
    if shade.texture != NO_TEXTURE {
        ambient = vec3f(AMBIENT);
        if !shading.is_met { ambient += emission_of(triangle); }
    }
    let seen = ambient + sep3(shade.diffuse * left);
    let all_of_it = ambient + sep3(shade.diffuse * whole);
    return select(vec3f(1.0), seen / all_of_it, all_of_it > vec3f(0.0));
}
