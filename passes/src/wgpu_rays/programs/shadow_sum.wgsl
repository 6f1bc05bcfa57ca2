// The picture of `deferredShadows`, from where the rays of its pixels start.
fn picture_of(pixel: Pixel, slot: u32) -> vec4f {
    let start = bitcast<vec4f>(points[slot]);
    if start.w == 2.0 { return vec4f(1.0); }
    if start.w == 0.0 { return opaque(vec3f(SHADOWED)); }
    return shadow_of(start.xyz);
}
