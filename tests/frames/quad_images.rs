//! Image files that the own shader of a quad samples: when they are read again, and how much memory they may take together.
//!
//! Pictures need the feature `glsl` and a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without a driver, the tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::{assert_near, has_driver};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::Settings;
use curitiba::{Choice, RasterChoice};
use tempfile::TempDir;

const LIBRARY: &str = r#"<materialLib name="L">
<textures><texture name="a" filename="a.png"/><texture name="b" filename="b.png"/></textures>
<shaders><shader name="quad" vs="quad.vert" ps="quad.frag"/></shaders>
<materials><material name="quad"><shader name="quad"><values>
<valueof uniform="first" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>
<valueof uniform="second" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="1"/>
</values></shader><textures><texture UNIT="0" name="a"/><texture UNIT="1" name="b"/></textures></material></materials></materialLib>"#;

const PROJECT: &str = r#"<project name="p" width="64" height="64"><assets>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true">
<pass class="quad" name="quad"><material name="quad" fromLibrary="L"/></pass>
</pipeline></pipelines></project>"#;

const VERTEX: &str = "#version 430\nin vec4 position;\nvoid main() { gl_Position = position; }\n";
const FRAGMENT: &str = "#version 430
uniform sampler2D first;
uniform sampler2D second;
out vec4 color;
void main() { color = 0.5 * (texelFetch(first, ivec2(0), 0) + texelFetch(second, ivec2(0), 0)); }
";

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const GREEN: [f32; 4] = [0.0, 1.0, 0.0, 1.0];
const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

/// A project whose quad shows the mean of the images `a.png` and `b.png`.
struct Project(TempDir);

impl Project {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in [("p.xml", PROJECT), ("p.mlib", LIBRARY), ("quad.vert", VERTEX), ("quad.frag", FRAGMENT)] {
            std::fs::write(folder.path().join(name), text).expect("written");
        }
        Self(folder)
    }

    fn image(&self, name: &str, side: u32, color: [f32; 4]) {
        write_png(&self.0.path().join(name), &Image::filled(side, side, color)).expect("written");
    }

    fn open(&self, settings: Settings) -> Renderer {
        let choice = Choice { raster: RasterChoice::Auto, ..Choice::CPU };
        let opened = curitiba::open(self.0.path().join("p.xml"), settings, choice, &mut Silent);
        opened.unwrap_or_else(|error| panic!("{}", error.joined()))
    }
}

#[test]
fn a_reload_reads_the_images_of_quads_again() {
    if !has_driver() {
        return;
    }
    let project = Project::new();
    project.image("a.png", 2, RED);
    project.image("b.png", 2, BLUE);
    let mut renderer = project.open(Settings::default());
    let before = |_, _| [0.5, 0.0, 0.5, 1.0];
    assert_near(&renderer.frame(&mut Silent).expect("it renders"), before, 1e-6);
    project.image("a.png", 2, GREEN);
    assert_near(&renderer.frame(&mut Silent).expect("it renders"), before, 1e-6);
    renderer.reload().expect("the project is there");
    assert_near(&renderer.update(&mut Silent).expect("it renders"), |_, _| [0.0, 0.5, 0.5, 1.0], 1e-6);
}

/// An image of 512 x 512 texels takes 4/3 MiB with its mip levels, and 1 MiB more while it is read.
#[test]
fn the_images_of_quads_take_no_more_memory_together_than_is_allowed() {
    if !has_driver() {
        return;
    }
    let project = Project::new();
    project.image("a.png", 512, RED);
    project.image("b.png", 512, BLUE);
    let opened = |mebibytes: u64| project.open(Settings { max_memory: mebibytes << 20, ..Settings::default() });
    opened(4).frame(&mut Silent).expect("it renders");
    let said = opened(3).frame(&mut Silent).expect_err("it is refused").to_string();
    assert!(said.contains(".png") && said.contains("--max-memory"), "{said}");
}
