// Screen-space ambient occlusion: `raster::effects::occlusion`.
//
//   HORIZONS      by horizons, or by sectors of a bitmask; else by differences of depths
//   BITMASK       by sectors of a bitmask
//   PERSPECTIVE   the camera has perspective

struct Params {
    camera: ScreenCamera,
    eye: vec4<f32>,
    // In perspective, the line of sight through the centre of the first pixel, at depth 1. Without perspective, the position that this pixel shows
    // at depth 0. Both are relative to the camera's origin.
    corner: vec4<f32>,
    // Without perspective, the step to the next depth.
    sight: vec4<f32>,
    // Cosine and sine of the angle from a slice to the next.
    turn: vec2<f32>,
    radius: f32,
    intensity: f32,
    slices: u32,
    steps: u32,
    seed: u32,
    thickness: f32,
    // 1 divided by the number of slices, and of steps.
    per_slice: f32,
    interval: f32,
    // The greatest distance of a step, in pixels.
    most: f32,
}

@group(1) @binding(3) var depths: texture_2d<f32>;

// A pixel of the picture: `raster::effects::occlusion::pixels`. Its surface point lies on the line of sight through its centre. Vectors in the
// pixel's basis have components along the direction to the eye and along two perpendicular vectors.
struct Here {
    // Column and row, each plus `ROUND`.
    center: vec2<f32>,
    depth: f32,
    // The divisor of columns and rows: the depth, or 1 without perspective.
    w: f32,
    // Distance from the eye.
    eye: f32,
    // Changes of columns, rows and `w` along the two perpendicular vectors: see `Slice`.
    rates: mat2x3<f32>,
    // Steps of the position to the next column, row and depth, in the pixel's basis. In perspective, the steps to columns and rows must be
    // multiplied by the depth, and the step to the next depth is along the first axis.
    right: vec3<f32>,
    down: vec3<f32>,
    sight: vec3<f32>,
    // The normal, in the pixel's basis.
    normal: vec3<f32>,
}

// A direction in which occluders are searched.
struct Slice {
    // Cosine and sine of the slice's angle.
    turn: vec2<f32>,
    // Unit direction of the slice in the picture, in columns and rows.
    along: vec2<f32>,
    // Change of the place in the picture, as a length in columns and rows, and change of `w`, for each unit of length along the slice.
    rate: vec2<f32>,
    // Length along the slice that covers one pixel of the picture.
    pixel: f32,
}

// The pixel at which a step of a slice arrives.
struct Found {
    // Column and row, each plus `ROUND`, which makes the sums whole numbers.
    rounded: vec2<f32>,
    pixel: vec2<u32>,
    // Whether the step arrives inside the picture.
    inside: bool,
}

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let depth = textureLoad(depths, pixel, 0).x;
    let normal = textureLoad(normal_buffer, pixel, 0).xyz;
    let squared = dot(normal, normal);
    if !(depth < FAR && squared > 0.0 && squared < LARGEST) {
        return vec4<f32>(1.0);
    }
    return vec4<f32>(vec3<f32>(power(open(pixel, depth, normal * inverseSqrt(squared)), params.intensity)), 1.0);
}

fn here_at(pixel: vec2<u32>, depth: f32, stored: vec3<f32>) -> Here {
    let camera = params.camera;
    let at = vec2<f32>(pixel);
    let corner = params.corner.xyz + at.x * camera.right.xyz + at.y * camera.down.xyz;
//#if PERSPECTIVE
    let away = corner;
//#else
    let away = corner + depth * params.sight.xyz + camera.origin.xyz - params.eye.xyz;
//#endif
    let squared = dot(away, away);
    let inverse = inverseSqrt(squared);
    let basis = basis_around(-away * inverse);
    let tilted = stored * basis;
    let turned_to = select(tilted, -tilted, tilted.x < 0.0);
    let normal = vec3<f32>(max(turned_to.x, LEAST_NORMAL), turned_to.yz);
    let right = camera.right.xyz * basis;
    let down = camera.down.xyz * basis;
//#if PERSPECTIVE
    // The inverse of the steps across.
    let scale = 1.0 / (right.y * down.z - down.y * right.z);
    let rates = mat2x2<f32>(vec2<f32>(down.z, -right.z) * scale, vec2<f32>(-down.y, right.y) * scale);
    let deeper = vec2<f32>(right.x, down.x) * inverse * rates;
    let size = squared * inverse;
    return Here(
        at + ROUND,
        depth,
        depth,
        depth * size,
        mat2x3<f32>(vec3<f32>(rates[0], deeper.x), vec3<f32>(rates[1], deeper.y)),
        right,
        down,
        vec3<f32>(-size, 0.0, 0.0),
        normal,
    );
//#else
    return Here(
        at + ROUND,
        depth,
        1.0,
        squared * inverse,
        mat2x3<f32>(rate_along(basis[1]), rate_along(basis[2])),
        right,
        down,
        params.sight.xyz * basis,
        normal,
    );
//#endif
}

