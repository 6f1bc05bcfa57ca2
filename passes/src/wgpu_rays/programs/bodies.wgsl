// Shared functions for paths through glass as each material says (`effects/dielectric`).

// The bodies that the camera is in.
fn around_eye() -> Media {
    var media: Media;
    for (var i = 0u; i < MOST_BODIES; i += 1u) { media.list[i] = atomicLoad(&ray_counts[AROUND_EYE + i]); }
    media.length = atomicLoad(&ray_counts[AROUND_EYE + MOST_BODIES]);
    return media;
}

// The share of light, by colour, that a body (NONE: air) transmits from the surface that a pixel shows to the eye.
fn kept_to_eye(pixel: Pixel, body: u32) -> vec3f {
    if body == NONE { return vec3f(1.0); }
    let to = stored_position(pixel).xyz - params.eye;
    return transmittance(extinction_of(body), sqrt(dot3(to, to)));
}
// A colour that a pixel shows, as it reaches the eye through the body around it.
fn seen_from_eye(pixel: Pixel, color: vec3f) -> vec3f {
    let length = atomicLoad(&ray_counts[AROUND_EYE + MOST_BODIES]);
    if length == 0u { return color; }
    return color * kept_to_eye(pixel, atomicLoad(&ray_counts[AROUND_EYE + length - 1u]));
}

// Refraction at a surface by its `interface_normal`. Where that normal would send refracted light back to the viewer's side, the geometric
// normal is used.
struct Bend { normal: vec3f, meeting: Interface, enters: bool, refracted: vec3f }
fn bent_by(body: Body, normal: vec3f, view: vec3f, ratio: f32) -> Bend {
    let meeting = face_of(body, -dot3(normal, view), ratio);
    var refracted: vec3f;
    let enters = refracts(meeting, view, normal, ratio, &refracted);
    return Bend(normal, meeting, enters, refracted);
}
fn bend(body: Body, surface: Surface, view: vec3f, ratio: f32) -> Bend {
    let bent = bent_by(body, interface_normal(surface, view), view, ratio);
    if bent.enters && dot3(bent.refracted, surface.facing) >= 0.0 { return bent_by(body, surface.facing, view, ratio); }
    return bent;
}
