//! Lines that passes draw beside triangles: the edges of cameras' view volumes, and coordinate axes, on the processor and on a device.
//!
//! Pictures of the device need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one the tests print `skipped`,
//! or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::clears::shadows;
use crate::own_shaders::has_driver;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project::{self, Pose};
use curitiba::{Choice, RasterChoice};
use glam::{DVec3, Vec2, Vec3};
use tempfile::TempDir;

const SIZE: [u32; 2] = [160, 120];
const BLACK: [f32; 3] = [0.0; 3];
const RED: [f32; 3] = [1.0, 0.0, 0.0];
const GREEN: [f32; 3] = [0.0, 1.0, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

/// A project whose pass `draw` draws these scenes from the camera `Main`; the passes of `more` follow. `Ball` is a ball of radius 0.5 on a floor.
fn files(scenes: &[&str], window: bool, more: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let [width, height] = SIZE;
    let target = if window { "" } else { r#"<renderTarget name="buffers" fromLibrary="L"/>"# };
    let scenes: String = scenes.iter().map(|scene| format!(r#"<scene name="{scene}"/>"#)).collect();
    let library = format!(
        r#"<materialLib name="L"><renderTargets>
<renderTarget name="buffers"><SIZE width="{width}" height="{height}"/><colors><color name="shaded" internalFormat="RGBA32F"/>
<color name="place" internalFormat="RGBA32F"/><color name="side" internalFormat="RGBA32F"/></colors></renderTarget>
<renderTarget name="rays"><SIZE width="{width}" height="{height}"/><colors><color name="share" internalFormat="RGBA32F"/></colors></renderTarget>
</renderTargets></materialLib>"#
    );
    let project = format!(
        r#"<project name="p" width="{width}" height="{height}"><assets>
<scenes><scene name="Ball"><geometry name="ball" type="SPHERE" slices="24" stacks="16"><SCALE x="0.5" y="0.5" z="0.5"/></geometry>
<geometry name="floor" type="BOX"><SCALE x="3" y="0.1" z="3"/><TRANSLATE x="0" y="-1" z="0"/></geometry></scene>
<scene name="Axes"><TRANSLATE x="-2" y="0" z="0"/><geometry name="axes" type="AXIS"><ROTATE x="0" y="0" z="1" w="90"/></geometry></scene></scenes>
<cameras><camera name="Main"><projection TYPE="PERSPECTIVE" FOV="50" NEAR="1" FAR="40"/>
<POSITION x="4" y="3" z="6"/><VIEW x="-4" y="-3" z="-6"/><UP x="0" y="1" z="0"/></camera>
<camera name="Seen"><projection TYPE="PERSPECTIVE" FOV="60" NEAR="0.5" FAR="2.5"/>
<POSITION x="0" y="0.5" z="1.5"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera>
<camera name="Flat"><projection TYPE="ORTHO" LEFT="-1" RIGHT="1" BOTTOM="-0.8" TOP="0.8" NEAR="1" FAR="3"/>
<POSITION x="0" y="0.5" z="2"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights><light name="Sun" type="directional"><DIRECTION x="0.4" y="-1" z="-0.3"/><COLOR r="0.7" g="0.7" b="0.7"/></light></lights>
<materialLibs><materialLib filename="l.mlib"/></materialLibs></assets>
<pipelines><pipeline name="p" default="true" defaultCamera="Main">
<pass class="default" name="draw"><scenes>{scenes}</scenes>{target}<lights><light name="Sun"/></lights></pass>{more}
</pipeline></pipelines></project>"#
    );
    for (name, text) in [("l.mlib", library), ("p.xml", project)] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

fn open(files: &TempDir, raster: RasterChoice) -> Renderer {
    let opened =
        curitiba::open(files.path().join("p.xml"), Settings::default(), Choice { raster, ..Choice::CPU }, &mut Silent);
    opened.unwrap_or_else(|error| panic!("{}", error.joined()))
}

fn picture(files: &TempDir, raster: RasterChoice) -> Image {
    open(files, raster).frame(&mut Silent).expect("it renders")
}

fn rasterisers() -> Vec<RasterChoice> {
    if has_driver() { vec![RasterChoice::Cpu, RasterChoice::Wgpu] } else { vec![RasterChoice::Cpu] }
}

/// The position of a point in the picture of `Main`, in pixels from the upper left corner.
fn place(point: Vec3) -> Vec2 {
    let eye = DVec3::new(4.0, 3.0, 6.0);
    let forward = -eye.normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let from_eye = point.as_dvec3() - eye;
    let half = 25_f64.to_radians().tan() * from_eye.dot(forward);
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let (x, y) = (from_eye.dot(right) / (half * aspect), from_eye.dot(up) / half);
    Vec2::new((0.5 + 0.5 * x as f32) * SIZE[0] as f32, (0.5 - 0.5 * y as f32) * SIZE[1] as f32)
}

/// Asserts that every column, or every row where the line is steeper, has a pixel of the line's colour at most half a pixel from it.
#[track_caller]
fn assert_line(picture: &Image, [from, to]: [[f32; 3]; 2], color: [f32; 3]) {
    let [from, to] = [from, to].map(|end| place(Vec3::from(end)));
    let along = to - from;
    let (main, other) = if along.x.abs() >= along.y.abs() { (0, 1) } else { (1, 0) };
    let (low, high) = (from[main].min(to[main]), from[main].max(to[main]));
    assert!(high - low > 8.0, "a line from {from} to {to} tells little");
    let (mut asked, mut found) = (0, 0);
    for step in low.ceil() as u32 + 2..high.floor() as u32 - 2 {
        let share = (step as f32 + 0.5 - from[main]) / along[main];
        let across = (from[other] + along[other] * share).floor() as u32;
        let [x, y] = if main == 0 { [step, across] } else { [across, step] };
        asked += 1;
        found += u32::from(rgb(&picture.pixels[(y * SIZE[0] + x) as usize]) == color);
    }
    // Where the line passes midway between two centres, either may be its pixel.
    assert!(found + 2 >= asked, "{found} of {asked} pixels between {from} and {to}");
}

/// A pixel without its alpha.
fn rgb([r, g, b, _]: &[f32; 4]) -> [f32; 3] {
    [*r, *g, *b]
}

fn is_line(pixel: &[f32; 4]) -> bool {
    [RED, GREEN].contains(&rgb(pixel))
}

fn of_color(picture: &Image, color: [f32; 3]) -> usize {
    picture.pixels.iter().filter(|pixel| rgb(pixel) == color).count()
}

#[test]
fn cameras_among_scenes_show_the_edges_of_what_they_see() {
    // Half the height is the tangent of 30 degrees times the distance, and the window's aspect is 4 to 3.
    let (high, wide) = (30_f32.to_radians().tan(), 30_f32.to_radians().tan() * 4.0 / 3.0);
    for raster in rasterisers() {
        let found = picture(&files(&["Seen"], true, ""), raster);
        let corner = |x: f32, y: f32, distance: f32| [x * wide * distance, 0.5 + y * high * distance, 1.5 - distance];
        let near = [corner(-1.0, 1.0, 0.5), corner(1.0, 1.0, 0.5), corner(1.0, -1.0, 0.5)];
        let far = [corner(-1.0, 1.0, 2.5), corner(1.0, 1.0, 2.5), corner(1.0, -1.0, 2.5)];
        for (edge, color) in [
            ([near[0], near[1]], RED),
            ([near[1], near[2]], RED),
            ([far[0], far[1]], GREEN),
            ([far[1], far[2]], GREEN),
            ([near[1], far[1]], GREEN),
            ([near[2], far[2]], GREEN),
        ] {
            assert_line(&found, edge, color);
        }
        let lines = of_color(&found, RED) + of_color(&found, GREEN);
        let black = of_color(&found, BLACK);
        assert!(lines + black == found.pixels.len() && (200..800).contains(&lines), "{lines} pixels of lines");

        let flat = picture(&files(&["Flat"], true, ""), raster);
        assert_line(&flat, [[-1.0, 1.3, 1.0], [1.0, 1.3, 1.0]], RED);
        assert_line(&flat, [[1.0, 1.3, -1.0], [1.0, -0.3, -1.0]], GREEN);
        assert_line(&flat, [[1.0, 1.3, 1.0], [1.0, 1.3, -1.0]], GREEN);
    }
}

/// A quarter turn about z takes x to y, and y to -x.
#[test]
fn axes_are_drawn_where_they_are_placed() {
    for raster in rasterisers() {
        let found = picture(&files(&["Axes"], true, ""), raster);
        assert_line(&found, [[-2.0, -1.0, 0.0], [-2.0, -0.1, 0.0]], RED);
        assert_line(&found, [[-2.0, 0.1, 0.0], [-2.0, 1.0, 0.0]], RED);
        assert_line(&found, [[-3.0, 0.0, 0.0], [-2.1, 0.0, 0.0]], GREEN);
        assert_line(&found, [[-2.0, 0.0, 0.1], [-2.0, 0.0, 1.0]], BLUE);
    }
}

#[test]
fn lines_hide_and_are_hidden_by_depth_and_change_no_other_pixel() {
    let mut pictures = Vec::new();
    for raster in rasterisers() {
        let without = picture(&files(&["Ball"], true, ""), raster);
        let with = picture(&files(&["Ball", "Seen"], true, ""), raster);
        let alone = picture(&files(&["Seen"], true, ""), raster);
        let mut counts = [0; 2];
        for ((with, without), alone) in with.pixels.iter().zip(&without.pixels).zip(&alone.pixels) {
            assert!(with == without || with == alone && is_line(alone), "{raster:?}: {with:?} {without:?} {alone:?}");
            counts[usize::from(with == alone)] += usize::from(is_line(alone));
        }
        let [hidden, seen] = counts;
        assert!(hidden > 10 && seen > 100, "{raster:?}: {hidden} pixels of lines are hidden and {seen} seen");
        pictures.push(with);
    }
    if let [cpu, device] = &pictures[..] {
        let off = cpu
            .pixels
            .iter()
            .zip(&device.pixels)
            .filter(|(a, b)| a.iter().zip(b.iter()).any(|(a, b)| (a - b).abs() > 0.01));
        let off = off.count();
        assert!(off < 12, "{off} pixels differ between the rasterisers");
    }
}

/// Rays start only where triangles are, and lines occlude no ray: rays treat pixels with lines as background.
#[test]
fn rays_neither_start_at_lines_nor_meet_them() {
    for raster in rasterisers() {
        let without = picture(&files(&["Ball"], false, &shadows(&["Ball"])), raster);
        let with = picture(&files(&["Ball", "Seen"], false, &shadows(&["Ball"])), raster);
        let drawn = picture(&files(&["Ball", "Seen"], true, ""), raster);
        let background = without.pixels[0];
        let mut lines = 0;
        for ((with, without), drawn) in with.pixels.iter().zip(&without.pixels).zip(&drawn.pixels) {
            let is_line = is_line(drawn);
            assert_eq!(with, if is_line { &background } else { without }, "{raster:?}");
            lines += usize::from(is_line);
        }
        let dark = with.pixels.iter().filter(|pixel| **pixel != background && pixel[0] < 1.0).count();
        assert!(lines > 100 && dark > 20, "{raster:?}: {lines} pixels of lines, {dark} in the shadow");
    }
}

#[test]
fn lines_follow_the_cameras_and_the_window() {
    let files = files(&["Ball", "Seen"], true, "");
    let moved =
        Pose { position: Vec3::new(0.5, 0.7, 1.5), direction: Vec3::new(-0.3, -0.1, -1.0), up: Vec3::Y, fov_y: 0.8 };
    for raster in rasterisers() {
        let mut renderer = open(&files, raster);
        let first = renderer.frame(&mut Silent).expect("it renders");
        renderer.set_pose("Seen", moved).expect("it is moved");
        let second = renderer.update(&mut Silent).expect("it renders");
        assert_ne!(first, second, "{raster:?}");
        let mut fresh = open(&files, raster);
        fresh.set_pose("Seen", moved).expect("it is moved");
        assert_eq!(fresh.frame(&mut Silent).expect("it renders"), second, "{raster:?}");
        renderer.set_size([80, 60]).expect("it is resized");
        fresh.set_size([80, 60]).expect("it is resized");
        let small = renderer.update(&mut Silent).expect("it renders");
        let lines = of_color(&small, RED) + of_color(&small, GREEN);
        let whole = of_color(&second, RED) + of_color(&second, GREEN);
        // The line is half as long, but still a pixel wide.
        assert!((whole / 3..whole * 2 / 3).contains(&lines), "{raster:?}: {lines} beside {whole}");
        assert_eq!(fresh.frame(&mut Silent).expect("it renders"), small, "{raster:?}");
    }
}

#[test]
fn thesis_fidelity_draws_no_lines() {
    let files = files(&["Ball", "Seen"], true, "");
    let declared = project::load(&files.path().join("p.xml")).expect("it loads");
    let sets = |fidelity| {
        let plan = Plan::new(declared.clone(), Settings { fidelity, ..Settings::default() }).expect("it is planned");
        let why = plan.decisions.iter().find(|decision| decision.what.contains("lines")).expect("a decision");
        (plan.scene_sets[0].len(), why.built)
    };
    assert_eq!((sets(Fidelity::Corrected), sets(Fidelity::Thesis)), ((2, true), (1, false)));
}
