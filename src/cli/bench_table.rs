//! The table that `bench` prints row by row.

use anstyle::Style;
use curitiba::bench::model::{BenchFile, BenchRow, RowError};
use curitiba::bench::text::{self, mrays_per_second, ray_device_ms, reference};
use curitiba::pipeline::memory::mebibytes;

const HEADER: Style = Style::new().bold();

/// Columns of a line beside the labels.
const BESIDE_LABELS: usize = 158;

/// Prints rows as they are measured, and numbers their references.
pub struct Table {
    label: usize,
    references: Vec<String>,
    begun: bool,
    /// Whether the terminal has no room for all columns in a line.
    narrow: bool,
}

impl Table {
    /// Prints a header about the machine.
    pub fn new<'a>(labels: impl Iterator<Item = &'a str>, file: &BenchFile) -> Self {
        let machine = &file.environment;
        crate::say!(
            "{}, {} threads, {} build, commit {}; {} frames a row after {} of warm-up",
            machine.cpu,
            machine.threads,
            machine.profile,
            machine.commit,
            file.frames,
            file.warmup
        );
        if machine.profile == "debug" {
            crate::say!("this is no release build: times say little");
        }
        for fallback in &machine.fallbacks {
            crate::say!("{fallback}");
        }
        let label = labels.map(|label| label.chars().count()).max().unwrap_or(0).max(6);
        let narrow = super::width::of_terminal().is_some_and(|columns| columns < label + BESIDE_LABELS);
        Self { label, references: Vec::new(), begun: false, narrow }
    }

    /// Prints a row.
    pub fn print(&mut self, row: &BenchRow) {
        let width = self.label;
        if self.narrow {
            return self.print_narrow(row);
        }
        if !self.begun {
            self.begun = true;
            crate::say!(
                "{HEADER}{:width$}  {:8}  {:10}  {:>20}  {:>20}  {:>4}  {:>6}  {:>9}  {:>8}  {:>9}  {:>7}  {:>4}  {:>8}  {:>7}  {:>8}{HEADER:#}",
                "effect",
                "view",
                "engines",
                "ms: median ± sd",
                "min … max",
                "n",
                "% rays",
                "device ms",
                "Mrays/s",
                "RMSE",
                "FLIP",
                "ref",
                "picture",
                "FLIP",
                "ratio"
            );
        }
        let dash = || "-".to_owned();
        let (rmse, flip) = errors(row);
        let [picture, picture_flip] = text::picture_cells(row);
        let engines = engines(row);
        crate::say!(
            "{:width$}  {:8}  {engines:10}  {:>20}  {:>20}  {:>4}  {:>6}  {:>9}  {:>8}  {rmse:>9}  {flip:>7}  {:>4}  {picture:>8}  {picture_flip:>7}  {:>8}",
            row.label,
            row.view,
            format!("{:.2} ± {:.2}", row.frame.median, row.frame.sd),
            format!("{:.2} … {:.2}", row.frame.min, row.frame.max),
            row.frame.n(),
            row.ray_share.map_or_else(dash, |share| format!("{:.1}", share * 100.0)),
            ray_device_ms(row).map_or_else(dash, |ms| format!("{ms:.2}")),
            mrays_per_second(row).map_or_else(dash, |speed| format!("{speed:.1}")),
            format!("[{}]", self.number(reference(row))),
            row.thesis.as_ref().and_then(|thesis| thesis.ratio).map_or_else(dash, |ratio| format!("{ratio:.2}")),
        );
    }

    /// The same in a line of a narrow terminal: effect, view, engines, time and error.
    fn print_narrow(&mut self, row: &BenchRow) {
        let width = self.label;
        if !self.begun {
            self.begun = true;
            let header = ["view", "engines", "ms: median ± sd", "RMSE", "FLIP", "ref"];
            let [view, engines, ms, rmse, flip, reference] = header;
            crate::say!(
                "{HEADER}{:width$}  {view:8}  {engines:10}  {ms:>16}  {rmse:>9}  {flip:>7}  {reference:>4}{HEADER:#}",
                "effect"
            );
        }
        let (rmse, flip) = errors(row);
        let ms = format!("{:.2} ± {:.2}", row.frame.median, row.frame.sd);
        let (engines, number) = (engines(row), format!("[{}]", self.number(reference(row))));
        crate::say!("{:width$}  {:8}  {engines:10}  {ms:>16}  {rmse:>9}  {flip:>7}  {number:>4}", row.label, row.view);
    }

    fn number(&mut self, reference: &str) -> usize {
        let found = self.references.iter().position(|known| known == reference);
        found.unwrap_or_else(|| {
            self.references.push(reference.to_owned());
            self.references.len() - 1
        }) + 1
    }

    /// Prints the numbered references, the machine of the report's times, and the missing rows.
    pub fn end(&self, file: &BenchFile) {
        for (index, reference) in self.references.iter().enumerate() {
            crate::say!("[{}]  {reference}", index + 1);
        }
        if self.narrow {
            let most = self.label + BESIDE_LABELS;
            crate::say!("the other columns are in a terminal of {most} columns, and in --json, --csv and --markdown");
        }
        text::of_pictures(&file.rows).iter().for_each(|line| crate::say!("picture: {line}"));
        text::of_answers(&file.rows).iter().for_each(|line| crate::say!("{line}"));
        text::of_outliers(&file.rows).iter().for_each(|line| crate::say!("{line}"));
        if file.rows.iter().any(|row| ray_device_ms(row).is_some()) {
            crate::say!("device ms: the ray passes on the GPU's own clock, without copies; Mrays/s are of host time");
        }
        if let Some(thesis) = file.rows.iter().find_map(|row| row.thesis.as_ref()) {
            let ratios = if file.rows.iter().any(|row| row.thesis.as_ref().is_some_and(|t| t.ratio.is_some())) {
                format!("ratio: the report's time ({}) divided by ours", thesis.machine)
            } else {
                format!("no ratio to the report's times, which are of {}: the size differs", thesis.machine)
            };
            crate::say!("{ratios}");
        }
        if let Some(peak) = file.rows.iter().filter_map(|row| row.peak_memory_bytes).max() {
            crate::say!("peak memory {}", mebibytes(peak));
        }
        for missing in &file.unavailable {
            crate::say!("not measured: {}: {}", missing.what, missing.why);
        }
    }
}

/// Root mean square and FLIP error of the effect, or dashes.
fn errors(row: &BenchRow) -> (String, String) {
    match &row.error {
        RowError::Against { comparison, .. } => (format!("{:.2e}", comparison.rmse), format!("{:.4}", comparison.flip)),
        RowError::Missing(_) => ("-".to_owned(), "-".to_owned()),
    }
}

fn engines(row: &BenchRow) -> String {
    match &row.rays {
        Some(rays) => format!("{} + {}", row.raster.name, rays.name),
        None => row.raster.name.clone(),
    }
}
