// Products as computed by a driver that fuses one of them with the difference, whatever the actual driver does: for tests.
fn sep2(x: vec2f) -> vec2f { return bitcast<vec2f>(bitcast<vec2u>(x) ^ vec2u(params.zero)); }
fn sheared_by(shear: vec2f, p: vec3f) -> vec2f { return sep2(p.xy - sep2(shear * p.z)); }
fn edge(a: vec2f, b: vec2f) -> f32 {
    let p = exact_product(a.x, b.y);
    return add(p, wide(-sep(a.y * b.x))).h;
}
// An edge function with an absolute value above this certainly has the right sign.
fn edge_doubt(a: vec2f, b: vec2f) -> f32 { return 8.0 * UNIT_ROUNDOFF * (abs(a.x * b.y) + abs(a.y * b.x)); }
