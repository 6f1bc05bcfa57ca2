// Several lights, lights with a place, and directional lights that are discs: the light that arrives at a surface (`effects/lights.rs` and
// `backend/light.rs`).

// A light (`layout.rs`).
struct Light {
    place: vec3f,
    flags: u32,
    direction: vec3f,
    range: f32,
    color: vec3f,
    exponent: f32,
    attenuation: vec3f,
    inner: f32,
    outer: f32,
}
fn light_count() -> u32 { return tables[params.lights_at]; }
// The share of a light that arrives in shadow of an opaque occluder: above 0 for a single directional light.
fn in_shadow() -> f32 { return table_number(params.lights_at + 1u); }
// Number of rays to the disc of each directional light; 0 where they are points.
fn disc_samples() -> u32 { return tables[params.lights_at + 2u]; }
fn light_at(index: u32) -> Light {
    let place = params.lights_at + LIGHT_HEAD + LIGHT_WORDS * index;
    return Light(table_vector(place), tables[place + 3u], table_vector(place + 4u), table_number(place + 7u),
                 table_vector(place + 8u), table_number(place + 11u), table_vector(place + 12u), table_number(place + 15u),
                 table_number(place + 16u));
}
// The emission that a textured material adds to the light on it.
fn emission_of(triangle: u32) -> vec3f {
    return table_vector(params.lights_at + LIGHT_HEAD + LIGHT_WORDS * light_count() + 3u * mesh_at(params.materials_at + triangle));
}

// The share of a spot light at an angle from its axis, given by the cosine.
fn cone_share(light: Light, cosine: f32) -> f32 {
    var share = 0.0;
    if cosine >= light.inner {
        share = 1.0;
    } else if cosine > light.outer {
        share = (cosine - light.outer) / (light.inner - light.outer);
    }
    let edge = share * share;
    if light.exponent == 0.0 { return edge; }
    // Some drivers give NaN for powers of 0.
    if cosine > 0.0 { return edge * pow(cosine, light.exponent); }
    return 0.0;
}
// The light that arrives at a point: the unit direction to the light, and the share of its colour; 0 at the light's own place.
struct Arriving { towards: vec3f, factor: f32 }
fn arriving(light: Light, point: vec3f) -> Arriving {
    if (light.flags & LIGHT_PLACE) == 0u { return Arriving(-light.direction, 1.0); }
    let way = light.place - point;
    let squared = dot3(way, way);
    if !(squared > 0.0 && is_finite(squared)) { return Arriving(vec3f(0.0), 0.0); }
    let distance = sep(sqrt(squared));
    let towards = sep3(way * (1.0 / distance));
    let falloff = sep(light.attenuation.x + sep(light.attenuation.y * distance)) + sep(light.attenuation.z * squared);
    let near = distance / light.range;
    let window = max(1.0 - sep(near * near * near * near), 0.0);
    var cone = 1.0;
    if (light.flags & LIGHT_CONE) != 0u { cone = cone_share(light, -dot3(towards, light.direction)); }
    return Arriving(towards, window * cone / max(falloff, LEAST_ATTENUATION));
}

// The current light: the direction to it, the end of rays to it, and the length of the rest of the way to it.
var<private> light_direction: vec3f;
var<private> light_length: f32;
fn to_light() -> vec3f { return light_direction; }
fn light_end() -> f32 { return light_length; }
fn way_left(gone: f32) -> f32 { return light_length - gone; }

// The colour of a surface that a ray hit.
fn met_color(hit: Hit, surface: Surface⟨, footprint: f32⟩) -> vec3f {
    let shade = shade_of(hit.triangle);
    var sum = vec3f(0.0);
    for (var index = 0u; index < light_count(); index += 1u) {
        let light = light_at(index);
        let arrives = arriving(light, surface.point.position);
        let cosine = cosine_to(shade, hit, surface.normal, arrives.towards);
        sum += sep3(light.color * sep(arrives.factor * cosine));
    }
    return shining_color(hit, shade, sum⟨, footprint⟩);
}

