//! Pictures that stay on the device until the quad pass has filled the window from them.

use super::is_there;
use curitiba::engines::{choose, ray_backend};
use curitiba::passes::raster::gpu::{AdapterChoice, AdapterKind, WgpuRasteriser, adapters};
use curitiba::passes::wgpu_rays::WgpuRays;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::color::{ColorSpace, Tone};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent, Spare, StepKind};
use curitiba::pipeline::image::{Codes, Image};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project::{self, ChannelRef};
use curitiba::pipeline::scene::RenderScene;
use curitiba::pipeline::shared::InPlace;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::Path;
use std::sync::Arc;

const TOGETHER: Choice = Choice { raster: RasterChoice::Wgpu, backend: BackendChoice::Wgpu, ..Choice::CPU };

fn settings() -> Settings {
    Settings { size: Some([72, 48]), ..Settings::default() }
}

fn plan(name: &str, settings: Settings) -> Plan {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/{name}.xml"));
    Plan::new(project::load(&path).expect("the project loads"), settings).expect("the plan stands")
}

fn renderer(name: &str, settings: Settings, engines: Engines) -> Renderer {
    Renderer::new(plan(name, settings), engines, &mut Silent).expect("ready")
}

/// The engines for a choice, with a rasteriser that also fills windows on software drivers.
fn engines(choice: Choice) -> Engines {
    let mut raster = WgpuRasteriser::new(AdapterChoice::Any).expect("a device");
    raster.set_fills_quads(true);
    let rays: Box<dyn RayBackend> = match choice.backend {
        BackendChoice::Wgpu => Box::new(WgpuRays::on(&raster.shared_device()).expect("it traces")),
        _ => ray_backend(choice).expect("a backend"),
    };
    Engines::new(Box::new(raster), rays)
}

fn together(name: &str, settings: Settings) -> Renderer {
    renderer(name, settings, engines(TOGETHER))
}

fn bits(image: &Image) -> Vec<[u32; 4]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// The plan's decision about the quad pass.
fn decision(renderer: &Renderer) -> Option<(bool, String)> {
    let mut found = renderer.decisions().iter().filter(|decision| decision.what.contains("on the rasteriser's device"));
    let decision = found.next().map(|decision| (decision.built, decision.why.clone()));
    assert!(found.next().is_none(), "it is said once");
    decision
}

/// Kind and note of each row of the last frame.
fn rows(renderer: &Renderer) -> Vec<(StepKind, String)> {
    let per_frame = renderer.timeline().rows.iter().filter(|row| row.kind.per_frame());
    per_frame.map(|row| (row.kind, row.note.clone())).collect()
}

/// The copies to the host that a frame makes.
fn copies(renderer: &Renderer) -> Vec<String> {
    rows(renderer).into_iter().filter(|(kind, _)| *kind == StepKind::ReadBack).map(|(_, note)| note).collect()
}

