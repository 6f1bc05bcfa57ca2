//! G-buffers that ray passes read in place, with a rasteriser and a ray backend that share host memory.

use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::{
    Attachments, BackendError, BuildStats, DrawStats, EffectJob, EffectStats, GBuffer, HandOver, Limits, RasterJob,
    Rasteriser, RayBackend, RayJob, RayStats,
};
use curitiba::pipeline::device_quad::{DeviceQuad, DeviceQuadStats, DeviceSource, OnDevice, QuadPlace, Shown};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent, Spare, StepKind};
use curitiba::pipeline::image::{Codes, Image};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project::{self, Clears, Pass};
use curitiba::pipeline::scene::RenderScene;
use curitiba::pipeline::shared::{DeviceUuid, SharedGBuffer};
use std::fs::File;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const DEVICE: DeviceUuid = *b"a device of test";
const SIZE: [u32; 2] = [48, 32];

/// A stand-in for the memory of a device.
#[derive(Debug, Default)]
struct Memory {
    /// The attachments that were drawn.
    drawn: GBuffer,
    /// The attachments that were handed over.
    shared: GBuffer,
    attachments: Attachments,
    value: u64,
    /// The attachments that were copied to the host.
    read_back: Vec<Attachments>,
    /// Whether there is room for the picture of a ray pass, that picture, and the value of the G-buffer from which it was traced.
    has_room: bool,
    picture: Vec<[f32; 4]>,
    picture_of: u64,
}

type Device = Arc<Mutex<Memory>>;

/// What the stand-ins can do.
#[derive(Debug, Clone, Copy, Default)]
struct Abilities {
    /// The rasteriser refuses to share.
    refuses: bool,
    /// The run in which the ray backend fails.
    fails_in: Option<u32>,
    /// Rays leave their picture on the device, and the rasteriser fills quads there.
    shows: bool,
}

/// A rasteriser that draws into the shared memory.
struct Drawer {
    inner: CpuRasteriser,
    device: Device,
    can: Abilities,
}

fn only(wanted: Attachments, from: &GBuffer) -> GBuffer {
    let channel = |wanted: bool, pixels: &[[f32; 4]]| if wanted { pixels.to_vec() } else { Vec::new() };
    GBuffer {
        origin: from.origin,
        width: from.width,
        height: from.height,
        color: channel(wanted.color, &from.color),
        position: channel(wanted.position, &from.position),
        normal: channel(wanted.normal, &from.normal),
        triangle: if wanted.triangle { from.triangle.clone() } else { Vec::new() },
        depth: Vec::new(),
    }
}

