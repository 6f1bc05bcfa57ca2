//! Decoded textures with mip levels, and the reference definition of their filtering.
//!
//! Texels are used as stored, as in the report's engine, or their colours are decoded from sRGB before filtering
//! ([`Texture::space`]). `v = 0` is the bottom row, coordinates repeat unless [`Texture::sampling`] has another wrap mode, and
//! filtering is trilinear: bilinear within a mip level, linear between two levels. Where the texture is magnified,
//! [`Texture::sampling`] may select the nearest texel instead.

use crate::color::{self, ColorSpace, DECODED};
use glam::{Vec2, Vec4};
use rayon::prelude::*;

/// Least number of texels per task.
const MIN_TEXELS: usize = 1 << 14;

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
    /// The value of a texel in 0..=1; with `DECODE` its colours are decoded from sRGB.
    #[inline(always)]
    fn texel<const DECODE: bool>(&self, x: usize, y: usize) -> Vec4 {
        let texel = self.texels[y * self.width as usize + x];
        if DECODE {
            let [r, g, b] = [0, 1, 2].map(|channel: usize| DECODED[usize::from(texel[channel])]);
            return Vec4::new(r, g, b, f32::from(texel[3]) / 255.0);
        }
        Vec4::from_array(texel.map(f32::from)) / 255.0
    }

    /// Samples the stored texels bilinearly at `uv`. Coordinates that are not finite read the first texel. Always inlined, so that
    /// it is compiled for the instruction set of the rasteriser.
    #[must_use]
    #[inline(always)]
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        self.sample_at::<false>(Place::of(uv))
    }

    #[inline(always)]
    fn sample_at<const DECODE: bool>(&self, place: Place) -> Vec4 {
        self.sample_in::<DECODE>(place, around, around)
    }

    #[inline(always)]
    fn sample_in<const DECODE: bool>(
        &self,
        Place { right, down }: Place,
        across: impl Fn(f32, u32) -> ([usize; 2], f32),
        along: impl Fn(f32, u32) -> ([usize; 2], f32),
    ) -> Vec4 {
        if right.is_nan() {
            return self.texel::<DECODE>(0, 0);
        }
        let ([left, right], fx) = across(right * self.width as f32 - 0.5, self.width);
        let ([top, bottom], fy) = along(down * self.height as f32 - 0.5, self.height);
        let upper = self.texel::<DECODE>(left, top).lerp(self.texel::<DECODE>(right, top), fx);
        let lower = self.texel::<DECODE>(left, bottom).lerp(self.texel::<DECODE>(right, bottom), fx);
        upper.lerp(lower, fy)
    }
}

/// Wrap mode: what texture coordinates outside 0 to 1 read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// The texture repeats, every second copy mirrored.
    Mirror,
    /// The edge texels are extended.
    Clamp,
}

impl Wrap {
    /// Maps a coordinate into the texture, 0..=1.
    #[inline]
    fn share(self, value: f32) -> f32 {
        match self {
            Self::Repeat => fraction(value),
            Self::Mirror => {
                let twice = 2.0 * fraction(0.5 * value);
                if twice > 1.0 { 2.0 - twice } else { twice }
            }
            Self::Clamp => value.clamp(0.0, 1.0),
        }
    }

    /// [`around`] for any wrap mode: modes other than `Repeat` read the edge texel again beyond the edge.
    #[inline]
    fn around(self, place: f32, count: u32) -> ([usize; 2], f32) {
        let ([before, after], share) = around(place, count);
        match self {
            Self::Repeat => ([before, after], share),
            _ if place < 0.0 => ([0, 0], share),
            _ => ([before, after.max(before)], share),
        }
    }
}

/// What a lookup reads where the texture is magnified: at a level of detail of 0 or below, where a texel is as large as a pixel or larger.
/// Lookups that have no level of detail, such as those of alpha tests, read level 0 and count as magnified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Magnification {
    /// The four texels around the point, blended.
    #[default]
    Linear,
    /// The texel that holds the point: after wrapping, the floor of the coordinate times the size.
    Nearest,
}

/// How a texture is read, as given by the samplers of scene files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sampling {
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// What a lookup reads where the texture is magnified.
    pub magnification: Magnification,
}

