// Screen-space rays from glass: `raster::effects::screen`.
//
//   REFRACT   also shows what is behind the pane, from the picture without glass

struct Params {
    camera: ScreenCamera,
    eye: vec4<f32>,
    // For each face: the directions to its centre, to its right, and down.
    axes: array<vec4<f32>, 18>,
    // First block, blocks in a row, and rows of each level of the pyramid.
    levels: array<vec4<u32>, MAX_LEVELS>,
    // Number of levels; 0 if no pixel shows glass or the camera is degenerate: then every pixel keeps its colour.
    level_count: u32,
    // Texels along a side of a face.
    map_size: u32,
    // Number of probes, and number of ranges of glass triangles.
    probes: u32,
    ranges: u32,
    // Index of refraction that stands for a whole pane.
    index: f32,
    // The number of a `Fresnel`: 0 for Fresnel's equations, 1 for Schlick's approximation, 2 and 3 for s-polarised and p-polarised light.
    fresnel: u32,
    thickness: f32,
    // 1: pixels without an answer get the alpha LEFT.
    leaves: u32,
}

@group(1) @binding(3) var faces: texture_2d_array<f32>;
// First triangle and end of each range of glass triangles, ascending.
@group(1) @binding(4) var<storage, read> glass: array<vec2<u32>>;
@group(1) @binding(5) var<storage, read> probes: array<Probe>;
@group(1) @binding(6) var<storage, read> pyramid: array<f32>;
// Counts of glass pixels, of those whose rays the screen answers, and of those that keep some of their colour. Each count
// is distributed over many sums, which the host adds.
@group(1) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;
//#if REFRACT
@group(2) @binding(0) var seen_color: texture_2d<f32>;
@group(2) @binding(1) var seen_position: texture_2d<f32>;
@group(2) @binding(2) var seen_normal: texture_2d<f32>;
//#endif

// The results of a pixel's rays.
struct Rays {
    missing: bool,
    keeps: bool,
}

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let color = textureLoad(color_buffer, pixel, 0);
    if params.level_count == 0u || !is_glass(textureLoad(triangle_buffer, pixel, 0).x - frame.id_base) {
        return color;
    }
    let sum = 3u * ((pixel.x + 8u * pixel.y) % SUMS);
    atomicAdd(&counts[sum], 1u);
    let position = textureLoad(position_buffer, pixel, 0).xyz;
    let seen = facing(params.eye.xyz, position, textureLoad(normal_buffer, pixel, 0).xyz);
    var rays = Rays(true, true);
    var result = color;
    if seen.known {
        rays = Rays(false, false);
        let mirrored = seen.view - 2.0 * seen.normal * dot(seen.normal, seen.view);
//#if REFRACT
        let interface_ = fresnel(-dot(seen.normal, seen.view));
        var both = vec3<f32>(0.0);
        if interface_.reflectance > 0.0 {
            both += interface_.reflectance * look(position, mirrored, color.xyz, &rays);
        }
        if interface_.reflectance < 1.0 {
            let along = seen.view - seen.normal * dot(seen.normal, seen.view);
            let bent = along / params.index - seen.normal * interface_.cos_refracted;
            both += (1.0 - interface_.reflectance) * look(position, bent, color.xyz, &rays);
        }
        result = vec4<f32>(both, 1.0);
//#else
        result = vec4<f32>(look(position, mirrored, color.xyz, &rays), 1.0);
//#endif
    }
    if rays.missing && params.leaves == 1u {
        return vec4<f32>(color.xyz, LEFT);
    }
    if !rays.missing {
        atomicAdd(&counts[sum + 1u], 1u);
    }
    if rays.keeps {
        atomicAdd(&counts[sum + 2u], 1u);
    }
    return result;
}

// The colour that a ray hits: from the screen if it shows the hit, else from a cube map if there is one, else the glass's own colour.
fn look(position: vec3<f32>, direction: vec3<f32>, own: vec3<f32>, rays: ptr<function, Rays>) -> vec3<f32> {
    let met = march(position, direction);
    if met.x >= 0 {
//#if REFRACT
        return textureLoad(seen_color, met, 0).xyz;
//#else
        return textureLoad(color_buffer, met, 0).xyz;
//#endif
    }
    if met.x == NOTHING_MET {
        return vec3<f32>(0.0);
    }
    (*rays).missing = true;
    if params.probes == 0u {
        (*rays).keeps = true;
        return own;
    }
    return sample_cube(nearest(position), position, direction);
}

const NOTHING_MET = -1;
const NOT_KNOWN = -2;

// The fraction of a line after which a coordinate reaches a bound.
fn until(place: f32, step: f32, low: f32, high: f32) -> f32 {
    if step > SMALLEST {
        return max((high - place) / step, 0.0);
    }
    if step < -SMALLEST {
        return max((low - place) / step, 0.0);
    }
    return LARGEST;
}