//#if PERSPECTIVE
//#else
fn rate_along(across: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(params.camera.columns.xyz, across), dot(params.camera.rows.xyz, across), 0.0);
}
//#endif

// Cosine and sine of the first slice's angle.
fn first_turn(bits: u32) -> vec2<f32> {
    return half_turn(unit(bits) * params.per_slice).yx;
}

fn turned(turn: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(turn.x * params.turn.x - turn.y * params.turn.y, turn.y * params.turn.x + turn.x * params.turn.y);
}

fn slice_of(here: Here, turn: vec2<f32>) -> Slice {
    let rate = here.rates * turn;
    let squared = dot(rate.xy, rate.xy);
    let inverse = inverseSqrt(squared);
    return Slice(turn, rate.xy * inverse, vec2<f32>(squared * inverse, rate.z), here.w * inverse);
}

// Distances in pixels from the pixel's centre to the places where the positions at distances `reach` along a slice are seen. They are at most
// `most`, which also stands for positions behind the eye.
fn pixels_to(here: Here, slice: Slice, reach: vec2<f32>) -> vec2<f32> {
    let w = fma(vec2<f32>(slice.rate.y), reach, vec2<f32>(here.w));
    let pixels = min(abs(reach) * slice.rate.x / w, vec2<f32>(params.most));
    return select(vec2<f32>(params.most), pixels, w > vec2<f32>(0.0));
}

// The pixel at a distance of `pixels` along the slice.
fn look(here: Here, slice: Slice, pixels: f32) -> Found {
    // Adding to `ROUND` rounds to an integer, which the sum holds in its low bits.
    let rounded = fma(slice.along, vec2<f32>(pixels), here.center);
    let pixel = bitcast<vec2<u32>>(rounded) - ROUND_BITS;
    return Found(rounded, pixel, all(pixel < frame.size));
}

// Columns and rows from the pixel's centre to a step's pixel. The factor 1 is a parameter that compilers do not know, so that they cannot
// cancel `ROUND`.
fn aside(here: Here, found: Found) -> vec2<f32> {
    return fma(found.rounded, vec2<f32>(params.eye.w), -here.center);
}

// The divisor of columns and rows at a depth: 1 without perspective.
fn to_w(depth: f32) -> f32 {
//#if PERSPECTIVE
    return depth;
//#else
    return 1.0;
//#endif
}

//#if HORIZONS
// The plane of a slice.
struct Plane {
    // Components of the normal along the direction to the eye and along the slice. The length of both is the slice's weight.
    normal: vec2<f32>,
    // Square of that length.
    squared: f32,
    // Steps to the next column, row and depth: components along the slice (x) and towards the eye (y). The steps are first moved into the plane
    // along the tangent plane.
    right: vec2<f32>,
    down: vec2<f32>,
    sight: vec2<f32>,
}

fn plane_of(here: Here, turn: vec2<f32>) -> Plane {
    // The normal's component along the slice, and its component perpendicular to the slice's plane.
    let across = here.normal.y * turn.x + here.normal.z * turn.y;
    let off = here.normal.z * turn.x - here.normal.y * turn.y;
    let squared = across * across + here.normal.x * here.normal.x;
    let shear = vec2<f32>(across, here.normal.x) * (off / squared);
    return Plane(
        vec2<f32>(here.normal.x, across),
        squared,
        into_plane(here.right, turn, shear),
        into_plane(here.down, turn, shear),
//#if PERSPECTIVE
        vec2<f32>(0.0, here.sight.x),
//#else
        into_plane(here.sight, turn, shear),
//#endif
    );
}

fn into_plane(step: vec3<f32>, turn: vec2<f32>, shear: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(step.y * turn.x + step.z * turn.y, step.x) + shear * (step.z * turn.x - step.y * turn.y);
}