impl Sampling {
    /// Trilinear filtering with these wrap modes along u and v.
    #[must_use]
    pub fn wrapped(wrap: [Wrap; 2]) -> Self {
        Self { wrap, ..Self::default() }
    }

    /// Whether the nearest texel is read where the texture is magnified.
    #[must_use]
    #[inline(always)]
    pub fn is_nearest(self) -> bool {
        self.magnification == Magnification::Nearest
    }
}

/// Position in a texture, as fractions of its sides, 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Fraction from the left; NaN if the coordinates are not finite.
    pub right: f32,
    /// Fraction from the top row.
    pub down: f32,
}

impl Place {
    /// The position of `uv` in a texture that repeats. Free of branches, so that loops over many coordinates are vectorised.
    #[must_use]
    #[inline(always)]
    pub fn of(uv: Vec2) -> Self {
        // The fractional part is taken first; multiplied by the size, large coordinates would lose their sub-texel position.
        let right = if uv.is_finite() { fraction(uv.x) } else { f32::NAN };
        Self { right, down: 1.0 - fraction(uv.y) }
    }
}

/// `value - value.floor()`, in 0..=1. Without SSE4.1 `floor` would be a function call.
#[inline(always)]
fn fraction(value: f32) -> f32 {
    // All `f32` numbers from here on are whole.
    const WHOLE: f32 = 8_388_608.0;
    let truncated = value as i32 as f32;
    let fraction = value - if truncated > value { truncated - 1.0 } else { truncated };
    if value.abs() >= WHOLE { 0.0 } else { fraction }
}

/// Base-2 logarithm of a positive, normal number, within 0.5001 units in the last place. The standard library's result differs in
/// the last bit between platforms; this one uses only operations that IEEE 754 rounds the same everywhere. Free of branches, as
/// [`Place::of`].
#[inline(always)]
fn log2(value: f32) -> f32 {
    // value = 2^exponent m, with m between sqrt(1/2) and sqrt(2).
    const ROOT_OF_HALF: u32 = 0x3f35_04f3;
    let exponent = value.to_bits().wrapping_sub(ROOT_OF_HALF).cast_signed() >> 23;
    let m = f64::from(f32::from_bits(value.to_bits().wrapping_sub((exponent << 23).cast_unsigned())));
    // ln m = 2 artanh t = 2 (t + t^3 / 3 + t^5 / 5 + ...); the omitted terms are below 4e-14 of the sum.
    let t = (m - 1.0) / (m + 1.0);
    let square = t * t;
    let series = [1.0 / 13.0, 1.0 / 11.0, 1.0 / 9.0, 1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0, 1.0];
    let sum = series.iter().fold(1.0 / 15.0, |sum, term| sum * square + term);
    (f64::from(exponent) + 2.0 * std::f64::consts::LOG2_E * t * sum) as f32
}

/// The two texels of a row or column of `count` that a position between -0.5 and `count - 0.5` lies between, with repetition, and
/// the weight of the second.
#[inline(always)]
fn around(place: f32, count: u32) -> ([usize; 2], f32) {
    let last = count as usize - 1;
    if place < 0.0 {
        return ([last, 0], place + 1.0);
    }
    let before = (place as usize).min(last);
    ([before, if before == last { 0 } else { before + 1 }], place - before as f32)
}

/// A texture and its mip levels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// Name for messages.
    pub name: String,
    /// Level 0 is the image; each next one halves both sides (rounded down, at least 1) down to 1 x 1.
    pub levels: Vec<Level>,
    /// Wrap modes, and the magnification mode.
    pub sampling: Sampling,
    /// How colours are read: as stored, or decoded from sRGB. Alpha is always read as stored.
    pub space: ColorSpace,
}

impl Texture {
    /// The texture with other wrap modes.
    #[must_use]
    pub fn wrapped(self, wrap: [Wrap; 2]) -> Self {
        Self { sampling: Sampling { wrap, ..self.sampling }, ..self }
    }

    /// The texture with another magnification mode.
    #[must_use]
    pub fn magnified(self, magnification: Magnification) -> Self {
        Self { sampling: Sampling { magnification, ..self.sampling }, ..self }
    }

    /// Whether the texture repeats along both axes.
    #[must_use]
    #[inline(always)]
    pub fn repeats(&self) -> bool {
        self.sampling.wrap == [Wrap::Repeat; 2]
    }

