//! Normal mapping: the reference definition, which kernels and shaders reproduce.
//!
//! A texel is a vector in tangent space as MikkTSpace defines it: tangent and normal are interpolated between the corners without
//! normalisation, and the bitangent is `w * cross(normal, tangent)`. Only the shading normal is bent. The visible side, the origins
//! of rays, the entry into glass and the corrected terminator use the triangle and its vertex normals.

use glam::{Vec3, Vec4};

/// Least z of a texel's vector: a lower z is raised to it, so that the vector lies almost in the surface.
pub const LEAST_HEIGHT: f32 = 1.0 / 255.0;

/// Least cosine between the bent normal and the triangle's normal, so that the bent normal stays on the side of the vertex normal.
pub const LEAST_COSINE: f32 = 0.01;

/// The bent unit normal from a texel (components as stored, in 0..=1) and an interpolated vertex normal. `flat` is the triangle's
/// unit normal and may point to either side. `normal` must be finite and not 0; a tangent of 0 bends nothing.
#[must_use]
#[inline(always)]
pub fn bent(texel: Vec3, scale: f32, normal: Vec3, tangent: Vec4, flat: Vec3) -> Vec3 {
    let x = (2.0 * texel.x - 1.0) * scale;
    let y = (2.0 * texel.y - 1.0) * scale;
    let height = 2.0 * texel.z - 1.0;
    let z = if height > LEAST_HEIGHT { height } else { LEAST_HEIGHT };
    let along = tangent.truncate();
    let across = normal.cross(along) * tangent.w;
    let bent = unit_or(along * x + across * y + normal * z, normal);
    let flat = if flat.dot(normal) < 0.0 { -flat } else { flat };
    let cosine = bent.dot(flat);
    if cosine < LEAST_COSINE { unit_or(bent + flat * (LEAST_COSINE - cosine), flat) } else { bent }
}

/// Cosine between a bent normal and the direction to the light, clamped to 0..=1; 0 if the light is below the horizon of the vertex normal.
/// All vectors but `normal` are unit vectors.
#[must_use]
#[inline(always)]
pub fn cosine(bent: Vec3, normal: Vec3, to_light: Vec3) -> f32 {
    let cosine = bent.dot(to_light);
    if normal.dot(to_light) > 0.0 && cosine > 0.0 { cosine.min(1.0) } else { 0.0 }
}

/// `vector` normalised, or `other` normalised if `vector` has no direction.
#[inline(always)]
fn unit_or(vector: Vec3, other: Vec3) -> Vec3 {
    let reciprocal = 1.0 / vector.dot(vector).sqrt();
    if reciprocal > 0.0 && reciprocal < f32::INFINITY {
        vector * reciprocal
    } else {
        other * (1.0 / other.dot(other).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::{LEAST_COSINE, LEAST_HEIGHT, bent, cosine};
    use glam::{Mat3, Quat, Vec3, Vec4};

    /// Expected result of [`bent`] in an orthonormal frame, by a matrix in `f64`.
    fn by_matrix(texel: Vec3, scale: f32, turn: Quat, side: f32) -> Vec3 {
        let vector = (2.0 * texel.as_dvec3() - 1.0) * glam::DVec3::new(f64::from(scale), f64::from(scale * side), 1.0);
        (turn.as_dquat() * vector.normalize()).as_vec3()
    }

    #[test]
    fn a_texel_tilts_the_normal_by_its_angle_in_every_frame() {
        for (step, scale) in [(0, 1.0), (1, 0.5), (2, 3.0), (3, 0.0), (4, -1.0)] {
            let turn = Quat::from_euler(glam::EulerRot::XYZ, step as f32, 0.7 * step as f32, 2.0);
            let [t, n] = [Vec3::X, Vec3::Z].map(|axis| turn * axis);
            for texel in [Vec3::new(0.8, 0.5, 0.9), Vec3::new(0.25, 0.9, 0.75), Vec3::new(0.5, 0.1, 1.0)] {
                for side in [1.0, -1.0] {
                    // The side to which `flat` points has no effect.
                    let found = bent(texel, scale, n, t.extend(side), -n);
                    let exact = by_matrix(texel, scale, turn, side);
                    assert!(found.distance(exact) < 1e-6, "{texel} {scale} {side}: {found}, not {exact}");
                }
                // Controls that must fail: green flipped, and the sign of the bitangent ignored.
                let flipped = Vec3::new(texel.x, 1.0 - texel.y, texel.z);
                let told_apart = scale != 0.0 && texel.y != 0.5;
                let right = by_matrix(texel, scale, turn, 1.0);
                assert_eq!(bent(flipped, scale, n, t.extend(1.0), n).distance(right) > 0.1, told_apart);
                assert_eq!(bent(texel, scale, n, t.extend(-1.0), n).distance(right) > 0.1, told_apart);
            }
        }
    }

    #[test]
    fn the_frame_is_as_long_as_what_is_interpolated() {
        // MikkTSpace: vN + vT x + vB y with vB = w cross(vN, vT), none of them normalised.
        let (n, t) = (Vec3::new(0.1, 0.2, 0.7), Vec3::new(0.6, 0.0, -0.1));
        let texel = Vec3::new(0.7, 0.3, 0.9);
        let [x, y, z] = [0.4, -0.4, 0.8];
        let frame = Mat3::from_cols(t, -n.cross(t), n);
        let exact = (frame * Vec3::new(x, y, z)).normalize();
        assert!(bent(texel, 1.0, n, t.extend(-1.0), Vec3::Z).distance(exact) < 1e-6);
    }

    #[test]
    fn a_bent_normal_stays_on_the_side_of_the_vertex_normal() {
        let n = Vec3::new(0.8, 0.0, 0.6);
        let t = Vec3::new(0.6, 0.0, -0.8);
        // A vector at 90 degrees to the vertex normal is far below the triangle's plane.
        let texel = Vec3::new(1.0, 0.5, 0.5);
        for flat in [Vec3::Z, Vec3::NEG_Z] {
            let found = bent(texel, 1.0, n, t.extend(1.0), flat);
            let low = LEAST_COSINE - 1e-6..3.0 * LEAST_COSINE;
            assert!(low.contains(&found.z) && found.is_normalized(), "{found}");
            let from_behind = bent(texel, 1.0, -n, (-t).extend(1.0), flat);
            assert!(low.contains(&-from_behind.z), "{from_behind}");
        }
        // A vector that points below the surface is raised almost into the surface; a vector without a direction gives the vertex normal.
        let sunk = bent(Vec3::new(1.0, 0.5, 0.0), 1.0, Vec3::Z, Vec4::new(1.0, 0.0, 0.0, 1.0), Vec3::Z);
        assert!(sunk.z >= LEAST_HEIGHT && sunk.is_normalized(), "{sunk}");
        assert_eq!(bent(Vec3::ONE, 1.0, Vec3::Y, Vec4::ZERO, Vec3::Y), Vec3::Y);
        assert_eq!(bent(Vec3::ONE, 1e6, 2.0 * Vec3::Y, Vec4::ZERO, Vec3::Y), Vec3::Y);
    }

    #[test]
    fn light_from_below_the_surface_is_none() {
        let (n, p) = (Vec3::Z, Vec3::new(0.8, 0.0, 0.6));
        assert_eq!(cosine(p, n, Vec3::new(0.99, 0.0, -0.1)), 0.0, "p faces it, the surface does not");
        assert_eq!(cosine(p, n, Vec3::new(-0.8, 0.0, 0.6)), 0.0);
        assert!((cosine(p, n, Vec3::Z) - 0.6).abs() < 1e-7);
    }
}
