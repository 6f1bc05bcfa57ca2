// Reflection in flat glass from mirrored cameras: `raster::effects::mirrors`. A pixel of a mirror's picture belongs to the
// same pixel of the output.

struct Params {
    // Number of mirrors, and number of ranges of glass triangles.
    mirrors: u32,
    ranges: u32,
}

// A plane drawn as a mirror.
struct Mirror {
    // The unit normal; w is the square of the greatest sine between it and shading normals.
    normal: vec4<f32>,
    plane: u32,
    // Layer of the mirror's picture.
    layer: u32,
}

@group(1) @binding(3) var pictures: texture_2d_array<f32>;
// First triangle, end and plane of each range of glass triangles, ascending.
@group(1) @binding(4) var<storage, read> glass: array<vec4<u32>>;
@group(1) @binding(5) var<storage, read> mirrors: array<Mirror>;

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let color = textureLoad(color_buffer, pixel, 0);
    if params.mirrors == 0u {
        return color;
    }
    let plane = plane_of(textureLoad(triangle_buffer, pixel, 0).x - frame.id_base);
    if plane >= NOT_GLASS {
        return color;
    }
    for (var index = 0u; index < params.mirrors; index++) {
        if mirrors[index].plane == plane {
            if agrees(textureLoad(normal_buffer, pixel, 0).xyz, mirrors[index].normal) {
                return vec4<f32>(textureLoad(pictures, pixel, mirrors[index].layer, 0).xyz, 1.0);
            }
            break;
        }
    }
    return color;
}
