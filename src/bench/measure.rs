//! Measuring a case: warm-up, frames, and every step of them.

use super::case::{Case, fidelity_name};
use super::model::{BenchRow, BenchStep, EngineName, RowError, Stats};
use super::threads::clock::Clocked;
use crate::OpenError;
use crate::environment::peak_memory;
use crate::pipeline::executor::{Observer, RenderError, Renderer, Row, StepKind};
use crate::pipeline::image::Image;
use std::time::{Duration, Instant};

/// File name that determines the format for which frames are drawn: PNG. No such file is written.
pub(super) const AS_WRITTEN: &str = "picture.png";

/// Number of frames of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeasureOptions {
    /// Number of frames that are measured, at least 1.
    pub frames: u32,
    /// Number of frames rendered before the measured ones.
    pub warmup: u32,
}

impl Default for MeasureOptions {
    fn default() -> Self {
        Self { frames: 5, warmup: 1 }
    }
}

/// Result of a measurement.
pub struct Measured {
    /// The row. Its error is [`RowError::Missing`] until the picture is compared with a reference.
    pub row: BenchRow,
    /// The renderer.
    pub renderer: Renderer,
    /// The picture of the last frame.
    pub picture: Image,
}

/// Opens a case, renders its frames and collects the times of all steps.
///
/// Whole frames are timed around [`Renderer::draw_frame_for`] a PNG file, as `curitiba render` draws them. The time ends when the picture is
/// in the host's memory; nothing is encoded or written. If the rasteriser's device fills the window, that picture has 4 bytes a pixel, and
/// another, untimed frame gives the picture in floats.
///
/// # Errors
/// If the case cannot be opened or a frame fails.
pub fn measure(case: &Case, options: &MeasureOptions, observer: &mut dyn Observer) -> Result<Measured, OpenError> {
    let renderer = case.open(observer)?;
    measure_with(renderer, case, options, observer).map_err(OpenError::from)
}

/// [`measure`] with an open renderer.
///
/// # Errors
/// If a frame fails.
pub fn measure_with(
    mut renderer: Renderer,
    case: &Case,
    options: &MeasureOptions,
    observer: &mut dyn Observer,
) -> Result<Measured, RenderError> {
    let on_device = renderer.fills_window_on_device();
    if options.warmup > 0 {
        warm_up(&mut renderer, options.warmup, observer)?;
    }
    let row = frames(&mut renderer, case, options.frames, observer)?;
    // The picture's error is computed from floats.
    let picture = if on_device { renderer.frame(observer)? } else { renderer.update(observer)? };
    Ok(Measured { row, renderer, picture })
}

/// Renders at least `frames` frames. If a step has device times, more frames are rendered until `BUSY` has passed, since devices lower their clock
/// while idle.
fn warm_up(renderer: &mut Renderer, frames: u32, observer: &mut dyn Observer) -> Result<(), RenderError> {
    /// Least time of warm-up on a device. An H100 raises its clock within a fifth of a second of work.
    const BUSY: Duration = Duration::from_millis(400);
    // In the first frame the device waits while its programs are compiled, so that frame does not count as work.
    renderer.draw_frame_for(AS_WRITTEN.as_ref(), observer)?;
    let begun = Instant::now();
    let mut done = 1;
    loop {
        let is_timed = renderer.timeline().rows.iter().any(|row| !row.device_ms.is_empty());
        if done >= frames && (!is_timed || begun.elapsed() >= BUSY) {
            return Ok(());
        }
        renderer.draw_frame_for(AS_WRITTEN.as_ref(), observer)?;
        done += 1;
    }
}

/// Renders `count` frames, at least 1, with an open renderer, which may have rendered frames before. Returns a row with the times of all steps of
/// these frames.
///
/// # Errors
/// If a frame fails.
pub fn frames(
    renderer: &mut Renderer,
    case: &Case,
    count: u32,
    observer: &mut dyn Observer,
) -> Result<BenchRow, RenderError> {
    renderer.forget_frames();
    let mut samples = Vec::with_capacity(count.max(1) as usize);
    for _ in 0..count.max(1) {
        let begun = Clocked::now();
        renderer.draw_frame_for(AS_WRITTEN.as_ref(), observer)?;
        samples.push(Clocked::since(begun));
    }
    Ok(row(renderer, case, &samples))
}

