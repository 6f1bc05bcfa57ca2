//! `deferredShadows`: the shadow of a directional light, 0.5 in shadow and 1 in light.
//!
//! Pixels whose light cosine (the position's `w`) is above 0 trace one shadow ray, or several to the points of the
//! light's disc. All other pixels are 1, because their colour is dark already.

pub mod corrected;
mod estimate;
mod light;
pub mod lights;
mod sides;
pub mod soft;
pub mod thesis;
mod tile;

pub use tile::Tile;

#[cfg(test)]
mod tests;
