//! Scenes with a sky, and scenes with glass whose transmission has a texture, with and without interpolation between texels. Also passes
//! over two scenes.

use super::conformance::record_of;
use super::lamps::add_lamps;
use super::{file, loaded, project, there};
use curitiba::conformance::Found;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayCounts, RayJob, RayStats};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent};
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba::pipeline::project::{self, MaterialPattern, Project, SceneOptions, SceneProjects};
use curitiba::pipeline::scene::RenderScene;
use curitiba::{BackendChoice, Choice};
use glam::{DVec3, Vec3};
use std::path::Path;
use std::sync::{Arc, Mutex};

/// A floor with a wall on it, in a box that is declared a sky.
fn under_a_sky(folder: &Path) -> Project {
    let mut text =
        "mtllib s.mtl\no floor\nusemtl stone\nv -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4\nf 4 3 2 1\n".to_owned();
    text += "o wall\nusemtl brick\nv -2 0 0\nv 2 0 0\nv 2 2 0\nv -2 2 0\nf 5 6 7 8\no box\nusemtl sky\n";
    for corner in 0..8 {
        let at = |axis: u32| if corner >> axis & 1 == 0 { -20 } else { 20 };
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    text += "f 9 10 12 11\nf 13 15 16 14\nf 9 13 14 10\nf 11 12 16 15\nf 9 11 15 13\nf 10 14 16 12\n";
    std::fs::write(folder.join("s.obj"), text).expect("a file");
    std::fs::write(folder.join("s.mtl"), "newmtl stone\nnewmtl brick\nnewmtl sky\nKd 0.2 0.5 0.9\n").expect("a file");
    made(folder, "s.obj", "shadows,ao")
}

/// A pane and a cube of glass under a dome with a picture and an emissive cloud.
fn glass_under_a_sky(folder: &Path) -> Project {
    let (mut text, mut vertices) = ("mtllib g.mtl\n".to_owned(), 0);
    let mut add = |name: &str, corners: &[[f32; 3]], faces: &[[usize; 4]]| {
        text += &format!("o {name}\nusemtl {name}\n");
        for [x, y, z] in corners {
            text += &format!("v {x} {y} {z}\nvt {} {}\n", 0.07 * x + 0.3 * y, 0.05 * z - 0.2 * y);
        }
        for face in faces {
            let corners = face.map(|corner| format!("{0}/{0}", vertices + corner + 1));
            text += &format!("f {}\n", corners.join(" "));
        }
        vertices += corners.len();
    };
    let corners = |low: [f32; 3], high: [f32; 3]| -> Vec<[f32; 3]> {
        let at = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        (0..8).map(|corner| [0, 1, 2].map(|axis| at(corner, axis))).collect()
    };
    let outwards = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let inwards = outwards.map(|[a, b, c, d]| [d, c, b, a]);
    add("dome", &corners([-30.0, -25.0, -28.0], [31.0, 40.0, 29.0]), &inwards);
    add("stone", &corners([-4.0, -0.3, -4.0], [4.0, 0.0, 4.0]), &outwards);
    add("pane", &[[-2.0, 0.1, -1.0], [0.5, 0.1, -1.3], [0.5, 2.2, -1.3], [-2.0, 2.2, -1.0]], &[[0, 1, 2, 3]]);
    add("cube", &corners([0.3, 0.2, -0.6], [1.4, 1.3, 0.5]), &outwards);
    // At equal distances the wall is seen, and not the cloud.
    add("cloud", &corners([-3.0, 0.0, -3.0], [-2.4, 1.5, 1.0]), &outwards);
    add("wall", &corners([-3.0, 0.0, -3.0], [-2.4, 1.5, 1.0]), &outwards);
    add("cloud", &corners([-9.0, 9.0, -12.0], [3.0, 9.5, 14.0]), &outwards);
    std::fs::write(folder.join("g.obj"), text).expect("a file");
    let texel = |i: u32| [i * 37, i * 23, i * 11, 63].map(|code| (code % 64) as f32 / 63.0);
    let image = Image { width: 8, height: 8, pixels: (0..64).map(texel).collect() };
    write_png(&folder.join("g.png"), &image).expect("a file");
    let glass = "Kd 1 1 1\nd 0.2\nNi 1.5\nillum 7\n";
    let materials = format!(
        "newmtl dome\nKd 1 1 1\nmap_Kd g.png\nnewmtl stone\nKd 0.6 0.6 0.5\nnewmtl pane\n{glass}newmtl cube\n{glass}\
         newmtl cloud\nKd 0 0 0\nKe 0.9 0.7 0.4\nnewmtl wall\nKd 0.8 0.2 0.1\n"
    );
    std::fs::write(folder.join("g.mtl"), materials).expect("a file");
    let mut project = made(folder, "g.obj", "shadows,glass");
    // The camera is turned to the glass; by default it looks at the centre of the scene, between floor and cloud.
    let camera = project.cameras.iter_mut().find(|camera| camera.name == "Camera").expect("the one in use");
    camera.direction = Vec3::new(-1.7, -0.4, -3.5).normalize();
    project.scenes[0].sky = ["dome", "cloud"].map(|name| MaterialPattern::Named(name.to_owned())).to_vec();
    project
}

/// A pane before a wall; two of the four texels of the pane's transmission are 0. `filter` is glTF's `magFilter` for the textures of both.
fn mapped(folder: &Path, filter: u32) -> Project {
    let corners = [[-1.0_f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions = corners.iter().flat_map(|[x, y]| [*x, *y, 0.0]);
    let coordinates = corners.iter().flatten().map(|at| 0.5 + 0.5 * at);
    let mut bytes: Vec<u8> = positions.chain(coordinates).flat_map(f32::to_le_bytes).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].into_iter().flat_map(u16::to_le_bytes));
    std::fs::write(folder.join("m.bin"), bytes).expect("a file");
    let texels = [1.0, 0.0, 0.0, 0.6].map(|clear| [clear, 0.3, 0.9, 1.0]).to_vec();
    write_png(&folder.join("m.png"), &Image { width: 2, height: 2, pixels: texels }).expect("a file");
    let text = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0,1]}],"extensionsUsed":["KHR_materials_transmission"],
