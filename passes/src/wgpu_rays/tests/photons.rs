//! The light of photons near a point, as programs find and sum them, against `PhotonMap::each_near`, point by point.

use super::functions::{Random, answers};
use super::rays;
use crate::effects::constants::PHOTON_GRAZING;
use crate::effects::dielectric::{Cloud, Photon, PhotonMap, Variant};
use crate::wgpu_rays::layout::{BODY_HEAD, HEAD_PHOTONS};
use crate::wgpu_rays::photons::append;
use crate::wgpu_rays::programs::{Kind, Stage, source};
use crate::wgpu_rays::split::Split;
use crate::wgpu_rays::{RayProgram, TextureLod, WgpuRays};
use curitiba_pipeline::backend::PhotonCounts;
use glam::Vec3;

/// Number of cases for each cloud.
const CASES: usize = 2000;
/// Numbers of input, and words of output, of a case: a point and the unit normal of the side that is lit, and the light.
const GIVEN: usize = 6;
const WORDS: usize = 3;

// All parameters are 0, among them the light's colour, so the share of each photon's colour is 1.
const ENTRY: &str = "
@compute @workgroup_size(64) fn functions(@builtin(global_invocation_id) id: vec3u) {
    let k = 6u * id.x;
    if k + params.zero >= arrayLength(&given) { return; }
    lit.position = vec3f(given[k], given[k + 1u], given[k + 2u]);
    lit.facing = vec3f(given[k + 3u], given[k + 4u], given[k + 5u]);
    put3(3u * id.x, light_of_photons());
}
";

/// Photons of random directions in a cube of this half side around a point.
fn cloud(random: &mut Random, count: usize, (center, half): (Vec3, f32), radius: f32) -> Cloud {
    let mut photon = |number: u32| {
        let normal = (Vec3::Y + random.vector()).normalize_or(Vec3::Y);
        let direction = random.vector().normalize_or(Vec3::NEG_Y);
        let direction = if direction.dot(normal) > 0.0 { -direction } else { direction };
        let power = Vec3::new(random.unit(), random.unit(), random.unit()) + 0.1;
        Photon::new(center + half * random.vector(), (direction, normal), power, number)
    };
    Cloud::new((0..count as u32).map(&mut photon).collect(), radius).expect("there is memory")
}

/// Many photons; so few that cells often share an entry of the table; none; and some so far from the origin that neighbouring coordinates are
/// farther apart than the radius.
fn photons(random: &mut Random) -> PhotonMap {
    let clouds = [
        cloud(random, 3000, (Vec3::ZERO, 2.5), 0.9),
        cloud(random, 6, (Vec3::X * 20.0, 0.6), 0.5),
        cloud(random, 0, (Vec3::ZERO, 4.0), 0.5),
        cloud(random, 64, (Vec3::new(1e6, -1e6, 0.0), 1.0), 1e-4),
    ];
    PhotonMap::new(clouds.into(), PhotonCounts::default())
}

/// Points near photons, on sides that are tilted against those of the photons.
fn cases(random: &mut Random, photons: &PhotonMap) -> Vec<[f32; GIVEN]> {
    let mut cases = Vec::new();
    for cloud in photons.clouds().iter().filter(|cloud| !cloud.photons().is_empty()) {
        for _ in 0..CASES {
            let photon = &cloud.photons()[(random.unit() * cloud.photons().len() as f32) as usize];
            let point = photon.position + random.vector() * cloud.radius() * random.unit() * 1.5;
            let facing = (photon.normal + 0.7 * random.vector()).normalize_or(photon.normal);
            cases.push([point.to_array(), facing.to_array()].concat().try_into().expect("six numbers"));
        }
    }
    cases
}

/// The device's output for each case; `change` is applied to the source of the programs.
fn found(rays: &WgpuRays, photons: &PhotonMap, cases: &[[f32; GIVEN]], change: [&str; 2]) -> Vec<Vec3> {
    // The tables begin with the settings for paths in glass, of which programs read the place of the photons.
    let mut tables = vec![0; BODY_HEAD as usize];
    tables[HEAD_PHOTONS as usize] = append(&mut tables, photons).expect("there is memory");
    let kind = Kind { focuses: true, ..Kind::plain(RayProgram::Final, Variant::Bodies) };
    let text = source(kind, Stage::Focus, (rays.arithmetic, TextureLod::Zero), Split::default()).expect("written");
    let [old, new] = change;
    assert_eq!(text.matches(old).count(), 1, "{old}");
    let words: Vec<[u32; WORDS]> = answers(&rays.gpu, text.replace(old, new) + ENTRY, (&[], &tables), cases);
    words.into_iter().map(|words| Vec3::from_array(words.map(f32::from_bits))).collect()
}

#[test]
fn photons_near_a_point_are_those_of_the_processor() {
    let Some(rays) = rays() else { return };
    let random = &mut Random(29);
    let photons = photons(random);
    let cases = cases(random, &photons);
    // For each case the light, and the light that the same photons would bring with the greatest weight.
    let (mut pairs, mut expected) = (0, Vec::new());
    let clouds = photons.clouds().iter().filter(|cloud| !cloud.photons().is_empty());
    for (cases, cloud) in cases.chunks(CASES).zip(clouds) {
        for [x, y, z, facing @ ..] in cases {
            let (mut light, mut most) = (Vec3::ZERO, Vec3::ZERO);
            photons.each_near(Vec3::new(*x, *y, *z), Vec3::from_array(*facing), |photon, weight| {
                pairs += 1;
                let cosine = (-photon.direction.dot(photon.normal)).max(PHOTON_GRAZING);
                light += photon.power * (weight / cosine);
                most += photon.power * (cloud.greatest_weight() / cosine);
            });
            expected.push((light, most));
        }
    }
    let is_lit = |(light, _): &&(Vec3, Vec3)| *light != Vec3::ZERO;
    let lit: Vec<usize> = expected.chunks(CASES).map(|lights| lights.iter().filter(is_lit).count()).collect();
    println!("{pairs} photons light {lit:?} of {} points", cases.len());
    assert!(pairs > 10_000 && lit.iter().all(|lit| *lit > 400), "{pairs} {lit:?}");
    let off = |change: [&str; 2]| {
        let found = found(&rays, &photons, &cases, change);
        // Quotients may be off by a few units in the last place.
        let is_off =
            |(found, (light, most)): (&Vec3, &(Vec3, Vec3))| !(*found - *light).abs().cmple(2e-6 * *most).all();
        found.iter().zip(&expected).filter(|pair| is_off(*pair)).count()
    };
    assert_eq!(off(["fn light_of_photons", "fn light_of_photons"]), 0);
    // Controls: each of these parts matters.
    for change in [
        ["if !is_new { continue; }", ""],
        ["abs(height) <= sep(PHOTON_FLAT * radius)", "true"],
        ["dot3(normal, lit.facing) >= PHOTON_ALIKE", "true"],
        ["dot3(direction, lit.facing) < 0.0", "true"],
        ["PHOTON_GRAZING)", "0.001)"],
        ["bitcast<vec3u>(vec3i(floor(point)))", "bitcast<vec3u>(vec3i(point))"],
        ["vec3u(1u, 2u, 4u)", "vec3u(1u, 2u, 0u)"],
    ] {
        let off = off(change);
        println!("{off} points are off with {change:?}");
        assert!(off > 50, "{change:?}: {off}");
    }
}
