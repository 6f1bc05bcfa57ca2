// The share of a surface's colour that is left by the shadows of several lights (`effects/lights.rs`). A program's `light_reaches` follows a
// ray to the current light, and returns the share of it that passes.

// The cosine of a light at a point.
fn light_cosine(shade: Shade, triangle: u32, position: vec3f, towards: vec3f) -> f32 {
    if (shade.flags & SHADE_NORMAL_MAP) != 0u && params.has_normals != 0u {
        var hit = shading.hit;
        if !shading.is_met { hit = locate(triangle, position); }
        return min(cosine_to(shade, hit, shading.normal, towards), 1.0);
    }
    return clamp(dot3(towards, shading.normal), 0.0, 1.0);
}

