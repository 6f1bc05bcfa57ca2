// The planes of a chunk's triangles, for one camera. Each fragment reads its depth from its triangle's plane. `camera_planes.wgsl` stands
// before this text.

@group(0) @binding(0) var<uniform> frame: Frame;
// Three indices of vertices for each triangle of the chunk.
@group(0) @binding(1) var<storage, read> corners: array<u32>;
// Three coordinates for each vertex.
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read_write> planes: array<Plane>;

fn position_of(corner: u32) -> vec3<f32> {
    let first = 3u * corners[corner];
    return vec3<f32>(positions[first], positions[first + 1u], positions[first + 2u]);
}

@compute @workgroup_size(64)
fn plane_main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let triangle = (group.y * groups.x + group.x) * 64u + thread;
    if triangle >= arrayLength(&planes) {
        return;
    }
    let first = 3u * triangle;
    let a = position_of(first);
    let u = position_of(first + 1u) - a;
    let v = position_of(first + 2u) - a;
    let from_origin = a - frame.origin.xyz;
    let across = vec3<f32>(fma(u.y, v.z, -(u.z * v.y)), fma(u.z, v.x, -(u.x * v.z)), fma(u.x, v.y, -(u.y * v.x)));
    // Because the longest component is exactly 1, triangles in one plane perpendicular to an axis have the same depth to the last bit.
    let size = abs(across);
    let longest = max(size.x, max(size.y, size.z));
    let normal = select(across / longest, sign(across), size == vec3<f32>(longest));
    var out: Plane;
    out.plane = vec4<f32>(normal, -product(vec4<f32>(normal, 0.0), vec4<f32>(from_origin, 0.0)));
    out.scale = 1.0 / product(out.plane, frame.towards);
    out.slope = vec2<f32>(product(out.plane, frame.right), product(out.plane, frame.down)) * out.scale;
    planes[triangle] = out;
}
