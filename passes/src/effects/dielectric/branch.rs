//! A branch of a path at a surface of glass.

use super::media::Media;
use crate::trace::Purpose;
use glam::Vec3;

/// One of the two continuations of a path at a surface: the reflected or the transmitted light.
#[derive(Clone, Copy)]
pub(super) struct Branch<K> {
    pub(super) purpose: Purpose,
    pub(super) direction: Vec3,
    /// Factor of the radiance along the branch, by colour.
    pub(super) weight: Vec3,
    pub(super) media: Media,
    /// The cone that leaves the surface.
    pub(super) cone: K,
}
