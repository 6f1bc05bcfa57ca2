//! The table of steps that every run prints.

use anstyle::{AnsiColor, Style};
use curitiba::pipeline::executor::{Row, StepKind, Timeline};

const HEADER: Style = Style::new().bold();
const TOTAL: Style = AnsiColor::Cyan.on_default();

/// Prints the steps, their times and their notes. With several frames the times are medians.
pub fn print(timeline: &Timeline, frames: u32) {
    let width = timeline.rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0).clamp(4, 44);
    let device = timeline.rows.iter().any(|row| !row.device_ms.is_empty());
    let device_header = if device { "  device ms" } else { "" };
    crate::say!(
        "{HEADER}{:9}  {:width$}  {:>10}{device_header}  {:>11}  {:>8}  note{HEADER:#}",
        "step",
        "name",
        "ms",
        "rays",
        "Mrays/s"
    );
    for row in &timeline.rows {
        print_row(row, width, device);
    }
    let frame: f64 = per_frame(timeline).map(Row::median_ms).sum();
    let rays: u64 = per_frame(timeline).filter_map(|row| row.rays).map(|rays| rays.total()).sum();
    let runs = if frames > 1 { format!("median of {frames} frames") } else { "one frame".to_owned() };
    let rays = if rays > 0 { format!(", {rays} rays") } else { String::new() };
    crate::say!("{TOTAL}frame {frame:.2} ms{TOTAL:#} ({runs}{rays})");
}

/// Prints rows of cells, the first as a header. Columns are as wide as their widest cell; from column `right` on they are
/// right-aligned.
pub fn print_aligned(rows: &[Vec<String>], right: usize) {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    for (index, row) in rows.iter().enumerate() {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, width))| {
            if column < right { format!("{cell:width$}") } else { format!("{cell:>width$}") }
        });
        let line = cells.collect::<Vec<_>>().join("  ");
        let line = line.trim_end();
        if index == 0 { crate::say!("{HEADER}{line}{HEADER:#}") } else { crate::say!("{line}") }
    }
}

fn per_frame(timeline: &Timeline) -> impl Iterator<Item = &Row> {
    timeline.rows.iter().filter(|row| row.kind.per_frame())
}

fn print_row(row: &Row, width: usize, device: bool) {
    let device_ms = match (device, row.device_ms.is_empty()) {
        (false, _) => String::new(),
        (true, true) => format!("  {:>9}", ""),
        (true, false) => format!("  {:>9.2}", curitiba::pipeline::executor::median(&row.device_ms)),
    };
    let rays = row.rays.map(|rays| rays.total().to_string()).unwrap_or_default();
    let speed = row.mrays_per_second().map(|speed| format!("{speed:.2}")).unwrap_or_default();
    let name = if row.kind == StepKind::Write { row.name.clone() } else { shorten(&row.name, width) };
    let line = format!(
        "{:9}  {name:width$}  {:>10.2}{device_ms}  {rays:>11}  {speed:>8}  {}",
        row.kind.name(),
        row.median_ms(),
        row.note
    );
    crate::say!("{}", line.trim_end());
}

/// Shortens a name from the left: its end is more informative than its beginning.
fn shorten(name: &str, width: usize) -> String {
    let length = name.chars().count();
    if length <= width {
        name.to_owned()
    } else {
        format!("…{}", name.chars().skip(length - width + 1).collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::shorten;

    #[test]
    fn long_names_keep_their_end() {
        assert_eq!(shorten("abcdef", 6), "abcdef");
        assert_eq!(shorten("abcdefg", 6), "…cdefg");
        assert_eq!(shorten("ãéíóúç…", 4), "…úç…".to_owned());
    }
}