"nodes":[{"mesh":0},{"mesh":1,"translation":[0.3,0.2,-1],"scale":[2,2,1]}],
"samplers":[{"magFilter":FILTER}],"images":[{"uri":"m.png"}],"textures":[{"source":0,"sampler":0}],
"materials":[{"name":"pane","doubleSided":true,"pbrMetallicRoughness":{"roughnessFactor":0},"extensions":{"KHR_materials_transmission":{"transmissionFactor":0.9,"transmissionTexture":{"index":0}}}},
{"name":"wall","doubleSided":true,"pbrMetallicRoughness":{"baseColorFactor":[0.8,0.2,0.1,1],"baseColorTexture":{"index":0}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"material":0}]},
{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"material":1}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-1,-1,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":12}],
"buffers":[{"uri":"m.bin","byteLength":92}]}"#;
    let file = format!("m{filter}.gltf");
    std::fs::write(folder.join(&file), text.replace("FILTER", &filter.to_string())).expect("a file");
    made(folder, &file, "shadows,glass")
}

fn made(folder: &Path, file: &str, effects: &str) -> Project {
    let from = Some(DVec3::new(1.5, 1.2, 3.5));
    let options = SceneOptions { effects: effects.parse().ok(), look_from: from, ..SceneOptions::default() };
    SceneProjects::new(&[folder.join(file)], &options, None, 1 << 28).expect("a scene").project()
}

fn agrees(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let (folder, found) = (tempfile::tempdir().expect("a folder"), Arc::new(Mutex::new(Found::default())));
    let skies = under_a_sky(folder.path());
    assert_eq!(skies.scenes[0].sky.len(), 1);
    let [blended, nearest] = [9729, 9728].map(|filter| mapped(folder.path(), filter));
    let zero = &["pass2.texturelod=zero"][..];
    for (name, project, set) in [
        ("sky", skies, &[][..]),
        ("mapped", blended, &[]),
        ("nearest", nearest.clone(), &[]),
        ("nearest", nearest, zero),
    ] {
        let set = set.iter().map(|one: &&str| (*one).to_owned()).collect();
        record_of(project, backend, name, "Camera", (Fidelity::Corrected, set), None, &found);
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 4, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        assert!(record.rays.shadow > 1000, "{words}");
    }
}

#[test]
fn skies_and_textures_of_transmission_on_our_own_tracer_are_the_processors() {
    agrees(BackendChoice::Cuda);
}

#[test]
fn skies_and_textures_of_transmission_on_optix_are_the_processors() {
    agrees(BackendChoice::Optix);
}

/// Mirrors and glass that see a sky: a dome and clouds around bodies of glass. Also the stone of the square's fronts, with one light, several
/// lights and discs.
fn glass_shows_skies(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let (folder, found) = (tempfile::tempdir().expect("a folder"), Arc::new(Mutex::new(Found::default())));
    let words = |set: &[&str]| set.iter().map(|one| (*one).to_owned()).collect::<Vec<_>>();
    for set in [&[][..], &["pass2.samples=9", "pass2.sun=4", "pass2.sunsamples=4"]] {
        record_of(
            glass_under_a_sky(folder.path()),
            backend,
            "glass",
            "Camera",
            (Fidelity::Corrected, words(set)),
            None,
            &found,
        );
    }
    for (name, set) in [
        ("SceneReflect", &[][..]),
        ("SceneRefract", &[]),
        ("SceneFinal", &["pass2.samples=25"]),
        ("SceneFinal", &["pass2.samples=2", "pass2.sun=4", "pass2.sunsamples=4"]),
    ] {
        for (camera, among_lamps) in [("MainCamera", false), ("Vidro", false), ("Vidro", true)] {
            let mut square = project::load(&project(name)).expect("the project loads");
            square.scenes[0].sky = vec![MaterialPattern::Named("Cantaria".to_owned())];
            if among_lamps {
                add_lamps(&mut square, camera);
            }
            record_of(square, backend, name, camera, (Fidelity::Corrected, words(set)), None, &found);
        }
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 2 + 4 * 3, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        // The main view of the square has 655 pixels of glass, of 65,536.
        let least = if record.camera.as_deref() == Some("MainCamera") { 600 } else { 10_000 };
        assert!(record.rays.reflected + record.rays.refracted > least, "little mirrors or refracts: {words}");
        if record.backend == "cuda" {
            let cpu = record.cpu_rays.expect("the processor ran");
            let glass = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
            assert_eq!(glass(record.rays), glass(cpu), "{words}");
        }
    }
}

