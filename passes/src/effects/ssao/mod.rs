//! `ssao`: ambient occlusion, the open share of the cosine-weighted hemisphere to the power of `intensity`.
//!
//! Traced by rays, not in screen space, despite its name. Everything occludes, glass included.

pub mod corrected;
pub mod thesis;

#[cfg(test)]
mod tests;
