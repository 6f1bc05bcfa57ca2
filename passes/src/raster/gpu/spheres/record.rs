//! The data from which the device intersects a sphere with the lines of sight of a picture.
//!
//! A point of depth z on the line of sight through the pixel (x, y) is F + z T in homogeneous coordinates. F, the point of depth 0, is a
//! linear function of x and y, and T is the same for all pixels. ([`LinesOfSight`](super::super::plane_depth::LinesOfSight) has the same
//! form, with F negated.) Here F and T are in coordinates in which the sphere has its centre at 0 and radius 1, rotated so that the x and
//! y of T are 0. The line hits the sphere where
//!
//! ```text
//! Fx² + Fy² + (Fz + z Tz)² = (Fw + z Tw)²
//! ```
//!
//! With ρ² = Fx² + Fy², K = Tz² - Tw², σ = Fw Tz - Fz Tw and β = Fw Tw - Fz Tz, the solutions are z = (β ± √(σ² - K ρ²)) / K.
//! With `+` the line enters the sphere as seen from the eye, with `-` it leaves it. At either hit the sphere's normal is
//! (Fx, Fy, (σ Tw ± √… Tz) / K), normalised. In perspective, Tz / Tw is the distance of the eye from the centre in radii, and K < 0
//! if the eye is inside.
//!
//! The device computes no small differences of large numbers, except at the outline, where √… is 0. The host computes such differences in
//! `f64` for each sphere: it gives Fx, Fy, σ, β, Fz and Fw as linear functions of the pixels from an *anchor* pixel in the sphere. So the
//! error of the outline is a few roundings of the sphere's size on the screen, however far away the sphere is.

use crate::raster::spheres::covered_pixels;
use curitiba_pipeline::backend::{RasterJob, Shade};
use curitiba_pipeline::scene::Sphere;
use glam::{DMat3, DMat4, DVec2, DVec3, DVec4, Vec2, Vec3, Vec4};
use std::ops::Range;

/// `Sphere` of the shader.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct SphereRecord {
    /// Fx, Fy, σ and β at the anchor, and their changes for a pixel to the right and down.
    at: Vec4,
    right: Vec4,
    down: Vec4,
    /// Fz and Fw likewise.
    ends: Vec2,
    ends_right: Vec2,
    ends_down: Vec2,
    /// Tz and Tw, scaled so that the greater magnitude is 1.
    axis: Vec2,
    /// K of the module's formula.
    k: f32,
    /// Factor of z, because F and T are scaled.
    scale: f32,
    /// Column and row of the anchor.
    anchor: Vec2,
    /// World directions of the three axes: this, `along` and `towards`.
    across: Vec3,
    /// Surface id plus 1.
    id: u32,
    along: Vec3,
    /// 1 if the sphere's inner side is culled, else 0.
    is_culled: u32,
    towards: Vec3,
    radius: f32,
    center: Vec3,
    unused: f32,
    /// Least x and y, greatest x and y of the pixels that the sphere covers, in normalised device coordinates.
    bounds: Vec4,
    diffuse: Vec4,
    glow: Vec4,
}

/// Data that all spheres of a job share.
#[derive(Debug)]
pub(super) struct Screen {
    /// Matrix from positions relative to `eye` to clip space, and the inverse matrix.
    matrix: DMat4,
    inverse: DMat4,
    eye: DVec3,
    /// Width and height in pixels.
    size: DVec2,
}

impl Screen {
    pub fn new(job: &RasterJob<'_>) -> Self {
        let (matrix, eye) = job.view.projection();
        let (matrix, eye) = (matrix.as_dmat4(), eye.as_dvec3());
        let size = DVec2::new(f64::from(job.viewport.width), f64::from(job.viewport.height));
        Self { matrix, inverse: matrix.inverse(), eye, size }
    }

    /// The columns and rows of the viewport that a sphere covers, with a margin; `None` if there are none.
    pub fn covered(&self, sphere: &Sphere) -> Option<[Range<usize>; 2]> {
        covered_pixels(sphere, (&self.matrix, self.eye), self.size.to_array())
    }

