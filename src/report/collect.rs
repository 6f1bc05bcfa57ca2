//! Carries out the plan: rows, rounds, and scalings.

use super::collector::{Collector, ReportError, Request};
use super::folder::Folder;
use super::model::{Effect, ReportData};
use super::plan::Stage;
use super::{Told, paired, pixel_samples, plan, scale};
use crate::pipeline::executor::Observer;

/// Measures everything that fits into the time, and writes the pictures into `folder`. `told` is called before each step.
///
/// # Errors
/// If the ray backend that was asked for is not available, no row can be measured, or the folder cannot be written.
pub fn collect(
    request: &Request,
    folder: &Folder,
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Result<ReportData, ReportError> {
    let mut collector = Collector::new(request);
    collector.look_for_engines()?;
    let entries = plan::entries(&request.wanted, collector.gpu, &collector.beside);
    let (late, entries): (Vec<_>, Vec<_>) = entries.into_iter().partition(|entry| entry.stage == Stage::OtherView);
    let sizes = plan::pixel_sizes(&request.wanted);
    let threads = plan::thread_counts(rayon::current_num_threads());
    collector.to_do = entries.len() * plan::ROUNDS as usize
        + late.len()
        + Effect::ALL.len()
        + plan::pixel_samples(&request.wanted).len()
        + plan::scaling_lines(&request.wanted).len() * (sizes.len() + threads.len() + request.wanted.triangles.len())
        + plan::light_lines(&request.wanted).len() * plan::LIGHT_COUNTS.len();
    for entry in &entries {
        collector.entry(entry, folder, told, observer)?;
    }
    if collector.file.rows.is_empty() {
        let reasons: Vec<String> =
            collector.file.unavailable.iter().map(|missing| format!("  {}: {}", missing.what, missing.why)).collect();
        return Err(ReportError::Nothing { path: request.projects.clone(), reasons: reasons.join("\n") });
    }
    paired::measure(&mut collector, told, observer);
    pixel_samples::measure(&mut collector, told, observer);
    collector.rounds(told, observer);
    let pixels = scale::by_pixels(&mut collector, &sizes, told, observer);
    let lights = scale::by_lights(&mut collector, folder, told, observer);
    let threads = scale::by_threads(&mut collector, &threads, told, observer);
    let triangles = scale::by_triangles(&mut collector, folder, told, observer);
    let samples = scale::by_samples(&collector);
    for entry in &late {
        collector.entry(entry, folder, told, observer)?;
    }
    Ok(collector.finish(vec![triangles, pixels, lights, samples, threads]))
}
