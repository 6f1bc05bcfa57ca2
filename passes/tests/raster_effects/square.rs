//! The effects on the shipped square: as near to the rays as their method allows.

use crate::world::mean;
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::executor::{Engines, Renderer, Silent};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::plan::{Plan, Settings};
use std::path::Path;

fn picture(name: &str, camera: &str) -> Image {
    picture_with(name, camera, &[], 192)
}

fn picture_with(name: &str, camera: &str, set: &[&str], side: u32) -> Image {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../xml_projects/{name}.xml"));
    let settings = Settings { size: Some([side; 2]), camera: Some(camera.to_owned()), set: set.iter().map(|s| (*s).to_owned()).collect(), ..Settings::default() };
    let project = curitiba_pipeline::project::load(&path).expect("the project is valid");
    let plan = Plan::new(project, settings).expect("the project has a plan");
    let engines = Engines { raster: Box::new(CpuRasteriser::new()), rays: Box::new(CpuRays::new()) };
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("the scene loads");
    renderer.frame(&mut Silent).expect("a frame")
}

/// Root of the mean square difference of two pictures' colours.
fn rms(a: &Image, b: &Image) -> f64 {
    let square = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>() / 3.0;
    mean(a.pixels.iter().zip(&b.pixels).map(square)).sqrt()
}

#[test]
fn each_effect_is_nearer_to_its_rays_than_no_effect_is() {
    // Not the shadows of `Vidro`: the sun grazes its pane, and the bias of a map over the whole town with its hills is
    // longer there than the way to what casts the shadow. What is refracted has no parallax in a map, so chairs behind the
    // pane are displaced: hardly nearer to the rays than the bare pane. Not the mirrors of `MainCamera`: four probes for all its windows.
    for (raster, rays, cameras, most) in [
        ("raster/SceneShadowMap", "SceneShadows", &["MainCamera"][..], 0.6),
        ("raster/SceneCubeReflect", "SceneReflect", &["Vidro"], 0.8),
        ("raster/SceneCubeRefract", "SceneRefract", &["Vidro"], 1.0),
        ("raster/SceneGTAO", "SceneSSAO", &["MainCamera", "Vidro"], 0.95),
    ] {
        for camera in cameras {
            let [found, expected, none] = [raster, rays, "SceneNoEffects"].map(|name| picture(name, camera));
            let (error, without) = (rms(&found, &expected), rms(&none, &expected));
            println!("{raster}, {camera}: {error:.4}, without the effect {without:.4}");
            assert_eq!(found.count_non_finite(), 0);
            assert!(error < most * without, "{raster}, {camera}: {error} {without}");
        }
    }
}

#[test]
#[ignore]
fn measure() {
    let side: u32 = std::env::var("SIDE").map_or(192, |v| v.parse().unwrap());
    let biases = std::env::var("BIAS").unwrap_or("1.5".into());
    for camera in ["MainCamera", "Vidro"] {
        let [expected, none] = ["SceneShadows", "SceneNoEffects"].map(|name| picture_with(name, camera, &[], side));
        println!("{camera} none {:.4}", rms(&none, &expected));
        for bias in biases.split(',') {
            for cascades in std::env::var("CASC").unwrap_or("1,2,3,4,6".into()).split(',') {
                for size in std::env::var("SIZE").unwrap_or("512,1024,2048".into()).split(',') {
                    let bias = format!("pass2.bias={bias}");
                    let cascades = format!("pass2.cascades={cascades}");
                    let size = format!("pass2.mapsize={size}");
                    let set = [bias.as_str(), &cascades, &size];
                    let found = picture_with("raster/SceneShadowMap", camera, &set, side);
                    println!("{camera} {set:?} {:.4}", rms(&found, &expected));
                }
            }
        }
    }
}