impl Rasteriser for Drawer {
    fn name(&self) -> &'static str {
        "wgpu"
    }
    fn limits(&self) -> Limits {
        self.inner.limits()
    }
    fn device(&self) -> String {
        "made up".to_owned()
    }
    fn upload(&mut self, scene: &Arc<RenderScene>) -> Result<(), BackendError> {
        self.inner.upload(scene)
    }
    fn draw(&mut self, job: &RasterJob<'_>, target: &mut GBuffer) -> Result<DrawStats, BackendError> {
        let mut own = GBuffer::new(target.width, target.height, job.attachments);
        let mut stats = self.inner.draw(job, &mut own)?;
        let mut device = self.device.lock().expect("no panic while it was held");
        if job.shared != Attachments::default() {
            assert_eq!(device.attachments.union(job.shared), device.attachments, "what is shared was announced");
            device.shared = only(job.shared, &own);
            device.value += 1;
            let (value, host) = (device.value, Duration::from_micros(30));
            stats.shared = Some(HandOver { value, host, device: Some(Duration::from_micros(20)) });
        }
        device.drawn = own;
        Ok(stats)
    }
    fn needs_read_back(&self) -> bool {
        true
    }
    fn read_back(&mut self, _: &RasterJob<'_>, wanted: Attachments, target: &mut GBuffer) -> Result<(), BackendError> {
        let mut device = self.device.lock().expect("no panic while it was held");
        device.read_back.push(wanted);
        let copied = only(wanted, &device.drawn);
        let channels = [
            (wanted.color, &mut target.color, copied.color),
            (wanted.position, &mut target.position, copied.position),
            (wanted.normal, &mut target.normal, copied.normal),
        ];
        channels.into_iter().filter(|(wanted, ..)| *wanted).for_each(|(_, to, from)| *to = from);
        if wanted.triangle {
            target.triangle = copied.triangle;
        }
        Ok(())
    }
    fn effect(&mut self, _: &EffectJob<'_>, _: &mut Image, _: &Progress) -> Result<EffectStats, BackendError> {
        unreachable!("no project here has one")
    }
    fn shares(&self) -> Option<DeviceUuid> {
        Some(DEVICE)
    }
    fn share(
        &mut self,
        width: u32,
        height: u32,
        attachments: Attachments,
        picture: bool,
    ) -> Result<SharedGBuffer, BackendError> {
        if self.can.refuses {
            return Err(BackendError::Device { backend: "wgpu", message: "no memory can be exported".to_owned() });
        }
        let mut device = self.device.lock().expect("no panic while it was held");
        (device.attachments, device.has_room) = (attachments, picture);
        let handle = || File::open("/dev/null").expect("it is everywhere").into();
        Ok(SharedGBuffer {
            device: DEVICE,
            width,
            height,
            attachments,
            picture,
            memory: handle(),
            bytes: 0,
            semaphore: handle(),
        })
    }
    fn fills_quads(&self) -> QuadPlace {
        if self.can.shows { QuadPlace::Device } else { QuadPlace::Host }
    }
    fn fill_on_device(&mut self, quad: &DeviceQuad, shown: Shown<'_>) -> Result<DeviceQuadStats, BackendError> {
        let device = self.device.lock().expect("no panic while it was held");
        let source = |source: DeviceSource| {
            let mut pixels = match source.place {
                OnDevice::Drawn { value, channel: 0 } if value == device.value => device.drawn.color.clone(),
                OnDevice::Made(_) => {
                    assert_eq!(device.picture_of, device.value, "the picture of this frame is meant");
                    device.picture.clone()
                }
                place => panic!("{place:?} is not there"),
            };
            source.format.round(&mut pixels);
            pixels
        };
        let mut pixels = source(quad.color);
        if let Some(factor) = quad.factor.map(source) {
            let multiply = |(color, factor): (&mut [f32; 4], &[f32; 4])| *color = color.map(|value| value * factor[0]);
            pixels.iter_mut().zip(&factor).for_each(multiply);
        }
        match shown {
            Shown::Floats(floats) => floats.copy_from_slice(&pixels),
            Shown::Codes(display, codes) => {
                let image = Image { width: quad.width, height: quad.height, pixels };
                codes.copy_from_slice(&Codes::of(&image, display).expect("made").pixels);
            }
        }
        Ok(DeviceQuadStats::default())
    }
}

/// A ray backend that traces on the shared memory, and that fails in run `fails_in`.
struct Tracer {
    inner: CpuRays,
    device: Device,
    joined: bool,
    runs: u32,
    can: Abilities,
}

impl Tracer {
    /// Counts a run, and fails in the run `fails_in`.
    fn count(&mut self) -> Result<(), BackendError> {
        self.runs += 1;
        match self.can.fails_in == Some(self.runs) {
            true => Err(BackendError::Device { backend: "cuda", message: "the device was lost".to_owned() }),
            false => Ok(()),
        }
    }

    /// Traces on the G-buffer that was handed over with that value.
    fn trace(
        &mut self,
        job: &RayJob<'_>,
        value: u64,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let device = self.device.lock().expect("no panic while it was held");
        assert!(self.joined && value == device.value, "the G-buffer of this frame is meant");
        assert!(job.position.is_empty() && job.normal.is_empty() && job.color.is_empty() && job.triangle.is_empty());
        let GBuffer { color, position, normal, triangle, .. } = &device.shared;
        self.inner.run(&RayJob { color, position, normal, triangle, shared: None, ..*job }, output, progress)
    }
}

impl RayBackend for Tracer {
    fn name(&self) -> &'static str {
        "cuda"
    }
    fn device(&self) -> String {
        "made up".to_owned()
    }
    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.inner.build(scene, filtered)
    }
    fn bytes_per_triangle(&self) -> u64 {
        self.inner.bytes_per_triangle()
    }
    fn joins(&self, device: DeviceUuid) -> bool {
        device == DEVICE
    }
    fn join(&mut self, shared: SharedGBuffer) -> Result<(), BackendError> {
        assert_eq!([shared.width, shared.height], SIZE);
        self.joined = true;
        Ok(())
    }
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.count()?;
        let Some(value) = job.shared else {
            return self.inner.run(job, output, progress);
        };
        let mut stats = self.trace(job, value, output, progress)?;
        stats.read_back = Some(Duration::from_nanos(1));
        Ok(stats)
    }
    fn shares_pictures(&self) -> bool {
        self.can.shows
    }
    fn run_in_place(&mut self, job: &RayJob<'_>, _: usize, progress: &Progress) -> Result<RayStats, BackendError> {
        self.count()?;
        let value = job.shared.expect("pictures are left beside a shared G-buffer alone");
        let pixels = vec![[0.0; 4]; job.width as usize * job.height as usize];
        let mut output = Image { width: job.width, height: job.height, pixels };
        let stats = self.trace(job, value, &mut output, progress)?;
        let mut device = self.device.lock().expect("no panic while it was held");
        assert!(device.has_room, "memory was set aside");
        (device.picture, device.picture_of) = (output.pixels, value);
        Ok(RayStats { read_back: None, ..stats })
    }
}

