// Glass as each material says (`effects/dielectric`): the bodies that a point lies in, and the effect of one surface. Weights are colours.
alias Weight = vec3f;
const ONE: Weight = vec3f(1.0);
const HAS_BODIES: bool = true;
// Splits a weight: `weight_left` is stored beside a point's colour, and `weighed_color` includes the rest in the colour.
fn weight_left(weight: Weight) -> f32 { return 1.0; }
fn weighed_color(weight: Weight, color: vec3f) -> vec3f { return weight * color; }

fn is_black(color: vec3f) -> bool { return all(color == vec3f(0.0)); }

// A material (`layout.rs`).
struct Body {
    shape: u32,
    index: f32,
    extinction: vec3f,
    filter_color: vec3f,
    filter_texture: u32,
    veil: f32,
    thickness: f32,
    priority: u32,
    vertex_colors: u32,
    // The spread of the index of refraction towards blue; the width of the distribution of microfacets, and the texture that multiplies it.
    spread: f32,
    alpha: f32,
    roughness_texture: u32,
    // The factor on reflected light; minimum, maximum and exponent of the material's own reflectance. The exponent is below 0 where it has none.
    mirrors: vec3f,
    curve: vec3f,
    // The texture that multiplies the share that is not scattered back.
    transmission_texture: u32,
}
fn body_place(material: u32) -> u32 { return params.bodies_at + BODY_HEAD + BODY_WORDS * material; }
fn body_of(material: u32) -> Body {
    let place = body_place(material);
    return Body(tables[place], table_number(place + 1u), table_vector(place + 2u), table_vector(place + 5u), tables[place + 8u],
                table_number(place + 9u), table_number(place + 10u), tables[place + 11u], tables[place + 12u],
                table_number(place + 13u), table_number(place + 14u), tables[place + 15u],
                table_vector(place + 16u), table_vector(place + 19u), tables[place + 22u]);
}
// The material at a hit, where a texture may give the share that is scattered back.
fn body_at(material: u32, hit: Hit⟨, footprint: f32⟩) -> Body {
    var body = body_of(material);
⟪    if is_sphere(hit.triangle) {
        body.filter_texture = NO_TEXTURE;
        body.vertex_colors = VERTEX_COLORS_NONE;
        body.roughness_texture = NO_TEXTURE;
        body.transmission_texture = NO_TEXTURE;
    }
⟫    if body.transmission_texture != NO_TEXTURE {
        let clear = sample_numbers(body.transmission_texture, texture_coordinates(hit)⟨, footprint⟩).x;
        body.veil = 1.0 - (1.0 - body.veil) * clear;
    }
    return body;
}
fn material_of(triangle: u32) -> u32 { return mesh_at(params.materials_at + triangle); }
fn shape_of(material: u32) -> u32 { return tables[body_place(material)]; }
fn priority_of(material: u32) -> u32 { return tables[body_place(material) + 11u]; }

// The bodies that a point of a path lies in; the last one fills the place (`media.rs`).
struct Media { list: array<u32, MOST_BODIES>, length: u32 }
fn top_of(media: Media) -> u32 {
    if media.length == 0u { return NONE; }
    var list = media.list;
    return list[media.length - 1u];
}
// The index of refraction of the body that fills a place, or of air for NONE.
fn index_of(body: u32) -> f32 {
    if body == NONE { return 1.0; }
    return table_number(body_place(body) + 1u);
}
fn index_in(media: Media) -> f32 { return index_of(top_of(media)); }
fn extinction_of(body: u32) -> vec3f { return table_vector(body_place(body) + 2u); }
fn extinction_in(media: Media) -> vec3f {
    let body = top_of(media);
    if body == NONE { return vec3f(0.0); }
    return extinction_of(body);
}
// Adds one body; returns whether it now fills the place.
fn put_body(media: ptr<function, Media>, body: u32) -> bool {
    let priority = priority_of(body);
    let length = (*media).length;
    var place = 0u;
    while place < length {
        if priority_of((*media).list[place]) > priority { break; }
        place += 1u;
    }
    if length == MOST_BODIES {
        count(LOST);
        return place == length;
    }
    for (var i = length; i > place; i -= 1u) { (*media).list[i] = (*media).list[i - 1u]; }
    (*media).list[place] = body;
    (*media).length = length + 1u;
    return place == length;
}
// Removes the last entry of `body`. Returns 0 if there is none, 1 if it did not fill the place, 2 if it did.
fn take_body(media: ptr<function, Media>, body: u32) -> u32 {
    let length = (*media).length;
    var place = length;
    while place > 0u {
        if (*media).list[place - 1u] == body { break; }
        place -= 1u;
    }
    if place == 0u { return 0u; }
    for (var i = place; i < length; i += 1u) { (*media).list[i - 1u] = (*media).list[i]; }
    (*media).list[length - 1u] = 0u;
    (*media).length = length - 1u;
    return select(1u, 2u, place == length);
}
// The border of a body: the bodies that fill the place before and behind it, and whether there is a surface. There is none where another body
// fills the place on both sides.
struct Border { before: u32, after: u32, is_there: bool }
// Crosses the surface of a body; `media` is changed to the bodies behind it.
fn border_of(media: ptr<function, Media>, body: u32, enters: bool) -> Border {
    var before = *media;
    var fills = false;
    if enters {
        fills = put_body(media, body);
    } else {
        let taken = take_body(media, body);
        fills = taken == 2u;
        // A path that leaves a body without having entered it was in that body all the same.
        if taken == 0u { fills = put_body(&before, body); }
    }
    return Border(top_of(before), top_of(*media), fills);
}
// As `border_of`, but returns the index of refraction behind the surface over that before it; 0 where there is no surface.
fn cross_border(media: ptr<function, Media>, body: u32, enters: bool) -> f32 {
    let border = border_of(media, body, enters);
    if !border.is_there { return 0.0; }
    return index_of(border.after) / index_of(border.before);
}

