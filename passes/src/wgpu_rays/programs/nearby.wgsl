// The triangles near the points of a group are gathered once; the rays of a point are tested only against triangles that they may hit.

// Greatest number of nodes that wait to be opened, and of rounds, each of which opens up to 32.
const WAITING: u32 = 320u;
const ROUNDS: u32 = 160u;
// Capacity of the list of triangles; and number of facets that are tested together (the buffer holds as many again for the next round).
const LISTED: u32 = 512u;
const FACETS: u32 = 32u;
// Points share a list if they are no farther apart than this many radii. With 1, a picture takes 1.2 ms longer (of 8.5) on an H200: lists
// are expensive to gather.
const NEIGHBOURS: f32 = 4.0;
// Greatest number of triangles that one point may see within the radius, or within a part of it. With more, tracing its rays is faster.
const SEEN: u32 = 128u;
const SEEN_NEARER: u32 = 96u;

var<workgroup> list: array<u32, 512>;
var<workgroup> waiting: array<u32, 320>;
var<workgroup> leaf_list: array<u32, 64>;
var<workgroup> near_list: array<u32, 128>;
var<workgroup> facets: array<vec4f, 256>;
var<workgroup> zone_low: array<vec4f, 32>;
var<workgroup> zone_high: array<vec4f, 32>;

// A box, and a plane behind which nothing counts; `has_plane` is false where there is no plane.
struct Zone { low: vec3f, high: vec3f, origin: vec3f, normal: vec3f, has_plane: bool }
// An upper bound of the height of a box above a plane (`trace/tree/volumes.rs`).
fn height_bound(low: vec3f, high: vec3f, origin: vec3f, normal: vec3f) -> f32 {
    let a = (low - origin) * normal; let b = (high - origin) * normal;
    let most = max(a, b); let size = max(most, -min(a, b));
    let each = most + size * SIDE_ERROR;
    return each.x + each.y + each.z;
}
fn zone_meets(zone: Zone, low: vec3f, high: vec3f) -> bool {
    if any(low > zone.high) || any(high < zone.low) { return false; }
    return !zone.has_plane || height_bound(low, high, zone.origin, zone.normal) > 0.0;
}
fn zone_meets_triangle(zone: Zone, corners: Corners) -> bool {
    let a = corners.a; let b = corners.b; let c = corners.c;
    if any(min(min(a, b), c) > zone.high) || any(max(max(a, b), c) < zone.low) { return false; }
    return !zone.has_plane || !(is_behind(a - zone.origin, zone.normal) && is_behind(b - zone.origin, zone.normal) &&
                                is_behind(c - zone.origin, zone.normal));
}
// The zone that contains all rays of a fan up to a distance; `bounded` is false where it overflows.
fn zone_of(origin: vec3f, facing: vec3f, distance: f32, bounded: ptr<function, bool>) -> Zone {
    let radius = distance * LONGEST;
    // The extreme point of the half ball against the normal lies on its rim.
    let rim = min(sqrt(max(vec3f(1.0) - facing * facing, vec3f(0.0))) + vec3f(RIM_ERROR), vec3f(1.0));
    let up = facing >= vec3f(0.0);
    let pad = (vec3f(radius) + abs(origin)) * END_ERROR + slack_around(origin);
    let low = origin - radius * select(vec3f(1.0), rim, up) - pad;
    let high = origin + radius * select(rim, vec3f(1.0), up) + pad;
    *bounded = is_finite3(low) && is_finite3(high);
    return Zone(low, high, origin, facing, true);
}
// The zone that holds the zones of all members. If all face the same way, what lies behind all of them is excluded.
fn zone_of_members(members: u32, own: Zone, facing: vec3f) -> Zone {
    zone_low[lane] = vec4f(own.low, 0.0);
    zone_high[lane] = vec4f(own.high, 0.0);
    workgroupBarrier();
    let same = ballot(all(own.normal == facing));
    var zone = Zone(vec3f(HUGE), vec3f(-HUGE), vec3f(0.0), facing, (same & members) == members);
    let sign = select(vec3f(-1.0), vec3f(1.0), facing >= vec3f(0.0));
    var turned = vec3f(HUGE);
    for (var left = members; left != 0u; left &= left - 1u) {
        let member = firstTrailingBit(left);
        zone.low = min(zone.low, zone_low[member].xyz);
        zone.high = max(zone.high, zone_high[member].xyz);
        turned = min(turned, sign * fan_origin[member].xyz);
    }
    zone.origin = sign * turned;
    return zone;
}

