// Fills a quad over a window, as floats or as the codes that are displayed. Pixels are bit patterns, and the arithmetic on
// them is in integers. So the results equal the processor's, however a driver treats subnormal numbers and fused
// multiplications. Only the tone curve is computed in floats.

struct Params {
    width: u32,
    // The first row of this launch, and its number of rows.
    first_row: u32,
    rows: u32,
    unused: u32,
    // Formats of the colour and of the factor; the second is NO_FACTOR if there is no factor.
    formats: vec2u,
    // Whether codes are written, and whether pixels are linear radiance.
    codes: u32,
    linear: u32,
    // The bits of 2 to the power of the exposure, and whether there is a tone curve.
    exposure: u32,
    tone: u32,
}

const STEPS: u32 = 255u;
// Offsets of the parts of the tables.
const CODE_STEPS: u32 = 0u;
const BYTE_STEPS: u32 = 256u;
const BYTES: u32 = 512u;
const ALPHA_STEPS: u32 = 768u;
// Format number for a quad without a factor.
const NO_FACTOR: u32 = 99u;

const INFINITE: u32 = 0x7f800000u;
const QUIET: u32 = 0x00400000u;
const NO_NUMBER: u32 = 0x7fc00000u;
const ONE: u32 = 0x3f800000u;
// The limit of Reinhard's curve for large luminances.
const SIXTEENTH: u32 = 0x3d800000u;

@group(0) @binding(0) var<uniform> params: Params;
// Bindings 1 and 2 are the colour and the factor: quads.rs writes their declarations, and load_color and load_factor, for textures or
// buffers.
@group(0) @binding(3) var<storage, read> tables: array<u32>;
@group(0) @binding(4) var<storage, read_write> pixels: array<u32>;
// The number of pixels that are not finite, and whether any pixel's colour differs from the first one's.
@group(0) @binding(5) var<storage, read_write> found: array<atomic<u32>, 2>;

var<workgroup> first: vec4u;

fn magnitude(x: u32) -> u32 {
    return x & 0x7fffffffu;
}

fn is_nan(x: u32) -> bool {
    return magnitude(x) > INFINITE;
}

