// Traces the occlusion rays of points that are not settled. A thread that has finished a ray takes the next one.
var<workgroup> ray_bits: array<vec4u, 32>;
var<workgroup> tops: array<u32, 32>;
var<workgroup> order: array<u32, 32>;
var<workgroup> open_counts: array<atomic<u32>, 32>;
var<workgroup> next_ray: atomic<u32>;

@compute @workgroup_size(32)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32) {
    begin_group(thread);
    let place = group.y * groups.x + group.x;
    let end = points_found();
    for (var first = GROUP * place; first < end; first += GROUP * groups.x * groups.y) {
        let point = first + lane;
        let wanted = has_fan(point, end);
        var known = vec4u(0u, 0u, NONE, 0u);
        if wanted { known = points[POINT * point + 5u]; }
        if wanted && !IS_SETTLED && params.root == NONE { points[POINT * point + 5u].x = params.samples; }
        let traces = known.z != NONE;
        // Without settling, the rays were not counted yet.
        if wanted && !IS_SETTLED { rays[OCCLUSION] += params.samples; }
        let bits = ballot(traces);
        if bits == 0u { continue; }
        if traces {
            keep_fan(lane, point);
            fan_origin[lane].w = bitcast<f32>(known.y);
            ray_bits[lane] = points[POINT * point + 4u];
            tops[lane] = known.z;
            order[before(bits)] = lane;
        }
        atomicStore(&open_counts[lane], 0u);
        if lane == 0u { atomicStore(&next_ray, 0u); }
        workgroupBarrier();
        let all = countOneBits(bits) * params.samples;
        loop {
            let taken = atomicAdd(&next_ray, 1u);
            if taken >= all { break; }
            let owner = order[taken / params.samples];
            let sample = taken % params.samples;
            let origin = fan_origin[owner];
            if IS_SETTLED && params.samples <= 128u && (ray_bits[owner][sample / 32u] >> (sample % 32u) & 1u) == 0u { continue; }
            let ray = Ray(origin.xyz, fan_direction(owner, sample), 0.0, params.radius);
            if !occluded_below(OCCLUSION_ACCEPT, ray, tops[owner], origin.w)⟪ && !occluded_by_sphere(OCCLUSION_ACCEPT, ray)⟫ { atomicAdd(&open_counts[owner], 1u); }
        }
        workgroupBarrier();
        if traces { points[POINT * point + 5u].x = known.x + atomicLoad(&open_counts[lane]); }
        workgroupBarrier();
    }
    note_cut_loops();
    count_rays(place);
}