// The children of a node that meet a zone; NONE for a child that does not.
fn met_children(zone: Zone, index: u32) -> vec2u {
    let a = bitcast<vec4f>(nodes_at(4u * index)); let b = bitcast<vec4f>(nodes_at(4u * index + 1u));
    let z = bitcast<vec4f>(nodes_at(4u * index + 2u));
    let children = nodes_at(4u * index + 3u).xy;
    return vec2u(
        select(NONE, children.x, zone_meets(zone, vec3f(a.x, a.z, z.x), vec3f(a.y, a.w, z.y))),
        select(NONE, children.y, zone_meets(zone, vec3f(b.x, b.z, z.z), vec3f(b.y, b.w, z.w))));
}
fn is_leaf(child: u32) -> bool { return child != NONE && (child & LEAF) != 0u; }

// The node that contains everything that the last `gather` found.
var<private> below: u32;
// Lists the triangles that meet a zone; returns their number, or a negative number if there are too many or the search takes too long. Each
// thread opens one node at a time.
fn gather(zone: Zone, top: u32) -> i32 {
    var waits = 1u;
    var found = 0u;
    var alone = true;
    below = top;
    if lane == 0u { waiting[0] = top; }
    workgroupBarrier();
    for (var round = 0u; waits > 0u; round += 1u) {
        if round == ROUNDS { return -1; }
        let opened = min(waits, GROUP);
        waits -= opened;
        var met = vec2u(NONE);
        if lane < opened {
            let node = waiting[waits + lane];
            if (node & LEAF) != 0u { met.x = node; } else { met = met_children(zone, node); }
        }
        let leaf_x = is_leaf(met.x); let leaf_y = is_leaf(met.y);
        let bits = ballots(vec4<bool>(met.x != NONE && !leaf_x, met.y != NONE && !leaf_y, leaf_x, leaf_y));
        let inner = countOneBits(bits.x); let inner_all = inner + countOneBits(bits.y);
        let leaves_x = countOneBits(bits.z); let leaves_all = leaves_x + countOneBits(bits.w);
        if waits + inner_all > WAITING { return -1; }
        if met.x != NONE {
            if leaf_x { leaf_list[before(bits.z)] = met.x; } else { waiting[waits + before(bits.x)] = met.x; }
        }
        if met.y != NONE {
            if leaf_y { leaf_list[leaves_x + before(bits.w)] = met.y; } else { waiting[waits + inner + before(bits.y)] = met.y; }
        }
        waits += inner_all;
        workgroupBarrier();
        alone = alone && inner_all == 1u && leaves_all == 0u;
        if alone { below = waiting[0]; }
        // The boxes of these leaves meet the zone; the triangles themselves may not. A leaf holds up to four.
        for (var base = 0u; base < 4u * leaves_all; base += GROUP) {
            var triangle = 0u;
            var meets = false;
            if base + lane < 4u * leaves_all {
                let leaf = leaf_list[(base + lane) / 4u];
                let member = (base + lane) % 4u;
                if member <= (leaf >> COUNT_SHIFT & 3u) {
                    triangle = (leaf & FIRST_OF_LEAF) + member;
                    meets = zone_meets_triangle(zone, load_triangle(triangle).corners);
                }
            }
            let bits = ballot(meets);
            let more = countOneBits(bits);
            if found + more > LISTED { return -1; }
            if meets { list[found + before(bits)] = triangle; }
            found += more;
        }
    }
    workgroupBarrier();
    return i32(found);
}

