//! The test of a ray and an exact sphere, and points on spheres, compared number by number with the processor's.

use super::functions::{Random, answers};
use super::rays;
use crate::effects::dielectric::Variant;
use crate::raster::gpu::AdapterKind;
use crate::trace::{Ray, SurfacePoint, sphere_roots};
use crate::wgpu_rays::WgpuRays;
use crate::wgpu_rays::programs::{Kind, Stage, source};
use crate::wgpu_rays::split::Split;
use curitiba_pipeline::programs::{Fidelity, RayProgram, TextureLod};
use curitiba_pipeline::scene::Sphere;
use glam::Vec3;

/// Numbers of input, and words of output, of a case.
const GIVEN: usize = 12;
const WORDS: usize = 17;

const ENTRY: &str = "
fn given3(k: u32) -> vec3f { return vec3f(given[k], given[k + 1u], given[k + 2u]); }
@compute @workgroup_size(64) fn functions(@builtin(global_invocation_id) id: vec3u) {
    let k = 12u * id.x;
    // Nothing of the parameters but that `zero` is 0.
    if k + params.zero >= arrayLength(&given) { return; }
    let sphere = Sphere(given3(k), given[k + 3u]);
    let origin = given3(k + 4u); let direction = given3(k + 7u);
    let o = 17u * id.x;
    let roots = roots_of(origin, direction, sphere);
    found[o] = select(0u, 1u, roots.meets);
    put(o + 1u, roots.low); put(o + 2u, roots.high);
    let met = met_on_sphere(sphere, origin, direction, given[k + 10u]);
    put3(o + 3u, met.position); put3(o + 6u, met.normal); put(o + 9u, met.error);
    let stored = on_sphere(sphere, origin);
    put3(o + 10u, stored.position); put3(o + 13u, stored.normal);
    put(o + 16u, spawn(stored, direction).x);
}
";

/// Where the rays of a case start.
#[derive(Debug, Clone, Copy, PartialEq)]
enum From {
    /// This many radii from the centre, aimed at the sphere, beside it or at its rim.
    Far(f32),
    /// Within the sphere.
    Inside,
    /// On the surface of the sphere, where the processor starts rays, in any direction and along the surface.
    Surface,
}

struct Case {
    sphere: Sphere,
    ray: Ray,
    from: From,
    /// Whether the ray starts on the sphere's surface and leaves it, and the rounding of coordinates is fine enough to resolve the sphere.
    leaves: bool,
}

fn cases() -> Vec<Case> {
    let mut random = Random(11);
    let mut cases = Vec::new();
    let sizes = [(1e-4, 0.0), (1e-4, 1.0), (0.3, 0.0), (1.0, 100.0), (250.0, 300.0), (1e-4, 1e4)];
    for (radius, away) in sizes {
        for from in [From::Far(3.0), From::Far(1e4), From::Far(1e8), From::Inside, From::Surface] {
            for index in 0..1500 {
                let sphere = Sphere { center: random.vector() * away, radius, material: 0 };
                let mut unit = || random.vector().normalize_or(Vec3::X);
                let (along, other) = (unit(), unit());
                let aside = along.any_orthonormal_vector();
                let mut leaves = false;
                let (origin, direction) = match from {
                    From::Far(radii) => {
                        // Through the sphere, within a millionth of its rim, or past it.
                        let share = [0.5, 1.0 + 1e-6 * (index % 7) as f32 - 3e-6, 1.2][index % 3];
                        (sphere.center + (aside * share - along * radii) * radius, along)
                    }
                    From::Inside => (sphere.center + other * radius * 0.9, along),
                    From::Surface => {
                        let point = SurfacePoint::on_sphere(&sphere, sphere.center + other * radius);
                        let tilt = [1.0, 1e-3, 1e-7][index % 3];
                        let flat = along.cross(point.normal).normalize_or(aside);
                        let direction = (flat + point.normal * tilt * along.x).normalize();
                        leaves = direction.dot(point.normal) > 0.0 && away <= 3e3 * radius;
                        (point.spawn(direction), direction)
                    }
                };
                cases.push(Case {
                    sphere,
                    ray: Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY },
                    from,
                    leaves,
                });
            }
        }
    }
    cases
}

/// The device's output for each case; `change` is applied to the source of the programs.
fn found(rays: &WgpuRays, cases: &[Case], change: impl Fn(String) -> String) -> Vec<[u32; WORDS]> {
    let variant = Variant::Panes(Fidelity::Corrected);
    let kind = Kind { spheres: true, ..Kind::plain(RayProgram::Reflection, variant) };
    let text = source(kind, Stage::Whole, (rays.arithmetic, TextureLod::Zero), Split::default()).expect("written");
    let given: Vec<[f32; GIVEN]> = cases
        .iter()
        .map(|Case { sphere, ray, .. }| {
            let ([x, y, z], [a, b, c], [u, v, w]) =
                (sphere.center.to_array(), ray.origin.to_array(), ray.direction.to_array());
            let t = sphere_roots(ray, sphere).map_or(1.0, |roots| roots[1]);
            [x, y, z, sphere.radius, a, b, c, u, v, w, t, 0.0]
        })
        .collect();
    answers(&rays.gpu, change(text) + ENTRY, (&[], &[]), &given)
}

/// The processor's roots, in the format of the device's output.
fn expected(Case { sphere, ray, .. }: &Case) -> [u32; 3] {
    match sphere_roots(ray, sphere) {
        Some(roots) => [1, roots[0].to_bits(), roots[1].to_bits()],
        None => [0; 3],
    }
}

