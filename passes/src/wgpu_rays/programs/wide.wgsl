// Arithmetic that does not depend on how a driver rounds. WGSL rounds + - * correctly, but lets compilers fuse a product with a sum, and
// drivers may do so; some also reorder sums. A value that passes through `sep` is rounded separately, because compilers do not know that
// `params.zero` is 0.
fn sep(x: f32) -> f32 { return bitcast<f32>(bitcast<u32>(x) ^ params.zero); }
fn sep3(x: vec3f) -> vec3f { return bitcast<vec3f>(bitcast<vec3u>(x) ^ vec3u(params.zero)); }

// WGSL does not guarantee infinities or NaN, so values that are not finite are recognised by their bits.
fn is_finite(x: f32) -> bool { return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u; }
fn is_finite3(x: vec3f) -> bool { return is_finite(x.x) && is_finite(x.y) && is_finite(x.z); }
const HUGE: f32 = 3.0e38;

fn dot3(a: vec3f, b: vec3f) -> f32 { return sep(sep(a.x * b.x) + sep(a.y * b.y)) + sep(a.z * b.z); }
fn cross3(a: vec3f, b: vec3f) -> vec3f { return sep3(a.yzx * b.zxy) - sep3(b.yzx * a.zxy); }
fn most3(a: vec3f) -> f32 { return max(max(a.x, a.y), a.z); }
fn length_recip(a: vec3f) -> f32 { return 1.0 / sep(sqrt(dot3(a, a))); }
// The magnitude of a number with the sign of another; the sign of -0 counts.
fn with_sign(x: f32, signed: f32) -> f32 {
    return bitcast<f32>((bitcast<u32>(x) & 0x7fffffffu) | (bitcast<u32>(signed) & 0x80000000u));
}
// The unit vector of a direction, or `other` if the direction is 0 or not finite.
fn normalize_or(a: vec3f, other: vec3f) -> vec3f {
    let square = dot3(a, a);
    if !(is_finite(square) && square > 0.0) { return other; }
    return sep3(a * (1.0 / sep(sqrt(square))));
}

// Double-word numbers: the sum `h + l`, with `l` below the rounding of `h`, which doubles the precision (Dekker, "A Floating-Point Technique for
// Extending the Available Precision", Numerische Mathematik 18, 1971). Exact products are in `product_split.wgsl` and `product_fused.wgsl`.
struct Wide { h: f32, l: f32 }
struct Wide3 { h: vec3f, l: vec3f }

fn wide(x: f32) -> Wide { return Wide(x, 0.0); }
fn wide3(x: vec3f) -> Wide3 { return Wide3(x, vec3f(0.0)); }

