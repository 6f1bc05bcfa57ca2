//! On random scenes, every program computes the same pixels on the fast tracer, on the `f64` tree and by `f64` brute
//! force.
//!
//! A pixel is compared only where no ray is close to a rounding decision. A tracer in between sees every ray that the
//! reference traces, and marks the pixel if a ray passes an edge, the end of its interval or another surface within the
//! margin of rounding. All other pixels must agree, whatever the scene; proptest shrinks a failure to a small one.

use super::world::{Shot, World};
use crate::cpu::trace_pixel;
use crate::trace::{BruteForce, Bvh, Double, Hit, Quality, Ray, Tracer};
use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
use curitiba_pipeline::programs::{Fresnel, RayParams, RayProgram, Sampler};
use glam::{Mat3, Vec3};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::{Config, TestCaseError, TestRunner};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

const PROGRAMS: [RayProgram; 5] =
    [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Refraction, RayProgram::Ssao, RayProgram::Final];

/// Relative distance from an edge, from the interval's end or between two surfaces, below which a ray is not compared.
const MARGIN: f64 = 2e-4;

/// Brute force that marks rays whose result rounding may decide.
struct Careful<'w> {
    inner: BruteForce,
    world: &'w World,
    /// Scale of the scene: lengths and differences below `MARGIN` times this are too close to a rounding decision.
    size: f64,
    delicate: AtomicBool,
    /// Whether a closest-hit ray was traced, after the pixel's own surface.
    bounced: AtomicBool,
}

impl Careful<'_> {
    fn look(&self, ray: &Ray) {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let geometry = &self.world.scene.geometry;
        let mut distances: Vec<f64> = Vec::new();
        let mut delicate = false;
        for triangle in 0..geometry.triangles.len() as u32 {
            let [a, b, c] = geometry.corners(triangle).map(|corner| corner.as_dvec3());
            let normal = (b - a).cross(c - a);
            let unit = normal.normalize_or_zero();
            let slope = unit.dot(direction).abs();
            let t = (a - origin).dot(unit) / unit.dot(direction);
            let point = origin + t * direction;
            let weight =
                |p: glam::DVec3, q: glam::DVec3| (q - p).cross(point - p).dot(normal) / normal.length_squared();
            let least = weight(a, b).min(weight(b, c)).min(weight(c, a));
            if !least.is_finite() {
                continue;
            }
            let near_edge = least.abs() < 0.01;
            let inside = least > -0.01;
            let length = self.size * MARGIN;
            let at_end = (t - f64::from(ray.t_min)).abs() < length || (t - f64::from(ray.t_max)).abs() < length;
            // If the ray starts on the triangle, the origin's offset decides: the ray must not hit that triangle.
            let own = t.abs() < length;
            delicate |= !own && t > -length && (near_edge || inside && (at_end || slope < 0.01));
            delicate |= own && inside && slope < 0.1;
            if inside && t > length {
                distances.push(t);
            }
        }
        distances.sort_unstable_by(f64::total_cmp);
        delicate |= distances.windows(2).any(|pair| pair[1] - pair[0] < self.size * MARGIN);
        if delicate {
            self.delicate.store(true, Ordering::Relaxed);
        }
    }
}

impl Tracer for Careful<'_> {
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.bounced.store(true, Ordering::Relaxed);
        self.look(ray);
        self.inner.closest(ray, accept)
    }

    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.look(ray);
        self.inner.occluded(ray, accept)
    }
}

#[derive(Debug, Clone)]
struct Case {
    /// Centre, three corners relative to it, material.
    triangles: Vec<([f32; 3], [[f32; 3]; 3], u32)>,
    sun: [f32; 3],
    eye: [f32; 3],
    targets: Vec<[f32; 3]>,
    scale: f32,
    offset: f32,
    depth: u32,
    index: f32,
    seed: u32,
}

fn vector(limit: f32) -> impl Strategy<Value = [f32; 3]> {
    [-limit..limit, -limit..limit, -limit..limit]
}