/// Asserts that the displayed codes of a device, and the floats with which it fills a window, equal those of the quad
/// pass on the host.
fn same(name: &str, settings: Settings) -> Renderer {
    let folder = tempfile::tempdir().expect("a folder");
    let [by_host, by_device] = ["host", "device"].map(|name| folder.path().join(name).with_extension("png"));
    let mut renderer = together(name, settings);
    assert_eq!(decision(&renderer).map(|(built, _)| built), Some(true), "{name}: {:?}", decision(&renderer));
    let expected = renderer.frame(&mut Silent).expect("rendered");
    renderer.save(&by_host, &mut Silent).expect("written");
    renderer.forget_frames();
    let display = renderer.plan().display;
    let found = renderer.displayed_frame(&mut Silent).expect("rendered");
    assert_eq!(copies(&renderer), ["4 bytes a pixel"], "{name}");
    assert!(rows(&renderer).contains(&(StepKind::Quad, "on wgpu".to_owned())), "{name}: {:?}", rows(&renderer));
    let of_host = Codes::of(&expected, display).expect("made");
    let wrong = of_host.pixels.iter().zip(&found.pixels).filter(|(a, b)| a != b).count();
    assert_eq!(wrong, 0, "{name}: pixels with other codes");
    assert!(found.pixels.iter().any(|pixel| *pixel != found.pixels[0]), "{name}: something is seen");
    let refused =
        renderer.save(&by_device.with_extension("exr"), &mut Silent).expect_err("it has no floats").to_string();
    assert!(refused.contains("draw_frame_for"), "{refused}");
    let again = Codes::of(&renderer.window_image(), display).expect("made");
    let colors = |codes: &Codes| codes.pixels.iter().map(|pixel| pixel[..3].to_vec()).collect::<Vec<_>>();
    if display.exposure == 0.0 && display.tone == Tone::None {
        assert!(colors(&again) == colors(&found), "{name}: what is known of it are its codes");
    }
    // The device's file equals the host's. All its pixels are finite, and they do not all have one colour.
    let saved = renderer.render_and_save(&by_device, &mut Silent).expect("written");
    assert_eq!((saved.not_finite, saved.is_blank), (0, false), "{name}");
    assert!(std::fs::read(&by_host).expect("read") == std::fs::read(&by_device).expect("read"), "{name}: the files");
    renderer.forget_frames();
    renderer.draw_frame_for(Path::new("picture.exr"), &mut Silent).expect("rendered");
    assert_eq!(copies(&renderer), ["16 bytes a pixel"], "{name}");
    assert!(bits(&renderer.window_image()) == bits(&expected), "{name}: every bit of the floats");
    // A caller that takes everything finds the picture in the targets.
    let after = renderer.update(&mut Silent).expect("rendered");
    assert!(bits(&after) == bits(&expected), "{name}: after it");
    renderer
}

fn channel(renderer: &Renderer, target: &str) -> ChannelRef {
    let targets = &renderer.project().targets;
    let found = targets.iter().position(|other| other.library.contains(target)).expect("the target");
    ChannelRef { target: found, channel: 0 }
}

#[test]
fn what_is_drawn_and_traced_is_shown_by_the_device_as_by_the_host() {
    if !is_there() {
        return;
    }
    same("SceneDummy", settings());
    let mut renderer = same("SceneShadows", settings());
    // Channels that only the quad reads are in host memory only if everything is read back.
    let (drawn, traced) = (channel(&renderer, "Deferred"), channel(&renderer, "Optix"));
    assert!(renderer.holds(drawn) && renderer.holds(traced));
    renderer.displayed_frame(&mut Silent).expect("rendered");
    assert!(!renderer.holds(drawn) && !renderer.holds(traced));
    renderer.refresh(&mut Silent).expect("rendered");
    assert!(renderer.holds(drawn) && renderer.holds(traced));
    // The same in linear light, with targets of 16-bit floats.
    let color = Some(ColorSpace::Linear);
    renderer = same("SceneShadows", Settings { color, exposure: 0.7, ..settings() });
    renderer.read_back_everything();
    renderer.forget_frames();
    renderer.displayed_frame(&mut Silent).expect("rendered");
    assert!(copies(&renderer).len() > 1, "who is shown everything gets it: {:?}", rows(&renderer));
}

#[test]
fn raster_effects_are_shown_by_the_device_as_by_the_host() {
    if !is_there() {
        return;
    }
    same("raster/SceneShadowMap", settings());
}

