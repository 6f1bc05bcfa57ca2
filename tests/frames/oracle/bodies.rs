//! Bodies of glass with `glass="auto"`, in whole scenes: compared with the results that `tests/oracle/bodies.py` stored.

use super::{Camera, Difference, Tally, agrees, load, path};
use curitiba::Choice;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::SceneOptions;
use glam::{DVec3, Vec3};
use serde::Deserialize;
use std::path::{Path, PathBuf};

#[derive(Deserialize)]
struct Stored {
    unseen: f64,
    set: Vec<String>,
    camera: Camera,
    sun: Option<[f32; 3]>,
    mean: Vec<Option<[f64; 3]>>,
    error: Vec<Option<[f64; 3]>>,
}

/// What a test changes: the eye's place, the seed, and parameters that replace the stored ones.
#[derive(Clone, Copy, Default)]
struct Change<'a> {
    moved: DVec3,
    seed: u32,
    set: &'a [&'a str],
}

/// The picture of a scene file, in linear light.
fn picture(stored: &Stored, file: &Path, change: Change<'_>) -> Image {
    let Camera { eye, target, fov_y, width, height, .. } = stored.camera;
    let point = |[x, y, z]: [f32; 3]| DVec3::new(x.into(), y.into(), z.into());
    let effects = if stored.sun.is_some() { "shadows+glass" } else { "glass" };
    let scene = SceneOptions {
        effects: Some(effects.parse().expect("effects")),
        look_from: Some(point(eye) + change.moved),
        look_at: Some(point(target) + change.moved),
        fov: Some(fov_y),
        sun: stored.sun.map(Vec3::from),
        ..SceneOptions::default()
    };
    let set = stored.set.iter().map(String::as_str).chain(change.set.iter().copied()).map(str::to_owned).collect();
    let settings = Settings { size: Some([width, height]), set, scene, seed: change.seed, ..Settings::default() };
    let mut renderer = curitiba::open(file, settings, Choice::CPU, &mut Silent)
        .unwrap_or_else(|error| panic!("{}: {}", file.display(), error.joined()));
    renderer.frame(&mut Silent).expect("a frame")
}

/// Compares red, green and blue. With one seed, a pixel is left out if a channel changes by more than 1 % when the eye moves by 0.002 scene units:
/// its path ends near the edge between two cells of the wall, which have different radiances. Mitsuba's rays start about 0.0001 off the surface, so
/// after twenty reflections its path may end in the other cell. Rough glass blurs these edges, and no pixel is left out. Its pictures have several
/// seeds, whose spread gives our noise. The stored `unseen` is an error that the standard errors miss.
fn difference(name: &str, file: &Path, seeds: u32, set: &[&str]) -> Difference {
    let stored: Stored = load(name);
    let change = Change { set, ..Change::default() };
    let pictures: Vec<Image> = (0..seeds).map(|seed| picture(&stored, file, Change { seed, ..change })).collect();
    let steps: &[DVec3] = if seeds > 1 { &[] } else { &[DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] };
    let moved = steps.iter().map(|step| picture(&stored, file, Change { moved: step * 2e-3, ..change }));
    let moved: Vec<Image> = moved.collect();
    let (mut tally, mut jumping) = (Tally::default(), 0);
    for (index, (mean, error)) in stored.mean.iter().zip(&stored.error).enumerate() {
        let (Some(mean), Some(error)) = (mean, error) else { continue };
        let value = |image: &Image, channel: usize| f64::from(image.pixels[index][channel]);
        let jumps = |image: &Image, channel: usize| {
            let first = value(&pictures[0], channel);
            (value(image, channel) - first).abs() > 1e-2 * first + 1e-6
        };
        if moved.iter().any(|image| (0..3).any(|channel| jumps(image, channel))) {
            jumping += 1;
            continue;
        }
        for channel in 0..3 {
            let ours: Vec<f64> = pictures.iter().map(|image| value(image, channel)).collect();
            let count = ours.len() as f64;
            let middle = ours.iter().sum::<f64>() / count;
            let own = ours.iter().map(|value| (value - middle).powi(2)).sum::<f64>() / (count - 1.0).max(1.0) / count;
            tally.add(middle, mean[channel], error[channel].hypot(own.sqrt()).hypot(stored.unseen));
        }
    }
    let found = Difference { jumping, ..tally.difference() };
    println!("{name} {set:?}: {found:?}");
    found
}

