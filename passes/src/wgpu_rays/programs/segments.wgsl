// Whether anything blocks segments between triangles: `SegmentTracer` of `trace/segments.rs`. A segment's own two triangles do not block,
// nor do those of materials that are not opaque.

// Two vectors for each segment: (start, length) and (direction, pair).
@group(0) @binding(8) var<storage, read> segments: array<vec4u>;
@group(0) @binding(9) var<storage, read> own_triangles: array<vec2u>;
// One bit for each segment, set if it is blocked.
@group(0) @binding(10) var<storage, read_write> answers: array<u32>;
struct Part { first: u32, end: u32, unused_x: u32, unused_y: u32 }
@group(0) @binding(11) var<uniform> part: Part;

fn is_blocked(ray: Ray, own: vec2u) -> bool {
    var query: Query;
    if params.root == NONE || !prepare(ray, &query) { return false; }
    var descent = begin_descent(&query, params.root, query.t_min);
    let limit = query.t_max;
    loop {
        let index = next_candidate(&descent, &query, limit);
        if index == NONE { break; }
        let triangle = load_triangle(index);
        if (triangle.id & TRANSPARENT) != 0u || triangle.id == own.x || triangle.id == own.y { continue; }
        let e = edges_of(&query, triangle.corners);
        if !e.passes { continue; }
        let verdict = decide(&query, triangle.corners, limit);
        if verdict == MISSES { continue; }
        if verdict == HITS && !e.some_zero { return true; }
        var hit: Hit;
        if solve(&query, triangle.corners, e, limit, &hit) && hit.t < limit { return true; }
    }
    return false;
}

var<workgroup> words: array<atomic<u32>, 2>;
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32) {
    if thread < 2u { atomicStore(&words[thread], 0u); }
    workgroupBarrier();
    let first = part.first + 64u * (group.y * groups.x + group.x);
    let index = first + thread;
    if index < part.end {
        let origin = segments[2u * index]; let along = segments[2u * index + 1u];
        let ray = Ray(bitcast<vec3f>(origin.xyz), bitcast<vec3f>(along.xyz), 0.0, bitcast<f32>(origin.w));
        if is_blocked(ray, own_triangles[along.w]) { atomicOr(&words[thread / 32u], 1u << (thread % 32u)); }
    }
    workgroupBarrier();
    if thread < 2u && first + 32u * thread < part.end { answers[first / 32u + thread] = atomicLoad(&words[thread]); }
}
