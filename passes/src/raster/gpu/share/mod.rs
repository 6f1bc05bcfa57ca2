//! G-buffers in memory that another programming interface of the same device can read. Needs the feature `share` and a
//! system with file descriptors; otherwise no device shares memory.

#[cfg(not(all(feature = "share", unix)))]
mod absent;
#[cfg(all(feature = "share", unix))]
mod memory;
#[cfg(all(feature = "share", unix, test))]
mod tests;
#[cfg(all(feature = "share", unix))]
mod vulkan;

#[cfg(not(all(feature = "share", unix)))]
pub(super) use absent::{Sharing, hand_over, open, quad_source, uuid, wait_for_picture};
#[cfg(all(feature = "share", unix))]
pub(super) use memory::{Sharing, hand_over, quad_source, wait_for_picture};
#[cfg(all(feature = "share", unix))]
pub(super) use vulkan::{open, uuid};
