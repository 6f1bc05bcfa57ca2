// Multiplies the colours of points by the share of the light that reaches them.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32) {
    let place = group.y * groups.x + group.x;
    let end = points_found();
    for (var point = 64u * place + thread; point < end; point += 64u * groups.x * groups.y) {
        let color = color_of(point);
        if all(color == vec3f(0.0)) { continue; }
        let start = point_vector(point, 0u);
        let facing = point_vector(point, 1u).xyz;
        let step = select(start.w, -start.w, dot3(facing, to_light()) < 0.0);
        var ray_start = RayStart(start.xyz + sep3(facing * step), false);
        if (bitcast<u32>(start.w) >> 31u) == 1u {
            let lift = point_vector(point, 4u);
            ray_start = lifted_start(start.xyz + sep3(facing * (lift.w * abs(start.w))), lift.xyz);
        }
        let lit = sep3(color * share_at(ray_start));
        points[POINT * point + 3u] = vec4u(bitcast<vec3u>(lit), next_of(point));
    }
    count_rays(place);
}
