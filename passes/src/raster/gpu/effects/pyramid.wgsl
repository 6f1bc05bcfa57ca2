// One level of the pyramid of nearest surfaces: `raster::effects::screen::pyramid`.

struct Params {
    camera: ScreenCamera,
    // First block, blocks in a row, and rows; of the finer level, and of the level that is computed.
    fine: vec4<u32>,
    coarse: vec4<u32>,
    // 1 for the level of single pixels, which reads the G-buffer.
    base: u32,
}

@group(0) @binding(1) var position_buffer: texture_2d<f32>;
@group(0) @binding(2) var normal_buffer: texture_2d<f32>;
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read_write> pyramid: array<f32>;

@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.coarse.y || id.y >= params.coarse.z {
        return;
    }
    let index = params.coarse.x + id.y * params.coarse.y + id.x;
    var nearest = NOTHING;
    if params.base == 1u {
        let position = textureLoad(position_buffer, id.xy, 0).xyz;
        let piece = piece_of(params.camera, position, textureLoad(normal_buffer, id.xy, 0).xyz);
        if piece.known {
            nearest = nearness_at(piece, vec2<f32>(id.xy) + select(vec2<f32>(0.0), vec2<f32>(1.0), piece.slope > vec2<f32>(0.0)));
        }
    } else {
        let first = 2u * id.xy;
        let last = min(first + 1u, params.fine.yz - 1u);
        nearest = max(
            max(block(first.x, first.y), block(last.x, first.y)),
            max(block(first.x, last.y), block(last.x, last.y)),
        );
    }
    pyramid[index] = nearest;
}

fn block(column: u32, row: u32) -> f32 {
    return pyramid[params.fine.x + row * params.fine.y + column];
}
