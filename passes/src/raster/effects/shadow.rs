//! One shadow map of a directional light: its camera, its bias, and its test.

use super::bounds::{Bounds, Frustum};
use curitiba_pipeline::backend::{Sun, View};
use curitiba_pipeline::raster_effects::EffectParams;
use glam::{DVec3, Mat4, Vec3};

/// Slopes are clamped to this (88 degrees): the bias stays finite, and beyond it the light's cosine is below 0.04.
pub const MAX_SLOPE: f32 = 28.0;

/// Steps in which the camera's sphere may grow, for each doubling.
const RADIUS_STEPS: f64 = 8.0;

/// Of [`RADIUS_STEPS`]: the smallest sphere is 2^-16 of the scene's.
const SMALLEST: f64 = -16.0 * RADIUS_STEPS;

/// A shadow map's camera.
///
/// Orthographic along the light. Across the light it covers a sphere: the scene's, or a smaller one around what the camera
/// sees of the scene. Along the light it covers the whole scene, because what casts shadows need not be seen.
///
/// So that edges do not shimmer when the camera moves, the smaller sphere's radius takes fixed steps (eight a doubling) and
/// its centre moves by whole texels only (Valient, "Stable Rendering of Cascaded Shadow Maps", ShaderX6, 2008): a surface
/// point keeps its place in its texel until the radius takes a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowFit {
    /// World to clip, depth reversed: 1 nearest to the light. The eye is a point at the near plane.
    pub view: View,
    /// World to texels: x right and y down from the top left corner of the map, z the depth.
    pub map_from_world: Mat4,
    /// Texels a side.
    pub size: u32,
    /// World length of a texel's side.
    pub texel: f32,
    /// Depth that one unit of world length along the light makes.
    pub depth_per_unit: f32,
    /// Whether it covers the whole scene.
    pub is_whole: bool,
    /// World length by which rounding may move a surface along the light.
    pub rounding: f32,
    /// Radius of the light's disc in texels, seen past what lies a depth of 1 nearer to it; 0 where the light is a point.
    pub spread: f32,
    /// Texels around a surface that the map covers for what hides the disc: the largest radius of a search and of a kernel.
    pub aside: f32,
}

impl ShadowFit {
    /// For one map of `params.map_size` texels a side of all that `camera` sees of a scene with these bounds. `None` where
    /// nothing can cast a shadow: the scene is empty, or the light has no direction.
    #[must_use]
    pub fn new(sun: &Sun, scene: &Bounds, camera: &View, params: &EffectParams) -> Option<Self> {
        let seen = Frustum::new(&camera.clip_from_world).and_then(|frustum| frustum.sphere_with(scene));
        Self::around(sun, scene, seen, params)
    }

    /// For a map of the part of the scene in a sphere, centre and radius; of the whole scene without one, or where the sphere
    /// is no smaller than the scene's.
    #[must_use]
    pub fn around(sun: &Sun, scene: &Bounds, seen: Option<(DVec3, f64)>, params: &EffectParams) -> Option<Self> {
        let direction = sun.direction.as_dvec3().try_normalize()?;
        if scene.is_empty() || !scene.min.is_finite() || !scene.max.is_finite() {
            return None;
        }
        let (anchor, half) =
            ((scene.min.as_dvec3() + scene.max.as_dvec3()) * 0.5, (scene.max.as_dvec3() - scene.min.as_dvec3()) * 0.5);
        let reach = direction.abs().dot(half);
        // The disc's half angle, and how far aside something may lie that hides it: as much is covered, but no more than half as much again.
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
            // Outside of the scene nothing hides the light.
            .unwrap_or((anchor, scene_radius, 2.0 * scene_radius));

        let size = f64::from(params.map_size);
        // Texels that the test reads around the sphere, and the half texel by which the centre may be off.
        let margin = f64::from(params.pcf + 2).min(size * 0.25);
        let texel = 2.0 * radius / (size - 2.0 * margin);
        let (right, up) = direction.any_orthonormal_pair();
        let snap = |axis: DVec3| (axis.dot(center - anchor) / texel).round() * texel;
        let (x, y) = (snap(right), snap(up));
        // So much is left free at both ends that rounding clips nothing.
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

    /// Where a position is in the map: texels right and down of its top left corner (texel centres at halves), and depth.
    #[must_use]
    #[inline]
    pub fn place(&self, position: Vec3) -> Vec3 {
        self.map_from_world.transform_point3(position)
    }

    /// Whether the filter around a place reads texels of the map only; with a disc, whether all that may hide it is in the map.
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

    /// By how much depth a surface may lie behind the map and still be lit, where the light meets it at an angle of this
    /// cosine.
    ///
    /// The farthest texel that the test reads is `√2 (pcf + 1)` texels away from the position; there a plane of slope
    /// `tan θ` towards the light lies that much times `texel tan θ` nearer to it. So with
    /// `bias (pcf + 1) texel tan θ`, and some units of rounding, a plane does not shadow itself from `bias = √2` on. Depth
    /// bias by slope: Woo, "The Shadow Depth Map Revisited", Graphics Gems III, 1992; its bound for a plane and a texel:
    /// Dou, Yan, Kerzner, Dai and Wyman, "Adaptive Depth Bias for Shadow Maps", JCGT 3(4), 2014.
    ///
    /// It lets light pass below what is nearer to the surface than the bias is long, which texels of cascades keep short. An
    /// offset along the normal (Holbert, "Normal Offset Shadows", GDC 2011) does not grow with the slope but moves every
    /// edge: where a plane does not shadow itself, the pictures of the shipped square are farther from ray traced ones.
    /// Depths along the receiver's plane (Isidoro, "Shadow Mapping: GPU-based Tips and Techniques", GDC 2006) are no nearer.
    #[must_use]
    #[inline]
    pub fn bias(&self, cos: f32, params: &EffectParams) -> f32 {
        (params.bias * (params.pcf + 1) as f32 * self.texel * Self::slope(cos) + self.rounding) * self.depth_per_unit
    }

    /// The slope towards the light of a surface that light meets at an angle of this cosine.
    #[inline]
    pub(super) fn slope(cos: f32) -> f32 {
        let cos = cos.min(1.0);
        ((1.0 - cos * cos).sqrt() / cos).min(MAX_SLOPE)
    }

    /// The share of the light that a position gets, 0..=1, from a map of `size` x `size` depths, top row first; 0 is an empty
    /// texel. Positions outside the map are lit.
    ///
    /// The mean of `(2 pcf + 1)^2` tests, each between the four texels around its place by their distance: Reeves, Salesin
    /// and Cook, "Rendering Antialiased Shadows with Depth Maps", SIGGRAPH 1987. Together: `(2 pcf + 2)^2` texels, the outer
    /// ones weighted by what of the filter's square they cover.
    #[must_use]
    #[inline]
    pub fn lit_share(&self, map: &[f32], position: Vec3, cos: f32, params: &EffectParams) -> f32 {
        let place = self.place(position);
        let (size, reach) = (self.size as i32, params.pcf as i32);
        let (x, y) = (place.x - 0.5, place.y - 0.5);
        let edge = 1e6;
        // Also where the place is not a number.
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