// The position seen at a depth: its distance along one side of the slice (x, above 0 on that side) and towards the eye (y).
fn in_plane(here: Here, plane: Plane, found: Found, depth: f32, towards: f32) -> vec2<f32> {
    let aside = aside(here, found);
//#if PERSPECTIVE
    // The pixel's own position is at a distance of `eye` from the eye.
    let x = depth * (towards * (aside.x * plane.right.x + aside.y * plane.down.x));
    return vec2<f32>(x, fma(depth, fma(aside.x, plane.right.y, fma(aside.y, plane.down.y, plane.sight.y)), here.eye));
//#else
    let moved = aside.x * plane.right + aside.y * plane.down + (depth - here.depth) * plane.sight;
    return vec2<f32>(towards * moved.x, moved.y);
//#endif
}

fn open(pixel: vec2<u32>, depth: f32, normal: vec3<f32>) -> f32 {
    let here = here_at(pixel, depth, normal);
    let bits = occlusion_bits(pixel, params.seed);
    let steps = f32(params.steps);
    var turn = first_turn(bits.x);
    var seeds = bits.zw;
    var taken = 0.0;
    var whole = 0.0;
//#if BITMASK
    let jitter = unit(bits.y);
//#endif
    for (var index = 0u; index < params.slices; index++) {
        let slice = slice_of(here, turn);
        let plane = plane_of(here, turn);
        turn = turned(turn);
        let first = fraction(seeds) * params.interval;
        seeds += vec2<u32>(JITTER_1, JITTER_2);
        // If the slice does not count, the normal is almost perpendicular to its plane.
        let counts = plane.squared >= LEAST_WEIGHT;
        let tilt = tilt_of(plane);
        let all = plane.normal.x + tilt * plane.normal.y;
        whole += select(0.0, all, counts);
        if !(slice.pixel < params.radius && counts) {
            continue;
        }
        // Both sides go from one pixel away to the end of the radius.
        let span = pixels_to(here, slice, vec2<f32>(params.radius, -params.radius)) - 1.0;
//#if BITMASK
        let sectors = sectors_of(plane, tilt, all, fract(jitter + f32(index) * params.per_slice));
        var shut = 0u;
        for (var step = 0.0; step < steps; step += 1.0) {
            let pixels = reaches(span, fma(vec2<f32>(step), vec2<f32>(params.interval), first));
            let right = look(here, slice, pixels.x);
            let left = look(here, slice, -pixels.y);
            shut |= shut_by(sectors, 1.0, plane, here, right) | shut_by(sectors, -1.0, plane, here, left);
        }
        taken += all * f32(countOneBits(shut)) * (1.0 / SECTORS);
//#else
        // The two horizons; both start at the tangent plane.
        let start = vec2<f32>(-plane.normal.y, plane.normal.y) / plane.normal.x;
        var horizons = start;
        // Two steps at a time, so that four reads are in flight.
        var step = 0.0;
        if (params.steps & 1u) == 1u {
            let pixels = reaches(span, first);
            let right = look(here, slice, pixels.x);
            let left = look(here, slice, -pixels.y);
            let seen = vec2<f32>(textureLoad(depths, right.pixel, 0).x, textureLoad(depths, left.pixel, 0).x);
            horizons = both_raised(horizons, here, plane, right, left, seen);
            step = 1.0;
        }
        for (; step < steps; step += 2.0) {
            let share = fma(vec2<f32>(step), vec2<f32>(params.interval), first);
            let near = reaches(span, share);
            let far = reaches(span, share + params.interval);
            let right = look(here, slice, near.x);
            let left = look(here, slice, -near.y);
            let far_right = look(here, slice, far.x);
            let far_left = look(here, slice, -far.y);
            let seen = vec2<f32>(textureLoad(depths, right.pixel, 0).x, textureLoad(depths, left.pixel, 0).x);
            let beyond = vec2<f32>(textureLoad(depths, far_right.pixel, 0).x, textureLoad(depths, far_left.pixel, 0).x);
            horizons = both_raised(horizons, here, plane, right, left, seen);
            horizons = both_raised(horizons, here, plane, far_right, far_left, beyond);
        }
        if any(horizons != start) {
            taken += lost(plane, horizons);
        }
//#endif
    }
    if whole > 0.0 {
        return clamp(1.0 - taken / whole, 0.0, 1.0);
    }
    return 1.0;
}

// Distances in pixels of a step on both sides, from its share of the span. Steps are denser near the pixel.
fn reaches(span: vec2<f32>, share: vec2<f32>) -> vec2<f32> {
    return fma(span, share * share, vec2<f32>(1.0));
}

