// Finds the bodies that the camera is in: those that a line from the camera leaves without having entered them (`eye.rs`).
const MOST_STEPS: u32 = 4096u;

@compute @workgroup_size(1)
fn main() {
    let direction = normalize_or(vec3f(0.352071, 0.631593, 0.690733), vec3f(0.0));
    var origin = params.eye;
    var kept = 0u;
    for (var step = 0u; step < MOST_STEPS; step += 1u) {
        var hit: Hit;
        if !closest_surface(origin, direction, &hit) { break; }
        let surface = surface_hit(direction, hit⟪, origin⟫⟨, NO_FOOTPRINT⟩);
        let material = material_of(hit.triangle);
        if shape_of(material) == SHAPE_SOLID {
            let enters = is_front(surface);
            var through = false;
            if kept > 0u { through = !enters && entered[kept - 1u] && crossed[kept - 1u] == material; }
            if through {
                // A body that is entered and left in succession does not hold the camera.
                kept -= 1u;
            } else if kept < MAX_LINE {
                crossed[kept] = material;
                entered[kept] = enters;
                kept += 1u;
            } else {
                count(LOST);
            }
        }
        origin = spawn(surface.point, direction);
    }
    var media = media_at_start(kept);
    for (var i = 0u; i < MOST_BODIES; i += 1u) { atomicStore(&ray_counts[AROUND_EYE + i], media.list[i]); }
    atomicStore(&ray_counts[AROUND_EYE + MOST_BODIES], media.length);
    count_rays(0u);
}
