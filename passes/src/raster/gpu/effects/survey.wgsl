// Counts for the planes of glass that a picture shows: how many pixels show each plane, and where. See
// `raster::effects::mirrors::Survey`.

struct Params {
    // Pixels in a row, and number of rows.
    size: vec2<u32>,
    // Offset of stored triangle ids: the stored value is the id plus this.
    id_base: u32,
    // Number of ranges of glass triangles.
    ranges: u32,
}

@group(0) @binding(2) var normal_buffer: texture_2d<f32>;
@group(0) @binding(3) var triangle_buffer: texture_2d<u32>;
@group(1) @binding(0) var<uniform> params: Params;
// First triangle, end and plane of each range of glass triangles, ascending.
@group(1) @binding(1) var<storage, read> glass: array<vec4<u32>>;
// For each plane: its unit normal, and the square of the greatest sine between it and shading normals.
@group(1) @binding(2) var<storage, read> normals: array<vec4<f32>>;
// Five numbers for the whole picture, then five for each plane. Of those for the picture, only the first is used: the count of all
// glass pixels. Those for a plane are the number of pixels, the complements of the first column and row, and the last column and row.
// All start at 0.
@group(1) @binding(3) var<storage, read_write> seen: array<atomic<u32>>;

// Each invocation reads several neighbouring pixels of a row. They mostly show the same plane, so the invocation mostly writes once.
@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = id.x * SEGMENT;
    let end = min(first + SEGMENT, params.size.x);
    if id.y >= params.size.y || first >= end {
        return;
    }
    var of_glass = 0u;
    var last_plane = NOT_GLASS;
    var count = 0u;
    var from_column = 0u;
    var to_column = 0u;
    for (var column = first; column < end; column++) {
        let pixel = vec2<u32>(column, id.y);
        let plane = plane_of(textureLoad(triangle_buffer, pixel, 0).x - params.id_base);
        if plane == NOT_GLASS {
            continue;
        }
        of_glass += 1u;
        if plane == NO_PLANE || !agrees(textureLoad(normal_buffer, pixel, 0).xyz, normals[plane]) {
            continue;
        }
        if plane != last_plane {
            put(last_plane, count, from_column, to_column, id.y);
            last_plane = plane;
            count = 0u;
            from_column = column;
        }
        count += 1u;
        to_column = column;
    }
    put(last_plane, count, from_column, to_column, id.y);
    if of_glass > 0u {
        atomicAdd(&seen[0], of_glass);
    }
}

fn put(plane: u32, count: u32, from_column: u32, to_column: u32, row: u32) {
    if count == 0u {
        return;
    }
    let place = 5u * (plane + 1u);
    atomicAdd(&seen[place], count);
    atomicMax(&seen[place + 1u], ~from_column);
    atomicMax(&seen[place + 2u], ~row);
    atomicMax(&seen[place + 3u], to_column);
    atomicMax(&seen[place + 4u], row);
}
