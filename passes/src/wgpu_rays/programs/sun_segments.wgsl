// One directional light that is a point, as in `sun.wgsl`. Light that exact spheres focus comes along several segments; shadow rays can
// follow one of them instead of the way to the light. Replaces `sun.wgsl` where glass focuses light.
var<private> is_segment: bool;
var<private> segment_direction: vec3f;
var<private> segment_length: f32;
// From now on, shadow rays follow a segment.
fn look_along(direction: vec3f, length: f32) {
    is_segment = true;
    segment_direction = direction;
    segment_length = length;
}
fn look_at_sun() { is_segment = false; }
fn to_light() -> vec3f { return select(params.to_light, segment_direction, is_segment); }
fn light_end() -> f32 { return select(HUGE, segment_length, is_segment); }
fn way_left(gone: f32) -> f32 { return select(HUGE, segment_length - gone, is_segment); }
fn in_shadow() -> f32 { return SHADOWED; }
fn met_color(hit: Hit, surface: Surface⟨, footprint: f32⟩) -> vec3f { return lit_color(hit, surface.normal⟨, footprint⟩); }

