// Products rounded as the driver chooses: for tests.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn sheared_by(shear: vec2f, p: vec3f) -> vec2f { return sep2(p.xy - shear * p.z); }
fn edge(a: vec2f, b: vec2f) -> f32 { return a.x * b.y - a.y * b.x; }
// An edge function with an absolute value above this certainly has the right sign.
fn edge_doubt(a: vec2f, b: vec2f) -> f32 { return 8.0 * UNIT_ROUNDOFF * (abs(a.x * b.y) + abs(a.y * b.x)); }
