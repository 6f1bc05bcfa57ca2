// Products of the triangle test that are rounded by themselves, whatever the driver does: the signs of edge functions are exact but for
// 0, and what is hit is what the processor hits.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn sheared_by(shear: vec2f, p: vec3f) -> vec2f { return sep2(p.xy - sep2(shear * p.z)); }
fn edge(a: vec2f, b: vec2f) -> f32 { return sep(a.x * b.y) - sep(a.y * b.x); }
// What an edge function must be above for its sign to be sure.
fn edge_doubt(a: vec2f, b: vec2f) -> f32 { return 0.0; }
