//! What is costly to make and stays for the next frame.

use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// How many of a kind are kept: passes of one frame may have several sizes.
const KEPT: usize = 4;

/// A few things by what they were made for; the one used last is last.
#[derive(Debug)]
pub struct Kept<K, V>(Vec<(K, V)>);

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq, V> Kept<K, V> {
    /// Finds or makes what belongs to `key`; `true` if it was made, and something else may be gone.
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
                    // The others may be what fills the memory.
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

    /// What was required last.
    pub fn last(&self) -> Option<&V> {
        self.0.last().map(|(_, value)| value)
    }

    /// What is kept.
    pub fn values(&self) -> impl Iterator<Item = &V> {
        self.0.iter().map(|(_, value)| value)
    }
}