// Greatest number of nodes that the search for a clear hemisphere opens, and greatest number that wait.
const CLEAR_VISITS: u32 = 96u;
const CLEAR_WAITING: u32 = 32u;
// Whether certainly nothing is in reach of a fan; everything in reach must lie below node `top`. False means that this is not known.
fn is_clear(zone: Zone, top: u32) -> bool {
    if (top & LEAF) != 0u { return false; }
    var pending: array<u32, 32>;
    var count = 1u;
    pending[0] = top;
    for (var visit = 0u; visit < CLEAR_VISITS; visit += 1u) {
        count -= 1u;
        let met = met_children(zone, pending[count]);
        for (var side = 0u; side < 2u; side += 1u) {
            let child = select(met.y, met.x, side == 0u);
            if child == NONE { continue; }
            if (child & LEAF) == 0u {
                if count == CLEAR_WAITING { return false; }
                pending[count] = child;
                count += 1u;
                continue;
            }
            for (var member = 0u; member <= (child >> COUNT_SHIFT & 3u); member += 1u) {
                if zone_meets_triangle(zone, load_triangle((child & FIRST_OF_LEAF) + member).corners) { return false; }
            }
        }
        if count == 0u { return true; }
    }
    return false;
}

// Up to 128 rays of one fan: up to three full slots with one ray for each thread, and a last slot of `rest` rays. Each ray of the last slot is
// tested by several threads against different facets, so that no thread idles.
var<private> ray_0: vec3f;
var<private> ray_1: vec3f;
var<private> ray_2: vec3f;
var<private> ray_3: vec3f;
var<private> whole: u32;
var<private> rest: u32;
// Base-2 logarithm of the number of threads for each ray of the last slot.
var<private> parts: u32;
// Blocked rays, one bit for each slot.
var<private> blocked: u32;
// Rays that some facet left undecided, one bit for each slot.
var<private> unsure: u32;

// Makes `count` rays from `first` on; false if a direction is too long for the facets' bounds, or not finite.
fn make_rays(owner: u32, first: u32, count: u32) -> bool {
    whole = min(count / GROUP, 3u);
    rest = count - GROUP * whole;
    parts = 0u;
    if rest == 1u { parts = 5u; } else if rest > 1u { parts = countLeadingZeros(rest - 1u) - 27u; }
    blocked = 0u;
    unsure = 0u;
    var longer = false;
    for (var slot = 0u; slot < 4u; slot += 1u) {
        if slot < 3u && slot >= whole { continue; }
        if slot == 3u && rest == 0u { continue; }
        let within = select(GROUP * whole + (lane & ((GROUP >> parts) - 1u)), GROUP * slot + lane, slot < 3u);
        let d = fan_direction(owner, first + min(within, count - 1u));
        longer = longer || !(dot(d, d) <= LONGEST) || !is_finite3(d);
        if slot == 0u { ray_0 = d; } else if slot == 1u { ray_1 = d; } else if slot == 2u { ray_2 = d; } else { ray_3 = d; }
    }
    return ballot(longer) == 0u;
}

// The verdict on a ray: 1 if it is certainly stopped, 2 if undecided, 0 if certainly missed.
fn judge(a: vec4f, b: vec4f, c: vec4f, normal: vec4f, direction: vec3f) -> u32 {
    let least = min(min(dot(direction, a.xyz), dot(direction, b.xyz)), dot(direction, c.xyz));
    let depth = dot(direction, normal.xyz);
    let miss = least <= -1.0 || depth <= a.w;
    let hit = least >= 1.0 && depth >= b.w;
    return select(select(2u, 0u, miss), 1u, hit);
}
// Tests the rays against facets `begin` to `begin + count`, at most 32.
fn test_rays(begin: u32, count: u32) {
    for (var f = 0u; f < count && whole > 0u; f += 1u) {
        let at = 4u * (begin + f);
        let a = facets[at]; let b = facets[at + 1u]; let c = facets[at + 2u]; let normal = facets[at + 3u];
        let first = judge(a, b, c, normal, ray_0);
        blocked |= first & 1u;
        unsure |= first >> 1u;
        if whole > 1u {
            let second = judge(a, b, c, normal, ray_1);
            blocked |= (second & 1u) << 1u;
            unsure |= second >> 1u << 1u;
        }
        if whole > 2u {
            let third = judge(a, b, c, normal, ray_2);
            blocked |= (third & 1u) << 2u;
            unsure |= third >> 1u << 2u;
        }
    }
    let within = GROUP >> parts;
    if (lane & (within - 1u)) < rest {
        for (var f = lane / within; f < count; f += 1u << parts) {
            let at = 4u * (begin + f);
            let fourth = judge(facets[at], facets[at + 1u], facets[at + 2u], facets[at + 3u], ray_3);
            blocked |= (fourth & 1u) << 3u;
            unsure |= fourth >> 1u << 3u;
        }
    }
}
// For each slot, the rays whose bit is set in any thread that tested them.
fn rays_with(bit: u32) -> vec4u {
    let bits = ballots(vec4<bool>((bit & 1u) != 0u, (bit & 2u) != 0u, (bit & 4u) != 0u, (bit & 8u) != 0u));
    var last = bits.w;
    for (var step = GROUP / 2u; step >= GROUP >> parts && step > 0u; step /= 2u) { last |= last >> step; }
    return vec4u(bits.xyz, last) & all_rays();
}
// For each slot, the mask of all its rays.
fn all_rays() -> vec4u {
    return vec4u(select(vec3u(0u), vec3u(0xffffffffu), vec3u(whole) > vec3u(0u, 1u, 2u)),
                 select(0u, 0xffffffffu >> (GROUP - max(rest, 1u)), rest > 0u));
}
fn bits_of(v: vec4u) -> u32 {
    let counts = countOneBits(v);
    return counts.x + counts.y + counts.z + counts.w;
}

