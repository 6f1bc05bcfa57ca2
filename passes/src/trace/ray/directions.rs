//! Directions of many rays from one origin, as vector code reads them.

use crate::trace::simd::{F16, WIDE, vector_at};
use glam::Vec3;

/// Unit directions, structure of arrays, in vectors of sixteen. It pays where those of one vector are neighbours.
#[derive(Debug, Clone, Default)]
pub struct Directions {
    /// What lies beyond the last direction is 0.
    pub(crate) vectors: Vec<[F16; 3]>,
    len: usize,
}

impl Directions {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Removes all.
    pub fn clear(&mut self) {
        self.vectors.clear();
        self.len = 0;
    }

    /// Adds one.
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

    /// Replaces all by `len` directions, whose vectors are returned to be filled; what lies beyond the last of them is set to
    /// 0 by [`Self::end`].
    pub(crate) fn begin(&mut self, len: usize) -> &mut [[F16; 3]] {
        self.len = len;
        self.vectors.resize(len.div_ceil(WIDE), [F16::ZERO; 3]);
        &mut self.vectors
    }

    /// Says that the vectors are filled.
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

    /// Them one by one.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        (0..self.len).map(|index| self.get(index))
    }

    /// Adds them to others.
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

    /// One of them.
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
