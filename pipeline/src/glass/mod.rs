//! Glass: the options of a pass, and the optical properties of each material.
//!
//! The report has one kind of glass: a single surface that represents a whole pane. Projects name the materials that are glass. With
//! `glass=auto` the properties of the materials decide ([`decide`]): closed surfaces of materials with a volume are solid bodies, other
//! transparent materials are thin walls. A material that the project names as glass, but whose properties do not make it glass, is a pane.

mod caustics;
mod closed;
mod decide;
mod limits;
mod spectrum;

pub use caustics::{caustics, first_target};
pub use closed::{Closedness, closedness, connected};
pub use decide::{Decided, TRANSPARENT, decide};
pub use limits::{CutoffColor, MOST_BOUNCES, PathLimits, Roulette};
pub use spectrum::{MOST_STRATA, Stratum, color_matching, daylight, strata};

pub use crate::scene::dispersion::{CAUCHY, CAUCHY_AT_D};
pub use crate::scene::reflectance::Reflectance;
use glam::Vec3;

/// What determines which materials are glass, and of which kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum GlassRule {
    /// The project: every material that it names is a pane with the pass's index, as in the report.
    #[default]
    Pane,
    /// Each material's own properties.
    Auto,
}

/// Colour of rays that miss the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Background {
    /// Black, as in the report.
    #[default]
    Black,
    /// The clear colour of the render target that holds the G-buffer; for rays that start at the camera, that of the pass's own
    /// target.
    Clear,
    /// Blue, as in the tutorials of the current descendant of the report's engine.
    Blue,
}

/// How light passes through glass along shadow rays, between a light source and a shaded point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum GlassShadow {
    /// Weakened by a factor of 0.9 at each glass surface, as in the report.
    #[default]
    Report,
    /// Not at all: glass casts full shadows, and the light that passes through glass is left to a pass for caustics.
    Opaque,
    /// In a straight line, weakened by Fresnel transmission at each surface and by absorption inside bodies.
    Straight,
    /// As [`Self::Straight`], but exact spheres that are glass bodies refract the light and so focus it; with photons, solid meshes do as
    /// well.
    Caustic,
}

named!(GlassRule, "pane" => Pane, "auto" => Auto);
named!(Background, "black" => Black, "clear" => Clear, "blue" => Blue);
named!(GlassShadow, "report" => Report, "opaque" => Opaque, "straight" => Straight, "caustic" => Caustic);

/// Shape of a glass surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Shape {
    /// Not glass.
    #[default]
    Opaque,
    /// The report's pane: a single surface that represents a whole pane. Light refracts at it as if it entered a block with the pass's
    /// index.
    Pane,
    /// A wall with parallel faces: light passes without a bend, and the reflections between the faces are summed up.
    Thin,
    /// The surface of a body: light is refracted where it enters and leaves, and absorbed inside.
    Solid,
}

impl Shape {
    /// The name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Opaque => "opaque",
            Self::Pane => "pane",
            Self::Thin => "thin",
            Self::Solid => "solid",
        }
    }
}

/// Optical properties of a material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Dielectric {
    /// Shape of its surfaces.
    pub shape: Shape,
    /// Index of refraction against vacuum, 1 to [`Self::MIRROR`], for light of 587.6 nm. Panes use the pass's index instead.
    pub index: f32,
    /// Dispersion of a solid: its index at 486.1 nm minus its index at 656.3 nm, `(n - 1) / V` with the Abbe number V. 0 without
    /// dispersion.
    pub spread: f32,
    /// Width alpha of the microfacet distribution: 0 (smooth), or [`Self::SMOOTH`] to 1.
    pub alpha: f32,
    /// Texture whose green channel, squared, multiplies the width: index into the scene's textures.
    pub roughness_texture: Option<u32>,
    /// Extinction coefficient by colour, per scene unit: transmittance is `exp(-extinction * length)`. At least 0, finite.
    pub extinction: Vec3,
    /// Reflectance of a surface of a body or wall; `None` for Fresnel's.
    pub reflectance: Option<Reflectance>,
    /// Share of the reflected light that is kept, by colour, 0 to 1; `None` for all of it.
    pub reflection: Option<Vec3>,
    /// Factor, by colour, of light that passes a surface, in addition to Fresnel's transmittance: 0 to 1.
    pub filter: Vec3,
    /// Texture whose colour (decoded from sRGB) multiplies the filter: index into the scene's textures.
    pub filter_texture: Option<u32>,
    /// Whether vertex colours multiply the filter.
    pub filter_vertex_colors: bool,
    /// Share of the entering light that is scattered back with the diffuse colour: 0 to 1.
    pub veil: f32,
    /// Texture whose red channel multiplies the light that is not scattered back: index into the scene's textures.
    pub transmission_texture: Option<u32>,
    /// Thickness of a thin wall that absorbs light, in scene units; otherwise 0.
    pub thickness: f32,
    /// Rank where bodies overlap: the body with the highest priority fills the overlap; among equal priorities it is the body entered
    /// last.
    pub priority: u8,
}

impl Dielectric {
    /// Least index at which all light is reflected: Fresnel reflectance differs from 1 by less than a rounding error.
    pub const MIRROR: f32 = 1e9;

    /// Width below which a surface counts as smooth: it scatters light by less than a hundredth of a degree.
    pub const SMOOTH: f32 = 1e-4;

    /// Whether it is a body that bends light: solid, with an index above 1.
    #[inline]
    #[must_use]
    pub fn bends_light(&self) -> bool {
        self.shape == Shape::Solid && self.index > 1.0
    }

