// All ways on that the pass asks for (`AllWays` of `effects/dielectric/ways.rs`): as many from rough glass as it has paths, and one for each stratum
// of the spectrum.

// The point that chooses the microfacet of the current path.
fn facet_point() -> vec2f {
    let place = asked(HEAD_FACETS) + 2u * now.path.sample;
    let seeds = dimensions(now.path.key, HASH_FACETS);
    return vec2f(unit_of(scramble_reversed(tables[place], seeds.x)), unit_of(scramble_reversed(tables[place + 1u], seeds.y)));
}
// The number of ways on from rough glass.
fn ways_by_facet() -> u32 { return asked(HEAD_FACET_COUNT); }
// Makes the current path one of the ways into which it is divided.
fn take_way(part: u32, way: u32, ways: u32) {
    if part == BY_COLOR {
        now.path.stratum = way;
    } else {
        let share = 1.0 / f32(ways);
        now.path.sample = way;
        now.path.importance *= share;
        now.weight *= share;
    }
}

// The effect on light of one stratum at the surface of a body that disperses colours, and the weights. Beyond the depth, light goes through the
// surface with the weight of both ways.
struct Stratum { ways: Ways, share: vec3f, back: vec3f, through: vec3f }
fn stratum_of(body: Body, border: Border, stratum: u32) -> Stratum {
    let ways = ways_of(body, index_for(border.after, stratum) / index_for(border.before, stratum));
    let share = table_vector(stratum_at(stratum) + 1u);
    let back = share * (ways.reflectance * ways.kept.x) * body.mirrors;
    let through = share * ((1.0 - ways.reflectance) * ways.kept.y);
    return Stratum(ways, share, back, through);
}
// Takes all strata: reflected light stays together and waits, and the strata follow. Returns the share that enters.
fn disperse(body: Body, border: Border) -> vec3f {
    let splits = now.path.splits < params.depth;
    var direction: vec3f;
    var is_flat = false;
    var together = vec3f(0.0);
    var entering = vec3f(0.0);
    var deeper = 0u;
⟨    var cone: Cone;
⟩    let strata = asked(HEAD_STRATUM_COUNT);
    for (var i = 0u; i < strata; i += 1u) {
        let stratum = stratum_of(body, border, i);
        entering += stratum.share * (1.0 - stratum.ways.reflectance);
        let goes_on = stratum.ways.enters && !splits;
        if stratum.ways.enters && splits && !is_black(stratum.back) { deeper = 1u; }
        if i == 0u {
            direction = stratum.ways.mirrored;
            is_flat = stratum.ways.is_flat;
⟨            cone = stratum.ways.back_cone;
⟩        }
        if stratum.ways.is_flat == is_flat && !goes_on { together += stratum.back; }
    }
    if !is_black(together) { follow(direction, together, now.path.media, REFLECTED, deeper⟨, cone⟩); }
    wait_for_it();
    divide(BY_COLOR, is_flat, strata);
    return entering;
}
// Takes one stratum.
fn follow_stratum(body: Body, border: Border, filter_: vec3f, after: Media, is_flat: bool) {
    let splits = now.path.splits < params.depth;
    let stratum = stratum_of(body, border, now.path.stratum);
    let ways = stratum.ways;
    var through = stratum.through * filter_;
    if ways.enters && !splits { through += stratum.back; }
    if ways.enters { follow(ways.refracted, through, after, REFRACTED, select(0u, 1u, splits)⟨, ways.on_cone⟩); }
    // Light of the stratum that is reflected by another normal than light of the first stratum. That is rare.
    let apart = ways.is_flat != is_flat && !(ways.enters && !splits);
    if apart && !is_black(stratum.back) { follow(ways.mirrored, stratum.back, now.path.media, REFLECTED, 0u⟨, ways.back_cone⟩); }
}
