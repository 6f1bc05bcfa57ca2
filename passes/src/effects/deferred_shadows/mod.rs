//! `deferredShadows`: shadows. For one directional light, a pixel is 0.5 in shadow, 1 in light, and in between where a part
//! of the light's disc is hidden.
//!
//! Only pixels whose light cosine (the position's `w`) is above 0 trace shadow rays: to the light, or to the points of its
//! disc. All other pixels are 1, because their colour is dark already.

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
