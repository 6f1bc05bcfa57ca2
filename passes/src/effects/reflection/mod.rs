//! `reflection`: glass pixels become mirrors. Other pixels keep their colour.
//!
//! A chain of mirror rays, at most `depth` glass hits long. It is black beyond that. Where a ray leaves the scene it shows
//! the background in `corrected`, and black in `thesis`.

pub mod corrected;
pub mod thesis;

#[cfg(test)]
mod tests;