fn case() -> impl Strategy<Value = Case> {
    let triangle = (vector(1.5), [vector(1.0), vector(1.0), vector(1.0)], 0..4_u32);
    (
        proptest::collection::vec(triangle, 1..24),
        vector(1.0),
        vector(1.0),
        proptest::collection::vec(vector(1.2), 12),
        (prop_oneof![Just(1.0_f32), Just(1e-3), Just(1e3)], prop_oneof![Just(0.0_f32), Just(10.0)]),
        (0..4_u32, prop_oneof![Just(1.1_f32), Just(1.5), Just(1.0), Just(0.8)], 0..1000_u32),
    )
        .prop_map(|(triangles, sun, eye, targets, (scale, offset), (depth, index, seed))| Case {
            triangles,
            sun,
            eye,
            targets,
            scale,
            offset,
            depth,
            index,
            seed,
        })
}

impl Case {
    fn world(&self) -> World {
        let mut world = World::lit_along(Vec3::from(self.sun) + Vec3::new(0.01, 0.0, -0.02));
        let materials = [
            world.paint(Vec3::new(0.8, 0.4, 0.2)),
            world.glass(),
            world.picture([[250, 200, 20, 255], [20, 90, 200, 30]], Some(0.5)),
            world.paint(Vec3::new(0.2, 0.7, 0.3)),
        ];
        for (center, corners, material) in &self.triangles {
            let corners = corners.map(|corner| Vec3::from(*center) + Vec3::from(corner));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            // A sliver has no interior beyond the margin of rounding.
            if normal.length() > 0.05 {
                world.triangle(materials[*material as usize], corners, [normal.normalize(); 3]);
            }
        }
        // Floor and ceiling, so that there is something to see, to mirror and to stand on.
        world.quad(materials[0], Vec3::Z * -3.0, Vec3::X * 9.0, Vec3::Y * 9.0);
        world.quad(materials[3], Vec3::Z * 6.0, Vec3::X * 4.0, Vec3::NEG_Y * 4.0);
        let axis = Vec3::new(0.48, -0.6, 0.64);
        world.transform(Mat3::from_axis_angle(axis, 0.7), self.scale, self.place());
        world
    }

    fn place(&self) -> Vec3 {
        Vec3::new(0.7, -0.4, 0.6) * (self.offset * self.scale)
    }

    fn shot<'w>(&self, world: &'w World) -> Shot<'w> {
        let turn = Mat3::from_axis_angle(Vec3::new(0.48, -0.6, 0.64), 0.7);
        let place = |p: Vec3| turn * p * self.scale + self.place();
        let eye = place(Vec3::from(self.eye) + Vec3::new(0.5, 0.2, 4.0));
        Shot::of(world, eye, self.targets.iter().map(|target| place(Vec3::from(*target))))
    }

    fn params(&self) -> RayParams {
        RayParams {
            samples: 9,
            sampler: Sampler::Strata,
            radius: 1.5 * self.scale,
            intensity: 1.0,
            depth: self.depth,
            index: self.index,
            // Every second scene takes Schlick's approximation: the weights of glass do not depend on the tracer.
            fresnel: if self.seed.is_multiple_of(2) { Fresnel::Exact } else { Fresnel::Schlick },
            ..RayParams::default()
        }
    }
}

/// The pixels of a row, by column.
type Pixels<'a> = &'a dyn Fn(u32) -> [f32; 4];

/// Whether the last bit of a hit decides the occlusion there: the report's noise is the fraction of a sine times 43758.
fn is_noise_at_hits(job: &RayJob<'_>) -> bool {
    (job.program, job.fidelity) == (RayProgram::Final, Thesis) && job.params.samples > 0
}

