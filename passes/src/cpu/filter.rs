//! The filter after ray passes that write a share of light: occlusion, and soft shadows.
//!
//! It is the filter of the raster effects ([`Filter`]). Positions are those of the G-buffer. Normals are those of the G-buffer if the program reads
//! them, else the geometric normals of the visible triangles or exact spheres. All normals are flipped to face the viewer, since neighbouring
//! triangles may have opposite windings. `intensity` is applied after the filter: the mean of powers is not the power of the mean.

use super::check;
use crate::raster::effects::filter::Filter;
use curitiba_pipeline::backend::{BackendError, NO_TRIANGLE, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Number of filter levels of a job; 0 if its output is not filtered.
pub(super) fn levels(job: &RayJob<'_>) -> u32 {
    match job.fidelity {
        Fidelity::Corrected => job.program.info().filter_levels(&job.params),
        Fidelity::Thesis => 0,
    }
}

/// Runs a job by `trace`, and filters its output if the job requests a filter.
///
/// # Errors
/// Those of `trace`. Also if there is not enough memory.
pub(super) fn filtered<R>(
    (filter, progress): (&mut Filter, &Progress),
    job: &RayJob<'_>,
    output: &mut Image,
    trace: impl FnOnce(&RayJob<'_>, &mut Image) -> Result<R, BackendError>,
) -> Result<R, BackendError> {
    let levels = levels(job);
    if levels == 0 {
        return trace(job, output);
    }
    let exponent = if job.program.info().reads("intensity") { job.params.intensity } else { 1.0 };
    let traced = trace(&RayJob { params: RayParams { intensity: 1.0, ..job.params }, ..*job }, output)?;
    let refused = |refused: curitiba_pipeline::memory::Refused| check::missing(super::NAME, job, &refused.to_string());
    let stored = job.program.info().buffers.contains(&"norm_buffer");
    filter.load(job.width, &output.pixels, |index| surface(job, index, stored)).map_err(refused)?;
    let shares = filter.run(levels, progress);
    let finish = |(pixel, share): (&mut [f32; 4], &f32)| {
        let share = share.clamp(0.0, 1.0);
        let share = if exponent == 1.0 { share } else { share.powf(exponent) };
        *pixel = [share, share, share, pixel[3]];
    };
    output.pixels.par_iter_mut().zip(shares).with_min_len(1 << 12).for_each(finish);
    Ok(traced)
}

/// Position and normal of the surface that a pixel shows; both are 0 for the background. The normal is flipped to face the viewer. It is the normal
/// of the G-buffer if `stored`, else the geometric normal of the triangle or sphere.
fn surface(job: &RayJob<'_>, index: usize, stored: bool) -> [[f32; 3]; 2] {
    let triangle = job.triangle[index];
    if triangle == NO_TRIANGLE {
        return [[0.0; 3]; 2];
    }
    let position = Vec4::from_array(job.position[index]).truncate();
    let normal = match stored {
        true => Vec4::from_array(job.normal[index]).truncate(),
        false => flat(job, triangle, position),
    };
    let to_viewer = job.eye - position;
    let facing = if normal.dot(to_viewer) < 0.0 { -normal } else { normal };
    [position.to_array(), facing.to_array()]
}

/// The geometric normal of a triangle, or of an exact sphere at a position; not normalised.
fn flat(job: &RayJob<'_>, triangle: u32, position: Vec3) -> Vec3 {
    let geometry = &job.scene.geometry;
    match geometry.sphere(triangle) {
        Some(sphere) => position - sphere.center,
        None => {
            let [a, b, c] = geometry.corners(triangle);
            let normal = (b - a).cross(c - a);
            // Scaled, because the cross product of short edges may be too short to be normalised.
            normal / normal.abs().max_element().max(f32::MIN_POSITIVE)
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::cpu::CpuRays;
    use crate::effects::tests::world::{Shot, World, grid};
    use crate::own::OwnProgram;
    use curitiba_pipeline::backend::{RayBackend, RayJob};
    use curitiba_pipeline::executor::Progress;
    use curitiba_pipeline::image::Image;
    use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
    use curitiba_pipeline::programs::{RayParams, RayProgram};
    use glam::Vec3;
    use std::sync::Arc;

    const SIDE: u32 = 64;

    fn shares(shot: &Shot<'_>, world: &World, program: RayProgram, fidelity: Fidelity, params: RayParams) -> Vec<f32> {
        let scene = Arc::new(world.scene.clone());
        let mut backend = CpuRays::new();
        backend.build(&scene, &vec![true; world.shades.len()]).expect("enough memory");
        let mut job = shot.job(program, fidelity, params);
        job.scene = &scene;
        let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
        backend.run(&job, &mut output, &Progress::default()).expect("a complete job");
        assert!(output.pixels.iter().all(|[r, g, b, _]| r == g && g == b));
        output.pixels.iter().map(|pixel| pixel[0]).collect()
    }

    fn off(found: &[f32], expected: impl Fn(usize) -> f64) -> f64 {
        let square = |(index, value): (usize, &f32)| (f64::from(*value) - expected(index)).powi(2);
        (found.iter().enumerate().map(square).sum::<f64>() / found.len() as f64).sqrt()
    }

    /// A floor in z = 0 and a wall in x = 0. If `turned`, the half of the floor at y > 0 has the opposite winding.
    fn wall(turned: bool) -> World {
        let mut world = World::lit_along(Vec3::NEG_Z);
        let paint = world.paint(Vec3::splat(0.5));
        world.quad(paint, Vec3::new(0.0, -4.5, 0.0), Vec3::X * 9.0, Vec3::Y * 4.5);
        let across = if turned { Vec3::NEG_Y } else { Vec3::Y };
        world.quad(paint, Vec3::new(0.0, 4.5, 0.0), Vec3::X * 9.0, across * 4.5);
        world.quad(paint, Vec3::ZERO, Vec3::Y * 9.0, Vec3::Z * 9.0);
        world
    }

    /// The floor at distances from 0.02 to 0.78 from the wall, seen from above.
    fn beside(world: &World) -> Shot<'_> {
        let targets = grid(SIDE, Vec3::new(0.4, 0.0, 0.0), Vec3::X * 0.38, Vec3::Y * 0.38);
        Shot::of(world, Vec3::new(0.4, 0.05, 0.9), targets).rows(SIDE)
    }

    fn distance(index: usize) -> f64 {
        0.4 + 0.38 * (2.0 * ((index % SIDE as usize) as f64 + 0.5) / f64::from(SIDE) - 1.0)
    }

    /// Closed-form openness of the floor at a pixel beside the perpendicular wall. The distance from the wall is in units of the occlusion radius.
    fn open(index: usize) -> f64 {
        let c = distance(index);
        1.0 - (c.acos() - c * (1.0 - c * c).sqrt()) / std::f64::consts::PI
    }

    #[test]
    fn few_samples_beside_a_wall_come_nearer_to_the_closed_form() {
        for turned in [false, true] {
            let world = wall(turned);
            let shot = beside(&world);
            let of = |samples, filter| {
                let params = RayParams { samples, filter, intensity: 1.0, radius: 1.0, ..RayParams::default() };
                shares(&shot, &world, RayProgram::Ssao, Corrected, params)
            };
            let errors = [0, 1, 2, 3].map(|levels| off(&of(4, levels), open));
            println!("{errors:?}");
            assert!(errors[0] > 0.08 && errors[1] < errors[0] / 2.0 && errors[2] < errors[0] / 3.0, "{errors:?}");
            assert!(errors[2] <= 0.03, "{errors:?}");
            // Beside the wall, the filter does not brighten the floor by the values of the open floor farther away.
            let contact: Vec<usize> = (0..(SIDE * SIDE) as usize).filter(|index| distance(*index) < 0.05).collect();
            let mean =
                |value: &dyn Fn(usize) -> f64| contact.iter().map(|i| value(*i)).sum::<f64>() / contact.len() as f64;
            let filtered = of(64, 1);
            let brighter = mean(&|index| f64::from(filtered[index])) - mean(&open);
            assert!(brighter.abs() < 0.01, "{brighter}");
        }
    }

    #[test]
    fn the_power_is_taken_of_the_filtered_share() {
        let world = wall(false);
        let shot = beside(&world);
        let of = |intensity| {
            let params = RayParams { samples: 4, filter: 2, intensity, radius: 1.0, ..RayParams::default() };
            shares(&shot, &world, RayProgram::Ssao, Corrected, params)
        };
        let (plain, powered) = (of(1.0), of(1.6));
        assert!(plain.iter().zip(&powered).all(|(a, b)| (a.powf(1.6) - b).abs() < 1e-6));
    }

    #[test]
    fn a_penumbra_of_few_rays_comes_nearer_to_many() {
        let mut world = World::lit_along(Vec3::new(0.3, 0.1, -1.0));
        let paint = world.paint(Vec3::splat(0.5));
        world.quad(paint, Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0);
        world.quad(paint, Vec3::new(-2.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Y * 4.0);
        let targets = grid(SIDE, Vec3::new(0.3, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y * 0.5);
        let shot = Shot::of(&world, Vec3::new(0.6, 0.1, 0.8), targets).rows(SIDE);
        let of = |sun, sun_samples, filter| {
            let params = RayParams { sun, sun_samples, filter, ..RayParams::default() };
            shares(&shot, &world, RayProgram::DeferredShadows, Corrected, params)
        };
        let truth = of(20.0, 1024, 0);
        assert!(truth.iter().any(|share| (0.6..0.9).contains(share)), "there is a penumbra");
        let errors = [0, 1, 2].map(|levels| off(&of(20.0, 4, levels), |index| f64::from(truth[index])));
        println!("{errors:?}");
        assert!(errors[1] < errors[0] / 2.0 && errors[2] < errors[1], "{errors:?}");
        // Shadows of a light that is a point have no noise, so the filter changes nothing.
        assert_eq!(of(0.0, 4, 3), of(0.0, 4, 0));
    }

    #[test]
    fn thesis_fidelity_and_programs_of_others_have_none() {
        let world = wall(false);
        let shot = beside(&world);
        let params = |filter| RayParams { samples: 4, filter, radius: 1.0, ..RayParams::default() };
        let thesis = |filter| shares(&shot, &world, RayProgram::Ssao, Thesis, params(filter));
        assert_eq!(thesis(0), thesis(3));
        let mut own = OwnProgram::new(RayProgram::Ssao, |_| [1.0; 4]);
        let scene = Arc::new(world.scene.clone());
        own.build(&scene, &vec![true; world.shades.len()]).expect("enough memory");
        let mut output = Image::filled(SIDE, SIDE, [0.0; 4]);
        let mut run = |filter| {
            let job = RayJob { scene: &scene, ..shot.job(RayProgram::Ssao, Corrected, params(filter)) };
            own.run(&job, &mut output, &Progress::default()).map_err(|error| error.to_string())
        };
        assert!(run(0).is_ok());
        let refused = run(2).expect_err("nothing would be filtered");
        assert!(refused.contains("filter=2"), "{refused}");
    }
}
