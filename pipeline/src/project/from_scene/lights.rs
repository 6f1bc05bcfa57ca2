//! Lights of a project made from scene files.

use super::extent::{Every, Extent};
use super::view::{self, SUN, unit};
use super::{Notes, SceneOptions, clean};
use crate::color::BRIGHTEST;
use crate::project::{Camera, Falloff, Light, Spot};
use crate::scene::{Scene, SceneLight};
use glam::{DVec3, Vec3};

/// Greatest number of lights that a project takes from its scene files: each light may cost a shadow ray at every shaded point.
const MOST: usize = 32;
/// Number of points on surfaces at which the strength of lights is examined.
const POINTS: usize = 1024;
/// Greatest number of triangles that are examined.
const MOST_TRIANGLES: usize = 1 << 16;
/// Share of the lit points, among the [`POINTS`], that receive at most [`SUN`].
const BELOW: f64 = 0.9;

/// The lights of a scene that is made into a project: the sun of the options; else the lights of the files; else a default sun.
pub(super) fn of(
    scene: &Scene,
    options: &SceneOptions,
    focus: Extent,
    camera: &Camera,
    notes: &mut Notes,
) -> Vec<Light> {
    let given = if options.sun.is_some() { &[][..] } else { &scene.lights[..] };
    match given {
        [] if options.sun.is_some() => vec![view::sun(options, camera)],
        [] => {
            notes.add("sun: behind the viewer's left shoulder; `--sun X,Y,Z` puts it elsewhere".to_owned());
            vec![view::sun(options, camera)]
        }
        [light] if light.position.is_none() => {
            notes.add(format!("sun: direction and hue of the scene's light `{}`", light.name));
            vec![view::sun_of_file(light)]
        }
        lights => several(scene, lights, (options, focus, camera), notes),
    }
}

/// The lights of the files; if there are more than [`MOST`], those that give the most light to the focus. The colours of all
/// lights are multiplied by the same factor, as by an exposure, so that most of the lit surfaces receive at most [`SUN`].
fn several(
    scene: &Scene,
    lights: &[SceneLight],
    (options, focus, camera): (&SceneOptions, Extent, &Camera),
    notes: &mut Notes,
) -> Vec<Light> {
    let points = points(scene, focus);
    let sum = |light: &SceneLight| points.iter().map(|point| arriving(light, scene.origin, point)).sum::<DVec3>();
    let mut strongest: Vec<(usize, f64)> =
        lights.iter().enumerate().map(|(index, light)| (index, sum(light).max_element())).collect();
    // The sort is stable: of equally strong lights, the first of the file stay.
    strongest.sort_by(|a, b| b.1.total_cmp(&a.1));
    strongest.truncate(MOST);
    strongest.sort_by_key(|(index, _)| *index);
    let taken: Vec<&SceneLight> = strongest.iter().map(|(index, _)| &lights[*index]).collect();
    let mut received: Vec<f64> = points
        .iter()
        .map(|point| taken.iter().map(|light| arriving(light, scene.origin, point)).sum::<DVec3>().max_element())
        .filter(|received| *received > 0.0)
        .collect();
    received.sort_unstable_by(f64::total_cmp);
    let Some(most) = received.get((received.len() as f64 * BELOW) as usize).or(received.last()).copied() else {
        notes.add(
            "sun: behind the viewer's left shoulder, because the scene's lights reach none of its surfaces".to_owned(),
        );
        return vec![view::sun(options, camera)];
    };
    let scale = f64::from(SUN) / most;
    let names: Vec<String> = taken.iter().take(3).map(|light| format!("`{}`", light.name)).collect();
    let more = match taken.len().saturating_sub(names.len()) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let left = match lights.len() - taken.len() {
        0 => String::new(),
        left => format!("; of {} lights {left} are left out, which light least of what is looked at", lights.len()),
    };
    notes.add(format!(
        "lights: {}{more} of the scene, where {most:.3} lux add {SUN} to the picture, which nine tenths of the lit surfaces do not exceed; \
         `--exposure EV` changes it{left}",
        names.join(", "),
    ));
    let mut made: Vec<Light> = Vec::with_capacity(taken.len());
    for light in taken {
        let name = unused(&light.name, &made);
        made.push(of_file(light, name, scene.origin, scale));
    }
    made
}

