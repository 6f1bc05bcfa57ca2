// Paths through smooth glass, with all ways on and all colours together (`effects/dielectric/walk.rs`), in front of a background. A program's
// `seen_through` gives the colour seen at an end, with the path's weight by colour. `ways.wgsl` replaces this text where glass is rough or
// disperses colours, or where paths are cut off.
//
// The processor's code recurses. Here a loop walks the tree of rays with a list of the branches still to be traced, each with the weight of
// its colour. The sum is the same up to the order of its roundings.

// A ray that is still to be traced; `start` is the point of the surface that it leaves, before the offset.
struct Branch {
    origin: vec3f,
    direction: vec3f,
    start: vec3f,
    weight: vec3f,
    media: Media,
    key: u32,
    surfaces: u32,
    splits: u32,
⟨    cone: Cone,
⟩}

// The remaining work of a pixel's walk.
var<private> waiting: array<Branch, MAX_DEPTH + 1u>;
var<private> stored: u32;
var<private> next: Branch;
var<private> follows: bool;
// The colour that the background adds where rays leave the scene.
var<private> missed: vec3f;

// The path that has arrived at the current surface of glass.
struct Path { weight: vec3f, media: Media, key: u32, surfaces: u32, splits: u32⟨, cone: Cone⟩ }
fn follow(surface: Surface, path: Path, direction: vec3f, weight: vec3f, media: Media, kind: u32, deeper: u32⟨, cone: Cone⟩) {
    count(kind);
    let branch = select(BRANCH_REFRACTED, BRANCH_REFLECTED, kind == REFLECTED);
    next = Branch(spawn(surface.point, direction), direction, surface.point.position, path.weight * weight, media,
                  path_key(path.key, branch), path.surfaces + 1u, path.splits + deeper⟨, cone⟩);
    follows = true;
}
// Follows both ways on; beyond the depth, only the way through the surface, if there is one. A way without weight is not taken.
fn split(surface: Surface, path: Path, back: vec3f, back_weight: vec3f, enters: bool, on: vec3f, on_weight: vec3f, after: Media⟨,
         back_cone: Cone, on_cone: Cone⟩) {
    var weight = on_weight;
    var mirrors = !is_black(back_weight);
    let through = enters && !is_black(on_weight);
    // Where all glass is panes, deeper paths are black, as in the report.
    let panes = params.bodies_at == 0u;
    let splits = panes || path.splits < params.depth;
    let deeper = select(0u, 1u, panes || (mirrors && through && splits));
    if mirrors && through && !splits {
        weight = back_weight + weight;
        mirrors = false;
    }
    if through { follow(surface, path, on, weight, after, REFRACTED, deeper⟨, on_cone⟩); }
    if !mirrors { return; }
    if follows {
        waiting[stored] = next;
        stored += 1u;
    }
    follow(surface, path, back, back_weight, path.media, REFLECTED, deeper⟨, back_cone⟩);
}

