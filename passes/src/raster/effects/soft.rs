//! Soft shadows from a depth map: percentage-closer soft shadows of a directional light that is a disc.
//!
//! Fernando, "Percentage-Closer Soft Shadows", SIGGRAPH 2005 sketches: depths around a point tell how far off what hides the light is, and so over how
//! wide a kernel the shadow test is averaged. For a disc at infinity of half angle a the kernel's radius is the distance times tan a, which is exact
//! for one occluder across the light: its penumbra is 2 tan a times the distance wide.
//!
//! # What is searched
//! As far around the point as the disc reaches at the top of the scene, and as the map covers ([`ShadowFit::aside`]). A texel counts that is in the cone from the point to the disc: no farther
//! aside than its own distance times tan a. So what stands beside the point and does not hide the light widens no penumbra.
//!
//! # Bias
//! A texel at some distance from the point is compared with a plane through the point that is as steep as the surface, in whatever direction: the
//! bias grows with the distance. It does not leak at wide kernels: inside the cone it is less than the distance of what hides the light, unless the disc
//! reaches below the horizon.
//!
//! # Limits
//! The taps are fixed: a search of [`SEARCH_TAPS`] texels misses what is thin and far off, and where several things hide the light the kernel is that of
//! their mean distance. Of a penumbra that is wider than a third of what its map covers the outer part is cut off. [`FILTER_TAPS`] tests give a penumbra as many steps, each as wide as a texel at least.

use super::shadow::ShadowFit;
use curitiba_pipeline::raster_effects::EffectParams;
use glam::{Vec2, Vec3};
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Texels of which the depth is read to find what hides the light.
pub const SEARCH_TAPS: usize = 32;
/// Shadow tests of a kernel, each between four texels.
pub const FILTER_TAPS: usize = 64;

/// A tap of a unit disk: where it is, how far from the middle, and what it counts.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Tap {
    /// Right and down of the middle.
    pub place: Vec2,
    /// The length of that.
    pub radius: f32,
    /// Its weight in a mean.
    pub weight: f32,
}

/// The taps of both steps.
#[derive(Debug)]
pub struct Taps {
    /// Denser towards the middle, where what is near hides the light, and weighted by the area that each stands for.
    pub search: [Tap; SEARCH_TAPS],
    /// Of equal areas: Vogel, "A better way to construct the sunflower head", Mathematical Biosciences 44, 1979.
    pub filter: [Tap; FILTER_TAPS],
}

/// Both spirals turn by the golden angle.
pub static TAPS: LazyLock<Taps> = LazyLock::new(|| {
    let tap = |index: usize, radius: f64, weight: f64| {
        let (sin, cos) = (index as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let place = Vec2::new((radius * cos) as f32, (radius * sin) as f32);
        Tap { place, radius: radius as f32, weight: weight as f32 }
    };
    Taps {
        // Radii by the square of t: an annulus has the area 2π r dr, which grows as t³.
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
    /// The share of the light's disc that a position sees, 0..=1; else as [`Self::lit_share`]. The kernel is never smaller than without a disc.
    #[must_use]
    pub fn soft_share(&self, map: &[f32], position: Vec3, cos: f32, params: &EffectParams) -> f32 {
        let place = self.place(position);
        let at = place.truncate() - 0.5;
        let edge = 1e6;
        // Also where the place is not a number.
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

    /// How far around a place of this depth, in texels, something may hide the disc.
    #[inline]
    pub(super) fn search(&self, depth: f32) -> f32 {
        (self.spread * (1.0 - depth).clamp(0.0, 1.0)).min(self.aside)
    }

    /// The bias of each texel of distance from the position, and what is always there.
    #[inline]
    fn soft_bias(&self, cos: f32) -> [f32; 2] {
        [self.texel * Self::slope(cos) * self.depth_per_unit, self.rounding * self.depth_per_unit]
    }

    /// A shadow test between the four texels around a place that is given by texel centres.
    #[inline]
    fn between(&self, map: &[f32], at: Vec2, depth: f32) -> f32 {
        let corner = at.floor();
        let share = at - corner;
        let (x, y) = (corner.x as i32, corner.y as i32);
        let lit = |right: i32, down: i32| if depth >= self.stored(map, x + right, y + down) { 1.0 } else { 0.0 };
        let row = |down: i32| lit(0, down) * (1.0 - share.x) + lit(1, down) * share.x;
        row(0) * (1.0 - share.y) + row(1) * share.y
    }

    /// The depth of a texel; those outside are empty.
    #[inline]
    fn stored(&self, map: &[f32], x: i32, y: i32) -> f32 {
        let size = self.size as i32;
        let inside = (0..size).contains(&x) & (0..size).contains(&y);
        if inside { map[y as usize * size as usize + x as usize] } else { EMPTY }
    }
}

/// Farther than any depth.
const EMPTY: f32 = -1e9;
