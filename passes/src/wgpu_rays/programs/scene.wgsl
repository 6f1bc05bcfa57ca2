// What rays hit: rays, hits, vertex attributes, textures, materials, and cut-outs.
//
// Here and in other texts, code between ⟨ and ⟩ is for ray cones only (`ray_cones.wgsl`), and code between ⦃ and ⦄ is only for passes where
// glass focuses light (`focus.wgsl`).

// Hits have t_min < t < t_max.
struct Ray { origin: vec3f, direction: vec3f, t_min: f32, t_max: f32 }
struct Hit { t: f32, triangle: u32, u: f32, v: f32 }
struct Corners { a: vec3f, b: vec3f, c: vec3f }

fn vector_at(place: u32) -> vec3f {
    return vec3f(bitcast<f32>(vertices_at(place)), bitcast<f32>(vertices_at(place + 1u)), bitcast<f32>(vertices_at(place + 2u)));
}
fn corners_of(triangle: u32) -> vec3u {
    return vec3u(mesh_at(3u * triangle), mesh_at(3u * triangle + 1u), mesh_at(3u * triangle + 2u));
}
fn positions_of(triangle: u32) -> Corners {
    let i = corners_of(triangle);
    return Corners(vector_at(3u * i.x), vector_at(3u * i.y), vector_at(3u * i.z));
}
// Interpolates three vectors at a hit, with the processor's roundings.
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
    return vec3f(bitcast<f32>(vertices_at(place)), bitcast<f32>(vertices_at(place + 1u)), 0.0);
}
fn texture_coordinates(hit: Hit) -> vec2f {
    let i = corners_of(hit.triangle);
    return weighed(texcoord_at(i.x), texcoord_at(i.y), texcoord_at(i.z), hit).xy;
}

fn four_at(place: u32) -> vec4f { return vec4f(vector_at(place), bitcast<f32>(vertices_at(place + 3u))); }
// A vertex attribute of four numbers, whose array begins at `first`, interpolated at a hit.
fn four_between(first: u32, hit: Hit) -> vec4f {
    let i = vec3u(first) + 4u * corners_of(hit.triangle);
    let w = 1.0 - hit.u - hit.v;
    return sep4(sep4(four_at(i.x) * w) + sep4(four_at(i.y) * hit.u)) + sep4(four_at(i.z) * hit.v);
}
fn vertex_color(hit: Hit) -> vec4f { return four_between(params.colors_at, hit); }

// Level 0 of a texture; further levels follow it in memory. If `nearest` is not 0, only the texel that contains the point is read.
struct Texture { first: u32, width: u32, height: u32, wrap_u: u32, wrap_v: u32, nearest: u32, decoded_at: u32 }
fn texture_of(index: u32) -> Texture {
    let place = params.textures_at + TEXTURE_WORDS * index;
    let wrap_u = tables[place + 3u]; let wrap_v = tables[place + 4u];
    return Texture(tables[place], tables[place + 1u], tables[place + 2u], wrap_u, wrap_v, tables[place + 5u], params.decoded_at);
}
// The index of the texel that replaces one beyond the border: the texel from the other side (repeat), or the one at the border.
fn beyond(x: i32, size: i32, wrap: u32) -> i32 {
    if wrap != WRAP_REPEAT { return clamp(x, 0, size - 1); }
    return select(select(x, x - size, x >= size), x + size, x < 0);
}
// A coordinate after wrapping, as a share of the side, 0 to 1.
fn share_of_side(t: f32, wrap: u32) -> f32 {
    if wrap == WRAP_CLAMP { return clamp(t, 0.0, 1.0); }
    if wrap == WRAP_REPEAT { return t - floor(t); }
    let halved = sep(0.5 * t);
    let twice = 2.0 * (halved - floor(halved));
    return select(twice, 2.0 - twice, twice > 1.0);
}
fn texel(image: Texture, column: i32, row: i32) -> vec4f {
    let x = beyond(column, i32(image.width), image.wrap_u);
    let y = beyond(row, i32(image.height), image.wrap_v);
    let word = texels_at(image.first + u32(y) * image.width + u32(x));
    let bytes = vec4u(word & 0xffu, word >> 8u & 0xffu, word >> 16u & 0xffu, word >> 24u);
    if image.decoded_at != 0u {
        let code = vec3u(image.decoded_at) + bytes.xyz;
        return vec4f(table_number(code.x), table_number(code.y), table_number(code.z), f32(bytes.w) / 255.0);
    }
    return vec4f(bytes) / 255.0;
}
fn sep4(x: vec4f) -> vec4f { return bitcast<vec4f>(bitcast<vec4u>(x) ^ vec4u(params.zero)); }
fn between(a: vec4f, b: vec4f, s: f32) -> vec4f { return sep4(a * (1.0 - s)) + sep4(b * s); }
// Bilinear filtering; `v = 0` is the bottom row.
fn sample_texture(index: u32, uv: vec2f⟨, footprint: f32⟩) -> vec4f { return sample_image(texture_of(index), uv⟨, footprint⟩); }
// As `sample_texture`, for textures that do not hold colours.
fn sample_numbers(index: u32, uv: vec2f⟨, footprint: f32⟩) -> vec4f {
    var image = texture_of(index);
    image.decoded_at = 0u;
    return sample_image(image, uv⟨, footprint⟩);
}
fn sample_image(image: Texture, uv: vec2f⟨, footprint: f32⟩) -> vec4f {
⟨    return sample_levels(image, uv, footprint);
}
fn sample_level(image: Texture, uv: vec2f) -> vec4f {
⟩    var x = sep(share_of_side(uv.x, image.wrap_u) * f32(image.width)) - 0.5;
    var y = sep((1.0 - sep(share_of_side(uv.y, image.wrap_v))) * f32(image.height)) - 0.5;
    // Without finite coordinates, only the first texel is read.
    if !(is_finite(uv.x) && is_finite(uv.y)) {
        x = 0.0;
        y = 0.0;
    }
    // At whole numbers, one texel has the whole weight.
    if image.nearest != 0u {
        x = floor(x + 0.5);
        y = floor(y + 0.5);
    }
    let left = floor(x); let top = floor(y);
    let fx = x - left; let fy = y - top;
    let l = i32(left); let t = i32(top);
    let above = between(texel(image, l, t), texel(image, l + 1, t), fx);
    let below = between(texel(image, l, t + 1), texel(image, l + 1, t + 1), fx);
    return between(above, below, fy);
}

