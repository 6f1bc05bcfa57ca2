// Exact products by splitting the digits into halves (Dekker), for drivers whose `fma` rounds twice.
fn upper(a: f32) -> f32 { return bitcast<f32>(bitcast<u32>(a) & 0xfffff000u); }
fn upper3(a: vec3f) -> vec3f { return bitcast<vec3f>(bitcast<vec3u>(a) & vec3u(0xfffff000u)); }
fn exact_product(a: f32, b: f32) -> Wide {
    let p = sep(a * b);
    let ah = upper(a); let al = sep(a - ah);
    let bh = upper(b); let bl = sep(b - bh);
    let rest = sep(sep(sep(p - sep(ah * bh)) - sep(al * bh)) - sep(ah * bl));
    return Wide(p, sep(sep(al * bl) - rest));
}
fn exact_product3(a: vec3f, b: vec3f) -> Wide3 {
    let p = sep3(a * b);
    let ah = upper3(a); let al = sep3(a - ah);
    let bh = upper3(b); let bl = sep3(b - bh);
    let rest = sep3(sep3(sep3(p - sep3(ah * bh)) - sep3(al * bh)) - sep3(ah * bl));
    return Wide3(p, sep3(sep3(al * bl) - rest));
}
