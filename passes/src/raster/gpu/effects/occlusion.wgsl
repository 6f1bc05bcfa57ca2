// Screen-space ambient occlusion: `raster::effects::occlusion`.
//
//   HORIZONS   by horizons, or by sectors; else by the difference of depths
//   BITMASK    by sectors of a bitmask

struct Params {
    camera: ScreenCamera,
    eye: vec4<f32>,
    // Cosine and sine of the angle from a slice to the next.
    turn: vec2<f32>,
    radius: f32,
    intensity: f32,
    slices: u32,
    steps: u32,
    seed: u32,
    thickness: f32,
}

@group(1) @binding(3) var depths: texture_2d<f32>;

// A pixel of the picture: `raster::effects::occlusion::pixels`. Vectors in its basis have components along the direction to the
// eye and along two vectors across.
struct Here {
    // Column and row, as numbers that `ROUND` is added to.
    center: vec2<f32>,
    // Column and row of the position, less half a pixel.
    place: vec2<f32>,
    depth: f32,
    // What columns and rows are divided by: the depth, 1 without perspective.
    w: f32,
    // Columns, rows and `w` along the two vectors across: see `Slice`.
    rates: mat2x3<f32>,
    // Steps of the position to the next column, row and depth; in the pixel's basis. Those to columns and rows are to be multiplied by
    // the depth.
    right: vec3<f32>,
    down: vec3<f32>,
    sight: vec3<f32>,
    // In the pixel's basis.
    normal: vec3<f32>,
}

// A direction in which occluders are searched.
struct Slice {
    // Cosine and sine of its angle.
    turn: vec2<f32>,
    // The position at a distance `r` along the slice is seen `rate.xy * r / (w + rate.z * r)` away from the pixel's own place.
    rate: vec3<f32>,
    // Length along the slice that covers one pixel of the picture.
    pixel: f32,
    // Relative position of the steps of each side in their interval.
    jitter: vec2<f32>,
}

// What a pixel shows, as seen from another. Outside the picture, and where a pixel shows nothing, it is `FAR`: beyond any radius.
struct Seen {
    // Columns and rows from that pixel, times the depth.
    aside: vec2<f32>,
    deeper: f32,
    // Whether it is a pixel of the picture.
    inside: bool,
}

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let position = textureLoad(position_buffer, pixel, 0).xyz;
    let seen = facing(params.eye.xyz, position, textureLoad(normal_buffer, pixel, 0).xyz);
    let depth = textureLoad(depths, pixel, 0).x;
    if !seen.known || !(depth < FAR) {
        return vec4<f32>(1.0);
    }
    return vec4<f32>(vec3<f32>(power(open(pixel, position, depth, seen), params.intensity)), 1.0);
}

fn here_at(pixel: vec2<u32>, position: vec3<f32>, depth: f32, seen: Facing) -> Here {
    let camera = params.camera;
    let perspective = camera.origin.w != 0.0;
    let basis = basis_around(-seen.view);
    let from_origin = vec4<f32>(position - camera.origin.xyz, 1.0);
    let w = to_w(depth);
    let place = vec2<f32>(dot(camera.columns, from_origin), dot(camera.rows, from_origin)) / w;
    let sight = select(camera.forward.xyz, from_origin.xyz / depth, perspective);
    return Here(
        vec2<f32>(pixel) + ROUND,
        place - 0.5,
        depth,
        w,
        mat2x3<f32>(rate_along(basis[1], place, perspective), rate_along(basis[2], place, perspective)),
        camera.right.xyz * basis,
        camera.down.xyz * basis,
        sight * basis,
        seen.normal * basis,
    );
}

fn rate_along(across: vec3<f32>, place: vec2<f32>, perspective: bool) -> vec3<f32> {
    let camera = params.camera;
    let deeper = select(0.0, dot(camera.depths.xyz, across), perspective);
    return vec3<f32>(
        vec2<f32>(dot(camera.columns.xyz, across), dot(camera.rows.xyz, across)) - place * deeper,
        deeper,
    );
}

// Cosine and sine of the first slice's angle.
fn first_turn(key: u32) -> vec2<f32> {
    return half_turn(unit(dimensions(key, 0u)).x / f32(params.slices)).yx;
}

fn turned(turn: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(turn.x * params.turn.x - turn.y * params.turn.y, turn.y * params.turn.x + turn.x * params.turn.y);
}

fn slice_of(here: Here, key: u32, index: u32, turn: vec2<f32>) -> Slice {
    let rate = here.rates * turn;
    return Slice(turn, rate, here.w / length(rate.xy), unit(dimensions(key, 1u + index)));
}

