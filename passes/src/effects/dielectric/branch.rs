//! Ways on from a surface of glass.

use super::media::Media;
use crate::trace::Purpose;
use glam::Vec3;

/// One of the two ways on from a surface: reflected, or through it.
#[derive(Clone, Copy)]
pub(super) struct Branch<K> {
    pub(super) purpose: Purpose,
    pub(super) direction: Vec3,
    /// Factor of its radiance, by colour.
    pub(super) weight: Vec3,
    pub(super) media: Media,
    /// The cone that leaves the surface.
    pub(super) cone: K,
}
