use crate::cpu::trace_pixel;
use crate::effects::tests::world::{Shot, World, grid};
use crate::trace::{Bvh, Decided, Estimates, Hit, InstructionSet, Packet, Ray, Tracer};
use curitiba_pipeline::backend::NO_TRIANGLE;
use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{Mat3, Vec3, Vec4};
use std::sync::atomic::{AtomicU64, Ordering};

const EYE: Vec3 = Vec3::new(0.3, 9.0, 4.0);

fn shadows(shot: &Shot<'_>, fidelity: Fidelity) -> (Vec<[f32; 4]>, u64) {
    let (pixels, rays) = shot.run(RayProgram::DeferredShadows, fidelity, RayParams::default());
    assert_eq!(rays.total(), rays.shadow);
    (pixels, rays.shadow)
}

/// A floor and, one unit above, a roof over `x < 0` with its other edges far away; light falls towards +x at 45
/// degrees.
fn half_plane() -> World {
    let mut world = World::lit_along(Vec3::new(1.0, -1.0, 0.0));
    let paint = world.paint(Vec3::splat(0.5));
    world.quad(paint, Vec3::ZERO, Vec3::Z * 20.0, Vec3::X * 20.0);
    world.quad(paint, Vec3::new(-10.0, 1.0, 0.0), Vec3::X * 10.0, Vec3::NEG_Z * 20.0);
    world
}

#[test]
fn a_half_plane_casts_a_hard_shadow_with_a_straight_edge() {
    let world = half_plane();
    // Seen from below the roof and from outside, so that both sides of the edge at x = 1 are visible.
    let targets: Vec<Vec3> = grid(40, Vec3::new(1.5, 0.0, 0.0), Vec3::X * 1.4, Vec3::Z * 3.0).collect();
    let shot = Shot::of(&world, EYE, targets.iter().copied());
    for fidelity in [Corrected, Thesis] {
        let (pixels, rays) = shadows(&shot, fidelity);
        assert_eq!(rays, 1600, "one ray a pixel");
        let mut shadowed = 0;
        for (pixel, position) in pixels.iter().zip(&shot.position) {
            assert!(position[1].abs() < 1e-4, "the floor is seen");
            let expected = if position[0] < 1.0 { 0.5 } else { 1.0 };
            assert_eq!(pixel[..3], [expected; 3], "{fidelity:?} at {position:?}");
            shadowed += usize::from(expected == 0.5);
        }
        assert!((200..1400).contains(&shadowed), "both sides are tested: {shadowed}");
    }
}

#[test]
fn only_thesis_writes_the_value_into_alpha() {
    let world = half_plane();
    let shot = Shot::of(&world, EYE, [Vec3::new(0.5, 0.0, 0.0)]);
    assert_eq!(shadows(&shot, Corrected).0, [[0.5, 0.5, 0.5, 1.0]]);
    assert_eq!(shadows(&shot, Thesis).0, [[0.5; 4]]);
}

#[test]
fn background_and_unlit_pixels_are_one_and_trace_nothing() {
    let mut world = half_plane();
    // Light from below: every cosine is 0.
    world.sun.as_mut().expect("a sun").direction = Vec3::new(0.0, 1.0, 0.0);
    let shot = Shot::of(&world, EYE, [Vec3::new(0.5, 0.0, 0.0), EYE + Vec3::Y]);
    for fidelity in [Corrected, Thesis] {
        assert_eq!(shadows(&shot, fidelity), (vec![[1.0; 4]; 2], 0));
    }
}

#[test]
fn a_triangle_turned_away_from_the_light_is_in_its_own_shadow_without_a_ray() {
    let mut world = World::lit_along(Vec3::new(1.0, -0.05, 0.0));
    let paint = world.paint(Vec3::splat(0.5));
    // The triangle is tilted away from the light by less than its vertex normals are bent towards the light.
    world.quad(paint, Vec3::ZERO, Vec3::Z, Vec3::new(1.0, -0.2, 0.0));
    world.bend_normals(Vec3::new(-0.3, 1.0, 0.0));
    let shot = Shot::of(&world, EYE, [Vec3::new(0.1, -0.02, 0.1)]);
    assert!(shot.position[0][3] > 0.1, "the shading normal sees the light");
    assert_eq!(shadows(&shot, Corrected), (vec![[0.5, 0.5, 0.5, 1.0]], 0));
    // In thesis fidelity, the ray leaves the triangle on the side that faces the light, and hits nothing.
    assert_eq!(shadows(&shot, Thesis), (vec![[1.0; 4]], 1));
}

