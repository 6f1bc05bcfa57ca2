// Products of the triangle test that are rounded by themselves, whatever the driver does: the signs of edge functions are exact but for
// 0, and what is hit is what the processor hits.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn product_2(a: vec2f, b: f32) -> vec2f { return sep2(a * b); }
fn edge(a: vec2f, b: vec2f) -> f32 { return sep(a.x * b.y) - sep(a.y * b.x); }
fn is_doubtful(e: f32, a: vec2f, b: vec2f) -> bool { return e == 0.0; }
