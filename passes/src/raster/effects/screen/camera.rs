//! The camera of a picture, and the pieces of surfaces that its pixels show.

use crate::raster::effects::bounds::Frustum;
use curitiba_pipeline::backend::View;
use glam::{DMat3, DMat4, DVec3, DVec4, Vec3, Vec4};

/// Least cosine between a surface's normal and the direction to the camera. Surfaces at a more grazing angle are
/// treated as if they had this cosine.
pub const LEAST_COSINE: f32 = 1e-3;

/// Tolerated gap between the pieces of neighbouring pixels, in pixel sides: the gap where shading normals deviate 14
/// degrees from the triangles'.
pub const SLACK: f64 = 0.25;

/// Maps world positions to places on the screen. Columns and rows are in pixels from the upper left corner. *Nearness*
/// is the inverse of the depth in perspective, and the negative depth without; it changes linearly along a line on the
/// screen. Depths are distances along the viewing direction, in scene units.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ScreenCamera {
    /// With a position `p` relative to [`Self::from`], the dot product with `(p, 1)` is column times depth; without
    /// perspective it is the column.
    pub columns: Vec4,
    /// The same for rows.
    pub rows: Vec4,
    /// The same for depths.
    pub depths: Vec4,
    /// Origin of the positions: in perspective the eye. `w` is 1 in perspective, else 0.
    pub from: Vec4,
    /// Step from a column to the next on the plane at depth 1; without perspective at every depth. `w` is the nearness
    /// of the near plane.
    pub right: Vec4,
    /// Step from a row to the next, on the same plane. `w` is the nearness of the farthest depth.
    pub down: Vec4,
    /// Unit viewing direction through the middle. `w` is [`SLACK`] at depth 1 in scene units; without perspective at
    /// every depth.
    pub forward: Vec4,
}

impl ScreenCamera {
    /// As [`ScreenCamera::new`], but all zeros for a degenerate matrix. For such a blind camera no position has a pixel, and all depths are 0.
    #[must_use]
    pub fn or_blind(view: &View, width: u32, height: u32) -> Self {
        Self::new(view, width, height).unwrap_or_else(bytemuck::Zeroable::zeroed)
    }

    /// The camera of a view for pictures of this size; `None` for a degenerate matrix.
    #[must_use]
    pub fn new(view: &View, width: u32, height: u32) -> Option<Self> {
        let perspective = Frustum::new(&view.clip_from_world)?.depth_plane().is_some();
        let from = if perspective { view.eye.as_dvec3() } else { DVec3::ZERO };
        let matrix = match view.clip_from_eye.filter(|_| perspective) {
            Some(matrix) => matrix.as_dmat4(),
            None => view.clip_from_world.as_dmat4() * DMat4::from_translation(from),
        };
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| matrix.row(row));
        let (columns, rows) = ((x + w) * (0.5 * f64::from(width)), (w - y) * (0.5 * f64::from(height)));
        // In perspective, depth 1 is a scene unit from the eye. Without, depth 0 is the near plane, where clip z is 1.
        let (scale, depths, near, far) = if perspective {
            let length = w.truncate().length();
            let near = z.w / (length - z.dot(w / length));
            (length, w / length, 1.0 / near, 0.0)
        } else {
            let length = (z / w.w).truncate().length();
            (w.w, (DVec4::W - z / w.w) / length, 0.0, -1.0 / length)
        };
        let (columns, rows) = (columns / scale, rows / scale);
        let pixels_of = DMat3::from_cols(columns.truncate(), rows.truncate(), depths.truncate()).transpose();
        let sight = pixels_of.inverse();
        let slack = SLACK * sight.x_axis.length();
        let camera = Self {
            columns: columns.as_vec4(),
            rows: rows.as_vec4(),
            depths: depths.as_vec4(),
            from: from.as_vec3().extend(f32::from(u8::from(perspective))),
            right: sight.x_axis.as_vec3().extend(near as f32),
            down: sight.y_axis.as_vec3().extend(far as f32),
            forward: depths.truncate().normalize().as_vec3().extend(slack as f32),
        };
        let known = [camera.columns, camera.rows, camera.depths, camera.right, camera.down, camera.forward];
        known.iter().all(|value| value.is_finite()).then_some(camera)
    }

    /// Whether the camera has perspective: all lines of sight meet in the eye.
    #[must_use]
    #[inline]
    pub fn perspective(&self) -> bool {
        self.from.w != 0.0
    }

    /// Lines of sight, relative to [`Self::from`]. In perspective, the first vector is the point at depth 1 on the line through the centre of
    /// the first pixel. Otherwise it is the position that this pixel shows at depth 0, and the second vector is the change of the position
    /// for one unit of depth. Zeros for a blind camera.
    #[must_use]
    pub fn sights(&self) -> [Vec3; 2] {
        let rows = [self.columns, self.rows, self.depths].map(Vec4::as_dvec4);
        let of_pixels = DMat3::from_cols(rows[0].truncate(), rows[1].truncate(), rows[2].truncate()).transpose();
        if of_pixels.determinant() == 0.0 {
            return [Vec3::ZERO; 2];
        }
        let sight = of_pixels.inverse();
        let at = if self.perspective() { DVec3::new(0.5, 0.5, 1.0) } else { DVec3::new(0.5, 0.5, 0.0) };
        let corner = sight * (at - DVec3::new(rows[0].w, rows[1].w, rows[2].w));
        [corner, sight.z_axis].map(|sight| sight.as_vec3())
    }

    /// Column, row and nearness of a position.
    #[must_use]
    #[inline]
    pub fn place(&self, position: Vec3) -> Vec3 {
        let [column, row, depth] =
            [self.columns, self.rows, self.depths].map(|row| row.dot((position - self.from.truncate()).extend(1.0)));
        if self.perspective() {
            Vec3::new(column / depth, row / depth, 1.0 / depth)
        } else {
            Vec3::new(column, row, -depth)
        }
    }

    /// Whether a place with this nearness lies at most `depth` plus [`SLACK`] behind a place with the nearness `other`.
    #[must_use]
    #[inline]
    pub fn is_within(&self, nearness: f32, other: f32, depth: f32) -> bool {
        let reach =
            if self.perspective() { (depth * other + self.forward.w) * nearness } else { depth + self.forward.w };
        other - nearness <= reach
    }
}