// The angle of the projected normal from the direction to the eye, as twice its half: `tan(g / 2) = sin g / (1 + cos g)`.
fn tilt_of(plane: Plane) -> f32 {
    let half = plane.normal.y / (plane.normal.x + sqrt(plane.squared));
    return 2.0 * arc_tangent(half);
}

//#if BITMASK
// How the contribution of a slice is divided into sectors: `raster::effects::occlusion::bitmask`.
struct Sectors {
    // Cosine and sine of the projected normal's angle.
    normal: vec2<f32>,
    // The contribution of the whole slice, without its weight.
    all: f32,
    // For each side, the contribution between the direction to the eye and the tangent plane.
    limit: vec2<f32>,
    jitter: f32,
}

fn sectors_of(plane: Plane, tilt: f32, all: f32, jitter: f32) -> Sectors {
    let scale = inverseSqrt(plane.squared);
    let normal = plane.normal * scale;
    let limit = 0.25 * (2.0 * normal.x + vec2<f32>(PI + 2.0 * tilt, 2.0 * tilt - PI) * normal.y);
    return Sectors(normal, all * scale, limit, jitter);
}

// A mask of the sectors that an occluder on one side of a slice covers.
fn shut_by(sectors: Sectors, towards: f32, plane: Plane, here: Here, found: Found) -> u32 {
    var depth = FAR;
    if found.inside {
        depth = textureLoad(depths, found.pixel, 0).x;
    }
    let front = in_plane(here, plane, found, depth, towards);
    let away = normalize(front - vec2<f32>(0.0, here.eye));
    // Distances at which the line through the occluder enters and leaves the disk of the radius.
    let middle = dot(front, away);
    let inside = middle * middle + (params.radius * params.radius - dot(front, front));
    let chord = sqrt(max(inside, 0.0));
    let first = max(-middle - chord, 0.0);
    let last = min(chord - middle, params.thickness);
    // Moving the occluder into the plane may bring a near pixel to the other side.
    if !(front.x > 0.0 && inside > 0.0 && last > first) {
        return 0u;
    }
    let parts = vec2<f32>(part(sectors, towards, front + first * away), part(sectors, towards, front + last * away));
    return below(max(parts.x, parts.y)) & ~below(min(parts.x, parts.y));
}

// The number of sectors whose tested angle lies before a direction on one side; the caller truncates it.
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
// Both horizons of a slice, raised to the positions seen at these depths.
fn both_raised(
    horizons: vec2<f32>,
    here: Here,
    plane: Plane,
    right: Found,
    left: Found,
    seen: vec2<f32>,
) -> vec2<f32> {
    return max(horizons, vec2<f32>(horizon(here, plane, right, seen.x, 1.0), horizon(here, plane, left, seen.y, -1.0)));
}

// The cotangent of the angle between the direction to the eye and the position seen; `-FAR` where nothing is seen within the radius. Outside
// the picture, any depth may be passed.
fn horizon(here: Here, plane: Plane, found: Found, depth: f32, towards: f32) -> f32 {
    let front = in_plane(here, plane, found, depth, towards);
    // Moving the position into the plane may bring a near pixel to the other side. For the pixel itself all differences are 0.
    let counts = found.inside && front.x > 0.0 && dot(front, front) <= params.radius * params.radius;
    return select(-FAR, front.y / front.x, counts);
}

// The share that two horizons occlude, with the slice's weight. On each side this is `(cos g sin^2 d + sin g (d - sin d cos d)) / 2`, where `d`
// is the angle between the tangent plane and the horizon. It equals `(cos g - cos(2h - g) + 2h sin g) / 4` at the tangent plane less that at `h`.
fn lost(plane: Plane, horizons: vec2<f32>) -> f32 {
    // Sines and cosines of both angles, times a length.
    let up = fma(horizons, vec2<f32>(plane.normal.x), vec2<f32>(plane.normal.y, -plane.normal.y));
    let along = fma(horizons, vec2<f32>(-plane.normal.y, plane.normal.y), vec2<f32>(plane.normal.x));
    let scaled = up / (up * up + along * along);
    // The difference of the angles needs only one arc tangent.
    let difference = direction(up.x * along.y - along.x * up.y, along.x * along.y + up.x * up.y);
    let products = scaled * along;
    return 0.5 * (plane.normal.x * dot(scaled, up) + plane.normal.y * (difference - (products.x - products.y)));
}

