//! Cascaded shadow maps: the depths that the camera sees are split, and each part has a map of its own.
//!
//! Engel, "Cascaded Shadow Maps", ShaderX5, 2006. The splits are logarithmic: then a texel has the same size on the
//! screen in all parts (Zhang, Sun, Xu and Lun, "Parallel-Split Shadow Maps for Large-scale Virtual Environments",
//! VRCIA 2006). That paper blends logarithmic with uniform splits, because logarithmic splits between the camera's
//! planes waste the first maps on the empty space before the eye. Here the depth range of the lit pixels is split
//! instead (Lauritzen, Salvi and Lefohn, "Sample Distribution Shadow Maps", I3D 2011). Measured on both views of the
//! shipped square, the less the blend weights the uniform splits, the nearer the shadows are to ray-traced ones.
//!
//! # Which map serves a pixel
//! The first map that contains the pixel's whole filter. The choice needs no depth of the pixel. The chosen map is
//! never coarser than the map of the pixel's own part, because that map contains the pixel, too. The map of a nearer part
//! also serves pixels behind that part, as far as the map reaches. Maps are not blended: where the map changes, the
//! softness of an edge jumps.
//!
//! # Limits
//! The ends of the depth range are rounded to a quarter of an octave. When an end moves by a step, shadow edges jump a
//! little, as when a map's radius changes; between steps the edges stay in place. An orthographic camera sees all depths
//! at one scale and gets one map. A camera without a far plane gets one map of the whole scene.

use super::bounds::{Bounds, Frustum};
use super::shadow::ShadowFit;
use curitiba_pipeline::backend::{EffectJob, Sun, View};
use curitiba_pipeline::raster_effects::EffectParams;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Steps per doubling to which the nearest and the farthest depth are rounded.
const DEPTH_STEPS: f64 = 4.0;

/// The nearest and the farthest depth of the lit pixels of a picture; `None` if no pixel is lit. A lit pixel has a
/// light cosine (the position's `w`) above 0.
///
/// Depths that are not positive finite numbers count as 0.
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

/// The plane whose dot product with `(p, 1)` is the depth of `p`; the zero vector for an orthographic or degenerate camera, whose
/// depths [`Cascades::new`] does not use.
#[must_use]
pub fn depth_plane(view: &View) -> Vec4 {
    let plane = Frustum::new(&view.clip_from_world).and_then(|frustum| frustum.depth_plane());
    plane.map_or(Vec4::ZERO, |plane| plane.as_vec4())
}

/// The shadow maps of a picture, from near to far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cascades {
    /// The camera of each map; empty where nothing can cast a shadow.
    pub fits: Vec<ShadowFit>,
}

impl Cascades {
    /// At most `params.cascades` maps of what `camera` sees between the two depths, which come from [`lit_depths`].
    ///
    /// There are fewer maps where one map covers the whole scene, or where a part of the depth range contains nothing
    /// of the scene.
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

    /// Whether a position is lit, if all tests in its map agree. `None` if they differ, or if no map covers the position.
    /// See [`ShadowFit::agreed`].
    #[must_use]
    #[inline]
    pub fn agreed<'a>(
        &self,
        map: impl Fn(usize) -> &'a [f32],
        position: Vec3,
        cos: f32,
        params: &EffectParams,
    ) -> Option<bool> {
        let index = self.fits.iter().position(|fit| fit.covers(fit.place(position), params))?;
        self.fits[index].agreed(map(index), position, cos, params)
    }

    /// The share of the light that reaches a position, 0..=1. `cos` is the cosine between the surface's normal and the
    /// direction to the light. `map` returns the depths of a map by its index, see [`ShadowFit::lit_share`].
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
        // In a map of few texels the filter fits inside the map at no place; then the last map serves the position.
        let Some(index) = covering.or(self.fits.len().checked_sub(1)) else { return 1.0 };
        let (fit, map) = (&self.fits[index], map(index));
        if params.sun > 0.0 {
            fit.soft_share(map, position, cos, params)
        } else {
            fit.lit_share(map, position, cos, params)
        }
    }
}

/// Boundary `index`, 0..=count, of `count` logarithmic parts of the depth range.
fn split(near: f64, far: f64, index: u32, count: u32) -> f64 {
    if index == count {
        return far;
    }
    near * (far / near).powf(f64::from(index) / f64::from(count))
}
