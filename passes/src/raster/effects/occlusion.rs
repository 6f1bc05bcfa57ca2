//! Ambient occlusion from what the camera sees: by horizons, and by the difference of depths.
//!
//! Both look along `slices` directions from a pixel, `steps` times on each side. A direction is a plane through the eye and
//! the pixel's position: with unit vectors `V` to the eye and `T` across, positions `P + r T` lie on a straight line of the
//! picture, and what is seen there lies in the plane up to the rounding to pixels.

use super::facing;
use crate::sampling::hash::{dimensions, pixel_key, unit};
use crate::sampling::hemisphere::Basis;
use curitiba_pipeline::backend::EffectJob;
use glam::{Mat4, Vec3, Vec4};
use std::f32::consts::PI;

/// How far above the tangent plane the depth difference begins to occlude, in radii: what tells an occluder from the surface
/// itself where its shading normal is some degrees off its plane.
pub const DEPTH_TOLERANCE: f32 = 0.1;

/// What the pixels of an occlusion have in common.
#[derive(Debug, Clone, Copy)]
pub struct Occlusion {
    clip_from_world: Mat4,
    eye: Vec3,
    width: f32,
    height: f32,
    seed: u32,
    radius: f32,
    intensity: f32,
    slices: u32,
    steps: u32,
}

/// A pixel and what it shows.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// World position.
    pub position: Vec3,
    /// Shading normal; 0 in the background.
    pub normal: Vec3,
}

/// A direction in which occluders are looked for.
struct Slice {
    /// `T`, unit length, across the view.
    across: Vec3,
    /// Clip coordinates of the pixel's position, and what a step of length 1 along `T` adds.
    clip: Vec4,
    clip_step: Vec4,
    /// World length along `T` that is a pixel of the picture.
    pixel: f32,
    /// Where in its interval each side's steps lie, 0..1.
    jitter: [f32; 2],
}

impl Occlusion {
    /// For a job whose parameters are valid.
    #[must_use]
    pub fn new(job: &EffectJob<'_>) -> Self {
        Self {
            clip_from_world: job.view.clip_from_world,
            eye: job.view.eye,
            width: job.width as f32,
            height: job.height as f32,
            seed: job.seed,
            radius: job.params.radius,
            intensity: job.params.intensity,
            slices: job.params.slices,
            steps: job.params.steps,
        }
    }

    /// Slice `index` of a pixel: its angle around the view is `π (index + u) / slices`, with `u` dimension 0 of counter 0 of the
    /// pixel's key; the sides' jitters are the dimensions of counter `1 + index`.
    fn slice(&self, key: u32, index: u32, basis: &Basis, position: Vec3) -> Slice {
        let offset = unit(dimensions(key, 0)[0]);
        let (sin, cos) = (PI * ((index as f32 + offset) / self.slices as f32)).sin_cos();
        let across = basis.tangent * cos + basis.bitangent * sin;
        let (clip, clip_step) =
            (self.clip_from_world * position.extend(1.0), self.clip_from_world * across.extend(0.0));
        // The derivative of x / w and y / w along `T`, in pixels.
        let rate =
            |value: f32, step: f32, side: f32| 0.5 * side * (step * clip.w - value * clip_step.w) / (clip.w * clip.w);
        let pixels = rate(clip.x, clip_step.x, self.width).hypot(rate(clip.y, clip_step.y, self.height));
        Slice { across, clip, clip_step, pixel: 1.0 / pixels, jitter: dimensions(key, 1 + index).map(unit) }
    }

    /// The pixel where `P + distance T` is seen; `None` outside the picture and in the middle pixel itself.
    #[inline]
    fn pixel_at(&self, slice: &Slice, distance: f32, center: (u32, u32)) -> Option<usize> {
        let clip = slice.clip + slice.clip_step * distance;
        if clip.w.is_nan() || clip.w <= 0.0 {
            return None;
        }
        let x = (clip.x / clip.w * 0.5 + 0.5) * self.width;
        let y = (0.5 - clip.y / clip.w * 0.5) * self.height;
        if !(x >= 0.0 && x < self.width && y >= 0.0 && y < self.height) {
            return None;
        }
        let (x, y) = (x as u32, y as u32);
        ((x, y) != center).then_some(y as usize * self.width as usize + x as usize)
    }

