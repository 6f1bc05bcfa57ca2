// One level of the edge-avoiding filter of ambient occlusion: `raster::effects::filter`.

struct Params {
    // Distance between neighbouring taps, in pixels.
    step: i32,
    // Exponent of the result.
    exponent: f32,
}

@group(1) @binding(3) var shares: texture_2d<f32>;

struct Surface {
    position: vec3<f32>,
    normal: vec3<f32>,
    // False where the pixel has no surface.
    shown: bool,
}

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let own = textureLoad(shares, pixel, 0).x;
    let here = surface_at(pixel);
    if !here.shown {
        return vec4<f32>(vec3<f32>(power(own, params.exponent)), 1.0);
    }
    var sum = 0.0;
    var weight = SPLINE_0 * SPLINE_0;
    for (var down = -2; down <= 2; down++) {
        for (var across = -2; across <= 2; across++) {
            let at = vec2<i32>(pixel) + params.step * vec2<i32>(across, down);
            if any(at < vec2<i32>(0)) || any(at >= vec2<i32>(frame.size)) || (down == 0 && across == 0) {
                continue;
            }
            let there = surface_at(vec2<u32>(at));
            if !there.shown {
                continue;
            }
            let away = there.position - here.position;
            let cosine = dot(here.normal, there.normal);
            let aside = max(abs(dot(away, here.normal)), abs(dot(away, there.normal)));
            let alongside = 1.0 - aside * aside / (MOST_OFF * MOST_OFF * dot(away, away));
            if !(alongside > 0.0) || cosine <= LEAST_NORMALS {
                continue;
            }
            let alike = (cosine - LEAST_NORMALS) / (1.0 - LEAST_NORMALS);
            let squared = alike * alike;
            let w = spline(down) * spline(across) * squared * squared * squared * squared * alongside * alongside;
            sum += w * (textureLoad(shares, at, 0).x - own);
            weight += w;
        }
    }
    return vec4<f32>(vec3<f32>(power(own + sum / weight, params.exponent)), 1.0);
}

fn surface_at(pixel: vec2<u32>) -> Surface {
    let position = textureLoad(position_buffer, pixel, 0).xyz;
    let normal = textureLoad(normal_buffer, pixel, 0).xyz;
    let length_ = length(normal);
    let shown = length_ > 0.0 && length_ < LARGEST && all(abs(position) < vec3<f32>(LARGEST));
    return Surface(position, normal / select(1.0, length_, shown), shown);
}

// Weights of the cubic B-spline.
fn spline(place: i32) -> f32 {
    let outer = select(SPLINE_2, SPLINE_1, abs(place) == 1);
    return select(outer, SPLINE_0, place == 0);
}

// `x` in 0..1 to a power of at least 0.
fn power(x: f32, exponent: f32) -> f32 {
    if exponent == 0.0 || x >= 1.0 {
        return 1.0;
    }
    if exponent == 1.0 {
        return max(x, 0.0);
    }
    return select(0.0, pow(x, exponent), x > 0.0);
}
