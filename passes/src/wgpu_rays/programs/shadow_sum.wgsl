// The picture of `deferredShadows`, from where the rays of its pixels start.
fn picture(pixel: Pixel) -> vec4f {
    let start = bitcast<vec4f>(points[slot_of(pixel)]);
    if start.w == 2.0 { return vec4f(1.0); }
    if start.w == 0.0 { return opaque(vec3f(SHADOWED)); }
    return shadow_of(start.xyz);
}