// The pixel that shows the position at this distance along the slice.
fn look(here: Here, slice: Slice, reach: f32) -> Seen {
    let w = here.w + slice.rate.z * reach;
    let at = here.place + slice.rate.xy * (reach / w);
    // Adding `ROUND` rounds to an integer, which the sum holds in its low bits. As a fused product with a 1 that compilers do not know,
    // none can reorder this sum with another.
    let rounded = fma(at, vec2<f32>(params.eye.w), vec2<f32>(ROUND));
    let pixel = bitcast<vec2<u32>>(rounded) - ROUND_BITS;
    let inside = w > 0.0 && all(pixel < frame.size);
    var depth = FAR;
    if inside {
        depth = textureLoad(depths, pixel, 0).x;
    }
    return Seen((rounded - here.center) * to_w(depth), depth - here.depth, inside);
}

// What columns and rows are divided by at a depth: 1 without perspective.
fn to_w(depth: f32) -> f32 {
    return fma(depth, params.camera.origin.w, 1.0 - params.camera.origin.w);
}

//#if HORIZONS
// The plane of a slice.
struct Plane {
    // Cosine and sine of the projected normal's angle from the direction to the eye.
    normal: vec2<f32>,
    // Length of that projection: the slice's weight. 0 where it does not count.
    weight: f32,
    // Steps to the next column, row and depth along the slice (x) and to the eye (y), after they are moved into the plane along the
    // tangent plane.
    right: vec2<f32>,
    down: vec2<f32>,
    sight: vec2<f32>,
}

fn plane_of(here: Here, turn: vec2<f32>) -> Plane {
    // The normal's component along the slice, and the one off its plane.
    let across = here.normal.y * turn.x + here.normal.z * turn.y;
    let off = here.normal.z * turn.x - here.normal.y * turn.y;
    let squared = across * across + here.normal.x * here.normal.x;
    // The normal is almost perpendicular to the plane.
    if squared < LEAST_WEIGHT {
        return Plane(vec2<f32>(1.0, 0.0), 0.0, vec2<f32>(0.0), vec2<f32>(0.0), vec2<f32>(0.0));
    }
    let weight = sqrt(squared);
    let shear = vec2<f32>(across, here.normal.x) * (off / squared);
    return Plane(
        vec2<f32>(here.normal.x, across) / weight,
        weight,
        into_plane(here.right, turn, shear),
        into_plane(here.down, turn, shear),
        into_plane(here.sight, turn, shear),
    );
}

fn into_plane(step: vec3<f32>, turn: vec2<f32>, shear: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(step.y * turn.x + step.z * turn.y, step.x) + shear * (step.z * turn.x - step.y * turn.y);
}

// What is seen, along a side of the slice (x, above 0 on that side) and to the eye (y).
fn in_plane(plane: Plane, seen: Seen, towards: f32) -> vec2<f32> {
    let moved = seen.aside.x * plane.right + seen.aside.y * plane.down + seen.deeper * plane.sight;
    return vec2<f32>(towards * moved.x, moved.y);
}

fn open(pixel: vec2<u32>, position: vec3<f32>, depth: f32, seen: Facing) -> f32 {
    let here = here_at(pixel, position, depth, seen);
    let key = pixel_key(pixel.x, pixel.y, params.seed);
    let steps = f32(params.steps);
    let interval = 1.0 / steps;
    var turn = first_turn(key);
    var taken = 0.0;
    var whole = 0.0;
//#if BITMASK
    let eye = distance(params.eye.xyz, position);
    let jitter = unit(dimensions(key, 0u)).y;
//#endif
    for (var index = 0u; index < params.slices; index++) {
        let slice = slice_of(here, key, index, turn);
        let plane = plane_of(here, turn);
        turn = turned(turn);
        let tilt = sign(plane.normal.y) * angle(vec2<f32>(abs(plane.normal.y), plane.normal.x)).x;
        let all = plane.normal.x + tilt * plane.normal.y;
        whole += plane.weight * all;
        if !(slice.pixel < params.radius && plane.weight > 0.0) {
            continue;
        }
        let first = slice.jitter * interval;
//#if BITMASK
        let sectors = sectors_of(plane.normal, tilt, all, fract(jitter + f32(index) / f32(params.slices)));
        var shut = 0u;
        for (var step = 0.0; step < steps; step += 1.0) {
            let reach = reaches(slice, fma(vec2<f32>(step), vec2<f32>(interval), first));
            shut |= shut_by(sectors, 1.0, plane, look(here, slice, reach.x), eye)
                | shut_by(sectors, -1.0, plane, look(here, slice, -reach.y), eye);
        }
        taken += plane.weight * all * f32(countOneBits(shut)) * (1.0 / SECTORS);
//#else
        // The two horizons, as directions; both start at the tangent plane.
        let start = vec4<f32>(plane.normal.x, -plane.normal.y, plane.normal);
        var horizons = start;
        // Two steps at a time: a turn of the loop costs about half a step.
        var step = 0.0;
        if (params.steps & 1u) == 1u {
            horizons = both_raised(horizons, here, slice, plane, first);
            step = 1.0;
        }
        for (; step < steps; step += 2.0) {
            let share = fma(vec2<f32>(step), vec2<f32>(interval), first);
            horizons = both_raised(horizons, here, slice, plane, share);
            horizons = both_raised(horizons, here, slice, plane, share + interval);
        }
        let mirrored = vec2<f32>(plane.normal.x, -plane.normal.y);
        taken += plane.weight
            * (lost(plane.normal, tilt, horizons.xy, start.xy) + lost(mirrored, -tilt, horizons.zw, start.zw));
//#endif
    }
    if whole > 0.0 {
        return clamp(1.0 - taken / whole, 0.0, 1.0);
    }
    return 1.0;
}