#[test]
fn the_side_is_that_of_the_vertex_normals_where_there_are_any() {
    // A floor seen from below, whose normals point up to the light: lit from above.
    let mut world = World::lit_along(Vec3::new(0.2, -1.0, 0.0));
    let paint = world.paint(Vec3::splat(0.5));
    world.quad(paint, Vec3::ZERO, Vec3::X, Vec3::Z);
    world.bend_normals(Vec3::Y);
    let below = Vec3::new(0.0, -3.0, 0.0);
    let shot = Shot::of(&world, below, [Vec3::new(0.1, 0.0, 0.1)]);
    assert_eq!(shadows(&shot, Corrected), (vec![[1.0; 4]], 1));
    // Without vertex normals, the lit side is the viewer's.
    let mut bare = world.scene.clone();
    bare.geometry.normals.clear();
    let mut job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
    job.scene = &bare;
    let (pixels, rays) = shot.run_on(&world.brute_force(), &job);
    assert_eq!((pixels, rays.shadow), (vec![[0.5, 0.5, 0.5, 1.0]], 0));
}

#[test]
fn light_passes_where_a_texture_is_cut_out_in_corrected_only() {
    let mut world = World::lit_along(Vec3::NEG_Y);
    let paint = world.paint(Vec3::splat(0.5));
    let leaves = world.picture([[255, 255, 255, 255], [255, 255, 255, 0]], Some(0.5));
    world.quad(paint, Vec3::ZERO, Vec3::Z * 2.0, Vec3::X * 2.0);
    // Opaque around u = 1/4 (x = -0.5), cut out around u = 3/4 (x = 0.5).
    world.quad(leaves, Vec3::Y, Vec3::X, Vec3::Z);
    let points = [Vec3::new(-0.5, 0.0, 0.3), Vec3::new(0.5, 0.0, 0.3), Vec3::new(1.5, 0.0, 0.3)];
    let shot = Shot::of(&world, Vec3::new(0.0, 0.5, 8.0), points);
    let values = |fidelity| shadows(&shot, fidelity).0.iter().map(|pixel| pixel[0]).collect::<Vec<_>>();
    assert_eq!(values(Corrected), [0.5, 1.0, 1.0]);
    assert_eq!(values(Thesis), [0.5, 0.5, 1.0]);
    // The same leaves drawn in the report's glass mask, (1, 0, 1, 0), keep their shape.
    world.shades[leaves as usize].diffuse = Vec4::new(1.0, 0.0, 1.0, 0.0);
    let shot = Shot::of(&world, Vec3::new(0.0, 0.5, 8.0), points);
    assert_eq!(shadows(&shot, Corrected).0.iter().map(|pixel| pixel[0]).collect::<Vec<_>>(), [0.5, 1.0, 1.0]);
}

/// Rounds to the 11 binary digits of a 16-bit float.
fn half_precision(value: f32) -> f32 {
    f32::from_bits((value.to_bits() + 0x1000) & !0x1fff)
}

#[test]
fn stored_positions_of_low_precision_shadow_themselves_in_thesis_only() {
    let mut world = World::lit_along(Vec3::new(0.6, -0.7, 0.2));
    let paint = world.paint(Vec3::splat(0.5));
    world.quad(paint, Vec3::new(0.0, -30.0, -500.0), Vec3::X * 300.0, Vec3::new(0.0, 80.0, -300.0));
    let targets = grid(30, Vec3::new(0.0, -30.0, -500.0), Vec3::X * 100.0, Vec3::new(0.0, 26.0, -100.0));
    let mut shot = Shot::of(&world, Vec3::ZERO, targets);
    for position in &mut shot.position {
        let [x, y, z, w] = *position;
        *position = [half_precision(x), half_precision(y), half_precision(z), w];
    }
    let dark = |fidelity| shadows(&shot, fidelity).0.iter().filter(|pixel| pixel[0] != 1.0).count();
    assert_eq!(dark(Corrected), 0, "the position is put back onto its triangle");
    assert!(dark(Thesis) > 300, "{}", dark(Thesis));
}

