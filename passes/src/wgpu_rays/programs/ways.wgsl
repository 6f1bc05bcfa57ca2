// Paths through glass that may be rough, disperse colours, or be cut off (`walk.rs`, `solid.rs` and `limits.rs` of `effects/dielectric`).
//
// As in `smooth.wgsl`, a loop walks the tree of rays with a list of the branches still to be traced. A surface of rough glass divides a path
// into several ways on, and dispersion divides it into strata of the spectrum. In both cases the meeting is kept, and its ways are taken in turn:
// the next one when all branches of the previous one are traced. A path is divided once by each cause, so at most two meetings are kept.
//
// Two texts say which ways are followed: `all_ways.wgsl` and `sampled_ways.wgsl`.

// The state of a path.
struct Path {
    media: Media,
    key: u32,
    surfaces: u32,
    splits: u32,
    // The stratum of its light; NONE until a body has dispersed colours.
    stratum: u32,
    // Its number among the ways on from rough glass; NONE before rough glass.
    sample: u32,
    // Its share of the pixel's colour. It is larger if the path is one of few that were followed by chance.
    importance: f32,
    reflections: u32,
    refractions: u32,
⟨    cone: Cone,
⟩}
// A ray that is still to be traced; `start` is the point of the surface that it leaves, before the offset.
struct Branch { origin: vec3f, direction: vec3f, start: vec3f, weight: vec3f, path: Path }
// A path that has arrived at a surface.
struct Meeting { hit: Hit, surface: Surface, view: vec3f, weight: vec3f, path: Path⟨, footprint: f32⟩ }
// How a path meets a surface: for the first time, or as one way of those into which it is divided there.
const WHOLE: u32 = 0u;
const BY_FACET: u32 = 1u;
const BY_COLOR: u32 = 2u;
// A meeting whose path is divided: the kind of division; for strata, whether the first way was bent by the geometric normal (`Ways`); the
// next way, the number of ways, and the number of branches that waited before.
struct Division { at: Meeting, part: u32, is_flat: bool, following: u32, ways: u32, base: u32 }

// The remaining work of a pixel's walk. One branch for each split may wait, one that colours share, and one that they do not share.
var<private> waiting: array<Branch, MAX_DEPTH + 3u>;
var<private> stored: u32;
var<private> divisions: array<Division, 2>;
var<private> divided: u32;
var<private> next: Branch;
var<private> follows: bool;
// The current meeting of the path, or its end.
var<private> now: Meeting;
// The colour that the background adds where rays leave the scene, or are not followed.
var<private> missed: vec3f;

fn asked(word: u32) -> u32 { return tables[params.bodies_at + word]; }
fn stratum_at(stratum: u32) -> u32 { return asked(HEAD_STRATA) + 4u * stratum; }
// The index of refraction of the body that fills a place, for light of a stratum.
fn index_for(body: u32, stratum: u32) -> f32 {
    let index = index_of(body);
    if body == NONE || stratum == NONE { return index; }
    let wavelength = table_number(stratum_at(stratum));
    let spread = table_number(body_place(body) + 13u);
    return max(index + sep(spread * (CAUCHY / sep(wavelength * wavelength) - CAUCHY_AT_D)), 1.0);
}
fn bends_apart(body: u32) -> bool { return body != NONE && table_number(body_place(body) + 13u) > 0.0; }
// The random-number key for the surface at which a path ends.
fn own_key(path: Path) -> u32 {
⟬    if path.sample == NONE && first_way > 0u { return path_key(path.key, BRANCH_SCATTERED + first_way); }
⟭    if path.sample == NONE { return path.key; }
    return path_key(path.key, BRANCH_SCATTERED + path.sample);
}