// Distances of a step to both sides, from its share of the way. Steps are denser near the pixel.
fn reaches(slice: Slice, share: vec2<f32>) -> vec2<f32> {
    return slice.pixel + (params.radius - slice.pixel) * share * share;
}

//#if BITMASK
// The measures of a slice's sectors: `raster::effects::occlusion::bitmask`.
struct Sectors {
    // Cosine and sine of the projected normal's angle.
    normal: vec2<f32>,
    // The contribution of the whole slice.
    all: f32,
    // For each side, the contribution between the direction to the eye and the tangent plane.
    limit: vec2<f32>,
    jitter: f32,
}

fn sectors_of(normal: vec2<f32>, tilt: f32, all: f32, jitter: f32) -> Sectors {
    let limit = 0.25 * (2.0 * normal.x + vec2<f32>(PI + 2.0 * tilt, 2.0 * tilt - PI) * normal.y);
    return Sectors(normal, all, limit, jitter);
}

// A mask of the sectors that something seen on one side of a slice shuts.
fn shut_by(sectors: Sectors, towards: f32, plane: Plane, seen: Seen, eye: f32) -> u32 {
    let front = in_plane(plane, seen, towards);
    let away = normalize(front - vec2<f32>(0.0, eye));
    // Distances at which that line enters and leaves the disk of the radius.
    let middle = dot(front, away);
    let inside = middle * middle + (params.radius * params.radius - dot(front, front));
    let chord = sqrt(max(inside, 0.0));
    let first = max(-middle - chord, 0.0);
    let last = min(chord - middle, params.thickness);
    // The move into the plane may bring a near pixel to the other side.
    if !(front.x > 0.0 && inside > 0.0 && last > first) {
        return 0u;
    }
    let parts = vec2<f32>(part(sectors, towards, front + first * away), part(sectors, towards, front + last * away));
    return below(max(parts.x, parts.y)) & ~below(min(parts.x, parts.y));
}

// The number of sectors whose tested angle lies before a direction of a side; to be truncated.
fn part(sectors: Sectors, towards: f32, direction: vec2<f32>) -> f32 {
    let normal = vec2<f32>(1.0, towards) * sectors.normal;
    let limit = select(sectors.limit.y, sectors.limit.x, towards > 0.0);
    let above = direction.x * normal.y + direction.y * normal.x > 0.0;
    let found = select(limit, arc(normal, angle(direction)), above);
    let place = (sectors.limit.y + towards * found) / sectors.all;
    return clamp(place * SECTORS - sectors.jitter + 1.0, 0.0, SECTORS);
}

// `(cos g - cos(2h - g) + 2h sin g) / 4` for an angle `h` and the normal's angle `g`.
fn arc(normal: vec2<f32>, h: vec3<f32>) -> f32 {
    return 0.25 * (normal.x - (h.y * normal.x + h.z * normal.y) + 2.0 * h.x * normal.y);
}

// A mask of the lowest bits: as many as the integer part of `count`.
fn below(count: f32) -> u32 {
    let bits = u32(count);
    return select(0u, 0xffffffffu >> ((32u - bits) & 31u), bits > 0u);
}
//#else
// Both horizons of a slice, raised by a step.
fn both_raised(horizons: vec4<f32>, here: Here, slice: Slice, plane: Plane, share: vec2<f32>) -> vec4<f32> {
    let reach = reaches(slice, share);
    return vec4<f32>(
        raised(horizons.xy, plane, look(here, slice, reach.x), 1.0),
        raised(horizons.zw, plane, look(here, slice, -reach.y), -1.0),
    );
}

