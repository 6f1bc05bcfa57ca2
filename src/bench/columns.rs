//! A merged benchmark as a table with a column for each machine.

use super::model::{BenchFile, BenchRow, RowError};
use super::text::median_and_interval;

/// The cells of the table, header first; all rows have the same length. A benchmark row that one machine measured twice gives two lines of the
/// table.
///
/// Columns: effect, view, engines, and for each machine the median with its 95 % interval (milliseconds) and the root mean
/// square error. Missing measurements are dashes.
#[must_use]
pub fn table(file: &BenchFile) -> Vec<Vec<String>> {
    let machines = file.machines.len().max(1);
    let mut header: Vec<String> = ["effect", "view", "engines"].map(str::to_owned).to_vec();
    for machine in 1..=machines {
        header.extend([format!("({machine}) ms: median (95 %)"), format!("({machine}) RMSE")]);
    }
    let mut table = vec![header];
    let mut rows = &file.rows[..];
    // In a merged file, rows with the same key are adjacent.
    while let Some(first) = rows.first() {
        let (same, rest) = rows.split_at(rows.iter().position(|row| row.key != first.key).unwrap_or(rows.len()));
        rows = rest;
        let of = |machine: usize| same.iter().filter(move |row| row.machine == machine);
        let lines = (0..machines).map(|machine| of(machine).count()).max().unwrap_or(0);
        for line in 0..lines {
            let found: Vec<Option<&BenchRow>> = (0..machines).map(|machine| of(machine).nth(line)).collect();
            let mut cells = vec![first.label.clone(), first.view.clone(), engines(&found)];
            cells.extend(found.iter().flat_map(|row| row.map_or(["-", "-"].map(str::to_owned), cells_of)));
            table.push(cells);
        }
    }
    table
}

/// The different engines of the rows, in the order of their machines.
fn engines(rows: &[Option<&BenchRow>]) -> String {
    let mut names: Vec<String> = Vec::new();
    for row in rows.iter().flatten() {
        let rays = row.rays.as_ref().map(|rays| format!(" + {}", rays.name)).unwrap_or_default();
        let name = row.raster.name.clone() + &rays;
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join("; ")
}

fn cells_of(row: &BenchRow) -> [String; 2] {
    let error = match &row.error {
        RowError::Against { comparison, .. } => format!("{:.2e}", comparison.rmse),
        RowError::Missing(_) => "-".to_owned(),
    };
    [median_and_interval(&row.frame), error]
}