fn exact_sum(a: f32, b: f32) -> Wide {
    let s = sep(a + b);
    let t = sep(s - a);
    return Wide(s, sep(sep(a - sep(s - t)) + sep(b - t)));
}
fn exact_sum3(a: vec3f, b: vec3f) -> Wide3 {
    let s = sep3(a + b);
    let t = sep3(s - a);
    return Wide3(s, sep3(sep3(a - sep3(s - t)) + sep3(b - t)));
}
// Requires |a| >= |b|, or a = 0.
fn quick_sum(a: f32, b: f32) -> Wide {
    let s = sep(a + b);
    return Wide(s, sep(b - sep(s - a)));
}
fn quick_sum3(a: vec3f, b: vec3f) -> Wide3 {
    let s = sep3(a + b);
    return Wide3(s, sep3(b - sep3(s - a)));
}
fn add(a: Wide, b: Wide) -> Wide {
    let s = exact_sum(a.h, b.h);
    let t = exact_sum(a.l, b.l);
    let c = quick_sum(s.h, sep(s.l + t.h));
    return quick_sum(c.h, sep(c.l + t.l));
}
fn add3(a: Wide3, b: Wide3) -> Wide3 {
    let s = exact_sum3(a.h, b.h);
    let t = exact_sum3(a.l, b.l);
    let c = quick_sum3(s.h, sep3(s.l + t.h));
    return quick_sum3(c.h, sep3(c.l + t.l));
}
fn minus(a: Wide) -> Wide { return Wide(-a.h, -a.l); }
fn minus3(a: Wide3) -> Wide3 { return Wide3(-a.h, -a.l); }
fn mul(a: Wide, b: Wide) -> Wide {
    let p = exact_product(a.h, b.h);
    return quick_sum(p.h, sep(p.l + sep(sep(a.h * b.l) + sep(a.l * b.h))));
}
fn mul3(a: Wide3, b: Wide3) -> Wide3 {
    let p = exact_product3(a.h, b.h);
    return quick_sum3(p.h, sep3(p.l + sep3(sep3(a.h * b.l) + sep3(a.l * b.h))));
}
// Division by a number that is not 0.
fn div(a: Wide, b: Wide) -> Wide {
    let first = sep(a.h / b.h);
    let rest = add(a, minus(mul(b, wide(first))));
    let second = sep(rest.h / b.h);
    let left = add(rest, minus(mul(b, wide(second))));
    let sum = quick_sum(first, second);
    return quick_sum(sum.h, sep(sum.l + sep(left.h / b.h)));
}
fn scaled3(a: Wide3, s: Wide) -> Wide3 { return mul3(a, Wide3(vec3f(s.h), vec3f(s.l))); }
fn wide_dot(a: Wide3, b: Wide3) -> Wide {
    let p = mul3(a, b);
    return add(add(Wide(p.h.x, p.l.x), Wide(p.h.y, p.l.y)), Wide(p.h.z, p.l.z));
}
fn wide_cross(a: Wide3, b: Wide3) -> Wide3 {
    let p = mul3(Wide3(a.h.yzx, a.l.yzx), Wide3(b.h.zxy, b.l.zxy));
    let q = mul3(Wide3(b.h.yzx, b.l.yzx), Wide3(a.h.zxy, a.l.zxy));
    return add3(p, minus3(q));
}
// The exact difference of two points, times a power of two.
fn difference(a: vec3f, b: vec3f, scale: f32) -> Wide3 {
    let d = exact_sum3(a, -b);
    return Wide3(sep3(d.h * scale), sep3(d.l * scale));
}
// The power of two whose product with a positive number is in [1, 2).
fn scale_to_one(x: f32) -> f32 {
    let exponent = clamp(bitcast<u32>(x) >> 23u & 0xffu, 1u, 253u);
    return bitcast<f32>((254u - exponent) << 23u);
}
// The reciprocal square root of a positive number.
fn wide_recip_root(a: Wide) -> Wide {
    let first = 1.0 / sep(sqrt(a.h));
    // One step of Newton's method, with the residual 1 - a first².
    let rest = add(wide(1.0), minus(mul(a, exact_product(first, first))));
    return quick_sum(first, sep(0.5 * sep(first * rest.h)));
}
// Unit vector of a vector whose largest component is far from the limits of the number format; 0 for the zero vector.
fn wide_unit(a: Wide3) -> Wide3 {
    let scale = scale_to_one(most3(abs(a.h)));
    let near = Wide3(sep3(a.h * scale), sep3(a.l * scale));
    let square = wide_dot(near, near);
    if !(square.h > 0.0 && is_finite(square.h)) { return wide3(vec3f(0.0)); }
    return scaled3(near, wide_recip_root(square));
}

// The sign of a b - c d, exactly: products of 24-bit mantissas as integers.
struct Product { sign: i32, exponent: i32, high: u32, low: u32 }
// The sign of a number by its bits: correct also for numbers so small that a driver may take them for 0.
fn bits_sign(x: f32) -> i32 {
    let bits = bitcast<u32>(x);
    return select(select(1, -1, (bits >> 31u) != 0u), 0, (bits & 0x7fffffffu) == 0u);
}
struct Mantissa { digits: u32, exponent: i32 }
fn mantissa(x: f32) -> Mantissa {
    let bits = bitcast<u32>(x) & 0x7fffffffu;
    let exponent = bits >> 23u;
    if exponent != 0u { return Mantissa(bits & 0x7fffffu | 0x800000u, i32(exponent)); }
    let shift = countLeadingZeros(bits) - 8u;
    return Mantissa(bits << shift, 1 - i32(shift));
}
fn product_of(a: f32, b: f32) -> Product {
    let sign = bits_sign(a) * bits_sign(b);
    if sign == 0 { return Product(0, 0, 0u, 0u); }
    let m = mantissa(a); let n = mantissa(b);
    let mh = m.digits >> 12u; let ml = m.digits & 0xfffu;
    let nh = n.digits >> 12u; let nl = n.digits & 0xfffu;
    let middle = mh * nl + ml * nh;
    var low = ml * nl + ((middle & 0xfffu) << 12u);
    var high = mh * nh + (middle >> 12u) + (low >> 24u);
    low &= 0xffffffu;
    var exponent = m.exponent + n.exponent;
    // The product has 47 or 48 digits; normalise to 48.
    if (high & 0x800000u) == 0u {
        high = high << 1u | low >> 23u;
        low = low << 1u & 0xffffffu;
        exponent -= 1;
    }
    return Product(sign, exponent, high, low);
}
fn exact_sign(a: f32, b: f32, c: f32, d: f32) -> i32 {
    let p = product_of(a, b); let q = product_of(c, d);
    if p.sign != q.sign { return sign(p.sign - q.sign); }
    if p.sign == 0 { return 0; }
    var order = sign(p.exponent - q.exponent);
    if order == 0 { order = sign(i32(p.high) - i32(q.high)); }
    if order == 0 { order = sign(i32(p.low) - i32(q.low)); }
    return p.sign * order;
}
