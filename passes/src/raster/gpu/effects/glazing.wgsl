
// Where a triangle's plane of glass is looked up: `raster::effects::planes`.

const NOT_GLASS = 0xfffffffeu;

// The plane that a triangle of glass lies in, or NO_PLANE; NOT_GLASS for others and for ids of no triangle.
fn plane_of(triangle: u32) -> u32 {
    var low = 0u;
    var high = params.runs;
    while low < high {
        let middle = (low + high) / 2u;
        if runs[middle].x <= triangle {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if low == 0u || triangle >= runs[low - 1u].y {
        return NOT_GLASS;
    }
    return runs[low - 1u].z;
}

// Whether a shading normal is that of a plane: its unit normal, and the square of the sine that is allowed.
fn agrees(normal: vec3<f32>, plane: vec4<f32>) -> bool {
    let square = dot(normal, normal);
    let off = cross(normal, plane.xyz);
    return square > 0.0 && square < LARGEST && dot(off, off) <= plane.w * square;
}
