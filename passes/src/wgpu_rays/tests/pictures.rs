//! Pictures of small worlds, compared with the processor's.

use super::{bits, picture, rays_in_turn};
use crate::cpu::CpuRays;
use crate::effects::tests::terminator::sphere;
use crate::effects::tests::world::{Shot, World, grid};
use crate::raster::gpu::AdapterKind;
use crate::wgpu_rays::WgpuRays;
use curitiba_pipeline::backend::RayBackend;
use curitiba_pipeline::programs::{Fidelity, Fresnel, RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::{Vec3, Vec4};
use std::sync::Arc;

const FIDELITIES: [Fidelity; 2] = [Fidelity::Corrected, Fidelity::Thesis];

/// The scattered world with a cut-out picture and glass in it.
pub(super) fn world() -> World {
    let mut world = World::scattered();
    let picture = world.picture([[255, 0, 0, 255], [0, 255, 0, 10]], Some(0.5));
    world.quad(picture, Vec3::new(0.0, 2.0, 0.0), Vec3::X * 1.5, Vec3::Z * 1.5);
    let tint = |at: &Vec3| Vec4::new(0.5 + 0.2 * at.x.sin(), 0.5 + 0.5 * at.y.cos(), 0.7, 0.5 + 0.5 * at.x.sin());
    world.scene.geometry.colors = world.scene.geometry.positions.iter().map(tint).collect();
    // Cut-outs by texture times vertex alpha, and by vertex alpha alone.
    world.shades[picture as usize].vertex_colors = true;
    (world.shades[0].vertex_colors, world.shades[0].alpha_cutoff) = (true, Some(0.2));
    let glass = world.glass();
    world.quad(glass, Vec3::new(0.5, -1.0, 0.5), Vec3::X * 2.0, Vec3::Z * 2.0);
    world.quad(glass, Vec3::new(0.0, 0.0, 3.0), Vec3::X, Vec3::Y);
    let vertices = world.scene.geometry.positions.len();
    world.scene.geometry.colors.resize(vertices, Vec4::ONE);
    // Normal maps on lit, cut-out and glass surfaces.
    world.bump(0, [[220, 90, 200, 255], [40, 160, 220, 255]], 1.0);
    world.bump(picture, [[128, 200, 220, 255], [60, 60, 200, 255]], 0.5);
    world.bump(glass, [[150, 120, 240, 255], [110, 140, 240, 255]], -1.0);
    world
}

/// The number of pixels in which any number differs by more than `by`.
pub(super) fn differing(a: &[[f32; 4]], b: &[[f32; 4]], by: f32) -> usize {
    let far = |(a, b): (&[f32; 4], &[f32; 4])| a.iter().zip(b).any(|(a, b)| (a - b).is_nan() || (a - b).abs() > by);
    a.iter().zip(b).filter(|pair| far(*pair)).count()
}

/// Pictures of a program from both backends.
fn both(program: RayProgram, fidelity: Fidelity, params: RayParams) -> Option<[Vec<[f32; 4]>; 2]> {
    let world = world();
    let shot = Shot::of(&world, Vec3::new(0.3, 0.8, 9.0), grid(96, Vec3::ZERO, Vec3::X * 4.5, Vec3::Y * 4.5)).rows(96);
    both_of(&world, &shot, program, fidelity, params)
}

/// Pictures of a world by a wgpu backend that tests share, and by the processor; `None` without a device.
pub(super) fn both_of(
    world: &World,
    shot: &Shot<'_>,
    program: RayProgram,
    fidelity: Fidelity,
    params: RayParams,
) -> Option<[Vec<[f32; 4]>; 2]> {
    Some(both_on(&mut *rays_in_turn()?, world, shot, program, fidelity, params))
}

/// As [`both_of`], on a backend of the caller.
pub(super) fn both_on(
    rays: &mut WgpuRays,
    world: &World,
    shot: &Shot<'_>,
    program: RayProgram,
    fidelity: Fidelity,
    params: RayParams,
) -> [Vec<[f32; 4]>; 2] {
    // A job identifies its scene by address.
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = curitiba_pipeline::backend::RayJob { scene: &scene, ..shot.job(program, fidelity, params) };
    let mut cpu = CpuRays::new();
    let filtered = vec![true; scene.materials.len()];
    rays.build(&scene, &filtered).expect("built");
    cpu.build(&scene, &filtered).expect("built");
    let ((found, mine), (expected, theirs)) = (picture(rays, &job), picture(&mut cpu, &job));
    if !matches!(program, RayProgram::Final | RayProgram::Refraction) {
        assert_eq!(mine.rays.shadow, theirs.rays.shadow, "{program:?} {fidelity:?}");
        let all = |rays: curitiba_pipeline::backend::RayCounts| rays.occlusion + rays.certain;
        // The last bit may decide whether the report's noise gives a finite ray.
        let few = if fidelity == Fidelity::Thesis { all(theirs.rays) / 1000 } else { 0 };
        assert!(all(mine.rays).abs_diff(all(theirs.rays)) <= few, "{program:?} {fidelity:?}");
    }
    // Software drivers do not fuse multiplications and additions, so any difference from the processor is of interest and is printed.
    if rays.gpu.adapter.kind == AdapterKind::Software {
        println!("{program:?} {fidelity:?}: {} of {} differ", differing(&found, &expected, 0.0), found.len());
    }
    [found, expected]
}

#[test]
fn shadows_are_the_processors_bit_by_bit() {
    for fidelity in FIDELITIES {
        let Some([found, expected]) = both(RayProgram::DeferredShadows, fidelity, RayParams::default()) else { return };
        let dark = expected.iter().filter(|pixel| pixel[0] < 1.0).count();
        assert!(dark > 500 && dark < 8000, "{dark} pixels in shadow");
        let differ = bits(&found).iter().zip(bits(&expected)).filter(|(a, b)| **a != *b).count();
        assert_eq!(differ, 0, "{fidelity:?}");
    }
}

#[test]
fn filtered_shares_are_the_processors() {
    let Some(mut rays) = rays_in_turn() else { return };
    let world = world();
    let shot = Shot::of(&world, Vec3::new(0.3, 0.8, 9.0), grid(96, Vec3::ZERO, Vec3::X * 4.5, Vec3::Y * 4.5)).rows(96);
    let soft = RayParams { sun: 12.0, sun_samples: 4, ..RayParams::default() };
    let open = RayParams { samples: 4, radius: 1.0, ..RayParams::default() };
    for (program, params, filter) in
        [(RayProgram::DeferredShadows, soft, 1), (RayProgram::DeferredShadows, soft, 2), (RayProgram::Ssao, open, 3)]
    {
        let mut of =
            |filter| both_on(&mut rays, &world, &shot, program, Fidelity::Corrected, RayParams { filter, ..params });
        let ([plain, _], [found, expected]) = (of(0), of(filter));
        let (off, changed) = (differing(&found, &expected, 2e-3), differing(&found, &plain, 0.02));
        println!("{program:?}, {filter} levels: {off} off, {changed} changed");
        assert!(off <= FEW && changed > 20 * FEW, "{program:?}, {filter}: {off} off, {changed} changed");
        assert!(found.iter().all(|pixel| pixel[3] == 1.0));
    }
    // In thesis fidelity nothing is filtered.
    let mut thesis = |filter| {
        let params = RayParams { filter, ..open };
        both_on(&mut rays, &world, &shot, RayProgram::Ssao, Fidelity::Thesis, params)
    };
    assert!(bits(&thesis(0)[0]) == bits(&thesis(2)[0]));
}

#[test]
fn dummy_writes_what_it_reads() {
    for fidelity in FIDELITIES {
        let Some([found, expected]) = both(RayProgram::Dummy, fidelity, RayParams::default()) else { return };
        assert!(bits(&found) == bits(&expected) && expected.iter().any(|pixel| pixel[0] != expected[0][0]));
    }
}

/// Number of pixels that may differ by more than a hundredth, where the last bit of a direction decides what a ray
/// hits.
const FEW: usize = 96 * 96 / 500;

/// Compares a program in both fidelities, and checks that the picture is not uniform.
fn agrees(program: RayProgram, params: RayParams, few: [usize; 2]) {
    for (fidelity, few) in FIDELITIES.into_iter().zip(few) {
        let Some([found, expected]) = both(program, fidelity, params) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= few, "{program:?} {fidelity:?}: {off} pixels are off");
        let changed = expected.iter().filter(|pixel| **pixel != expected[0]).count();
        assert!(changed > 1000, "{changed} pixels show something");
    }
}