#[test]
fn mirrors_and_glass_on_our_own_tracer_show_skies_as_the_processors_do() {
    glass_shows_skies(BackendChoice::Cuda);
}

#[test]
fn mirrors_and_glass_on_optix_show_skies_as_the_processors_do() {
    glass_shows_skies(BackendChoice::Optix);
}

/// A camera in a tinted body among emitters; `tests/oracle/bodies.py` wrote the scene.
fn in_a_body(effects: &str) -> Project {
    let options = SceneOptions {
        effects: effects.parse().ok(),
        look_from: Some(DVec3::new(0.2, 0.3, 1.3)),
        look_at: Some(DVec3::new(0.0, 0.0, -0.4)),
        fov: Some(62.0),
        sun: Some(Vec3::new(0.3, 1.0, 0.5)),
        ..SceneOptions::default()
    };
    SceneProjects::new(&[file("tests/oracle/body_inside.gltf")], &options, None, 1 << 28).expect("a scene").project()
}

/// What the camera sees directly and through the faces of the body around it, by `refraction` and by all kernels of `final`.
fn a_body_around_the_camera(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let passes = [
        ("glass", &[][..]),
        ("shadows,glass", &["pass2.shadow=straight"][..]),
        ("shadows,glass", &["pass2.shadow=opaque"]),
        ("shadows,ao,glass", &["pass2.samples=9"]),
        ("shadows,glass", &["pass2.sun=4", "pass2.sunsamples=4"]),
    ];
    for (effects, set) in passes {
        let set = set.iter().map(|one| (*one).to_owned()).collect();
        record_of(in_a_body(effects), backend, effects, "Camera", (Fidelity::Corrected, set), None, &found);
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), passes.len(), "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        assert!(record.rays.refracted > 10_000, "few pixels show the body: {words}");
    }
}

#[test]
fn the_body_around_the_camera_absorbs_on_our_own_tracer_as_on_the_processor() {
    a_body_around_the_camera(BackendChoice::Cuda);
}

#[test]
fn the_body_around_the_camera_absorbs_on_optix_as_on_the_processor() {
    a_body_around_the_camera(BackendChoice::Optix);
}

/// A backend that runs each job twice, and between the runs a job over another scene that traces no ray.
struct Interrupted(Box<dyn RayBackend>);

impl RayBackend for Interrupted {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn device(&self) -> String {
        self.0.device()
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.0.supports(program, fidelity)
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.0.build(scene, filtered)
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.0.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.0.run(job, output, progress)?;
        let first = output.pixels.clone();
        let other = job.scene.clone();
        let still = RayJob { scene: &other, params: RayParams { samples: 0, ..job.params }, ..*job };
        self.0.run(&still, output, progress)?;
        assert!(output.pixels.iter().all(|pixel| *pixel == [1.0; 4]), "nothing occludes without rays");
        let stats = self.0.run(job, output, progress)?;
        assert!(output.pixels == first, "another picture than before");
        Ok(stats)
    }
}

fn keeps_its_structure(backend: BackendChoice) {
    let Some(rays) = there(Choice::CPU.traced_by(backend)) else { return };
    let settings = Settings { size: Some([96, 64]), set: vec!["pass2.samples=9".to_owned()], ..Settings::default() };
    let plan = Plan::new(loaded("SceneSSAO"), settings).expect("the plan stands");
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(Interrupted(rays)));
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("ready");
    renderer.frame(&mut Silent).expect("rendered");
    let rays = renderer.timeline().rows.iter().find_map(|row| row.rays).expect("rays were traced");
    assert!(rays.occlusion + rays.certain > 1000, "{rays:?}");
}

/// Runs on any machine: GPUs are asked for the same.
#[test]
fn a_pass_without_rays_over_another_scene_leaves_the_structure_on_the_processor() {
    keeps_its_structure(BackendChoice::Cpu);
}

#[test]
fn a_pass_without_rays_over_another_scene_leaves_the_structure_on_our_own_tracer() {
    keeps_its_structure(BackendChoice::Cuda);
}

#[test]
fn a_pass_without_rays_over_another_scene_leaves_the_structure_on_optix() {
    keeps_its_structure(BackendChoice::Optix);
}
