//! Table 2 of the report of 2014, called the report below: its rows, its figures, and the corresponding projects.

use super::case::Case;
use super::model::{BenchRow, ThesisFigure};
use crate::pipeline::plan::Settings;
use crate::{Choice, OpenError};
use std::path::Path;

/// The report's machine.
pub const MACHINE: &str = "GeForce GTX 780M laptop, OptiX 3.0.1, January 2014";

/// Size of the report's frames in pixels.
pub const SIZE: [u32; 2] = [1024, 1024];

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableRow {
    /// Label in the report.
    pub label: &'static str,
    /// View: `Fonte` or `Vidro`.
    pub view: &'static str,
    /// Project file.
    pub project: &'static str,
    /// Occlusion samples of the project's pass `pass2`, if the row sets them.
    pub samples: Option<u32>,
    /// The report's time per frame, milliseconds.
    pub frame_ms: f64,
    /// The report's percentage of the frame time in the ray pass; `None` if the report does not give it.
    pub ray_percent: Option<f64>,
}

const fn row(
    label: &'static str,
    view: &'static str,
    project: &'static str,
    samples: Option<u32>,
    frame_ms: f64,
    ray_percent: f64,
) -> TableRow {
    TableRow { label, view, project, samples, frame_ms, ray_percent: Some(ray_percent) }
}

const fn occlusion(label: &'static str, samples: u32, frame_ms: f64, ray_percent: f64) -> TableRow {
    row(label, "Fonte", "SceneSSAO.xml", Some(samples), frame_ms, ray_percent)
}

/// The rows of the table.
pub const ROWS: [TableRow; 19] = [
    TableRow {
        label: "no effects",
        view: "Fonte",
        project: "SceneNoEffects.xml",
        samples: None,
        frame_ms: 0.87,
        ray_percent: None,
    },
    row("no effects, through the ray pass", "Fonte", "SceneDummy.xml", None, 5.33, 81.0),
    row("shadows", "Fonte", "SceneShadows.xml", None, 11.77, 93.7),
    row("reflection", "Fonte", "SceneReflect.xml", None, 7.16, 86.0),
    row("reflection", "Vidro", "SceneReflect.xml", None, 15.61, 95.3),
    row("refraction", "Fonte", "SceneRefract.xml", None, 9.4, 89.1),
    row("refraction", "Vidro", "SceneRefract.xml", None, 23.42, 96.8),
    occlusion("AO, 1 sample", 1, 11.68, 91.8),
    occlusion("AO, 4 samples", 4, 33.18, 96.8),
    occlusion("AO, 9 samples", 9, 66.05, 98.3),
    occlusion("AO, 16 samples", 16, 109.20, 98.9),
    occlusion("AO, 25 samples", 25, 165.37, 99.3),
    occlusion("AO, 36 samples", 36, 231.86, 99.5),
    occlusion("AO, 49 samples", 49, 309.13, 99.6),
    occlusion("AO, 64 samples", 64, 397.88, 99.7),
    occlusion("AO, 81 samples", 81, 497.68, 99.7),
    occlusion("AO, 100 samples", 100, 607.87, 99.8),
    row("all but AO", "Fonte", "SceneFinal.xml", Some(0), 17.93, 94.5),
    row("all", "Fonte", "SceneFinal.xml", Some(100), 759.74, 99.8),
];

impl TableRow {
    /// The case that measures this row with the project in the folder `projects`. The row's number of samples and view replace those of `settings`.
    ///
    /// # Errors
    /// As [`Case::new`].
    pub fn case(&self, projects: &Path, settings: &Settings, choice: Choice) -> Result<Case, OpenError> {
        let mut settings = settings.clone();
        settings.set.extend(self.samples.map(|samples| format!("pass2.samples={samples}")));
        if self.view != "Fonte" {
            settings.camera = Some(self.view.to_owned());
        }
        let case = Case::new(&projects.join(self.project), settings, choice)?;
        Ok(Case { label: self.label.to_owned(), view: self.view.to_owned(), ..case })
    }

    /// The report's figure for a measured row.
    #[must_use]
    pub fn figure(&self, measured: &BenchRow) -> ThesisFigure {
        ThesisFigure {
            frame_ms: self.frame_ms,
            ray_percent: self.ray_percent,
            machine: format!("{MACHINE}, {} x {}", SIZE[0], SIZE[1]),
            ratio: (measured.size == SIZE).then(|| self.frame_ms / measured.frame.median.max(1e-9)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    #[test]
    fn every_row_is_a_project_that_computes_what_its_label_says() {
        let projects = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("xml_projects");
        let mut keys = Vec::new();
        for row in ROWS {
            let case = row.case(&projects, &Settings::default(), Choice::default()).expect("the project is valid");
            let plain = Case::new(&case.project, case.settings.clone(), case.choice).expect("valid");
            // The report's label `all` does not name its 100 samples.
            assert_eq!(case.label, if row.label == "all" { "all" } else { &plain.label });
            assert_eq!(case.view, plain.view);
            keys.push(case.key);
        }
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 19, "two rows are the same");
    }

    #[test]
    fn joining_the_two_systems_costs_what_the_report_says() {
        assert!((ROWS[1].frame_ms - ROWS[0].frame_ms - 4.46).abs() < 1e-9);
        assert!(ROWS[18].frame_ms > ROWS[16].frame_ms + ROWS[17].frame_ms, "all costs more than its parts");
    }
}
