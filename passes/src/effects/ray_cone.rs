//! Ray cones: at which mip level textures are read at hits (Akenine-Möller and others, "Texture Level of Detail Strategies for Real-Time Ray
//! Tracing", Ray Tracing Gems, chapter 20, 2019; and "Improved Shader and Texture Level of Detail Using Ray Cones", JCGT 10(1), 2021).
//!
//! A cone has a width, across the ray, and a spread, by which the width grows for each scene unit. To first order, both describe a narrow
//! bundle of rays in the plane of incidence. Both have a sign: a concave mirror or a lens makes a bundle converge, and behind its focus the
//! width is below 0. A facet of a rough surface counts as smooth. A direction chosen at random does not widen the cone, because the mean
//! over many of them filters by itself.
//!
//! Programs that read level 0 are compiled with [`LevelZero`], which takes no space and no time.

use curitiba_pipeline::backend::PixelCone;
use curitiba_pipeline::scene::Geometry;
use curitiba_pipeline::scene::texture::{Texture, lod_of_area};
use glam::Vec3;

/// The area of a texture that a lookup covers.
pub trait Footprint: Copy {
    /// An unknown footprint: level 0.
    const NONE: Self;

    /// The mip level of a texture at which the footprint covers one texel.
    fn level(self, texture: &Texture) -> f32;
}

/// The bundle of rays that a path represents.
pub trait Cone: Copy {
    /// The type of the area that the cone covers on textures.
    type Footprint: Footprint;

    /// The cone of a pixel, at a distance from the eye.
    fn of_pixel(pixel: PixelCone, distance: f32) -> Self;

    /// The cone after `distance` scene units.
    #[must_use]
    fn along(self, distance: f32) -> Self;

    /// The cone after a mirror; see [`RayCone::mirrored`]. [`LevelZero`] does not call `curvature`.
    #[must_use]
    fn mirrored(self, curvature: impl FnOnce() -> f32, cos: f32) -> Self;

    /// The cone after an interface; see [`RayCone::refracted`].
    #[must_use]
    fn refracted(self, curvature: impl FnOnce() -> f32, cos: [f32; 2], index: f32) -> Self;

    /// The area that the cone covers on the textures of a triangle that it hits in a unit direction.
    fn footprint(self, geometry: &Geometry, triangle: u32, direction: Vec3) -> Self::Footprint;
}

/// Every texture is read at level 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LevelZero;

impl Footprint for LevelZero {
    const NONE: Self = Self;

    #[inline(always)]
    fn level(self, _: &Texture) -> f32 {
        0.0
    }
}

impl Cone for LevelZero {
    type Footprint = Self;

    #[inline(always)]
    fn of_pixel(_: PixelCone, _: f32) -> Self {
        Self
    }

    #[inline(always)]
    fn along(self, _: f32) -> Self {
        self
    }

    #[inline(always)]
    fn mirrored(self, _: impl FnOnce() -> f32, _: f32) -> Self {
        self
    }

    #[inline(always)]
    fn refracted(self, _: impl FnOnce() -> f32, _: [f32; 2], _: f32) -> Self {
        self
    }

    #[inline(always)]
    fn footprint(self, _: &Geometry, _: u32, _: Vec3) -> Self {
        self
    }
}

/// A cone, at a point of its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayCone {
    /// Width across the axis, in scene units; below 0 behind a focus.
    pub width: f32,
    /// By how much the width grows for each scene unit; below 0 before a focus.
    pub spread: f32,
}

/// The area that a lookup covers in texture coordinates: the square of the longer axis of the covered ellipse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureArea(pub f32);

impl Footprint for TextureArea {
    const NONE: Self = Self(0.0);

    fn level(self, texture: &Texture) -> f32 {
        let size = texture.size();
        lod_of_area(self.0 * (size.x * size.y))
    }
}

impl Cone for RayCone {
    type Footprint = TextureArea;

    fn of_pixel(PixelCone { width, spread }: PixelCone, distance: f32) -> Self {
        Self { width: width + spread * distance, spread }
    }