// The weight factor of a way that may be followed: 1, or more if it is followed by chance; 0 if chance leaves it out, -1 if it is cut off.
fn kept_of(weight: vec3f, kind: u32, path: ptr<function, Path>) -> f32 {
    if kind == REFLECTED {
        (*path).reflections += 1u;
        if (*path).reflections > asked(HEAD_REFLECTIONS) { return -1.0; }
    } else {
        (*path).refractions += 1u;
        if (*path).refractions > asked(HEAD_REFRACTIONS) { return -1.0; }
    }
    (*path).importance *= most3(abs(weight));
    let cutoff = bitcast<f32>(asked(HEAD_CUTOFF));
    if (*path).importance >= cutoff { return 1.0; }
    if asked(HEAD_ROULETTE) == 0u { return -1.0; }
⟬    events |= MET_CHANCE;
⟭    let chance = (*path).importance / cutoff;
    var wavelength = 0u;
    if (*path).stratum != NONE { wavelength = tables[stratum_at((*path).stratum)]; }
    let key = path_key(path_key(own_key(*path), wavelength), asked(HEAD_CHANCE));
    (*path).importance = cutoff;
    if unit_of(dimensions(key, HASH_ROULETTE).x) < chance { return 1.0 / chance; }
    return 0.0;
}
// Follows a way on; the way that was to be followed waits.
fn follow(direction: vec3f, weight: vec3f, media: Media, kind: u32, deeper: u32⟨, cone: Cone⟩) {
    var path = now.path;
⟨    path.cone = cone;
⟩    path.media = media;
    path.surfaces += 1u;
    path.splits += deeper;
    path.key = path_key(path.key, select(BRANCH_REFRACTED, BRANCH_REFLECTED, kind == REFLECTED));
    var whole = now.weight * weight;
    let kept = kept_of(weight, kind, &path);
    if kept <= 0.0 {
        if kept < 0.0 && asked(HEAD_BACKGROUND) != 0u { missed += whole * params.beyond; }
        return;
    }
    whole *= kept;
    count(kind);
    wait_for_it();
    next = Branch(spawn(now.surface.point, direction), direction, now.surface.point.position, whole, path);
    follows = true;
}
fn wait_for_it() {
    if !follows { return; }
    waiting[stored] = next;
    stored += 1u;
    follows = false;
}
// Follows both ways on; beyond the depth, only the way through the surface, if there is one. A way without weight is not taken.
fn split(back: vec3f, back_weight: vec3f, enters: bool, on: vec3f, on_weight: vec3f, after: Media⟨, back_cone: Cone, on_cone: Cone⟩) {
    var weight = on_weight;
    var mirrors = !is_black(back_weight);
    let through = enters && !is_black(on_weight);
    let both = mirrors && through;
    let deeper = select(0u, 1u, both && now.path.splits < params.depth);
    if both && deeper == 0u {
        weight = back_weight + weight;
        mirrors = false;
    }
    if through { follow(on, weight, after, REFRACTED, deeper⟨, on_cone⟩); }
    if mirrors { follow(back, back_weight, now.path.media, REFLECTED, deeper⟨, back_cone⟩); }
}
// Keeps the meeting of a path that is divided.
fn divide(part: u32, is_flat: bool, ways: u32) {
⟬    events |= MET_DIVIDED;
⟭    divisions[divided] = Division(now, part, is_flat, 0u, ways, stored);
    divided += 1u;
}

// Whether the path meets a microfacet, which is then stored in `facet`.
fn meets_facet(body: Body, facet: ptr<function, Facet>) -> bool {
    if now.path.sample == NONE || body.alpha <= 0.0 { return false; }
    let alpha = alpha_at(body, now.hit⟨, now.footprint⟩);
    if alpha <= 0.0 { return false; }
    *facet = facet_seen(alpha, interface_normal(now.surface, now.view), now.view, facet_point());
    return true;
}

