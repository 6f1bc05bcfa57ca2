// Products of the triangle test rounded separately, whatever the driver does. The signs of edge functions are then exact except for 0, and
// rays have the same hits as on the processor.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn sheared_by(shear: vec2f, p: vec3f) -> vec2f { return sep2(p.xy - sep2(shear * p.z)); }
fn edge(a: vec2f, b: vec2f) -> f32 { return sep(a.x * b.y) - sep(a.y * b.x); }
// An edge function with an absolute value above this certainly has the right sign.
fn edge_doubt(a: vec2f, b: vec2f) -> f32 { return 0.0; }
