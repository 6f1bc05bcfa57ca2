// The products as the driver likes to round them: for tests.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn product_2(a: vec2f, b: f32) -> vec2f { return a * b; }
fn edge(a: vec2f, b: vec2f) -> f32 { return a.x * b.y - a.y * b.x; }
fn is_doubtful(e: f32, a: vec2f, b: vec2f) -> bool {
    return abs(e) <= 8.0 * UNIT_ROUNDOFF * (abs(a.x * b.y) + abs(a.y * b.x));
}
