//! `deferredShadows`: the shadow of a directional light, 0.5 in shadow and 1 in light.
//!
//! One shadow ray, or as many as go to the light's disc, for each pixel whose light cosine (the position's `w`) is above 0; the others are 1, for they are dark
//! already.

pub mod corrected;
mod estimate;
mod light;
mod sides;
pub mod soft;
pub mod thesis;
mod tile;

pub use tile::Tile;

#[cfg(test)]
mod tests;
