//! The light that glass focuses in a pass.

use super::lenses::Lenses;
use super::photon_map::PhotonMap;

/// The light that glass focuses in a pass.
#[derive(Debug, Default)]
pub struct Focused {
    /// The exact spheres that focus light.
    pub lenses: Lenses,
    /// The photons that glass meshes have sent to surfaces.
    pub photons: PhotonMap,
}

impl Focused {
    /// Whether no glass focuses light.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lenses.is_empty() && self.photons.is_empty()
    }
}
