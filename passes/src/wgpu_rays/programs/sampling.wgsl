// Random numbers without state and directions of a hemisphere: the same integers and, step by step, the same floats as
// `passes/src/sampling`, which gives the source of each formula.

fn pcg4d(seed: vec4u) -> vec4u {
    var v = seed * 1664525u + vec4u(1013904223u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}
// The key of a pixel, by its place in the picture.
fn pixel_key(pixel: Pixel) -> u32 {
    return pcg4d(vec4u(pixel.x + params.origin_x, pixel.y + params.origin_y, params.seed, HASH_PIXEL)).w;
}
fn path_key(key: u32, branch: u32) -> u32 { return pcg4d(vec4u(key, branch, 0u, HASH_PATH)).w; }
fn dimensions(key: u32, counter: u32) -> vec2u { return pcg4d(vec4u(key, counter, 0u, HASH_DIMENSIONS)).zw; }
fn unit_of(bits: u32) -> f32 { return f32(bits >> 8u) * (1.0 / 16777216.0); }
fn scramble_reversed(word: u32, seed: u32) -> u32 {
    var v = word + seed;
    v ^= v * 0x6c50b47cu;
    v ^= v * 0xb82f1e52u;
    v ^= v * 0xc7afe638u;
    v ^= v * 0x8d22f6e6u;
    return reverseBits(v);
}

struct Basis { tangent: vec3f, bitangent: vec3f, normal: vec3f }
fn to_world(basis: Basis, v: vec3f) -> vec3f {
    return sep3(sep3(basis.tangent * v.x) + sep3(basis.bitangent * v.y)) + sep3(basis.normal * v.z);
}
fn basis_around(n: vec3f) -> Basis {
    let turned = with_sign(1.0, n.z);
    let a = -1.0 / (turned + n.z);
    let b = sep(n.x * n.y) * a;
    let tangent = vec3f(1.0 + sep(sep(sep(turned * n.x) * n.x) * a), turned * b, -turned * n.x);
    return Basis(tangent, vec3f(b, turned + sep(sep(n.y * n.y) * a), -n.y), n);
}

// Sine and cosine of angles up to π/4.
fn sin_cos_eighth(angle: f32) -> vec2f {
    let square = sep(angle * angle);
    let s = sep(sep(-1.9515296e-4 * square) + 8.332161e-3);
    let sine = sep(sep(sep(sep(s * square) - 1.6666655e-1) * square) * angle) + angle;
    let c = sep(sep(2.4433157e-5 * square) - 1.3887316e-3);
    let cosine = sep(sep(sep(sep(c * square) + 4.1666646e-2) * square) * square);
    return vec2f(sine, sep(cosine - sep(0.5 * square)) + 1.0);
}
fn concentric_disk(point: vec2f) -> vec2f {
    let x = 2.0 * point.x - 1.0; let y = 2.0 * point.y - 1.0;
    let upright = abs(x) > abs(y);
    let radius = select(y, x, upright); let other = select(x, y, upright);
    if radius == 0.0 { return vec2f(0.0); }
    let sc = sin_cos_eighth(sep(QUARTER_PI * sep(other / radius)));
    let along = sep(radius * sc.y); let across = sep(radius * sc.x);
    return select(vec2f(across, along), vec2f(along, across), upright);
}
const QUARTER_PI: f32 = 0.785398163397448309615660845819875721;
fn cosine_direction(point: vec2f) -> vec3f {
    let disk = concentric_disk(point);
    return vec3f(disk, sqrt(max(1.0 - (sep(disk.x * disk.x) + sep(disk.y * disk.y)), 0.0)));
}

// The report's noise and hemisphere, for thesis fidelity. Sines are taken in twice the precision and rounded once.

// Sine and cosine of any angle in a picture: a multiple of a quarter turn, in three words, is subtracted, and Taylor's series is evaluated
// for the rest, with its first terms in two words. The error before the final rounding is below 2⁻³².
fn wide_sine(x: Wide) -> f32 {
    let square = mul(x, x);
    let z = square.h;
    let rest = z * z * (8.3333333e-3 + z * (-1.9841270e-4 + z * (2.7557319e-6 - z * 2.5052108e-8)));
    let series = add(add(wide(1.0), minus(mul(square, Wide(0.1666666716337204, -4.967053879312289e-09)))), wide(rest));
    return mul(series, x).h;
}
fn wide_cosine(x: Wide) -> f32 {
    let square = mul(x, x);
    let z = square.h;
    let rest = z * z * z * (-1.3888889e-3 + z * (2.4801587e-5 + z * (-2.7557319e-7 + z * 2.0876757e-9)));
    let fourth = mul(mul(square, square), Wide(0.0416666679084301, -1.2417634698280722e-09));
    return add(add(add(wide(1.0), Wide(-0.5 * square.h, -0.5 * square.l)), fourth), wide(rest)).h;
}
// An angle minus `turns` quarter turns.
struct Reduced { angle: Wide, turns: i32 }
fn reduced(angle: f32) -> Reduced {
    let turns = round(sep(angle * 0.63661977));
    var x = add(wide(angle), minus(exact_product(turns, 1.5707963705062866)));
    x = add(x, minus(exact_product(turns, -4.371138828673793e-8)));
    x = add(x, minus(exact_product(turns, -1.7151245100058819e-15)));
    return Reduced(x, i32(turns));
}
// The sine of the angle plus `more` quarter turns.
fn sine_of(r: Reduced, more: i32) -> f32 {
    let quarter = (r.turns + more) & 3;
    var sine = 0.0;
    if (quarter & 1) == 0 { sine = wide_sine(r.angle); } else { sine = wide_cosine(r.angle); }
    return select(sine, -sine, quarter >= 2);
}
// NaN, in a form that no compiler recognises.
fn not_a_number() -> f32 { return bitcast<f32>(0x7fc00000u ^ params.zero); }
fn thesis_rand(x: f32, y: f32) -> f32 {
    let angle = sep(x * 12.9898) + sep(y * 78.233);
    // Above 2²⁴, the rounding of an angle is more than a turn.
    if !is_finite(angle) || abs(angle) > 16777216.0 { return not_a_number(); }
    // 43758.5453 in two words.
    let product = mul(wide(sine_of(reduced(sep(angle)), 0)), Wide(43758.546875, -0.0015750000020489097));
    return product.h - trunc(product.h);
}
fn thesis_stratum(p: vec3f, i: u32, j: u32, side: u32) -> vec2f {
    let a = f32(i + 1u); let b = f32(j + 1u);
    let rand1 = thesis_rand(sep(p.x * a), sep(p.y * b));
    let rand2 = thesis_rand(sep(p.x * b), sep(p.z * a));
    let rand3 = thesis_rand(sep(p.y * a), sep(p.z * b));
    let rand4 = thesis_rand(sep(rand1 * b), sep(rand2 * a));
    let rand5 = thesis_rand(sep(rand3 * a), sep(rand4 * b));
    let width = sep(1.0 / f32(side));
    return vec2f((f32(i) + rand5) * width, (f32(j) + rand4) * width);
}
fn thesis_cosine(point: vec2f) -> vec3f {
    let radius = sep(sqrt(point.x));
    if !(is_finite(point.x) && is_finite(point.y)) { return vec3f(not_a_number()); }
    let turn = reduced(sep(6.2831855 * point.y));
    let x = sep(radius * sine_of(turn, 1)); let y = sep(radius * sine_of(turn, 0));
    return vec3f(x, y, sqrt(max(sep(1.0 - sep(x * x)) - sep(y * y), 0.0)));
}
fn thesis_basis(n: vec3f) -> Basis {
    let b = select(vec3f(0.0, -n.z, n.y), vec3f(-n.y, n.x, 0.0), abs(n.x) > abs(n.z));
    let bitangent = sep3(b * length_recip(b));
    return Basis(cross3(bitangent, n), bitangent, n);
}
