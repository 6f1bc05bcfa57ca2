// Glass that reflects and refracts, shared by `refraction` and `final`. Their `seen_through` gives the weighted colour of a surface seen
// through it.
//
// The processor's code recurses. Here a loop walks the tree of rays with a list of pending branches, each with the weight of its colour.
// The sum is the same up to the order of its roundings.

// A ray that is still to be traced. While one branch is followed, at most one for each bounce waits.
struct Branch { origin: vec3f, direction: vec3f, weight: f32, key: u32, bounces: u32⟨, cone: Cone⟩ }

// The colour of the glass that a pixel shows.
fn glass_color(pixel: Pixel, triangle: u32, first: Surface, first_view: vec3f, first_key: u32) -> vec3f {
    var waiting: array<Branch, MAX_DEPTH + 1u>;
    var stored = 0u;
    var surface = first;
    var view = first_view;
    var key = first_key;
    var weight = 1.0;
    var bounces = 0u;
    var splits = true;
    var sum = vec3f(0.0);
⟨    var cone = cone_at(first);
    var glass_met = triangle;
⟩    loop {
        var next: Branch;
        var follows = false;
        if splits {
            // Splits the light that the glass sends along `view` into a reflected and a refracted ray.
            splits = false;
            var normal = interface_normal(surface, view);
            var meeting = interface_at(-dot3(normal, view), params.index);
            var refracted: vec3f;
            var inside = refracts(meeting, view, normal, params.index, &refracted);
            if inside && dot3(refracted, surface.facing) >= 0.0 {
                normal = surface.facing;
                meeting = interface_at(-dot3(normal, view), params.index);
                inside = refracts(meeting, view, normal, params.index, &refracted);
            }
⟨            let curvature = curvature_of(glass_met, surface.facing⟪, surface.point.normal⟫);
            let cosine = -dot3(normal, view);
⟩            if inside {
                count(REFRACTED);
                next = Branch(spawn(surface.point, refracted), refracted, weight * (1.0 - meeting.reflectance),
                              path_key(key, BRANCH_REFRACTED), bounces⟨,
                              cone_refracted(cone, curvature, cosine, meeting.cos_refracted, params.index)⟩);
                follows = true;
            }
            if meeting.reflectance > 0.0 {
                count(REFLECTED);
                if follows {
                    waiting[stored] = next;
                    stored += 1u;
                }
                let direction = mirrored(view, normal);
                next = Branch(spawn(surface.point, direction), direction, weight * meeting.reflectance,
                              path_key(key, BRANCH_REFLECTED), bounces⟨, cone_mirrored(cone, curvature, cosine)⟩);
                follows = true;
            }
        }
        if !follows {
            if stored == 0u { break; }
            stored -= 1u;
            next = waiting[stored];
        }
        var hit: Hit;
        if !closest_surface(next.origin, next.direction, &hit) { continue; }
        let glass = is_glass(hit.triangle);
        if glass && next.bounces >= params.depth { continue; }
⟨        cone = cone_along(next.cone, hit.t);
        let footprint = footprint_of(cone, hit.triangle, next.direction);
        glass_met = hit.triangle;
⟩        let met = surface_hit(next.direction, hit⟪, next.origin⟫⟨, footprint⟩);
        if !glass {
            sum += seen_through(hit, met, next.key, next.weight⟨, footprint⟩);
            continue;
        }
        surface = met;
        view = next.direction;
        key = next.key;
        weight = GLASS_BOUNCE * next.weight;
        bounces = next.bounces + 1u;
        splits = true;
    }
    return sum;
}
