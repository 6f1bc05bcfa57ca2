
// Cube maps of the panes: `raster::effects::cube` and `raster::effects::panes`.

struct Probe {
    // The box of the pane.
    low: vec4<f32>,
    high: vec4<f32>,
    // Centre of the cube map; w is 1 if there is a proxy.
    center: vec4<f32>,
    // Corners of the proxy, relative to the centre.
    proxy_low: vec4<f32>,
    proxy_high: vec4<f32>,
}

// Direction in which a cube map is looked up for a ray: `raster::effects::proxy`.
fn toward(probe: u32, position: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let center = probes[probe].center;
    if center.w == 0.0 {
        return direction;
    }
    let low = probes[probe].proxy_low.xyz;
    let high = probes[probe].proxy_high.xyz;
    let place = clamp(position - center.xyz, low, high);
    var way = LARGEST;
    for (var axis = 0u; axis < 3u; axis++) {
        let along = direction[axis];
        if abs(along) > LEAST_ALONG {
            way = min(way, (select(low[axis], high[axis], along > 0.0) - place[axis]) / along);
        }
    }
    return place + direction * way;
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

// The colour of a ray in a cube map, bilinear within the face.
fn sample_cube(probe: u32, position: vec3<f32>, ray: vec3<f32>) -> vec3<f32> {
    let direction = toward(probe, position, ray);
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