#[test]
fn mirrors_and_glass_show_what_the_processors_do() {
    agrees(RayProgram::Reflection, RayParams::default(), [FEW; 2]);
    agrees(RayProgram::Refraction, RayParams::default(), [FEW; 2]);
    for fresnel in [Fresnel::Schlick, Fresnel::S, Fresnel::P] {
        agrees(RayProgram::Refraction, RayParams { fresnel, ..RayParams::default() }, [FEW; 2]);
    }
}

#[test]
fn occlusion_is_the_processors() {
    for (samples, sampler) in
        [(9, curitiba_pipeline::programs::Sampler::Sobol), (16, curitiba_pipeline::programs::Sampler::Strata)]
    {
        let params = RayParams { samples, sampler, radius: 1.5, ..RayParams::default() };
        agrees(RayProgram::Ssao, params, [FEW; 2]);
    }
}

#[test]
fn all_effects_together_are_the_processors() {
    let params = RayParams { samples: 4, radius: 1.5, ..RayParams::default() };
    // In thesis fidelity, occlusion rays at hits depend on the last bits of the hits: the limit is that of the
    // conformance matrix.
    agrees(RayProgram::Final, params, [FEW, 96 * 96 * 15 / 100]);
}

/// On triangles that face away from the light, but whose shading normals face it, the kernels lift the points, with rays that
/// they trace one after the other.
#[test]
fn round_bodies_are_lit_as_by_the_processor() {
    let mut world = sphere(6, true);
    let (wall, glass) = (world.paint(Vec3::new(0.5, 0.6, 0.4)), world.glass());
    world.quad(wall, Vec3::new(0.6, -1.2, 0.2), Vec3::X * 2.0, Vec3::Z * 2.0);
    world.quad(glass, Vec3::new(-0.8, 0.0, 1.6), Vec3::X, Vec3::Y);
    let shot = Shot::of(&world, Vec3::new(4.0, 3.0, 5.0), grid(64, Vec3::ZERO, Vec3::X * 1.6, Vec3::Y * 1.6)).rows(64);
    let of = |program, params| both_of(&world, &shot, program, Fidelity::Corrected, params);
    let Some([found, expected]) = of(RayProgram::DeferredShadows, RayParams::default()) else { return };
    assert!(bits(&found) == bits(&expected));
    for samples in [0, 4, 16] {
        let params = RayParams { samples, radius: 0.5, ..RayParams::default() };
        let Some([found, expected]) = of(RayProgram::Final, params) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= 64 * 64 / 500, "{samples} samples: {off} pixels are off");
    }
}

