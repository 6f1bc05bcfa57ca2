//! Several samples per pixel: closed forms of the picture, and everything in which such a picture must agree with one of a
//! single sample.

mod adaptive;
mod exact;
mod frames;
mod occlusion;

use curitiba::Choice;
use curitiba::pipeline::color::ColorSpace;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{Orthographic, Project, SceneOptions, SceneProjects};
use curitiba::pipeline::scene::{Group, Material, Mesh, Object, Scene};
use glam::{DVec3, Mat4, Vec2, Vec3};
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(format!("{name}.xml"))
}

fn samples(count: u32) -> PixelSamples {
    PixelSamples::new(count).expect("there are so many")
}

/// Settings for small pictures, with few samples where the project takes any.
fn settings(name: &str, count: u32) -> Settings {
    let sampled = matches!(name, "SceneSSAO" | "SceneFinal");
    let set = if sampled { vec!["pass2.samples=4".to_owned()] } else { Vec::new() };
    Settings { size: Some([112, 80]), aa: samples(count), set, ..Settings::default() }
}

fn opened(name: &str, settings: Settings) -> Renderer {
    curitiba::open(file(name), settings, Choice::CPU, &mut Silent).expect("the project opens")
}

fn frame(renderer: &mut Renderer) -> Image {
    renderer.frame(&mut Silent).expect("the frame renders")
}

fn bits(image: &Image) -> (u32, u32, Vec<[u32; 4]>) {
    (image.width, image.height, image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect())
}

/// The mean of pictures, summed in `f64`.
fn mean(pictures: &[Image]) -> Image {
    let of = |pixel: usize| {
        [0, 1, 2, 3].map(|i| {
            let sum: f64 = pictures.iter().map(|picture| f64::from(picture.pixels[pixel][i])).sum();
            (sum / pictures.len() as f64) as f32
        })
    };
    let Image { width, height, ref pixels } = pictures[0];
    Image { width, height, pixels: (0..pixels.len()).map(of).collect() }
}

fn rms(a: &Image, b: &Image) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let squares = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)));
    (squares.sum::<f64>() / (3 * a.pixels.len()) as f64).sqrt()
}

/// Triangles in z = 0 in front of black, seen along z by an orthographic camera. A unit is a pixel; x goes right and y
/// up from the picture's centre. The camera is displaced by `moved`.
fn flat(triangles: &[[Vec2; 3]], side: u32, moved: [f32; 2]) -> Project {
    let mesh = Mesh {
        name: "flat".to_owned(),
        positions: triangles.as_flattened().iter().map(|corner| corner.extend(0.0)).collect(),
        groups: vec![Group {
            material: 0,
            triangles: (0..triangles.len() as u32).map(|index| [0, 1, 2].map(|corner| 3 * index + corner)).collect(),
        }],
        ..Mesh::default()
    };
    let object = Object { name: "flat".to_owned(), mesh: 0, transform: Mat4::IDENTITY };
    let white = Material { name: "white".to_owned(), diffuse: glam::Vec4::ONE, ..Material::default() };
    let scene = Scene { meshes: vec![mesh], objects: vec![object], materials: vec![white], ..Scene::default() };
    let options = SceneOptions {
        effects: Some("none".parse().expect("effects")),
        look_from: Some(DVec3::new(0.0, 0.0, 16.0)),
        look_at: Some(DVec3::ZERO),
        sun: Some(Vec3::Z),
        background: Some(Vec3::ZERO),
        ..SceneOptions::default()
    };
    let mut project = SceneProjects::in_memory(scene, &options, Some([side; 2])).expect("a project").project();
    let half = side as f32 / 2.0;
    let [right, down] = moved;
    for camera in &mut project.cameras {
        (camera.position, camera.near, camera.far) = (DVec3::new(0.0, 0.0, 16.0), 1.0, 33.0);
        camera.orthographic =
            Some(Orthographic { left: right - half, right: right + half, bottom: -down - half, top: -down + half });
    }
    project
}

/// The covered share of every pixel in the picture of a [`flat`] project.
fn covered(project: Project, count: u32) -> Vec<f64> {
    let settings = Settings { aa: samples(count), color: Some(ColorSpace::Linear), ..Settings::default() };
    let mut renderer = curitiba::open_project(project, settings, Choice::CPU, &mut Silent).expect("it opens");
    let picture = frame(&mut renderer);
    assert!(picture.pixels.iter().all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2]));
    picture.pixels.iter().map(|pixel| f64::from(pixel[0])).collect()
}
