//! Reports: the cost and the error of each effect by raster and by rays on this machine, as a page that opens
//! from disk.
//!
//! [`collect`](collect::collect) carries out a [`plan`] and gives a [`model::ReportData`], from which the page is made. [`page`], [`plots`] and
//! [`summary`] are pure functions of these data, and render nothing.

pub mod collect;
mod collector;
pub mod folder;
mod graph;
mod lights;
pub mod model;
pub mod number;
pub mod page;
mod paired;
mod pixel_samples;
pub mod plan;
pub mod plots;
mod scale;
pub mod summary;
#[cfg(test)]
mod tests;
pub mod verdict;

pub use collector::{PROJECTS, ReportError, Request};
pub use plan::Wanted;

use crate::pipeline::executor::Observer;
use folder::{Folder, FolderError};
use std::path::{Path, PathBuf};

/// Progress: the row that is measured next.
#[derive(Debug, Clone, Copy)]
pub struct Told<'a> {
    /// Label of the row.
    pub label: &'a str,
    /// Number of rows that are done.
    pub done: usize,
    /// Number of all rows.
    pub of: usize,
    /// Time spent and allowed.
    pub time: plan::TimePlan,
}

/// Measures, builds the page and writes the folder, which appears only when it is complete.
///
/// # Errors
/// If the folder holds something else, no row can be measured, or files cannot be written.
pub fn make(
    request: &Request,
    target: &Path,
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Result<(PathBuf, model::ReportData), ReportError> {
    let folder = Folder::begin(target)?;
    let data = collect::collect(request, &folder, told, observer)?;
    write(&data, &folder)?;
    Ok((folder.finish()?, data))
}

/// Writes the page, the plots and the data.
fn write(data: &model::ReportData, folder: &Folder) -> Result<(), FolderError> {
    let page = page::build(data);
    for (name, svg) in &page.plots {
        folder.write(&format!("plots/{name}"), svg.as_bytes())?;
    }
    let json = serde_json::to_string_pretty(&data.bench)
        .map_err(|error| FolderError::Io { path: folder.path().join("data.json"), error: error.into() })?;
    folder.write("data.json", json.as_bytes())?;
    folder.write("data.csv", crate::bench::text::csv(&data.bench).as_bytes())?;
    folder.write("data.md", crate::bench::text::markdown(&data.bench).as_bytes())?;
    // The page is written last: a folder without it is no report.
    folder.write("index.html", page.html.as_bytes())
}
