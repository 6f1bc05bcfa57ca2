// A direction to the disc of a light: uniform in the solid angle of a cone around the basis's normal (`sampling/cone.rs`).
fn disc_direction(sample: u32, seeds: vec2u, basis: Basis) -> vec3f {
    let place = tables[params.lights_at + 4u] + 2u * sample;
    let point = vec2f(unit_of(scramble_reversed(tables[place], seeds.x)), unit_of(scramble_reversed(tables[place + 1u], seeds.y)));
    let height = table_number(params.lights_at + 3u);
    let disk = concentric_disk(point);
    let below = sep((sep(disk.x * disk.x) + sep(disk.y * disk.y)) * height);
    let stretch = sep(sqrt(sep(height * (2.0 - below))));
    return to_world(basis, vec3f(sep(disk.x * stretch), sep(disk.y * stretch), 1.0 - below));
}
// The key of the random numbers of a light.
fn light_key(number: u32) -> u32 {
    if number == 0u { return shading.key; }
    return path_key(shading.key, BRANCH_LIGHTS + number);
}