// The effect of glass on a ray that meets it; returns the weight of the light that the glass scatters back.
fn meet(hit: Hit, surface: Surface, view: vec3f, path: Path⟨, footprint: f32⟩) -> vec3f {
    follows = false;
    if path.surfaces >= MOST_SURFACES {
        count(LOST);
        return vec3f(0.0);
    }
    let material = material_of(hit.triangle);
    var shape = SHAPE_PANE;
    var body: Body;
    if params.bodies_at != 0u {
        body = body_at(material, hit⟨, footprint⟩);
        shape = body.shape;
    }
    var after = path.media;
    var ratio = params.index;
    if shape == SHAPE_SOLID { ratio = cross_border(&after, material, is_front(surface)); }
    // The ways on. The refracted one goes straight on unless the surface bends it.
    var on = view;
    var enters = true;
    var back = vec3f(0.0);
    var back_weight = vec3f(0.0);
    var on_weight = vec3f(1.0);
    var veil = vec3f(0.0);
⟨    // A thin wall's two faces undo each other's bending.
    var back_cone = path.cone;
    var on_cone = path.cone;
    let curvature = curvature_of(hit.triangle, surface.facing⟪, surface.point.normal⟫);
⟩    if shape == SHAPE_THIN {
        let normal = interface_normal(surface, view);
        let meeting = face_of(body, -dot3(normal, view), body.index / index_in(path.media));
        let wall = wall_of(meeting.reflectance, kept_across(body, meeting.cos_refracted));
        back = mirrored(view, normal);
⟨        back_cone = cone_mirrored(path.cone, curvature, -dot3(normal, view));
⟩        back_weight = wall.reflected;
        on_weight = wall.transmitted;
        veil = on_weight;
    } else if ratio != 0.0 && (shape != SHAPE_SOLID || ratio != 1.0) {
        let bent = bend(body, surface, view, ratio);
        // Of the report's panes, those after the first one dim light.
        let kept = select(1.0, GLASS_BOUNCE, shape != SHAPE_SOLID && path.surfaces > 0u);
        back = mirrored(view, bent.normal);
⟨        back_cone = cone_mirrored(path.cone, curvature, -dot3(bent.normal, view));
        on_cone = cone_refracted(path.cone, curvature, -dot3(bent.normal, view), bent.meeting.cos_refracted, ratio);
⟩        back_weight = vec3f(kept * bent.meeting.reflectance);
        on = bent.refracted;
        enters = bent.enters;
        on_weight = vec3f(kept * (1.0 - bent.meeting.reflectance));
        veil = on_weight;
    } else {
        veil = on_weight;
    }
    // Panes, and places without a surface, neither filter nor scatter light.
    let filters = shape == SHAPE_THIN || (shape == SHAPE_SOLID && ratio != 0.0);
    if filters { on_weight *= filter_of(body, hit⟨, footprint⟩); }
    split(surface, path, back, back_weight, enters, on, on_weight, after⟨, back_cone, on_cone⟩);
    return select(vec3f(0.0), body.veil * veil, filters);
}

// The colour of the glass that a pixel shows, without the background's part.
fn glass_color(pixel: Pixel, triangle: u32, first: Surface, first_view: vec3f, key: u32) -> vec3f {
    stored = 0u;
    missed = vec3f(0.0);
    let position = stored_position(pixel).xyz;
    var path = Path(vec3f(1.0), around_eye(), key, 0u, 0u⟨, cone_at(first)⟩);
    path.weight = kept_to_eye(pixel, top_of(path.media));
    var hit = located(triangle, position);
    var surface = first;
    var view = first_view;
    var meets = true;
⟨    var footprint = footprint_of(path.cone, triangle, first_view);
⟩    var sum = vec3f(0.0);
    loop {
        var weight = vec3f(0.0);
        var end_key = path.key;
        if meets {
            meets = false;
            weight = path.weight * meet(hit, surface, view, path⟨, footprint⟩);
        }
        if is_black(weight) {
            if !follows {
                if stored == 0u { break; }
                stored -= 1u;
                next = waiting[stored];
            }
            follows = false;
            let extinction = extinction_in(next.media);
            if !closest_surface(next.origin, next.direction, &hit) {
                missed += next.weight * transmittance(extinction, HUGE) * params.beyond;
                continue;
            }
            let glass = is_glass(hit.triangle);
            if glass && params.bodies_at == 0u && next.splits > params.depth { continue; }
⟨            let cone = cone_along(next.cone, hit.t);
            footprint = footprint_of(cone, hit.triangle, next.direction);
⟩            surface = surface_hit(next.direction, hit⟪, next.origin⟫⟨, footprint⟩);
            let length = max(dot3(surface.point.position - next.start, next.direction), 0.0);
            weight = next.weight * transmittance(extinction, length);
            if glass {
                view = next.direction;
                path = Path(weight, next.media, next.key, next.surfaces, next.splits⟨, cone⟩);
                meets = true;
                continue;
            }
            end_key = next.key;
        }
        sum += seen_through(hit, surface, end_key, weight⟨, footprint⟩);
    }
    return sum;
}
fn missed_color() -> vec3f { return missed; }
