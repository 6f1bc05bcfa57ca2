// Exact products for drivers whose `fma` rounds once, as tested when the device is opened: the second word is the error of the first.
fn exact_product(a: f32, b: f32) -> Wide {
    let p = sep(a * b);
    return Wide(p, fma(a, b, -p));
}
fn exact_product3(a: vec3f, b: vec3f) -> Wide3 {
    let p = sep3(a * b);
    return Wide3(p, fma(a, b, -p));
}
