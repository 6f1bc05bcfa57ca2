//! What glass is: the choices of a pass, and what each material is to its rays.
//!
//! The report knows one kind of glass, a plane that stands for a whole pane, and materials are mapped to it by name. With
//! `glass=auto` the materials decide ([`decide`]): closed surfaces of materials with a volume are solids, other transparent materials
//! are thin walls, and what a project names without a property of its own stays a pane.

mod closed;
mod decide;

pub use closed::{Closedness, closedness};
pub use decide::{Decided, TRANSPARENT, decide};

use glam::Vec3;

/// What decides what glass is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum GlassRule {
    /// The report's: every material that the project names is a pane of the pass's index.
    #[default]
    Pane,
    /// Each material's own properties.
    Auto,
}

/// What rays show that leave the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Background {
    /// Nothing, as in the report.
    #[default]
    Black,
    /// The clear colour of the render target that holds the G-buffer.
    Clear,
}

/// What shadow rays find of light that falls through glass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum GlassShadow {
    /// 0.9 for each surface of glass crossed, as in the report.
    #[default]
    Report,
    /// None: glass is as opaque as anything else, and what light does in it is left to a pass for caustics.
    Opaque,
    /// As if it went straight on, weakened by Fresnel's share at each surface and by absorption on each way inside.
    Straight,
}

named!(GlassRule, "pane" => Pane, "auto" => Auto);
named!(Background, "black" => Black, "clear" => Clear);
named!(GlassShadow, "report" => Report, "opaque" => Opaque, "straight" => Straight);

/// How a surface of glass stands in the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Shape {
    /// No glass.
    #[default]
    Opaque,
    /// The report's: one surface bends light as if it entered a block of the pass's index, and stands for a whole pane.
    Pane,
    /// A plane-parallel wall: light goes straight on, and what is reflected between its faces is added up.
    Thin,
    /// The border of a body: light is bent where it enters and where it leaves, and absorbed on its way inside.
    Solid,
}

impl Shape {
    /// As it is printed.
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

/// A material as rays in glass see it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Dielectric {
    /// How its surfaces stand.
    pub shape: Shape,
    /// Index of refraction against vacuum, 1 to [`Self::MIRROR`]; of panes the pass's serves.
    pub index: f32,
    /// Extinction by colour, per scene unit: light keeps `exp(-extinction * length)`. At least 0, finite.
    pub extinction: Vec3,
    /// Share of the light by colour that passes a surface, beside Fresnel's: 0 to 1.
    pub filter: Vec3,
    /// A texture whose colour (decoded from sRGB) is part of the filter: an index into the scene's textures.
    pub filter_texture: Option<u32>,
    /// Share of the light that enters and is scattered back by the diffuse colour: 0 to 1.
    pub veil: f32,
    /// Thickness of a thin wall that absorbs, scene units; else 0.
    pub thickness: f32,
    /// Where bodies overlap, the one of the higher priority fills the place; of two alike the one that was entered later.
    pub priority: u8,
}

impl Dielectric {
    /// The index from which on all light is reflected: Fresnel's share differs from 1 by less than a rounding error.
    pub const MIRROR: f32 = 1e9;

    /// Extinction per unit of a material in which light keeps `color` after `distance`: `-ln(color) / distance` (Beer and Lambert;
    /// glTF `KHR_materials_volume`). Nothing is absorbed over an infinite distance; colours below 1e-6 count as that, so that no
    /// product of 0 and infinity arises.
    #[must_use]
    pub fn extinction_of(color: Vec3, distance: f32) -> Vec3 {
        if !(distance > 0.0 && distance.is_finite()) {
            return Vec3::ZERO;
        }
        color.to_array().map(|share| (-f64::from(share.clamp(1e-6, 1.0)).ln() / f64::from(distance)) as f32).into()
    }

    /// What light keeps, by colour, on a way of this length inside.
    #[inline]
    #[must_use]
    pub fn transmittance(&self, length: f32) -> Vec3 {
        transmittance(self.extinction, length)
    }
}

/// `exp(-extinction * length)` by colour; exactly 1 where nothing is absorbed, whatever the length.
#[inline]
#[must_use]
pub fn transmittance(extinction: Vec3, length: f32) -> Vec3 {
    extinction.to_array().map(|share| if share > 0.0 { (-share * length).exp() } else { 1.0 }).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extinction_is_that_of_the_colour_after_the_distance() {
        let color = Vec3::new(0.1, 0.5, 0.9);
        for distance in [0.25, 1.0, 4.0] {
            let glass = Dielectric { extinction: Dielectric::extinction_of(color, distance), ..Dielectric::default() };
            assert!((glass.transmittance(distance) - color).abs().max_element() < 1e-6, "{distance}");
            assert!((glass.transmittance(2.0 * distance) - color * color).abs().max_element() < 1e-6, "{distance}");
        }
        // Hard case 13: a slab of 2 with sigma .1, .5, 2.
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