/// A name that none of the lights in `taken` has.
fn unused(name: &str, taken: &[Light]) -> String {
    let base = clean(name).unwrap_or_else(|| "light".to_owned());
    let is_taken = |name: &str| taken.iter().any(|light| light.name.to_lowercase() == name.to_lowercase());
    let numbered = (2..).map(|number| format!("{base} {number}"));
    std::iter::once(base.clone()).chain(numbered).find(|name| !is_taken(name)).expect("numbers do not end")
}

fn of_file(light: &SceneLight, name: String, origin: DVec3, scale: f64) -> Light {
    let color = (light.color.as_dvec3() * scale).as_vec3().min(Vec3::splat(BRIGHTEST));
    let Some(position) = light.position else { return view::directional(name, light.direction.as_dvec3(), color) };
    let spot = light.cone.map(|[inner, outer]| {
        let cutoff = outer.to_degrees();
        let axis = unit(light.direction.as_dvec3()).unwrap_or(Vec3::NEG_Z);
        Spot { axis, cutoff, inner: inner.to_degrees().min(cutoff), exponent: 0.0 }
    });
    let falloff = Falloff { attenuation: [0.0, 0.0, 1.0], range: light.range, spot };
    Light { name, direction: None, position: Some(origin + position.as_dvec3()), color, falloff }
}

/// A point of a surface, in the world, and the unit normal of its triangle.
struct Point {
    position: DVec3,
    normal: DVec3,
}

/// Illuminance by a light at a point, on the side of the surface that faces the light, without shadows: in lux, by colour.
fn arriving(light: &SceneLight, origin: DVec3, Point { position, normal }: &Point) -> DVec3 {
    let color = light.color.as_dvec3();
    let Some(place) = light.position else { return color * normal.dot(light.direction.as_dvec3()).abs() };
    let way = origin + place.as_dvec3() - position;
    let distance = way.length();
    if distance <= 0.0 {
        return DVec3::ZERO;
    }
    let window = (1.0 - (distance / f64::from(light.range)).powi(4)).max(0.0);
    let cone = light.cone.map_or(1.0, |[inner, outer]| {
        let [inner, outer] = [inner, outer].map(|angle| f64::from(angle).cos());
        let cosine = -way.dot(light.direction.as_dvec3()) / distance;
        if cosine >= inner { 1.0 } else { ((cosine - outer) / (inner - outer)).max(0.0).powi(2) }
    });
    color * (window * cone * way.dot(*normal).abs() / (distance * distance * distance))
}

/// Up to [`POINTS`] points on the triangles whose centroids lie in a box. Each point represents an equal part of the area of these
/// triangles. If there are more than [`MOST_TRIANGLES`] triangles, only every n-th triangle is examined.
fn points(scene: &Scene, focus: Extent) -> Vec<Point> {
    let count: usize = scene
        .objects
        .iter()
        .flat_map(|object| &scene.meshes[object.mesh as usize].groups)
        .map(|group| group.triangles.len())
        .sum();
    let step = count.div_ceil(MOST_TRIANGLES).max(1);
    let (mut every, mut whole) = (Every::nth(step), 0.0);
    // Corners of triangles, each with the sum of twice the areas up to and including this triangle.
    let mut triangles: Vec<(f64, [DVec3; 3])> = Vec::with_capacity(count / step);
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh as usize];
        for triangle in mesh.groups.iter().flat_map(|group| every.of(&group.triangles)) {
            let corner = |index: u32| {
                let placed = object.transform.transform_point3(*mesh.positions.get(index as usize)?);
                placed.is_finite().then(|| scene.origin + placed.as_dvec3())
            };
            let [Some(a), Some(b), Some(c)] = triangle.map(corner) else { continue };
            let (area, middle) = ((b - a).cross(c - a).length(), (a + b + c) / 3.0);
            if area > 0.0 && middle.cmpge(focus.low).all() && middle.cmple(focus.high).all() {
                whole += area;
                triangles.push((whole, [a, b, c]));
            }
        }
    }
    let mut rest = triangles.into_iter().peekable();
    let mut points = Vec::with_capacity(POINTS);
    for index in 0..POINTS {
        let area = whole * (index as f64 + 0.5) / POINTS as f64;
        while rest.next_if(|(until, _)| *until <= area).is_some() {}
        let Some((_, [a, b, c])) = rest.peek() else { break };
        // An additive recurrence fills the unit square evenly; the half beyond the diagonal is folded back.
        let [u, v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step: f64| (step * index as f64).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let (first, second) = (*b - *a, *c - *a);
        points.extend(
            first.cross(second).try_normalize().map(|normal| Point { position: *a + first * u + second * v, normal }),
        );
    }
    points
}
