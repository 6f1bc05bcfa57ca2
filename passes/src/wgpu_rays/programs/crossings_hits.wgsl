// The hits of a shadow ray on glass, ordered by distance. A ray through the edge between two triangles hits both, so distances that differ
// only by rounding count as one surface. Beyond MAX_CROSSINGS, each counts as a surface of its own.
var<private> crossing: array<Hit, MAX_CROSSINGS>;
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
        let before = crossing[slot - 1u];
        if before.t < hit.t || (before.t == hit.t && before.triangle <= hit.triangle) { break; }
        crossing[slot] = crossing[slot - 1u];
        slot -= 1u;
    }
    crossing[slot] = hit;
}
fn distinct_crossings() -> u32 {
    var count = crossings_beyond + select(0u, 1u, crossings_stored > 0u);
    for (var i = 1u; i < crossings_stored; i += 1u) {
        if crossing[i].t - crossing[i - 1u].t > 16.0 * UNIT_ROUNDOFF * crossing[i].t { count += 1u; }
    }
    return count;
}