#[test]
fn what_the_host_reads_is_brought_there_and_the_plan_says_why() {
    if !is_there() {
        return;
    }
    let why = |settings: Settings, engines: Engines| {
        let mut renderer = renderer("SceneShadows", settings, engines);
        let expected = renderer.frame(&mut Silent).expect("rendered");
        let codes = renderer.displayed_frame(&mut Silent).expect("rendered");
        assert!(codes == Codes::of(&expected, renderer.plan().display).expect("made"));
        assert!(!rows(&renderer).contains(&(StepKind::Quad, "on wgpu".to_owned())));
        decision(&renderer)
    };
    let shown = Settings { show: vec!["all".to_owned()], ..settings() };
    let (built, words) = why(shown, engines(TOGETHER)).expect("said");
    assert!(!built && words.contains("is shown, too"), "{words}");
    let (built, words) = why(settings(), engines(TOGETHER.traced_by(BackendChoice::Cpu))).expect("said");
    assert!(!built && words.contains("cpu leaves its pictures in memory of its own"), "{words}");
    let several = Settings { aa: "2".parse().expect("a number"), ..settings() };
    assert!(why(several, engines(TOGETHER)).expect("said").1.contains("samples of a pixel"));
    let on_host = choose(Choice::CPU).expect("always there");
    assert_eq!(why(settings(), on_host), None, "nothing is said where there is no device");
    if adapters().first().is_some_and(|adapter| adapter.kind == AdapterKind::Software) {
        let (built, words) = why(settings(), choose(TOGETHER).expect("a device")).expect("said");
        assert!(!built && words.contains("its driver runs on the processor"), "{words}");
    }
}

/// A ray backend that loses its device in a frame.
struct Fails {
    inner: WgpuRays,
    left: u32,
}

impl RayBackend for Fails {
    fn name(&self) -> &'static str {
        self.inner.name()
    }
    fn device(&self) -> String {
        self.inner.device()
    }
    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.inner.supports(program, fidelity)
    }
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.inner.build(scene, filtered)
    }
    fn bytes_per_triangle(&self) -> u64 {
        self.inner.bytes_per_triangle()
    }
    fn reads(&mut self, lent: &InPlace) -> bool {
        self.inner.reads(lent)
    }
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.inner.run(job, output, progress)
    }
    fn run_in_place(
        &mut self,
        job: &RayJob<'_>,
        picture: usize,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        if self.left == 0 {
            return Err(BackendError::Device { backend: "wgpu", message: "the device was lost".to_owned() });
        }
        self.left -= 1;
        self.inner.run_in_place(job, picture, progress)
    }
}

#[test]
fn where_rays_fail_in_a_frame_the_host_goes_on_and_it_is_said() {
    if !is_there() {
        return;
    }
    let failing = |spares: bool| {
        let mut raster = WgpuRasteriser::new(AdapterChoice::Any).expect("a device");
        raster.set_fills_quads(true);
        let inner = WgpuRays::on(&raster.shared_device()).expect("it traces");
        let mut engines = Engines::new(Box::new(raster), Box::new(Fails { inner, left: 1 }));
        if spares {
            engines.spares.push_back(Spare::new("cpu", || ray_backend(Choice::CPU)));
        }
        engines
    };
    let cpu = engines(TOGETHER.traced_by(BackendChoice::Cpu));
    let expected = renderer("SceneShadows", settings(), cpu).displayed_frame(&mut Silent).expect("rendered");
    let mut alone = renderer("SceneShadows", settings(), failing(false));
    let first = alone.displayed_frame(&mut Silent).expect("rendered");
    let message = alone.displayed_frame(&mut Silent).expect_err("nothing may take over").to_string();
    assert_eq!(message, "pass `pass2` of frame 2: wgpu: the device was lost");
    let mut helped = renderer("SceneShadows", settings(), failing(true));
    assert!(helped.displayed_frame(&mut Silent).expect("rendered") == first);
    assert_eq!(decision(&helped).map(|(built, _)| built), Some(true));
    assert!(helped.displayed_frame(&mut Silent).expect("rendered") == expected, "the whole frame was made again");
    assert_eq!(helped.fallbacks().len(), 1);
    assert_eq!(decision(&helped).map(|(built, _)| built), Some(false), "the plan says so");
}
