//! Glass as defined by each material, textures that do not repeat and surfaces that emit light, compared with the processor.

use super::lights::lamps;
use super::pictures::differing;
use super::{picture, rays, rays_in_turn};
use crate::cpu::CpuRays;
use crate::effects::tests::world::{Shot, World, grid};
use crate::raster::gpu::AdapterKind;
use crate::wgpu_rays::selftest;
use curitiba_pipeline::backend::{Glow, RayBackend, RayJob, RayStats};
use curitiba_pipeline::color::ColorSpace;
use curitiba_pipeline::glass::{
    CutoffColor, Dielectric, GlassRule, GlassShadow, PathLimits, Reflectance, Roulette, Shape,
};
use curitiba_pipeline::programs::{Fidelity, Fresnel, RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::texture::{Magnification, Texture, Wrap};
use curitiba_pipeline::scene::{RenderScene, TriangleRanges};
use glam::Vec3;
use std::sync::Arc;

const SIDE: u32 = 64;
/// Number of pixels that may differ by more than a hundredth, where the last bit of a direction decides what a ray hits.
pub(super) const FEW: usize = (SIDE * SIDE) as usize / 200;

pub(super) fn solid(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, filter: Vec3::ONE, ..Dielectric::default() }
}

/// A box with six outward faces.
pub(super) fn block(world: &mut World, material: u32, center: Vec3, half: Vec3) {
    for (x, y, z) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
        for side in [1.0, -1.0] {
            world.quad(material, center + z * half * side, x * half * side, y * half);
        }
    }
}

/// Tinted, veiled and overlapping bodies, one inside another, an absorbing wall and a pane, over a floor with a textured block. A texture
/// determines where light enters the veiled body and the wall.
pub(super) fn several() -> World {
    several_of([Dielectric::default(); 3])
}

/// [`several`] with the roughness and the dispersion of `surfaces` in its tinted block, its veiled block and its wall.
pub(super) fn several_of(surfaces: [Dielectric; 3]) -> World {
    let [tinted, veiled, wall] = surfaces;
    let with = |own: Dielectric, plain: Dielectric| Dielectric {
        alpha: own.alpha,
        spread: own.spread,
        reflectance: own.reflectance,
        reflection: own.reflection,
        ..plain
    };
    let mut world = World { beyond: Vec3::new(0.2, 0.5, 0.9), ..World::lit_along(Vec3::new(-0.4, -0.8, -0.5)) };
    // Colours are decoded; the values of the first texture are not.
    let texture = |texels: [[u8; 4]; 2]| Texture::new("clear".to_owned(), 2, 1, texels.to_vec());
    let clear = texture([[255, 0, 0, 255], [90, 255, 255, 255]]);
    world.scene.textures = vec![clear, Texture { space: ColorSpace::Linear, ..texture([[9; 4]; 2]) }];
    let transmission_texture = Some(0);
    let floor = world.paint(Vec3::new(0.8, 0.7, 0.5));
    block(&mut world, floor, Vec3::new(0.0, -2.0, 0.0), Vec3::new(9.0, 0.2, 9.0));
    let tinted = with(tinted, Dielectric { extinction: Vec3::new(0.1, 0.4, 0.9), ..solid(1.5) });
    let tinted = world.dielectric(tinted);
    block(&mut world, tinted, Vec3::new(-1.6, 0.2, 0.3), Vec3::new(0.9, 1.1, 0.8));
    let water = world.dielectric(solid(1.33));
    block(&mut world, water, Vec3::new(-1.6, 0.1, 0.3), Vec3::new(0.5, 0.6, 0.4));
    let filter = Vec3::new(0.9, 1.0, 0.8);
    let plain = Dielectric { veil: 0.3, filter, priority: 1, transmission_texture, ..solid(1.8) };
    let veiled = with(veiled, plain);
    let veiled = world.dielectric(veiled);
    block(&mut world, veiled, Vec3::new(1.3, -0.6, -0.4), Vec3::new(0.7, 0.8, 0.7));
    let light = world.dielectric(solid(1.2));
    block(&mut world, light, Vec3::new(1.9, -0.5, -0.3), Vec3::new(0.8, 0.4, 0.5));
    let plain = Dielectric {
        shape: Shape::Thin,
        index: 1.5,
        thickness: 0.2,
        extinction: Vec3::new(2.0, 0.5, 0.1),
        filter: Vec3::new(1.0, 0.8, 0.9),
        transmission_texture,
        ..Dielectric::default()
    };
    let wall = world.dielectric(with(wall, plain));
    world.quad(wall, Vec3::new(0.1, 0.6, 1.6), Vec3::X * 0.7, Vec3::Y * 1.1);
    let pane = world.glass();
    world.quad(pane, Vec3::new(2.2, 1.2, 1.5), Vec3::X * 0.6, Vec3::Y * 0.7);
    let red = world.paint(Vec3::new(0.9, 0.1, 0.2));
    block(&mut world, red, Vec3::new(0.3, 0.4, -3.0), Vec3::new(0.8, 1.2, 0.4));
    world
}