// The number of steps of the table that are at most `x`; 0 if `x` is NaN or below 0.
fn count(table: u32, x: u32) -> u32 {
    if (x >> 31u) != 0u || is_nan(x) {
        return 0u;
    }
    var low = 0u;
    var high = STEPS;
    while low < high {
        let middle = (low + high) / 2u;
        if tables[table + middle] <= x {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Rounds to the nearest multiple of 1/255. NaN and -0 stay.
fn to_byte(x: u32) -> u32 {
    if is_nan(x) || x == 0x80000000u {
        return x;
    }
    return tables[BYTES + count(BYTE_STEPS, x)];
}

// Shifts right by at least 1, and rounds to nearest, ties to even. `rest` tells whether bits below the lowest are set.
fn round_shift(x: u32, shift: u32, rest: bool) -> u32 {
    if shift > 25u {
        return 0u;
    }
    let kept = x >> shift;
    let below = x & ((1u << shift) - 1u);
    let half = 1u << (shift - 1u);
    return kept + u32(below > half || (below == half && (rest || (kept & 1u) == 1u)));
}

// The nearest 16-bit float, ties to even.
fn to_half(x: u32) -> u32 {
    let sign = x & 0x80000000u;
    let size = magnitude(x);
    if size > INFINITE {
        return x | QUIET;
    }
    if size >= 0x477ff000u {
        return sign | INFINITE;
    }
    if size >= 0x38800000u {
        return sign | (round_shift(size, 13u, false) << 13u);
    }
    // Subnormal result, in units of 2^-24.
    let exponent = size >> 23u;
    let units = round_shift((size & 0x7fffffu) | 0x800000u, 126u - exponent, false);
    if exponent == 0u || units == 0u {
        return sign;
    }
    let top = firstLeadingBit(units);
    return sign | ((top + 103u) << 23u) | ((units << (23u - top)) & 0x7fffffu);
}

fn stored(pixel: vec4u, format: u32) -> vec4u {
    switch format {
        case 1u: {
            return vec4u(to_half(pixel.x), to_half(pixel.y), to_half(pixel.z), to_half(pixel.w));
        }
        case 2u: {
            return vec4u(to_byte(pixel.x), to_byte(pixel.y), to_byte(pixel.z), to_byte(pixel.w));
        }
        case 3u: {
            return vec4u(to_byte(pixel.x), 0u, 0u, ONE);
        }
        case 4u: {
            return vec4u(pixel.x, 0u, 0u, ONE);
        }
        case 5u: {
            return vec4u(pixel.x, pixel.y, 0u, ONE);
        }
        default: {
            return pixel;
        }
    }
}

// A non-zero number as an integer of 24 bits, whose highest bit is set, times 2 to the power of (the second
// component - 150).
fn parts(size: u32) -> vec2i {
    let fraction = size & 0x7fffffu;
    if size >= 0x800000u {
        return vec2i(i32(fraction | 0x800000u), i32(size >> 23u));
    }
    let shift = countLeadingZeros(fraction) - 8u;
    return vec2i(i32(fraction << shift), 1 - i32(shift));
}

// The IEEE 754 product, rounded to nearest, ties to even.
fn product(x: u32, y: u32) -> u32 {
    let a = magnitude(x);
    let b = magnitude(y);
    let sign = (x ^ y) & 0x80000000u;
    if a > INFINITE || b > INFINITE {
        return select(y, x, a > INFINITE) | QUIET;
    }
    if a == INFINITE || b == INFINITE {
        return select(sign | INFINITE, NO_NUMBER, a == 0u || b == 0u);
    }
    if a == 0u || b == 0u {
        return sign;
    }
    let p = parts(a);
    let q = parts(b);
    // The product of two 24-bit integers, from halves of 12 bits.
    let ph = u32(p.x) >> 12u;
    let pl = u32(p.x) & 0xfffu;
    let qh = u32(q.x) >> 12u;
    let ql = u32(q.x) & 0xfffu;
    let middle = ph * ql + pl * qh;
    let lower = pl * ql + ((middle & 0xfffu) << 12u);
    var high = ph * qh + (middle >> 12u) + (lower >> 24u);
    var low = lower & 0xffffffu;
    var exponent = p.y + q.y - 126;
    if high < 0x800000u {
        high = (high << 1u) | (low >> 23u);
        low = (low << 1u) & 0xffffffu;
        exponent -= 1;
    }
    if exponent < 1 {
        return sign | round_shift(high, u32(1 - exponent), low != 0u);
    }
    let up = u32(low > 0x800000u || (low == 0x800000u && (high & 1u) == 1u));
    if exponent > 254 {
        return sign | INFINITE;
    }
    // The carry goes into the exponent, and from the greatest float to infinity.
    return sign | ((u32(exponent) << 23u) + (high - 0x800000u) + up);
}

fn shown(at: vec2u) -> vec4u {
    let color = stored(load_color(at), params.formats.x);
    if params.formats.y == NO_FACTOR {
        return color;
    }
    let factor = stored(load_factor(at), params.formats.y).x;
    return vec4u(product(color.x, factor), product(color.y, factor), product(color.z, factor), product(color.w, factor));
}

// The factor of Reinhard's curve: `Tone` of the crate `curitiba-pipeline`.
fn tone_scale(color: vec3u) -> u32 {
    let weighted = vec3u(
        product(color.x, bitcast<u32>(0.2126f)),
        product(color.y, bitcast<u32>(0.7152f)),
        product(color.z, bitcast<u32>(0.0722f)),
    );
    let sizes = vec3u(magnitude(weighted.x), magnitude(weighted.y), magnitude(weighted.z));
    let infinite = sizes == vec3u(INFINITE);
    let negative = (weighted >> vec3u(31u)) == vec3u(1u);
    let opposite = any(infinite & negative) && any(infinite & !negative);
    if any(sizes > vec3u(INFINITE)) || opposite {
        // The maximum of 0 and NaN is 0, whose factor is 1.
        return ONE;
    }
    if any(infinite) {
        return select(SIXTEENTH, ONE, any(infinite & negative));
    }
    let parts = bitcast<vec3f>(weighted);
    let luminance = max(parts.x + parts.y + parts.z, 0.0);
    if magnitude(bitcast<u32>(luminance)) >= INFINITE {
        return SIXTEENTH;
    }
    // Above 2^30 the factor is 1/16 to the last bit, so a bound of 2^40 changes nothing. The bound is needed because a driver
    // need not divide correctly by numbers above 2^126.
    let bounded = min(luminance, 1099511627776.0);
    return bitcast<u32>(1.0 / (1.0 + bounded) + bounded / (1.0 + bounded) / 16.0);
}

fn code(pixel: vec4u) -> u32 {
    var color = pixel.xyz;
    if params.linear != 0u {
        color = vec3u(
            product(color.x, params.exposure),
            product(color.y, params.exposure),
            product(color.z, params.exposure),
        );
        if params.tone != 0u {
            let scale = tone_scale(color);
            color = vec3u(product(color.x, scale), product(color.y, scale), product(color.z, scale));
        }
    }
    let red = count(CODE_STEPS, color.x);
    let green = count(CODE_STEPS, color.y);
    let blue = count(CODE_STEPS, color.z);
    return red | (green << 8u) | (blue << 16u) | (alpha(pixel.w) << 24u);
}

// Alpha is stored as any value is in PNG files.
fn alpha(x: u32) -> u32 {
    return count(ALPHA_STEPS, x);
}

fn differ(a: u32, b: u32) -> bool {
    return is_nan(a) || is_nan(b) || (a != b && (magnitude(a) | magnitude(b)) != 0u);
}

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        first = shown(vec2u(0u));
    }
    workgroupBarrier();
    if id.x >= params.width || id.y >= params.rows {
        return;
    }
    let at = vec2u(id.x, params.first_row + id.y);
    let pixel = shown(at);
    let sizes = vec4u(magnitude(pixel.x), magnitude(pixel.y), magnitude(pixel.z), magnitude(pixel.w));
    if any(sizes >= vec4u(INFINITE)) {
        atomicAdd(&found[0], 1u);
    }
    let is_first = at.x == 0u && at.y == 0u;
    if !is_first && (differ(pixel.x, first.x) || differ(pixel.y, first.y) || differ(pixel.z, first.z)) {
        atomicStore(&found[1], 1u);
    }
    let place = id.y * params.width + id.x;
    if params.codes != 0u {
        pixels[place] = code(pixel);
        return;
    }
    pixels[4u * place] = pixel.x;
    pixels[4u * place + 1u] = pixel.y;
    pixels[4u * place + 2u] = pixel.z;
    pixels[4u * place + 3u] = pixel.w;
}
