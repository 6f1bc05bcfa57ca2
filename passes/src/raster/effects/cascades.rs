//! Cascaded shadow maps: the depths that the camera sees are split, and each part has a map of its own.
//!
//! Engel, "Cascaded Shadow Maps", ShaderX5, 2006. The splits are logarithmic: then a texel has the same size on the screen in
//! all parts (Zhang, Sun, Xu and Lun, "Parallel-Split Shadow Maps for Large-scale Virtual Environments", VRCIA 2006). That
//! paper's practical splits are half way to uniform ones, because logarithmic ones between the camera's planes leave the first
//! maps to the empty space before the eye. Here the depths of the lit pixels are split instead (Lauritzen, Salvi and Lefohn,
//! "Sample Distribution Shadow Maps", I3D 2011), and both views of the shipped square are the nearer to ray traced shadows the
//! less of uniform splits is in the mixture.
//!
//! # Which map serves a pixel
//! The first one that contains the pixel's filter. It needs no depth of the pixel, and is never farther than the map of the
//! pixel's own part: that one contains it, too. Maps of nearer parts also serve pixels behind these parts as far as they
//! reach. From one map to the next an edge gets softer at once; they are not blended.
//!
//! # Limits
//! Ends of the depths take steps of a quarter of a doubling. When one does, as when a map's radius does, edges change a
//! little at once; between steps they stay. An orthographic camera sees all depths at one scale and gets one map. So does a
//! camera without a far plane, of the whole scene.

use super::bounds::{Bounds, Frustum};
use super::shadow::ShadowFit;
use curitiba_pipeline::backend::{EffectJob, Sun, View};
use curitiba_pipeline::raster_effects::EffectParams;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Steps of the nearest and the farthest depth for each doubling.
const DEPTH_STEPS: f64 = 4.0;

/// The nearest and the farthest depth of the lit pixels of a picture. `None` without such a pixel.
///
/// Depths that are not numbers count as 0.
#[must_use]
pub fn lit_depths(job: &EffectJob<'_>) -> Option<[f32; 2]> {
    let plane = depth_plane(&job.view);
    let depths = job.position.par_iter().filter(|position| position[3] > 0.0).map(|position| {
        let depth = plane.dot(Vec4::from_array(*position).with_w(1.0));
        let depth = if depth > 0.0 && depth < f32::INFINITY { depth } else { 0.0 };
        [depth, depth]
    });
    depths.reduce_with(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// The plane whose dot product with `(p, 1)` is the depth of `p`; 0 where [`Cascades::new`] asks for no depths.
#[must_use]
pub fn depth_plane(view: &View) -> Vec4 {
    let plane = Frustum::new(&view.clip_from_world).and_then(|frustum| frustum.depth_plane());
    plane.map_or(Vec4::ZERO, |plane| plane.as_vec4())
}

/// The maps of a picture, from near to far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cascades {
    /// One for each map. None where nothing can cast a shadow.
    pub fits: Vec<ShadowFit>,
}

impl Cascades {
    /// At most `params.cascades` maps of what `camera` sees between two depths, those of [`lit_depths`].
    ///
    /// There are fewer where a map covers the whole scene, or a part of the depths shows nothing of the scene.
    #[must_use]
    pub fn new(sun: &Sun, scene: &Bounds, camera: &View, depths: [f32; 2], params: &EffectParams) -> Self {
        let frustum = Frustum::new(&camera.clip_from_world);
        let whole = |seen| ShadowFit::around(sun, scene, seen, params);
        let parts = frustum.and_then(|frustum| {
            let plane = frustum.depth_plane()?;
            let [near, far] = frustum.depths(plane);
            let step =
                |depth: f32, round: fn(f64) -> f64| (round(f64::from(depth).log2() * DEPTH_STEPS) / DEPTH_STEPS).exp2();
            let near = near.max(step(depths[0], f64::floor));
            let far = far.min(step(depths[1], f64::ceil)).min(scene.farthest(plane));
            (near > 0.0 && near < far && far.is_finite()).then_some((frustum, plane, near, far))
        });
        let mut fits: Vec<ShadowFit> = Vec::new();
        if let Some((frustum, plane, near, far)) = parts {
            let count = params.cascades.max(1);
            for part in 0..count {
                let ends = [part, part + 1].map(|index| split(near, far, index, count));
                let Some(seen) = frustum.slice(plane, ends).sphere_with(scene) else { continue };
                fits.extend(whole(Some(seen)));
                if fits.last().is_some_and(|fit| fit.is_whole) {
                    break;
                }
            }
        }
        if fits.is_empty() {
            fits.extend(whole(frustum.and_then(|frustum| frustum.sphere_with(scene))));
        }
        Self { fits }
    }

    /// The share of the light that a position gets, 0..=1, where the light meets the surface at an angle of this cosine.
    /// `map` gives the depths of each map, see [`ShadowFit::lit_share`].
    #[must_use]
    #[inline]
    pub fn lit_share<'a>(
        &self,
        map: impl Fn(usize) -> &'a [f32],
        position: Vec3,
        cos: f32,
        params: &EffectParams,
    ) -> f32 {
        let covering = self.fits.iter().position(|fit| fit.covers(fit.place(position), params));
        // Maps of few texels may have no place for a whole filter.
        let Some(index) = covering.or(self.fits.len().checked_sub(1)) else { return 1.0 };
        let (fit, map) = (&self.fits[index], map(index));
        if params.sun > 0.0 {
            fit.soft_share(map, position, cos, params)
        } else {
            fit.lit_share(map, position, cos, params)
        }
    }
}

/// End `index` of `count` parts of these depths.
fn split(near: f64, far: f64, index: u32, count: u32) -> f64 {
    if index == count {
        return far;
    }
    near * (far / near).powf(f64::from(index) / f64::from(count))
}