    fn along(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// The cone after a mirror of this curvature k, where `cos` is the cosine of the angle of incidence. Over the width w the normal rotates by δ =
    /// k w / cos, and the direction by 2 δ.
    fn mirrored(self, curvature: impl FnOnce() -> f32, cos: f32) -> Self {
        Self { spread: self.spread + 2.0 * self.turn(curvature(), cos), ..self }
    }

    /// The cone after an interface of this curvature, with the cosines of the angles of incidence i and refraction t; `index` is the refractive
    /// index n of the far side over that of the near side. By the derivative of Snell's law, sin i = n sin t, t changes by m = cos i / (n cos t)
    /// times the change of i. Over the width, i changes by the spread plus the rotation δ of the normal. The direction rotates by the change of t
    /// minus δ.
    fn refracted(self, curvature: impl FnOnce() -> f32, [cos, cos_refracted]: [f32; 2], index: f32) -> Self {
        let rate = cos / (index * cos_refracted);
        let spread = rate * self.spread + (rate - 1.0) * self.turn(curvature(), cos);
        Self { width: self.width * (cos_refracted / cos), spread }
    }

    /// In the triangle's plane the cone covers an ellipse whose longer axis is w / |cos|. The square of this axis is converted to texture
    /// coordinates by the ratio of the triangle's area in texture coordinates to its area in the scene.
    fn footprint(self, geometry: &Geometry, triangle: u32, direction: Vec3) -> TextureArea {
        if geometry.texcoords.len() != geometry.positions.len() {
            return TextureArea::NONE;
        }
        let [a, b, c] = geometry.corners(triangle);
        let [ta, tb, tc] = geometry.triangles[triangle as usize].map(|vertex| geometry.texcoords[vertex as usize]);
        let normal = (b - a).cross(c - a);
        let side = self.width / normal.dot(direction);
        TextureArea((tb - ta).perp_dot(tc - ta).abs() * normal.length() * (side * side))
    }
}

impl RayCone {
    /// Rotation in radians, over the cone's width, of the normal of a surface of this curvature; `cos` is the cosine of the angle of incidence.
    fn turn(self, curvature: f32, cos: f32) -> f32 {
        // A plane's normal does not rotate, even at a cosine of 0.
        if curvature == 0.0 { 0.0 } else { curvature * self.width / cos }
    }
}

/// The curvature of a triangle with these corners and vertex normals, in 1 / scene units: above 0 where the normals spread. It is the mean of
/// the curvatures along the sides, weighted by the sides' squared lengths; exact on a sphere.
#[must_use]
pub fn curvature(corners: [Vec3; 3], normals: [Vec3; 3]) -> f32 {
    let normals = normals.map(Vec3::normalize_or_zero);
    let (mut turn, mut length) = (0.0, 0.0);
    for (from, to) in [(0, 1), (1, 2), (2, 0)] {
        let side = corners[to] - corners[from];
        turn += (normals[to] - normals[from]).dot(side);
        length += side.length_squared();
    }
    if length > 0.0 { turn / length } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    const WHOLE: RayCone = RayCone { width: 0.01, spread: 0.002 };

    #[test]
    fn programs_that_read_level_0_carry_nothing() {
        assert_eq!(size_of::<LevelZero>(), 0);
        let never = || unreachable!("the curvature does not count");
        let texture = Texture::new("one".to_owned(), 4, 4, vec![[9; 4]; 16]);
        let same = LevelZero.along(3.0).mirrored(never, 0.5).refracted(never, [0.5, 0.8], 1.5);
        assert_eq!(same.footprint(&Geometry::default(), 7, Vec3::X).level(&texture), 0.0);
    }

    /// A cone through a slab keeps its spread; its width grows by the spread times the equivalent path length in air.
    #[test]
    fn two_parallel_faces_undo_each_others_bending() {
        for (degrees, index) in [(0.0_f32, 1.5_f32), (50.0, 1.5), (80.0, 2.4), (30.0, 0.7)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let inner = (1.0 - (sin / index).powi(2)).sqrt();
            let inside = WHOLE.refracted(|| 0.0, [cos, inner], index);
            // The étendue of a bundle: width, spread and index keep their product.
            assert!((inside.width * inside.spread * index / (WHOLE.width * WHOLE.spread) - 1.0).abs() < 1e-5);
            let after = inside.along(2.0).refracted(|| 0.0, [inner, cos], index.recip());
            assert!((after.spread / WHOLE.spread - 1.0).abs() < 1e-5, "{degrees} {index}: {after:?}");
            let longer = WHOLE.spread * 2.0 * (cos / inner).powi(2) / index;
            assert!((after.width - WHOLE.width - longer).abs() < 1e-7, "{degrees} {index}: {after:?}");
        }
    }

    /// The focus of a ball lies n / (2 (n - 1)) radii behind its centre; the focus of a convex mirror lies half a radius behind its surface
    /// (Hecht, Optics, sections 5.2 and 5.4).
    #[test]
    fn balls_and_mirrors_have_their_focus() {
        let parallel = RayCone { spread: 0.0, ..WHOLE };
        for (index, radius) in [(1.5, 1.0), (1.33, 20.0), (1.9, 0.01)] {
            let inside = parallel.refracted(|| 1.0 / radius, [1.0; 2], index).along(2.0 * radius);
            let after = inside.refracted(|| -1.0 / radius, [1.0; 2], index.recip());
            let focus = radius + after.width / -after.spread;
            assert!((focus / radius - index / (2.0 * (index - 1.0))).abs() < 1e-4, "{index} {radius}: {focus}");
            let mirrored = parallel.mirrored(|| 1.0 / radius, 1.0);
            assert!((mirrored.width / mirrored.spread / radius - 0.5).abs() < 1e-6);
            let focused = parallel.mirrored(|| -1.0 / radius, 1.0).along(0.75 * radius);
            assert!((focused.width / parallel.width + 0.5).abs() < 1e-6, "behind the focus: {focused:?}");
        }
        // A plane mirror changes nothing, at any angle.
        assert_eq!([1.0, 1e-9, 0.0].map(|cos| WHOLE.mirrored(|| 0.0, cos)), [WHOLE; 3]);
    }

    #[test]
    fn the_curvature_of_a_sphere_is_exact_and_that_of_planes_0() {
        let corners =
            [Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.3, -0.2, 0.8), Vec3::new(-0.1, 0.1, 1.0)].map(Vec3::normalize);
        for radius in [0.01_f32, 1.0, 300.0] {
            // Vertex normals need not be of length 1.
            let found = curvature(corners.map(|corner| corner * radius), corners.map(|corner| corner * 3.0));
            assert!((found * radius - 1.0).abs() < 1e-4, "{radius}: {found}");
            let inwards = curvature(corners.map(|corner| corner * radius), corners.map(|corner| -corner));
            assert!((inwards * radius + 1.0).abs() < 1e-4);
        }
        assert_eq!(curvature(corners, [Vec3::new(0.3, 0.5, 0.2); 3]), 0.0);
        assert_eq!(curvature([Vec3::ONE; 3], corners), 0.0, "a triangle without sides");
    }

