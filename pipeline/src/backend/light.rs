//! Lights of passes that have several lights, or a light with a position.

use glam::Vec3;

/// Least divisor of a light's attenuation. It keeps the light that arrives finite everywhere.
pub const LEAST_DIVISOR: f32 = 1e-12;

/// A light of a pass that has several lights, or one that is not directional. The light of a pass with a single directional light is a
/// [`Sun`](super::Sun).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Position in the world, relative to the scene's origin; `None` for a directional light.
    pub place: Option<Vec3>,
    /// Unit direction in which a directional light travels, or the axis of a spot light; 0 for a point light.
    pub direction: Vec3,
    /// Linear colour of the arriving light where the attenuation is 1.
    pub color: Vec3,
    /// Attenuation of a light with a position: its light is divided by `constant + linear d + quadratic d²` at a distance `d`.
    pub attenuation: [f32; 3],
    /// Distance at which a light with a position ends; infinite if it has no end.
    pub range: f32,
    /// The cone of a spot light; `None` for other lights.
    pub cone: Option<Cone>,
}

/// The cone of a spot light. With an exponent of 0 its factor is 1 within the inner angle and 0 outside of the outer angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Cosine of the angle to the axis up to which the light is not reduced.
    pub inner: f32,
    /// Cosine of the angle to the axis beyond which there is no light; at most `inner`.
    pub outer: f32,
    /// The light is multiplied by the cosine of the angle to the axis, raised to this power.
    pub exponent: f32,
}

/// The light that arrives at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arriving {
    /// Unit direction to the light; 0 at the light's own position.
    pub towards: Vec3,
    /// Share of the light's colour after attenuation, range and cone. The surface's cosine and shadows are not included.
    pub factor: f32,
}

impl Light {
    /// The light that arrives at a point without an occluder. No light arrives at the light's own position, where the direction is
    /// undefined, or at a distance whose square is not finite.
    #[inline(always)]
    #[must_use]
    pub fn at(&self, point: Vec3) -> Arriving {
        let Some(place) = self.place else { return Arriving { towards: -self.direction, factor: 1.0 } };
        let way = place - point;
        let squared = way.length_squared();
        if !(squared > 0.0 && squared < f32::INFINITY) {
            return Arriving { towards: Vec3::ZERO, factor: 0.0 };
        }
        let distance = squared.sqrt();
        let towards = way * (1.0 / distance);
        let [constant, linear, quadratic] = self.attenuation;
        let divisor = constant + linear * distance + quadratic * squared;
        let near = distance / self.range;
        let window = (1.0 - near * near * near * near).max(0.0);
        let cone = self.cone.map_or(1.0, |cone| cone.at(-towards.dot(self.direction)));
        Arriving { towards, factor: window * cone / divisor.max(LEAST_DIVISOR) }
    }
}

impl Cone {
    /// The share of the light in a direction, 0 to 1, given by the cosine of the direction's angle to the axis. It is 1 from
    /// [`Self::inner`] up, 0 below [`Self::outer`], and the square of a linear ramp between them, times the cosine raised to
    /// [`Self::exponent`].
    #[inline(always)]
    #[must_use]
    pub fn at(self, cosine: f32) -> f32 {
        let share = if cosine >= self.inner {
            1.0
        } else if cosine > self.outer {
            (cosine - self.outer) / (self.inner - self.outer)
        } else {
            0.0
        };
        let edge = share * share;
        if self.exponent == 0.0 { edge } else { edge * cosine.max(0.0).powf(self.exponent) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp() -> Light {
        Light {
            place: Some(Vec3::Y),
            direction: Vec3::ZERO,
            color: Vec3::ONE,
            attenuation: [0.0, 0.0, 1.0],
            range: f32::INFINITY,
            cone: None,
        }
    }

    #[test]
    fn the_light_of_a_place_falls_off_by_its_divisor_and_ends_at_its_range() {
        let at = |light: &Light, height: f32| light.at(Vec3::Y * (1.0 - height));
        assert_eq!(at(&lamp(), 2.0), Arriving { towards: Vec3::Y, factor: 0.25 });
        let linear = Light { attenuation: [1.0, 0.5, 0.0], ..lamp() };
        assert_eq!(at(&linear, 2.0).factor, 0.5);
        let near = Light { range: 4.0, ..lamp() };
        assert_eq!(at(&near, 2.0).factor, 0.25 * (1.0 - 1.0 / 16.0));
        assert_eq!((at(&near, 4.0).factor, at(&near, 9.0).factor), (0.0, 0.0));
    }

    #[test]
    fn a_light_at_the_point_or_beyond_all_numbers_gives_nothing_and_one_close_by_a_finite_number() {
        let nothing = Arriving { towards: Vec3::ZERO, factor: 0.0 };
        assert_eq!(lamp().at(Vec3::Y), nothing);
        assert_eq!(lamp().at(Vec3::splat(1e30)), nothing);
        let close = Light { place: Some(Vec3::X * 1e-12), ..lamp() }.at(Vec3::ZERO);
        assert!(close.factor.is_finite() && close.factor > 1e11, "{close:?}");
        let far = Light { place: Some(Vec3::X * 1e6), ..lamp() }.at(Vec3::ZERO);
        assert!((far.factor * 1e12 - 1.0).abs() < 1e-6, "{far:?}");
        let nowhere = Light { attenuation: [0.0; 3], ..lamp() }.at(Vec3::ZERO);
        assert!(nowhere.factor.is_finite(), "{nowhere:?}");
    }

    #[test]
    fn a_cone_has_an_edge_where_both_angles_agree_and_a_slope_where_they_do_not() {
        let sharp = Cone { inner: 0.5, outer: 0.5, exponent: 0.0 };
        assert_eq!([0.51, 0.5, 0.49].map(|cosine| sharp.at(cosine)), [1.0, 1.0, 0.0]);
        let soft = Cone { inner: 0.75, outer: 0.25, exponent: 0.0 };
        assert_eq!([0.8, 0.5, 0.25, -1.0].map(|cosine| soft.at(cosine)), [1.0, 0.25, 0.0, 0.0]);
        let dimmed = Cone { inner: -1.0, outer: -1.0, exponent: 2.0 };
        assert_eq!([1.0, 0.5, -0.5].map(|cosine| dimmed.at(cosine)), [1.0, 0.25, 0.0]);
    }
}
