//! Rows with several samples a pixel.

use super::Told;
use super::collector::{Collector, Place};
use super::plan::{self, Entry, Stage};
use crate::bench::Case;
use crate::bench::model::BenchRow;
use crate::pipeline::executor::Observer;
use crate::pipeline::image::Image;

/// Measures the rows, then compares them with references as far as the time suffices. References come last, since each takes longer than its row.
pub(super) fn measure(collector: &mut Collector<'_>, told: &mut dyn FnMut(Told<'_>), observer: &mut dyn Observer) {
    let (projects, size) = (collector.request.projects.clone(), collector.request.wanted.size);
    let stage = Stage::PixelSamples;
    let place = Place { projects: &projects, size, triangles: None, lights: None, threads: None, stage };
    let mut measured: Vec<(Entry, Entry, Case, BenchRow, Image)> = Vec::new();
    for (single, several) in plan::pixel_samples(&collector.request.wanted) {
        match collector.row(&several, &place, told, observer) {
            Ok((case, row, picture)) => measured.push((single, several, case, row, picture)),
            Err(why) => collector.miss(&several.label, why),
        }
    }
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for (single, several, case, mut row, picture) in measured {
        collector.finish_row(&several, &case, &mut row, &picture, observer);
        let same = |(entry, _): &&(Entry, String)| {
            let of = |entry: &Entry| (entry.file, entry.panes, entry.set.clone(), entry.on_cpu, entry.beside);
            of(entry) == of(&single)
        };
        let first = collector.measured.iter().find(same).map(|(_, key)| key.clone()).unwrap_or_default();
        match groups.iter_mut().find(|(known, _)| *known == first) {
            Some((_, rows)) => rows.push(row.key.clone()),
            None => groups.push((first, vec![row.key.clone()])),
        }
        collector.file.rows.push(row);
    }
    let of_group = |(first, rows): (String, Vec<String>)| std::iter::once(first).chain(rows);
    collector.pixel_samples = groups.into_iter().flat_map(of_group).filter(|key| !key.is_empty()).collect();
}
