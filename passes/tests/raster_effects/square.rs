//! The effects on the shipped square: as near to the rays as their method allows.

use crate::world::mean;
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::executor::{Engines, Renderer, Silent};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::plan::{Plan, Settings};
use std::path::Path;

fn picture(name: &str, camera: &str, set: &[&str]) -> Image {
    rendered(name, camera, set, 192)
}

fn rendered(name: &str, camera: &str, set: &[&str], side: u32) -> Image {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../xml_projects/{name}.xml"));
    let set = set.iter().map(|set| (*set).to_owned()).collect();
    let settings = Settings { size: Some([side, side]), camera: Some(camera.to_owned()), set, ..Settings::default() };
    let project = curitiba_pipeline::project::load(&path).expect("the project is valid");
    let plan = Plan::new(project, settings).expect("the project has a plan");
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
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
    // What is refracted has no parallax in a map, so chairs behind the
    // pane are displaced: hardly nearer to the rays than the bare pane. Not the mirrors of `MainCamera`: four probes for all its windows.
    for (raster, rays, cameras, most) in [
        ("raster/SceneShadowMap", "SceneShadows", &["MainCamera", "Vidro"][..], 0.4),
        ("raster/SceneCubeReflect", "SceneReflect", &["Vidro"], 0.8),
        ("raster/SceneCubeRefract", "SceneRefract", &["Vidro"], 1.0),
        ("raster/ScenePlanarReflect", "SceneReflect", &["MainCamera", "Vidro"], 0.5),
        ("raster/SceneGTAO", "SceneSSAO", &["MainCamera", "Vidro"], 0.95),
    ] {
        for camera in cameras {
            let [found, expected, none] = [raster, rays, "SceneNoEffects"].map(|name| picture(name, camera, &[]));
            let (error, without) = (rms(&found, &expected), rms(&none, &expected));
            println!("{raster}, {camera}: {error:.4}, without the effect {without:.4}");
            assert_eq!(found.count_non_finite(), 0);
            assert!(error < most * without, "{raster}, {camera}: {error} {without}");
        }
    }
}

#[test]
fn cascades_are_nearer_to_the_rays_than_one_map_of_the_same_size_or_of_the_same_memory() {
    for camera in ["MainCamera", "Vidro"] {
        let [expected, none] = ["SceneShadows", "SceneNoEffects"].map(|name| picture(name, camera, &[]));
        let without = rms(&none, &expected);
        let error = |cascades: &str, size: &str| {
            let [cascades, size] = [format!("pass2.cascades={cascades}"), format!("pass2.mapsize={size}")];
            let found = picture("raster/SceneShadowMap", camera, &[&cascades, &size]);
            let error = rms(&found, &expected);
            println!("{camera}, {cascades}, {size}: {error:.4}, without the effect {without:.4}");
            error
        };
        let four = error("4", "1024");
        assert!(four < 0.4 * without && four < 0.7 * error("1", "1024") && four < 0.8 * error("1", "2048"), "{camera}");
        // The control: one map of texels of many metres is no picture of these shadows.
        assert!(error("1", "32") > 0.6 * without, "{camera}");
    }
}

#[test]
fn mirrors_are_nearer_to_the_rays_than_cube_maps() {
    const SIDE: u32 = 512;
    for camera in ["MainCamera", "Vidro"] {
        let files = ["raster/ScenePlanarReflect", "raster/SceneCubeReflect", "SceneReflect", "SceneNoEffects"];
        let [mirrors, cubes, rays, none] = files.map(|name| rendered(name, camera, &[], SIDE));
        // Pixels whose ray meets no glass after the first: those that one bounce less does not change.
        let first = rendered("SceneReflect", camera, &["pass2.depth=0"], SIDE);
        let (mut worst, mut square, mut other, mut glass, mut deeper) = (0f32, 0.0, 0.0, 0u32, 0u32);
        for (index, expected) in first.pixels.iter().enumerate() {
            if *expected == none.pixels[index] {
                continue;
            }
            if *expected != rays.pixels[index] {
                deeper += 1;
                continue;
            }
            glass += 1;
            let off = |image: &Image| (0..3).map(|i| (image.pixels[index][i] - expected[i]).powi(2)).sum::<f32>() / 3.0;
            worst = worst.max(off(&mirrors).sqrt());
            square += f64::from(off(&mirrors));
            other += f64::from(off(&cubes));
        }
        let [error, other] = [square, other].map(|sum| (sum / f64::from(glass)).sqrt());
        println!(
            "{camera}: first bounce of {glass} pixels (others {deeper}): mirrors {error:.4}, at most {worst:.3}, cube maps {other:.4}; \
             whole pictures {:.4} and {:.4}, without {:.4}",
            rms(&mirrors, &rays),
            rms(&cubes, &rays),
            rms(&none, &rays)
        );
        keep(&format!("{camera} mirrors"), &mirrors);
        keep(&format!("{camera} cubes"), &cubes);
        keep(&format!("{camera} rays"), &rays);
        keep(&format!("{camera} rays first"), &first);
        assert!(error < 0.5 * other && rms(&mirrors, &rays) < 0.8 * rms(&cubes, &rays), "{camera}");
    }
}

/// `CURITIBA_PICTURES=DIR` writes the pictures.
fn keep(name: &str, image: &Image) {
    if let Some(folder) = std::env::var_os("CURITIBA_PICTURES") {
        let path = Path::new(&folder).join(format!("{name}.png"));
        curitiba_pipeline::image::write_png(&path, image).expect("the picture is written");
    }
}
