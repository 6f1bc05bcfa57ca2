//! A whole run of a small project, as `curitiba render` does it. This is the body of the fuzz target `render`; the
//! ordinary test `main.rs` runs it, too.
//!
//! The input's bytes choose one of the shipped projects, numbers for its camera, light and viewport, the settings, and
//! the triangles of its scene; see `input`. A run reads the project, plans it, loads, builds, draws, traces and writes,
//! in both fidelities. It panics if a picture breaks a promise.

use super::fuzz_targets::Folder;
use super::fuzz_targets::check::Outcome;
use super::input::Run;
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::executor::{Engines, Observer, Output, Progress, Renderer, StepKind, Triangles};
use curitiba_pipeline::image::{Image, read_image};
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::project;
use std::sync::Arc;

/// Memory limit of a run, in bytes.
const MAX_MEMORY: u64 = 64 << 20;

/// A channel that a pass wrote: its name, its size, and the bits of its pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    pub name: String,
    pub size: [u32; 2],
    pub bits: Vec<[u32; 4]>,
}

/// Renders the input's project in both fidelities.
pub fn render(input: &[u8]) -> Outcome {
    if pictures(input).is_empty() { Outcome::Refused } else { Outcome::Loaded }
}

/// Everything that the passes wrote, in order, for each fidelity in which the project renders.
pub fn pictures(bytes: &[u8]) -> Vec<Written> {
    let run = Run::of(bytes);
    let folder = Folder::new();
    for (name, text) in run.files() {
        folder.write(name, &text);
    }
    let mut written = Vec::new();
    for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
        let settings = Settings { fidelity, max_memory: MAX_MEMORY, ..run.settings() };
        written.extend(frames(&folder, settings).unwrap_or_else(|refusal| {
            assert!(!refusal.is_empty(), "a refusal says why");
            Vec::new()
        }));
    }
    written
}

/// Renders two frames and writes their files. Returns what the passes of the first frame wrote, and the window.
fn frames(folder: &Folder, settings: Settings) -> Result<Vec<Written>, String> {
    let project = project::load(&folder.path().join("project.xml")).map_err(|problems| problems.to_string())?;
    let plan = Plan::new(project, settings).map_err(|error| error.to_string())?;
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
    let (window, fidelity) = (plan.window, plan.settings.fidelity);
    let mut watcher = Watcher::new(fidelity);
    let mut renderer = Renderer::new(plan, engines, &mut watcher).map_err(|error| error.to_string())?;
    let picture = renderer.frame(&mut watcher).map_err(|error| error.to_string())?;
    let first = std::mem::take(&mut watcher.written);
    assert_eq!([picture.width, picture.height], window, "the picture is as large as the window");
    assert!(first.iter().any(|output| output.name == "window"), "the window is shown to observers");
    let again = renderer.frame(&mut watcher).map_err(|error| format!("the second frame fails: {error}"));
    let again = again.expect("what was rendered once is rendered again");
    assert!(bits(&picture) == bits(&again) && first == watcher.written, "a second frame differs");
    files(folder, &mut renderer, &picture);
    Ok(first)
}

/// Reads back every file that a run writes. Each must have the right size, and the same values if the format can hold them.
fn files(folder: &Folder, renderer: &mut Renderer, picture: &Image) {
    let mut watcher = Watcher::new(renderer.plan().settings.fidelity);
    for name in ["out.png", "out.exr"] {
        let path = folder.path().join(name);
        let written = renderer.save(&path, &mut watcher).expect("the files can be written");
        assert_eq!(written.len(), 1 + 2 * renderer.plan().shown.len());
        for file in &written {
            let read = read_image(&file.path).expect("a written picture can be read");
            if file.path == path {
                assert_eq!([read.image.width, read.image.height], [picture.width, picture.height]);
            }
        }
        let read = read_image(&path).expect("the window can be read");
        match read.steps {
            None => assert!(bits(&read.image) == bits(picture), "an EXR holds other values than the window"),
            Some(steps) => assert_eq!(steps, 255),
        }
    }
}

fn bits(image: &Image) -> Vec<[u32; 4]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Records the outputs of passes, and asserts that they hold no meaningless numbers.
pub struct Watcher {
    fidelity: Fidelity,
    written: Vec<Written>,
}

impl Watcher {
    /// A watcher that has recorded nothing.
    pub fn new(fidelity: Fidelity) -> Self {
        Self { fidelity, written: Vec::new() }
    }
}

impl Observer for Watcher {
    fn begin(&mut self, _: StepKind, _: &str, _: &Arc<Progress>) {}
    fn end(&mut self) {}

    fn wrote(&mut self, output: &Output<'_>) {
        let [width, height] = [output.width, output.height];
        let name = format!("pass {}: {}", output.pass, output.channel);
        assert_eq!(output.pixels.len() as u64, u64::from(width) * u64::from(height), "{name}: {width} x {height}");
        for (component, faults) in output.components().iter().zip(output.faults()) {
            // The report's Fresnel weights are below 0 or above 1 at grazing angles (docs/fidelity.md).
            let wrong = match self.fidelity {
                Fidelity::Corrected => faults.total(),
                Fidelity::Thesis => faults.nan + faults.infinite,
            };
            assert_eq!(wrong, 0, "{:?}: {name}: {component}: {faults:?}", self.fidelity);
        }
        let bits = output.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect();
        let name = if output.channel == "window" { output.channel.clone() } else { name };
        self.written.push(Written { name, size: [width, height], bits });
    }

    fn wrote_triangles(&mut self, triangles: &Triangles<'_>) {
        assert_eq!(triangles.faults().total(), 0, "pass {}: {:?}", triangles.pass, triangles.faults());
    }
}