#[test]
fn a_lit_plane_does_not_shadow_itself_at_any_scale_and_place() {
    let rotation = Mat3::from_axis_angle(Vec3::new(0.3, 1.0, -0.7).normalize(), 1.1);
    for scale in [1e-3, 1.0, 1e3] {
        for distance in [0.0, 1.0, 1e3] {
            let mut world = World::lit_along(Vec3::new(0.3, -0.4, 0.7));
            let paint = world.paint(Vec3::splat(0.5));
            world.quad(paint, Vec3::ZERO, Vec3::Z, Vec3::X);
            let offset = Vec3::new(0.7, -0.3, 0.6) * distance * scale;
            world.transform(rotation, scale, offset);
            let place = |p: Vec3| rotation * p * scale + offset;
            let targets = grid(20, Vec3::ZERO, Vec3::X * 0.9, Vec3::Z * 0.9).map(place);
            let shot = Shot::of(&world, place(Vec3::new(0.2, 3.0, 0.5)), targets);
            assert!(shot.position.iter().all(|position| position[3] > 0.1));
            let dark = |fidelity| shadows(&shot, fidelity).0.iter().filter(|pixel| pixel[0] != 1.0).count();
            assert_eq!(dark(Corrected), 0, "scale {scale}, distance {distance}");
            if scale * distance >= 1e6 {
                assert!(dark(Thesis) > 50, "the fixed distance is below the rounding here: {}", dark(Thesis));
            }
        }
    }
}

#[test]
fn pixels_of_a_tile_get_what_they_get_alone() {
    let world = World::scattered();
    let targets: Vec<Vec3> = grid(48, Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Y * 4.0).collect();
    let mut bare = world.scene.clone();
    bare.geometry.normals.clear();
    // 48 pixels a row are three tiles. 36 pixels leave one tile of four columns, and rows that fill no tile.
    for width in [48, 36] {
        let shot = Shot::of(&world, Vec3::new(1.0, 2.0, 12.0), targets.iter().copied()).rows(width);
        for scene in [&world.scene, &bare] {
            let mut job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
            job.scene = scene;
            let tracer = world.tree();
            let (pixels, rays) = shot.run_on(&tracer, &job);
            let alone: Vec<[f32; 4]> = (0..job.height)
                .flat_map(|y| (0..job.width).map(move |x| (x, y)))
                .map(|(x, y)| trace_pixel(&tracer, &job, x, y).expect("a complete job"))
                .collect();
            assert_eq!(pixels, alone);
            let dark = pixels.iter().filter(|pixel| pixel[0] == 0.5).count();
            let seen = job.triangle.iter().filter(|triangle| **triangle != NO_TRIANGLE).count();
            assert!(dark > 200 && dark < seen && (rays.shadow as usize) < seen, "{dark} {seen} {rays:?}");
        }
    }
}

/// A tree that counts the rays that it is asked to trace.
struct Counting<'a> {
    tree: &'a Bvh,
    traced: AtomicU64,
}

impl Counting<'_> {
    fn note(&self, rays: u32) {
        self.traced.fetch_add(rays.into(), Ordering::Relaxed);
    }
}

impl Tracer for Counting<'_> {
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.tree.closest(ray, accept)
    }

    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.note(1);
        self.tree.occluded(ray, accept)
    }

    fn decides(&self) -> bool {
        true
    }

    fn decide(&self, estimates: &Estimates, decided: &mut Decided) {
        self.tree.decide(estimates, decided);
    }

    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], accept: impl FnMut(usize, &Hit) -> bool) {
        self.note(packets.iter().map(|packet| packet.active.count_ones()).sum());
        self.tree.occluded_packets(packets, blocked, accept);
    }
}

/// A floor of a few large triangles with a step in it, under triangles that cast shadows.
fn under_a_roof() -> World {
    let mut world = World::scattered();
    let paint = world.paint(Vec3::splat(0.5));
    world.quad(paint, Vec3::new(-4.0, -4.0, 0.0), Vec3::Z * 8.0, Vec3::X * 4.0);
    world.quad(paint, Vec3::new(4.0, -3.5, 0.0), Vec3::Z * 8.0, Vec3::X * 4.0);
    world.quad(paint, Vec3::new(0.0, -3.75, 0.0), Vec3::Z * 8.0, Vec3::Y * 0.25);
    world
}

