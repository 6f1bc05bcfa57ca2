// The products as a driver rounds them that fuses one with the difference, whatever this one does: for tests.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn product_2(a: vec2f, b: f32) -> vec2f { return sep2(a * b); }
fn edge(a: vec2f, b: vec2f) -> f32 {
    let p = exact_product(a.x, b.y);
    return add(p, wide(-sep(a.y * b.x))).h;
}
fn is_doubtful(e: f32, a: vec2f, b: vec2f) -> bool {
    return abs(e) <= 8.0 * UNIT_ROUNDOFF * (abs(a.x * b.y) + abs(a.y * b.x));
}