    /// The position of `uv` in the texture, by its wrap modes.
    #[must_use]
    #[inline(always)]
    pub fn place(&self, uv: Vec2) -> Place {
        if self.repeats() || !uv.is_finite() {
            return Place::of(uv);
        }
        let [across, along] = self.sampling.wrap;
        Place { right: across.share(uv.x), down: 1.0 - along.share(uv.y) }
    }

    /// Builds the mip chain of an image by 2 x 2 box filtering of the stored values, rounded to nearest.
    ///
    /// # Panics
    /// If the image is empty or `texels` does not match its size.
    #[must_use]
    pub fn new(name: String, width: u32, height: u32, texels: Vec<[u8; 4]>) -> Self {
        Self::build(name, Level { width, height, texels }, false, ColorSpace::Report)
    }

    /// Builds the mip chain of an image: as [`Self::cut_out`] if `cut_out` is set, otherwise as [`Self::new`]. With
    /// [`ColorSpace::Linear`] colours are averaged in linear light and stored in sRGB again.
    ///
    /// # Panics
    /// As [`Self::new`].
    #[must_use]
    pub fn build(name: String, base: Level, cut_out: bool, space: ColorSpace) -> Self {
        let Level { width, height, .. } = base;
        assert!(width > 0 && height > 0, "texture {name} is empty");
        assert_eq!(base.texels.len(), width as usize * height as usize, "texture {name}: texel count");
        let levels = match (cut_out, space) {
            (false, ColorSpace::Report) => chain(base, mean),
            (false, ColorSpace::Linear) => chain(base, linear_mean),
            (true, ColorSpace::Report) => chain(base, mean_by_alpha),
            (true, ColorSpace::Linear) => chain(base, linear_mean_by_alpha),
        };
        Self { name, levels, sampling: Sampling::default(), space }
    }

    /// Builds the mip chain of a texture with holes where its alpha is low. Alpha tests read level 0 only, for cameras and rays
    /// alike. Colours are averaged with their alpha as weight, so that the colours stored in holes do not bleed into the edges.
    ///
    /// # Panics
    /// If the image is empty or `texels` does not match its size.
    #[must_use]
    pub fn cut_out(name: String, width: u32, height: u32, texels: Vec<[u8; 4]>) -> Self {
        Self::build(name, Level { width, height, texels }, true, ColorSpace::Report)
    }

    /// Samples trilinearly at a level of detail. `lod <= 0` reads level 0, or with [`Magnification::Nearest`] a single texel of it.
    #[must_use]
    #[inline(always)]
    pub fn sample(&self, uv: Vec2, lod: f32) -> Vec4 {
        self.sample_at(self.place(uv), lod)
    }

    /// [`Self::sample`] at a position found by [`Self::place`].
    #[must_use]
    #[inline(always)]
    pub fn sample_at(&self, place: Place, lod: f32) -> Vec4 {
        let last = self.levels.len() - 1;
        let lod = lod.clamp(0.0, last as f32);
        let fine = lod as usize;
        let blend = lod - fine as f32;
        let sample = |level: &Level| match self.space {
            ColorSpace::Report => self.sample_level::<false>(level, place, lod),
            ColorSpace::Linear => self.sample_level::<true>(level, place, lod),
        };
        let color = sample(&self.levels[fine]);
        if blend == 0.0 { color } else { color.lerp(sample(&self.levels[fine + 1]), blend) }
    }

    #[inline(always)]
    fn sample_level<const DECODE: bool>(&self, level: &Level, place: Place, lod: f32) -> Vec4 {
        if self.sampling == Sampling::default() {
            return level.sample_at::<DECODE>(place);
        }
        let nearest = self.sampling.is_nearest() && lod == 0.0;
        // A whole position gives one texel all of the weight. A position is the coordinate times the size, less half a texel.
        let axis = |wrap: Wrap| move |at: f32, count| wrap.around(if nearest { (at + 0.5).floor() } else { at }, count);
        let [u, v] = self.sampling.wrap;
        level.sample_in::<DECODE>(place, axis(u), axis(v))
    }

    /// Width and height of level 0 in texels.
    #[must_use]
    #[inline(always)]
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32)
    }
}

