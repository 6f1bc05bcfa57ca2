// Some ways on of a path: those of a sample (`Sample` of `effects/dielectric/ways.rs`, `sampled_spectrum` of `solid.rs`). Rough glass divides a path
// into the ways of the sample. Dispersion divides it into these ways, with one stratum each, and light of the reference wavelength.

// The number of the first way, the number of ways, and the stochastic events that the path has met.
var<private> first_way: u32;
var<private> way_count: u32;
var<private> events: u32;
// The weight of the light of the current stratum.
var<private> share: vec3f;

// Begins the sample of a pixel. Returns the key of its random numbers; `key` is the pixel's own.
fn begin_sample(pixel: Pixel, key: u32) -> u32 {
    events = 0u;
    first_way = 0u;
    way_count = 1u;
    let list = tables[params.bodies_at - SAMPLE_WAYS];
    if list == 0u { return key; }
    let place = list + 4u * (pixel.y * params.width + pixel.x);
    first_way = tables[place + 1u];
    way_count = tables[place + 2u];
    return tables[place];
}
// The stochastic events of the sample, to be added to a colour.
fn noted() -> vec4f { return vec4f(0.0, 0.0, 0.0, f32(events)); }

// The place of a way in a shuffled sequence.
fn in_order(way: u32, order: u32) -> u32 {
    return scramble_reversed(reverseBits(tables[params.bodies_at - SAMPLE_OFFSET] + way), order);
}
// The second dimension of a Sobol point, bits reversed. Its matrix is Pascal's triangle modulo 2, so each bit is the sum of the bits of all places
// that contain its own place.
fn second_sobol(index: u32) -> u32 {
    var v = index;
    v ^= v >> 1u & 0x55555555u;
    v ^= v >> 2u & 0x33333333u;
    v ^= v >> 4u & 0x0f0f0f0fu;
    v ^= v >> 8u & 0x00ff00ffu;
    return v ^ v >> 16u;
}
// The point that chooses the microfacet of the current path.
fn facet_point() -> vec2f {
    let key = now.path.key;
    let index = in_order(now.path.sample, dimensions(key, HASH_FACET_ORDER).x);
    let seeds = dimensions(key, HASH_FACETS);
    return vec2f(unit_of(scramble_reversed(index, seeds.x)), unit_of(scramble_reversed(second_sobol(index), seeds.y)));
}
// The stratum of a way.
fn stratum_of_way(way: u32) -> u32 {
    let seeds = dimensions(now.path.key, HASH_SPECTRUM);
    let place = scramble_reversed(in_order(way, seeds.y), seeds.x);
    // The high word of the product of the place and the number of strata, which is below 2^16.
    let strata = asked(HEAD_STRATUM_COUNT);
    return ((place >> 16u) * strata + ((place & 0xffffu) * strata >> 16u)) >> 16u;
}
// The weight of a stratum, where the spectrum is divided into that many ways.
fn stratum_weight(stratum: u32, ways: u32) -> vec3f {
    return sep3(table_vector(stratum_at(stratum) + 1u) * (f32(asked(HEAD_STRATUM_COUNT)) / f32(ways)));
}

// The number of ways on from rough glass.
fn ways_by_facet() -> u32 { return way_count; }
// The first way, and the number of ways, into which the spectrum divides the current path.
fn ways_by_color() -> vec2u {
    if now.path.sample != NONE { return vec2u(now.path.sample, 1u); }
    return vec2u(first_way, way_count);
}
// Makes the current path one of the ways into which it is divided. Its importance is not divided, so that cut-offs do not depend on the number
// of ways.
fn take_way(part: u32, way: u32, ways: u32) {
    if part == BY_FACET {
        now.path.sample = first_way + way;
        now.weight *= 1.0 / f32(ways);
        return;
    }
    // The first way is light of the reference wavelength, whose weight `disperse` has found. It follows the last stratum in the table.
    now.path.stratum = asked(HEAD_STRATUM_COUNT);
    if way == 0u { return; }
    let number = ways_by_color().x + way - 1u;
    now.path.sample = number;
    now.path.stratum = stratum_of_way(number);
    share = stratum_weight(now.path.stratum, ways - 1u);
}

// The ways on for light of a stratum at the surface that disperses colours. Light of the reference wavelength has the material's own index.
fn ways_of_stratum(body: Body, border: Border, stratum: u32) -> Ways {
    let own = select(stratum, NONE, stratum == asked(HEAD_STRATUM_COUNT));
    return ways_of(body, index_for(border.after, own) / index_for(border.before, own));
}
// The reflected light of all ways, the share that enters, and whether both ways on are followed.
struct Together { is_flat: bool, back: vec3f, entering: vec3f, deeper: u32 }
fn add_stratum(sum: ptr<function, Together>, body: Body, ways: Ways, weight: vec3f) {
    let splits = now.path.splits < params.depth;
    let back = weight * (ways.reflectance * ways.kept.x) * body.mirrors;
    (*sum).entering += weight * (1.0 - ways.reflectance);
    if ways.enters && splits && !is_black(back) { (*sum).deeper = 1u; }
    if ways.is_flat == (*sum).is_flat && !(ways.enters && !splits) { (*sum).back += back; }
}
// Divides the spectrum: reflected light stays together and waits, and the strata follow. Returns the share that enters. The weight of light
// of the reference wavelength is 1 minus the sum of the strata's weights.
fn disperse(body: Body, border: Border) -> vec3f {
    let reference = ways_of_stratum(body, border, asked(HEAD_STRATUM_COUNT));
    let ways = ways_by_color();
    var sum = Together(reference.is_flat, vec3f(0.0), vec3f(0.0), 0u);
    var rest = vec3f(1.0);
    for (var i = 0u; i < ways.y; i += 1u) {
        let stratum = stratum_of_way(ways.x + i);
        let weight = stratum_weight(stratum, ways.y);
        rest -= weight;
        if !is_black(weight) { add_stratum(&sum, body, ways_of_stratum(body, border, stratum), weight); }
    }
    if !is_black(rest) { add_stratum(&sum, body, reference, rest); }
    if !is_black(sum.back) { follow(reference.mirrored, sum.back, now.path.media, REFLECTED, sum.deeper⟨, reference.back_cone⟩); }
    wait_for_it();
    divide(BY_COLOR, reference.is_flat, 1u + ways.y);
    share = rest;
    return sum.entering;
}
// Takes one stratum.
fn follow_stratum(body: Body, border: Border, filter_: vec3f, after: Media, is_flat: bool) {
    if is_black(share) { return; }
    let splits = now.path.splits < params.depth;
    let ways = ways_of_stratum(body, border, now.path.stratum);
    let back = share * (ways.reflectance * ways.kept.x) * body.mirrors;
    var through = share * ((1.0 - ways.reflectance) * ways.kept.y) * filter_;
    if ways.enters && !splits { through += back; }
    // The importance excludes the weight of the stratum, so that cut-offs do not depend on the number of ways.
    now.path.importance /= most3(abs(share));
    if ways.enters { follow(ways.refracted, through, after, REFRACTED, select(0u, 1u, splits)⟨, ways.on_cone⟩); }
    // Light of the stratum that is reflected by another normal than light of the reference wavelength. That is rare.
    let apart = ways.is_flat != is_flat && !(ways.enters && !splits);
    if apart && !is_black(back) { follow(ways.mirrored, back, now.path.media, REFLECTED, 0u⟨, ways.back_cone⟩); }
}
