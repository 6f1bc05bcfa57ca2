// Shadows of a directional light from cascaded depth maps: `raster::effects::{cascades, shadow}`. Names of `//#if`:
//   SOFT     the light is a disc: `raster::effects::soft`
//   BORDER   pixels whose tests differ are left to rays; not with SOFT

struct Cascade {
    // World to texel matrix: x right and y down from the top left corner of the map, and z the depth.
    map_from_world: mat4x4<f32>,
    // Depth bias for a slope of 1.
    slope_bias: f32,
    // Constant depth bias, for rounding.
    rounding_bias: f32,
    // With a disc, the depth bias for a slope of 1, for each texel of distance.
    texel_bias: f32,
    // Radius of the disc in texels, for an occluder that is nearer to the light by a depth of 1.
    spread: f32,
    // Greatest radius of a search, in texels.
    aside: f32,
}

struct Params {
    // The cascades, from near to far.
    cascades: array<Cascade, MAX_CASCADES>,
    // 0 where nothing can cast a shadow; there is no map then.
    count: u32,
    // Texels along a side of each map.
    map_size: i32,
    // Texels that a test averages on each side of the middle one.
    reach: i32,
    // Taps of the unit disk: offset to the right and down from the centre, distance from it, and weight.
    search: array<vec4<f32>, SEARCH_TAPS>,
    filter_taps: array<vec4<f32>, FILTER_TAPS>,
}

@group(1) @binding(3) var shadow_maps: texture_depth_2d_array;

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let position = textureLoad(position_buffer, pixel, 0);
    if params.count == 0u || !(position.w > 0.0) {
        return vec4<f32>(1.0);
    }
    let share = lit_share(position.xyz, position.w);
//#if BORDER
    if share < 0.0 {
        return vec4<f32>(vec3<f32>(1.0), LEFT);
    }
//#endif
    return vec4<f32>(vec3<f32>(SHADOWED + (1.0 - SHADOWED) * share), 1.0);
}

// The share of the light, 0 to 1. With BORDER, 0 or 1 where the tests of all texels agree, else -1.
fn lit_share(position: vec3<f32>, cosine: f32) -> f32 {
    // The first map that contains the whole filter; if none does, the last map.
//#if SOFT
    let least = f32(params.reach) + 0.5;
//#else
    let low = f32(params.reach + 1);
    let high = f32(params.map_size) - low;
//#endif
    var cascade = 0u;
    var place = vec3<f32>(0.0);
    for (; cascade < params.count; cascade++) {
        place = (params.cascades[cascade].map_from_world * vec4<f32>(position, 1.0)).xyz;
//#if SOFT
        let low = least + 0.5 + search_radius(cascade, place.z);
        let high = f32(params.map_size) - low;
//#endif
        if all(place.xy >= vec2<f32>(low)) && all(place.xy <= vec2<f32>(high)) {
            break;
        }
    }
//#if BORDER
    if cascade == params.count || !(abs(place.z) < LARGEST) {
        return -1.0;
    }
//#endif
    cascade = min(cascade, params.count - 1u);
    let at = place.xy - 0.5;
    // The negated comparisons are also true for a NaN.
    if !(all(abs(at) < vec2<f32>(1e6)) && abs(place.z) < LARGEST) {
        return 1.0;
    }
    let cos = min(cosine, 1.0);
    let slope = min(sqrt(1.0 - cos * cos) / cos, MAX_SLOPE);
//#if SOFT
    let bias = params.cascades[cascade].slope_bias * slope + params.cascades[cascade].rounding_bias;
    let texel_bias = params.cascades[cascade].texel_bias * slope;
    let spread = params.cascades[cascade].spread;
    let search = search_radius(cascade, place.z) + least;
    var sum = 0.0;
    var weight = 0.0;
    for (var index = 0u; index < SEARCH_TAPS; index++) {
        let tap = params.search[index];
        let radius = tap.z * search;
        let ahead = stored_depth(vec2<i32>(floor(at + tap.xy * search + 0.5)), cascade) - place.z;
        // The texel counts if it is in the cone from the position to the disc.
        if ahead > bias + radius * texel_bias && radius <= ahead * spread + least {
            sum += tap.w * ahead;
            weight += tap.w;
        }
    }
    if weight == 0.0 {
        return 1.0;
    }
    let kernel = clamp(sum / weight * spread, least, search);
    var lit = 0.0;
    for (var index = 0u; index < FILTER_TAPS; index++) {
        let tap = params.filter_taps[index];
        lit += tap.w * between(at + tap.xy * kernel, place.z + (bias + tap.z * kernel * texel_bias), cascade);
    }
    return min(lit, 1.0);
}

