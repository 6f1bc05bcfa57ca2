
// Where a triangle's plane of glass is looked up: `raster::effects::planes`.

const NOT_GLASS = 0xfffffffeu;

// The plane that a triangle of glass lies in, or NO_PLANE; NOT_GLASS for others and for ids of no triangle.
fn plane_of(triangle: u32) -> u32 {
    let range = range_of(triangle);
    if range == 0u {
        return NOT_GLASS;
    }
    return glass[range - 1u].z;
}

// Whether a shading normal is that of a plane: its unit normal, and the square of the sine that is allowed.
fn agrees(normal: vec3<f32>, plane: vec4<f32>) -> bool {
    let square = dot(normal, normal);
    let off = cross(normal, plane.xyz);
    return square > 0.0 && square < LARGEST && dot(off, off) <= plane.w * square;
}
