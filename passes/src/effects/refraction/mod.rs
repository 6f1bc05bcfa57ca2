//! `refraction`: glass that reflects and refracts. Other pixels keep their colour.
//!
//! One plane represents a whole pane: light always enters, the normal faces the ray, and the index is that of the pane.
//! Glass seen in glass splits the ray again, up to `depth` glass hits, black beyond.

pub mod corrected;
pub mod thesis;

#[cfg(test)]
mod tests;