fn leaves(first: u32, side: f32, start: f32, span: f32) -> f32 {
    if span > LEAST_SPAN {
        return ((f32(first) + 1.0) * side - start) / span;
    }
    if span < -LEAST_SPAN {
        return (f32(first) * side - start) / span;
    }
    return 1.0;
}

// The pixel that shows what a ray hits; NOTHING_MET or NOT_KNOWN in x.
fn march(position: vec3<f32>, direction: vec3<f32>) -> vec2<i32> {
    let camera = params.camera;
    let start = place_of(camera, position);
    let along = vec3<f32>(dot(camera.columns.xyz, direction), dot(camera.rows.xyz, direction), dot(camera.depths.xyz, direction));
    let size = vec2<f32>(frame.size);
    var step = vec3<f32>(along.xy, -along.z);
    if camera.origin.w != 0.0 {
        step = vec3<f32>(along.xy - start.xy * along.z, -start.z * along.z);
    }
    let beside = min(until(start.x, step.x, 0.0, size.x), until(start.y, step.y, 0.0, size.y));
    let ahead = until(start.z, step.z, camera.down.w, camera.right.w);
    let reach = min(beside, ahead);
    let span = step * reach;
    if !(start.z > NOTHING && reach < LARGEST && all(abs(span) < vec3<f32>(LARGEST))) {
        return vec2<i32>(NOT_KNOWN);
    }
    let far = step.z < 0.0 && ahead <= beside;
    let least = STEP / max(max(abs(span.x), abs(span.y)), STEP);
    let rounding = ROUNDING * abs(start.z);
    let last = params.level_count - 1u;
    let most_steps = 4u * (frame.size.x + frame.size.y) + 256u;
    // `enter` and `t` are fractions of the ray's line: where the ray enters the block, and a place inside the block.
    var enter = 0.0;
    var t = 0.0;
    var level = 0u;
//#if REFRACT
    var own = false;
//#else
    var own = true;
//#endif
    for (var steps = 0u; steps < most_steps && t < 1.0; steps++) {
        let at = max(start.xy + span.xy * t, vec2<f32>(0.0));
        let block = min(vec2<u32>(at), frame.size - 1u) >> vec2<u32>(level);
        let side = f32(1u << level);
        let exit = min(max(min(leaves(block.x, side, start.x, span.x), leaves(block.y, side, start.y, span.y)), t), 1.0);
        let deepest = start.z + span.z * select(enter, exit, span.z < 0.0);
        let stored = params.levels[level];
        if own {
            own = false;
        } else if deepest <= pyramid[stored.x + block.y * stored.y + block.x] {
            if level > 0u {
                level -= 1u;
                continue;
            }
            let crossing = cross_pixel(start, span, direction, enter, exit, block, rounding);
            if crossing == 1u {
                return vec2<i32>(block);
            }
            if crossing == 2u {
                return vec2<i32>(NOT_KNOWN);
            }
        }
        enter = exit;
        t = exit + least;
        level = min(level + 1u, last);
    }
    return vec2<i32>(select(NOT_KNOWN, NOTHING_MET, far && t >= 1.0));
}

// 0 where the ray goes on, 1 where it hits the surface that the pixel shows, 2 where it hits something that the picture does not
// show.
fn cross_pixel(
    start: vec3<f32>,
    span: vec3<f32>,
    direction: vec3<f32>,
    enter: f32,
    exit: f32,
    pixel: vec2<u32>,
    rounding: f32,
) -> u32 {
//#if REFRACT
    let piece = piece_of(params.camera, textureLoad(seen_position, pixel, 0).xyz, textureLoad(seen_normal, pixel, 0).xyz);
//#else
    let piece =
        piece_of(params.camera, textureLoad(position_buffer, pixel, 0).xyz, textureLoad(normal_buffer, pixel, 0).xyz);
//#endif
    if !piece.known {
        return 0u;
    }
    let first = start + span * enter;
    let second = start + span * exit;
    let seen_in = nearness_at(piece, first.xy);
    let seen_out = nearness_at(piece, second.xy);
    let tolerance = max(rounding, ROUNDING * abs(piece.place.z));
    let before = first.z >= seen_in - tolerance;
    if before && second.z >= seen_out - tolerance {
        return 0u;
    }
    var deep = params.thickness + params.camera.forward.w;
    if params.camera.origin.w != 0.0 {
        deep = (params.thickness * seen_in + params.camera.forward.w) * first.z;
    }
    if !(before || seen_in - first.z <= deep) || dot(piece.normal, direction) >= 0.0 {
        return 2u;
    }
//#if REFRACT
    return 1u;
//#else
    return select(1u, 2u, is_glass(textureLoad(triangle_buffer, pixel, 0).x - frame.id_base));
//#endif
}
