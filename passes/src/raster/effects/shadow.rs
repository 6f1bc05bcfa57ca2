//! One shadow map of a directional light: its camera, its bias, and its test.

use super::bounds::{Bounds, Frustum};
use curitiba_pipeline::backend::{Sun, View};
use curitiba_pipeline::raster_effects::EffectParams;
use glam::{DVec3, Mat4, Vec3};

/// Slopes are clamped to this (88 degrees), so that the bias stays finite; the light's cosine is below 0.04 there.
pub const MAX_SLOPE: f32 = 28.0;

/// Steps per doubling of the radius of the sphere around what the camera sees.
const RADIUS_STEPS: f64 = 8.0;

/// Number of steps from the scene's radius to the smallest radius, which is 2^-16 of the scene's radius; negative.
const SMALLEST: f64 = -16.0 * RADIUS_STEPS;

/// A shadow map's camera.
///
/// The camera is orthographic along the light. Across the light it covers a sphere: the scene's, or a smaller one
/// around the part of the scene that the camera sees. Along the light it covers the whole scene, because occluders need
/// not be seen.
///
/// So that shadow edges do not shimmer when the camera moves, the smaller sphere's radius takes fixed steps (eight a
/// doubling), and its centre moves by whole texels only (Valient, "Stable Rendering of Cascaded Shadow Maps", ShaderX6,
/// 2008). A surface point keeps its place within its texel until the radius takes a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowFit {
    /// World to clip matrix with reversed depth: 1 is nearest to the light. The eye is a point of the near plane.
    pub view: View,
    /// World to texel matrix: x right and y down from the top left corner of the map, and z the depth.
    pub map_from_world: Mat4,
    /// Texels a side.
    pub size: u32,
    /// World length of a texel's side.
    pub texel: f32,
    /// Change of depth per world unit along the light.
    pub depth_per_unit: f32,
    /// Whether the map covers the whole scene.
    pub is_whole: bool,
    /// World length by which rounding may displace a surface along the light's direction.
    pub rounding: f32,
    /// Radius in texels of the cone from a surface to the light's disc, at a place that is nearer to the light by a depth of 1; 0 for
    /// a point light.
    pub spread: f32,
    /// Margin of the map around the surfaces that it serves, in texels, for occluders of the disc. This is the greatest
    /// radius of a search and of a kernel.
    pub aside: f32,
}

impl ShadowFit {
    /// The camera of one map with `params.map_size` texels a side, for everything that `camera` sees of a scene with
    /// these bounds. `None` if the scene is empty or the light has no direction, so that nothing casts a shadow, or if numbers overflow.
    #[must_use]
    pub fn new(sun: &Sun, scene: &Bounds, camera: &View, params: &EffectParams) -> Option<Self> {
        let seen = Frustum::new(&camera.clip_from_world).and_then(|frustum| frustum.sphere_with(scene));
        Self::around(sun, scene, seen, params)
    }

