// One level of the edge-avoiding filter of ambient occlusion and ray passes: `raster::effects::filter`.

struct Params {
    // Distance of neighbouring taps in pixels, as a power of 2.
    level: u32,
    // Exponent that is applied to the averages: 1 in all levels but the last.
    exponent: f32,
}

@group(1) @binding(3) var shares: texture_2d<f32>;

// Pixels along a side of the tile that a workgroup reads: its own pixels, and two more on each side.
const TILE = GROUP + 4u;

// For each pixel of the tile: position and share.
var<workgroup> places: array<vec4<f32>, TILE * TILE>;
// For each pixel of the tile: unit normal, and 1 where there is a surface, else 0.
var<workgroup> surfaces: array<vec4<f32>, TILE * TILE>;

// The pixels of a workgroup are `step` apart, as the taps are, so that the workgroup reads each pixel of its tile once. The pixels between
// them belong to the other workgroups of a square of `step` times `step` workgroups.
@compute @workgroup_size(GROUP, GROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    let step = 1u << params.level;
    let square = (group.xy >> vec2<u32>(params.level)) * (GROUP * step);
    let corner = vec2<i32>(square + (group.xy & vec2<u32>(step - 1u)) + vec2<u32>(0u, frame.first_row)) - 2 * i32(step);
    for (var at = index; at < TILE * TILE; at += GROUP * GROUP) {
        load(at, corner + i32(step) * vec2<i32>(vec2<u32>(at % TILE, at / TILE)));
    }
    workgroupBarrier();
    let pixel = corner + i32(step) * vec2<i32>(local.xy + 2u);
    if all(pixel < vec2<i32>(frame.size)) {
        let share = power(filtered((local.y + 2u) * TILE + local.x + 2u), params.exponent);
        textureStore(output, pixel, vec4<f32>(vec3<f32>(share), 1.0));
    }
}

// Reads a pixel into a place of the tile. Beyond the picture there is no surface.
fn load(at: u32, pixel: vec2<i32>) {
    var place = vec4<f32>(0.0);
    var surface = vec4<f32>(0.0);
    if all(pixel >= vec2<i32>(0)) && all(pixel < vec2<i32>(frame.size)) {
        let position = textureLoad(position_buffer, pixel, 0).xyz;
        let normal = textureLoad(normal_buffer, pixel, 0).xyz;
        let squared = dot(normal, normal);
        let shown = squared > 0.0 && squared < LARGEST && all(abs(position) < vec3<f32>(LARGEST));
        place = vec4<f32>(select(vec3<f32>(0.0), position, shown), textureLoad(shares, pixel, 0).x);
        surface = select(vec4<f32>(0.0), vec4<f32>(normal * inverseSqrt(squared), 1.0), shown);
    }
    places[at] = place;
    surfaces[at] = surface;
}

// The average around a pixel of the tile.
fn filtered(middle: u32) -> f32 {
    let here = places[middle];
    let surface = surfaces[middle];
    if surface.w == 0.0 {
        return here.w;
    }
    let above = row(here, surface, middle - 2u * TILE, SPLINE_2) + row(here, surface, middle - TILE, SPLINE_1);
    let below = row(here, surface, middle + TILE, SPLINE_1) + row(here, surface, middle + 2u * TILE, SPLINE_2);
    let sums = above + row(here, surface, middle, SPLINE_0) + below;
    return here.w + sums.x / (sums.y + SPLINE_0 * SPLINE_0);
}

// Sums over the taps of a row around a pixel of the tile: the weighted differences from `here`, and the weights. The taps are written out,
// so that no compiler leaves them in a loop.
fn row(here: vec4<f32>, surface: vec4<f32>, at: u32, spline: f32) -> vec2<f32> {
    return SPLINE_2 * spline * (tap(here, surface, at - 2u) + tap(here, surface, at + 2u))
        + SPLINE_1 * spline * (tap(here, surface, at - 1u) + tap(here, surface, at + 1u))
        + SPLINE_0 * spline * tap(here, surface, at);
}

// A tap: its weighted difference and its weight, which is high where it shows the same surface. For `here` itself the weight is 0.
fn tap(here: vec4<f32>, surface: vec4<f32>, at: u32) -> vec2<f32> {
    let there = places[at];
    let other = surfaces[at];
    let away = there.xyz - here.xyz;
    let distance_squared = dot(away, away);
    // Without a surface, the normal is 0.
    let alike = max((dot(surface.xyz, other.xyz) - LEAST_NORMALS) * (1.0 / (1.0 - LEAST_NORMALS)), 0.0);
    let aside = max(abs(dot(away, surface.xyz)), abs(dot(away, other.xyz)));
    let bound = max(MOST_OFF * MOST_OFF * distance_squared, SMALLEST);
    let alongside = max(1.0 - aside * aside / bound, 0.0);
    let squared = alike * alike;
    let root = squared * squared * alongside;
    let weight = select(0.0, root * root, distance_squared > 0.0);
    return vec2<f32>(weight * (there.w - here.w), weight);
}

// `x`, from 0 to 1, raised to a power of at least 0.
fn power(x: f32, exponent: f32) -> f32 {
    if exponent == 0.0 || x >= 1.0 {
        return 1.0;
    }
    if exponent == 1.0 {
        return max(x, 0.0);
    }
    return select(0.0, pow(x, exponent), x > 0.0);
}
