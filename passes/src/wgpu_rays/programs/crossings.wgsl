// The distances of the glass surfaces that a shadow ray crosses, in order. A ray through the edge between two triangles hits both, so
// distances that differ only by rounding count as one surface. Beyond MAX_CROSSINGS, each counts as a surface of its own.
var<private> crossing: array<f32, MAX_CROSSINGS>;
var<private> crossings_stored: u32;
var<private> crossings_beyond: u32;
fn add_crossing(hit: Hit) {
    if crossings_stored == MAX_CROSSINGS {
        crossings_beyond += 1u;
        return;
    }
    var slot = crossings_stored;
    crossings_stored += 1u;
    while slot > 0u {
        if crossing[slot - 1u] <= hit.t { break; }
        crossing[slot] = crossing[slot - 1u];
        slot -= 1u;
    }
    crossing[slot] = hit.t;
}
fn distinct_crossings() -> u32 {
    var count = crossings_beyond + select(0u, 1u, crossings_stored > 0u);
    for (var i = 1u; i < crossings_stored; i += 1u) {
        if crossing[i] - crossing[i - 1u] > 16.0 * UNIT_ROUNDOFF * crossing[i] { count += 1u; }
    }
    return count;
}