/// Level of detail from the derivatives of the texture coordinates along the screen's x and y (per pixel): `log2` of the longer
/// side of the footprint, in texels of level 0 of a texture of the given size (Vulkan 1.3, section 16.5.7). Free of branches, as
/// [`Place::of`].
#[must_use]
#[inline(always)]
pub fn lod(size: Vec2, duv_dx: Vec2, duv_dy: Vec2) -> f32 {
    let footprint = (duv_dx * size).length_squared().max((duv_dy * size).length_squared());
    // NaN and zero footprints read level 0.
    if footprint > 1.0 { 0.5 * log2(footprint) } else { 0.0 }
}

/// Level of detail for a lookup that covers this area, in square texels of level 0: `log2` of the side of a square of that area. It is 0 for
/// areas of up to 1, and where the area is not a number.
#[must_use]
#[inline(always)]
pub fn lod_of_area(area: f32) -> f32 {
    if area > 1.0 { 0.5 * log2(area) } else { 0.0 }
}

fn chain(base: Level, mean: impl Fn([[u8; 4]; 4]) -> [u8; 4] + Sync) -> Vec<Level> {
    let mut levels = vec![base];
    while let Some(last) = levels.last().filter(|level| level.width > 1 || level.height > 1) {
        levels.push(halve(last, &mean));
    }
    levels
}

fn halve(level: &Level, mean: impl Fn([[u8; 4]; 4]) -> [u8; 4] + Sync) -> Level {
    let (width, height) = ((level.width / 2).max(1), (level.height / 2).max(1));
    let mut texels = vec![[0; 4]; width as usize * height as usize];
    let row = |y: u32| &level.texels[y as usize * level.width as usize..][..level.width as usize];
    let fill = |(y, out): (usize, &mut [[u8; 4]])| {
        let y = (2 * y as u32).min(level.height - 1);
        let (upper, lower) = (row(y), row((y + 1).min(level.height - 1)));
        if let ([upper], [lower]) = (upper, lower) {
            out[0] = mean([*upper, *upper, *lower, *lower]);
            return;
        }
        // The rows are cut to whole pairs, so that the compiler knows their lengths.
        for ((out, upper), lower) in out.iter_mut().zip(upper.as_chunks().0).zip(lower.as_chunks().0) {
            let ([a, b], [c, d]) = (*upper, *lower);
            *out = mean([a, b, c, d]);
        }
    };
    let least = MIN_TEXELS.div_ceil(width as usize);
    if (height as usize) <= least {
        texels.chunks_mut(width as usize).enumerate().for_each(fill);
    } else {
        texels.par_chunks_mut(width as usize).with_min_len(least).enumerate().for_each(fill);
    }
    Level { width, height, texels }
}

fn mean(four: [[u8; 4]; 4]) -> [u8; 4] {
    std::array::from_fn(|channel| {
        let sum: u32 = four.iter().map(|texel| u32::from(texel[channel])).sum();
        ((sum + 2) / 4) as u8
    })
}

/// Mean of colours with alpha as weight; the plain mean if all four are fully transparent.
fn mean_by_alpha(four: [[u8; 4]; 4]) -> [u8; 4] {
    let plain = mean(four);
    let weight: u32 = four.iter().map(|texel| u32::from(texel[3])).sum();
    if weight == 0 {
        return plain;
    }
    let color = |channel: usize| {
        let sum: u32 = four.iter().map(|texel| u32::from(texel[channel]) * u32::from(texel[3])).sum();
        ((sum + weight / 2) / weight) as u8
    };
    [color(0), color(1), color(2), plain[3]]
}

/// Mean of colours in linear light, stored in sRGB.
fn linear_mean(four: [[u8; 4]; 4]) -> [u8; 4] {
    let [.., alpha] = mean(four);
    let color = |channel: usize| {
        let sum: f32 = four.iter().map(|texel| DECODED[usize::from(texel[channel])]).sum();
        color::code(0.25 * sum)
    };
    [color(0), color(1), color(2), alpha]
}

