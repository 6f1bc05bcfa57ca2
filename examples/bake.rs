//! Bakes a scene from rows of visibility: how much of the sky each triangle sees, and how much of it the scene hides.
//!
//! ```sh
//! cargo run --release --example bake -- xml_projects/SceneSSAO.xml sky.png occlusion.png
//! ```
//!
//! A half sphere of distant triangles is the sky. The form factors from a triangle to this sky, with the scene in between, sum to the sky-view
//! factor: the first picture. Without the scene, a triangle of tilt `t` would see `(1 + cos t) / 2` of the sky. The ratio of the two is ambient
//! occlusion, the second picture: white is open. Triangles that look large are halved first, so that the ground has more than one value.

use curitiba::passes::trace::{Bvh, Quality, Ray, Tracer as _};
use curitiba::passes::visibility::{Effort, Estimator, Options, Surfaces};
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::project::{self, Camera};
use curitiba::pipeline::scene::{Batch, Geometry};
use curitiba::visibility::load_project;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::path::Path;

type Triangle = [Vec3; 3];

/// Longest edge, as a share of the distance from the camera, and the length below which an edge is not halved.
const EDGE: f32 = 0.12;
const SHORT: f32 = 1.5;
/// Segments for a pair with an occluder in between.
const SAMPLES: u32 = 8;
/// Circles of latitude of the half sphere, and quadrilaterals in each.
const RINGS: u32 = 3;
const SECTORS: u32 = 6;
/// Size of the pictures in pixels, and rays for each pixel along each axis.
const SIZE: [u32; 2] = [1024, 640];
const FINE: u32 = 3;
/// Memory that the scene may take.
const MEMORY: u64 = 4 << 30;

/// Halves a triangle at its longest edge until that edge is short for its distance.
fn divided(triangle: Triangle, eye: Vec3, parts: &mut Vec<Triangle>) {
    let mut left = vec![triangle];
    while let Some([a, b, c]) = left.pop() {
        let lengths = [a.distance(b), b.distance(c), c.distance(a)];
        let longest = lengths[0].max(lengths[1]).max(lengths[2]);
        let [p, q, r] = if lengths[0] == longest {
            [a, b, c]
        } else if lengths[1] == longest {
            [b, c, a]
        } else {
            [c, a, b]
        };
        let distance = (eye.distance((p + q + r) / 3.0) - longest).max(0.0);
        if longest > (EDGE * distance).max(SHORT) {
            let middle = (p + q) * 0.5;
            left.extend([[p, middle, r], [middle, q, r]]);
        } else {
            parts.push([a, b, c]);
        }
    }
}

/// The upper half of a sphere, which looks inward.
fn sphere(center: Vec3, radius: f32) -> Vec<Triangle> {
    let at = |ring: u32, sector: u32| {
        // Rings of equal area lie between circles of latitude at equal distances along the axis.
        let y = ring as f32 / RINGS as f32;
        let (sin, cos) = (TAU * (sector % SECTORS) as f32 / SECTORS as f32).sin_cos();
        let r = (1.0 - y * y).max(0.0).sqrt();
        center + radius * Vec3::new(r * cos, y, r * sin)
    };
    let mut triangles = Vec::new();
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let [a, b, c, d] = [at(ring, sector), at(ring, sector + 1), at(ring + 1, sector + 1), at(ring + 1, sector)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let area = |[a, b, c]: &Triangle| (*b - *a).cross(*c - *a).length();
    triangles.retain(|triangle| area(triangle) > 1e-4 * radius * radius);
    for triangle in &mut triangles {
        let [a, b, c] = *triangle;
        if (b - a).cross(c - a).dot(a - center) > 0.0 {
            *triangle = [a, c, b];
        }
    }
    triangles
}

/// The scene's triangles, divided, with the sphere behind them; the number of the scene's triangles; and the number of all triangles.
fn with_sphere(geometry: &Geometry, eye: Vec3) -> (Geometry, u32, u32) {
    let mut triangles = Vec::new();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for id in 0..geometry.triangles.len() as u32 {
        let corners = geometry.corners(id);
        corners.iter().for_each(|corner| (low, high) = (low.min(*corner), high.max(*corner)));
        divided(corners, eye, &mut triangles);
    }
    let count = triangles.len() as u32;
    let sky = sphere((low + high) * 0.5, 50.0 * (high - low).length());
    triangles.extend_from_slice(&sky);
    let all = triangles.len() as u32;
    let geometry = Geometry {
        positions: triangles.concat(),
        triangles: (0..all).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        batches: vec![Batch { material: 0, first: 0, count: all }],
        ..Geometry::default()
    };
    (geometry, count, all)
}

/// For each triangle: the form factor to the sky, and its ratio to the form factor without the scene.
fn bake(geometry: &Geometry, count: u32, all: u32) -> Result<Vec<[f32; 2]>, String> {
    let surfaces = Surfaces::new(geometry, &[]);
    let bvh = Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::default());
    let options = Options { effort: Effort::Samples(SAMPLES), form_factors: true, ..Options::default() };
    let estimator = Estimator::new(&surfaces, &bvh, options)?;
    let (mut rows, mut values) = (Vec::new(), vec![0.0_f64; count as usize]);
    let triangles: Vec<u32> = (0..count).collect();
    for some in triangles.chunks(4096) {
        let pairs: Vec<[u32; 2]> = some.iter().flat_map(|a| (count..all).map(move |b| [*a, b])).collect();
        estimator.rows(&pairs, &mut rows);
        for row in &rows {
            values[row.pair[0] as usize] += row.form_factors.unwrap_or_default()[0];
        }
    }
    let share = |(id, sky): (u32, f64)| {
        let [a, b, c] = geometry.corners(id);
        let alone = 0.5 * (1.0 + (b - a).cross(c - a).normalize_or_zero().y);
        [sky as f32, if alone > 1e-3 { sky as f32 / alone } else { 1.0 }]
    };
    Ok((0..).zip(values).map(share).collect())
}

