//! A small cache for resources that are costly to make.

use super::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// Greatest number of entries: the passes of one frame may have several sizes or attachments.
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
    /// Finds or makes the value of `key`. Before a value is made, older values may be dropped. `release` is called before that, to drop
    /// whatever else holds them: a bind group, for example, keeps its textures in memory.
    pub fn require(
        &mut self,
        gpu: &Gpu,
        key: K,
        release: impl FnOnce(),
        make: impl Fn(&K) -> Result<V, BackendError>,
    ) -> Result<&V, BackendError> {
        let entry = match self.0.iter().position(|(other, _)| *other == key) {
            Some(index) => self.0.remove(index),
            None => {
                release();
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
                (key, value)
            }
        };
        self.0.push(entry);
        Ok(&self.0[self.0.len() - 1].1)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::gpu::faults::failure;
    use crate::raster::gpu::tests::rasteriser;
    use std::cell::{Cell, RefCell};
    use std::rc::{Rc, Weak};

    #[test]
    fn older_values_are_free_before_a_value_is_made() {
        let Some(rasteriser) = rasteriser() else { return };
        let mut kept = Kept::default();
        // All values that were made, and those that something else holds, as bind groups hold textures.
        let made: RefCell<Vec<Weak<u32>>> = RefCell::default();
        let held: RefCell<Vec<Rc<u32>>> = RefCell::default();
        let room = Cell::new(usize::MAX);
        let mut require = |key: u32| {
            let make = |key: &u32| {
                let alive = made.borrow().iter().filter(|value| value.strong_count() > 0).count();
                assert!(alive < KEPT, "{alive} values before another is made");
                if alive >= room.get() {
                    return Err(failure("memory is full"));
                }
                let value = Rc::new(*key);
                made.borrow_mut().push(Rc::downgrade(&value));
                Ok(value)
            };
            let value = kept.require(&rasteriser.gpu, key, || held.borrow_mut().clear(), make).expect("there is room");
            held.borrow_mut().push(Rc::clone(value));
            **value
        };
        for key in [0, 1, 2, 3, 0, 1, 2, 3, 4, 5, 6] {
            assert_eq!(require(key), key);
        }
        // A value that is kept is not made again.
        assert_eq!((require(3), made.borrow().len()), (3, 7));
        // There is room for one value, and four are kept.
        room.set(1);
        assert_eq!((require(9), made.borrow().len()), (9, 8));
        assert_eq!(kept.values().count(), 1);
    }
}
