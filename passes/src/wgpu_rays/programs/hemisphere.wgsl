// The points of the unit square for the directions of occlusion rays.

fn point_of_sample(sample: u32, key: u32, seeds: vec2u) -> vec2f {
    if params.strata == 0u {
        let place = params.points_at + 2u * sample;
        return vec2f(unit_of(scramble_reversed(tables[place], seeds.x)), unit_of(scramble_reversed(tables[place + 1u], seeds.y)));
    }
    let jitter = dimensions(key, sample);
    let width = sep(1.0 / f32(params.strata));
    let row = sample / params.strata; let column = sample - row * params.strata;
    return vec2f(
        min(sep((f32(row) + unit_of(jitter.x)) * width), 1.0 - UNIT_ROUNDOFF),
        min(sep((f32(column) + unit_of(jitter.y)) * width), 1.0 - UNIT_ROUNDOFF));
}
