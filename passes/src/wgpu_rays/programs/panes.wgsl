// Weights of light where all glass is the report's panes: single numbers.
alias Weight = f32;
const ONE: Weight = 1.0;
const HAS_BODIES: bool = false;
// Splits a weight: `weight_left` is stored beside a point's colour, and `weighed_color` includes the rest in the
// colour.
fn weight_left(weight: Weight) -> f32 { return weight; }
fn weighed_color(weight: Weight, color: vec3f) -> vec3f { return color; }
// A colour that a pixel shows, as it reaches the eye: unchanged, because no body is around the eye.
fn seen_from_eye(pixel: Pixel, color: vec3f) -> vec3f { return color; }
// What the background adds to the colour of glass: nothing.
fn missed_color() -> vec3f { return vec3f(0.0); }