/// [`mean_by_alpha`] in linear light, stored in sRGB.
fn linear_mean_by_alpha(four: [[u8; 4]; 4]) -> [u8; 4] {
    let [.., alpha] = mean(four);
    let weight: u32 = four.iter().map(|texel| u32::from(texel[3])).sum();
    if weight == 0 {
        return linear_mean(four);
    }
    let color = |channel: usize| {
        let weighted = four.iter().map(|texel| DECODED[usize::from(texel[channel])] * f32::from(texel[3]));
        color::code(weighted.sum::<f32>() / weight as f32)
    };
    [color(0), color(1), color(2), alpha]
}

#[cfg(test)]
mod tests {
    use super::{ColorSpace, Level, Magnification, Texture, Wrap, log2};
    use glam::Vec2;

    /// The texel that is read for an index, which may be beyond the sides.
    fn texel(texels: &[u8], wrap: Wrap, index: i64) -> u8 {
        let count = texels.len() as i64;
        let index = match wrap {
            Wrap::Repeat => index.rem_euclid(count),
            Wrap::Clamp => index.clamp(0, count - 1),
            Wrap::Mirror => {
                let twice = index.rem_euclid(2 * count);
                if twice < count { twice } else { 2 * count - 1 - twice }
            }
        };
        texels[index as usize]
    }

    /// Bilinear filtering by its definition: texel centres, and the wrap mode applied to each index (Vulkan 1.3, section 16.6).
    fn expected(texels: &[u8], wrap: Wrap, u: f64) -> f64 {
        let count = texels.len() as i64;
        let texel = |index: i64| f64::from(texel(texels, wrap, index)) / 255.0;
        let at = u * count as f64 - 0.5;
        let before = at.floor();
        let share = at - before;
        texel(before as i64) * (1.0 - share) + texel(before as i64 + 1) * share
    }

    /// A texture of one row, and one of one column, with these values in the order of u or v.
    fn row_and_column(values: &[u8], wrap: Wrap) -> [Texture; 2] {
        let row: Vec<[u8; 4]> = values.iter().map(|value| [*value, 0, 0, 255]).collect();
        let count = values.len() as u32;
        let across = Texture::new("row".into(), count, 1, row.clone()).wrapped([wrap, Wrap::Clamp]);
        // The first row is at the top, where v is 1.
        let column = row.into_iter().rev().collect();
        [across, Texture::new("column".into(), 1, count, column).wrapped([Wrap::Clamp, wrap])]
    }

