//! Textures of a project's material libraries on primitives and scene files, by rasterisers and by rays.
//!
//! Pictures of the device need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one the tests print `skipped`,
//! or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`. Pictures of an NVIDIA GPU are skipped without one, or fail with `CURITIBA_REQUIRE_CUDA_TESTS=1`.

use crate::own_shaders::{SIDE, has_driver};
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{Project, load};
use curitiba::pipeline::scene::ShapeKind;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The quarters of the texture, by row from the top.
const QUARTERS: [[u8; 3]; 4] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]];
const RED: char = 'r';
const GREEN: char = 'g';
const BLUE: char = 'b';
const YELLOW: char = 'y';

/// A folder with the texture, a square as a scene file, and a library.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let quarter = |x: u32, y: u32| (x / 16 + 2 * (y / 16)) as usize;
    let texture = image::RgbImage::from_fn(32, 32, |x, y| image::Rgb(QUARTERS[quarter(x, y)]));
    std::fs::create_dir(folder.path().join("images")).expect("a folder");
    texture.save(folder.path().join("images/quarters.png")).expect("written");
    let few = image::RgbImage::from_fn(2, 2, |x, y| image::Rgb(QUARTERS[(x + 2 * y) as usize]));
    few.save(folder.path().join("images/few.png")).expect("written");
    write(
        "square.obj",
        "usemtl wall\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1/1 2/2 3/3 4/4\n",
    );
    write("pane.obj", "usemtl pane\nv -1 -1 2\nv 1 -1 2\nv 1 1 2\nv -1 1 2\nf 1 2 3 4\n");
    write(
        "l.mlib",
        r#"<materialLib name="L">
<textures><texture name="Quarters" filename="images\quarters.png" mipmap=true/><texture name="Lost" filename="images/lost.png"/><texture name="Few" filename="images/few.png"/></textures>
<renderTargets><renderTarget name="target"><SIZE width="64" height="64"/><colors><color name="seen" internalFormat="RGBA32F"/></colors></renderTarget>
<renderTarget name="buffers"><SIZE width="64" height="64"/><CLEAR_VALUES r="0" g="0" b="0" a="1"/>
<colors><color name="shaded" internalFormat="RGBA32F"/><color name="pos" internalFormat="RGBA32F"/><color name="norm" internalFormat="RGBA32F"/></colors></renderTarget></renderTargets>
<materials>
<material name="quarters"><color><DIFFUSE r="1" g="1" b="1"/></color><textures><texture name="Quarters" UNIT="0"/></textures></material>
<material name="lost"><color><DIFFUSE r="1" g="1" b="0"/></color><textures><texture name="Lost" UNIT="0"/></textures></material>
<material name="few"><color><DIFFUSE r="1" g="1" b="1"/></color><textures><texture name="Few" UNIT="0"/></textures></material>
<material name="nearest"><color><DIFFUSE r="1" g="1" b="1"/></color>
<textures><texture name="Few" UNIT="0"><MAG_FILTER value="NEAREST"/></texture></textures></material>
<material name="pane"><color><DIFFUSE r="1" g="0" b="1" a="0"/></color></material>
<material name="second"><color><DIFFUSE r="1" g="1" b="0"/></color><textures><texture name="Quarters" UNIT="1"/></textures></material>
</materials></materialLib>"#,
    );
    folder
}

/// How the scene is drawn.
#[derive(Clone, Copy, Debug)]
enum By {
    Raster,
    /// Rays from the camera.
    Rays,
    /// Rays from a pane of glass in front of the whole scene.
    Glass,
}

