// One directional light that is a point; other texts call these functions. In passes with other lights, `lights.wgsl` replaces this text.
fn to_light() -> vec3f { return params.to_light; }
// The end of rays to the light, and the length of the rest of the way to it.
fn light_end() -> f32 { return HUGE; }
fn way_left(gone: f32) -> f32 { return HUGE; }
// The share of the light that arrives in shadow of an opaque occluder.
fn in_shadow() -> f32 { return SHADOWED; }

// The colour of a surface that a ray hit.
fn met_color(hit: Hit, surface: Surface⟨, footprint: f32⟩) -> vec3f { return lit_color(hit, surface.normal⟨, footprint⟩); }
// The normal for the light of the next surface is not stored: with one light, the surface's colour already includes it.
fn shaded_as_seen(normal: vec3f, key: u32) {}
fn shaded_as_met(hit: Hit, surface: Surface, key: u32) {}
