//! Decoded textures with mip levels, and the one definition of how they are filtered.
//!
//! Texels are used as stored: no colour management, as in the report's engine. `v = 0` is the bottom row, coordinates
//! repeat, filtering is bilinear within a level and linear between two.

use glam::{Vec2, Vec4};

/// One mip level: rows from the top, RGBA, 8 bits a channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Level {
    /// Texels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` texels, top row first.
    pub texels: Vec<[u8; 4]>,
}

impl Level {
    /// A texel with repeating coordinates, in 0..=1.
    #[inline]
    fn texel(&self, x: i64, y: i64) -> Vec4 {
        let x = x.rem_euclid(i64::from(self.width)) as usize;
        let y = y.rem_euclid(i64::from(self.height)) as usize;
        let texel = self.texels[y * self.width as usize + x];
        Vec4::from_array(texel.map(f32::from)) / 255.0
    }

    /// Bilinear filtering at `uv`. Non-finite coordinates read the first texel.
    #[must_use]
    #[inline]
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        if !uv.is_finite() {
            return self.texel(0, 0);
        }
        // The fractional part first: large coordinates would lose the sub-texel position otherwise.
        let x = (uv.x - uv.x.floor()) * self.width as f32 - 0.5;
        let y = (1.0 - (uv.y - uv.y.floor())) * self.height as f32 - 0.5;
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let (left, top) = (left as i64, top as i64);
        let upper = self.texel(left, top).lerp(self.texel(left + 1, top), fx);
        let lower = self.texel(left, top + 1).lerp(self.texel(left + 1, top + 1), fx);
        upper.lerp(lower, fy)
    }
}

/// A texture and its mip levels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// Name for messages.
    pub name: String,
    /// Level 0 is the image; each next one halves both sides (rounded down, at least 1) down to 1 x 1.
    pub levels: Vec<Level>,
}

impl Texture {
    /// Builds the mip chain of an image by 2 x 2 box filtering (rounded to nearest).
    ///
    /// # Panics
    /// If the image is empty or `texels` does not match its size.
    #[must_use]
    pub fn new(name: String, width: u32, height: u32, texels: Vec<[u8; 4]>) -> Self {
        assert!(width > 0 && height > 0, "texture {name} is empty");
        assert_eq!(texels.len(), width as usize * height as usize, "texture {name}: texel count");
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last().filter(|level| level.width > 1 || level.height > 1) {
            levels.push(halve(last));
        }
        Self { name, levels }
    }

    /// Trilinear filtering at a level of detail; `lod <= 0` reads level 0.
    #[must_use]
    #[inline]
    pub fn sample(&self, uv: Vec2, lod: f32) -> Vec4 {
        let last = self.levels.len() - 1;
        let lod = lod.clamp(0.0, last as f32);
        let fine = lod as usize;
        let blend = lod - fine as f32;
        let color = self.levels[fine].sample(uv);
        if blend == 0.0 { color } else { color.lerp(self.levels[fine + 1].sample(uv), blend) }
    }

    /// Level of detail for the derivatives of the texture coordinates along the screen's x and y (in pixels):
    /// `log2` of the longer footprint side in texels of level 0 (Vulkan 1.3, section 16.5.7).
    #[must_use]
    #[inline]
    pub fn lod(&self, duv_dx: Vec2, duv_dy: Vec2) -> f32 {
        let size = Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32);
        let footprint = (duv_dx * size).length_squared().max((duv_dy * size).length_squared());
        // NaN and zero footprints read level 0.
        if footprint > 1.0 { 0.5 * footprint.log2() } else { 0.0 }
    }
}

fn halve(level: &Level) -> Level {
    let (width, height) = ((level.width / 2).max(1), (level.height / 2).max(1));
    let mut texels = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let (x0, y0) = ((2 * x).min(level.width - 1), (2 * y).min(level.height - 1));
            let (x1, y1) = ((x0 + 1).min(level.width - 1), (y0 + 1).min(level.height - 1));
            let at = |x: u32, y: u32| level.texels[y as usize * level.width as usize + x as usize];
            let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
            texels.push(std::array::from_fn(|channel| {
                let sum = u32::from(a[channel]) + u32::from(b[channel]) + u32::from(c[channel]) + u32::from(d[channel]);
                ((sum + 2) / 4) as u8
            }));
        }
    }
    Level { width, height, texels }
}
