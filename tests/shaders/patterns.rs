//! Ray passes without a camera, which our own shaders draw: pictures with known pixels.
//!
//! They need the feature `glsl` and a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without a driver, the tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::{SIDE, assert_near, has_driver};
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::Settings;
use curitiba::{Choice, RasterChoice};

const PROJECT: &str = r#"<project name="p" width="64" height="64"><assets>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true">
<pass class="rt" name="pattern"><renderTarget name="target" fromLibrary="L"/>
<rtVertexAttributes><attribute name="position"/></rtVertexAttributes>
<rtEntryPoint><rayGen file="own.ptx" proc="__raygen__own"/></rtEntryPoint>
<rtDefaultMaterial><rayType name="Phong"><rtProgram type="MISS" file="own.ptx" proc="__miss__own"/></rayType></rtDefaultMaterial>
<rtGlobalParams>HANDED</rtGlobalParams></pass>
<pass class="quad" name="show"><texture name="shown" fromLibrary="L"/></pass>
</pipeline></pipelines></project>"#;

const LIBRARY: &str = r#"<materialLib name="L">
<textures><texture name="corners" filename="corners.png"/></textures>
<renderTargets><renderTarget name="target"><SIZE width="64" height="64"/>
<colors><color name="shown" internalFormat="RGBA32F"/></colors></renderTarget></renderTargets>
</materialLib>"#;

/// The picture of a pattern with the input `handed`.
fn picture(handed: &str) -> Image {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("p.xml");
    std::fs::write(&path, PROJECT.replace("HANDED", handed)).expect("written");
    std::fs::write(folder.path().join("p.mlib"), LIBRARY).expect("written");
    // The picture is as large as the target, so that each pixel shows one texel.
    let mut corners = Image::filled(SIDE, SIDE, [0.0, 0.0, 0.0, 1.0]);
    for (index, pixel) in (0..).zip(&mut corners.pixels) {
        *pixel = corner(index % SIDE, index / SIDE);
    }
    write_png(&folder.path().join("corners.png"), &corners).expect("written");
    let choice = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
    let opened = curitiba::open(path, Settings::default(), choice, &mut Silent);
    opened.unwrap_or_else(|error| panic!("{}", error.joined())).frame(&mut Silent).expect("it renders")
}

/// Red grows to the right and green downwards.
fn corner(x: u32, y: u32) -> [f32; 4] {
    [x as f32 / 255.0, y as f32 / 255.0, 1.0, 1.0]
}

#[test]
fn a_pass_that_is_handed_nothing_shows_stripes() {
    if !has_driver() {
        return;
    }
    let stripes = |x: u32, _| {
        let green = 0.5 + 0.5 * (0.2 * f64::from(x)).cos() as f32;
        [0.0, green, 1.0 - green, 1.0]
    };
    assert_near(&picture(""), stripes, 1e-4);
}

#[test]
fn a_pass_that_is_handed_a_texture_shows_it_upright() {
    if !has_driver() {
        return;
    }
    let handed = r#"<param name="tex" type="TEXTURE" context="L::corners" component="ID"/>"#;
    assert_near(&picture(handed), corner, 1e-4);
}
