// Screen-space ambient occlusion: `raster::effects::occlusion`.
//
//   HORIZONS   by horizons, or by sectors; else by the difference of depths
//   BITMASK    by sectors of a bitmask

struct Params {
    clip_from_world: mat4x4<f32>,
    eye: vec4<f32>,
    radius: f32,
    intensity: f32,
    slices: u32,
    steps: u32,
    seed: u32,
    thickness: f32,
}

// A direction in which occluders are searched.
struct Slice {
    across: vec3<f32>,
    clip: vec4<f32>,
    clip_step: vec4<f32>,
    // World length along `across` that covers one pixel of the picture.
    pixel: f32,
    jitter: vec2<f32>,
}

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let position = textureLoad(position_buffer, pixel, 0).xyz;
    let seen = facing(params.eye.xyz, position, textureLoad(normal_buffer, pixel, 0).xyz);
    if !seen.known {
        return vec4<f32>(1.0);
    }
    return vec4<f32>(vec3<f32>(occlusion(pixel, position, seen)), 1.0);
}

//#if HORIZONS
fn occlusion(pixel: vec2<u32>, position: vec3<f32>, seen: Facing) -> f32 {
    let to_eye = -seen.view;
    let basis = basis_around(to_eye);
    let key = pixel_key(pixel.x, pixel.y, params.seed);
    var visible = 0.0;
    var whole = 0.0;
    for (var index = 0u; index < params.slices; index++) {
        let slice = slice_of(key, index, basis, position);
        let aside = cross(to_eye, slice.across);
        let off = dot(seen.normal, aside);
        let length_squared = 1.0 - off * off;
        // The normal is almost perpendicular to the slice's plane, so the slice has no weight.
        if length_squared < LEAST_WEIGHT {
            continue;
        }
        let shear = (aside - seen.normal * off) / length_squared;
        let weight = sqrt(length_squared);
        let sin_normal = clamp(dot(seen.normal, slice.across) / weight, -1.0, 1.0);
        let cos_normal = clamp(dot(seen.normal, to_eye) / weight, 0.0, 1.0);
//#if BITMASK
        let sectors = Sectors(
            sin_normal,
            cos_normal,
            vec2<f32>(arc(-sin_normal, 1.0, sin_normal, cos_normal), arc(sin_normal, -1.0, sin_normal, cos_normal)),
            fract(unit(dimensions(key, 0u)).y + f32(index) / f32(params.slices)),
        );
        var shut = 0u;
        if slice.pixel < params.radius {
            shut = shut_by(sectors, 1.0, slice.jitter.x, slice, shear, aside, to_eye, position, pixel)
                | shut_by(sectors, -1.0, slice.jitter.y, slice, shear, aside, to_eye, position, pixel);
        }
        let all = weight * (sectors.limit.x + sectors.limit.y);
        whole += all;
        visible += all * (1.0 - f32(countOneBits(shut)) / SECTORS);
//#else
        // The cosines of the two horizons; both start at the tangent plane.
        let open = vec2<f32>(-sin_normal, sin_normal);
        var horizons = open;
        if slice.pixel < params.radius {
            horizons.x = horizon(open.x, 1.0, slice.jitter.x, slice, shear, aside, to_eye, position, pixel);
            horizons.y = horizon(open.y, -1.0, slice.jitter.y, slice, shear, aside, to_eye, position, pixel);
        }
        whole += weight * (arc(open.x, 1.0, sin_normal, cos_normal) + arc(open.y, -1.0, sin_normal, cos_normal));
        visible += weight
            * (arc(horizons.x, 1.0, sin_normal, cos_normal) + arc(horizons.y, -1.0, sin_normal, cos_normal));
//#endif
    }
    if whole > 0.0 {
        return power(clamp(visible / whole, 0.0, 1.0), params.intensity);
    }
    return 1.0;
}