/// The surface that a pixel shows, as a piece of a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Column, row and nearness of the pixel's position.
    pub place: Vec3,
    /// Change of the nearness per column and per row.
    pub slope: [f32; 2],
    /// Unit normal, negated if it points away from the camera.
    pub normal: Vec3,
}

impl Piece {
    /// The piece for a position and a normal of a G-buffer; `None` where the pixel shows nothing.
    #[must_use]
    #[inline]
    pub fn new(camera: &ScreenCamera, position: [f32; 4], normal: [f32; 4]) -> Option<Self> {
        let position = Vec4::from_array(position).truncate();
        let normal = Vec4::from_array(normal).truncate().try_normalize()?;
        let place = camera.place(position);
        let away = if camera.perspective() { position - camera.from.truncate() } else { camera.forward.truncate() };
        if !place.is_finite() || (camera.perspective() && place.z <= 0.0) {
            return None;
        }
        let cosine = normal.dot(away);
        let normal = if cosine > 0.0 { -normal } else { normal };
        let slant = cosine.abs().max(LEAST_COSINE * away.length());
        let [across, down] = [camera.right, camera.down].map(|step| -normal.dot(step.truncate()) / slant);
        // In perspective, the nearness changes within a pixel by no more than the nearness of the position: beyond the plane's
        // horizon, where the nearness is 0, the plane is not visible.
        let sum = across.abs() + down.abs();
        let scale = if camera.perspective() && sum > place.z { place.z / sum } else { 1.0 };
        Some(Self { place, slope: [across * scale, down * scale], normal })
    }

    /// Nearness of the plane at a column and row.
    #[must_use]
    #[inline]
    pub fn nearness(&self, column: f32, row: f32) -> f32 {
        self.place.z + self.slope[0] * (column - self.place.x) + self.slope[1] * (row - self.place.y)
    }

    /// Greatest nearness within a pixel.
    #[must_use]
    #[inline]
    pub fn nearest(&self, column: u32, row: u32) -> f32 {
        let end = |first: u32, slope: f32| first as f32 + f32::from(u8::from(slope > 0.0));
        self.nearness(end(column, self.slope[0]), end(row, self.slope[1]))
    }
}
