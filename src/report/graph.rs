//! The graph of attachments between the passes of a row, from its plan.

use super::model::PassGraph;
use crate::bench::Case;
use crate::pipeline::plan::{DEPTH, Plan, Slot, TRIANGLES, Work};
use crate::pipeline::project::PassKind;

/// The passes of a case that run, according to its plan; `None` if the project cannot be read any more.
pub(super) fn of(case: &Case, row: &str, label: &str) -> Option<PassGraph> {
    let plan = Plan::new(case.settings.open(&case.project).ok()?, case.settings.clone()).ok()?;
    let mut passes = Vec::new();
    let mut written: Vec<(Slot, usize)> = Vec::new();
    let mut edges: Vec<(usize, usize, Vec<String>)> = Vec::new();
    for (index, planned) in plan.passes.iter().enumerate() {
        let pass = plan.pass(planned);
        let what = match (&planned.work, &pass.kind) {
            (Work::Off { .. }, _) => "switched off".to_owned(),
            (_, PassKind::Raster(_)) => "draws triangles".to_owned(),
            (_, PassKind::Ray(ray)) => format!("{}, by rays", ray.program.info().stem),
            (_, PassKind::Effect(effect)) => format!("{}, by raster", effect.program.info().name),
            (_, PassKind::Quad(_)) => "fills a rectangle".to_owned(),
            (_, PassKind::Intersection(_)) => "traces the rays of a buffer".to_owned(),
            (_, PassKind::Compute(_)) => "runs a compute shader".to_owned(),
        };
        passes.push([pass.name.clone(), what]);
        let access = plan.access(planned);
        for slot in access.reads {
            let Some((_, from)) = written.iter().rev().find(|(written, _)| *written == slot) else { continue };
            let name = attachment(&plan, slot);
            match edges.iter_mut().find(|(first, last, _)| (*first, *last) == (*from, index)) {
                Some((_, _, names)) if names.contains(&name) => {}
                Some((_, _, names)) => names.push(name),
                None => edges.push((*from, index, vec![name])),
            }
        }
        written.extend(access.writes.into_iter().map(|slot| (slot, index)));
    }
    Some(PassGraph { row: row.to_owned(), label: label.to_owned(), passes, edges })
}

fn attachment(plan: &Plan, (target, channel): Slot) -> String {
    match target {
        _ if channel == TRIANGLES => "triangle ids".to_owned(),
        _ if channel == DEPTH => "depth".to_owned(),
        Some(target) => plan.project.targets[target].channels[channel].name.clone(),
        None => "the window".to_owned(),
    }
}