// The angle of the direction `(x, y)`, -π..π.
fn direction(y: f32, x: f32) -> f32 {
    let sides = abs(vec2<f32>(x, y));
    let within = arc_tangent(min(sides.x, sides.y) / max(sides.x, sides.y));
    let quarter = select(within, 0.5 * PI - within, sides.y > sides.x);
    let half = select(quarter, PI - quarter, x < 0.0);
    return select(half, -half, y < 0.0);
}
//#endif

// The arc tangent of -1..1, by the odd polynomial of degree 11 with the least greatest error: 1.7e-6. A device's own function may be off by
// 4096 units in the last place (Vulkan 1.3, "Precision and Operation of SPIR-V Instructions").
fn arc_tangent(q: f32) -> f32 {
    let qq = q * q;
    var sum = -0.011719135;
    sum = fma(sum, qq, 0.05264735);
    sum = fma(sum, qq, -0.11642648);
    sum = fma(sum, qq, 0.19354038);
    sum = fma(sum, qq, -0.33262283);
    return q * fma(sum, qq, 0.99997722);
}

//#if BITMASK
// The angle of a direction from the second axis, 0..π, then cosine and sine of twice that angle; the first component is not below 0.
fn angle(direction: vec2<f32>) -> vec3<f32> {
    let height = abs(direction.y);
    let steep = height >= direction.x;
    let q = select(height / direction.x, direction.x / height, steep);
    let qq = q * q;
    let within = arc_tangent(q);
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
//#endif
//#else
fn open(pixel: vec2<u32>, depth: f32, normal: vec3<f32>) -> f32 {
    let here = here_at(pixel, depth, normal);
    let bits = occlusion_bits(pixel, params.seed);
    let camera = params.camera;
    let corner = params.corner.xyz + f32(pixel.x) * camera.right.xyz + f32(pixel.y) * camera.down.xyz;
//#if PERSPECTIVE
    let position = abs(camera.origin.xyz + depth * corner);
//#else
    let position = abs(camera.origin.xyz + corner + depth * params.sight.xyz);
//#endif
    let largest = max(position.x, max(position.y, position.z));
    let tolerance = max(DEPTH_TOLERANCE * params.radius, 4.0 * EPSILON * largest);
    // Heights above the tangent plane of the steps to the next column, row and depth.
    let heights = vec3<f32>(dot(here.right, here.normal), dot(here.down, here.normal), dot(here.sight, here.normal));
    var turn = first_turn(bits.x);
    var seeds = bits.zw;
    var occluded = 0u;
    var samples = 0u;
    for (var index = 0u; index < params.slices; index++) {
        let slice = slice_of(here, turn);
        turn = turned(turn);
        let jitter = fraction(seeds);
        seeds += vec2<u32>(JITTER_1, JITTER_2);
        for (var step = 0u; step < params.steps; step++) {
            let reach = vec2<f32>(params.radius, -params.radius) * sqrt((f32(step) + jitter) * params.interval);
            let pixels = pixels_to(here, slice, reach) * vec2<f32>(1.0, -1.0);
            for (var side = 0u; side < 2u; side++) {
                let found = look(here, slice, select(pixels.x, pixels.y, side == 1u));
                let aside = aside(here, found);
                if !found.inside || all(aside == vec2<f32>(0.0)) {
                    continue;
                }
                samples += 1u;
                let other = textureLoad(depths, found.pixel, 0).x;
                let height = dot(vec3<f32>(aside * to_w(other), other - here.depth), heights);
                occluded += u32(other < FAR && height > tolerance);
            }
        }
    }
    return 1.0 - f32(occluded) / f32(max(samples, 1u));
}
//#endif

// Sine and cosine of `share * π`, for `share` in 0..1, by the series around π / 2; error below 3e-7. A device's own functions may be off by
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

// `x`, from 0 to 1, raised to a power of at least 0.
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

// `sampling::hash::occlusion_bits`.
fn occlusion_bits(pixel: vec2<u32>, seed: u32) -> vec4<u32> {
    return pcg4d(vec4<u32>(pixel, seed, HASH_OCCLUSION));
}

// `sampling::hash::unit`.
fn unit(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

// `sampling::hash::fraction`: the 23 high bits as numbers in [0, 1). It avoids converting integers, which is slow on devices.
fn fraction(bits: vec2<u32>) -> vec2<f32> {
    return bitcast<vec2<f32>>((bits >> vec2<u32>(9u)) | vec2<u32>(0x3f800000u)) - 1.0;
}