// Both ways on from the surface of a body: the reflectance, the two directions, the shares that other facets leave of them, and whether
// `bend` used the geometric normal.
struct Ways { reflectance: f32, mirrored: vec3f, enters: bool, refracted: vec3f, kept: vec2f, is_flat: bool⟨, back_cone: Cone, on_cone: Cone⟩ }
// The side of the surface to which a direction goes, by the interpolated normal and by the triangle; 0 where these differ.
fn side_of(direction: vec3f) -> f32 {
    let flat_side = dot3(direction, now.surface.facing);
    if dot3(direction, interface_normal(now.surface, now.view)) * flat_side > 0.0 { return with_sign(1.0, flat_side); }
    return 0.0;
}
⟨// The cone after a mirror of this normal, and after an interface.
fn mirrored_cone(normal: vec3f) -> Cone {
    return cone_mirrored(now.path.cone, curvature_of(now.hit.triangle, now.surface.facing⟪, now.surface.point.normal⟫), -dot3(normal, now.view));
}
fn refracted_cone(bent: Bend, ratio: f32) -> Cone {
    let curvature = curvature_of(now.hit.triangle, now.surface.facing⟪, now.surface.point.normal⟫);
    return cone_refracted(now.path.cone, curvature, -dot3(bent.normal, now.view), bent.meeting.cos_refracted, ratio);
}
⟩fn ways_of(body: Body, ratio: f32) -> Ways {
    var facet: Facet;
    if !meets_facet(body, &facet) {
        let normal = interface_normal(now.surface, now.view);
        let bent = bend(body, now.surface, now.view, ratio);
        return Ways(bent.meeting.reflectance, mirrored(now.view, bent.normal), bent.enters, bent.refracted, vec2f(1.0),
                    any(bent.normal != normal)⟨, mirrored_cone(bent.normal), refracted_cone(bent, ratio)⟩);
    }
    let bent = bent_by(body, facet.normal, now.view, ratio);
    let back = mirrored(now.view, facet.normal);
    let enters = bent.enters && side_of(bent.refracted) < 0.0;
    var kept = vec2f(0.0);
    if side_of(back) > 0.0 { kept.x = passes_facets(facet, back); }
    if enters { kept.y = passes_facets(facet, bent.refracted); }
    return Ways(bent.meeting.reflectance, back, enters, bent.refracted, kept, false⟨, mirrored_cone(facet.normal), refracted_cone(bent, ratio)⟩);
}

// The material of a pane of the report, without own properties.
fn pane() -> Body {
    var body: Body;
    body.curve = vec3f(-1.0);
    return body;
}
// The effect of a thin wall or a pane of the report on the path; returns the weight of the light that it scatters back.
fn meet_flat(body: Body) -> vec3f {
    let view = now.view;
    if body.shape != SHAPE_THIN {
        let bent = bend(pane(), now.surface, view, params.index);
        // Panes after the first surface dim light.
        let kept = select(1.0, GLASS_BOUNCE, now.path.surfaces > 0u);
        split(mirrored(view, bent.normal), vec3f(kept * bent.meeting.reflectance), bent.enters, bent.refracted,
              vec3f(kept * (1.0 - bent.meeting.reflectance)), now.path.media⟨, mirrored_cone(bent.normal), refracted_cone(bent, params.index)⟩);
        return vec3f(0.0);
    }
    var facet: Facet;
    let is_rough = meets_facet(body, &facet);
    let normal = select(interface_normal(now.surface, view), facet.normal, is_rough);
    let meeting = face_of(body, -dot3(normal, view), body.index / index_for(top_of(now.path.media), now.path.stratum));
    let wall = wall_of(meeting.reflectance, kept_across(body, meeting.cos_refracted));
    let back = mirrored(view, normal);
    var back_weight = wall.reflected * body.mirrors;
    var on = view;
    var on_weight = wall.transmitted * filter_of(body, now.hit⟨, now.footprint⟩);
    if is_rough {
        // The reflected light, as far as it stays on the viewer's side. The transmitted light behind the wall is its mirror image.
        let kept = passes_facets(facet, back);
        let is_above = dot3(back, facet.surface) > 0.0;
        on = mirrored(back, facet.surface);
        back_weight *= select(0.0, kept, is_above && dot3(back, now.surface.facing) > 0.0);
        on_weight *= select(0.0, kept, is_above && dot3(on, now.surface.facing) < 0.0);
    }
    split(back, back_weight, true, on, on_weight, now.path.media⟨, mirrored_cone(normal), now.path.cone⟩);
    return body.veil * wall.transmitted;
}

