// The occlusion rays of the points of a group, in shared memory: origins, the sides to which they go, and the data that their directions
// share.

// Ray origins; w: the distance before which nothing is hit, 0 unless `trace.wgsl` sets it.
var<workgroup> fan_origin: array<vec4f, 32>;
// Side to which the rays go; w: first scrambling seed.
var<workgroup> fan_facing: array<vec4f, 32>;
// First tangent; w: second scrambling seed.
var<workgroup> fan_tangent: array<vec4f, 32>;
// Second tangent; w: key.
var<workgroup> fan_bitangent: array<vec4f, 32>;
var<workgroup> fan_normal: array<vec4f, 32>;

// Whether a point has occlusion rays.
fn has_fan(point: u32, end: u32) -> bool {
    return point < end && params.samples != 0u && any(color_of(point) != vec3f(0.0));
}
// Stores the fan of a point. The origin is that of `spawn`.
fn keep_fan(own: u32, point: u32) {
    let start = point_vector(point, 0u);
    let facing = points[POINT * point + 1u];
    let side = bitcast<vec3f>(facing.xyz);
    let basis = basis_around(point_vector(point, 2u).xyz);
    let seeds = dimensions(facing.w, HASH_SCRAMBLE);
    fan_origin[own] = vec4f(start.xyz + sep3(side * abs(start.w)), 0.0);
    fan_facing[own] = vec4f(side, bitcast<f32>(seeds.x));
    fan_tangent[own] = vec4f(basis.tangent, bitcast<f32>(seeds.y));
    fan_bitangent[own] = vec4f(basis.bitangent, bitcast<f32>(facing.w));
    fan_normal[own] = vec4f(basis.normal, 0.0);
}
fn fan_direction(own: u32, sample: u32) -> vec3f {
    let facing = fan_facing[own]; let tangent = fan_tangent[own]; let bitangent = fan_bitangent[own];
    let seeds = vec2u(bitcast<u32>(facing.w), bitcast<u32>(tangent.w));
    let point = point_of_sample(sample, bitcast<u32>(bitangent.w), seeds);
    let direction = to_world(Basis(tangent.xyz, bitangent.xyz, fan_normal[own].xyz), cosine_direction(point));
    let below = min(dot3(direction, facing.xyz), 0.0);
    return direction - sep3(2.0 * below * facing.xyz);
}
