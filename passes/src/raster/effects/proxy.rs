//! Boxes that approximate the surroundings of a cube map, for lookups from places other than the map's centre.
//!
//! A cube map holds what its centre sees. From another place the same direction hits another point, and the difference
//! is the larger the nearer that point is. With a box around the centre, a ray from any place in the box is followed to
//! the box's wall, and the map is looked up in the direction of that point from the centre (Bjorke, "Image-Based
//! Lighting", GPU Gems, 2004; Lagarde and Zanuttini, "Local image-based lighting with parallax-corrected cubemaps",
//! SIGGRAPH 2012 talks). In an empty room of the box's shape this is exact.
//!
//! Such boxes are usually placed by hand; this one is computed. The scene is drawn from the centre into six faces of
//! [`FACE`] x [`FACE`] pixels. A pixel's normal is negated if it points to the centre. The pixel then belongs to the side of
//! the box whose outward direction is nearest to that normal, with the pixel's distance along the side's axis. A side is
//! placed at the median of its pixels' distances, weighted by solid angle. From a place at distance `s` from the centre, the
//! lookup of a point at distance `t` has an angular error of about `s (1/t - 1/d)`, where `d` is the distance of the side. The
//! median is the `d` that minimises the sum of these errors, and outliers do not move it.

use super::cube::{self, FACES};
use curitiba_pipeline::backend::{Attachments, NO_TRIANGLE, View};
use curitiba_pipeline::gbuffer::GBuffer;
use glam::{Vec2, Vec3, Vec4};

/// Pixels along a side of the faces from which boxes are computed.
pub const FACE: u32 = 64;

/// Attachments of the faces from which boxes are computed.
pub const ATTACHMENTS: Attachments = Attachments { color: false, position: true, normal: true, triangle: true };

/// A ray whose unit direction has a component of at most this size along an axis counts as parallel to the two sides across that axis.
pub const LEAST_ALONG: f32 = 1e-6;

/// The viewpoint of a cube map, and the pane that its box must contain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// World position.
    pub center: Vec3,
    /// Nearest distance drawn.
    pub near: f32,
    /// Farthest distance drawn.
    pub far: f32,
    /// Half the sides of the pane's box.
    pub half: Vec3,
}

/// An axis-parallel box, relative to the cube map's centre, which it contains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proxy {
    /// Lowest corner; all coordinates are below 0.
    pub low: Vec3,
    /// Highest corner; all coordinates are above 0.
    pub high: Vec3,
}

impl Proxy {
    /// Computes the box for the surroundings of a cube map; it contains the pane. A side to which no pixel belongs is at
    /// the far distance.
    ///
    /// `draw` must draw the scene without glass, with [`ATTACHMENTS`], into the whole buffer.
    ///
    /// # Errors
    /// The errors of `draw`.
    pub fn find<E>(eye: &Eye, mut draw: impl FnMut(View, &mut GBuffer) -> Result<(), E>) -> Result<Self, E> {
        let mut seen: [Vec<(f32, f32)>; 6] = Default::default();
        let mut buffer = GBuffer::new(FACE, FACE, ATTACHMENTS);
        for face in 0..FACES {
            draw(cube::view(face, eye.center, eye.near, eye.far), &mut buffer)?;
            for index in 0..buffer.triangle.len() {
                if buffer.triangle[index] == NO_TRIANGLE {
                    continue;
                }
                let [position, normal] =
                    [&buffer.position, &buffer.normal].map(|values| Vec4::from_array(values[index]).truncate());
                if let Some((side, distance)) = side_of(position - eye.center, normal) {
                    seen[side].push((distance, solid_angle(index)));
                }
            }
        }
        let mut distance = |side: usize| {
            let least = eye.half[side / 2].max(eye.near);
            weighted_median(&mut seen[side]).unwrap_or(eye.far).max(least)
        };
        Ok(Self {
            low: -Vec3::new(distance(1), distance(3), distance(5)),
            high: Vec3::new(distance(0), distance(2), distance(4)),
        })
    }

    /// Follows a ray from `place` (relative to the centre) along a unit direction to the wall of the box, and returns
    /// the vector from the centre to that point. A place outside the box counts as the nearest place in it.
    #[must_use]
    #[inline]
    pub fn toward(&self, place: Vec3, direction: Vec3) -> Vec3 {
        let place = place.clamp(self.low, self.high);
        let mut way = f32::MAX;
        for axis in 0..3 {
            let along = direction[axis];
            if along.abs() > LEAST_ALONG {
                let side = if along > 0.0 { self.high[axis] } else { self.low[axis] };
                way = way.min((side - place[axis]) / along);
            }
        }
        place + direction * way
    }
}

/// The side of the box that a surface at `offset` from the centre belongs to, and its distance along that side's axis.
/// Sides 0 and 1 are +x and -x, and so on. `None` if the distance is not above 0 or not finite.
fn side_of(offset: Vec3, normal: Vec3) -> Option<(usize, f32)> {
    // The centre sees the inner side of the surface, so the normal that points away from the centre is the outward one.
    let outward = if normal.dot(offset) < 0.0 { -normal } else { normal };
    let axis = outward.abs().max_position();
    let negative = outward[axis] < 0.0;
    let distance = if negative { -offset[axis] } else { offset[axis] };
    (distance > 0.0 && distance.is_finite()).then_some((2 * axis + usize::from(negative), distance))
}

/// The solid angle of a pixel of a face, up to a factor.
fn solid_angle(index: usize) -> f32 {
    let size = FACE as usize;
    let at = (Vec2::new((index % size) as f32, (index / size) as f32) + 0.5) * (2.0 / size as f32) - 1.0;
    (1.0 + at.length_squared()).powf(-1.5)
}

/// The weighted median of pairs of value and weight: half of the weight lies below it. `None` for no pairs.
fn weighted_median(seen: &mut [(f32, f32)]) -> Option<f32> {
    seen.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let whole: f64 = seen.iter().map(|(_, weight)| f64::from(*weight)).sum();
    let mut below = 0.0;
    let reaches = |(_, weight): &&(f32, f32)| {
        below += f64::from(*weight);
        2.0 * below >= whole
    };
    seen.iter().find(reaches).map(|(value, _)| *value)
}
