// Uses `fma` wherever a product meets a sum. A driver may fuse it or not, as long as it does the same everywhere: shared corners have the
// same bits in both triangles. Where it does not fuse, the numbers are the processor's.
fn sheared_by(shear: vec2f, p: vec3f) -> vec2f { return fma(-shear, p.zz, p.xy); }
fn edge(a: vec2f, b: vec2f) -> f32 { return fma(-a.y, b.x, a.x * b.y); }
// An edge function with an absolute value above this certainly has the right sign. If fused, it errs by the rounding of the first product.
// If not, only a value of 0 is uncertain, since rounding never reverses the order of the products.
fn edge_doubt(a: vec2f, b: vec2f) -> f32 { return 2.0 * UNIT_ROUNDOFF * abs(a.x * b.y); }
