// The share of light on surfaces in `final`, by colour, for several lights, lights with a place and discs.

fn light_reaches(origin: vec3f) -> vec3f { return vec3f(light_from(origin)); }
fn light_share(surface: Surface, lit_side: vec3f, triangle: u32) -> vec3f {
    return share_of_lights(ACCEPT_STOPS, surface.point, lit_side, triangle);
}
