//! Time against threads: wall time and processor time of each step.

use super::Plot;
use super::canvas::{Entry, Ink, LogAxis, Mark, NEUTRAL, RASTER, RAYS, draw, lay_out, legend, log_chart};
use crate::bench::threads::file::{ThreadsCase, ThreadsPoint, speed_up};
use crate::pipeline::executor::StepKind;
use plotters::prelude::*;

const SIZE: (u32, u32) = (760, 460);

/// A curve of the plot.
struct Curve<'c> {
    name: String,
    ink: Ink,
    points: &'c [ThreadsPoint],
}

fn curves(case: &ThreadsCase) -> Vec<Curve<'_>> {
    let mut curves: Vec<Curve<'_>> = Vec::new();
    for step in &case.steps {
        let inks: &[Ink] = match step.kind {
            StepKind::Load => &[NEUTRAL],
            StepKind::Build => &RASTER[2..],
            StepKind::Raster | StepKind::Maps | StepKind::Effect => &RASTER[..2],
            StepKind::Rays => &RAYS[..2],
            StepKind::Quad => &RAYS[2..],
            // Copies and writing use a single thread, and get no curve.
            _ => continue,
        };
        // Steps that take less than 0.01 ms on at least one of the numbers of threads get no curve.
        if step.points.iter().any(|point| point.wall.median < 0.01) {
            continue;
        }
        let before = curves.iter().filter(|curve| inks.contains(&curve.ink)).count();
        let name = match step.kind {
            StepKind::Load | StepKind::Build => step.kind.name().to_owned(),
            kind => format!("{} {}", kind.name(), step.name),
        };
        curves.push(Curve { name, ink: inks[before % inks.len()], points: &step.points });
    }
    curves
}

/// Logarithmic axes: wall times as lines with marks, and processor times of all threads as dashed lines. The legend has the speed-up from the
/// fewest to the most threads. `None` without a point.
#[must_use]
pub fn threads_plot(case: &ThreadsCase) -> Option<Plot> {
    let curves = curves(case);
    let entries: Vec<Entry> = curves
        .iter()
        .enumerate()
        .map(|(index, curve)| {
            let most = curve.points.iter().max_by_key(|point| point.threads);
            let times = most.and_then(|most| speed_up(curve.points, most).map(|times| (most.threads, times)));
            let label = match times {
                Some((threads, times)) => format!("{} ({times:.1} on {threads})", curve.name),
                None => curve.name.clone(),
            };
            Entry { mark: Mark::of(index), ink: curve.ink, label }
        })
        .collect();
    let points = || curves.iter().flat_map(|curve| curve.points);
    let mut x = LogAxis::around(points().map(|point| point.threads as f64))?;
    x.ticks = points().map(|point| (point.threads as f64).log10()).collect();
    x.ticks.sort_by(f64::total_cmp);
    x.ticks.dedup();
    let processor = |point: &ThreadsPoint| point.processor.as_ref().map(|stats| stats.median);
    let y = LogAxis::around(points().flat_map(|point| [Some(point.wall.median), processor(point)]).flatten())?;
    let [width, height] = case.size;
    let title = format!("{}, {}, {width} x {height}: time against threads", case.label, case.view);
    draw(SIZE, &title, |root| {
        let (places, height) = lay_out(&entries, SIZE.0 as i32 - 80);
        legend(root, &entries, &places, (70, 8))?;
        let (_, body) = root.split_vertically(height + 10);
        let titles = ["threads", "time, ms: — on the wall, - - of all threads"];
        let mut chart = log_chart(&body, 28, [&x, &y], titles)?;
        for (curve, entry) in curves.iter().zip(&entries) {
            let color = entry.ink.color();
            let place = |threads: usize, ms: f64| ((threads as f64).log10(), ms.max(1e-9).log10());
            let wall: Vec<_> = curve.points.iter().map(|point| place(point.threads, point.wall.median)).collect();
            let all = curve.points.iter().filter_map(|point| Some(place(point.threads, processor(point)?)));
            chart.draw_series(DashedLineSeries::new(all, 4, 4, color.into()))?;
            chart.draw_series(LineSeries::new(wall.iter().copied(), color.stroke_width(2)))?;
            for place in wall {
                entry.mark.draw(root, chart.plotting_area().map_coordinate(&place), entry.ink)?;
            }
        }
        Ok(())
    })
}
