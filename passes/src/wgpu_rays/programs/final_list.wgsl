// The points of `final`: surfaces that pixels see, directly and through glass.

// The first and the last point of the pixel so far.
var<private> head: u32 = NONE;
var<private> last: u32 = NONE;
// Called for each end of the tree of rays (`glass.wgsl`); the point's colour is added to the pixel by a later kernel.
fn seen_through(hit: Hit, surface: Surface, key: u32, weight: Weight⟨, footprint: f32⟩) -> vec3f {
    let color = weighed_color(weight, lit_color(hit, surface.normal⟨, footprint⟩));
    // Black stays black, without tracing a ray.
    if head == NO_ROOM || all(color == vec3f(0.0)) { return vec3f(0.0); }
    let place = atomicAdd(&ray_counts[FOUND], 1u);
    if place >= params.capacity {
        // The points of this pixel that were listed before are discarded.
        for (var point = head; point != NONE; point = next_of(point)) { put_nothing(point, next_of(point)); }
        head = NO_ROOM;
        return vec3f(0.0);
    }
    put_lit_point(place, surface, surface.facing, hit.triangle, key, weight_left(weight), color);
    if head == NONE { head = place; } else { points[POINT * last + 3u].w = place; }
    last = place;
    return vec3f(0.0);
}

// Stores a point whose light is found by a later kernel. Few triangles are turned away; their light is found now, divided by SHADOWED,
// because the later kernel multiplies turned points by it.
fn put_lit_point(place: u32, surface: Surface, lit_side: vec3f, triangle: u32, key: u32, weight: f32, color: vec3f) {
    let turned = dot3(lit_side, params.to_light) <= 0.0;
    var lit = color;
    if turned && any(color != vec3f(0.0)) { lit = sep3(color * turned_share(surface, lit_side, triangle)) * (1.0 / SHADOWED); }
    put_point(place, surface, turned, key, weight, lit);
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
        let nothing = glass_color(pixel, triangle, surface, view, key);
        if head == NO_ROOM { rays = array<u32, RAY_COUNT_KINDS>(); }
        put_nothing(slot, head);
        if HAS_BODIES { put_missed(slot, missed_color()); }
        return;
    }
    let lit_side = select(surface.facing, -surface.facing, dot3(stored, surface.facing) < 0.0);
    put_lit_point(slot, surface, lit_side, triangle, key, 1.0, stored_color(pixel).xyz);
}
fn list_nothing(slot: u32) { put_nothing(slot, NONE); }