/// Pictures of a world by the wgpu backend and by the processor; `None` without a device. Checks that the counts of rays agree, up to a hundredth.
pub(super) fn both(world: &World, eye: Vec3, program: RayProgram, params: RayParams) -> Option<[Vec<[f32; 4]>; 2]> {
    let mut rays = rays_in_turn()?;
    let (found, mine) = picture_on(&mut *rays, world, eye, program, params);
    let (expected, theirs) = picture_on(&mut CpuRays::new(), world, eye, program, params);
    let counts = |rays: curitiba_pipeline::backend::RayCounts| [rays.reflected, rays.refracted];
    println!("{program:?}: {:?} {:?}", mine.rays, theirs.rays);
    for (mine, theirs) in counts(mine.rays).into_iter().zip(counts(theirs.rays)) {
        assert!(mine.abs_diff(theirs) <= theirs / 100 + 2, "{mine} rays, and {theirs} on the processor");
    }
    Some([found, expected])
}

pub(super) fn picture_on(
    rays: &mut dyn RayBackend,
    world: &World,
    eye: Vec3,
    program: RayProgram,
    params: RayParams,
) -> (Vec<[f32; 4]>, RayStats) {
    let shot = shot(world, eye);
    // A job identifies its scene by address.
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = RayJob { scene: &scene, ..shot.job(program, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    picture(rays, &job)
}

/// The G-buffer of [`picture_on`].
pub(super) fn shot(world: &World, eye: Vec3) -> Shot<'_> {
    Shot::of(world, eye, grid(SIDE, eye - Vec3::Z * 4.0, Vec3::X * 2.6, Vec3::Y * 2.2)).rows(SIDE)
}

pub(super) fn auto(depth: u32, shadow: GlassShadow, samples: u32) -> RayParams {
    RayParams { glass: GlassRule::Auto, depth, shadow, samples, radius: 1.5, ..RayParams::default() }
}

#[test]
fn bodies_walls_and_panes_show_what_the_processors_do() {
    let world = several();
    let eye = Vec3::new(0.2, 0.4, 7.0);
    for (program, params) in [
        (RayProgram::Refraction, auto(5, GlassShadow::Report, 0)),
        (RayProgram::Refraction, RayParams { fresnel: Fresnel::Schlick, ..auto(1, GlassShadow::Report, 0) }),
        // Several kernels, one after the other; the last one contains everything that a single kernel would. Software drivers take seconds
        // to compile each.
        (RayProgram::Final, auto(4, GlassShadow::Straight, 2)),
        (RayProgram::Final, auto(4, GlassShadow::Report, 2)),
    ] {
        let Some([found, expected]) = both(&world, eye, program, params) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{program:?} {params:?}: {off} pixels are off");
        let changed = expected.iter().filter(|pixel| **pixel != expected[0]).count();
        assert!(changed > 1000, "{changed} pixels show something");
        let mut clear = several();
        clear.dielectrics.iter_mut().for_each(|dielectric| dielectric.transmission_texture = None);
        let (without, _) = picture_on(&mut CpuRays::new(), &clear, eye, program, params);
        assert!(differing(&without, &expected, 0.02) > 5 * FEW, "a texture of transmission is seen");
    }
}

#[test]
fn light_of_several_lights_and_of_discs_falls_through_glass_as_on_the_processor() {
    if rays().is_none_or(|rays| rays.gpu.adapter.kind == AdapterKind::Software) {
        println!("skipped: software drivers take a minute to compile `final` with bodies");
        return;
    }
    let eye = Vec3::new(0.2, 0.4, 7.0);
    let world = World { sun: None, lights: lamps(), ..several() };
    let params = auto(2, GlassShadow::Straight, 0);
    let Some([found, expected]) = both(&world, eye, RayProgram::Final, params) else { return };
    let off = differing(&found, &expected, 0.01);
    assert!(off <= FEW, "{off} pixels are off");
    let report = auto(2, GlassShadow::Report, 0);
    let (dimmed, _) = picture_on(&mut CpuRays::new(), &world, eye, RayProgram::Final, report);
    assert!(differing(&found, &dimmed, 0.01) > 4 * FEW, "what glass takes of light is not seen");
    // Discs, of several lights and of one.
    let soft = RayParams { sun: 8.0, sun_samples: 4, ..params };
    for world in [world, several()] {
        let Some([found, expected]) = both(&world, eye, RayProgram::Final, soft) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{} lights that may be discs: {off} pixels are off", world.lights.len());
    }
}

/// The roughness and the dispersion of the tinted block, the veiled block and the wall.
pub(super) fn ways(alphas: [f32; 3], spreads: [f32; 3]) -> [Dielectric; 3] {
    [0, 1, 2].map(|place| Dielectric { alpha: alphas[place], spread: spreads[place], ..Dielectric::default() })
}

/// Compares the backends on `asked`, and checks that its picture differs from that of `plain`, which lacks the tested property.
fn differs_from_plain(asked: (&World, RayParams), plain: (&World, RayParams), program: RayProgram) -> Option<()> {
    let eye = Vec3::new(0.2, 0.4, 7.0);
    let [found, expected] = both(asked.0, eye, program, asked.1)?;
    let off = differing(&found, &expected, 0.01);
    assert!(off <= FEW, "{program:?} {:?}: {off} pixels are off", asked.1);
    let (without, _) = picture_on(&mut CpuRays::new(), plain.0, eye, program, plain.1);
    let changed = differing(&without, &expected, 0.003);
    assert!(changed > 5 * FEW, "{program:?} {:?}: {changed} pixels show it", asked.1);
    Some(())
}

#[test]
fn rough_bodies_and_walls_show_what_the_processors_do() {
    let plain = several();
    let rough = several_of(ways([0.2, 0.0, 0.3], [0.0; 3]));
    let params = RayParams { paths: 4, first_path: 8, ..auto(2, GlassShadow::Report, 0) };
    let seen = differs_from_plain((&rough, params), (&plain, params), RayProgram::Refraction);
    let Some(()) = seen else { return };
    // Rough glass inside smooth glass, with a list of points that overflows: one thread computes each pixel whose points do not fit.
    let rough = several_of(ways([0.0, 0.15, 0.3], [0.0; 3]));
    let params = RayParams { paths: 6, ..auto(2, GlassShadow::Straight, 2) };
    differs_from_plain((&rough, params), (&plain, params), RayProgram::Final);
}

#[test]
fn colours_that_are_bent_apart_are_where_the_processor_shows_them() {
    let plain = several();
    let flint = several_of(ways([0.0; 3], [0.15, 0.2, 0.0]));
    let params = RayParams { wavelengths: 5, ..auto(3, GlassShadow::Report, 0) };
    let together = RayParams { wavelengths: 1, ..params };
    let seen = differs_from_plain((&flint, params), (&plain, together), RayProgram::Refraction);
    let Some(()) = seen else { return };
    // Paths that are divided twice, by roughness and by dispersion, in either order.
    let both_ways = several_of(ways([0.1, 0.0, 0.2], [0.15, 0.2, 0.0]));
    let params = RayParams { wavelengths: 3, paths: 2, ..auto(2, GlassShadow::Report, 0) };
    differs_from_plain((&both_ways, params), (&plain, params), RayProgram::Refraction);
}

#[test]
fn reflectances_and_colours_of_their_own_are_those_of_the_processor() {
    let curve = |minimum, maximum, exponent| Some(Reflectance { minimum, maximum, exponent });
    let own = several_of([
        Dielectric { reflectance: curve(0.3, 0.9, 2.0), ..Dielectric::default() },
        Dielectric { reflection: Some(Vec3::new(1.0, 0.4, 0.1)), spread: 0.1, ..Dielectric::default() },
        Dielectric { reflectance: curve(0.2, 0.2, 0.0), reflection: Some(Vec3::X), ..Dielectric::default() },
    ]);
    let params = RayParams { wavelengths: 2, ..auto(3, GlassShadow::Report, 0) };
    let seen = differs_from_plain((&own, params), (&several(), params), RayProgram::Refraction);
    let Some(()) = seen else { return };
    // Uses the kernels of rough glass, which software drivers take a minute to compile.
    let params = RayParams { wavelengths: 1, ..auto(3, GlassShadow::Straight, 2) };
    differs_from_plain((&own, params), (&several(), params), RayProgram::Final);
}

#[test]
fn paths_end_where_the_processor_ends_them() {
    let world = several_of(ways([0.0, 0.2, 0.0], [0.06, 0.0, 0.0]));
    let all = RayParams { paths: 3, wavelengths: 3, ..auto(3, GlassShadow::Report, 0) };
    let limits = |limits| RayParams { limits, ..all };
    for asked in [
        PathLimits { cutoff: 0.05, cutoff_color: CutoffColor::Background, ..PathLimits::DEFAULT },
        PathLimits { cutoff: 0.1, roulette: Roulette::On, ..PathLimits::DEFAULT },
        PathLimits { reflections: 0, refractions: 3, ..PathLimits::DEFAULT },
    ] {
        let Some(()) = differs_from_plain((&world, limits(asked)), (&world, all), RayProgram::Refraction) else {
            return;
        };
    }
}

#[test]
fn glass_that_divides_paths_is_refused_where_a_driver_cuts_loops() {
    let Some(rays) = rays() else { return };
    let cuts = selftest::cuts_loops(&rays.gpu).expect("it answers");
    for (params, glass) in [
        (auto(2, GlassShadow::Report, 0), Dielectric { alpha: 0.2, ..solid(1.5) }),
        (auto(2, GlassShadow::Report, 0), Dielectric { spread: 0.02, ..solid(1.5) }),
    ] {
        match rays.supports_glass(RayProgram::Refraction, &params, &[glass]) {
            Ok(()) => assert!(!cuts, "paths would be missing"),
            Err(error) => assert!(cuts && error.to_string().contains("glass that divides paths"), "{error}"),
        }
        let plain = RayParams { wavelengths: 1, ..params };
        assert!(rays.supports_glass(RayProgram::Refraction, &plain, &[solid(1.5)]).is_ok());
    }
}

#[test]
fn panes_before_a_background_show_it() {
    let mut world = World { beyond: Vec3::new(0.3, 0.6, 0.9), ..World::lit_along(Vec3::NEG_Y) };
    let pane = world.glass();
    world.quad(pane, Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0);
    world.quad(pane, Vec3::new(0.5, 0.2, -1.0), Vec3::X * 2.0, Vec3::new(0.0, 1.5, 0.4));
    for program in [RayProgram::Reflection, RayProgram::Refraction] {
        let params = RayParams { depth: 1, samples: 0, ..RayParams::default() };
        let Some([found, expected]) = both(&world, Vec3::new(0.1, 0.3, 5.0), program, params) else { return };
        assert_eq!(differing(&found, &expected, 1e-4), 0, "{program:?}");
        let blue = expected.iter().filter(|pixel| pixel[2] > 0.8 && pixel[0] < 0.4).count();
        assert!(blue > 500, "{program:?}: {blue} pixels show the background in or through glass");
    }
}

/// A sky around [`several`].
fn under_a_sky() -> World {
    let mut world = several();
    let sky = world.paint(Vec3::ZERO);
    world.shades[sky as usize].glow = Some(Glow { color: Vec3::new(0.2, 0.5, 0.9), texture: None });
    block(&mut world, sky, Vec3::ZERO, Vec3::splat(12.0));
    world.scene.materials[sky as usize].sky = true;
    world.scene.geometry.sky = TriangleRanges::of_triangles(&world.scene.geometry, &world.scene.skies());
    world
}

#[test]
fn a_sky_is_in_the_way_of_nothing_and_glass_shows_it_as_the_processors_does() {
    let (world, eye) = (under_a_sky(), Vec3::new(0.2, 0.4, 7.0));
    let mut panes = under_a_sky();
    panes.bodies = false;
    let is_blue = |pixel: &[f32; 4]| pixel[2] > 0.8 && pixel[0] < 0.3;
    // Software drivers take minutes to compile all of these programs.
    let left_out = [RayProgram::DeferredShadows, RayProgram::Ssao, RayProgram::Final];
    let some = rays().is_some_and(|rays| rays.gpu.adapter.kind == AdapterKind::Software);
    let all = [
        (&world, RayProgram::DeferredShadows, RayParams::default()),
        (&world, RayProgram::Ssao, auto(1, GlassShadow::Report, 8)),
        (&world, RayProgram::Refraction, auto(3, GlassShadow::Report, 0)),
        (&panes, RayProgram::Final, RayParams { glass: GlassRule::Pane, ..auto(2, GlassShadow::Report, 2) }),
    ];
    for (world, program, params) in all.into_iter().filter(|(_, program, _)| !(some && left_out.contains(program))) {
        let Some([found, expected]) = both(world, eye, program, params) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{program:?}: {off} pixels are off");
        if program == RayProgram::Refraction || program == RayProgram::Final {
            // What the camera sees of the sky itself is not in this G-buffer.
            let seen = expected.iter().filter(|pixel| is_blue(pixel)).count();
            assert!(seen > 100, "{program:?}: {seen} pixels show it");
        } else {
            let mut roof = several();
            let sky = roof.paint(Vec3::ZERO);
            block(&mut roof, sky, Vec3::ZERO, Vec3::splat(12.0));
            let (dark, _) = picture_on(&mut CpuRays::new(), &roof, eye, program, RayParams { radius: 30.0, ..params });
            assert!(differing(&dark, &expected, 0.1) > 500, "{program:?}: a roof is noticed");
        }
    }
}

#[test]
fn the_camera_may_be_in_a_body() {
    let mut world = World { beyond: Vec3::splat(0.8), ..World::lit_along(Vec3::NEG_Y) };
    let water = world.dielectric(Dielectric { extinction: Vec3::new(0.3, 0.1, 0.02), ..solid(1.33) });
    block(&mut world, water, Vec3::ZERO, Vec3::splat(2.0));
    let bubble = world.dielectric(Dielectric { priority: 1, ..solid(1.0) });
    block(&mut world, bubble, Vec3::new(0.2, 0.1, -0.8), Vec3::splat(0.4));
    let params = auto(6, GlassShadow::Report, 0);
    let Some([found, expected]) = both(&world, Vec3::new(0.1, 0.2, 1.5), RayProgram::Refraction, params) else {
        return;
    };
    let off = differing(&found, &expected, 0.01);
    assert!(off <= FEW, "{off} pixels are off");
    // Control: with a camera taken to be in air, refraction and absorption differ.
    let outside = World { dielectrics: vec![solid(1.33), solid(1.0)], ..world };
    let Some([other, _]) = both(&outside, Vec3::new(0.1, 0.2, 1.5), RayProgram::Refraction, params) else { return };
    assert!(differing(&other, &expected, 0.01) > 10 * FEW, "absorption is seen");
}

const WATER: Vec3 = Vec3::new(0.3, 0.1, 0.6);
const VESSEL: Vec3 = Vec3::new(0.02, 0.5, 0.1);

/// A wall and a block in water, which is in a vessel of glass. With `absorbs`, the water and the glass absorb light. Without `passes_light`, glass
/// is opaque to shadow rays.
fn in_water(absorbs: bool, passes_light: bool) -> World {
    let mut world = World { beyond: Vec3::splat(0.8), ..World::lit_along(Vec3::new(0.3, -0.4, -1.0)) };
    for (extinction, index, half) in [(VESSEL, 1.5, 3.2), (WATER, 1.33, 3.0)] {
        let extinction = if absorbs { extinction } else { Vec3::ZERO };
        let material = world.dielectric(Dielectric { extinction, ..solid(index) });
        block(&mut world, material, Vec3::ZERO, Vec3::splat(half));
    }
    let [wall, red] = [Vec3::new(0.8, 0.7, 0.5), Vec3::new(0.9, 0.3, 0.2)].map(|color| world.paint(color));
    world.quad(wall, Vec3::new(-0.8, 0.0, -2.2), Vec3::X * 1.7, Vec3::Y * 2.4);
    block(&mut world, red, Vec3::new(0.3, -0.2, -0.6), Vec3::new(0.4, 0.5, 0.3));
    if !passes_light {
        world.shadow_glass.fill(false);
    }
    world
}

#[test]
fn the_body_around_the_camera_absorbs_light_from_what_is_in_it() {
    let eye = Vec3::new(0.1, 0.2, 1.5);
    let world = in_water(true, true);
    let shot = Shot::of(&world, eye, grid(SIDE, eye - Vec3::Z * 4.0, Vec3::X * 2.6, Vec3::Y * 2.2));
    let is_opaque = |index: &usize| !world.glass[world.scene.geometry.material_of(shot.triangle[*index]) as usize];
    let opaque: Vec<usize> = (0..shot.triangle.len()).filter(is_opaque).collect();
    assert!(opaque.len() > 1000 && opaque.len() + 200 < shot.triangle.len(), "{}", opaque.len());
    let at = |pixels: &[[f32; 4]], index: usize| Vec3::from_slice(&pixels[index]);
    let apart = |one: Vec3, other: Vec3| (one - other).abs().max_element();
    let cut = PathLimits { cutoff: 0.01, ..PathLimits::DEFAULT };
    for (program, params) in [
        (RayProgram::Refraction, auto(4, GlassShadow::Report, 0)),
        (RayProgram::Refraction, RayParams { limits: cut, ..auto(4, GlassShadow::Report, 0) }),
        (RayProgram::Final, auto(4, GlassShadow::Straight, 2)),
        (RayProgram::Final, auto(4, GlassShadow::Opaque, 2)),
    ] {
        let passes_light = params.shadow != GlassShadow::Opaque;
        let Some([found, expected]) = both(&in_water(true, passes_light), eye, program, params) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{program:?} {params:?}: {off} pixels are off");
        // The last bit may decide whether a ray to the light meets an edge.
        let unlike = opaque.iter().filter(|index| apart(at(&found, **index), at(&expected, **index)) > 1e-4).count();
        assert!(unlike <= FEW, "{program:?} {params:?}: {unlike} opaque pixels are off");
        let (clear, _) = picture_on(&mut CpuRays::new(), &in_water(false, passes_light), eye, program, params);
        for index in opaque.iter().copied() {
            let way = at(&shot.position, index).as_dvec3().distance(eye.as_dvec3());
            let of = |sigma: Vec3| at(&shot.color, index) * (-sigma.as_dvec3() * way).map(f64::exp).as_vec3();
            if program == RayProgram::Refraction {
                let off = [WATER, VESSEL].map(|sigma| apart(at(&found, index), of(sigma)));
                assert!(off[0] < 1e-5 && off[1] > 0.01, "{params:?}, {index}: {off:?}");
            }
        }
        let dyed = opaque.iter().filter(|index| apart(at(&found, **index), at(&clear, **index)) > 0.01).count();
        assert!(dyed > opaque.len() * 9 / 10, "control: {params:?}, {dyed} of {} pixels", opaque.len());
    }
}

#[test]
fn mirrors_show_the_nearest_texels_of_magnified_textures_that_ask_for_them() {
    let pictures = |magnification, texture_lod| {
        let mut world = World::lit_along(Vec3::new(-0.3, -0.5, -1.0));
        for (wrap, x) in [([Wrap::Repeat; 2], -5.0), ([Wrap::Clamp; 2], 0.0), ([Wrap::Mirror; 2], 5.0)] {
            let material = world.picture([[255, 30, 60, 255], [20, 90, 250, 255]], None);
            let texture = world.scene.textures.pop().expect("just made").wrapped(wrap).magnified(magnification);
            world.scene.textures.push(texture);
            let first = world.scene.geometry.texcoords.len();
            world.quad(material, Vec3::new(x, 0.0, 8.0), Vec3::X * 2.4, Vec3::Y * 5.0);
            world.scene.geometry.texcoords[first..].iter_mut().for_each(|uv| *uv = *uv * 3.0 - 1.0);
        }
        let mirror = world.glass();
        world.quad(mirror, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
        let params = RayParams { texture_lod, ..RayParams::default() };
        both(&world, Vec3::new(0.0, 0.0, 5.0), RayProgram::Reflection, params)
    };
    let colors = |picture: &[[f32; 4]]| {
        let rounded = picture.iter().map(|pixel| pixel.map(|channel| (channel * 1e4).round() as i32));
        rounded.collect::<std::collections::BTreeSet<_>>().len()
    };
    for texture_lod in [TextureLod::Zero, TextureLod::Cones] {
        let Some([found, expected]) = pictures(Magnification::Nearest, texture_lod) else { return };
        // Where the border of two texels passes through a pixel's centre, the last bit decides.
        let off = differing(&found, &expected, 1e-5);
        assert!(off <= FEW, "{texture_lod:?}: {off} pixels are off");
        assert_eq!(
            [&found, &expected].map(|picture| colors(picture)),
            [4; 2],
            "two texels, what is around them, and what is around the mirror"
        );
        let Some([blended, _]) = pictures(Magnification::Linear, texture_lod) else { return };
        assert!(colors(&blended) > 15, "control: {} colours", colors(&blended));
    }
}

#[test]
fn textures_that_do_not_repeat_and_light_of_surfaces_are_seen_in_mirrors() {
    let mut world = World::lit_along(Vec3::new(-0.3, -0.5, -1.0));
    let mut scene = |wrap: [Wrap; 2], place: Vec3| {
        let material = world.picture([[255, 30, 60, 255], [20, 90, 250, 255]], None);
        let textures = &mut world.scene.textures;
        let texture = textures.pop().expect("just made").wrapped(wrap);
        textures.push(texture);
        let glow = textures.len() as u32 - 1;
        world.shades[material as usize].glow = Some(Glow { color: Vec3::new(0.5, 0.25, 0.1), texture: Some(glow) });
        let first = world.scene.geometry.texcoords.len();
        world.quad(material, place, Vec3::X * 0.9, Vec3::Y * 0.9);
        world.scene.geometry.texcoords[first..].iter_mut().for_each(|uv| *uv = *uv * 3.0 - 1.0);
    };
    scene([Wrap::Clamp, Wrap::Repeat], Vec3::new(-1.0, 1.0, 8.0));
    scene([Wrap::Mirror, Wrap::Clamp], Vec3::new(1.0, 1.0, 8.0));
    scene([Wrap::Repeat, Wrap::Mirror], Vec3::new(-1.0, -1.0, 8.0));
    let plain = world.paint(Vec3::new(0.2, 0.8, 0.3));
    world.shades[plain as usize].glow = Some(Glow { color: Vec3::new(0.0, 0.4, 0.9), texture: None });
    world.quad(plain, Vec3::new(1.0, -1.0, 8.0), Vec3::X * 0.9, Vec3::Y * 0.9);
    let mirror = world.glass();
    world.quad(mirror, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
    let Some([found, expected]) = both(&world, Vec3::new(0.0, 0.0, 5.0), RayProgram::Reflection, RayParams::default())
    else {
        return;
    };
    assert_eq!(differing(&found, &expected, 1e-5), 0);
    let seen = expected.iter().filter(|pixel| pixel[0] + pixel[1] + pixel[2] > 0.5).count();
    assert!(seen > 500, "{seen} pixels show what shines");
}
