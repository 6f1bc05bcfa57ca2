// Settles the occlusion rays of points with the triangles near them, before any ray is traced.

// Distance within which triangles are gathered. If too many are within the radius, a smaller reach still finds the rays that are stopped
// near their origin, and most hits are near the surface that a ray leaves. The parts are tried in order.
const REACHES: u32 = 3u;
fn reach_of(part: u32) -> f32 {
    return params.radius * select(select(0.04, 0.125, part == 1u), 1.0, part == 0u);
}
// Reaches below the radius are tried only for fans of at most this many rays.
const REMEMBERED: u32 = 128u;

// Reorders the masks of the slots by sample: the last slot's bits follow those of the full slots.
fn by_sample(slots: vec4u) -> vec4u {
    var bits = slots;
    if params.samples < 128u { bits[params.samples / GROUP] = slots.w; }
    return bits;
}

// Settles the rays of the points of a group with the triangles near them, as far as possible (`settle` of `cuda/programs/count_open.cuh`):
//   1. The first point left leads. The points no farther from it than NEIGHBOURS radii share a list.
//   2. For each reach in turn, the triangles within reach of any of them are gathered; the first list that is not too long is taken.
//   3. Each point tests its rays against the list up to that reach, with all threads; if it sees too many triangles, up to the next one.
//      If the reach is the whole radius, only rays that some triangle left undecided are traced. Else all rays that are not stopped are
//      traced, from that distance on if all triangles were certain.
//   4. Without a list, all rays are traced.
// At the end, points that saw no triangle within a smaller reach test once whether their whole half ball is clear.
fn settle(point: u32, wanted: bool, there: bool) {
    if wanted { keep_fan(lane, point); }
    workgroupBarrier();
    var known_open = 0u;
    // One bit for each sample whose ray is still to be traced.
    var bits = vec4u(0xffffffffu);
    var beyond = 0.0;
    var top = params.root;
    var certain = wanted && params.root == NONE;
    var traces = wanted && !certain;
    // Whether too many triangles were gathered around the point, although it sees none within a smaller reach.
    var asks = false;
⟪    // Rays that may meet a sphere are traced.
    var is_apart = true;
    if wanted { is_apart = !is_near_sphere(fan_origin[lane].xyz, params.radius); }
⟫    var left = ballot(traces⟪ && is_apart⟫);
    while left != 0u {
        let leader = firstTrailingBit(left);
        let candidate = (left >> lane & 1u) != 0u;
        let own = select(leader, lane, candidate);
        let origin = fan_origin[own].xyz; let facing = fan_facing[own].xyz;
        let to = origin - fan_origin[leader].xyz;
        let apart = NEIGHBOURS * params.radius;
        var members = 0u;
        var member = candidate && (lane == leader || dot(to, to) <= apart * apart);
        var shared_top = params.root;
        var gathered = -1;
        var attempt = 0u;
        loop {
            var bounded = false;
            let zone = zone_of(origin, facing, reach_of(attempt), &bounded);
            if attempt == 0u {
                let sure = ballot(bounded);
                member = member && (lane == leader || bounded);
                left &= ~ballot(member);
                // If a point has no finite bounds, its rays are traced.
                member = member && (sure >> leader & 1u) != 0u;
                members = ballot(member);
                if members == 0u { break; }
            }
            gathered = gather(zone_of_members(members, zone, fan_facing[leader].xyz), shared_top);
            if attempt == 0u {
                shared_top = below;
                if member { top = below; }
            }
            if gathered >= 0 { break; }
            workgroupBarrier();
            asks = asks || member;
            attempt += 1u;
            if params.samples > REMEMBERED || attempt == REACHES {
                members = 0u;
                break;
            }
        }
        if members != 0u && gathered == 0 && attempt == 0u {
            certain = certain || member;
            traces = traces && !member;
            members = 0u;
        }
        for (; members != 0u; members &= members - 1u) {
            let owner = firstTrailingBit(members);
            var sum = 0u;
            var found = 0u;
            var doubts = 0u;
            var radius = 0.0;
            // If a point sees too many triangles, the same list serves for a smaller reach.
            for (var part = attempt; part < REACHES; part += 1u) {
                radius = reach_of(part);
                sum = 0u;
                doubts = 0u;
                found = 0u;
                for (var first = 0u; first < params.samples && found < TOO_MANY; first += 128u) {
                    found = open_of(owner, radius, first, min(params.samples - first, 128u), u32(gathered));
                    doubts += bits_of(open_unsure);
                    sum += select(found, min(params.samples - first, 128u), found == NOTHING_SEEN);
                    if found == NOTHING_SEEN && params.samples > 128u { found = 0u; }
                }
                workgroupBarrier();
                if found != TOO_MANY || params.samples > REMEMBERED { break; }
            }
            if lane != owner || found == TOO_MANY || found == TOO_LONG { continue; }
            if radius < params.radius {
                traces = found != 0u;
                asks = found == NOTHING_SEEN;
                bits = by_sample(open);
                // If some triangle may stop a ray, the rays are traced from their origins.
                if doubts == 0u { beyond = radius; }
            } else if doubts == 0u {
                certain = found == NOTHING_SEEN;
                traces = false;
                known_open = sum;
            } else if params.samples <= REMEMBERED {
                bits = by_sample(open_unsure);
                known_open = sum - doubts;
            }
        }
    }
    if asks && traces {
        var bounded = false;
        let zone = zone_of(fan_origin[lane].xyz, fan_facing[lane].xyz, params.radius, &bounded);
        certain = bounded && is_clear(zone, top);
        traces = !certain;
    }
    if certain {
        rays[CERTAIN] += params.samples;
        known_open = params.samples;
    } else if wanted {
        rays[OCCLUSION] += params.samples;
    }
    if there {
        if traces { points[POINT * point + 4u] = bits; }
        points[POINT * point + 5u] = vec4u(known_open, bitcast<u32>(beyond), select(NONE, top, traces), 0u);
    }
}

@compute @workgroup_size(32)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32) {
    begin_group(thread);
    let place = group.y * groups.x + group.x;
    let end = points_found();
    for (var first = GROUP * place; first < end; first += GROUP * groups.x * groups.y) {
        let point = first + lane;
        settle(point, has_fan(point, end), point < end);
        workgroupBarrier();
    }
    note_cut_loops();
    count_rays(place);
}
