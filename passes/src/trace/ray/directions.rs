//! Directions of many rays from one origin, in the layout of vector code.

use crate::trace::simd::{F16, WIDE, vector_at};
use glam::Vec3;

/// Unit directions as a structure of arrays, in vectors of sixteen. Vector code is fastest where the directions of one vector are similar.
#[derive(Debug, Clone, Default)]
pub struct Directions {
    /// Lanes beyond the last direction hold 0.
    pub(crate) vectors: Vec<[F16; 3]>,
    len: usize,
}

impl Directions {
    /// Number of directions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no directions.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Removes all directions.
    pub fn clear(&mut self) {
        self.vectors.clear();
        self.len = 0;
    }

    /// Adds a direction.
    pub fn push(&mut self, direction: Vec3) {
        let lane = self.len % WIDE;
        if lane == 0 {
            self.vectors.push([F16::ZERO; 3]);
        }
        if let Some(vector) = self.vectors.last_mut() {
            for axis in 0..3 {
                vector[axis].0[lane] = direction[axis];
            }
        }
        self.len += 1;
    }

    /// Sets the number of directions to `len` and returns their vectors for the caller to fill. [`Self::end`] must follow; it sets the
    /// lanes beyond the last direction to 0.
    pub(crate) fn begin(&mut self, len: usize) -> &mut [[F16; 3]] {
        self.len = len;
        self.vectors.resize(len.div_ceil(WIDE), [F16::ZERO; 3]);
        &mut self.vectors
    }

    /// Ends filling: sets the lanes beyond the last direction to 0.
    pub(crate) fn end(&mut self) {
        let used = self.len % WIDE;
        if let Some(vector) = self.vectors.last_mut()
            && used > 0
        {
            for axis in vector {
                axis.0[used..].fill(0.0);
            }
        }
    }

    /// The directions one by one.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        (0..self.len).map(|index| self.get(index))
    }

    /// Appends the directions to a list.
    pub(crate) fn append_to(&self, others: &mut Vec<Vec3>) {
        let end = others.len() + self.len;
        for [x, y, z] in &self.vectors {
            let mut vector = [Vec3::ZERO; WIDE];
            for (lane, direction) in vector.iter_mut().enumerate() {
                *direction = Vec3::new(x.0[lane], y.0[lane], z.0[lane]);
            }
            others.extend_from_slice(&vector);
        }
        others.truncate(end);
    }

    /// The direction at an index.
    ///
    /// # Panics
    /// If there is no such direction.
    #[must_use]
    pub fn get(&self, index: usize) -> Vec3 {
        vector_at(&self.vectors[index / WIDE], index % WIDE)
    }
}

impl Extend<Vec3> for Directions {
    fn extend<I: IntoIterator<Item = Vec3>>(&mut self, directions: I) {
        for direction in directions {
            self.push(direction);
        }
    }
}
