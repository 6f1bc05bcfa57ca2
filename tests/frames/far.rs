//! Scenes in map coordinates show the picture of the same scene at the origin, bit for bit where the file's numbers
//! allow it.

use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project::{Effects, Project, SceneOptions};
use curitiba::{BackendChoice, Choice, RasterChoice};
use glam::DVec3;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Displacements of the scene. All the scene's numbers are multiples of 2^-10, so that the displaced numbers are exact.
const MOVED: [DVec3; 4] =
    [DVec3::new(1e3, 0.0, 0.0), DVec3::new(-1e4, 0.0, 2e4), DVec3::new(1e5, 1e5, -1e5), DVec3::new(1e6, 0.0, 5e6)];

fn steps(value: f64) -> f64 {
    (value * 1024.0).round() / 1024.0
}

/// Triangles with their material.
type Parts = Vec<(&'static str, Vec<[usize; 3]>)>;

/// A bumpy body three units in size above a floor, with a pane of glass beside it.
fn corners() -> (Vec<DVec3>, Parts) {
    let (rings, sides) = (24, 48);
    let mut points = Vec::new();
    let mut body = Vec::new();
    for ring in 0..=rings {
        for side in 0..sides {
            let (up, around) = (PI * f64::from(ring) / f64::from(rings), 2.0 * PI * f64::from(side) / f64::from(sides));
            let radius = 1.1 + 0.2 * (5.0 * up).sin() * (7.0 * around).cos();
            let point = DVec3::new(up.sin() * around.cos(), up.cos(), up.sin() * around.sin()) * radius;
            points.push(point.map(steps));
        }
    }
    let at = |ring: i32, side: i32| (ring * sides + side % sides) as usize;
    for ring in 0..rings {
        for side in 0..sides {
            body.push([at(ring, side), at(ring + 1, side), at(ring + 1, side + 1)]);
            body.push([at(ring, side), at(ring + 1, side + 1), at(ring, side + 1)]);
        }
    }
    let mut quad = |quad: [[f64; 3]; 4]| {
        let first = points.len();
        points.extend(quad.map(DVec3::from));
        vec![[first, first + 1, first + 2], [first, first + 2, first + 3]]
    };
    let floor = quad([[-1.5, -1.25, -1.5], [-1.5, -1.25, 1.5], [1.5, -1.25, 1.5], [1.5, -1.25, -1.5]]);
    let pane = quad([[-1.5, -1.25, 1.25], [0.0, -1.25, 1.5], [0.0, 1.0, 1.5], [-1.5, 1.0, 1.25]]);
    (points, vec![("stone", body), ("stone", floor), ("glass", pane)])
}

/// Writes the displaced scene, and returns the file's path.
fn obj(folder: &Path, moved: DVec3) -> PathBuf {
    let (points, parts) = corners();
    let mut text = String::from("mtllib far.mtl\n");
    for point in points {
        let DVec3 { x, y, z } = point + moved;
        writeln!(text, "v {x} {y} {z}").expect("a string");
    }
    for (number, (material, triangles)) in parts.into_iter().enumerate() {
        writeln!(text, "o part{number}\nusemtl {material}").expect("a string");
        for [a, b, c] in triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("a string");
        }
    }
    let file = folder.join(format!("far{}_{}.obj", moved.x, moved.z));
    std::fs::write(folder.join("far.mtl"), "newmtl stone\nKd 0.7 0.6 0.5\nnewmtl glass\nillum 4\nd 0.1\nKd 1 1 1\n")
        .expect("the folder is ours");
    std::fs::write(&file, text).expect("the folder is ours");
    file
}

