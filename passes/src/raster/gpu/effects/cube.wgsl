// Reflection and refraction in glass from cube maps: `raster::effects::cube` and `raster::effects::panes`.
//
//   REFRACT   what is behind the pane, too

struct Params {
    eye: vec4<f32>,
    // By face: the directions to its middle, to the right, and down.
    axes: array<vec4<f32>, 18>,
    // Texels a side of a face.
    map_size: u32,
    // How many probes and ranges there are.
    probes: u32,
    ranges: u32,
    // Index of refraction of a whole pane.
    index: f32,
    // 1: Schlick's approximation of Fresnel's equations.
    schlick: u32,
}

// The box of a pane.
struct Probe {
    low: vec4<f32>,
    high: vec4<f32>,
}

// Layers: six faces for each probe.
@group(1) @binding(3) var faces: texture_2d_array<f32>;
// First triangle and end of each range of triangles that are glass, ascending.
@group(1) @binding(4) var<storage, read> glass: array<vec2<u32>>;
@group(1) @binding(5) var<storage, read> probes: array<Probe>;

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let color = textureLoad(color_buffer, pixel, 0);
    if params.probes == 0u || !is_glass(textureLoad(triangle_buffer, pixel, 0).x - frame.id_base) {
        return color;
    }
    let position = textureLoad(position_buffer, pixel, 0).xyz;
    let seen = facing(params.eye.xyz, position, textureLoad(normal_buffer, pixel, 0).xyz);
    if !seen.known {
        return color;
    }
    let probe = nearest(position);
    let mirrored = seen.view - 2.0 * seen.normal * dot(seen.normal, seen.view);
//#if REFRACT
    let interface_ = fresnel(-dot(seen.normal, seen.view));
    var result = vec3<f32>(0.0);
    if interface_.reflectance > 0.0 {
        result += interface_.reflectance * sample_cube(probe, mirrored);
    }
    if interface_.reflectance < 1.0 {
        let along = seen.view - seen.normal * dot(seen.normal, seen.view);
        let bent = along / params.index - seen.normal * interface_.cos_refracted;
        result += (1.0 - interface_.reflectance) * sample_cube(probe, bent);
    }
    return vec4<f32>(result, 1.0);
//#else
    return vec4<f32>(sample_cube(probe, mirrored), 1.0);
//#endif
}

fn nearest(position: vec3<f32>) -> u32 {
    var best = 0u;
    var shortest = LARGEST;
    for (var index = 0u; index < params.probes; index++) {
        let away = position - clamp(position, probes[index].low.xyz, probes[index].high.xyz);
        let distance_squared = dot(away, away);
        if distance_squared < shortest {
            shortest = distance_squared;
            best = index;
        }
    }
    return best;
}

// A cube map in a direction, filtered within the face.
fn sample_cube(probe: u32, direction: vec3<f32>) -> vec3<f32> {
    let size = abs(direction);
    var face: u32;
    if size.x >= size.y && size.x >= size.z {
        face = u32(direction.x < 0.0);
    } else if size.y >= size.z {
        face = 2u + u32(direction.y < 0.0);
    } else {
        face = 4u + u32(direction.z < 0.0);
    }
    let forward = params.axes[3u * face].xyz;
    let right = params.axes[3u * face + 1u].xyz;
    let down = params.axes[3u * face + 2u].xyz;
    let scale = 0.5 / max(dot(direction, forward), SMALLEST);
    let at = vec2<f32>(dot(direction, right), dot(direction, down)) * scale + 0.5;
    let last = f32(params.map_size - 1u);
    let place = clamp(at * f32(params.map_size) - 0.5, vec2<f32>(0.0), vec2<f32>(last));
    let first = vec2<u32>(place);
    let second = min(first + 1u, vec2<u32>(params.map_size - 1u));
    let share = place - vec2<f32>(first);
    let layer = 6u * probe + face;
    let upper = mix(texel(first.x, first.y, layer), texel(second.x, first.y, layer), share.x);
    let lower = mix(texel(first.x, second.y, layer), texel(second.x, second.y, layer), share.x);
    return mix(upper, lower, share.y);
}

fn texel(x: u32, y: u32, layer: u32) -> vec3<f32> {
    return textureLoad(faces, vec2<u32>(x, y), layer, 0).xyz;
}
//#if REFRACT

struct Interface {
    reflectance: f32,
    cos_refracted: f32,
}

// Fresnel's equations for unpolarised light: `effects::interface`, in single precision.
fn fresnel(cosine: f32) -> Interface {
    let cos = clamp(cosine, 0.0, 1.0);
    let index = params.index;
    // The first term loses no digits for an index near 1.
    let discriminant = (index - 1.0) * (index + 1.0) + cos * cos;
    if discriminant <= 0.0 {
        return Interface(1.0, 0.0);
    }
    let bent = sqrt(discriminant) / index;
    if params.schlick == 1u {
        // `effects::schlick`.
        let root = (index - 1.0) / (index + 1.0);
        let zero = root * root;
        let away = 1.0 - select(cos, min(bent, 1.0), index < 1.0);
        let square = away * away;
        return Interface(min(zero + (1.0 - zero) * (square * square * away), 1.0), bent);
    }
    let perpendicular = (cos - index * bent) / (cos + index * bent);
    let parallel = (index * cos - bent) / (index * cos + bent);
    return Interface(0.5 * (perpendicular * perpendicular + parallel * parallel), bent);
}
//#endif