/// A part of a picture has the same pixels as the whole picture: random numbers depend on the pixel's place in the whole picture.
#[test]
fn parts_of_a_picture_are_those_of_the_whole() {
    let Some(mut rays) = rays_in_turn() else { return };
    let world = world();
    let shot = Shot::of(&world, Vec3::new(0.3, 0.8, 9.0), grid(48, Vec3::ZERO, Vec3::X * 4.5, Vec3::Y * 4.5)).rows(48);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let params = RayParams { samples: 4, ..RayParams::default() };
    let job =
        curitiba_pipeline::backend::RayJob { scene: &scene, ..shot.job(RayProgram::Ssao, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    let (whole, _) = picture(&mut *rays, &job);
    let lower = 16 * 48;
    let part = curitiba_pipeline::backend::RayJob {
        origin: [0, 16],
        height: 32,
        position: &job.position[lower..],
        normal: &job.normal[lower..],
        color: &job.color[lower..],
        triangle: &job.triangle[lower..],
        ..job
    };
    let (found, _) = picture(&mut *rays, &part);
    assert!(bits(&found) == bits(&whole[lower..]));
    let elsewhere = curitiba_pipeline::backend::RayJob { origin: [0, 17], ..part };
    assert!(bits(&picture(&mut *rays, &elsewhere).0) != bits(&found), "the comparison can fail");
}