fn plan(project: &str, show: Option<&str>) -> Plan {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/{project}.xml"));
    let show = show.into_iter().map(str::to_owned).collect();
    let settings = Settings { size: Some(SIZE), show, set: vec!["pass2.samples=4".to_owned()], ..Settings::default() };
    let settings = if project == "SceneFinal" { settings } else { Settings { set: Vec::new(), ..settings } };
    Plan::new(project::load(&path).expect("the project loads"), settings).expect("the plan stands")
}

fn joined(plan: Plan, refuses: bool, fails_in: Option<u32>) -> (Renderer, Device) {
    able(plan, Abilities { refuses, fails_in, shows: false })
}

fn able(plan: Plan, can: Abilities) -> (Renderer, Device) {
    let device = Device::default();
    let raster = Drawer { inner: CpuRasteriser::new(), device: Arc::clone(&device), can };
    let of_device = Arc::clone(&device);
    let cuda = Spare::new("cuda", move || {
        Ok(Box::new(Tracer { inner: CpuRays::new(), device: of_device, joined: false, runs: 0, can }))
    });
    let cpu = Spare::new("cpu", || Ok(Box::new(CpuRays::new())));
    let engines = Engines::first_of(Box::new(raster), [cuda, cpu]).expect("both are there");
    (Renderer::new(plan, engines, &mut Silent).expect("ready"), device)
}

fn expected(plan: Plan) -> Vec<[u32; 4]> {
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("ready");
    bits(&renderer.frame(&mut Silent).expect("rendered"))
}

