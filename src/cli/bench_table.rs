//! The table that `bench` prints row by row.

use super::width;
use anstyle::Style;
use curitiba::bench::model::{BenchFile, BenchRow, RowError};
use curitiba::bench::text::{self, mrays_per_second, ray_device_ms, reference};
use curitiba::pipeline::memory::mebibytes;

const HEADER: Style = Style::new().bold();

/// Width of a line with all columns, without label and view.
const BESIDE_LABELS: usize = 152;
/// Width of a line with engines, time and error, without label and view.
const BESIDE_LABELS_NARROW: usize = 66;

/// How rows are laid out, the same for all rows of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// All columns in one line.
    Wide,
    /// Label, view, engines, time and error in one line.
    Narrow,
    /// As [`Self::Narrow`], with label and view in a line of their own.
    Stacked,
}

/// Prints rows as they are measured, and numbers their references.
pub struct Table {
    /// Widths of the first two columns.
    label: usize,
    view: usize,
    layout: Layout,
    /// Columns of the terminal, if the output stream is one.
    columns: Option<usize>,
    references: Vec<String>,
    begun: bool,
}

impl Table {
    /// Prints a header about the machine. `rows` are label and view of each row.
    pub fn new<'a>(rows: impl Iterator<Item = [&'a str; 2]>, file: &BenchFile) -> Self {
        let table = Self::of(rows, width::of_terminal());
        print(&table.introduction(file));
        table
    }

    /// Prints a row.
    pub fn print(&mut self, row: &BenchRow) {
        print(&self.row(row));
    }

    /// Prints the numbered references, the machine of the report's times, and the missing rows.
    pub fn end(&self, file: &BenchFile) {
        print(&self.ending(file));
    }

    /// A table of rows with these labels and views, for a terminal with this number of columns.
    fn of<'a>(rows: impl Iterator<Item = [&'a str; 2]>, columns: Option<usize>) -> Self {
        let (mut label, mut view) = (6, 4);
        for [of_label, of_view] in rows {
            label = label.max(of_label.chars().count());
            view = view.max(of_view.chars().count());
        }
        let layout = match columns {
            Some(columns) if columns < label + view + BESIDE_LABELS_NARROW => Layout::Stacked,
            Some(columns) if columns < label + view + BESIDE_LABELS => Layout::Narrow,
            _ => Layout::Wide,
        };
        Self { label, view, layout, columns, references: Vec::new(), begun: false }
    }

    fn introduction(&self, file: &BenchFile) -> Vec<String> {
        let machine = &file.environment;
        let mut lines = self.prose(&format!(
            "{}, {} threads, {} build, commit {}; {}",
            machine.cpu,
            machine.threads,
            machine.profile,
            machine.commit,
            text::frames(file)
        ));
        if machine.profile == "debug" {
            lines.push("this is no release build: times say little".to_owned());
        }
        lines.extend(machine.fallbacks.iter().flat_map(|fallback| self.prose(fallback)));
        lines
    }

    /// Prose, folded to fit the terminal; commands that users may copy stay whole.
    fn prose(&self, text: &str) -> Vec<String> {
        let is_command = text.contains("curitiba ");
        width::folded(text, self.columns.filter(|_| !is_command))
    }

    /// The lines of a row, below those of the header if it is the first.
    fn row(&mut self, row: &BenchRow) -> Vec<String> {
        let begun = std::mem::replace(&mut self.begun, true);
        let header = if begun { Vec::new() } else { self.header() };
        let number = format!("[{}]", self.number(reference(row)));
        let cells = match self.layout {
            Layout::Wide => Vec::from(all_cells(row, &number)),
            Layout::Narrow | Layout::Stacked => Vec::from(few_cells(row, &number)),
        };
        header.into_iter().chain(self.line(&row.label, &row.view, &cells)).collect()
    }

    fn header(&self) -> Vec<String> {
        let names: Vec<String> = self.cells().iter().map(|(name, _)| (*name).to_owned()).collect();
        self.line("effect", "view", &names).into_iter().map(|line| format!("{HEADER}{line}{HEADER:#}")).collect()
    }

    /// Names and widths of the columns after label and view.
    fn cells(&self) -> &'static [(&'static str, usize)] {
        match self.layout {
            Layout::Wide => &WIDE,
            Layout::Narrow | Layout::Stacked => &NARROW,
        }
    }

    /// Label, view and cells in the lines of the layout.
    fn line(&self, label: &str, view: &str, cells: &[String]) -> Vec<String> {
        let mut line = match self.layout {
            Layout::Wide | Layout::Narrow => {
                format!("{label:label_width$}  {view:view_width$}", label_width = self.label, view_width = self.view)
            }
            Layout::Stacked => String::new(),
        };
        for (index, (cell, (_, width))) in cells.iter().zip(self.cells()).enumerate() {
            // The first column is text and left-aligned; the others are right-aligned.
            line += &if index == 0 { format!("  {cell:width$}") } else { format!("  {cell:>width$}") };
        }
        match self.layout {
            Layout::Wide | Layout::Narrow => vec![line],
            Layout::Stacked => {
                let mut lines = width::folded(&format!("{label}, {view}"), self.columns);
                lines.push(line);
                lines
            }
        }
    }

    fn number(&mut self, reference: &str) -> usize {
        let found = self.references.iter().position(|known| known == reference);
        found.unwrap_or_else(|| {
            self.references.push(reference.to_owned());
            self.references.len() - 1
        }) + 1
    }

    fn ending(&self, file: &BenchFile) -> Vec<String> {
        let mut lines: Vec<String> =
            self.references.iter().enumerate().map(|(index, of)| format!("[{}]  {of}", index + 1)).collect();
        let mut say = |text: &str| lines.extend(self.prose(text));
        if self.layout != Layout::Wide {
            let most = self.label + self.view + BESIDE_LABELS;
            say(&format!("the other columns are in a terminal of {most} columns, and in --json, --csv and --markdown"));
        }
        text::of_pictures(&file.rows).iter().for_each(|line| say(&format!("picture: {line}")));
        text::of_answers(&file.rows).iter().for_each(|line| say(line));
        text::of_outliers(&file.rows).iter().for_each(|line| say(line));
        if file.rows.iter().any(|row| ray_device_ms(row).is_some()) {
            say("device ms: the ray passes on the GPU's own clock, without copies; Mrays/s are of host time");
        }
        if let Some(thesis) = file.rows.iter().find_map(|row| row.thesis.as_ref()) {
            if file.rows.iter().any(|row| row.thesis.as_ref().is_some_and(|t| t.ratio.is_some())) {
                say(&format!("ratio: the report's time ({}) divided by ours", thesis.machine));
            } else {
                say(&format!("no ratio to the report's times, which are of {}: the size differs", thesis.machine));
            }
        }
        if let Some(peak) = file.rows.iter().filter_map(|row| row.peak_memory_bytes).max() {
            say(&format!("peak memory {}", mebibytes(peak)));
        }
        file.unavailable.iter().for_each(|missing| say(&format!("not measured: {}: {}", missing.what, missing.why)));
        lines
    }
}