//#if BITMASK
// The measures of a slice's sectors: `raster::effects::occlusion::bitmask`.
struct Sectors {
    sin_normal: f32,
    cos_normal: f32,
    // For each side, the contribution between the direction to the eye and the tangent plane.
    limit: vec2<f32>,
    jitter: f32,
}

// A mask of the sectors that the samples on one side of a slice shut.
fn shut_by(
    sectors: Sectors,
    towards: f32,
    jitter: f32,
    slice: Slice,
    shear: vec3<f32>,
    aside: vec3<f32>,
    to_eye: vec3<f32>,
    position: vec3<f32>,
    center: vec2<u32>,
) -> u32 {
    let eye = distance(params.eye.xyz, position);
    var shut = 0u;
    for (var step = 0u; step < params.steps; step++) {
        // Steps are denser near the pixel.
        let share = (f32(step) + jitter) / f32(params.steps);
        let reach = slice.pixel + (params.radius - slice.pixel) * share * share;
        let at = pixel_at(slice, towards * reach, center);
        if at.x < 0 {
            continue;
        }
        let other = difference(at, position);
        if !other.known {
            continue;
        }
        let delta = other.delta - shear * dot(other.delta, aside);
        let front = vec2<f32>(towards * dot(delta, slice.across), dot(delta, to_eye));
        // The move into the plane may bring a near pixel to the other side.
        if !(front.x > 0.0) {
            continue;
        }
        let away = normalize(front - vec2<f32>(0.0, eye));
        // Distances at which that line enters and leaves the disk of the radius.
        let middle = dot(front, away);
        let inside = middle * middle + (params.radius * params.radius - dot(front, front));
        if !(inside > 0.0) {
            continue;
        }
        let chord = sqrt(inside);
        let first = max(-middle - chord, 0.0);
        let last = min(chord - middle, params.thickness);
        if !(last > first) {
            continue;
        }
        let parts = vec2<f32>(part(sectors, towards, front + first * away), part(sectors, towards, front + last * away));
        shut |= below(max(parts.x, parts.y)) & ~below(min(parts.x, parts.y));
    }
    return shut;
}

// The number of sectors whose tested angle lies before a direction of a side; to be truncated.
fn part(sectors: Sectors, towards: f32, direction: vec2<f32>) -> f32 {
    let cosine = direction.y / length(direction);
    let limit = select(sectors.limit.y, sectors.limit.x, towards > 0.0);
    let above = direction.x * towards * sectors.sin_normal + direction.y * sectors.cos_normal > 0.0;
    let found = select(limit, arc(cosine, towards, sectors.sin_normal, sectors.cos_normal), above);
    let place = (sectors.limit.y + towards * found) / (sectors.limit.x + sectors.limit.y);
    return clamp(place * SECTORS - sectors.jitter + 1.0, 0.0, SECTORS);
}

// A mask of the lowest bits: as many as the integer part of `count`.
fn below(count: f32) -> u32 {
    let bits = u32(count);
    return select(0u, 0xffffffffu >> ((32u - bits) & 31u), bits > 0u);
}
//#else
// The cosine of the horizon on one side of a slice.
fn horizon(
    tangent: f32,
    towards: f32,
    jitter: f32,
    slice: Slice,
    shear: vec3<f32>,
    aside: vec3<f32>,
    to_eye: vec3<f32>,
    position: vec3<f32>,
    center: vec2<u32>,
) -> f32 {
    var highest = tangent;
    for (var step = 0u; step < params.steps; step++) {
        // Steps are denser near the pixel.
        let share = (f32(step) + jitter) / f32(params.steps);
        let reach = slice.pixel + (params.radius - slice.pixel) * share * share;
        let at = pixel_at(slice, towards * reach, center);
        if at.x < 0 {
            continue;
        }
        let other = difference(at, position);
        if !other.known || dot(other.delta, other.delta) > params.radius * params.radius {
            continue;
        }
        let delta = other.delta - shear * dot(other.delta, aside);
        let along = towards * dot(delta, slice.across);
        // The move into the plane may bring a near pixel to the other side.
        if !(along > 0.0) {
            continue;
        }
        let up = dot(delta, to_eye);
        highest = max(highest, up / sqrt(along * along + up * up));
    }
    return highest;
}
//#endif