/// A project that looks along -z at the scene, and sees from -1 to 1 in the middle of the window.
fn project(folder: &Path, scene: &str, material: &str, by: By) -> PathBuf {
    let maps = format!(
        r#"<materialMaps><map fromMaterial="wall" toLibrary="L" toMaterial="{material}"/>
<map fromMaterial="pane" toLibrary="L" toMaterial="pane"/></materialMaps>"#
    );
    let scenes = r#"<scenes><scene name="S"/></scenes><lights><light name="Sun"/></lights>"#;
    let passes = match by {
        By::Rays => format!(
            r#"<pass class="rt" name="rays" program="albedo"><scenes><scene name="S"/></scenes><rendertarget name="target" fromLibrary="L"/>{maps}</pass>
<pass class="quad" name="show"><texture name="seen" fromLibrary="L"/></pass>"#
        ),
        By::Raster => format!(r#"<pass class="default" name="draw">{scenes}{maps}</pass>"#),
        By::Glass => {
            let program = |kind: &str, name: &str| {
                format!(r#"<optixProgram type="{kind}" ray="Phong" file="refraction.ptx" proc="{name}"/>"#)
            };
            let variable = |name: &str, component: &str| {
                format!(r#"<valueof optixVar="{name}" type="CURRENT" context="LIGHT" id="0" component="{component}"/>"#)
            };
            let buffers = [("pos_buffer", "pos"), ("norm_buffer", "norm"), ("color_buffer", "shaded")]
                .map(|(name, texture)| format!(r#"<buffer var="{name}" texture="L::{texture}"/>"#));
            [
                format!(r#"<pass class="default" name="draw">{scenes}<rendertarget name="buffers" fromLibrary="L"/>{maps}</pass>"#),
                format!(r#"<pass class="optix" name="rays">{scenes}<rendertarget name="target" fromLibrary="L"/>{maps}"#),
                r#"<optixEntryPoint><optixProgram type="RayGen" file="refraction.ptx" proc="buffer_camera"/></optixEntryPoint>"#.to_owned(),
                format!("<optixDefaultMaterial>{}{}</optixDefaultMaterial>", program("Closest_Hit", "closest_hit"), program("Miss", "miss")),
                format!(r#"<optixMaterialMap><optixMap to="pane">{}</optixMap></optixMaterialMap>"#, program("Closest_Hit", "closest_hit_glass")),
                r#"<optixVertexAttributes><attribute name="position"/><attribute name="normal"/><attribute name="texCoord0"/></optixVertexAttributes>"#.to_owned(),
                r#"<optixMaterialAttributes><valueof optixVar="diffuse" type="CURRENT" context="COLOR" component="DIFFUSE"/>
<valueof optixVar="texCount" type="CURRENT" context="TEXTURE" component="COUNT"/></optixMaterialAttributes>"#.to_owned(),
                format!("<optixGlobalAttributes>{}{}</optixGlobalAttributes>", variable("lightDir", "DIRECTION"), variable("lightColor", "COLOR")),
                format!("<optixInput>{}</optixInput></pass>", buffers.concat()),
                r#"<pass class="quad" name="show"><texture name="seen" fromLibrary="L"/></pass>"#.to_owned(),
            ]
            .concat()
        }
    };
    let text = format!(
        r#"<project name="p" width="{SIDE}" height="{SIDE}"><assets><scenes><scene name="S">{scene}</scene></scenes>
<viewports><viewport name="V"><CLEAR_COLOR r="0" g="0" b="0"/></viewport></viewports>
<cameras><camera name="C"><viewport name="V"/><projection TYPE="PERSPECTIVE" FOV="30" NEAR="1" FAR="20"/>
<POSITION x="0" y="0" z="5"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights><light name="Sun" type="directional"><DIRECTION x="0" y="0" z="-1"/><COLOR r="1" g="1" b="1"/></light></lights>
<materialLibs><materialLib filename="l.mlib"/></materialLibs></assets>
<pipelines><pipeline name="p" default="true" defaultCamera="C">{passes}</pipeline></pipelines></project>"#
    );
    let path = folder.join("p.xml");
    std::fs::write(&path, text).expect("written");
    path
}

fn picture(project: Project, raster: RasterChoice) -> Image {
    picture_by(project, Choice { raster, ..Choice::CPU })
}

fn picture_by(project: Project, choice: Choice) -> Image {
    let opened = curitiba::open_project(project, Settings::default(), choice, &mut Silent);
    let mut renderer = opened.unwrap_or_else(|error| panic!("{}", error.joined()));
    renderer.frame(&mut Silent).expect("it renders")
}

fn opened(path: &Path) -> Project {
    load(path).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// The colours at four points a quarter of the picture from its middle, row by row: r, g, b, y, and . for any other.
fn seen(picture: &Image) -> [char; 4] {
    let (near, far) = (SIDE / 2 - SIDE / 8, SIDE / 2 + SIDE / 8);
    [(near, near), (far, near), (near, far), (far, far)].map(|(x, y)| {
        let pixel = picture.pixels[(y * picture.width + x) as usize];
        let bright = [0, 1, 2].map(|channel| pixel[channel] > 0.5);
        let dark = [0, 1, 2].map(|channel| pixel[channel] < 0.1);
        match (bright, dark) {
            ([true, false, false], [_, true, true]) => RED,
            ([false, true, false], [true, _, true]) => GREEN,
            ([false, false, true], [true, true, _]) => BLUE,
            ([true, true, false], [_, _, true]) => YELLOW,
            _ => '.',
        }
    })
}

#[test]
fn primitives_and_scene_files_show_the_texture_of_a_mapped_material_in_the_engines_place() {
    let folder = folder();
    let upright = [RED, GREEN, BLUE, YELLOW];
    // After a quarter turn about x, the former z axis points down.
    let turned = r#"<ROTATE x="1" y="0" z="0" w="90"/>"#;
    let cases = [
        (r#"<file name="square.obj"/>"#.to_owned(), upright),
        (r#"<geometry name="g" type="BOX" material="wall"/>"#.to_owned(), upright),
        // The texture's top is at +z on squares and grids.
        (
            format!(r#"<geometry name="g" type="SQUARE" material="wall">{turned}</geometry>"#),
            [BLUE, YELLOW, RED, GREEN],
        ),
        (
            format!(r#"<geometry name="g" type="GRID" divisions="9" length="2" material="wall">{turned}</geometry>"#),
            [BLUE, YELLOW, RED, GREEN],
        ),
        // u starts where the sphere's normal points along +z, and grows towards +x.
        (
            r#"<geometry name="g" type="SPHERE" slices="32" stacks="32" material="wall"/>"#.to_owned(),
            [GREEN, RED, YELLOW, BLUE],
        ),
    ];
    let rasters: &[RasterChoice] =
        if has_driver() { &[RasterChoice::Cpu, RasterChoice::Wgpu] } else { &[RasterChoice::Cpu] };
    for (scene, expected) in cases {
        for raster in rasters {
            let drawn = picture(opened(&project(folder.path(), &scene, "quarters", By::Raster)), *raster);
            assert_eq!(seen(&drawn), expected, "{scene}, {raster:?}");
        }
        let traced = picture(opened(&project(folder.path(), &scene, "quarters", By::Rays)), RasterChoice::Cpu);
        assert_eq!(seen(&traced), expected, "{scene}, rays");
    }
}

/// Whether rays of a backend read the texture behind a pane of glass.
fn reads_behind_glass(backend: BackendChoice) {
    let folder = folder();
    for (geometry, expected) in [
        (r#"<geometry name="g" type="BOX" material="wall"/>"#, [RED, GREEN, BLUE, YELLOW]),
        (r#"<geometry name="g" type="SPHERE" slices="32" stacks="32" material="wall"/>"#, [GREEN, RED, YELLOW, BLUE]),
    ] {
        let scene = format!(r#"{geometry}<file name="pane.obj"/>"#);
        let shown = |material: &str, by: By| {
            let project = opened(&project(folder.path(), &scene, material, by));
            seen(&picture_by(project, Choice::CPU.traced_by(backend)))
        };
        assert_eq!(shown("quarters", By::Glass), expected, "{geometry}, {backend:?}");
        assert_eq!(shown("second", By::Glass), [YELLOW; 4], "{geometry}, {backend:?}");
        assert_eq!(shown("quarters", By::Raster), ['.'; 4], "the pane is before it");
    }
}

#[test]
fn rays_behind_glass_read_the_texture_of_a_mapped_material() {
    reads_behind_glass(BackendChoice::Cpu);
}

#[test]
fn rays_on_nvidia_gpus_read_the_texture_of_a_mapped_material() {
    for backend in [BackendChoice::Cuda, BackendChoice::Optix] {
        if crate::nvidia::there(Choice::CPU.traced_by(backend)).is_some() {
            reads_behind_glass(backend);
        }
    }
}

/// The engine numbers columns along x and rows along z, and divides by one more than their number.
#[test]
fn a_grid_shows_less_than_the_whole_texture() {
    for divisions in [1, 4] {
        let grid = ShapeKind::Grid { divisions, length: 2.0 }.mesh().expect("it has a mesh");
        let part = divisions as f32 / (divisions as f32 + 1.0);
        for (position, texcoord) in grid.positions.iter().zip(&grid.texcoords) {
            let expected = [position.x + 1.0, position.z + 1.0].map(|along| along / 2.0 * part);
            assert!(
                (texcoord.x - expected[0]).abs() + (texcoord.y - expected[1]).abs() < 1e-6,
                "{position}: {texcoord}"
            );
        }
        assert_eq!(grid.positions.len(), grid.texcoords.len());
    }
}

/// Number of different colours in a picture.
fn colors(picture: &Image) -> usize {
    let bits = picture.pixels.iter().map(|pixel| pixel.map(|channel| (channel * 1e3).round() as i32));
    bits.collect::<std::collections::BTreeSet<_>>().len()
}

#[test]
fn a_magnified_texture_shows_its_nearest_texels_where_a_material_asks_for_them() {
    let folder = folder();
    let square = r#"<file name="square.obj"/>"#.to_owned();
    let behind = format!(r#"{square}<file name="pane.obj"/>"#);
    let wgpu = has_driver().then_some((By::Raster, &square, RasterChoice::Wgpu));
    let cpu = [(By::Raster, &square), (By::Rays, &square), (By::Glass, &behind)];
    for (by, scene, raster) in cpu.map(|(by, scene)| (by, scene, RasterChoice::Cpu)).into_iter().chain(wgpu) {
        let shown = |material: &str| picture(opened(&project(folder.path(), scene, material, by)), raster);
        let (nearest, blended) = (shown("nearest"), shown("few"));
        // The four texels, and the colour around the square.
        assert_eq!(colors(&nearest), 5, "{by:?}, {raster:?}");
        assert_eq!(seen(&nearest), [RED, GREEN, BLUE, YELLOW], "{by:?}, {raster:?}");
        assert!(colors(&blended) > 100, "control: {by:?}, {raster:?}: {} colours", colors(&blended));
    }
}

#[test]
fn a_written_project_shows_the_same_texture() {
    let folder = folder();
    let scene = r#"<geometry name="g" type="BOX" material="wall"/>"#;
    let cases = [("drawn", "quarters", By::Raster), ("traced", "quarters", By::Rays), ("near", "nearest", By::Raster)];
    for (name, material, by) in cases {
        let first = opened(&project(folder.path(), scene, material, by));
        let path = folder.path().join(format!("{name}.xml"));
        first.write(&path).expect("written");
        let (first, again) = (picture(first, RasterChoice::Cpu), picture(opened(&path), RasterChoice::Cpu));
        assert_eq!(first, again);
        assert_eq!(seen(&first)[0], RED);
    }
}

#[test]
fn a_texture_that_is_not_read_is_a_warning_and_the_diffuse_colour_serves() {
    let folder = folder();
    let scene = r#"<geometry name="g" type="BOX" material="wall"/>"#;
    for (material, warned) in [("lost", Some("lost.png")), ("second", Some("`second`")), ("quarters", None)] {
        let project = opened(&project(folder.path(), scene, material, By::Raster));
        let warnings: Vec<String> = project.problems.0.iter().map(ToString::to_string).collect();
        assert_eq!(warnings.len(), usize::from(warned.is_some()), "{warnings:?}");
        if let Some(warned) = warned {
            assert!(warnings[0].contains(warned), "{warnings:?}");
            assert_eq!(seen(&picture(project, RasterChoice::Cpu)), [YELLOW; 4]);
        }
    }
    // A file that is not an image is detected when it is decoded.
    std::fs::write(folder.path().join("images/lost.png"), "none").expect("written");
    let project = opened(&project(folder.path(), scene, "lost", By::Raster));
    assert!(project.problems.0.is_empty(), "{:?}", project.problems);
    let mut renderer =
        curitiba::open_project(project, Settings::default(), Choice::CPU, &mut Silent).expect("it opens");
    let warnings: Vec<String> = renderer.warnings().groups().iter().map(ToString::to_string).collect();
    assert!(
        matches!(&warnings[..], [one] if one.contains("lost.png") && one.contains("the diffuse colour serves")),
        "{warnings:?}"
    );
    assert_eq!(seen(&renderer.frame(&mut Silent).expect("it renders")), [YELLOW; 4]);
}