fn print(lines: &[String]) {
    lines.iter().for_each(|line| crate::say!("{line}"));
}

/// Columns after label and view, with their widths.
const WIDE: [(&str, usize); 13] = [
    ("engines", 12),
    ("ms: median (95 %)", 22),
    ("min … max", 20),
    ("n", 4),
    ("% rays", 6),
    ("device ms", 9),
    ("Mrays/s", 8),
    ("RMSE", 9),
    ("FLIP", 7),
    ("ref", 4),
    ("picture", 8),
    ("FLIP", 7),
    ("ratio", 8),
];

/// Columns after label and view on narrow terminals.
const NARROW: [(&str, usize); 5] = [("engines", 12), ("ms: median (95 %)", 22), ("RMSE", 9), ("FLIP", 7), ("ref", 4)];

/// The cells of [`WIDE`].
fn all_cells(row: &BenchRow, number: &str) -> [String; 13] {
    let dash = || "-".to_owned();
    let [rmse, flip] = errors(row);
    let [picture, picture_flip] = text::picture_cells(row);
    [
        engines(row),
        text::median_and_interval(&row.frame),
        format!("{:.2} … {:.2}", row.frame.min, row.frame.max),
        row.frame.n().to_string(),
        row.ray_share.map_or_else(dash, |share| format!("{:.1}", share * 100.0)),
        ray_device_ms(row).map_or_else(dash, |ms| format!("{ms:.2}")),
        mrays_per_second(row).map_or_else(dash, |speed| format!("{speed:.1}")),
        rmse,
        flip,
        number.to_owned(),
        picture,
        picture_flip,
        row.thesis.as_ref().and_then(|thesis| thesis.ratio).map_or_else(dash, |ratio| format!("{ratio:.2}")),
    ]
}

/// The cells of [`NARROW`].
fn few_cells(row: &BenchRow, number: &str) -> [String; 5] {
    let [rmse, flip] = errors(row);
    [engines(row), text::median_and_interval(&row.frame), rmse, flip, number.to_owned()]
}

/// Root mean square and FLIP error of the effect, or dashes.
fn errors(row: &BenchRow) -> [String; 2] {
    match &row.error {
        RowError::Against { comparison, .. } => [format!("{:.2e}", comparison.rmse), format!("{:.4}", comparison.flip)],
        RowError::Missing(_) => ["-", "-"].map(str::to_owned),
    }
}