/// The scene from a camera at `eye`; each triangle's value is its grey.
fn draw(geometry: &Geometry, count: u32, (camera, eye): (&Camera, Vec3), values: &[f32]) -> Image {
    let bvh = Bvh::build(geometry, &[], Quality::default());
    let [width, height] = SIZE;
    let right = camera.direction.cross(camera.up).normalize();
    let up = right.cross(camera.direction);
    let tall = (0.5 * camera.fov_y).tan();
    let mut image = Image::filled(width, height, [0.0; 4]);
    image.pixels.par_iter_mut().enumerate().for_each(|(index, pixel)| {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let mut sum = Vec3::ZERO;
        for sample in 0..FINE * FINE {
            let part = |place: u32, part: u32| place as f32 + (part as f32 + 0.5) / FINE as f32;
            let [x, y] = [part(x, sample % FINE), part(y, sample / FINE)];
            let across = (2.0 * x - width as f32) / height as f32 * tall;
            let above = (1.0 - 2.0 * y / height as f32) * tall;
            let direction = (camera.direction + across * right + above * up).normalize();
            let ray = Ray { origin: eye, direction, t_min: camera.near, t_max: f32::INFINITY };
            sum += match bvh.closest(&ray, |_| true).filter(|hit| hit.triangle < count) {
                Some(hit) => Vec3::splat(values[hit.triangle as usize].clamp(0.0, 1.0)),
                None => Vec3::new(0.55, 0.7, 0.9),
            };
        }
        *pixel = (sum / (FINE * FINE) as f32).extend(1.0).to_array();
    });
    image
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, sky, occlusion] = &arguments[..] else {
        return Err("usage: bake PROJECT.xml SKY.png OCCLUSION.png".into());
    };
    let project = project::load(Path::new(file))?;
    let camera = project.cameras.first().ok_or("the project has no camera")?.clone();
    let scene = load_project(&project, MEMORY)?.scene;
    let eye = (camera.position - scene.origin).as_vec3();
    let (geometry, count, all) = with_sphere(&scene.geometry, eye);
    println!("{count} triangles, {} pairs with the sphere", u64::from(count) * u64::from(all - count));
    let start = std::time::Instant::now();
    let values = bake(&geometry, count, all)?;
    println!("{:.1} s", start.elapsed().as_secs_f64());
    for (path, value) in [(sky, 0), (occlusion, 1)] {
        let shares: Vec<f32> = values.iter().map(|shares| shares[value]).collect();
        write_png(path.as_ref(), &draw(&geometry, count, (&camera, eye), &shares))?;
        println!("{path}");
    }
    Ok(())
}
