// Where all glass is the report's panes: weights are numbers.
alias Weight = f32;
const ONE: Weight = 1.0;
const HAS_BODIES: bool = false;
// Of a weight, what is kept beside a point's colour, and what becomes part of it.
fn weight_left(weight: Weight) -> f32 { return weight; }
fn weighed_color(weight: Weight, color: vec3f) -> vec3f { return color; }
// What a background adds to the colour of glass: there is none.
fn missed_color() -> vec3f { return vec3f(0.0); }