fn row(renderer: &Renderer, case: &Case, clocked: &[Clocked]) -> BenchRow {
    let samples: Vec<f64> = clocked.iter().map(|frame| frame.wall_ms).collect();
    let processor: Option<Vec<f64>> = clocked.iter().map(|frame| frame.processor_ms).collect();
    let plan = renderer.plan();
    let engines = renderer.engines();
    let timeline = &renderer.timeline().rows;
    let steps = |per_frame: bool| -> Vec<BenchStep> {
        timeline.iter().filter(|row| row.kind.per_frame() == per_frame).filter_map(step).collect()
    };
    let traces = plan.passes.iter().any(|planned| plan.traced(planned).is_some());
    let frames = samples.len();
    let total: f64 = samples.iter().sum();
    let frame = Stats::new(samples).expect("at least one frame was rendered");
    let in_rays: f64 =
        timeline.iter().filter(|row| row.kind == StepKind::Rays).flat_map(|row| row.host_ms.iter()).sum();
    BenchRow {
        key: case.key.clone(),
        label: case.label.clone(),
        effect: case.effect.clone(),
        technique: case.technique,
        view: case.view.clone(),
        project: case.project.clone(),
        set: plan.settings.set.clone(),
        size: plan.window,
        fidelity: fidelity_name(plan.settings.fidelity).to_owned(),
        seed: plan.settings.seed,
        triangles: renderer.scenes().map(|scene| scene.geometry.triangles.len() as u64).sum(),
        raster: EngineName { name: engines.raster.name().to_owned(), device: engines.raster.device() },
        rays: traces.then(|| EngineName { name: engines.rays.name().to_owned(), device: engines.rays.device() }),
        interval: frame.interval(),
        outliers: Some(frame.outliers()),
        frame,
        frame_device: frame_device(timeline, frames),
        frame_processor: processor.and_then(Stats::new),
        steps: steps(true),
        setup: steps(false),
        ray_share: traces.then(|| in_rays / total.max(1e-9)),
        peak_memory_bytes: peak_memory(),
        held_bytes: plan.target_bytes() + timeline.iter().map(|row| row.bytes).sum::<u64>(),
        error: RowError::Missing("no reference was asked for".to_owned()),
        picture_error: None,
        thesis: None,
        inputs: None,
        picture: None,
        machine: 0,
    }
}

fn step(row: &Row) -> Option<BenchStep> {
    Some(BenchStep {
        kind: row.kind,
        name: row.name.clone(),
        host: Stats::new(row.host_ms.clone())?,
        device: Stats::new(row.device_ms.clone()),
        rays: row.rays,
        mrays_per_second: row.mrays_per_second(),
        answers: row.answers,
        adaptive: row.adaptive,
        note: row.note.clone(),
    })
}

/// The sum of the device times of each frame; `None` if a step other than a copy has no device time.
fn frame_device(timeline: &[Row], frames: usize) -> Option<Stats> {
    let mut sums = vec![0.0; frames];
    for row in timeline.iter().filter(|row| row.kind.per_frame() && row.kind != StepKind::ReadBack) {
        if row.device_ms.len() != frames {
            return None;
        }
        sums.iter_mut().zip(&row.device_ms).for_each(|(sum, ms)| *sum += ms);
    }
    Stats::new(sums)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Choice;
    use crate::pipeline::executor::{Silent, Timeline};
    use crate::pipeline::plan::Settings;
    use std::path::Path;
    use std::time::Duration;

    #[test]
    fn a_row_holds_the_samples_of_its_frames_and_none_of_the_warm_up() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneSSAO.xml");
        let settings =
            Settings { size: Some([24, 24]), set: vec!["pass2.samples=4".to_owned()], ..Settings::default() };
        let choice = Choice::CPU;
        let case = Case::new(&path, settings, choice).expect("the project is valid");
        assert_eq!((case.label.as_str(), case.view.as_str()), ("AO, 4 samples", "Fonte"));
        let measured = measure(&case, &MeasureOptions { frames: 3, warmup: 2 }, &mut Silent).expect("measured");
        let row = measured.row;
        assert_eq!(row.frame.n(), 3);
        assert!(!row.steps.is_empty() && row.steps.iter().all(|step| step.host.n() == 3));
        assert!(row.setup.iter().all(|step| step.host.n() == 1));
        let rays = row.steps.iter().find(|step| step.kind == StepKind::Rays).expect("a ray step");
        assert!(rays.rays.is_some_and(|rays| rays.occlusion > 0));
        let structure: u64 = measured.renderer.timeline().rows.iter().map(|row| row.bytes).sum();
        assert!(structure > 0 && row.held_bytes == measured.renderer.plan().target_bytes() + structure);
        let share = row.ray_share.expect("a ray pass ran");
        assert!(share > 0.0 && share <= 1.0, "{share}");
        assert!(matches!(row.error, RowError::Missing(_)));
    }

    #[test]
    fn a_frame_has_a_device_time_only_where_all_its_steps_have_one() {
        let mut timeline = Timeline::default();
        for ms in [2.0, 3.0] {
            timeline.record(StepKind::Raster, "a", Duration::ZERO).device_ms.push(ms);
            timeline.record(StepKind::ReadBack, "a", Duration::ZERO);
        }
        assert_eq!(frame_device(&timeline.rows, 2).map(|stats| stats.samples), Some(vec![2.0, 3.0]));
        timeline.record(StepKind::Rays, "b", Duration::ZERO);
        assert_eq!(frame_device(&timeline.rows, 2), None);
    }
}
