//! The library: the settings of a renderer, cancelled frames, accumulated samples, and passes of the caller's own.

mod accumulate;
mod cancel;
mod given_up;
mod own;
mod setters;

use curitiba::Choice;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(format!("{name}.xml"))
}

/// Settings for small pictures, with few samples where the project takes any.
fn settings(name: &str) -> Settings {
    let sampled = matches!(name, "SceneSSAO" | "SceneFinal");
    let set = if sampled { vec!["pass2.samples=4".to_owned()] } else { Vec::new() };
    Settings { size: Some([112, 80]), set, ..Settings::default() }
}

fn opened(name: &str, settings: Settings) -> Renderer {
    curitiba::open(file(name), settings, Choice::CPU, &mut Silent).expect("the project opens")
}

fn bits(image: &Image) -> (u32, u32, Vec<[u32; 4]>) {
    (image.width, image.height, image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect())
}

fn frame(renderer: &mut Renderer) -> Image {
    renderer.frame(&mut Silent).expect("the frame renders")
}

fn update(renderer: &mut Renderer) -> Image {
    renderer.update(&mut Silent).expect("the frame renders")
}

fn ran(renderer: &Renderer) -> Vec<&str> {
    renderer.passes_run().collect()
}
