//! An independent rasteriser: exact integer edge functions on snapped corners. Where clipping would be needed, it uses
//! homogeneous coordinates in 64-bit floats instead of clipping.

use curitiba_pipeline::backend::{NO_TRIANGLE, RasterJob};
use glam::{DMat3, DMat4, DVec3, Vec4};

/// The reference's result for a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// The nearest triangle, or [`NO_TRIANGLE`].
    pub triangle: u32,
    /// Its depth.
    pub depth: f64,
    /// Whether another result is as good: a clipped edge passes within 1/100 pixel, or two depths are nearly equal.
    pub doubtful: bool,
}

/// Two depths closer than this may be ordered either way in 32-bit floats.
const DEPTH_NOISE: f64 = 1e-5;

/// Draws by testing every triangle at every pixel of the viewport; the top row comes first.
pub fn draw(job: &RasterJob<'_>) -> Vec<Seen> {
    let (width, height) = (job.viewport.width, job.viewport.height);
    let mut seen = vec![Seen { triangle: NO_TRIANGLE, depth: 0.0, doubtful: false }; (width * height) as usize];
    for triangle in 0..job.scene.geometry.triangles.len() as u32 {
        let cover = Cover::new(job, triangle);
        let [left, right] = cover.columns(width);
        for (index, pixel) in seen.iter_mut().enumerate() {
            let (x, y) = (index as u32 % width, index as u32 / width);
            if x < left || x > right {
                continue;
            }
            let (depth, doubtful) = cover.at(x, y);
            let Some(depth) = depth else {
                // An uncertain miss matters only where the triangle would be visible.
                pixel.doubtful |= doubtful;
                continue;
            };
            if (depth - pixel.depth).abs() < DEPTH_NOISE && pixel.triangle != NO_TRIANGLE {
                pixel.doubtful = true;
            } else if depth > pixel.depth {
                // A nearer triangle replaces uncertainty behind it.
                *pixel = Seen { triangle, depth, doubtful };
            }
        }
    }
    seen
}

enum Cover {
    Snapped { corners: [[i128; 2]; 3], depth: [f64; 3], origin: [i128; 2] },
    Homogeneous { inverse: DMat3, depth: DVec3, size: [f64; 2] },
    Nothing,
}

impl Cover {
    fn new(job: &RasterJob<'_>, triangle: u32) -> Self {
        let corners = job.scene.geometry.corners(triangle);
        let clip = corners.map(|p| job.view.clip_from_world * p.extend(1.0));
        let port = job.viewport;
        let tame = |c: &Vec4| c.z >= 0.0 && c.z <= c.w && c.w > 0.0 && c.x.abs() < 8.0 * c.w && c.y.abs() < 8.0 * c.w;
        if clip.iter().all(tame) {
            let snapped = clip.map(|c| {
                let inv_w = 1.0 / c.w;
                let x = port.x as f32 + (c.x * inv_w * 0.5 + 0.5) * port.width as f32;
                let y = port.y as f32 + (0.5 - c.y * inv_w * 0.5) * port.height as f32;
                [x, y].map(|pixels| (f64::from(pixels) * 256.0).round_ties_even() as i128)
            });
            let depth = clip.map(|c| f64::from(c.z) / f64::from(c.w));
            return Self::Snapped { corners: snapped, depth, origin: [port.x, port.y].map(i128::from) };
        }
        let exact = DMat4::from_cols_array(&job.view.clip_from_world.to_cols_array().map(f64::from));
        let clip = corners.map(|p| exact * p.as_dvec3().extend(1.0));
        let matrix = DMat3::from_cols_array_2d(&clip.map(|c| [c.x, c.y, c.w]));
        if matrix.determinant().abs() < 1e-12 {
            return Self::Nothing;
        }
        let depth = DVec3::from_array(clip.map(|c| c.z));
        Self::Homogeneous { inverse: matrix.inverse(), depth, size: [port.width, port.height].map(f64::from) }
    }

