
// Looks up the plane of glass of a triangle: `raster::effects::planes`.

const NOT_GLASS = 0xfffffffeu;

// The plane that a glass triangle lies in, or NO_PLANE; NOT_GLASS for other triangles and for ids that do not belong to a triangle.
fn plane_of(triangle: u32) -> u32 {
    let range = range_of(triangle);
    if range == 0u {
        return NOT_GLASS;
    }
    return glass[range - 1u].z;
}

// Whether a shading normal is perpendicular to a plane: `plane` is its unit normal and the square of the greatest sine.
fn agrees(normal: vec3<f32>, plane: vec4<f32>) -> bool {
    let square = dot(normal, normal);
    let off = cross(normal, plane.xyz);
    return square > 0.0 && square < LARGEST && dot(off, off) <= plane.w * square;
}