/// The scene file with one text replaced by another.
fn edited(name: &str, from: &str, to: &str) -> (tempfile::TempDir, PathBuf) {
    let text = std::fs::read_to_string(path(name, "gltf")).expect("the scene");
    assert!(text.contains(from), "{name}: {from}");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.gltf");
    std::fs::write(&file, text.replace(from, to)).expect("written");
    (folder, file)
}

/// The pictures agree, and with a mistake in the file they do not.
fn compared(name: &str, seeds: u32, least: usize, [from, to]: [&str; 2]) {
    let found = difference(name, &path(name, "gltf"), seeds, &[]);
    assert!(found.pixels > 3 * least && agrees(&found), "{name}: {found:?}");
    let (_folder, file) = edited(name, from, to);
    let wrong = difference(name, &file, seeds, &[]);
    assert!(!agrees(&wrong), "{name} with {to}: {wrong:?}");
}

#[test]
fn clear_bodies_show_the_room_alike() {
    for name in ["body_slab", "body_ball"] {
        compared(name, 1, 300, ["\"ior\":1.5", "\"ior\":1.53"]);
    }
}

#[test]
fn bodies_absorb_alike() {
    compared("body_dyed", 1, 300, ["\"attenuationDistance\":1.0", "\"attenuationDistance\":0.95"]);
}

#[test]
fn a_body_in_a_body_shows_the_room_alike() {
    compared("body_filled", 1, 200, ["\"ior\":1.33", "\"ior\":1.31"]);
}

/// The camera is in the body, which absorbs light from emitters in it as well as what comes through its faces.
#[test]
fn a_camera_in_a_body_sees_emitters_in_it_and_outside_alike() {
    compared("body_inside", 1, 300, ["\"attenuationDistance\":1.0", "\"attenuationDistance\":0.95"]);
}

#[test]
fn rough_bodies_scatter_alike() {
    compared("body_rough", 32, 300, ["\"roughnessFactor\":0.31622776601683794", "\"roughnessFactor\":0.35"]);
}

/// The oracle renders wavelength by wavelength. Its table of colour matching differs from our formula by a hundredth.
#[test]
fn colours_are_bent_apart_alike() {
    compared("body_prism", 1, 150, ["\"dispersion\":1.0", "\"dispersion\":0.7"]);
}

#[test]
fn textures_and_holes_are_seen_alike_through_a_body() {
    compared("body_texture", 1, 300, ["\"alphaMode\":\"MASK\"", "\"alphaMode\":\"OPAQUE\""]);
}

/// The share of the sun's light that a body leaves on a floor. Without an occluder the floor has one colour; where no sunlight is left, half of
/// that colour.
#[test]
fn light_that_goes_straight_on_is_kept_alike() {
    let stored: Stored = load("body_shadow");
    let image = picture(&stored, &path("body_shadow", "gltf"), Change::default());
    let lit = stored.mean.iter().position(|mean| *mean == Some([1.0; 3])).expect("a pixel in the light");
    let (mut shaded, mut unlike, mut pixels, mut most) = (0, 0, 0, 0.0_f64);
    for (index, mean) in stored.mean.iter().enumerate() {
        let Some(mean) = mean else { continue };
        let share = |channel: usize| 2.0 * f64::from(image.pixels[index][channel] / image.pixels[lit][channel]) - 1.0;
        let off = (0..3).map(|channel| (share(channel) - mean[channel]).abs()).fold(0.0, f64::max);
        pixels += 1;
        shaded += usize::from(mean[2] < 0.9);
        unlike += usize::from(off > 1e-3);
        most = if off > 1e-3 { most } else { most.max(off) };
    }
    println!("{pixels} pixels, {shaded} of them in the shadow, {unlike} differ; the others by {most:.1e} at most");
    assert!(pixels > 400 && shaded > 60, "{pixels} {shaded}");
    // Pixels whose ray to the sun passes an edge of the body.
    assert!(unlike <= 2, "{unlike}");
}
