//! `final`: glass as in `refraction`, shadows and ambient occlusion, at pixels and at every hit.
//!
//! Glass that shadow rays pass dims light and does not occlude.

pub mod bodies;
pub mod corrected;
pub mod thesis;

#[cfg(test)]
mod tests;
