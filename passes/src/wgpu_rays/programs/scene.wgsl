// What is hit: rays, hits, vertex attributes, textures, materials, and where triangles are cut out.

// Hits have t_min < t < t_max.
struct Ray { origin: vec3f, direction: vec3f, t_min: f32, t_max: f32 }
struct Hit { t: f32, triangle: u32, u: f32, v: f32 }
struct Corners { a: vec3f, b: vec3f, c: vec3f }

fn vector_at(place: u32) -> vec3f {
    return vec3f(bitcast<f32>(vertices[place]), bitcast<f32>(vertices[place + 1u]), bitcast<f32>(vertices[place + 2u]));
}
fn corners_of(triangle: u32) -> vec3u {
    return vec3u(mesh[3u * triangle], mesh[3u * triangle + 1u], mesh[3u * triangle + 2u]);
}
fn positions_of(triangle: u32) -> Corners {
    let i = corners_of(triangle);
    return Corners(vector_at(3u * i.x), vector_at(3u * i.y), vector_at(3u * i.z));
}
// Three vectors, weighed as the processor does.
fn weighed(a: vec3f, b: vec3f, c: vec3f, hit: Hit) -> vec3f {
    let w = 1.0 - hit.u - hit.v;
    return sep3(sep3(a * w) + sep3(b * hit.u)) + sep3(c * hit.v);
}
fn normal_at(hit: Hit) -> vec3f {
    let i = corners_of(hit.triangle) * 3u + vec3u(params.normals_at);
    return weighed(vector_at(i.x), vector_at(i.y), vector_at(i.z), hit);
}
fn texcoord_at(vertex: u32) -> vec3f {
    let place = params.texcoords_at + 2u * vertex;
    return vec3f(bitcast<f32>(vertices[place]), bitcast<f32>(vertices[place + 1u]), 0.0);
}
fn texture_coordinates(hit: Hit) -> vec2f {
    let i = corners_of(hit.triangle);
    return weighed(texcoord_at(i.x), texcoord_at(i.y), texcoord_at(i.z), hit).xy;
}

fn color_at(vertex: u32) -> vec4f {
    let place = params.colors_at + 4u * vertex;
    return vec4f(vector_at(place), bitcast<f32>(vertices[place + 3u]));
}
fn vertex_color(hit: Hit) -> vec4f {
    let i = corners_of(hit.triangle);
    let w = 1.0 - hit.u - hit.v;
    return sep4(sep4(color_at(i.x) * w) + sep4(color_at(i.y) * hit.u)) + sep4(color_at(i.z) * hit.v);
}

// Level 0 of a texture, which alone rays read.
struct Texture { first: u32, width: u32, height: u32 }
fn texture_of(index: u32) -> Texture {
    let place = params.textures_at + 3u * index;
    return Texture(tables[place], tables[place + 1u], tables[place + 2u]);
}
fn texel(image: Texture, column: i32, row: i32) -> vec4f {
    let width = i32(image.width); let height = i32(image.height);
    let x = select(select(column, column - width, column >= width), column + width, column < 0);
    let y = select(select(row, row - height, row >= height), row + height, row < 0);
    let word = texels[image.first + u32(y) * image.width + u32(x)];
    let bytes = vec4u(word & 0xffu, word >> 8u & 0xffu, word >> 16u & 0xffu, word >> 24u);
    if params.decoded_at != 0u {
        let code = vec3u(params.decoded_at) + bytes.xyz;
        return vec4f(table_number(code.x), table_number(code.y), table_number(code.z), f32(bytes.w) / 255.0);
    }
    return vec4f(bytes) / 255.0;
}
fn sep4(x: vec4f) -> vec4f { return bitcast<vec4f>(bitcast<vec4u>(x) ^ vec4u(params.zero)); }
fn between(a: vec4f, b: vec4f, s: f32) -> vec4f { return sep4(a * (1.0 - s)) + sep4(b * s); }
// Bilinear filtering; `v = 0` is the bottom row, coordinates repeat.
fn sample_texture(index: u32, uv: vec2f) -> vec4f {
    let image = texture_of(index);
    if !(is_finite(uv.x) && is_finite(uv.y)) { return texel(image, 0, 0); }
    let x = sep((uv.x - floor(uv.x)) * f32(image.width)) - 0.5;
    let y = sep((1.0 - sep(uv.y - floor(uv.y))) * f32(image.height)) - 0.5;
    let left = floor(x); let top = floor(y);
    let fx = x - left; let fy = y - top;
    let l = i32(left); let t = i32(top);
    let above = between(texel(image, l, t), texel(image, l + 1, t), fx);
    let below = between(texel(image, l, t + 1), texel(image, l + 1, t + 1), fx);
    return between(above, below, fy);
}

