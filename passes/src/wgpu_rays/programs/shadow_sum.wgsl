// The picture of `deferredShadows`, from the listed starts of its shadow rays.
fn picture(pixel: Pixel) -> vec4f {
    let slot = 2u * slot_of(pixel);
    let start = bitcast<vec4f>(points[slot]);
    if start.w == NOTHING { return vec4f(1.0); }
    var way = vec3f(0.0);
    if start.w == LIFTED { way = bitcast<vec4f>(points[slot + 1u]).xyz; }
    return shadow_from(start.w, start.xyz, way);
}
