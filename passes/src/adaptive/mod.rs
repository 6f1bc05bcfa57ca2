//! Adaptive sampling of stochastic glass: each pixel gets as many paths as the error asked for requires.
//!
//! `rounds` decides how often pixels are sampled, with the help of `allocation`, which decides which pixels get more paths. Backends follow the paths
//! ([`FollowPaths`]); `listed` hands them to a device as the pixels of pictures. May use `effects` and `sampling`.

mod allocation;
mod listed;
mod rounds;

pub use allocation::Sampled;
pub use listed::{Sampling, sample_on_device};
pub use rounds::{FollowPaths, asked, each_path, sample, stochastic};
