//! Distribution of a texture's alpha, which decides whether a blended surface is transparent or cut out.

use super::super::error::{Budget, SceneError};
use super::super::{Material, Needs, TextureSource};
use super::texture::{Cost, cost, encoded_bytes, pixels, times};
use image::RgbaImage;
use std::path::Path;

/// Alpha cutoff of surfaces that are blended texel by texel: only texels whose 8-bit alpha is 0 are holes.
const CLEAR: f32 = 0.5 / 255.0;

/// Warning about materials that are blended texel by texel in a load without [`Needs::glass_maps`].
pub(in crate::scene) const BLENDED: &str = "materials that are blended texel by texel";
/// Remedy in the warning [`BLENDED`].
pub(in crate::scene) const CUT_WITHOUT_GLASS: &str = "without glass=\"auto\" what is half clear or more is cut out";

/// An opacity as a factor of a texture's alpha, in 65,535ths.
pub(in crate::scene) fn opacity(share: f32) -> u16 {
    (share.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16
}

/// Distribution of a texture's alpha times an opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scene) struct Alphas {
    /// Share of the visible texels (alpha of 1/16 or more) that are half clear over an area. Such a texel has an alpha of at most 7/8, and
    /// its neighbours to the right and below differ from it by at most 8/255. 0 if no texel is visible.
    pub(in crate::scene) half_clear: f32,
    /// Mean alpha of the texels that are half clear over an area; 1 if there are none.
    pub(in crate::scene) mean: f32,
}

impl Alphas {
    /// Share above which alpha is soft. Leaves and railings are half clear only at their edges, a texel or two wide; windows, smoke and
    /// shadows are half clear over an area.
    const LEAST: f32 = 0.01;
    /// Alpha codes of half-clear texels. Texels from the first of these codes on are visible.
    const HALF_CLEAR: std::ops::RangeInclusive<u8> = 16..=223;
    /// Largest difference between the alpha codes of neighbours in an area.
    const LEVEL: u8 = 8;

    /// Whether the surface is blended texel by texel; otherwise it is cut out.
    pub(in crate::scene) fn are_soft(self) -> bool {
        self.half_clear > Self::LEAST
    }

    /// Makes a material transparent: by the alpha of each texel if the load needs textures and glass maps, otherwise evenly by the
    /// mean alpha. Returns whether it is by texel.
    pub(in crate::scene) fn blend(self, material: &mut Material, needs: Needs) -> bool {
        let by_texel = needs.textures && needs.glass_maps;
        if by_texel {
            // The transmission texture holds the transmittance of each texel.
            (material.transmission, material.veil) = (1.0, 0.0);
            material.alpha_cutoff = Some(CLEAR);
        } else {
            (material.transmission, material.veil) = (1.0 - self.mean, self.mean);
        }
        by_texel
    }

    fn of(image: &RgbaImage, opacity: u16) -> Self {
        let (width, height) = image.dimensions();
        let at = |x: u32, y: u32| times(image.get_pixel(x % width, y % height).0[3], opacity);
        let (mut seen, mut half, mut sum) = (0_u64, 0_u64, 0_u64);
        for y in 0..height {
            for x in 0..width {
                let alpha = at(x, y);
                seen += u64::from(alpha >= *Self::HALF_CLEAR.start());
                let level = |other: u8| alpha.abs_diff(other) <= Self::LEVEL;
                if Self::HALF_CLEAR.contains(&alpha) && level(at(x + 1, y)) && level(at(x, y + 1)) {
                    (half, sum) = (half + 1, sum + u64::from(alpha));
                }
            }
        }
        let mean = if half == 0 { 1.0 } else { (sum as f64 / (255.0 * half as f64)) as f32 };
        Self { half_clear: (half as f64 / seen.max(1) as f64) as f32, mean }
    }
}

/// Finds the distribution of a texture's alpha times an opacity in 65,535ths; `None` if the texture cannot be decoded.
pub(in crate::scene) fn alphas(
    source: &TextureSource,
    opacity: u16,
    (file, budget): (&Path, &mut Budget),
) -> Result<Option<Alphas>, SceneError> {
    let encoded = encoded_bytes(source);
    budget.take(file, &format!("the file {}", source.name()), encoded)?;
    budget.give_back(encoded);
    let Ok(Cost { texels, working }) = cost(source) else { return Ok(None) };
    let bytes = 4 * texels + working;
    budget.take(file, &format!("the texels of {}", source.name()), bytes)?;
    let found = pixels(source).map(|image| Alphas::of(&image, opacity));
    budget.give_back(bytes);
    Ok(found.ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    /// A picture whose alpha is a function of the position.
    fn picture(alpha: impl Fn(u32, u32) -> u8) -> RgbaImage {
        RgbaImage::from_fn(64, 64, |x, y| Rgba([9, 9, 9, alpha(x, y)]))
    }

    #[test]
    fn leaves_with_soft_edges_are_cut_and_areas_are_blended() {
        let of = |image: &RgbaImage| Alphas::of(image, u16::MAX);
        // A disc whose edge falls off over three texels. The edge is a third of its visible texels.
        let leaf = |x: u32, y: u32| {
            let away = f64::from(x % 16).hypot(f64::from(y % 16) - 8.0) - 4.0;
            (255.0 * (0.5 - away / 3.0).clamp(0.0, 1.0)) as u8
        };
        let edge = picture(leaf).pixels().filter(|pixel| Alphas::HALF_CLEAR.contains(&pixel.0[3])).count();
        let seen = picture(leaf).pixels().filter(|pixel| pixel.0[3] >= 16).count();
        assert!(edge * 3 > seen, "{edge} of {seen}");
        assert!(!of(&picture(leaf)).are_soft(), "{:?}", of(&picture(leaf)));
        // A window of 8 x 8 texels in a body that is opaque.
        let window = |x: u32, y: u32| if x < 8 && y < 8 { 76 } else { 255 };
        let found = of(&picture(window));
        assert!(found.are_soft(), "{found:?}");
        assert!(
            (found.mean - 76.0 / 255.0).abs() < 1e-6 && (found.half_clear - 49.0 / 4096.0).abs() < 1e-6,
            "{found:?}"
        );
        // Smoke: a slope from clear to opaque.
        assert!(of(&picture(|x, _| (4 * x) as u8)).are_soft());
        for even in [0, 15, 224, 255] {
            assert!(!of(&picture(|_, _| even)).are_soft(), "{even}");
        }
    }

    #[test]
    fn an_opacity_makes_an_opaque_picture_half_clear() {
        let opaque = picture(|_, _| 255);
        let found = Alphas::of(&opaque, u16::MAX / 2);
        assert_eq!((found.half_clear, found.are_soft()), (1.0, true));
        assert!((found.mean - 127.0 / 255.0).abs() < 1e-6, "{found:?}");
    }
}