#[test]
fn most_rays_are_decided_by_estimates_as_they_are_alone() {
    let rotation = Mat3::from_axis_angle(Vec3::new(0.3, 1.0, -0.7).normalize(), 1.1);
    let (mut all, mut traced_of_all, mut dark) = (0, 0, 0);
    for (scale, distance) in [(1.0, 0.0), (1.0, 30.0), (1.0, 1e3), (1e-3, 10.0), (1e3, 1.0)] {
        for light in [Vec3::new(0.4, -1.0, 0.3), Vec3::new(-0.9, -0.3, 0.1), Vec3::NEG_Y, Vec3::new(0.0, -0.1, -1.0)] {
            let mut world = under_a_roof();
            world.sun.as_mut().expect("a sun").direction = light.normalize();
            let turn = if distance == 30.0 { Mat3::IDENTITY } else { rotation };
            let offset = Vec3::new(0.7, -0.3, 0.6) * distance * scale;
            world.transform(turn, scale, offset);
            let place = |p: Vec3| turn * p * scale + offset;
            let targets = grid(64, Vec3::NEG_Y * 4.0, Vec3::X * 5.0, Vec3::Z * 5.0).map(place);
            let shot = Shot::of(&world, place(Vec3::new(1.0, 9.0, 7.0)), targets).rows(64);
            let mut bare = world.scene.clone();
            bare.geometry.normals.clear();
            for scene in [&world.scene, &bare] {
                let mut job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
                job.scene = scene;
                for lanes in [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable] {
                    let Some(tree) = world.tree().with_instruction_set(lanes) else { continue };
                    let counting = Counting { tree: &tree, traced: AtomicU64::new(0) };
                    let (pixels, rays) = shot.run_on(&counting, &job);
                    let alone: Vec<[f32; 4]> = (0..64 * 64)
                        .map(|index| trace_pixel(&tree, &job, index % 64, index / 64).expect("a complete job"))
                        .collect();
                    assert_eq!(pixels, alone, "scale {scale}, distance {distance}, light {light}, {lanes:?}");
                    all += rays.shadow;
                    traced_of_all += counting.traced.into_inner();
                    dark += pixels.iter().filter(|pixel| pixel[0] == 0.5).count();
                }
            }
        }
    }
    assert!(traced_of_all * 2 < all, "{traced_of_all} of {all} rays were traced");
    assert!(dark > 10_000, "{dark} pixels are dark");
}

#[test]
fn positions_off_their_triangle_are_decided_as_alone() {
    let world = under_a_roof();
    let targets: Vec<Vec3> = grid(32, Vec3::NEG_Y * 4.0, Vec3::X * 5.0, Vec3::Z * 5.0).collect();
    let eye = Vec3::new(1.0, 9.0, 7.0);
    let mut shot = Shot::of(&world, eye, targets).rows(32);
    let mut state = 3_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    for (index, position) in shot.position.iter_mut().enumerate() {
        // Offsets of low precision, offsets far away, and positions that are NaN, infinite or huge.
        let off = [2e-3, 0.0, 0.3, 1e-6, 0.0, 5.0, 1e-4, 0.0][index % 8];
        for coordinate in &mut position[..3] {
            *coordinate += off * random();
        }
        match index % 97 {
            0 => position[index % 3] = f32::NAN,
            1 => position[index % 3] = f32::INFINITY,
            2 => position[index % 3] = 3e38,
            _ => {}
        }
    }
    let job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
    let tree = world.tree();
    let (pixels, _) = shot.run_on(&tree, &job);
    let alone: Vec<[f32; 4]> =
        (0..32 * 32).map(|index| trace_pixel(&tree, &job, index % 32, index / 32).expect("a complete job")).collect();
    assert_eq!(pixels, alone);
}

/// Workers keep their buffers from pass to pass, and the unused lanes of a tile's last sixteen pixels hold earlier
/// pixels.
#[test]
fn a_small_picture_of_a_small_scene_may_follow_a_large_one() {
    let large = World::scattered();
    let targets: Vec<Vec3> = grid(48, Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Y * 4.0).collect();
    let before = Shot::of(&large, Vec3::new(1.0, 2.0, 12.0), targets).rows(48);
    let mut small = World::lit_along(Vec3::NEG_Z);
    let paint = small.paint(Vec3::splat(0.5));
    small.quad(paint, Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0);
    let after = Shot::of(&small, Vec3::new(0.1, 0.2, 3.0), grid(3, Vec3::ZERO, Vec3::X, Vec3::Y));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for program in [RayProgram::DeferredShadows, RayProgram::Ssao, RayProgram::Final] {
        let run = |world: &World, shot: &Shot<'_>| {
            let job = shot.job(program, Corrected, RayParams { samples: 16, ..RayParams::default() });
            pool.install(|| shot.run_on(&world.tree(), &job).0)
        };
        let alone = run(&small, &after);
        run(&large, &before);
        assert_eq!(run(&small, &after), alone, "{program:?}");
    }
}
