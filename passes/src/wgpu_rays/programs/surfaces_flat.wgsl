// The normal of the triangle, of no particular length. Products of short edges may be too small to be scaled.
fn unturned(pixel: Pixel, triangle: u32) -> vec3f {
⟪    if is_sphere(triangle) { return stored_position(pixel).xyz - sphere_of(triangle).center; }
⟫    let corners = positions_of(triangle);
    let normal = cross3(corners.b - corners.a, corners.c - corners.a);
    let sizes = abs(normal);
    return normal / max(max(sizes.x, max(sizes.y, sizes.z)), SMALLEST_NORMAL);
}
const SMALLEST_NORMAL: f32 = 1.1754944e-38;
