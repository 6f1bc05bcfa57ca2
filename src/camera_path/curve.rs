//! Interpolation between points and between directions.

use glam::DVec3;

/// Angle in radians below which [`slerp`] interpolates linearly; the difference is a few bits at most.
const SMALL: f64 = 1e-6;

/// The cubic Hermite polynomial from `p0` to `p1` at `u` from 0 to 1. The tangents `m0` and `m1` are derivatives with respect to
/// `u`.
pub(super) fn hermite(p0: DVec3, m0: DVec3, p1: DVec3, m1: DVec3, u: f64) -> DVec3 {
    let (u2, u3) = (u * u, u * u * u);
    p0 * (2.0 * u3 - 3.0 * u2 + 1.0) + m0 * (u3 - 2.0 * u2 + u) + p1 * (3.0 * u2 - 2.0 * u3) + m1 * (u3 - u2)
}

/// The tangent of a Catmull-Rom spline (Catmull and Rom 1974) at a key, per frame: the slope from the key before to the key after.
/// Both are given as frame and point; at an end of the path one of them is the end itself.
pub(super) fn tangent(before: (f64, DVec3), after: (f64, DVec3)) -> DVec3 {
    let span = after.0 - before.0;
    if span > 0.0 { (after.1 - before.1) / span } else { DVec3::ZERO }
}

/// The angle between two unit vectors, radians. Accurate near 0 and π too, where the arc cosine is not.
pub(super) fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Spherical linear interpolation (Shoemake 1985) between unit vectors that are not opposite; `u` is 0 to 1.
pub(super) fn slerp(a: DVec3, b: DVec3, u: f64) -> DVec3 {
    let angle = angle(a, b);
    let (from, to) = match angle < SMALL {
        true => (1.0 - u, u),
        false => (((1.0 - u) * angle).sin() / angle.sin(), (u * angle).sin() / angle.sin()),
    };
    a * from + b * to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_goes_through_its_points_with_its_tangents() {
        let [p0, p1] = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.5, 9.0)];
        let [m0, m1] = [DVec3::new(2.0, 0.0, 1.0), DVec3::new(0.0, -3.0, 1.0)];
        let at = |u| hermite(p0, m0, p1, m1, u);
        assert_eq!((at(0.0), at(1.0)), (p0, p1));
        let step = 1e-6;
        assert!(((at(step) - p0) / step - m0).length() < 1e-4);
        assert!(((p1 - at(1.0 - step)) / step - m1).length() < 1e-4);
        // Points at an even pace on a straight line are interpolated linearly.
        let line = hermite(DVec3::ZERO, DVec3::X, DVec3::X, DVec3::X, 0.3);
        assert!((line - DVec3::X * 0.3).length() < 1e-15);
        assert_eq!(tangent((0.0, DVec3::ZERO), (4.0, DVec3::X)), DVec3::X / 4.0);
        assert_eq!(tangent((4.0, DVec3::X), (4.0, DVec3::X)), DVec3::ZERO);
    }

    #[test]
    fn directions_turn_evenly_on_the_great_circle() {
        let [a, b] = [DVec3::X, DVec3::new(-0.6, 0.8, 0.0)];
        let whole = angle(a, b);
        for step in 0..=10 {
            let u = f64::from(step) / 10.0;
            let between = slerp(a, b, u);
            assert!((between.length() - 1.0).abs() < 1e-14 && between.z == 0.0);
            assert!((angle(a, between) - u * whole).abs() < 1e-14);
        }
        assert_eq!((slerp(a, b, 0.0), slerp(a, a, 0.7)), (a, a));
        assert!((angle(DVec3::X, -DVec3::X) - std::f64::consts::PI).abs() < 1e-15);
    }
}