    #[test]
    fn footprints_follow_the_size_of_texels_and_the_angle() {
        let level = |scale: f32, repeat: f32, cone: RayCone, direction: Vec3| {
            let geometry = Geometry {
                positions: [Vec3::ZERO, Vec3::X, Vec3::Z].map(|corner| corner * scale).to_vec(),
                texcoords: [Vec2::ZERO, Vec2::X, Vec2::Y].map(|corner| corner * repeat).to_vec(),
                triangles: vec![[0, 1, 2]],
                ..Geometry::default()
            };
            let texture = Texture::new("it".to_owned(), 64, 16, vec![[9; 4]; 64 * 16]);
            cone.footprint(&geometry, 0, direction).level(&texture)
        };
        let cone = RayCone { width: 0.25, spread: 0.0 };
        // 32 texels a scene unit, as the mean of both sides: 8 across the cone.
        assert!((level(1.0, 1.0, cone, Vec3::NEG_Y) - 3.0).abs() < 1e-5);
        assert!((level(1.0, 2.0, cone, Vec3::NEG_Y) - 4.0).abs() < 1e-5);
        assert!((level(4.0, 1.0, cone, Vec3::Y) - 1.0).abs() < 1e-5);
        assert!((level(1.0, 1.0, RayCone { width: -0.25, ..cone }, Vec3::NEG_Y) - 3.0).abs() < 1e-5, "behind a focus");
        let slanted = Vec3::new(0.0, -0.25, (1.0_f32 - 0.0625).sqrt());
        assert!((level(1.0, 1.0, cone, slanted) - 5.0).abs() < 1e-5);
        // A footprint that is NaN reads level 0; an unbounded one reads the last level.
        assert_eq!(level(1.0, 1.0, RayCone { width: f32::NAN, ..cone }, Vec3::NEG_Y), 0.0);
        assert_eq!(level(0.0, 1.0, cone, Vec3::NEG_Y), 0.0);
        assert_eq!(level(1.0, 0.0, cone, Vec3::NEG_Y), 0.0);
        assert!(level(1.0, 1.0, cone, Vec3::X) >= 6.0);
        let plain = Geometry {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
            triangles: vec![[0, 1, 2]],
            ..Geometry::default()
        };
        assert_eq!(WHOLE.footprint(&plain, 0, Vec3::Y), TextureArea::NONE);
    }
}