// `(-cos(2h - g) + cos g + 2h sin g) / 4` for a horizon `h` and the normal's angle `g`.
fn arc(cosine: f32, side: f32, sin_normal: f32, cos_normal: f32) -> f32 {
    let cos_h = clamp(cosine, -1.0, 1.0);
    let h = side * arc_cosine(cos_h);
    let sin_h = side * sqrt(1.0 - cos_h * cos_h);
    let cos_2h = 2.0 * cos_h * cos_h - 1.0;
    let sin_2h = 2.0 * sin_h * cos_h;
    return 0.25 * (cos_normal - (cos_2h * cos_normal + sin_2h * sin_normal) + 2.0 * h * sin_normal);
}

// The arc cosine by Abramowitz and Stegun, "Handbook of Mathematical Functions", 4.4.46: error below 2e-8 besides
// rounding. A device's own may be off by 4096 units in the last place (Vulkan 1.3, "Precision and Operation of SPIR-V
// Instructions").
fn arc_cosine(x: f32) -> f32 {
    let a = abs(x);
    var sum = -0.0012624911;
    sum = sum * a + 0.0066700901;
    sum = sum * a - 0.0170881256;
    sum = sum * a + 0.0308918810;
    sum = sum * a - 0.0501743046;
    sum = sum * a + 0.0889789874;
    sum = sum * a - 0.2145988016;
    sum = sum * a + 1.5707963050;
    let angle = sqrt(1.0 - a) * sum;
    return select(angle, PI - angle, x < 0.0);
}
//#else
fn occlusion(pixel: vec2<u32>, position: vec3<f32>, seen: Facing) -> f32 {
    let basis = basis_around(-seen.view);
    let key = pixel_key(pixel.x, pixel.y, params.seed);
    let largest = max(abs(position.x), max(abs(position.y), abs(position.z)));
    let tolerance = max(DEPTH_TOLERANCE * params.radius, 4.0 * EPSILON * largest);
    var occluded = 0u;
    var samples = 0u;
    for (var index = 0u; index < params.slices; index++) {
        let slice = slice_of(key, index, basis, position);
        for (var side = 0u; side < 2u; side++) {
            let jitter = select(slice.jitter.x, slice.jitter.y, side == 1u);
            let towards = select(1.0, -1.0, side == 1u);
            for (var step = 0u; step < params.steps; step++) {
                let reach = params.radius * sqrt((f32(step) + jitter) / f32(params.steps));
                let at = pixel_at(slice, towards * reach, pixel);
                if at.x < 0 {
                    continue;
                }
                samples += 1u;
                let other = difference(at, position);
                if other.known && dot(other.delta, seen.normal) > tolerance {
                    occluded += 1u;
                }
            }
        }
    }
    return power(1.0 - f32(occluded) / f32(max(samples, 1u)), params.intensity);
}
//#endif

fn slice_of(key: u32, index: u32, basis: Basis, position: vec3<f32>) -> Slice {
    let offset = unit(dimensions(key, 0u)).x;
    let turn = half_turn((f32(index) + offset) / f32(params.slices));
    let across = basis.tangent * turn.y + basis.bitangent * turn.x;
    let clip = params.clip_from_world * vec4<f32>(position, 1.0);
    let clip_step = params.clip_from_world * vec4<f32>(across, 0.0);
    // The derivative of x / w and y / w along `across`, in pixels.
    let rate = 0.5 * vec2<f32>(frame.size) * (clip_step.xy * clip.w - clip.xy * clip_step.w) / (clip.w * clip.w);
    return Slice(across, clip, clip_step, 1.0 / length(rate), unit(dimensions(key, 1u + index)));
}