struct Shade { diffuse: vec3f, flags: u32, texture: u32, cutoff: f32 }
fn table_number(place: u32) -> f32 { return bitcast<f32>(tables[place]); }
fn shade_of(triangle: u32) -> Shade {
    let place = SHADE_WORDS * mesh[params.materials_at + triangle];
    let diffuse = vec3f(table_number(place), table_number(place + 1u), table_number(place + 2u));
    return Shade(diffuse, tables[place + 3u], tables[place + 4u], table_number(place + 5u));
}
fn flags_of(triangle: u32) -> u32 { return tables[SHADE_WORDS * mesh[params.materials_at + triangle] + 3u]; }
fn is_glass(triangle: u32) -> bool { return (flags_of(triangle) & SHADE_GLASS) != 0u; }
fn passes_light(triangle: u32) -> bool { return (flags_of(triangle) & SHADE_SHADOW_GLASS) != 0u; }
// Whether there is a surface at this point of the triangle.
fn covers(hit: Hit) -> bool {
    if params.cut == 0u { return true; }
    let shade = shade_of(hit.triangle);
    if (shade.flags & SHADE_CUT) == 0u { return true; }
    let colored = (shade.flags & SHADE_VERTEX_COLORS) != 0u;
    if shade.texture == NO_TEXTURE { return !colored || vertex_color(hit).w >= shade.cutoff; }
    var alpha = sample_texture(shade.texture, texture_coordinates(hit)).w;
    if colored { alpha = alpha * vertex_color(hit).w; }
    return alpha >= shade.cutoff;
}

// Diffuse light, ambient light and texture, with this unit normal, times the vertex colour.
fn lit_color(hit: Hit, normal: vec3f) -> vec3f {
    let shade = shade_of(hit.triangle);
    let lit = sep3(shade.diffuse * (params.light_color * max(dot3(params.to_light, normal), 0.0)));
    var reflected = lit + sep3(AMBIENT * shade.diffuse);
    if shade.texture != NO_TEXTURE {
        reflected = (lit + vec3f(AMBIENT)) * sample_texture(shade.texture, texture_coordinates(hit)).xyz;
    }
    if (shade.flags & SHADE_VERTEX_COLORS) != 0u { reflected = reflected * vertex_color(hit).xyz; }
    return reflected;
}

// Which candidate hits on transparent materials count, as the ray asks.
const ACCEPT_ALL: u32 = 0u;     // every one
const ACCEPT_COVERED: u32 = 1u; // where the triangle is not cut out
const ACCEPT_STOPS: u32 = 2u;   // covered, and not glass that shadow rays pass
const ACCEPT_OPAQUE: u32 = 3u;  // not glass that shadow rays pass (thesis: nothing is cut out)
const ACCEPT_COUNTS: u32 = 4u;  // as ACCEPT_STOPS; the covered glass on the way is counted

// The distances of the glass surfaces that a shadow ray crosses, in order. A ray through the edge between two triangles meets both:
// distances no farther apart than their rounding are one surface. Beyond MAX_CROSSINGS, each counts as a surface of its own.
var<private> crossing: array<f32, MAX_CROSSINGS>;
var<private> crossings_stored: u32;
var<private> crossings_beyond: u32;
fn add_crossing(t: f32) {
    if crossings_stored == MAX_CROSSINGS {
        crossings_beyond += 1u;
        return;
    }
    var slot = crossings_stored;
    crossings_stored += 1u;
    while slot > 0u {
        if crossing[slot - 1u] <= t { break; }
        crossing[slot] = crossing[slot - 1u];
        slot -= 1u;
    }
    crossing[slot] = t;
}
fn distinct_crossings() -> u32 {
    var count = crossings_beyond + select(0u, 1u, crossings_stored > 0u);
    for (var i = 1u; i < crossings_stored; i += 1u) {
        if crossing[i] - crossing[i - 1u] > 16.0 * UNIT_ROUNDOFF * crossing[i] { count += 1u; }
    }
    return count;
}

fn accepts(accept: u32, hit: Hit) -> bool {
    switch accept {
        case ACCEPT_ALL: { return true; }
        case ACCEPT_COVERED: { return covers(hit); }
        case ACCEPT_STOPS: { return !passes_light(hit.triangle) && covers(hit); }
        case ACCEPT_OPAQUE: { return !passes_light(hit.triangle); }
        default: {
            if !covers(hit) { return false; }
            if !passes_light(hit.triangle) { return true; }
            add_crossing(hit.t);
            return false;
        }
    }
}