    /// The camera of a map for the part of the scene in the sphere `seen` (centre and radius). It covers the whole
    /// scene if there is no sphere, or if the sphere is no smaller than the scene's.
    #[must_use]
    pub fn around(sun: &Sun, scene: &Bounds, seen: Option<(DVec3, f64)>, params: &EffectParams) -> Option<Self> {
        let direction = sun.direction.as_dvec3().try_normalize()?;
        if scene.is_empty() || !scene.min.is_finite() || !scene.max.is_finite() {
            return None;
        }
        let (anchor, half) =
            ((scene.min.as_dvec3() + scene.max.as_dvec3()) * 0.5, (scene.max.as_dvec3() - scene.min.as_dvec3()) * 0.5);
        let reach = direction.abs().dot(half);
        // `tangent` is the tangent of the disc's half angle. `aside` is the greatest distance across the light at which an
        // occluder of the disc may lie. The map's radius grows by `aside`, but by no more than half.
        let tangent = (f64::from(params.sun) * 0.5).to_radians().tan();
        let aside = |radius: f64| (tangent * 2.0 * reach).min(0.5 * radius);
        let largest = scene.min.abs().max(scene.max.abs()).max_element();
        // A scene that is a point still needs texels of some size.
        let scene_radius = half.length().max(f64::from(largest * f32::EPSILON)).max(f64::from(f32::MIN_POSITIVE));
        let (center, radius, aside) = seen
            .map(|(center, radius)| {
                let steps = (RADIUS_STEPS * (radius / scene_radius).log2()).ceil().max(SMALLEST);
                let radius = scene_radius * (steps / RADIUS_STEPS).exp2();
                (center, radius + aside(radius), aside(radius))
            })
            .filter(|(_, radius, _)| *radius < scene_radius)
            // A map of the whole scene contains every occluder, so the margin is unlimited.
            .unwrap_or((anchor, scene_radius, 2.0 * scene_radius));

        let size = f64::from(params.map_size);
        // Margin for the texels that the test reads around the sphere, and for the half texel by which the centre is
        // rounded.
        let margin = f64::from(params.pcf + 2).min(size * 0.25);
        let texel = 2.0 * radius / (size - 2.0 * margin);
        let (right, up) = direction.any_orthonormal_pair();
        let snap = |axis: DVec3| (axis.dot(center - anchor) / texel).round() * texel;
        let (x, y) = (snap(right), snap(up));
        // Room at both ends, so that rounding clips nothing.
        let depth_half = reach * (1.0 + 1e-5) + texel + f64::from(largest) * 1e-6;
        let depth_range = 2.0 * depth_half;

        let row = |axis: DVec3, scale: f64, offset: f64| (axis * scale).extend(offset - axis.dot(anchor) * scale);
        let matrix = |x: glam::DVec4, y: glam::DVec4, z: glam::DVec4| {
            glam::DMat4::from_cols(x, y, z, glam::DVec4::W).transpose().as_mat4()
        };
        let depth = row(-direction, 1.0 / depth_range, 0.5);
        let scale = 2.0 / (size * texel);
        let clip_from_world = matrix(row(right, scale, -x * scale), row(up, scale, -y * scale), depth);
        let map_from_world = matrix(
            row(right, 1.0 / texel, 0.5 * size - x / texel),
            row(-up, 1.0 / texel, 0.5 * size + y / texel),
            depth,
        );
        let eye = anchor + right * x + up * y - direction * depth_half;
        let fit = Self {
            view: View::new(clip_from_world, eye.as_vec3()),
            map_from_world,
            size: params.map_size,
            is_whole: radius >= scene_radius,
            texel: texel as f32,
            depth_per_unit: (1.0 / depth_range) as f32,
            rounding: 8.0 * f32::EPSILON * (largest + depth_range as f32),
            spread: (tangent * depth_range / texel) as f32,
            aside: (aside / texel) as f32,
        };
        (fit.map_from_world.is_finite() && clip_from_world.is_finite() && fit.texel > 0.0).then_some(fit)
    }

    /// The place of a position in the map: texels right and down of the top left corner (texel centres at halves), and
    /// the depth.
    #[must_use]
    #[inline]
    pub fn place(&self, position: Vec3) -> Vec3 {
        self.map_from_world.transform_point3(position)
    }

    /// Whether the filter around a place reads only texels inside the map. With a disc, also whether all its possible
    /// occluders are in the map.
    #[must_use]
    #[inline]
    pub fn covers(&self, place: Vec3, params: &EffectParams) -> bool {
        let mut low = (params.pcf + 1) as f32;
        if params.sun > 0.0 {
            low += self.search(place.z);
        }
        let high = self.size as f32 - low;
        place.x >= low && place.x <= high && place.y >= low && place.y <= high
    }

    /// The depth by which a surface may lie behind the map and still be lit, for a light cosine of `cos`.
    ///
    /// The farthest texel that the test reads is `√2 (pcf + 1)` texels from the position. There, a plane of slope
    /// `tan θ` towards the light is nearer to the light by that distance times `texel tan θ`. So with the bias
    /// `bias (pcf + 1) texel tan θ`, plus some units of rounding, a plane does not shadow itself for `bias >= √2`.
    /// Depth bias by slope: Woo, "The Shadow Depth Map Revisited", Graphics Gems III, 1992; its bound for a plane and a
    /// texel: Dou, Yan, Kerzner, Dai and Wyman, "Adaptive Depth Bias for Shadow Maps", JCGT 3(4), 2014.
    ///
    /// Light leaks below occluders that are nearer to the surface than the bias is long; the small texels of cascades
    /// keep it short. An offset along the normal (Holbert, "Normal Offset Shadows", GDC 2011) does not grow with the
    /// slope, but it moves every edge. With an offset large enough that planes do not shadow themselves, the pictures
    /// of the shipped square are farther from the ray-traced ones. Pictures with depths along the receiver's plane
    /// (Isidoro, "Shadow Mapping: GPU-based Tips and Techniques", GDC 2006) are no nearer to the ray-traced ones.
    #[must_use]
    #[inline]
    pub fn bias(&self, cos: f32, params: &EffectParams) -> f32 {
        (params.bias * (params.pcf + 1) as f32 * self.texel * Self::slope(cos) + self.rounding) * self.depth_per_unit
    }

