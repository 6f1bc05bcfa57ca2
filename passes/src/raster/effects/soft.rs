//! Soft shadows from a depth map: percentage-closer soft shadows of a directional light with the shape of a disc.
//!
//! Fernando, "Percentage-Closer Soft Shadows", SIGGRAPH 2005, describes the method. The distance of the occluder is
//! estimated from the depths around a point. This distance gives the width of the kernel over which the shadow test is
//! averaged. For a disc at infinity of half angle a, the kernel's radius is the occluder's distance times tan a. This is
//! exact for one occluder perpendicular to the light: its penumbra is 2 tan a times its distance wide.
//!
//! # Search for occluders
//! The radius of the search is that of the cone from the point to the disc, at the end of the scene that is nearest to the
//! light. It is at most the margin that the map has around the point ([`ShadowFit::aside`]). A texel counts if it is in the
//! cone: no farther aside than its own distance times tan a. So an object beside the point that does not hide the light
//! widens no penumbra.
//!
//! # Bias
//! A texel is compared with a plane through the point that is as steep as the surface and rises towards the texel, in
//! whatever direction the texel lies. So the bias grows with the texel's distance from the point. Wide kernels do not
//! leak: inside the cone the bias is less than the occluder's distance, unless the disc reaches below the horizon.
//!
//! # Limits
//! The number of taps is fixed. A search of [`SEARCH_TAPS`] texels misses thin, distant occluders. Where several
//! objects hide the light, the kernel is that of their mean distance. A penumbra wider than a third of the area its map
//! covers loses its outer part. [`FILTER_TAPS`] tests give a penumbra as many grey levels, each step at least a texel
//! wide.

use super::shadow::ShadowFit;
use curitiba_pipeline::raster_effects::EffectParams;
use glam::{Vec2, Vec3};
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Texels whose depth is read in the search for occluders.
pub const SEARCH_TAPS: usize = 32;
/// Shadow tests of a kernel; each test interpolates between four texels.
pub const FILTER_TAPS: usize = 64;

/// A tap of the unit disk: its place, its distance from the centre, and its weight.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Tap {
    /// Offset to the right and down from the centre.
    pub place: Vec2,
    /// Length of `place`.
    pub radius: f32,
    /// Its weight in a mean.
    pub weight: f32,
}

/// The taps of the occluder search and of the kernel.
#[derive(Debug)]
pub struct Taps {
    /// Taps of the search: denser towards the centre, where occluders near the surface are; each is weighted by the area that it represents.
    pub search: [Tap; SEARCH_TAPS],
    /// Taps of the kernel; each represents the same area: Vogel, "A better way to construct the sunflower head",
    /// Mathematical Biosciences 44, 1979.
    pub filter: [Tap; FILTER_TAPS],
}

/// The taps. Each of the two lists is a spiral whose angle grows by the golden angle from tap to tap.
pub static TAPS: LazyLock<Taps> = LazyLock::new(|| {
    let tap = |index: usize, radius: f64, weight: f64| {
        let (sin, cos) = (index as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let place = Vec2::new((radius * cos) as f32, (radius * sin) as f32);
        Tap { place, radius: radius as f32, weight: weight as f32 }
    };
    Taps {
        // The radius is r = t². An annulus has the area 2π r dr, so the area inside grows as t⁴ and the weight of a tap
        // as t³.
        search: std::array::from_fn(|index| {
            let t = index as f64 / (SEARCH_TAPS - 1) as f64;
            tap(index, t * t, (t + 0.5 / SEARCH_TAPS as f64).powi(3))
        }),
        filter: std::array::from_fn(|index| {
            tap(index, ((index as f64 + 0.5) / FILTER_TAPS as f64).sqrt(), 1.0 / FILTER_TAPS as f64)
        }),
    }
});

impl ShadowFit {
    /// The share of the light's disc that is visible from a position, 0..=1, with the arguments of [`Self::lit_share`]. The
    /// kernel is never smaller than the filter of a point light.
    #[must_use]
    pub fn soft_share(&self, map: &[f32], position: Vec3, cos: f32, params: &EffectParams) -> f32 {
        let place = self.place(position);
        let at = place.truncate() - 0.5;
        let edge = 1e6;
        // The negated comparisons are also true for a NaN.
        if !(at.x.abs() < edge && at.y.abs() < edge && place.z.is_finite()) {
            return 1.0;
        }
        let [per_texel, always] = self.soft_bias(cos);
        let bias = |radius: f32| (params.bias + radius) * per_texel + always;
        let least = params.pcf as f32 + 0.5;
        let search = self.search(place.z) + least;
        let (mut sum, mut weight) = (0.0, 0.0);
        for tap in &TAPS.search {
            let texel = (at + tap.place * search + 0.5).floor();
            let radius = tap.radius * search;
            let ahead = self.stored(map, texel.x as i32, texel.y as i32) - place.z;
            if ahead > bias(radius) && radius <= ahead * self.spread + least {
                sum += tap.weight * ahead;
                weight += tap.weight;
            }
        }
        if weight == 0.0 {
            return 1.0;
        }
        let kernel = (sum / weight * self.spread).clamp(least, search);
        let mut lit = 0.0;
        for tap in &TAPS.filter {
            let depth = place.z + bias(tap.radius * kernel);
            lit += tap.weight * self.between(map, at + tap.place * kernel, depth);
        }
        lit.min(1.0)
    }

    /// Radius in texels within which an occluder may hide the disc from a place of this depth.
    #[inline]
    pub(super) fn search(&self, depth: f32) -> f32 {
        (self.spread * (1.0 - depth).clamp(0.0, 1.0)).min(self.aside)
    }

    /// The bias for each texel of distance from the position, and the constant bias for rounding.
    #[inline]
    fn soft_bias(&self, cos: f32) -> [f32; 2] {
        [self.texel * Self::slope(cos) * self.depth_per_unit, self.rounding * self.depth_per_unit]
    }

    /// A shadow test, interpolated between the four texels around a place; the centre of the first texel is at 0.
    #[inline]
    fn between(&self, map: &[f32], at: Vec2, depth: f32) -> f32 {
        let corner = at.floor();
        let share = at - corner;
        let (x, y) = (corner.x as i32, corner.y as i32);
        let lit = |right: i32, down: i32| if depth >= self.stored(map, x + right, y + down) { 1.0 } else { 0.0 };
        let row = |down: i32| lit(0, down) * (1.0 - share.x) + lit(1, down) * share.x;
        row(0) * (1.0 - share.y) + row(1) * share.y
    }

    /// The depth of a texel; texels outside the map are empty.
    #[inline]
    fn stored(&self, map: &[f32], x: i32, y: i32) -> f32 {
        let size = self.size as i32;
        let inside = (0..size).contains(&x) & (0..size).contains(&y);
        if inside { map[y as usize * size as usize + x as usize] } else { EMPTY }
    }
}

/// Depth of an empty texel: farther from the light than any depth.
const EMPTY: f32 = -1e9;