    /// The columns to test: all between the corners, and one more on each side.
    fn columns(&self, width: u32) -> [u32; 2] {
        let Self::Snapped { corners, origin, .. } = self else { return [0, width] };
        let column = |x: i128| (x.div_euclid(256) - origin[0]).clamp(-1, i128::from(width));
        let least = corners.iter().map(|corner| column(corner[0])).min().expect("three corners");
        let most = corners.iter().map(|corner| column(corner[0])).max().expect("three corners");
        [(least - 1).max(0) as u32, (most + 1) as u32]
    }

    /// The depth at a pixel centre that the triangle covers, and whether that is uncertain.
    fn at(&self, x: u32, y: u32) -> (Option<f64>, bool) {
        match self {
            Self::Nothing => (None, false),
            Self::Snapped { corners, depth, origin } => (snapped(corners, depth, origin, x, y), false),
            Self::Homogeneous { inverse, depth, size } => {
                let at = |dx: f64, dy: f64| {
                    let ndc_x = (f64::from(x) + 0.5 + dx) / size[0] * 2.0 - 1.0;
                    let ndc_y = 1.0 - (f64::from(y) + 0.5 + dy) / size[1] * 2.0;
                    let weights = *inverse * DVec3::new(ndc_x, ndc_y, 1.0);
                    let depth = weights.dot(*depth);
                    // Nothing is drawn beyond the near and far planes. On them, rounding decides.
                    (weights.min_element() >= 0.0 && (0.0..=1.0).contains(&depth)).then_some(depth)
                };
                let centre = at(0.0, 0.0);
                let around = [(0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)];
                let doubtful = around.iter().any(|(dx, dy)| at(*dx, *dy).is_some() != centre.is_some());
                (centre, doubtful)
            }
        }
    }
}

fn snapped(corners: &[[i128; 2]; 3], depth: &[f64; 3], origin: &[i128; 2], x: u32, y: u32) -> Option<f64> {
    let p = [(i128::from(x) + origin[0]) * 256 + 128, (i128::from(y) + origin[1]) * 256 + 128];
    let cross =
        |a: [i128; 2], b: [i128; 2], c: [i128; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let area = cross(corners[0], corners[1], corners[2]);
    if area == 0 {
        return None;
    }
    let mut weights = [0.0; 3];
    for opposite in 0..3 {
        let (a, b) = (corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]);
        let value = cross(a, b, p) * area.signum();
        // The edge in clockwise direction, with y down.
        let (dx, dy) = if area > 0 { (b[0] - a[0], b[1] - a[1]) } else { (a[0] - b[0], a[1] - b[1]) };
        let top_or_left = (dy == 0 && dx > 0) || dy < 0;
        if value < 0 || (value == 0 && !top_or_left) {
            return None;
        }
        weights[opposite] = value as f64 / area.abs() as f64;
    }
    Some(weights[0] * depth[0] + weights[1] * depth[1] + weights[2] * depth[2])
}

/// The difference of a picture of triangle ids from the reference.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Difference {
    /// Pixels compared.
    pub compared: usize,
    /// Compared pixels that a triangle covers in the reference.
    pub covered: usize,
    /// Uncertain pixels, which are not compared.
    pub doubtful: usize,
    /// Compared pixels with another triangle.
    pub wrong: usize,
}

/// Compares the triangle ids of a picture of the viewport's size.
pub fn compare(seen: &[Seen], triangles: &[u32]) -> Difference {
    assert_eq!(seen.len(), triangles.len());
    let mut difference = Difference::default();
    for (seen, triangle) in seen.iter().zip(triangles) {
        if seen.doubtful {
            difference.doubtful += 1;
        } else {
            difference.compared += 1;
            difference.covered += usize::from(seen.triangle != NO_TRIANGLE);
            difference.wrong += usize::from(seen.triangle != *triangle);
        }
    }
    difference
}
