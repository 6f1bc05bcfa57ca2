//! The two rasterisers draw the same G-buffers for the seven projects.
//!
//! Needs a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one, the test prints `skipped`, or
//! fails with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use curitiba::Choice;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::backend::{
    Attachments, GBuffer, LoadStore, NO_TRIANGLE, RasterJob, Rasteriser, Shade, Sun, View,
};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::plan::{Settings, Work};
use curitiba::pipeline::scene::RenderScene;
use glam::{Vec3, Vec4};
use std::path::Path;
use std::sync::Arc;

const SIDE: u32 = 512;

/// Least share of pixels that both cover or both leave empty.
const COVERAGE: f64 = 0.9999;

/// Greatest difference of positions relative to the distance from the eye, where both show the same triangle.
const POSITION: f32 = 1e-4;

/// Greatest share of those pixels whose positions may differ by more: at grazing angles, and where only a snapped triangle covers a pixel.
/// On lavapipe 22.3.6, 0 (Fonte) and 2 (Vidro) of 262,000 pixels differ so, and no pixel is covered by only one rasteriser.
const SLIVERS: f64 = 1e-4;

fn open(name: &str, camera: Option<&str>) -> Renderer {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/Scene{name}.xml"));
    let camera = camera.map(str::to_owned);
    let settings = Settings { size: Some([SIDE, SIDE]), camera, ..Settings::default() };
    let choice = Choice::CPU;
    curitiba::open(path, settings, choice, &mut Silent).expect("the project opens")
}

/// Draws the scene of the first pass, with every attachment and the camera moved by `shift`.
fn draw(rasteriser: &mut dyn Rasteriser, renderer: &Renderer, shift: f32) -> GBuffer {
    let Work::Raster { scene_set, view, viewport, clear_color, .. } = renderer.plan().passes[0].work else {
        panic!("the first pass draws");
    };
    let scene: Arc<RenderScene> = Arc::clone(renderer.scenes().nth(scene_set).expect("its scene"));
    let moved = glam::Mat4::from_translation(Vec3::X * shift);
    let view = View { clip_from_world: view.clip_from_world * moved, ..view };
    let shade = |material: &curitiba::pipeline::scene::Material| Shade {
        diffuse: material.diffuse,
        emission: material.emission,
        texture: material.texture,
        alpha_cutoff: material.alpha_cutoff,
        ..Shade::default()
    };
    let shades: Vec<Shade> = scene.materials.iter().map(shade).collect();
    let attachments = Attachments { color: true, position: true, normal: true, triangle: true };
    let job = RasterJob {
        scene: &scene,
        program: curitiba::pipeline::programs::RasterProgram::Deferred,
        view,
        lights: &[],
        sun: Some(Sun { direction: Vec3::new(0.597, -0.39, 0.7).normalize(), color: Vec3::splat(0.9) }),
        shades: &shades,
        culled: &[],
        viewport,
        clear_color: Vec4::W + clear_color,
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    };
    let mut buffer = GBuffer::new(SIDE, SIDE, attachments);
    rasteriser.upload(&scene).expect("the scene fits");
    rasteriser.draw(&job, &mut buffer).expect("it draws");
    if rasteriser.needs_read_back() {
        rasteriser.read_back(&job, job.attachments, &mut buffer).expect("it reads back");
    }
    buffer
}

/// The reason why two G-buffers disagree; `None` if they agree.
fn disagreement(cpu: &GBuffer, gpu: &GBuffer, eye: Vec3) -> Option<String> {
    let (mut uncovered, mut same, mut far) = (0, 0, 0);
    for (index, (a, b)) in cpu.triangle.iter().zip(&gpu.triangle).enumerate() {
        uncovered += usize::from((*a == NO_TRIANGLE) != (*b == NO_TRIANGLE));
        if a == b && *a != NO_TRIANGLE {
            same += 1;
            let position = |buffer: &GBuffer| Vec4::from_array(buffer.position[index]).truncate();
            let distance = position(cpu).distance(eye);
            far += usize::from(position(cpu).distance(position(gpu)) > POSITION * distance);
        }
    }
    let pixels = cpu.triangle.len();
    println!("{uncovered} of {pixels} covered by one only, {far} of {same} positions beyond {POSITION}");
    if (uncovered as f64) > (1.0 - COVERAGE) * pixels as f64 {
        return Some(format!("{uncovered} of {pixels} pixels are covered by one only"));
    }
    if same < pixels * 9 / 10 {
        return Some(format!("only {same} of {pixels} pixels show the same triangle"));
    }
    (far as f64 > SLIVERS * same as f64).then(|| format!("{far} of {same} positions differ"))
}

#[test]
fn g_buffers_of_the_seven_projects_agree() {
    let mut gpu = match WgpuRasteriser::new(AdapterChoice::Any) {
        Ok(gpu) => gpu,
        Err(error) => {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
            println!("skipped: {error}");
            return;
        }
    };
    let mut cpu = CpuRasteriser::new();
    for name in ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        for camera in [None, Some("Vidro")] {
            let renderer = open(name, camera);
            let Work::Raster { view, .. } = renderer.plan().passes[0].work else { panic!("the first pass draws") };
            let mine = draw(&mut cpu, &renderer, 0.0);
            let theirs = draw(&mut gpu, &renderer, 0.0);
            let found = disagreement(&mine, &theirs, view.eye);
            assert_eq!(found, None, "Scene{name}, camera {camera:?}");
            // Control: the comparison rejects a picture whose camera is moved by a centimetre.
            let beside = draw(&mut gpu, &renderer, 0.01);
            assert!(
                disagreement(&mine, &beside, view.eye).is_some(),
                "Scene{name}, camera {camera:?}: a shifted view passes"
            );
        }
    }
}