/// Bound on the error of points from the rounding of the distance to 46 bits; near the rim it is larger along the ray.
fn met_error(sphere: &Sphere, ray: &Ray) -> f64 {
    let apart = (ray.origin - sphere.center).as_dvec3();
    let direction = ray.direction.as_dvec3().normalize();
    let (off, radius) = (apart.length() * 2e-13, f64::from(sphere.radius));
    let square = radius * radius - (apart - apart.dot(direction) * direction).length_squared();
    off + (2.0 * radius * off).sqrt().min(radius * off / square.max(1e-300).sqrt())
}

/// Whether the device's roots are the processor's; -0 and 0 count as the same distance.
fn is_same(found: &[u32], expected: [u32; 3]) -> bool {
    let number = |bits: u32| f32::from_bits(bits);
    found[0] == expected[0] && (1..3).all(|place| number(found[place]) == number(expected[place]))
}

#[test]
fn rays_meet_spheres_at_the_processors_distances_bit_by_bit() {
    let Some(rays) = rays() else { return };
    let cases = cases();
    let words = found(&rays, &cases, |text| text);
    let is_software = rays.gpu.adapter.kind == AdapterKind::Software;
    let (mut off, mut hits, mut points, mut again) = (0, [0; 2], 0, [0; 2]);
    for (case, words) in cases.iter().zip(&words) {
        let Case { sphere, ray, from, leaves } = case;
        let expected = expected(case);
        off += usize::from(!is_same(words, expected));
        hits[expected[0] as usize] += 1;
        let vector = |place: usize| Vec3::from_array([0, 1, 2].map(|axis| f32::from_bits(words[place + axis])));
        let t = if expected[0] == 1 { f32::from_bits(expected[2]) } else { 1.0 };
        let met = SurfacePoint::on_sphere_by(sphere, ray, t);
        let stored = SurfacePoint::on_sphere(sphere, ray.origin);
        let same = vector(3) == met.position && vector(6) == met.normal && f32::from_bits(words[9]) == met.error;
        let same = same && vector(10) == stored.position && vector(13) == stored.normal;
        // From a hundred million radii away, 46 bits are too few for the rounding that 53 bits give.
        if *from != From::Far(1e8) {
            points += usize::from(!(same && f32::from_bits(words[16]) == stored.spawn(ray.direction).x));
        }
        // With any driver, a point agrees with the processor's to a fraction of the offset of rays.
        let reach = f64::from(sphere.center.abs().max_element() + sphere.radius);
        let near = |found: Vec3, expected: Vec3, more: f64| {
            f64::from((found - expected).abs().max_element()) <= 1.2e-7 * reach + more
        };
        let far = met_error(sphere, ray);
        assert!(near(vector(3), met.position, far), "{sphere:?} {ray:?}: {} {}", vector(3), met.position);
        assert!(near(vector(10), stored.position, 0.0), "{sphere:?} {ray:?}");
        if *leaves {
            again[usize::from(words[0] == 1 && f32::from_bits(words[2]) > 0.0)] += 1;
        }
    }
    println!("of {}: {off} roots and {points} points differ; hits and misses {hits:?}", cases.len());
    assert!(hits[0] > 4000 && hits[1] > 10_000, "{hits:?}");
    assert!(again[0] > 2000 && again[1] == 0, "rays that leave a sphere meet it where they start: {again:?}");
    let few = if is_software { 0 } else { cases.len() / 1000 };
    assert!(off <= few, "{off} roots differ");
    assert!(points * 100 <= cases.len(), "{points} points differ");
}

/// The source `text`, changed so that its test of spheres has roots and quotients that are off by up to four units in the last place, depending on
/// an operand.
fn careless(text: &str) -> String {
    let [root, quotient] = ["let found = sep(sqrt(x));", "let found = sep(dividend / divisor);"];
    assert!(text.contains(root) && text.contains(quotient));
    let off = "
fn off(x: f32, by: f32) -> f32 {
    let units = i32((bitcast<u32>(by) * 2654435761u) >> 29u) - 3;
    return bitcast<f32>(u32(i32(bitcast<u32>(x)) + select(units, 0, x == 0.0 || !is_finite(x))));
}
";
    text.replace(root, "let found = sep(off(sqrt(x), x));")
        .replace(quotient, "let found = sep(off(dividend / divisor, a));")
        + off
}

#[test]
fn no_distance_depends_on_how_a_driver_rounds_roots_and_quotients() {
    let Some(rays) = rays() else { return };
    let cases = cases();
    let off = |words: &[[u32; WORDS]]| {
        cases.iter().zip(words).filter(|(case, words)| !is_same(*words, expected(case))).count()
    };
    let careless_off = off(&found(&rays, &cases, |text| careless(&text)));
    // Control: the results of a careless driver without the correction.
    let bare = found(&rays, &cases, |text| {
        let at_once = "> LEAST_ROUNDED && is_finite(found)";
        assert_eq!(text.matches(at_once).count(), 2);
        careless(&text).replace(at_once, "> LEAST_ROUNDED && params.zero != 0u")
    });
    println!("of {}: {careless_off} differ by a careless driver, {} uncorrected", cases.len(), off(&bare));
    assert_eq!(careless_off, 0, "roots differ");
    assert!(off(&bare) > cases.len() / 4, "control: {}", off(&bare));
}
