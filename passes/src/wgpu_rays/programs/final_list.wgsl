// The points of `final`: surfaces that pixels see, directly and through glass.

// The first and the last point of the pixel so far.
var<private> head: u32 = NONE;
var<private> last: u32 = NONE;
// Called for each end of the tree of rays (`glass.wgsl`). A later kernel adds the point's colour to the pixel; a sky's colour is returned here.
fn seen_through(hit: Hit, surface: Surface, key: u32, weight: Weight⟨, footprint: f32⟩) -> vec3f {
    let color = weighed_color(weight, met_color(hit, surface⟨, footprint⟩));
    // Black stays black, without tracing a ray.
    if head == NO_ROOM || all(color == vec3f(0.0)) { return vec3f(0.0); }
    if HAS_BODIES && is_sky(hit.triangle) { return color; }
    let place = atomicAdd(&ray_counts[FOUND], 1u);
    if place >= params.capacity {
        // The points of this pixel that were listed before are discarded.
        for (var point = head; point != NONE; point = next_of(point)) { put_nothing(point, next_of(point)); }
        head = NO_ROOM;
        return vec3f(0.0);
    }
    shaded_as_met(hit, surface, key);
    put_lit_point(place, surface, surface.facing, hit.triangle, key, weight_left(weight), color);
    if head == NONE { head = place; } else { points[POINT * last + 3u].w = place; }
    last = place;
    return vec3f(0.0);
}

fn list(pixel: Pixel, slot: u32) {
    let triangle = stored_triangle(pixel);
    if triangle == NO_TRIANGLE {
        list_nothing(slot);
        return;
    }
    let stored = stored_normal(pixel);
    let point = snap(triangle, stored_position(pixel).xyz);
    let view = normalize_or(point.position - params.eye, -point.normal);
    let surface = surface_of(point, stored, view);
    let key = pixel_key(pixel);
    if is_glass(triangle) {
        let sky = glass_color(pixel, triangle, surface, view, key);
        if head == NO_ROOM { rays = array<u32, RAY_COUNT_KINDS>(); }
        put_nothing(slot, head);
        if HAS_BODIES { put_missed(slot, missed_color() + sky); }
⟬        points[POINT * slot + 2u].w = events;
⟭        return;
    }
    let lit_side = select(surface.facing, -surface.facing, dot3(stored, surface.facing) < 0.0);
    shaded_as_seen(stored, key);
    put_lit_point(slot, surface, lit_side, triangle, key, 1.0, seen_from_eye(pixel, stored_color(pixel).xyz));
}
fn list_nothing(slot: u32) { put_nothing(slot, NONE); }
