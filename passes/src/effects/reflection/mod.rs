//! `reflection`: a mirror in the place of glass. Other pixels keep their colour.
//!
//! A chain of mirror rays, at most `depth` glass hits long; black beyond, and where a ray leaves the scene.

pub mod corrected;
pub mod thesis;

#[cfg(test)]
mod tests;