struct Shade { diffuse: vec3f, flags: u32, texture: u32, cutoff: f32 }
fn table_number(place: u32) -> f32 { return bitcast<f32>(tables[place]); }
fn table_vector(place: u32) -> vec3f { return vec3f(table_number(place), table_number(place + 1u), table_number(place + 2u)); }
fn shade_of(triangle: u32) -> Shade {
    let place = SHADE_WORDS * mesh_at(params.materials_at + triangle);
    let diffuse = vec3f(table_number(place), table_number(place + 1u), table_number(place + 2u));
⟪    if is_sphere(triangle) { return Shade(diffuse, tables[place + 3u] & ~OF_VERTICES, NO_TEXTURE, 0.0); }
⟫    return Shade(diffuse, tables[place + 3u], tables[place + 4u], table_number(place + 5u));
}
fn flags_of(triangle: u32) -> u32 { return tables[SHADE_WORDS * mesh_at(params.materials_at + triangle) + 3u]; }
fn is_glass(triangle: u32) -> bool { return (flags_of(triangle) & SHADE_GLASS) != 0u; }
fn is_sky(triangle: u32) -> bool { return ⟪!is_sphere(triangle) && ⟫(flags_of(triangle) & SHADE_SKY) != 0u; }
fn passes_light(triangle: u32) -> bool { return (flags_of(triangle) & SHADE_SHADOW_GLASS) != 0u; }
⦃// Whether photons carry the light that meets a triangle, so that the light does not go straight on (`targets.rs`).
fn is_target(triangle: u32) -> bool { return (flags_of(triangle) & SHADE_TARGET) != 0u; }
⦄// Whether there is a surface at this point of the triangle, that is, no cut-out.
fn covers(hit: Hit) -> bool {
    if params.cut == 0u { return true; }
    let shade = shade_of(hit.triangle);
    if (shade.flags & SHADE_CUT) == 0u { return true; }
    let colored = (shade.flags & SHADE_VERTEX_COLORS) != 0u;
    if shade.texture == NO_TEXTURE { return !colored || vertex_color(hit).w >= shade.cutoff; }
    var alpha = sample_texture(shade.texture, texture_coordinates(hit)⟨, NO_FOOTPRINT⟩).w;
    if colored { alpha = alpha * vertex_color(hit).w; }
    return alpha >= shade.cutoff;
}