// exp(-extinction * length) by colour; exactly 1 where nothing is absorbed, whatever the length.
fn transmittance(extinction: vec3f, length: f32) -> vec3f {
    // After 200 extinctions no light is left. The bounds are needed because programs cannot rely on infinities.
    return select(vec3f(1.0), exp(-min(extinction * min(length, 1.0e20), vec3f(200.0))), extinction > vec3f(0.0));
}

// A plane-parallel wall after all reflections between its faces (`slab.rs`).
struct Wall { reflected: vec3f, transmitted: vec3f }
fn wall_of(r: f32, kept: vec3f) -> Wall {
    if r >= 1.0 { return Wall(vec3f(1.0), vec3f(0.0)); }
    let through = (1.0 - r) * (1.0 - r) * kept / (1.0 - r * r * kept * kept);
    return Wall(r + r * kept * through, through);
}
fn kept_across(body: Body, cos_refracted: f32) -> vec3f {
    return transmittance(body.extinction, body.thickness / max(cos_refracted, 1.0e-30));
}

fn decoded(encoded: vec3f) -> vec3f {
    let curve = pow((max(encoded, vec3f(0.0)) + 0.055) / 1.055, vec3f(2.4));
    return select(curve, encoded / 12.92, encoded <= vec3f(0.04045));
}
// The share of the light that passes, by colour, relative to the light that is not reflected.
fn filter_of(body: Body, hit: Hit⟨, footprint: f32⟩) -> vec3f {
    var colors = vec3f(1.0);
    if body.filter_texture != NO_TEXTURE {
        colors = sample_texture(body.filter_texture, texture_coordinates(hit)⟨, footprint⟩).xyz;
        // A share of light is linear in every colour space of the pass.
        if params.decoded_at == 0u { colors = decoded(colors); }
    }
    if body.vertex_colors != VERTEX_COLORS_NONE {
        var shares = vertex_color(hit).xyz;
        if body.vertex_colors == VERTEX_COLORS_DISPLAY { shares = decoded(shares); }
        colors *= shares;
    }
    return (1.0 - body.veil) * body.filter_color * colors;
}

// The barycentric coordinates of a point in the plane of a triangle, as a hit at distance 0.
fn located(triangle: u32, position: vec3f) -> Hit {
⟪    if is_sphere(triangle) { return Hit(0.0, triangle, 0.0, 0.0); }
⟫    let corners = positions_of(triangle);
    let e1 = corners.b - corners.a; let e2 = corners.c - corners.a; let to = position - corners.a;
    let normal = cross3(e1, e2);
    let area = dot3(normal, normal);
    return Hit(0.0, triangle, dot3(cross3(to, e2), normal) / area, dot3(cross3(e1, to), normal) / area);
}

// Whether a surface is seen from the side of the counter-clockwise winding: of a body, from outside.
fn is_front(surface: Surface) -> bool { return all(surface.facing == surface.point.normal); }
