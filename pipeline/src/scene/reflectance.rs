//! Reflectance curves that materials have instead of Fresnel's equations.

/// A curve after Schlick: `minimum + (maximum - minimum) (1 - cos)^exponent`. The cosine is that of the angle on the side of the lower
/// index, so that the reflected share is the same in both directions. With minimum ((n - 1) / (n + 1))², maximum 1 and exponent 5 it is
/// Schlick's approximation of Fresnel's equations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflectance {
    /// Share reflected at normal incidence: 0 to [`Self::maximum`].
    pub minimum: f32,
    /// Share reflected at grazing incidence, up to 1.
    pub maximum: f32,
    /// Exponent of the curve, 0 to [`Self::STEEPEST`].
    pub exponent: f32,
}

impl Reflectance {
    /// The greatest exponent.
    pub const STEEPEST: f32 = 1000.0;

    /// Schlick's approximation for an index of refraction.
    #[must_use]
    pub fn of_index(index: f32) -> Self {
        let root = if index.is_finite() { (index - 1.0) / (index + 1.0) } else { 1.0 };
        Self { minimum: root * root, maximum: 1.0, exponent: 5.0 }
    }

    /// Whether its numbers are in their ranges. The curve is then nowhere below 0 or above 1.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let Self { minimum, maximum, exponent } = *self;
        (0.0..=1.0).contains(&minimum)
            && (minimum..=1.0).contains(&maximum)
            && (0.0..=Self::STEEPEST).contains(&exponent)
    }

    /// The reflected share for `away` = 1 - cosine, 0 to 1.
    #[inline]
    #[must_use]
    pub fn at(&self, away: f32) -> f32 {
        self.minimum + (self.maximum - self.minimum) * away.powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_ends_are_its_numbers_and_it_stays_between_them() {
        let curve = Reflectance { minimum: 0.04, maximum: 0.9, exponent: 5.0 };
        assert_eq!((curve.at(0.0), curve.at(1.0)), (0.04, 0.9));
        for step in 0..=100 {
            let share = curve.at(step as f32 / 100.0);
            assert!((0.04..=0.9).contains(&share), "{share}");
        }
        // Between the ends, 0.5^5 = 1 / 32 of the way.
        assert!((curve.at(0.5) - (0.04 + 0.86 / 32.0)).abs() < 1e-6, "{}", curve.at(0.5));
    }

    #[test]
    fn numbers_out_of_range_are_told() {
        let valid = |minimum, maximum, exponent| Reflectance { minimum, maximum, exponent }.is_valid();
        assert!(valid(0.0, 1.0, 5.0) && valid(0.3, 0.3, 0.0) && Reflectance::of_index(f32::INFINITY).is_valid());
        assert!(!valid(0.5, 0.4, 5.0) && !valid(0.0, 1.1, 5.0) && !valid(-0.1, 1.0, 5.0));
        assert!(!valid(0.0, 1.0, -1.0) && !valid(0.0, 1.0, f32::INFINITY) && !valid(f32::NAN, 1.0, 5.0));
    }
}
