// One directional light that is a point: other texts ask these functions about it. `lights.wgsl` stands in its place in passes with other
// lights.
fn to_light() -> vec3f { return params.to_light; }
// Where rays to the light end, and the length of the way that is left to it.
fn light_end() -> f32 { return HUGE; }
fn way_left(gone: f32) -> f32 { return HUGE; }
// What arrives of the light where something opaque is in the way.
fn in_shadow() -> f32 { return SHADOWED; }

// The colour of a surface that a ray met.
fn met_color(hit: Hit, surface: Surface⟨, footprint: f32⟩) -> vec3f { return lit_color(hit, surface.normal⟨, footprint⟩); }
// By which normal the next surface is shaded whose light is asked for: with one light its colour says so.
fn shaded_as_seen(normal: vec3f, key: u32) {}
fn shaded_as_met(hit: Hit, surface: Surface, key: u32) {}