// The pixel that shows the position at this distance along the slice; -1 outside the picture and for the centre pixel.
fn pixel_at(slice: Slice, reach: f32, center: vec2<u32>) -> vec2<i32> {
    let clip = slice.clip + slice.clip_step * reach;
    if !(clip.w > 0.0) {
        return vec2<i32>(-1);
    }
    let size = vec2<f32>(frame.size);
    let at = vec2<f32>((clip.x / clip.w * 0.5 + 0.5) * size.x, (0.5 - clip.y / clip.w * 0.5) * size.y);
    if !(all(at >= vec2<f32>(0.0)) && all(at < size)) {
        return vec2<i32>(-1);
    }
    let pixel = vec2<i32>(at);
    if all(pixel == vec2<i32>(center)) {
        return vec2<i32>(-1);
    }
    return pixel;
}

struct Difference {
    delta: vec3<f32>,
    // False where the other pixel shows nothing, or the same position.
    known: bool,
}

// The difference between the position of another pixel and a position.
fn difference(pixel: vec2<i32>, position: vec3<f32>) -> Difference {
    let other = textureLoad(position_buffer, pixel, 0);
    let delta = other.xyz - position;
    let known = any(other != vec4<f32>(0.0)) && any(delta != vec3<f32>(0.0)) && all(abs(delta) < vec3<f32>(LARGEST));
    return Difference(delta, known);
}

// Sine and cosine of `share * π`, for `share` in 0..1, by the series around π / 2; error below 1e-7. A device's own may
// be off by 2^-11.
fn half_turn(share: f32) -> vec2<f32> {
    let x = (share - 0.5) * PI;
    let xx = x * x;
    let sin_x = x * (1.0 + xx * (-1.0 / 6.0 + xx * (1.0 / 120.0 + xx * (-1.0 / 5040.0 + xx * (1.0 / 362880.0
        - xx / 39916800.0)))));
    let cos_x = 1.0 + xx * (-0.5 + xx * (1.0 / 24.0 + xx * (-1.0 / 720.0 + xx * (1.0 / 40320.0 + xx * (-1.0 / 3628800.0
        + xx / 479001600.0)))));
    return vec2<f32>(cos_x, -sin_x);
}

// `x` in 0..1 to a power of at least 0.
fn power(x: f32, exponent: f32) -> f32 {
    if exponent == 0.0 || x >= 1.0 {
        return 1.0;
    }
    return select(0.0, pow(x, exponent), x > 0.0);
}

struct Basis {
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
}

// `sampling::hemisphere::Basis::around`.
fn basis_around(normal: vec3<f32>) -> Basis {
    let sign_z = select(1.0, -1.0, (bitcast<u32>(normal.z) >> 31u) == 1u);
    let a = -1.0 / (sign_z + normal.z);
    let b = normal.x * normal.y * a;
    return Basis(
        vec3<f32>(1.0 + sign_z * normal.x * normal.x * a, sign_z * b, -sign_z * normal.x),
        vec3<f32>(b, sign_z + normal.y * normal.y * a, -normal.y),
    );
}

// `sampling::hash`.
fn pcg4d(counters: vec4<u32>) -> vec4<u32> {
    var v = counters * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4<u32>(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

fn pixel_key(x: u32, y: u32, seed: u32) -> u32 {
    return pcg4d(vec4<u32>(x, y, seed, HASH_PIXEL)).w;
}

fn dimensions(key: u32, counter: u32) -> vec2<u32> {
    return pcg4d(vec4<u32>(key, counter, 0u, HASH_DIMENSIONS)).zw;
}

fn unit(bits: vec2<u32>) -> vec2<f32> {
    return vec2<f32>(bits >> vec2<u32>(8u)) * (1.0 / 16777216.0);
}