fn engines(row: &BenchRow) -> String {
    match &row.rays {
        Some(rays) => format!("{} + {}", row.raster.name, rays.name),
        None => row.raster.name.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba::Choice;
    use curitiba::bench::model::{EngineName, Stats};
    use curitiba::bench::{Case, MeasureOptions, measure};
    use curitiba::environment::Environment;
    use curitiba::pipeline::executor::Silent;
    use curitiba::pipeline::metrics::Comparison;
    use curitiba::pipeline::plan::Settings;
    use std::path::Path;

    /// A benchmark of two rows with these labels, one of them with an error.
    fn file(labels: [&str; 2]) -> BenchFile {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneNoEffects.xml");
        let case =
            Case::new(&path, Settings { size: Some([8, 8]), ..Settings::default() }, Choice::CPU).expect("valid");
        let plain = measure(&case, &MeasureOptions::default(), &mut Silent).expect("measured").row;
        let optix = EngineName { name: "optix".to_owned(), device: "a GPU".to_owned() };
        let against = RowError::Against {
            reference: "65536 rays a pixel in f64, the mean of two renders; not ten times below the row's error"
                .to_owned(),
            key: String::new(),
            own_error: 1e-4,
            comparison: Comparison {
                pixels: 64,
                rmse: 1e-12,
                relative_mse: 0.0,
                max: 0.5,
                psnr: 30.0,
                ssim: 1.0,
                flip: 0.5,
                energy_ratio: 1.0,
                outliers: 0.0,
            },
        };
        let slow = Stats::new(vec![12_345.678, 12_346.0, 12_347.0, 12_348.0, 99_999.0]);
        let slow = BenchRow { error: against.clone(), frame: slow.expect("samples"), ..plain.clone() };
        let slow = BenchRow { rays: Some(optix), picture_error: Some(against), label: labels[1].to_owned(), ..slow };
        let mut file = BenchFile::begin("curitiba bench".to_owned(), Environment::here(), 5, 1);
        file.environment.fallbacks.push("raster `auto` takes the cpu: there is no real GPU ".repeat(2));
        file.rows = vec![BenchRow { label: labels[0].to_owned(), ..plain }, slow];
        file.miss("optix", "there is no NVIDIA driver here: install driver 580 or newer, or use --backend cpu");
        file
    }

    /// All lines as a terminal with this number of columns shows them, without styles.
    fn shown(file: &BenchFile, columns: Option<usize>) -> (Layout, Vec<String>) {
        let mut table = Table::of(file.rows.iter().map(|row| [&*row.label, &*row.view]), columns);
        let mut lines = table.introduction(file);
        file.rows.iter().for_each(|row| lines.extend(table.row(row)));
        lines.extend(table.ending(file));
        let wrapped = lines.iter().flat_map(|line| width::wrapped(line, columns.unwrap_or(usize::MAX)));
        (table.layout, wrapped.map(|line| anstream::adapter::strip_str(&line).to_string()).collect())
    }

    fn widest(lines: &[String]) -> usize {
        lines.iter().map(|line| line.chars().count()).max().unwrap_or(0)
    }

    #[test]
    fn every_line_fits_80_columns() {
        let long = "reflection, planarReflection, planes=16, with a label that no terminal of eighty columns can hold";
        for (labels, layout) in [
            (["none", "shadows"], Layout::Narrow),
            (["none", "reflection, planarReflection"], Layout::Stacked),
            (["none", long], Layout::Stacked),
        ] {
            let file = file(labels);
            let (wide, whole) = shown(&file, None);
            assert!(wide == Layout::Wide && widest(&whole) > 150, "control: without a terminal lines are whole");
            let (found, lines) = shown(&file, Some(80));
            assert_eq!(found, layout, "{labels:?}");
            assert!(widest(&lines) <= 80, "{lines:#?}");
            let all = lines.join(" ");
            for word in ["12347 (", "optix", "1.00e-12", "[2]", "severe outliers:", "--backend"] {
                assert!(all.contains(word), "{word} is left out: {lines:#?}");
            }
        }
    }

    #[test]
    fn all_rows_of_a_table_are_laid_out_alike() {
        let (_, lines) = shown(&file(["none", "reflection, planarReflection"]), Some(80));
        for row in ["effect, view", "none, Fonte", "reflection, planarReflection, Fonte"] {
            let place = lines.iter().position(|line| line == row).unwrap_or_else(|| panic!("{row}: {lines:#?}"));
            assert!(lines[place + 1].starts_with("  "), "{lines:#?}");
        }
        let (layout, lines) = shown(&file(["none", "reflection, planarReflection"]), Some(200));
        assert_eq!(layout, Layout::Wide);
        assert!(lines.iter().any(|line| line.starts_with("none                          Fonte  cpu")), "{lines:#?}");
    }
}
