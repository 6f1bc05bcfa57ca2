//! A pyramid with the nearness of the nearest surface in every block of pixels.

use super::camera::{Piece, ScreenCamera};
use curitiba_pipeline::memory::{Refused, resize};
use rayon::prelude::*;

/// Nearness of blocks that show nothing.
pub const NOTHING: f32 = f32::MIN;

/// Greatest number of levels: enough for a picture of 32,768 pixels a side.
pub const MAX_LEVELS: usize = 16;

/// A level: blocks of `2^level` pixels a side; blocks at the right and bottom edges may have fewer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Level {
    /// Index of the first block.
    pub first: u32,
    /// Blocks a row.
    pub width: u32,
    /// Rows of blocks.
    pub height: u32,
    padding: u32,
}

/// The levels of a picture, from single pixels to one block, and the total number of blocks. `None` for pictures that
/// are too large.
#[must_use]
pub fn levels(width: u32, height: u32) -> Option<(Vec<Level>, usize)> {
    let mut levels = Vec::new();
    let (mut width, mut height, mut first) = (width.max(1), height.max(1), 0_u64);
    loop {
        levels.push(Level { first: u32::try_from(first).ok()?, width, height, padding: 0 });
        first += u64::from(width) * u64::from(height);
        if width.max(height) == 1 {
            break;
        }
        (width, height) = (width.div_ceil(2), height.div_ceil(2));
    }
    (levels.len() <= MAX_LEVELS).then_some((levels, usize::try_from(first).ok()?))
}

/// The greatest nearness in every block, from single pixels upwards. Keeps its memory from picture to picture.
#[derive(Debug, Default)]
pub struct Pyramid {
    levels: Vec<Level>,
    nearest: Vec<f32>,
}

impl Pyramid {
    /// Builds the pyramid of a G-buffer.
    ///
    /// # Errors
    /// If the picture is too large, or there is not enough memory: 16 bytes for every three pixels.
    pub fn build(
        &mut self,
        camera: &ScreenCamera,
        [width, height]: [u32; 2],
        position: &[[f32; 4]],
        normal: &[[f32; 4]],
    ) -> Result<(), Refused> {
        let Some((levels, blocks)) = levels(width, height) else {
            return Err(Refused { bytes: u64::MAX });
        };
        self.levels = levels;
        resize(&mut self.nearest, blocks, NOTHING)?;
        let (pixels, mut coarse) = self.nearest.split_at_mut(position.len());
        pixels.par_chunks_mut(width.max(1) as usize).enumerate().with_min_len(8).for_each(|(row, nearest)| {
            for (column, nearest) in (0u32..).zip(nearest) {
                let index = row * width as usize + column as usize;
                let piece = Piece::new(camera, position[index], normal[index]);
                *nearest = piece.map_or(NOTHING, |piece| piece.nearest(column, row as u32));
            }
        });
        let mut fine: &[f32] = pixels;
        for pair in self.levels.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let (here, rest) = coarse.split_at_mut(to.width as usize * to.height as usize);
            here.par_chunks_mut(to.width as usize).enumerate().with_min_len(32).for_each(|(row, blocks)| {
                let last = |index: usize, count: u32| (index).min(count as usize - 1);
                let rows = [2 * row, last(2 * row + 1, from.height)];
                for (column, nearest) in blocks.iter_mut().enumerate() {
                    let columns = [2 * column, last(2 * column + 1, from.width)];
                    let all = rows.iter().flat_map(|row| columns.map(|column| row * from.width as usize + column));
                    *nearest = all.map(|index| fine[index]).fold(NOTHING, f32::max);
                }
            });
            (fine, coarse) = (here, rest);
        }
        Ok(())
    }

    /// Gives every block the greatest nearness, so that marching skips nothing.
    #[cfg(test)]
    pub fn forget(&mut self) {
        self.nearest.fill(f32::MAX);
    }

    /// Number of levels.
    #[must_use]
    #[inline]
    pub fn depth(&self) -> u32 {
        self.levels.len() as u32
    }

    /// Nearness of the nearest surface in a block of a level.
    #[must_use]
    #[inline]
    pub fn nearest(&self, level: u32, column: u32, row: u32) -> f32 {
        let Level { first, width, .. } = self.levels[level as usize];
        self.nearest[first as usize + row as usize * width as usize + column as usize]
    }
}