// The interpolated normal, bent by a texel of the normal map, on a triangle with unit normal `flat_normal` (of either sign), as in
// `normal_map::bent` of the pipeline.
fn bent(texel: vec3f, scale: f32, normal: vec3f, tangent: vec4f, flat_normal: vec3f) -> vec3f {
    let slopes = sep3((2.0 * texel - vec3f(1.0)) * scale);
    let height = 2.0 * texel.z - 1.0;
    let z = select(LEAST_HEIGHT, height, height > LEAST_HEIGHT);
    let across = sep3(cross3(normal, tangent.xyz) * tangent.w);
    let unbent = normalize_or(normal, normal);
    let sum = sep3(sep3(tangent.xyz * slopes.x) + sep3(across * slopes.y)) + sep3(normal * z);
    let turned = normalize_or(sum, unbent);
    let side = select(flat_normal, -flat_normal, dot3(flat_normal, normal) < 0.0);
    let cosine = dot3(turned, side);
    if cosine < LEAST_COSINE { return normalize_or(turned + sep3(side * (LEAST_COSINE - cosine)), normalize_or(side, side)); }
    return turned;
}
// The normal at a hit, bent by the material's normal map if it has one; `vertex_normal` is the interpolated normal.
fn bent_normal(hit: Hit, vertex_normal: vec3f, flat_normal: vec3f⟨, footprint: f32⟩) -> vec3f {
    if params.tangents_at == 0u || !(dot3(vertex_normal, vertex_normal) > LEAST_SQUARE) { return vertex_normal; }
    let place = SHADE_WORDS * mesh_at(params.materials_at + hit.triangle);
    if (tables[place + 3u] & SHADE_NORMAL_MAP) == 0u { return vertex_normal; }
    let texel = sample_numbers(tables[place + 10u], texture_coordinates(hit)⟨, footprint⟩).xyz;
    return bent(texel, table_number(place + 11u), vertex_normal, four_between(params.tangents_at, hit), flat_normal);
}
// Whether the interpolated normal faces a light, after it is turned to the side of the triangle that the bent normal is on.
fn vertices_face_light(hit: Hit, bent: vec3f, to_light: vec3f) -> bool {
    let corners = positions_of(hit.triangle);
    let flat_normal = cross3(corners.b - corners.a, corners.c - corners.a);
    let vertex_normal = normal_at(hit);
    let is_turned = (dot3(flat_normal, vertex_normal) < 0.0) != (dot3(flat_normal, bent) < 0.0);
    let cosine = dot3(vertex_normal, to_light);
    return select(cosine, -cosine, is_turned) > 0.0;
}

// The cosine of a light on a surface with this unit normal; 0 where the surface is turned away.
fn cosine_to(shade: Shade, hit: Hit, normal: vec3f, to_light: vec3f) -> f32 {
    if (shade.flags & SHADE_NORMAL_MAP) != 0u && !vertices_face_light(hit, normal, to_light) { return 0.0; }
    return max(dot3(to_light, normal), 0.0);
}

// Diffuse and ambient light times texture and vertex colour; `lights` is the diffuse light on white.
fn reflected_color(hit: Hit, shade: Shade, lights: vec3f⟨, footprint: f32⟩) -> vec3f {
    let lit = sep3(shade.diffuse * lights);
    var reflected = lit + sep3(AMBIENT * shade.diffuse);
    if shade.texture != NO_TEXTURE {
        reflected = (lit + vec3f(AMBIENT)) * sample_texture(shade.texture, texture_coordinates(hit)⟨, footprint⟩).xyz;
    }
    if (shade.flags & SHADE_VERTEX_COLORS) != 0u { reflected = reflected * vertex_color(hit).xyz; }
    return reflected;
}
// The reflected colour plus the light that the surface emits.
fn shining_color(hit: Hit, shade: Shade, lights: vec3f⟨, footprint: f32⟩) -> vec3f {
    let reflected = reflected_color(hit, shade, lights⟨, footprint⟩);
    if (shade.flags & SHADE_GLOW) == 0u { return reflected; }
    let place = SHADE_WORDS * mesh_at(params.materials_at + hit.triangle) + 6u;
    let glow = vec3f(table_number(place), table_number(place + 1u), table_number(place + 2u));
    let image = tables[place + 3u];
    if image == NO_TEXTURE⟪ || is_sphere(hit.triangle)⟫ { return reflected + glow; }
    return reflected + sep3(glow * sample_texture(image, texture_coordinates(hit)⟨, footprint⟩).xyz);
}
// The colour in the light of one directional light, with this unit normal.
fn lit_color(hit: Hit, normal: vec3f⟨, footprint: f32⟩) -> vec3f {
    let shade = shade_of(hit.triangle);
    let cosine = cosine_to(shade, hit, normal, params.to_light);
    return shining_color(hit, shade, params.light_color * cosine⟨, footprint⟩);
}

// Which candidate hits on transparent materials count for a ray.
const ACCEPT_ALL: u32 = 0u;     // every hit
const ACCEPT_COVERED: u32 = 1u; // hits where the triangle is not cut out
const ACCEPT_STOPS: u32 = 2u;   // covered hits, except on glass that shadow rays pass
const ACCEPT_OPAQUE: u32 = 3u;  // hits except on glass that shadow rays pass (thesis: nothing is cut out)
const ACCEPT_COUNTS: u32 = 4u;  // as ACCEPT_STOPS⦃, and glass that focuses light⦄; the covered glass on the way is counted

fn accepts(accept: u32, hit: Hit) -> bool {
    if accept == ACCEPT_ALL { return true; }
    let passes = accept != ACCEPT_COVERED && passes_light(hit.triangle)⦃ && !(accept == ACCEPT_COUNTS && is_target(hit.triangle))⦄;
    if accept == ACCEPT_OPAQUE { return !passes; }
    // Drivers inline every call of a function, so coverage is tested in one place.
    if (accept == ACCEPT_STOPS && passes) || !covers(hit) { return false; }
    if passes { add_crossing(hit); }
    return !passes;
}
