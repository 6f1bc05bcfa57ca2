// Ray cones (`effects/ray_cone.rs`): at which mip level textures are read at hits. Other texts have their code for ray cones between
// ⟨ and ⟩; it is left out where all textures are read at level 0.

// A cone at a point of its axis; both numbers are negative where it converges, or has converged.
struct Cone { width: f32, spread: f32 }
// The footprint of a lookup in a texture: the area of the square of its longer side, in texture coordinates; 0 reads level 0.
const NO_FOOTPRINT: f32 = 0.0;
// Programs cannot rely on infinities.
const LEAST_DIVISOR: f32 = 1.0e-20;
const MOST_SIDE: f32 = 1.0e15;
const MOST_AREA: f32 = 1.0e30;

// The cone of the pixel at the surface that it shows.
fn cone_at(surface: Surface) -> Cone {
    let to = surface.point.position - params.eye;
    return Cone(params.cone_width + params.cone_spread * sqrt(dot3(to, to)), params.cone_spread);
}
fn cone_along(cone: Cone, distance: f32) -> Cone { return Cone(cone.width + cone.spread * distance, cone.spread); }

// The angle by which the normal of a surface of this curvature turns over the cone's width.
fn turn_of(cone: Cone, curvature: f32, cosine: f32) -> f32 {
    if curvature == 0.0 { return 0.0; }
    return curvature * cone.width / max(cosine, LEAST_DIVISOR);
}
fn cone_mirrored(cone: Cone, curvature: f32, cosine: f32) -> Cone {
    return Cone(cone.width, cone.spread + 2.0 * turn_of(cone, curvature, cosine));
}
// `ratio` is the index of refraction behind the surface over that before it.
fn cone_refracted(cone: Cone, curvature: f32, cosine: f32, cos_refracted: f32, ratio: f32) -> Cone {
    let rate = cosine / max(ratio * cos_refracted, LEAST_DIVISOR);
    let spread = rate * cone.spread + (rate - 1.0) * turn_of(cone, curvature, cosine);
    return Cone(cone.width * (cos_refracted / max(cosine, LEAST_DIVISOR)), spread);
}

// The curvature of a triangle by its vertex normals, on the side of `facing`: above 0 where it is convex.⟪ Of a sphere by its radius;
// `outward` is its normal.⟫
fn curvature_of(triangle: u32, facing: vec3f⟪, outward: vec3f⟫) -> f32 {
⟪    if is_sphere(triangle) { return with_sign(1.0 / sphere_of(triangle).radius, dot3(outward, facing)); }
⟫    let corners = positions_of(triangle);
    let i = corners_of(triangle) * 3u + vec3u(params.normals_at);
    let na = vector_at(i.x); let nb = vector_at(i.y); let nc = vector_at(i.z);
    if all(na == nb) && all(nb == nc) { return 0.0; }
    let zero = vec3f(0.0);
    let ua = normalize_or(na, zero); let ub = normalize_or(nb, zero); let uc = normalize_or(nc, zero);
    let ab = corners.b - corners.a; let bc = corners.c - corners.b; let ca = corners.a - corners.c;
    let length = dot3(ab, ab) + dot3(bc, bc) + dot3(ca, ca);
    if !(length > 0.0) { return 0.0; }
    let curvature = (dot3(ub - ua, ab) + dot3(uc - ub, bc) + dot3(ua - uc, ca)) / length;
    return select(curvature, -curvature, dot3(na + nb + nc, facing) < 0.0);
}

// The footprint of a cone in the textures of a triangle that it meets in a unit direction.
fn footprint_of(cone: Cone, triangle: u32, direction: vec3f) -> f32 {
⟪    // Spheres have no texture coordinates.
    if is_sphere(triangle) { return NO_FOOTPRINT; }
⟫    let corners = positions_of(triangle);
    let i = corners_of(triangle);
    let ta = texcoord_at(i.x).xy; let first = texcoord_at(i.y).xy - ta; let second = texcoord_at(i.z).xy - ta;
    let normal = cross3(corners.b - corners.a, corners.c - corners.a);
    let side = min(abs(cone.width) / max(abs(dot3(normal, direction)), LEAST_DIVISOR), MOST_SIDE);
    return abs(sep(first.x * second.y) - sep(first.y * second.x)) * sqrt(dot3(normal, normal)) * (side * side);
}

// The next smaller level, which follows in memory.
fn next_level(image: Texture) -> Texture {
    var next = image;
    next.first += image.width * image.height;
    next.width = max(image.width / 2u, 1u);
    next.height = max(image.height / 2u, 1u);
    return next;
}
// Trilinear filtering.
fn sample_levels(image: Texture, uv: vec2f, footprint: f32) -> vec4f {
    let area = min(footprint * (f32(image.width) * f32(image.height)), MOST_AREA);
    var fine = image;
    var blend = 0.0;
    if area > 1.0 {
        fine.nearest = 0u;
        let last = f32(firstLeadingBit(max(image.width, image.height)));
        let lod = min(0.5 * log2(area), last);
        for (var level = 0u; level < u32(lod); level += 1u) { fine = next_level(fine); }
        blend = lod - floor(lod);
    }
    // Drivers inline every call of a function, so both levels are read in one place.
    var color = vec4f(0.0);
    for (var second = false; ; second = true) {
        let read = sample_level(fine, uv);
        if second { return between(color, read, blend); }
        if blend == 0.0 { return read; }
        color = read;
        fine = next_level(fine);
    }
    return color;
}