    /// The index for a wavelength in nanometres, at least 1: `n + spread (523655 / λ² - 1.5168)` (glTF `KHR_materials_dispersion`,
    /// which is Cauchy's A + B / λ²).
    #[inline]
    #[must_use]
    pub fn index_at(&self, wavelength: f32) -> f32 {
        (self.index + self.spread * (CAUCHY / (wavelength * wavelength) - CAUCHY_AT_D)).max(1.0)
    }

    /// Share of the reflected light that is kept, by colour: [`Self::reflection`], or all of it.
    #[inline]
    #[must_use]
    pub fn mirrors(&self) -> Vec3 {
        self.reflection.unwrap_or(Vec3::ONE)
    }

    /// Extinction per unit of a material in which light keeps `color` after `distance`: `-ln(color) / distance` (Beer and Lambert;
    /// glTF `KHR_materials_volume`). The extinction is 0 if the distance is infinite or not above 0. Colours below 1e-6 count as 1e-6, so
    /// that no product of 0 and infinity arises.
    #[must_use]
    pub fn extinction_of(color: Vec3, distance: f32) -> Vec3 {
        if !(distance > 0.0 && distance.is_finite()) {
            return Vec3::ZERO;
        }
        color.to_array().map(|share| (-f64::from(share.clamp(1e-6, 1.0)).ln() / f64::from(distance)) as f32).into()
    }

    /// Transmittance by colour over a distance inside the body.
    #[inline]
    #[must_use]
    pub fn transmittance(&self, length: f32) -> Vec3 {
        transmittance(self.extinction, length)
    }
}

/// Transmittance `exp(-extinction * length)` by colour; exactly 1 where the extinction is 0, for any length.
#[inline]
#[must_use]
pub fn transmittance(extinction: Vec3, length: f32) -> Vec3 {
    extinction.to_array().map(|share| if share > 0.0 { (-share * length).exp() } else { 1.0 }).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::dispersion::of_cauchy;

    /// A glass like BK7 at the lines F, d and C, and the angle of minimum deviation of a 60-degree prism.
    #[test]
    fn the_index_falls_with_the_wavelength_by_abbes_number() {
        let glass = Dielectric { index: 1.5168, spread: 0.5168 / 64.17, ..Dielectric::default() };
        for (line, degrees) in [(486.13, 39.1428), (587.56, 38.6467), (656.27, 38.4339)] {
            let index = f64::from(glass.index_at(line));
            let found = 2.0 * (index * 30_f64.to_radians().sin()).asin().to_degrees() - 60.0;
            assert!((found - degrees).abs() < 3e-4, "{line}: {found}");
        }
        let abbe = (glass.index - 1.0) / (glass.index_at(486.13) - glass.index_at(656.27));
        assert!((abbe - 64.17).abs() < 0.05, "{abbe}");
        let plain = Dielectric { index: 1.5, ..Dielectric::default() };
        assert_eq!([380.0, 500.0, 780.0].map(|wavelength| plain.index_at(wavelength)), [1.5; 3]);
        assert_eq!(Dielectric { index: 1.01, spread: 0.5, ..plain }.index_at(780.0), 1.0, "no index is below 1");
    }

    #[test]
    fn cauchys_equation_is_the_same_law() {
        // A dense flint glass; with nanometres in place of micrometres there would be no dispersion at all.
        let [index, spread] = of_cauchy([1.5, 0.01]).map(|value| value as f32);
        let glass = Dielectric { index, spread, ..Dielectric::default() };
        for (wavelength, expected) in [(700.0, 1.520_408), (550.0, 1.533_058), (450.0, 1.549_383)] {
            assert!((glass.index_at(wavelength) - expected).abs() < 1e-6, "{wavelength}");
        }
    }

    #[test]
    fn extinction_is_that_of_the_colour_after_the_distance() {
        let color = Vec3::new(0.1, 0.5, 0.9);
        for distance in [0.25, 1.0, 4.0] {
            let glass = Dielectric { extinction: Dielectric::extinction_of(color, distance), ..Dielectric::default() };
            assert!((glass.transmittance(distance) - color).abs().max_element() < 1e-6, "{distance}");
            assert!((glass.transmittance(2.0 * distance) - color * color).abs().max_element() < 1e-6, "{distance}");
        }
        // Hard case 13: a slab of thickness 2 with extinction .1, .5, 2.
        let kept = transmittance(Vec3::new(0.1, 0.5, 2.0), 2.0);
        assert!((kept - Vec3::new(0.818_731, 0.367_879, 0.018_316)).abs().max_element() < 1e-6, "{kept}");
    }

    #[test]
    fn colours_of_0_and_distances_of_0_give_numbers() {
        let black = Dielectric::extinction_of(Vec3::ZERO, 1.0);
        assert!(black.is_finite() && transmittance(black, 0.0) == Vec3::ONE);
        assert_eq!(Dielectric::extinction_of(Vec3::ZERO, f32::INFINITY), Vec3::ZERO);
        assert_eq!(Dielectric::extinction_of(Vec3::splat(0.5), 0.0), Vec3::ZERO);
        assert_eq!(transmittance(Vec3::ZERO, f32::INFINITY), Vec3::ONE);
        assert_eq!(transmittance(Vec3::ONE, f32::INFINITY), Vec3::ZERO);
    }

    #[test]
    fn values_are_found_by_their_names() {
        for (name, value) in GlassShadow::NAMED {
            assert_eq!((value.name(), GlassShadow::named(name)), (*name, Some(*value)));
        }
        assert_eq!((GlassRule::named("auto"), GlassRule::named("Auto")), (Some(GlassRule::Auto), None));
        assert_eq!(Background::named("clear"), Some(Background::Clear));
    }
}