// The effect of glass on the path that meets it; returns the weight of the light that the glass scatters back. `part` is WHOLE for the first
// visit, or else the division that goes on. For a stratum, `is_flat` tells whether the first way was bent by the geometric normal.
fn meet(part: u32, is_flat: bool) -> vec3f {
    if now.path.surfaces >= MOST_SURFACES {
        count(LOST);
        return vec3f(0.0);
    }
    let material = material_of(now.hit.triangle);
    let body = body_at(material, now.hit⟨, now.footprint⟩);
    let divides = now.path.sample == NONE && asked(HEAD_FACET_COUNT) > 0u && body.alpha > 0.0;
    if body.shape != SHAPE_SOLID {
        if body.shape == SHAPE_THIN && divides && alpha_at(body, now.hit⟨, now.footprint⟩) > 0.0 {
            divide(BY_FACET, false, ways_by_facet());
            return vec3f(0.0);
        }
        return meet_flat(body);
    }
    var after = now.path.media;
    let lost = rays[LOST];
    let border = border_of(&after, material, is_front(now.surface));
    // A path that returns for a division is not counted as lost again.
    if part != WHOLE { rays[LOST] = lost; }
    if !border.is_there {
        follow(now.view, vec3f(1.0), after, REFRACTED, 0u⟨, now.path.cone⟩);
        return vec3f(0.0);
    }
    let filter_ = filter_of(body, now.hit⟨, now.footprint⟩);
    if part == BY_COLOR {
        follow_stratum(body, border, filter_, after, is_flat);
        return vec3f(0.0);
    }
    let strata = asked(HEAD_STRATUM_COUNT);
    let disperses = now.path.stratum == NONE && strata > 0u && (bends_apart(border.before) || bends_apart(border.after));
    let ratio = index_for(border.after, now.path.stratum) / index_for(border.before, now.path.stratum);
    if ratio == 1.0 && !disperses {
        follow(now.view, filter_, after, REFRACTED, 0u⟨, now.path.cone⟩);
        return vec3f(body.veil);
    }
    if divides && alpha_at(body, now.hit⟨, now.footprint⟩) > 0.0 {
        divide(BY_FACET, false, ways_by_facet());
        return vec3f(0.0);
    }
    if disperses { return body.veil * disperse(body, border); }
    let ways = ways_of(body, ratio);
    split(ways.mirrored, ways.reflectance * ways.kept.x * body.mirrors, ways.enters, ways.refracted,
          (1.0 - ways.reflectance) * ways.kept.y * filter_, after⟨, ways.back_cone, ways.on_cone⟩);
    return vec3f(body.veil * (1.0 - ways.reflectance));
}

// The colour of the glass that a pixel shows, without the background's part.
fn glass_color(pixel: Pixel, triangle: u32, first: Surface, first_view: vec3f, key: u32) -> vec3f {
    stored = 0u;
    divided = 0u;
    follows = false;
    missed = vec3f(0.0);
    let position = stored_position(pixel).xyz;
    let around = around_eye();
    let path = Path(around, ⟬begin_sample(pixel, ⟭key⟬)⟭, 0u, 0u, NONE, NONE, 1.0, 0u, 0u⟨, cone_at(first)⟩);
    now = Meeting(located(triangle, position), first, first_view, kept_to_eye(pixel, top_of(around)), path⟨,
                  footprint_of(path.cone, triangle, first_view)⟩);
    var part = WHOLE;
    var is_flat = false;
    var meets = true;
    var sum = vec3f(0.0);
    loop {
        // The weight of the surface that is seen where the path is now.
        var weight = vec3f(0.0);
        if meets {
            meets = false;
            weight = meet(part, is_flat) * now.weight;
            part = WHOLE;
        }
        if is_black(weight) {
            if !follows && divided > 0u && stored == divisions[divided - 1u].base {
                let last = divided - 1u;
                let way = divisions[last].following;
                if way == divisions[last].ways {
                    divided = last;
                    continue;
                }
                divisions[last].following = way + 1u;
                now = divisions[last].at;
                part = divisions[last].part;
                is_flat = divisions[last].is_flat;
                take_way(part, way, divisions[last].ways);
                meets = true;
                continue;
            }
            if !follows {
                if stored == 0u { break; }
                stored -= 1u;
                next = waiting[stored];
            }
            follows = false;
            let extinction = extinction_in(next.path.media);
            var hit: Hit;
            if !closest_surface(next.origin, next.direction, &hit) {
                missed += next.weight * transmittance(extinction, HUGE) * params.beyond;
                continue;
            }
⟨            next.path.cone = cone_along(next.path.cone, hit.t);
            let footprint = footprint_of(next.path.cone, hit.triangle, next.direction);
⟩            let surface = surface_hit(next.direction, hit⟪, next.origin⟫⟨, footprint⟩);
            let kept = transmittance(extinction, max(dot3(surface.point.position - next.start, next.direction), 0.0));
            now = Meeting(hit, surface, next.direction, next.weight * kept, next.path⟨, footprint⟩);
            if is_glass(hit.triangle) {
                now.path.importance *= most3(kept);
                meets = true;
                continue;
            }
            weight = now.weight;
        }
        sum += seen_through(now.hit, now.surface, own_key(now.path), weight⟨, now.footprint⟩);
    }
    return sum;
}
fn missed_color() -> vec3f { return missed; }