    #[test]
    fn magnified_textures_that_ask_for_it_show_their_nearest_texel() {
        let values = [10, 200, 90, 255, 0];
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let blended = row_and_column(&values, wrap);
            let nearest = blended.clone().map(|texture| texture.magnified(Magnification::Nearest));
            let mut others = 0;
            // These coordinates are never on the border of two texels.
            for step in -400..400 {
                let u = (f64::from(step) + 0.5) * 0.0078125;
                let exact = f32::from(texel(&values, wrap, (u * 5.0).floor() as i64)) / 255.0;
                for (axis, (nearest, blended)) in nearest.iter().zip(&blended).enumerate() {
                    let uv = if axis == 0 { Vec2::new(u as f32, 0.3) } else { Vec2::new(0.3, u as f32) };
                    assert_eq!(
                        [nearest.sample(uv, 0.0).x, nearest.sample(uv, -2.0).x],
                        [exact; 2],
                        "{wrap:?} {axis} {u}"
                    );
                    assert_eq!(nearest.sample(uv, 0.25), blended.sample(uv, 0.25), "minified textures are blended");
                    others += usize::from(blended.sample(uv, 0.0).x != exact);
                }
            }
            assert!(others > 200, "control: {others} lookups are others if blended");
            for texture in nearest {
                assert_eq!(texture.sample(Vec2::new(f32::NAN, 0.0), 0.0), texture.sample(Vec2::INFINITY, 0.0));
                assert!(texture.sample(Vec2::new(1e30, -1e30), 0.0).is_finite());
                // Exactly on a side, the result is some texel of the texture.
                for side in [Vec2::ZERO, Vec2::ONE, -Vec2::ONE] {
                    assert!(values.iter().any(|value| texture.sample(side, 0.0).x == f32::from(*value) / 255.0));
                }
            }
        }
    }

    #[test]
    fn textures_repeat_mirror_and_clamp_as_vulkan_defines_it() {
        let values = [10, 200, 90, 255, 0];
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let [across, along] = row_and_column(&values, wrap);
            for step in -400..400 {
                let u = f64::from(step) * 0.0078125;
                let (uv, vu) = (Vec2::new(u as f32, 0.3), Vec2::new(0.3, u as f32));
                let exact = expected(&values, wrap, u) as f32;
                assert!((across.sample(uv, 0.0).x - exact).abs() < 1e-5, "{wrap:?} at {u}");
                assert!((along.sample(vu, 0.0).x - exact).abs() < 1e-5, "{wrap:?} at v = {u}");
            }
            assert!(across.sample(Vec2::new(f32::NAN, 0.0), 0.0).is_finite());
            assert!(across.sample(Vec2::new(1e30, -1e30), 2.0).is_finite());
        }
    }

    #[test]
    fn linear_textures_are_filtered_and_halved_in_linear_light() {
        let (black, white) = ([0, 0, 0, 255], [255, 255, 255, 255]);
        let checker = Level { width: 2, height: 2, texels: vec![black, white, white, black] };
        let linear = Texture::build("checker".into(), checker.clone(), false, ColorSpace::Linear);
        let report = Texture::new("checker".into(), 2, 2, checker.texels);
        assert_eq!(
            (linear.levels[1].texels[0], report.levels[1].texels[0]),
            ([188, 188, 188, 255], [128, 128, 128, 255])
        );
        // The centre between four texels: bilinear weights of a quarter each.
        assert_eq!(linear.sample(Vec2::splat(0.5), 0.0).x, 0.5);
        assert!((linear.sample(Vec2::splat(0.5), 1.0).x - 0.5).abs() < 0.004, "188 is not quite a half");
        // Codes 0 and 128 side by side: the mean is half of what 128 decodes to, not what 64 decodes to.
        let row = Level { width: 2, height: 1, texels: vec![[0, 0, 0, 128], [128, 128, 128, 128]] };
        let row = Texture::build("row".into(), row, false, ColorSpace::Linear);
        let exact = ((128.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
        let middle = row.sample(Vec2::new(0.5, 0.5), 0.0);
        assert!((f64::from(middle.x) - 0.5 * exact).abs() < 1e-6, "{middle}");
        assert!((middle.w - 128.0 / 255.0).abs() < 1e-6, "alpha is no colour");
        assert!((f64::from(row.sample(Vec2::new(0.75, 0.5), 0.0).x) - exact).abs() < 1e-6);
    }

    #[test]
    fn linear_cut_outs_weigh_colours_by_alpha() {
        let texels = vec![[255, 0, 10, 255], [0, 255, 10, 0], [128, 0, 10, 255], [0, 255, 10, 0]];
        let level = Level { width: 2, height: 2, texels };
        let cut = Texture::build("leaf".into(), level.clone(), true, ColorSpace::Linear);
        // Only the two opaque texels count: the mean of 1 and of what 128 decodes to.
        let red = 0.5 * (1.0 + ((128.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4));
        let code = (255.0 * (1.055 * red.powf(1.0 / 2.4) - 0.055)).round() as u8;
        assert_eq!(cut.levels[1].texels[0][..3], [code, 0, 10]);
        let whole = Texture::build("leaf".into(), level, false, ColorSpace::Linear);
        assert_eq!(whole.levels[1].texels[0][1], 188, "control: without weights the holes show");
    }

    #[test]
    fn logarithms_are_rounded_to_nearest_but_for_ties() {
        assert_eq!(log2(f32::INFINITY), 128.0);
        for exponent in -126..128 {
            assert_eq!(log2((exponent as f32).exp2()), exponent as f32);
        }
        let (mut largest, mut before) = (0.0_f64, f32::NEG_INFINITY);
        for bits in (f32::MIN_POSITIVE.to_bits()..f32::INFINITY.to_bits()).step_by(4099) {
            let value = f32::from_bits(bits);
            let (found, exact) = (log2(value), f64::from(value).log2());
            assert!(found >= before, "{value}");
            before = found;
            let unit = f64::from(found.abs().next_up()) - f64::from(found.abs());
            largest = largest.max((f64::from(found) - exact).abs() / unit);
        }
        assert!((0.49..0.5001).contains(&largest), "{largest}");
    }
}