/// Counts of compared and of delicate pixels; `Err` describes a pixel that differs.
fn compare(world: &World, job: &RayJob<'_>, scale: f32, others: &[(&str, Pixels<'_>)]) -> Result<(u32, u32), String> {
    let (mut compared, mut skipped) = (0, 0);
    for x in 0..job.width {
        let careful = Careful {
            inner: world.brute_force(),
            world,
            size: f64::from(scale),
            delicate: AtomicBool::new(false),
            bounced: AtomicBool::new(false),
        };
        let expected = trace_pixel(&careful, job, x, 0).expect("a complete job");
        if careful.delicate.into_inner() || is_noise_at_hits(job) && careful.bounced.into_inner() {
            skipped += 1;
            continue;
        }
        compared += 1;
        for (name, value) in others {
            let found = value(x);
            let close = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() <= 2e-3);
            if !close {
                let (program, fidelity) = (job.program, job.fidelity);
                return Err(format!("{program:?} {fidelity:?} pixel {x} on {name}: {found:?}, expected {expected:?}"));
            }
        }
    }
    Ok((compared, skipped))
}

fn check(case: &Case, program: RayProgram, fidelity: Fidelity, drop: Option<u32>) -> Result<(u32, u32), String> {
    let world = case.world();
    let shot = case.shot(&world);
    let job = RayJob { seed: case.seed, ..shot.job(program, fidelity, case.params()) };
    let all = vec![true; world.scene.materials.len()];
    let mut geometry = world.scene.geometry.clone();
    if let Some(dropped) = drop {
        geometry.triangles[dropped as usize] = [u32::MAX; 3];
    }
    let fast = Bvh::build(&geometry, &all, Quality::Balanced);
    let double = Double::build(&geometry, &all);
    let judge = |job: &RayJob<'_>| {
        let on_fast = |x| trace_pixel(&fast, job, x, 0).expect("a complete job");
        let on_double = |x| trace_pixel(&double, job, x, 0).expect("a complete job");
        compare(&world, job, case.scale, &[("the fast tree", &on_fast), ("the f64 tree", &on_double)])
    };
    if is_noise_at_hits(&job) {
        // Without occlusion, the surfaces that glass shows can be compared.
        judge(&RayJob { params: RayParams { samples: 0, ..job.params }, ..job })?;
    }
    judge(&job)
}

fn run(program: RayProgram, fidelity: Fidelity) {
    let (compared, skipped) = (Cell::new(0), Cell::new(0));
    let config = Config { cases: 96, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new(config);
    let result = runner.run(&case(), |case| {
        // The report's fixed distances assume metres.
        let case = if fidelity == Thesis { Case { scale: 1.0, ..case } } else { case };
        let (here, delicate) = check(&case, program, fidelity, None).map_err(TestCaseError::fail)?;
        compared.set(compared.get() + here);
        skipped.set(skipped.get() + delicate);
        Ok(())
    });
    if let Err(error) = result {
        panic!("{error}");
    }
    println!("{program:?} {fidelity:?}: {} pixels compared, {} delicate", compared.get(), skipped.get());
    assert!(compared.get() > 200, "{program:?} {fidelity:?}: only {} pixels say something", compared.get());
}

#[test]
fn corrected_programs_agree_with_brute_force_on_random_scenes() {
    for program in PROGRAMS {
        run(program, Corrected);
    }
}

#[test]
fn thesis_programs_agree_with_brute_force_on_random_scenes() {
    for program in PROGRAMS {
        run(program, Thesis);
    }
}

#[test]
fn a_missing_triangle_is_noticed_in_every_program() {
    for program in PROGRAMS {
        for fidelity in [Corrected, Thesis] {
            let mut runner = TestRunner::deterministic();
            let noticed = (0..20).any(|_| {
                let case = case().new_tree(&mut runner).expect("a case").current();
                let case = Case { scale: 1.0, ..case };
                let count = case.world().scene.geometry.triangles.len() as u32;
                (0..count).any(|dropped| check(&case, program, fidelity, Some(dropped)).is_err())
            });
            assert!(noticed, "{program:?} {fidelity:?}");
        }
    }
}