    /// The open share of the cosine-weighted hemisphere within the radius, to the power of the intensity, by horizons; 1 in the
    /// background. `read` gives the G-buffer's position of a pixel; all 0 is nothing.
    ///
    /// Jimenez, Wu, Pesce and Jarabo, "Practical Real-Time Strategies for Accurate Indirect Occlusion", SIGGRAPH 2016 course,
    /// section 4: with horizons `h1 <= 0 <= h2` and the projected normal's angle `γ`, all measured from `V`, a slice
    /// contributes `|n_p| (arc(h1) + arc(h2))`, `arc(h) = (-cos(2h - γ) + cos γ + 2h sin γ) / 4`. What differs here:
    /// - Slices are uniform in the angle around `V`, not in the picture's angle.
    /// - Where a pixel's middle is off the slice's plane, the position is moved into it along the tangent plane, so that a plane
    ///   seen at a grazing angle does not occlude itself.
    /// - Positions farther than the radius are ignored without a falloff: that is what a ray of this length meets.
    /// - The sum is divided by that of the open slices, not by their number: an open plane is exactly 1.
    #[must_use]
    #[inline]
    pub fn by_horizons(&self, shown: Shown, read: impl Fn(usize) -> [f32; 4]) -> f32 {
        let Some((view, normal)) = facing(self.eye, shown.position, shown.normal) else { return 1.0 };
        let to_eye = -view;
        let basis = Basis::around(to_eye);
        let key = pixel_key(shown.x, shown.y, self.seed);
        let (mut visible, mut whole) = (0.0, 0.0);
        for index in 0..self.slices {
            let slice = self.slice(key, index, &basis, shown.position);
            let aside = to_eye.cross(slice.across);
            let off = normal.dot(aside);
            let length_squared = 1.0 - off * off;
            // The normal is the slice plane's: it has no weight.
            if length_squared < 1e-6 {
                continue;
            }
            let shear = (aside - normal * off) / length_squared;
            let length = length_squared.sqrt();
            let (sin, cos) = (normal.dot(slice.across) / length, (normal.dot(to_eye) / length).max(0.0));
            let (sin, cos) = (sin.clamp(-1.0, 1.0), cos.min(1.0));
            // The cosines of the horizons, from that of the tangent plane upwards.
            let open = [-sin, sin];
            let mut horizons = open;
            if slice.pixel < self.radius {
                for (side, horizon) in horizons.iter_mut().enumerate() {
                    let towards = if side == 0 { 1.0 } else { -1.0 };
                    for step in 0..self.steps {
                        // Denser near the pixel.
                        let share = (step as f32 + slice.jitter[side]) / self.steps as f32;
                        let distance = slice.pixel + (self.radius - slice.pixel) * share * share;
                        let Some(pixel) = self.pixel_at(&slice, towards * distance, (shown.x, shown.y)) else {
                            continue;
                        };
                        let Some(delta) = difference(read(pixel), shown.position) else { continue };
                        if delta.length_squared() > self.radius * self.radius {
                            continue;
                        }
                        let delta = delta - shear * delta.dot(aside);
                        let (x, y) = (towards * delta.dot(slice.across), delta.dot(to_eye));
                        // Moving it may have brought a near pixel to the other side.
                        if x <= 0.0 {
                            continue;
                        }
                        *horizon = horizon.max(y / (x * x + y * y).sqrt());
                    }
                }
            }
            whole += length * (arc(open[0], 1.0, sin, cos) + arc(open[1], -1.0, sin, cos));
            visible += length * (arc(horizons[0], 1.0, sin, cos) + arc(horizons[1], -1.0, sin, cos));
        }
        if whole > 0.0 { (visible / whole).clamp(0.0, 1.0).powf(self.intensity) } else { 1.0 }
    }

    /// The open share of the samples around the pixel, to the power of the intensity, by the difference of depths; 1 in the
    /// background. `read` as for [`Self::by_horizons`].
    ///
    /// A sample is occluded where it is nearer to the camera than the tangent plane, that is, on the camera's side of it, by
    /// more than [`DEPTH_TOLERANCE`] radii, however much nearer (no range check; Mittring, "Finding Next Gen: CryEngine 2",
    /// SIGGRAPH 2007 course, section 8.5.4.3, has one for this reason). So a thing far in front darkens what is
    /// behind its outline. Samples are uniform in the disk of the radius across the view; those outside the picture do not
    /// count.
    #[must_use]
    #[inline]
    pub fn by_depths(&self, shown: Shown, read: impl Fn(usize) -> [f32; 4]) -> f32 {
        let Some((view, normal)) = facing(self.eye, shown.position, shown.normal) else { return 1.0 };
        let basis = Basis::around(-view);
        let key = pixel_key(shown.x, shown.y, self.seed);
        let rounding = 4.0 * f32::EPSILON * shown.position.abs().max_element();
        let tolerance = (DEPTH_TOLERANCE * self.radius).max(rounding);
        let (mut occluded, mut samples) = (0u32, 0u32);
        for index in 0..self.slices {
            let slice = self.slice(key, index, &basis, shown.position);
            for (jitter, towards) in slice.jitter.into_iter().zip([1.0, -1.0]) {
                for step in 0..self.steps {
                    let distance = self.radius * ((step as f32 + jitter) / self.steps as f32).sqrt();
                    let Some(pixel) = self.pixel_at(&slice, towards * distance, (shown.x, shown.y)) else { continue };
                    samples += 1;
                    let height = difference(read(pixel), shown.position).map_or(0.0, |delta| delta.dot(normal));
                    occluded += u32::from(height > tolerance);
                }
            }
        }
        let open = 1.0 - occluded as f32 / samples.max(1) as f32;
        open.powf(self.intensity)
    }
}

/// From a position to that of another pixel; `None` where that shows nothing.
#[inline]
fn difference(pixel: [f32; 4], position: Vec3) -> Option<Vec3> {
    let delta = Vec3::new(pixel[0], pixel[1], pixel[2]) - position;
    (pixel != [0.0; 4] && delta != Vec3::ZERO && delta.is_finite()).then_some(delta)
}

/// `(-cos(2h - γ) + cos γ + 2h sin γ) / 4` for a horizon `h = ±acos(cos_h)`.
#[inline]
fn arc(cos_h: f32, sign: f32, sin: f32, cos: f32) -> f32 {
    let cos_h = cos_h.clamp(-1.0, 1.0);
    let h = sign * cos_h.acos();
    let sin_h = sign * (1.0 - cos_h * cos_h).sqrt();
    let (cos_2h, sin_2h) = (2.0 * cos_h * cos_h - 1.0, 2.0 * sin_h * cos_h);
    0.25 * (cos - (cos_2h * cos + sin_2h * sin) + 2.0 * h * sin)
}