var<private> open: vec4u;
var<private> open_unsure: vec4u;
// Results other than a number of open rays: too many triangles; a ray that is too long; no ray has an occluder.
const TOO_MANY: u32 = 0xfffffffdu;
const TOO_LONG: u32 = 0xfffffffeu;
const NOTHING_SEEN: u32 = 0xffffffffu;

// Of the `count` rays of a fan from `first` on, the number that no gathered triangle certainly stops within a radius. `open` has a bit for
// each of these rays, and `open_unsure` for each of them that some triangle may stop.
fn open_of(owner: u32, radius: f32, first: u32, count: u32, gathered: u32) -> u32 {
    open = vec4u(0xffffffffu);
    open_unsure = vec4u(0u);
    let ball = half_ball(fan_origin[owner].xyz, fan_facing[owner].xyz, radius);
    // Only some of the triangles near all members are near this point.
    let most = select(SEEN_NEARER, SEEN, radius == params.radius);
    var near = 0u;
    for (var base = 0u; base < gathered; base += GROUP) {
        var place = 0u;
        var meets = false;
        if base + lane < gathered {
            place = list[base + lane];
            meets = ball_meets(ball, load_triangle(place).corners);
        }
        let bits = ballot(meets);
        let more = countOneBits(bits);
        if near + more > most { return TOO_MANY; }
        if meets { near_list[near + before(bits)] = place; }
        near += more;
    }
    workgroupBarrier();
    var seen = false;
    var made = false;
    var count_of_facets = 0u;
    for (var base = 0u; base < near; base += GROUP) {
        var facet: Facet;
        var met = false;
        var stops = false;
        if base + lane < near {
            let triangle = load_triangle(near_list[base + lane]);
            met = facet_of(triangle, ball, &facet);
            // Glass that occlusion rays pass does not stop them.
            let may_pass_light = OCCLUSION_ACCEPT == ACCEPT_STOPS && (triangle.id & TRANSPARENT) != 0u;
            stops = met && !(may_pass_light && passes_light(triangle.id & ~TRANSPARENT));
        }
        let bits = ballots(vec4<bool>(met, stops, false, false));
        seen = seen || bits.x != 0u;
        if stops {
            let at = 4u * (count_of_facets + before(bits.y));
            facets[at] = facet.a;
            facets[at + 1u] = facet.b;
            facets[at + 2u] = facet.c;
            facets[at + 3u] = facet.normal;
        }
        count_of_facets += countOneBits(bits.y);
        workgroupBarrier();
        if count_of_facets > FACETS || (count_of_facets > 0u && base + GROUP >= near) {
            if !made && !make_rays(owner, first, count) { return TOO_LONG; }
            made = true;
            for (var begin = 0u; begin < count_of_facets; begin += FACETS) {
                test_rays(begin, min(count_of_facets - begin, FACETS));
            }
            count_of_facets = 0u;
            open = all_rays() & ~rays_with(blocked);
            if bits_of(open) == 0u { return 0u; }
        }
    }
    if !made { return select(NOTHING_SEEN, count, seen); }
    open_unsure = open & rays_with(unsure);
    return bits_of(open);
}
