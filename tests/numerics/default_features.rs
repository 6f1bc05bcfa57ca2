//! The messages of a program that was built without the features `glsl` and `cuda`, for settings that need them.

use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::plan::Settings;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::Path;

/// The message with which a shipped project is refused.
fn refused(file: &str, choice: Choice) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../xml_projects").join(file);
    match curitiba::open(&path, Settings::default(), choice, &mut Silent) {
        Ok(_) => panic!("{file} is refused"),
        Err(error) => error.joined(),
    }
}

#[test]
fn own_shaders_ask_for_the_feature_glsl() {
    let drawn = refused("shaders/Bands.xml", Choice { raster: RasterChoice::Auto, ..Choice::CPU });
    assert!(drawn.contains("Bands.xml:") && drawn.contains("is not a raster program"), "{drawn}");
    let computed = refused("shaders/Compute.xml", Choice { raster: RasterChoice::Auto, ..Choice::CPU });
    assert!(computed.contains("Compute.xml:") && computed.contains("runs a compute shader"), "{computed}");
    for said in [drawn, computed] {
        assert!(said.contains("cargo build --features glsl"), "{said}");
    }
}

#[test]
fn ray_backends_of_nvidia_ask_for_the_feature_cuda() {
    for backend in [BackendChoice::Cuda, BackendChoice::Optix] {
        let said = refused("SceneShadows.xml", Choice { backend, ..Choice::CPU });
        assert!(said.contains("this program was built without it") && said.contains("--features cuda"), "{said}");
    }
}
