//! Boxes that stand for what a cube map sees, so that it can be looked up from beside its centre.
//!
//! A cube map knows what its centre sees. From another place the same direction meets something else, the more so the nearer
//! that is. With a box around the centre a ray from any place in it is followed to the box, and the map is asked in the direction in which
//! the centre sees that point (Bjorke, "Image-Based Lighting", GPU Gems, 2004; Lagarde and Zanuttini, "Local image-based
//! lighting with parallax-corrected cubemaps", SIGGRAPH 2012 talks). In a room that is the box, this is exact.
//!
//! Those boxes are placed by hand; this one is found. The scene is drawn from the centre into six faces of [`FACE`] x [`FACE`] pixels.
//! What a pixel sees belongs to the side of the box that its normal faces, at its distance along that axis. A side lies at the
//! median of these distances, weighted by solid angle. From a place `s` beside the centre, what lies at distance `t` is looked up about
//! `s (1/t - 1/d)` beside its direction if the side is at `d`: the median is the `d` of which the sum of these angles is least, and
//! far or near exceptions do not move it.

use super::cube::{self, FACES};
use curitiba_pipeline::backend::{Attachments, NO_TRIANGLE, View};
use curitiba_pipeline::gbuffer::GBuffer;
use glam::{Vec2, Vec3, Vec4};

/// Pixels a side of a face that boxes are found from.
pub const FACE: u32 = 64;

/// What is drawn of a face.
pub const ATTACHMENTS: Attachments = Attachments { color: false, position: true, normal: true, triangle: true };

/// Components of unit directions below this meet no side across.
pub const LEAST_ALONG: f32 = 1e-6;

/// What a cube map sees from, and what has to lie in its box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// Where it is, world.
    pub center: Vec3,
    /// Nearest distance drawn.
    pub near: f32,
    /// Farthest distance drawn.
    pub far: f32,
    /// Half of the sides of the pane around it.
    pub half: Vec3,
}

/// A box with sides along the axes. Corners are relative to the cube map's centre, which it contains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proxy {
    /// Below 0.
    pub low: Vec3,
    /// Above 0.
    pub high: Vec3,
}

impl Proxy {
    /// What stands for the surroundings of a cube map; contains its pane. A side that nothing faces is as far as the map sees.
    ///
    /// `draw` draws the scene without glass, with [`ATTACHMENTS`], into the whole of a buffer.
    ///
    /// # Errors
    /// Those of `draw`.
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

    /// From a place, relative to the centre, along a unit direction: the direction in which the centre sees where the box is left. A place outside
    /// counts as the nearest one in the box.
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

/// The side that what is seen at `offset` from the centre belongs to, and its distance along that axis: 0 and 1 are +x and -x.
fn side_of(offset: Vec3, normal: Vec3) -> Option<(usize, f32)> {
    // Turned to the centre: the side faces it.
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

/// The value below which half of the weight lies; values and weights.
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
