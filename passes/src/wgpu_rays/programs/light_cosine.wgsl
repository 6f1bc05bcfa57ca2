// The cosine of a light at a point (`cosine_at` of `effects/lights.rs`); `towards` is the unit direction to the light.
fn light_cosine(shade: Shade, triangle: u32, position: vec3f, towards: vec3f) -> f32 {
    if (shade.flags & SHADE_NORMAL_MAP) != 0u && params.has_normals != 0u {
        var hit = shading.hit;
        if !shading.is_met { hit = locate(triangle, position); }
        return min(cosine_to(shade, hit, shading.normal, towards), 1.0);
    }
    return clamp(dot3(towards, shading.normal), 0.0, 1.0);
}