    /// The record of a sphere that covers `columns` and `rows`, without its colours. `None` where the camera or the sphere is so extreme
    /// that the record would not be finite.
    pub fn record(&self, sphere: &Sphere, [columns, rows]: &[Range<usize>; 2]) -> Option<SphereRecord> {
        let center = sphere.center.as_dvec3() - self.eye;
        let radius = f64::from(sphere.radius);
        // Maps homogeneous points to coordinates of the sphere, before the rotation of the axes.
        let own = |point: DVec4| ((point.truncate() - center * point.w) / radius).extend(point.w);
        let [x, y, t, rest] =
            [self.inverse.x_axis, self.inverse.y_axis, self.inverse.z_axis, self.inverse.w_axis].map(own);
        let axes = axes(t.truncate());
        let turned = |point: DVec4| (axes.transpose() * point.truncate()).extend(point.w);
        let [x, y, rest] = [x, y, rest].map(turned);
        let (right, down) = (x * (2.0 / self.size.x), y * (-2.0 / self.size.y));
        let anchor = self.anchor(center, [columns, rows]);
        let place = (anchor + 0.5) / self.size * 2.0 - 1.0;
        let at = x * place.x - y * place.y + rest;

        let axis = DVec2::new(t.truncate().length(), t.w);
        let size_of_t = axis.abs().max_element();
        let axis = axis / size_of_t;
        let extent = DVec2::new(columns.len() as f64, rows.len() as f64);
        let greatest = |v: DVec4| v.abs().max_element();
        let size_of_f = greatest(at).max(greatest(right) * extent.x).max(greatest(down) * extent.y);
        let scaled = [at, right, down].map(|point| point / size_of_f);
        let numbers = scaled.map(|f| {
            let (sigma, beta) = (f.w * axis.x - f.z * axis.y, f.w * axis.y - f.z * axis.x);
            DVec4::new(f.x, f.y, sigma, beta).as_vec4()
        });
        let ends = scaled.map(|f| DVec2::new(f.z, f.w).as_vec2());
        let k = (axis.x - axis.y) * (axis.x + axis.y);
        let scale = (size_of_f / size_of_t) as f32;
        let is_known = numbers.iter().all(|v| v.is_finite()) && ends.iter().all(|v| v.is_finite());
        if !(is_known && axis.is_finite() && scale.is_finite() && scale > 0.0) {
            return None;
        }
        let ndc = |column: usize, row: usize| {
            (DVec2::new(column as f64, row as f64) / self.size * 2.0 - 1.0) * DVec2::new(1.0, -1.0)
        };
        let (low, high) = (ndc(columns.start, rows.end), ndc(columns.end, rows.start));
        Some(SphereRecord {
            at: numbers[0],
            right: numbers[1],
            down: numbers[2],
            ends: ends[0],
            ends_right: ends[1],
            ends_down: ends[2],
            axis: axis.as_vec2(),
            k: k as f32,
            scale,
            anchor: anchor.as_vec2(),
            across: axes.x_axis.as_vec3(),
            id: 0,
            along: axes.y_axis.as_vec3(),
            is_culled: 0,
            towards: axes.z_axis.as_vec3(),
            radius: sphere.radius,
            center: sphere.center,
            unused: 0.0,
            bounds: DVec4::new(low.x, low.y, high.x, high.y).as_vec4(),
            diffuse: Vec4::ZERO,
            glow: Vec4::ZERO,
        })
    }

    /// The covered pixel that is nearest to the pixel of the sphere's centre.
    fn anchor(&self, center: DVec3, [columns, rows]: [&Range<usize>; 2]) -> DVec2 {
        let clip = self.matrix * center.extend(1.0);
        let low = DVec2::new(columns.start as f64, rows.start as f64);
        let high = DVec2::new((columns.end - 1) as f64, (rows.end - 1) as f64);
        let place = DVec2::new(0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w) * self.size;
        if clip.w > 0.0 && place.is_finite() { place.floor().clamp(low, high) } else { ((low + high) * 0.5).floor() }
    }
}

impl SphereRecord {
    /// The record with an id, the colours of its material, and whether the inner side is left out.
    pub fn shown(self, id: u32, shade: &Shade, is_culled: bool) -> Self {
        let glow = shade.glow.map_or(Vec3::ZERO, |glow| glow.color).extend(0.0);
        Self { id: id.wrapping_add(1), diffuse: shade.diffuse, glow, is_culled: u32::from(is_culled), ..self }
    }
}

/// Right-handed axes. The third axis points along `towards`, or along z if `towards` is 0.
fn axes(towards: DVec3) -> DMat3 {
    let third = towards.normalize_or(DVec3::Z);
    let (first, second) = third.any_orthonormal_pair();
    DMat3::from_cols(first, second, third)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::gpu::spheres::{Kind, TEXT};
    use std::mem::offset_of;
    use wgpu::naga;

    #[test]
    fn records_lie_as_the_shader_reads_them() {
        let module = naga::front::wgsl::parse_str(&Kind::whole().source()).expect("valid");
        let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Sphere")).expect("has the struct");
        let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("no struct") };
        let found: Vec<_> = members.iter().map(|m| (m.name.as_deref().expect("named"), m.offset as usize)).collect();
        macro_rules! offsets {
            ($($name:ident),*) => { vec![$((stringify!($name), offset_of!(SphereRecord, $name))),*] };
        }
        let expected = offsets![
            at, right, down, ends, ends_right, ends_down, axis, k, scale, anchor, across, id, along, is_culled,
            towards, radius, center, bounds, diffuse, glow
        ];
        assert_eq!((found, *span as usize), (expected, size_of::<SphereRecord>()));
        assert!(TEXT.contains("struct Sphere {"));
    }

    #[test]
    fn axes_are_a_rotation_in_every_direction() {
        for towards in
            [DVec3::ZERO, DVec3::X, DVec3::NEG_Z, DVec3::new(1e-30, 2e-30, -1e-30), DVec3::new(3.0, -4.0, 1e9)]
        {
            let axes = axes(towards);
            assert!((axes.determinant() - 1.0).abs() < 1e-12, "{towards}");
            assert!((axes.z_axis * towards.length() - towards).length() <= 1e-12 * towards.length(), "{towards}");
        }
    }
}