/// Writes the parts of stone as a COLLADA file, which has no glass. They are displaced by positions and by the node.
fn collada(folder: &Path, [by_positions, by_node]: [DVec3; 2]) -> PathBuf {
    let (points, parts) = corners();
    let (mut positions, mut primitives, count) = (String::new(), String::new(), points.len());
    for point in points {
        let DVec3 { x, y, z } = point + by_positions;
        write!(positions, "{x} {y} {z} ").expect("a string");
    }
    for (_, triangles) in parts.iter().filter(|(material, _)| *material == "stone") {
        let corners: Vec<String> = triangles.iter().flatten().map(ToString::to_string).collect();
        let vertices = r##"<input semantic="VERTEX" source="#v" offset="0"/>"##;
        write!(primitives, r#"<triangles material="stone">{vertices}<p>{}</p></triangles>"#, corners.join(" "))
            .expect("a string");
    }
    let DVec3 { x, y, z } = by_node;
    let text = format!(
        r##"<COLLADA version="1.4.1"><library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert>
<diffuse><color>0.7 0.6 0.5 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="stone" name="stone"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="{}">{positions}</float_array>
<technique_common><accessor source="#pa" count="{count}" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{primitives}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>{x} {y} {z}</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##,
        3 * count
    );
    let file = folder.join(format!("far{}_{}.dae", by_positions.x, by_node.x));
    std::fs::write(&file, text).expect("the folder is ours");
    file
}

/// The project of a displaced scene, and its settings.
fn opened(file: &Path, moved: DVec3, size: u32, backend: BackendChoice, fidelity: Fidelity) -> (Project, Settings) {
    let scene = SceneOptions {
        // Software drivers need minutes for kernels with glass.
        effects: Some(Effects { shadows: true, occlusion: true, glass: backend != BackendChoice::Wgpu }),
        look_from: Some(DVec3::new(-2.5, 1.75, 3.5) + moved),
        look_at: Some(DVec3::new(0.125, -0.25, 0.0) + moved),
        ..SceneOptions::default()
    };
    let set = vec!["pass2.samples=4".to_owned()];
    let settings = Settings { size: Some([size; 2]), scene, fidelity, set, ..Settings::default() };
    (settings.open(file).expect("it opens"), settings)
}

fn renderer(file: &Path, moved: DVec3, size: u32, choice: Choice, fidelity: Fidelity) -> Renderer {
    let (project, settings) = opened(file, moved, size, choice.backend, fidelity);
    curitiba::open_project(project, settings, choice, &mut Silent).expect("it is built")
}

fn bits(renderer: &mut Renderer) -> Vec<[u32; 4]> {
    let image = renderer.frame(&mut Silent).expect("it renders");
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn picture(file: &Path, moved: DVec3) -> Vec<[u32; 4]> {
    bits(&mut renderer(file, moved, 96, cpu(), Fidelity::Corrected))
}

fn cpu() -> Choice {
    Choice { raster: RasterChoice::Cpu, backend: BackendChoice::Cpu, ..Choice::default() }
}

#[test]
fn the_picture_far_away_is_that_at_the_origin() {
    let folder = tempfile::tempdir().expect("a folder");
    let near = picture(&obj(folder.path(), DVec3::ZERO), DVec3::ZERO);
    for moved in MOVED {
        let far = picture(&obj(folder.path(), moved), moved);
        let differ = near.iter().zip(&far).filter(|(near, far)| near != far).count();
        assert_eq!(differ, 0, "{moved}");
    }
}

#[test]
fn a_collada_file_far_away_shows_what_it_shows_at_the_origin() {
    let folder = tempfile::tempdir().expect("a folder");
    let near = picture(&collada(folder.path(), [DVec3::ZERO; 2]), DVec3::ZERO);
    let mut colors = near.clone();
    colors.sort_unstable();
    colors.dedup();
    assert!(colors.len() > 100, "the scene is in the picture");
    let moved = MOVED[3];
    for by in [[moved, DVec3::ZERO], [DVec3::ZERO, moved], [MOVED[2], moved - MOVED[2]]] {
        let far = picture(&collada(folder.path(), by), moved);
        let differ = near.iter().zip(&far).filter(|(near, far)| near != far).count();
        assert_eq!(differ, 0, "{by:?}");
    }
}

/// The ray backends of NVIDIA GPUs, each compared with itself.
#[test]
fn rays_on_nvidia_gpus_show_far_away_what_they_show_at_the_origin() {
    for backend in [BackendChoice::Cuda, BackendChoice::Optix] {
        let choice = cpu().traced_by(backend);
        if crate::nvidia::there(choice).is_none() {
            continue;
        }
        let folder = tempfile::tempdir().expect("a folder");
        let shown =
            |moved: DVec3| bits(&mut renderer(&obj(folder.path(), moved), moved, 96, choice, Fidelity::Corrected));
        let near = shown(DVec3::ZERO);
        for moved in MOVED {
            let far = shown(moved);
            let differ = near.iter().zip(&far).filter(|(near, far)| near != far).count();
            assert_eq!(differ, 0, "{backend:?} {moved}");
        }
    }
}

/// Rays and rasteriser of `wgpu` are compared with themselves: a driver may fuse multiplications and additions, so the near
/// picture is drawn on the device as well.
#[test]
fn wgpu_shows_far_away_what_it_shows_at_the_origin() {
    let choice = Choice { raster: RasterChoice::Wgpu, backend: BackendChoice::Wgpu, ..Choice::default() };
    if let Err(error) = WgpuRasteriser::new(AdapterChoice::Any) {
        assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
        println!("skipped: {error}");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let near = obj(folder.path(), DVec3::ZERO);
    let mut renderer = renderer(&near, DVec3::ZERO, 32, choice, Fidelity::Corrected);
    let near = bits(&mut renderer);
    let moved = MOVED[3];
    let (project, settings) = opened(&obj(folder.path(), moved), moved, 32, choice.backend, Fidelity::Corrected);
    // The same device is used again, because its kernels are already compiled.
    let plan = Plan::new(project, settings).expect("a plan");
    let mut far = Renderer::new(plan, renderer.into_engines(), &mut Silent).expect("it is built");
    assert!(near == bits(&mut far), "{moved}");
}

#[test]
fn thesis_fidelity_knows_no_other_origin() {
    let folder = tempfile::tempdir().expect("a folder");
    let moved = MOVED[1];
    let file = obj(folder.path(), moved);
    let origins = |fidelity| {
        let renderer = renderer(&file, moved, 16, cpu(), fidelity);
        let origins: Vec<DVec3> = renderer.scenes().map(|scene| scene.origin).collect();
        let told = renderer.decisions().iter().any(|decision| decision.what == "origin near the scene");
        (origins, told, renderer.plan().origin)
    };
    assert_eq!(origins(Fidelity::Thesis), (vec![DVec3::ZERO], false, DVec3::ZERO));
    assert_eq!(origins(Fidelity::Corrected), (vec![moved], true, moved));
}

/// A camera set later is relative to the same origin.
#[test]
fn a_camera_that_is_moved_in_a_far_scene_sees_what_it_sees_near() {
    let folder = tempfile::tempdir().expect("a folder");
    let moved = MOVED[2];
    let turned = |moved: DVec3| {
        let mut renderer = renderer(&obj(folder.path(), moved), moved, 64, cpu(), Fidelity::Corrected);
        renderer.frame(&mut Silent).expect("it renders");
        let mut pose = renderer.project().pose("Camera").expect("the camera");
        pose.position = (DVec3::new(1.5, 1.0, 3.0) + moved).as_vec3();
        pose.direction = glam::Vec3::new(-0.4, -0.3, -0.9);
        renderer.set_pose("Camera", pose).expect("a camera");
        renderer.frame(&mut Silent).expect("it renders").pixels
    };
    assert_eq!(turned(DVec3::ZERO), turned(moved));
}
