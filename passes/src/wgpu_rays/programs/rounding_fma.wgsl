// `fma` wherever a product meets a sum. A driver fuses it or not, as long as it does so everywhere: what two triangles share has the same
// bits in both. Where it does not, the numbers are the processor's.
fn sheared_by(shear: vec2f, p: vec3f) -> vec2f { return fma(-shear, p.zz, p.xy); }
fn edge(a: vec2f, b: vec2f) -> f32 { return fma(-a.y, b.x, a.x * b.y); }
// What an edge function must be above for its sign to be sure. Fused, it errs by the rounding of the first product. Otherwise only that of
// 0 is unsure, since rounding never turns the order of the products.
fn edge_doubt(a: vec2f, b: vec2f) -> f32 { return 2.0 * UNIT_ROUNDOFF * abs(a.x * b.y); }
