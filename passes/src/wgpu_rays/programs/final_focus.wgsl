// Multiplies the colours of points by the share of light that comes straight, plus the light that glass focuses on them.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32) {
    let place = group.y * groups.x + group.x;
    let end = points_found();
    for (var point = 64u * place + thread; point < end; point += 64u * groups.x * groups.y) {
        let color = color_of(point);
        if all(color == vec3f(0.0)) { continue; }
        let start = point_vector(point, 0u);
        let facing = point_vector(point, 1u).xyz;
        let normal = point_vector(point, 2u).xyz;
        let straight = point_vector(point, 4u);
        let position = point_vector(point, 5u).xyz;
        let told = points[POINT * point + 5u].w;
        // Nothing is known yet about the point's other rays.
        points[POINT * point + 5u] = vec4u(0u, 0u, params.root, 0u);
        let side = select(1.0, -1.0, (told & OTHER_SIDE) != 0u);
        let surface = Lit(position, start.xyz, facing, start.w, side * facing, side * normal, straight.w, tint_of(told & ~OTHER_SIDE));
        let shown = sep3(color * (straight.xyz + (1.0 - SHADOWED) * focused_light(surface)));
        points[POINT * point + 3u] = vec4u(bitcast<vec3u>(shown), next_of(point));
    }
    note_cut_loops();
    count_rays(place);
}