// A horizon raised to what is seen, if that is above it and within the radius.
fn raised(horizon: vec2<f32>, plane: Plane, seen: Seen, towards: f32) -> vec2<f32> {
    let front = in_plane(plane, seen, towards);
    let within = dot(front, front) <= params.radius * params.radius;
    // The move into the plane may bring a near pixel to the other side. For the pixel itself all differences are 0.
    let higher = front.x > 0.0 && front.y * horizon.x > horizon.y * front.x;
    return select(horizon, front, within && higher);
}

// What a horizon takes away: `(cos g - cos(2h - g) + 2h sin g) / 4` at the tangent plane less that at the horizon `h`, for the normal's
// angle `g`.
fn lost(normal: vec2<f32>, tilt: f32, horizon: vec2<f32>, start: vec2<f32>) -> f32 {
    if all(horizon == start) {
        return 0.0;
    }
    let h = angle(horizon);
    return 0.25 * (normal.x * (1.0 + h.y) + normal.y * (h.z + PI + 2.0 * (tilt - h.x)));
}
//#endif

// The angle of a direction from the second axis, 0..π, then cosine and sine of twice that angle; the first component is not below 0.
// The arc tangent is Abramowitz and Stegun, "Handbook of Mathematical Functions", 4.4.49: error below 2e-8 besides rounding. A
// device's own may be off by 4096 units in the last place (Vulkan 1.3, "Precision and Operation of SPIR-V Instructions").
fn angle(direction: vec2<f32>) -> vec3<f32> {
    let height = abs(direction.y);
    let steep = height >= direction.x;
    let q = select(height / direction.x, direction.x / height, steep);
    let qq = q * q;
    var sum = 0.0028662257;
    sum = sum * qq - 0.016165737;
    sum = sum * qq + 0.042909614;
    sum = sum * qq - 0.07528964;
    sum = sum * qq + 0.10656264;
    sum = sum * qq - 0.142089;
    sum = sum * qq + 0.19993551;
    sum = sum * qq - 0.33333145;
    let within = sum * qq * q + q;
    let upward = select(0.5 * PI - within, within, steep);
    let scale = 1.0 / (1.0 + qq);
    let double = vec2<f32>(1.0 - qq, 2.0 * q) * scale;
    let down = direction.y < 0.0;
    return vec3<f32>(
        select(upward, PI - upward, down),
        select(-double.x, double.x, steep),
        select(double.y, -double.y, down),
    );
}
//#else
fn open(pixel: vec2<u32>, position: vec3<f32>, depth: f32, seen: Facing) -> f32 {
    let here = here_at(pixel, position, depth, seen);
    let key = pixel_key(pixel.x, pixel.y, params.seed);
    let largest = max(abs(position.x), max(abs(position.y), abs(position.z)));
    let tolerance = max(DEPTH_TOLERANCE * params.radius, 4.0 * EPSILON * largest);
    // Heights above the tangent plane of the steps to the next column, row and depth.
    let heights = vec3<f32>(dot(here.right, here.normal), dot(here.down, here.normal), dot(here.sight, here.normal));
    var turn = first_turn(key);
    var occluded = 0u;
    var samples = 0u;
    for (var index = 0u; index < params.slices; index++) {
        let slice = slice_of(here, key, index, turn);
        turn = turned(turn);
        for (var side = 0u; side < 2u; side++) {
            let jitter = select(slice.jitter.x, slice.jitter.y, side == 1u);
            let reach = select(params.radius, -params.radius, side == 1u);
            for (var step = 0u; step < params.steps; step++) {
                let other = look(here, slice, reach * sqrt((f32(step) + jitter) / f32(params.steps)));
                if !other.inside || all(other.aside == vec2<f32>(0.0)) {
                    continue;
                }
                samples += 1u;
                if other.deeper < FAR - here.depth && dot(vec3<f32>(other.aside, other.deeper), heights) > tolerance {
                    occluded += 1u;
                }
            }
        }
    }
    return 1.0 - f32(occluded) / f32(max(samples, 1u));
}
//#endif

// Sine and cosine of `share * π`, for `share` in 0..1, by the series around π / 2; error below 3e-7. A device's own may be off by
// 2^-11.
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

// A unit vector and two across it: `sampling::hemisphere::Basis::around`.
fn basis_around(normal: vec3<f32>) -> mat3x3<f32> {
    let sign_z = select(1.0, -1.0, (bitcast<u32>(normal.z) >> 31u) == 1u);
    let a = -1.0 / (sign_z + normal.z);
    let b = normal.x * normal.y * a;
    return mat3x3<f32>(
        normal,
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
