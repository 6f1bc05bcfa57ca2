//! Reports: what each effect costs by raster and by rays on this machine, and what error each has, as a page that opens
//! from disk.
//!
//! [`model::ReportData`] is all that a page is made from. [`page`], [`plots`] and [`summary`] are pure functions of it;
//! nothing there renders.

pub mod folder;
pub mod model;
pub mod number;
pub mod page;
pub mod plots;
pub mod summary;
#[cfg(test)]
mod tests;