// Radius in texels within which an occluder may hide the disc from a place of this depth.
fn search_radius(cascade: u32, depth: f32) -> f32 {
    return min(params.cascades[cascade].spread * clamp(1.0 - depth, 0.0, 1.0), params.cascades[cascade].aside);
}

// A shadow test, interpolated between the four texels around a place; the centre of the first texel is at 0.
fn between(at: vec2<f32>, depth: f32, cascade: u32) -> f32 {
    let corner = floor(at);
    let share = at - corner;
    let texel = vec2<i32>(corner);
    var lit = vec4<f32>(0.0);
    for (var index = 0; index < 4; index++) {
        if depth >= stored_depth(texel + vec2<i32>(index & 1, index >> 1u), cascade) {
            lit[index] = 1.0;
        }
    }
    let rows = lit.xz * (1.0 - share.x) + lit.yw * share.x;
    return rows.x * (1.0 - share.y) + rows.y * share.y;
}

fn stored_depth(texel: vec2<i32>, cascade: u32) -> f32 {
    // Texels outside the map are empty: farther than the far plane.
    if any(texel < vec2<i32>(0)) || any(texel >= vec2<i32>(params.map_size)) {
        return -1e9;
    }
    return textureLoad(shadow_maps, texel, cascade, 0);
}
//#else
    let depth = place.z + (params.cascades[cascade].slope_bias * slope + params.cascades[cascade].rounding_bias);
    let corner = floor(at);
    let last_share = at - corner;
    let first = vec2<i32>(corner) - params.reach;
    let width = 2 * params.reach + 2;
//#if BORDER
    // The map covers the place, so all texels of the filter are inside the map.
    let is_lit = depth >= textureLoad(shadow_maps, first, cascade, 0);
    for (var row = 0; row < width; row++) {
        for (var column = 0; column < width; column++) {
            if (depth >= textureLoad(shadow_maps, first + vec2<i32>(column, row), cascade, 0)) != is_lit {
                return -1.0;
            }
        }
    }
    return select(0.0, 1.0, is_lit);
}
//#else
    var lit = 0.0;
    for (var row = 0; row < width; row++) {
        var lit_in_row = 0.0;
        for (var column = 0; column < width; column++) {
            let texel = first + vec2<i32>(column, row);
            let inside = all(texel >= vec2<i32>(0)) && all(texel < vec2<i32>(params.map_size));
            // Texels outside the map are empty: farther than the far plane.
            var stored = -1e9;
            if inside {
                stored = textureLoad(shadow_maps, texel, cascade, 0);
            }
            if depth >= stored {
                lit_in_row += weight(column, width, last_share.x);
            }
        }
        lit += lit_in_row * weight(row, width, last_share.y);
    }
    let side = f32(2 * params.reach + 1);
    return min(lit / (side * side), 1.0);
}

// The part of a texel that the filter's square covers along one of its axes.
fn weight(index: i32, width: i32, last_share: f32) -> f32 {
    if index == 0 {
        return 1.0 - last_share;
    }
    return select(1.0, last_share, index + 1 == width);
}
//#endif
//#endif