fn bits(picture: &Image) -> Vec<[u32; 4]> {
    picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn kinds(renderer: &Renderer) -> Vec<StepKind> {
    renderer.timeline().rows.iter().filter(|row| row.kind.per_frame()).map(|row| row.kind).collect()
}

#[test]
fn what_only_rays_read_does_not_pass_through_the_host() {
    for project in ["SceneFinal", "SceneDummy", "SceneRefract"] {
        let (mut renderer, device) = joined(plan(project, None), false, None);
        for _ in 0..2 {
            let picture = renderer.frame(&mut Silent).expect("rendered");
            assert!(bits(&picture) == expected(plan(project, None)), "{project}");
        }
        assert!(device.lock().expect("free").read_back.is_empty(), "{project}: nothing was copied");
        assert!(renderer.warnings().is_empty());
        let steps = kinds(&renderer);
        let join = steps.iter().filter(|kind| **kind == StepKind::Join).count();
        assert_eq!(join, 1, "{project}: joining is a step of its own: {steps:?}");
        let row = renderer.timeline().rows.iter().find(|row| row.kind == StepKind::Join).expect("there");
        assert_eq!((row.host_ms.len(), row.device_ms.len()), (2, 2));
    }
}

#[test]
fn what_is_shown_or_read_by_the_host_is_copied_besides() {
    let (mut renderer, device) = joined(plan("SceneShadows", None), false, None);
    let picture = renderer.frame(&mut Silent).expect("rendered");
    assert!(bits(&picture) == expected(plan("SceneShadows", None)));
    let color = Attachments { color: true, ..Attachments::default() };
    assert_eq!(device.lock().expect("free").read_back, [color], "the quad pass reads the colour, and nothing else");
}

#[test]
fn everything_is_copied_where_observers_want_to_see_it() {
    let (mut renderer, device) = joined(plan("SceneFinal", None), false, None);
    renderer.read_back_everything();
    let picture = renderer.frame(&mut Silent).expect("rendered");
    assert!(bits(&picture) == expected(plan("SceneFinal", None)));
    let all = Attachments { color: true, position: true, normal: true, triangle: true };
    assert_eq!(device.lock().expect("free").read_back, [all]);
}

#[test]
fn where_memory_cannot_be_shared_the_host_copies_and_that_is_told() {
    let (mut renderer, device) = joined(plan("SceneFinal", None), true, None);
    let warnings: Vec<String> = renderer.warnings().groups().iter().map(ToString::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("cannot be shared"), "{warnings:?}");
    assert!(warnings[0].contains("no memory can be exported"), "{warnings:?}");
    let picture = renderer.frame(&mut Silent).expect("rendered");
    assert!(bits(&picture) == expected(plan("SceneFinal", None)));
    assert_eq!(device.lock().expect("free").read_back.len(), 1);
}

#[test]
fn a_backend_that_takes_over_finds_the_g_buffer_in_the_host() {
    let (mut renderer, device) = joined(plan("SceneFinal", None), false, Some(2));
    renderer.frame(&mut Silent).expect("the first frame is shared");
    assert!(device.lock().expect("free").read_back.is_empty());
    for frame in 2..4 {
        let picture = renderer.frame(&mut Silent).expect("the cpu goes on");
        assert!(bits(&picture) == expected(plan("SceneFinal", None)), "frame {frame}");
    }
    assert_eq!(renderer.fallbacks().len(), 1);
    assert_eq!(device.lock().expect("free").read_back.len(), 2, "one copy for each frame since");
}

/// The codes of the picture that the host's engines make.
fn expected_codes(plan: Plan) -> Codes {
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
    Renderer::new(plan, engines, &mut Silent).expect("ready").displayed_frame(&mut Silent).expect("rendered")
}

#[test]
fn a_picture_that_rays_leave_in_shared_memory_is_shown_from_there() {
    for project in ["SceneShadows", "SceneFinal", "SceneRefract"] {
        let (mut renderer, device) = able(plan(project, None), Abilities { shows: true, ..Abilities::default() });
        assert!(renderer.fills_window_on_device(), "{project}: {:?}", renderer.decisions());
        for _ in 0..2 {
            let codes = renderer.displayed_frame(&mut Silent).expect("rendered");
            assert!(codes == expected_codes(plan(project, None)), "{project}");
        }
        let steps = kinds(&renderer);
        let passes = [StepKind::Raster, StepKind::Join, StepKind::Rays, StepKind::Quad, StepKind::ReadBack];
        assert_eq!(steps, passes, "{project}: nothing but the codes is copied");
        assert!(device.lock().expect("free").read_back.is_empty(), "{project}");
        // A caller that takes all targets finds them in host memory.
        let picture = renderer.frame(&mut Silent).expect("rendered");
        assert!(bits(&picture) == expected(plan(project, None)), "{project}");
    }
}

#[test]
fn where_the_picture_does_not_stay_there_is_no_room_for_it() {
    let (renderer, device) = able(plan("SceneFinal", Some("all")), Abilities { shows: true, ..Abilities::default() });
    assert!(!renderer.fills_window_on_device());
    assert!(!device.lock().expect("free").has_room, "what is shown is read by the host");
    let (_, device) = joined(plan("SceneFinal", None), false, None);
    assert!(!device.lock().expect("free").has_room, "this backend leaves its pictures in the host");
}

#[test]
fn a_backend_that_takes_over_from_one_that_leaves_its_pictures_begins_the_frame_again() {
    let can = Abilities { shows: true, fails_in: Some(2), ..Abilities::default() };
    let (mut renderer, _) = able(plan("SceneShadows", None), can);
    for frame in 1..4 {
        let codes = renderer.displayed_frame(&mut Silent).expect("rendered");
        assert!(codes == expected_codes(plan("SceneShadows", None)), "frame {frame}");
    }
    assert_eq!(renderer.fallbacks().len(), 1);
    assert!(!renderer.fills_window_on_device());
}

#[test]
fn a_picture_of_a_g_buffer_that_is_drawn_twice_is_not_left_there() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneDummy.xml");
    let drawn = |again: bool| {
        let mut project = project::load(&path).expect("the project loads");
        let passes = &mut project.pipelines[project.default_pipeline].passes;
        if again {
            // The second pass keeps the output of the first, so both run.
            let clears = Clears { color: false, ..Clears::default() };
            passes.insert(1, Pass { name: "again".to_owned(), clears, ..passes[0].clone() });
        }
        let settings = Settings { size: Some(SIZE), ..Settings::default() };
        able(Plan::new(project, settings).expect("the plan stands"), Abilities { shows: true, ..Abilities::default() })
    };
    assert!(drawn(false).0.fills_window_on_device(), "control");
    let (mut renderer, device) = drawn(true);
    assert!(!renderer.fills_window_on_device() && !device.lock().expect("free").has_room);
    let codes = renderer.displayed_frame(&mut Silent).expect("rendered");
    assert!(codes == expected_codes(plan("SceneDummy", None)));
}
