//! Grouping of glass into planes.

use super::world::World;
use curitiba_passes::raster::effects::planes::{GlassPlane, Glazing, NO_PLANE, ROUNDING};
use glam::{DQuat, DVec3, Vec3};

fn glazing(world: &World) -> Glazing {
    Glazing::find(&world.scene.geometry, &world.glass).expect("host memory")
}

/// Panes of a facade, rotated and moved in `f64` and then rounded once. Panes of odd columns stand forward by
/// `forward`.
fn facade(turn: DQuat, at: DVec3, forward: f64) -> World {
    let mut world = World::default();
    let (wall, glass) = (world.paint(Vec3::ONE), world.pane());
    for column in 0..20u32 {
        for row in 0..4u32 {
            let off = if column % 2 == 1 { forward } else { 0.0 };
            let local = DVec3::new(1.7 * f64::from(column) - 16.0, 2.3 * f64::from(row), off);
            let size = if row == 3 { 0.2 } else { 0.6 };
            let (center, x, y) = (turn * local + at, turn * DVec3::X * size, turn * DVec3::Y * (1.5 * size));
            world.quad(glass, center.as_vec3(), x.as_vec3(), y.as_vec3());
            world.quad(wall, center.as_vec3() + Vec3::ONE, x.as_vec3(), y.as_vec3());
        }
    }
    world
}

#[test]
fn panes_of_a_facade_are_one_plane_however_it_is_turned_and_wherever_it_stands() {
    for away in [0.0, 30.0, 1e4] {
        for i in 0..12u32 {
            let turn = DQuat::from_rotation_y(0.53 * f64::from(i)) * DQuat::from_rotation_x(0.1 * f64::from(i));
            let at = DVec3::new(away, 0.3 * away, -0.7 * away);
            let found = glazing(&facade(turn, at, 0.0));
            assert_eq!(found.planes.len(), 1, "{away} {i}: {:?}", found.planes);
            let normal = turn * DVec3::Z;
            let plane = found.planes[0];
            let GlassPlane { normal: found_normal, slack, .. } = plane;
            // The error of the plane is the error of the corners times the factor of extrapolation.
            let rounding = (away + 30.0) * ROUNDING;
            assert!(found_normal.cross(normal).length() < 10.0 * rounding, "{away} {i}");
            assert!(plane.distance(at).abs() < 100.0 * rounding, "{away} {i}");
            assert!(slack < 200.0 * rounding, "{away} {i}: {slack}");
        }
    }
}

#[test]
fn panes_a_millimetre_before_others_are_another_plane() {
    let turn = DQuat::from_rotation_y(0.7);
    for (forward, planes) in [(0.0, 1), (1e-3, 2), (-0.05, 2)] {
        assert_eq!(glazing(&facade(turn, DVec3::ZERO, forward)).planes.len(), planes, "{forward}");
    }
}

#[test]
fn every_triangle_of_glass_has_its_plane_and_no_other_triangle() {
    let world = facade(DQuat::from_rotation_y(0.7), DVec3::new(3.0, 1.0, 2.0), 0.1);
    let found = glazing(&world);
    let geometry = &world.scene.geometry;
    for triangle in 0..geometry.triangles.len() as u32 {
        let plane = found.plane_of(triangle);
        assert_eq!(plane.is_some(), world.glass[geometry.material_of(triangle) as usize]);
        let Some(plane) = plane else { continue };
        let plane = &found.planes[plane as usize];
        for corner in geometry.corners(triangle) {
            assert!(plane.distance(corner.as_dvec3()).abs() <= plane.slack);
            assert!(plane.bounds.distance_squared(corner) == 0.0);
        }
    }
    assert_eq!(found.plane_of(geometry.triangles.len() as u32), None);
    assert_eq!(found.plane_of(u32::MAX), None);
    assert_eq!(glazing(&World::default()), Glazing::default());
}

#[test]
fn both_sides_and_the_faces_of_a_box_are_told_by_their_planes() {
    let mut world = World::default();
    let glass = world.pane();
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
    world.quad(glass, Vec3::X * 3.0, Vec3::Y, Vec3::X);
    assert_eq!(glazing(&world).planes.len(), 1, "two panes that look to opposite sides");
    // A thin box has two large faces and four narrow ones.
    world.block(glass, Vec3::new(0.0, 5.0, 0.0), Vec3::new(1.0, 0.8, 0.004));
    assert_eq!(glazing(&world).planes.len(), 7);
}

/// A glass ball of `rings` rings, with the normals of its faces or smooth ones.
fn ball(rings: u32, smooth: bool) -> World {
    let mut world = World::default();
    let glass = world.pane();
    let at = |ring: u32, step: u32| {
        let share = |index: u32| index as f32 / rings as f32;
        let (a, b) = (share(ring) * std::f32::consts::PI, share(step) * std::f32::consts::TAU);
        Vec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin())
    };
    for ring in 1..rings - 1 {
        for step in 0..rings {
            let (p, q, r) = (at(ring, step), at(ring, step + 1), at(ring + 1, step));
            let normal = (q - p).cross(r - p).normalize();
            let geometry = &mut world.scene.geometry;
            let first = geometry.positions.len() as u32;
            geometry.positions.extend([p, q, r]);
            geometry.normals.extend(if smooth { [p, q, r] } else { [normal; 3] });
            geometry.texcoords.extend([glam::Vec2::ZERO; 3]);
            let id = geometry.triangles.len() as u32;
            geometry.triangles.push([first, first + 1, first + 2]);
            geometry.batches.push(curitiba_pipeline::scene::Batch { material: glass, first: id, count: 1 });
        }
    }
    world
}

#[test]
fn round_glass_has_no_plane_and_cut_glass_one_for_each_face() {
    let found = glazing(&ball(40, true));
    assert!(found.planes.is_empty() && found.runs.iter().all(|run| run.plane == NO_PLANE));
    assert_eq!(found.runs.iter().map(|run| run.end - run.first).sum::<u32>(), 38 * 40);
    let found = glazing(&ball(40, false));
    assert_eq!(found.planes.len(), 38 * 40);
}

#[test]
fn many_faces_are_told_apart_in_little_time() {
    let world = ball(250, false);
    let start = std::time::Instant::now();
    let found = glazing(&world);
    println!("{} planes in {:.2?}", found.planes.len(), start.elapsed());
    assert!(found.planes.len() > 60_000 && start.elapsed().as_secs() < 20);
}

#[test]
fn triangles_that_are_no_triangles_have_no_plane() {
    let mut world = World::default();
    let glass = world.pane();
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::X);
    world.quad(glass, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    world.quad(glass, Vec3::NAN, Vec3::X, Vec3::Y);
    world.quad(glass, Vec3::splat(3e38), Vec3::X, Vec3::Y);
    let found = glazing(&world);
    assert!(found.planes.is_empty(), "{found:?}");
}
