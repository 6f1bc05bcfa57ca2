//! Mirrors: the planes of glass that a picture shows, and the cameras that see the mirrored scene.
//!
//! A ray from the eye hits a plane and is mirrored there. The mirrored ray lies on the line from the mirrored eye through
//! the same point of the plane. With the camera's own projection, that point is at the same pixel for both eyes. So in an
//! image of the scene from the mirrored camera, clipped at the plane, each pixel of the mirror shows exactly the hit of
//! the pixel's mirrored ray, without filtering. (Blinn and Newell 1976 mirror at planes in this way; Kilgard, "Improving
//! Shadows and Reflections via the Stencil Buffer", 1999, draws such images on hardware.)

use super::bounds::{Bounds, Frustum};
use super::planes::{GlassPlane, Glazing, NO_PLANE, agrees};
use curitiba_pipeline::backend::{EffectJob, NO_TRIANGLE, Rect, View};
use curitiba_pipeline::memory::{Refused, filled, resize};
use glam::{DMat4, DVec3, DVec4, Vec3, Vec4};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// The pixels that show a plane: their number, and the box around them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seen {
    /// Number of pixels.
    pub pixels: u32,
    /// First column and row.
    pub low: [u32; 2],
    /// Last column and row.
    pub high: [u32; 2],
}

impl Seen {
    /// No pixels.
    pub const NONE: Self = Self { pixels: 0, low: [u32::MAX; 2], high: [0; 2] };

    fn with(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            low: [0, 1].map(|axis: usize| self.low[axis].min(other.low[axis])),
            high: [0, 1].map(|axis: usize| self.high[axis].max(other.high[axis])),
        }
    }
}

/// The planes of glass in a picture.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Survey {
    /// The pixels of each plane.
    pub planes: Vec<Seen>,
    /// Number of glass pixels, including those that show no plane.
    pub glass: u64,
}

impl Survey {
    /// Visits all pixels, on all threads. `plane_of` receives the plane of each pixel: [`NO_PLANE`] where there is
    /// none, or where the shading normal is not the plane's.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn new(job: &EffectJob<'_>, glazing: &Glazing, plane_of: &mut Vec<u32>) -> Result<Self, Refused> {
        let width = job.width as usize;
        plane_of.clear();
        resize(plane_of, width * job.height as usize, NO_PLANE)?;
        let normals: Vec<Vec4> = glazing.planes.iter().map(GlassPlane::agreement).collect();
        let whole = Mutex::new(Self { planes: filled(Seen::NONE, normals.len())?, glass: 0 });
        if width == 0 || glazing.runs.is_empty() {
            return Ok(whole.into_inner().unwrap_or_else(PoisonError::into_inner));
        }
        plane_of.par_chunks_mut(width).enumerate().with_min_len(8).for_each(|(row, planes)| {
            // Neighbouring pixels usually show the same triangle, and so the same plane.
            let mut last = (NO_TRIANGLE, None);
            let (mut found, mut glass): (Vec<(u32, Seen)>, u64) = (Vec::new(), 0);
            let first = row * width;
            for ((column, triangle), plane_of) in (0u32..).zip(&job.triangle[first..first + width]).zip(planes) {
                if *triangle != last.0 {
                    last = (*triangle, glazing.plane_of(*triangle));
                }
                let Some(plane) = last.1 else { continue };
                glass += 1;
                let [x, y, z, _] = job.normal[first + column as usize];
                if normals.get(plane as usize).is_none_or(|normal| !agrees(Vec3::new(x, y, z), *normal)) {
                    continue;
                }
                *plane_of = plane;
                let place = [column, row as u32];
                let one = Seen { pixels: 1, low: place, high: place };
                match found.last_mut().filter(|(last, _)| *last == plane) {
                    Some((_, seen)) => *seen = seen.with(one),
                    None => found.push((plane, one)),
                }
            }
            if glass > 0 {
                let mut whole = whole.lock().unwrap_or_else(PoisonError::into_inner);
                whole.glass += glass;
                for (plane, seen) in found {
                    let known = &mut whole.planes[plane as usize];
                    *known = known.with(seen);
                }
            }
        });
        Ok(whole.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A plane that is drawn as a mirror in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirror {
    /// Index of the plane.
    pub plane: u32,
    /// The plane's unit normal; `w` is the square of the greatest sine between it and shading normals.
    pub normal: Vec4,
    /// The mirrored camera, with the viewport of the picture.
    pub view: View,
    /// The box around the pixels that show the mirror.
    pub pixels: Rect,
}

/// The mirrors of a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mirrors {
    /// Ordered by number of pixels, the most first; equals by plane index.
    pub chosen: Vec<Mirror>,
    /// Number of glass pixels, then number of glass pixels that show no mirror.
    pub glass_pixels: [u64; 2],
}

impl Mirrors {
    /// Chooses the planes that the most pixels show, at most `most` of them. `scene` is the box around the scene.
    #[must_use]
    pub fn choose(glazing: &Glazing, survey: &Survey, scene: &Bounds, camera: &View, most: u32) -> Self {
        let mut mirrors = Self { chosen: Vec::new(), glass_pixels: [survey.glass; 2] };
        let Some(camera) = Camera::new(camera, scene) else { return mirrors };
        let shown = (0u32..).zip(glazing.planes.iter().zip(&survey.planes)).filter(|(_, (_, seen))| seen.pixels > 0);
        let mut ranked: Vec<(u32, (&GlassPlane, &Seen))> = shown.collect();
        ranked.sort_by_key(|(_, (_, seen))| std::cmp::Reverse(seen.pixels));
        let views = ranked.into_iter().filter_map(|(index, (plane, seen))| {
            let view = camera.mirrored(plane)?;
            let [x, y] = seen.low;
            let pixels = Rect { x, y, width: seen.high[0] - x + 1, height: seen.high[1] - y + 1 };
            Some((Mirror { plane: index, normal: plane.agreement(), view, pixels }, u64::from(seen.pixels)))
        });
        for (mirror, pixels) in views.take(most as usize) {
            mirrors.chosen.push(mirror);
            mirrors.glass_pixels[1] -= pixels;
        }
        mirrors
    }
}

/// The picture's camera, prepared for mirroring.
struct Camera {
    /// Matrix to clip space, from positions relative to the eye in perspective, else from world positions.
    matrix: DMat4,
    /// Position of the eye; without perspective, a point far away.
    eye: DVec3,
    /// Mapping of depths.
    depth: Depth,
    /// [`View::footprint`].
    footprint: f32,
}

/// Depth mapping of mirrored cameras. They see up to the far end of the scene, as rays do, whatever the picture's far plane is.
enum Depth {
    /// In perspective, depth is `near / w`, where `near` is this number. Depth is 1 at the camera's near distance, and has the same relative
    /// precision at all distances.
    Near(f64),
    /// Without perspective, linear over the box around the scene.
    Scene(Bounds),
}

impl Camera {
    /// Prepares the camera of a view; `None` for a degenerate camera.
    fn new(view: &View, scene: &Bounds) -> Option<Self> {
        let eye = view.eye.as_dvec3();
        let (world, footprint) = (view.clip_from_world.as_dmat4(), view.footprint);
        if Frustum::new(&view.clip_from_world)?.depth_plane().is_none() {
            return Some(Self { matrix: world, eye, depth: Depth::Scene(*scene), footprint });
        }
        let matrix = match view.clip_from_eye {
            Some(matrix) => matrix.as_dmat4(),
            None => world * DMat4::from_translation(eye),
        };
        // Near distance in units of `w`: on the line from the eye along which `w` grows, the point where clip z equals
        // `w`.
        let (z, w) = (matrix.row(2), matrix.row(3));
        let forward = w.truncate().try_normalize()?;
        let near = z.w / (w.truncate().length() - z.truncate().dot(forward)) * w.truncate().length();
        // Slightly nearer, as a margin for rounding.
        let near = near * (1.0 - 1e-4);
        (near > 0.0 && near.is_finite()).then_some(Self { matrix, eye, depth: Depth::Near(near), footprint })
    }

