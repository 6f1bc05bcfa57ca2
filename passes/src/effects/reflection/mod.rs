//! `reflection`: glass pixels become mirrors. Other pixels keep their colour.
//!
//! A chain of mirror rays, at most `depth` glass hits long. It is black beyond that, and where a ray leaves the scene.

pub mod corrected;
pub mod thesis;

#[cfg(test)]
mod tests;
