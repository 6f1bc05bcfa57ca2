// The reflectance of a surface of glass, Fresnel's or its own, and the cosine of the refracted ray (`interface_of` of `optics.rs`).
fn face_of(body: Body, cosine: f32, ratio: f32) -> Interface {
    var face = interface_at(cosine, ratio);
    let is_total = face.cos_refracted == 0.0 && face.reflectance >= 1.0;
    if body.curve.z < 0.0 || is_total { return face; }
    let away = 1.0 - select(clamp(cosine, 0.0, 1.0), face.cos_refracted, ratio < 1.0);
    // Some drivers give NaN for powers of 0.
    var rise = select(0.0, 1.0, body.curve.z == 0.0);
    if away > 0.0 { rise = pow(away, body.curve.z); }
    face.reflectance = body.curve.x + (body.curve.y - body.curve.x) * rise;
    return face;
}
