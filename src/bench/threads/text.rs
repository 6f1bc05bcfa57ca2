//! Thread sweeps as Markdown.

use super::file::{ThreadsCase, ThreadsFile, ThreadsPoint, speed_up};
use crate::bench::text::in_cell;
use std::fmt::Write as _;

/// Words of the first line of [`markdown`].
const ABOUT: &str = "Medians of wall time in milliseconds; in brackets how many times as fast as on the fewest threads";

/// Whether a text begins like the output of [`markdown`], so that it may be overwritten by such output.
#[must_use]
pub fn is_ours(text: &[u8]) -> bool {
    String::from_utf8_lossy(text).lines().next().is_some_and(|line| line.contains(ABOUT))
}

/// A row of a case's table: name and points.
pub type Line<'c> = (String, &'c [ThreadsPoint]);

/// The steps of a case and the whole frame, without those that take less than 5 microseconds on every number of threads.
#[must_use]
pub fn lines(case: &ThreadsCase) -> Vec<Line<'_>> {
    let steps = case.steps.iter().map(|step| (format!("{} {}", step.kind.name(), step.name), &step.points[..]));
    let all = steps.chain([("frame".to_owned(), &case.frame[..])]);
    all.filter(|(_, points)| points.iter().any(|point| point.wall.median >= 0.005)).collect()
}

/// A cell such as `12.34 (3.9, 48.1 cpu)`: wall time, speed-up over the fewest threads, and processor time. Times are in milliseconds.
#[must_use]
pub fn cell(points: &[ThreadsPoint], point: &ThreadsPoint) -> String {
    let mut inside = Vec::new();
    inside.extend(speed_up(points, point).map(|times| format!("{times:.1}")));
    inside.extend(point.processor.as_ref().map(|processor| format!("{:.1} cpu", processor.median)));
    let wall = format!("{:.2}", point.wall.median);
    if inside.is_empty() { wall } else { format!("{wall} ({})", inside.join(", ")) }
}

/// A one-line description of a case.
#[must_use]
pub fn heading(case: &ThreadsCase) -> String {
    let [width, height] = case.size;
    format!(
        "{}, {}, {width} x {height}, {} triangles, {} textures",
        case.label, case.view, case.triangles, case.textures
    )
}

/// A page with a table for each case: steps downwards, threads to the right.
#[must_use]
pub fn markdown(file: &ThreadsFile) -> String {
    let machine = &file.environment;
    let mut page = format!(
        "{}, {} build, commit {}. {ABOUT}, and the processor time of all threads. {} rounds of {} frames after {} of warm-up.\n",
        machine.cpu, machine.profile, machine.commit, file.rounds, file.frames, file.warmup
    );
    for case in &file.cases {
        let _ = write!(page, "\n### {}\n\n| step |", heading(case));
        for point in &case.frame {
            let plural = if point.threads == 1 { "" } else { "s" };
            let _ = write!(page, " {} thread{plural} |", point.threads);
        }
        let _ = writeln!(page, "\n|---|{}", "---|".repeat(case.frame.len()));
        for (name, points) in lines(case) {
            let cells: Vec<String> = points.iter().map(|point| cell(points, point)).collect();
            let _ = writeln!(page, "| {} | {} |", in_cell(&name), cells.join(" | "));
        }
    }
    page
}