    /// The camera mirrored at a plane, which sees only the eye's side of the plane. `None` where the eye is in the
    /// plane, up to rounding.
    fn mirrored(&self, plane: &GlassPlane) -> Option<View> {
        let distance = plane.distance(self.eye);
        let (normal, offset) =
            if distance < 0.0 { (-plane.normal, -plane.offset) } else { (plane.normal, plane.offset) };
        let height = distance.abs();
        let turn = DMat4::from_cols(
            (DVec3::X - 2.0 * normal.x * normal).extend(0.0),
            (DVec3::Y - 2.0 * normal.y * normal).extend(0.0),
            (DVec3::Z - 2.0 * normal.z * normal).extend(0.0),
            DVec4::W,
        );
        let mirrored_eye = self.eye - 2.0 * height * normal;
        let eye = mirrored_eye.as_vec3();
        let scale = plane.bounds.min.abs().max(plane.bounds.max.abs()).max_element();
        // Points within this distance count as lying in the mirror: the slack of the mirror's own glass, plus the
        // rounding of distances in 32-bit floats.
        let reach = match self.depth {
            Depth::Near(_) => plane.bounds.farthest_from(self.eye),
            Depth::Scene(_) => f64::from(scale),
        };
        let slack = plane.slack + reach * 4.0 * f64::from(f32::EPSILON);
        if height.is_nan() || height <= slack {
            return None;
        }
        let view = match &self.depth {
            Depth::Near(near) => {
                // Positions are relative to the rounded eye. The translation in `rest` corrects the matrix for the eye's rounding.
                let rest = turn * DMat4::from_translation(eye.as_dvec3() - mirrored_eye);
                let mut matrix = (self.matrix * rest).transpose();
                matrix.z_axis = DVec4::W * *near;
                let matrix = matrix.transpose();
                let above = (normal.dot(eye.as_dvec3()) - offset) - slack;
                View {
                    clip_from_world: (matrix * DMat4::from_translation(-eye.as_dvec3())).as_mat4(),
                    eye,
                    clip_from_eye: Some(matrix.as_mat4()),
                    clip_plane: Some(normal.extend(above).as_vec4()),
                    footprint: self.footprint,
                }
            }
            Depth::Scene(bounds) => {
                let mirror = DMat4::from_translation(2.0 * offset * normal) * turn;
                let mut matrix = (self.matrix * mirror).transpose();
                let z = matrix.z_axis;
                let (low, high) = (-bounds.farthest(-z), bounds.farthest(z));
                let margin = 0.01 * (high - low) + f64::MIN_POSITIVE;
                matrix.z_axis = (z - DVec4::W * (low - margin)) / (high - low + 2.0 * margin);
                View {
                    clip_plane: Some(normal.extend(-offset - slack).as_vec4()),
                    footprint: self.footprint,
                    ..View::new(matrix.transpose().as_mat4(), eye)
                }
            }
        };
        let finite = view.clip_plane.is_some_and(|plane| plane.is_finite()) && view.eye.is_finite();
        (finite && view.clip_from_world.is_finite() && view.projection().0.is_finite()).then_some(view)
    }
}