    /// The slope towards the light, `tan θ`, of a surface with this light cosine.
    #[inline]
    pub(super) fn slope(cos: f32) -> f32 {
        let cos = cos.min(1.0);
        ((1.0 - cos * cos).sqrt() / cos).min(MAX_SLOPE)
    }

    /// Whether a position is lit, if the tests of all `(2 pcf + 2)^2` texels that [`Self::lit_share`] reads agree. `None` if the tests
    /// differ, outside the map, and for a position that is not finite.
    #[must_use]
    #[inline]
    pub fn agreed(&self, map: &[f32], position: Vec3, cos: f32, params: &EffectParams) -> Option<bool> {
        let place = self.place(position);
        if !(self.covers(place, params) && place.z.is_finite()) {
            return None;
        }
        let depth = place.z + self.bias(cos, params);
        let (size, reach) = (self.size as usize, params.pcf as usize);
        // The place is at least `pcf + 1` texels from the map's edge, so all texels of the filter are inside the map.
        let first = |at: f32| (at - 0.5).floor() as usize - reach;
        let (left, width) = (first(place.x), 2 * reach + 2);
        let mut rows = map.chunks_exact(size).skip(first(place.y)).take(width).map(|row| &row[left..left + width]);
        let lit = depth >= *rows.clone().next()?.first()?;
        rows.all(|row| row.iter().all(|stored| (depth >= *stored) == lit)).then_some(lit)
    }

    /// The share of the light that reaches a position, 0..=1, from a map of `size` x `size` depths, top row first. A depth
    /// of 0 is an empty texel. Positions outside the map are lit.
    ///
    /// The mean of `(2 pcf + 1)^2` tests, each bilinear between the four texels around its place: Reeves, Salesin and
    /// Cook, "Rendering Antialiased Shadows with Depth Maps", SIGGRAPH 1987. Together they read `(2 pcf + 2)^2` texels;
    /// the outer ones are weighted by the part of them that the filter's square covers.
    #[must_use]
    #[inline]
    pub fn lit_share(&self, map: &[f32], position: Vec3, cos: f32, params: &EffectParams) -> f32 {
        let place = self.place(position);
        let (size, reach) = (self.size as i32, params.pcf as i32);
        let (x, y) = (place.x - 0.5, place.y - 0.5);
        let edge = 1e6;
        // The negated comparisons are also true for a NaN.
        if !(x.abs() < edge && y.abs() < edge && place.z.is_finite()) {
            return 1.0;
        }
        let depth = place.z + self.bias(cos, params);
        let (left, top) = (x.floor(), y.floor());
        let (right_share, lower_share) = (x - left, y - top);
        let (first_column, first_row) = (left as i32 - reach, top as i32 - reach);
        let width = 2 * reach + 2;
        let share = |index: i32, last_share: f32| match index {
            0 => 1.0 - last_share,
            _ if index + 1 == width => last_share,
            _ => 1.0,
        };
        let mut lit = 0.0;
        for row in 0..width {
            let y = first_row + row;
            let mut lit_in_row = 0.0;
            for column in 0..width {
                let x = first_column + column;
                let inside = (0..size).contains(&x) & (0..size).contains(&y);
                if !inside || depth >= map[y as usize * size as usize + x as usize] {
                    lit_in_row += share(column, right_share);
                }
            }
            lit += lit_in_row * share(row, lower_share);
        }
        let side = (2 * reach + 1) as f32;
        (lit / (side * side)).min(1.0)
    }
}
