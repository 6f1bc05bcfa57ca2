// Light that photons bring to surfaces from the bodies of glass meshes (`effects/dielectric/photons.rs` and `photon_map.rs`). The numbers are the
// processor's step by step, so that the same photons count.

// The place in the tables of the photons (`photons.rs` of this backend).
fn photons_at() -> u32 { return tables[params.bodies_at + HEAD_PHOTONS]; }

// The cell of a point that is given in cells. Cells are so wide that their numbers are below 2^21 (`cells_a_unit` in `photon_map.rs`).
fn cell_of(point: vec3f) -> vec3u { return bitcast<vec3u>(vec3i(floor(point))); }
// The entry of a cell in a table whose length is a power of two.
fn entry_of(cell: vec3u, entries: u32) -> u32 {
    let mixed = (cell.x * 73856093u) ^ (cell.y * 19349663u) ^ (cell.z * 83492791u);
    return (mixed ^ (mixed >> 15u)) & (entries - 1u);
}

// The light that photons add at the surface `lit`, as a share of its colour. Each photon that landed nearby, on the side that is lit, counts as a
// light of the photon's direction. Its irradiance is weighted by the kernel.
fn light_of_photons() -> vec3f {
    var light = vec3f(0.0);
    let head = photons_at();
    for (var number = 0u; number < tables[head]; number += 1u) {
        // The photons of one target (`CLOUD_WORDS`).
        let cloud = head + 1u + CLOUD_WORDS * number;
        let photons = tables[cloud];
        let starts = tables[cloud + 1u];
        let entries = tables[cloud + 2u];
        let radius = table_number(cloud + 9u);
        let cells_a_unit = table_number(cloud + 10u);
        let greatest_weight = table_number(cloud + 11u);
        let low = table_vector(cloud + 3u) - radius;
        let high = table_vector(cloud + 6u) + radius;
        if any(lit.position < low) || any(lit.position > high) { continue; }
        let square = sep(radius * radius);
        let first = cell_of(sep3(lit.position - radius) * cells_a_unit);
        let last = cell_of(sep3(lit.position + radius) * cells_a_unit);
        // Two cells may share an entry of the table; its photons count once.
        var seen: array<u32, 8>;
        for (var corner = 0u; corner < 8u; corner += 1u) {
            let is_last = (vec3u(corner) & vec3u(1u, 2u, 4u)) != vec3u(0u);
            let entry = entry_of(select(first, last, is_last), entries);
            var is_new = true;
            for (var other = 0u; other < corner; other += 1u) { is_new = is_new && seen[other] != entry; }
            seen[corner] = entry;
            if !is_new { continue; }
            let end = tables[starts + entry + 1u];
            for (var photon = tables[starts + entry]; photon < end; photon += 1u) {
                let place = photons + PHOTON_WORDS * photon;
                let from_point = table_vector(place) - lit.position;
                let height = sep(dot3(from_point, lit.facing));
                let distance = sep(dot3(from_point, from_point)) - sep(height * height);
                if !(distance < square && abs(height) <= sep(PHOTON_FLAT * radius)) { continue; }
                let direction = table_vector(place + 3u);
                let normal = table_vector(place + 6u);
                if !(dot3(normal, lit.facing) >= PHOTON_ALIKE && dot3(direction, lit.facing) < 0.0) { continue; }
                let weight = greatest_weight * (1.0 - max(distance, 0.0) / square);
                let cosine = max(-dot3(direction, normal), PHOTON_GRAZING);
                light += table_vector(place + 9u) * (weight / cosine) * share_from(-direction);
            }
        }
    }
    return light;
}
