//! A small cache for resources that are costly to make.

use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// Greatest number of entries: the passes of one frame may have several sizes.
const KEPT: usize = 4;

/// A few values with their keys; the last used is last.
#[derive(Debug)]
pub struct Kept<K, V>(Vec<(K, V)>);

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq, V> Kept<K, V> {
    /// Finds or makes the value of `key`. Returns whether it was made; an older value may then have been dropped.
    pub fn require(
        &mut self,
        gpu: &Gpu,
        key: K,
        make: impl Fn(&K) -> Result<V, BackendError>,
    ) -> Result<(&V, bool), BackendError> {
        let (entry, made) = match self.0.iter().position(|(other, _)| *other == key) {
            Some(index) => (self.0.remove(index), false),
            None => {
                if self.0.len() == KEPT {
                    self.0.remove(0);
                }
                let value = match make(&key) {
                    // Memory may be full because of the kept values.
                    Err(BackendError::Device { .. }) if !self.0.is_empty() => {
                        self.0.clear();
                        gpu.submit_and_wait(None, "release of what other frames left")?;
                        make(&key)?
                    }
                    result => result?,
                };
                ((key, value), true)
            }
        };
        self.0.push(entry);
        Ok((&self.0[self.0.len() - 1].1, made))
    }

    /// The value that [`Self::require`] returned last; `None` if nothing is kept.
    pub fn last(&self) -> Option<&V> {
        self.0.last().map(|(_, value)| value)
    }

    /// All values.
    pub fn values(&self) -> impl Iterator<Item = &V> {
        self.0.iter().map(|(_, value)| value)
    }
}
