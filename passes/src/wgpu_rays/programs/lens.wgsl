// Light that exact spheres of glass focus on surfaces (`effects/dielectric/caustic.rs`).

fn point_place(point: u32) -> u32 { return lenses_at() + LENS_HEAD + 2u * point; }

// The state of the search: the sphere and its material; two unit vectors in the plane through the point, the sphere's centre and the light,
// namely the direction from the axis to the point and the direction in which light travels; and the sum of the light that is found.
var<private> lens: Lens;
var<private> lens_body: Body;
var<private> side_of_point: vec3f;
var<private> axis: vec3f;
var<private> focused_sum: vec3f;

struct Lens { center: vec3f, radius: f32, id: u32 }

// The share of the light that a ray keeps in the sphere.
fn kept_by(ray: Turned) -> vec3f {
    let passes = 1.0 - face_of(lens_body, ray.cos, lens_body.index).reflectance;
    let faces = (1.0 - lens_body.veil) * lens_body.filter_color;
    return passes * passes * faces * faces * transmittance(lens_body.extinction, 2.0 * lens.radius * ray.inner);
}

// Adds the light of a bundle unless it is occluded: from the surface to the sphere, in it, and on to the light.
fn take_bundle(bundle: Bundle, ray: Turned, side: f32) {
    let aside = side * side_of_point;
    let direction = axis * ray.turn_cos - aside * ray.turn_sin;
    if !(dot3(lit.facing, direction) < 0.0) { return; }
    let to_sphere = -direction;
    var light = share_from(to_sphere) * bundle.strength;
    let exit = lens.center + lens.radius * (aside * (ray.sin * ray.turn_cos - ray.cos * ray.turn_sin)
        + axis * (ray.sin * ray.turn_sin + ray.cos * ray.turn_cos));
    let entry = lens.center + lens.radius * (aside * ray.sin - axis * ray.cos);
    var origin = lit.start + sep3(lit.offset * select(lit.step, -lit.step, dot3(lit.offset, to_sphere) < 0.0));
    for (var way = 0u; way < 3u; way += 1u) {
        if all(light == vec3f(0.0)) { break; }
        let end = select(exit, entry, way == 1u);
        if way == 2u {
            look_along(params.to_light, HUGE);
        } else {
            let along = end - origin;
            look_along(normalize_or(along, vec3f(0.0, 0.0, 1.0)), sqrt(dot3(along, along)));
        }
        light *= straight_along(origin, lens.id);
        origin = end;
    }
    look_at_sun();
    focused_sum += light;
}

// The light that spheres focus on the surface `lit`, as a share of its colour.
fn light_of_spheres() -> vec3f {
    focused_sum = vec3f(0.0);
    let head = lenses_at();
    let along_light = Wide3(table_vector(head + LENS_AXIS), table_vector(head + LENS_AXIS + 3u));
    axis = along_light.h;
    for (var number = 0u; number < tables[head]; number += 1u) {
        let place = point_place(POINTS + POINTS_AT_AXIS) + LENS_WORDS * number;
        lens = Lens(table_vector(place), table_number(place + 3u), tables[place + 6u]);
        // In radii, from the sphere's centre. Within the sphere no light is focused.
        let from_center = scaled3(exact_sum3(lit.position, -lens.center), Wide(table_number(place + 4u), table_number(place + 5u)));
        let square = dot3(from_center.h, from_center.h);
        if square <= 1.0 { continue; }
        let along = wide_dot(from_center, along_light);
        let across = add3(from_center, minus3(scaled3(along_light, along)));
        let distance = wide_root(wide_dot(across, across));
        side_of_point = normalize_or(across.h, basis_beside(axis));
        lens_body = body_of(tables[place + 7u]);
        let width = max(LENS_WIDTH, sqrt(square) * table_number(head + LENS_BLUR));
        let reach = select(width, width + distance.h, distance.h < width);
        find_bundles(Aim(distance, along, width, reach, lens_body.index, tables[place + 8u]));
    }
    return focused_sum;
}
// A unit vector perpendicular to a unit vector.
fn basis_beside(unit: vec3f) -> vec3f {
    return normalize_or(cross3(unit, select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(unit.x) > 0.5)), vec3f(0.0));
}
