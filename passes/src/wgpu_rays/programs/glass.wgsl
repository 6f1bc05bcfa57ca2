// Glass that reflects and refracts, shared by `refraction` and `final`, which say in `seen_through` what is seen there, with its weight.
//
// The processor's code recurses; here the tree of rays is walked with a list of the branches still to be traced, each with the weight of
// its colour. The sum is the same but for the order of its roundings.

// A ray that is still to be traced. At most one a bounce waits while another is followed.
struct Branch { origin: vec3f, direction: vec3f, weight: f32, key: u32, bounces: u32 }

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
    loop {
        var next: Branch;
        var follows = false;
        if splits {
            // The light that the glass sends along `view` splits.
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
            if inside {
                count(REFRACTED);
                next = Branch(spawn(surface.point, refracted), refracted, weight * (1.0 - meeting.reflectance),
                              path_key(key, BRANCH_REFRACTED), bounces);
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
                              path_key(key, BRANCH_REFLECTED), bounces);
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
        let met = surface_hit(next.direction, hit);
        if !glass {
            sum += seen_through(hit, met, next.key, next.weight);
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
