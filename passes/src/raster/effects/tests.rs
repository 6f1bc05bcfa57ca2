//! The cameras of shadow maps and cube maps, and the choice of panes, against closed forms.

use super::bounds::{Bounds, Frustum};
use super::cascades::{Cascades, depth_plane};
use super::cube;
use super::panes::{self, Probes};
use super::shadow::ShadowFit;
use crate::sampling::hash::{pcg4d, unit};
use curitiba_pipeline::backend::{Sun, View};
use curitiba_pipeline::raster_effects::EffectParams;
use curitiba_pipeline::scene::{Batch, Geometry, Sphere};
use glam::{Mat4, Vec2, Vec3};

fn camera(eye: Vec3, target: Vec3, far: f32) -> View {
    let up = if (target - eye).normalize().y.abs() > 0.99 { Vec3::X } else { Vec3::Y };
    let look = glam::camera::rh::view::look_at_mat4(eye, target, up);
    View::new(glam::camera::rh::proj::directx::perspective(1.0, 1.0, far, 0.1) * look, eye)
}

fn sun(direction: Vec3) -> Sun {
    Sun { direction: direction.normalize(), color: Vec3::ONE }
}

fn bounds(min: Vec3, max: Vec3) -> Bounds {
    Bounds { min, max }
}

/// A pseudo-random point of the unit cube.
fn random(index: u32) -> Vec3 {
    let [x, y, z, _] = pcg4d([index, 0, 0, 0]).map(unit);
    Vec3::new(x, y, z)
}

const STREET: (Vec3, Vec3) = (Vec3::new(-40.0, -2.0, -30.0), Vec3::new(50.0, 20.0, 35.0));

#[test]
fn the_shadow_map_covers_all_that_is_seen_and_all_casters_in_depth() {
    let scene = bounds(STREET.0, STREET.1);
    let directions = [Vec3::NEG_Y, Vec3::Y, Vec3::new(0.3, -1.0, 0.2), Vec3::new(1.0, -0.01, 0.0), Vec3::NEG_Z];
    for direction in directions {
        for far in [3.0, 30.0, 3000.0] {
            let view = camera(Vec3::new(3.0, 2.0, 5.0), Vec3::new(-4.0, 1.0, -2.0), far);
            let params = EffectParams { map_size: 512, ..EffectParams::default() };
            let fit = ShadowFit::new(&sun(direction), &scene, &view, &params).expect("a scene");
            let (center, radius) =
                Frustum::new(&view.clip_from_world).and_then(|f| f.sphere_with(&scene)).expect("something seen");
            for i in 0..1000u32 {
                let point = scene.min + (scene.max - scene.min) * random(i);
                let place = fit.place(point);
                assert!((0.0..=1.0).contains(&place.z), "{direction} {far}: {place}");
                if (point.as_dvec3() - center).length() <= radius {
                    assert!(place.x > 0.0 && place.x < 512.0 && place.y > 0.0 && place.y < 512.0, "{place}");
                }
                // The place in the map agrees with the clip space of the map's camera.
                let clip = fit.view.clip_from_world * point.extend(1.0);
                let pixel = Vec2::new(clip.x * 0.5 + 0.5, 0.5 - clip.y * 0.5) * 512.0;
                assert!((pixel - place.truncate()).length() < 2e-3 && (clip.z - place.z).abs() < 1e-6);
            }
            // One unit along the light changes the depth by `depth_per_unit`, and one unit across it moves by one over
            // the texel size.
            let p = Vec3::new(1.0, 2.0, 3.0);
            let (there, along) = (fit.place(p), fit.place(p + direction.normalize()));
            assert!((there.z - along.z - fit.depth_per_unit).abs() < 1e-6);
            assert!((there.truncate() - along.truncate()).length() < 1e-2);
            let across = direction.normalize().any_orthonormal_vector();
            let moved = (fit.place(p + across).truncate() - there.truncate()).length();
            assert!((moved * fit.texel - 1.0).abs() < 1e-2, "{moved} {}", fit.texel);
        }
    }
}

#[test]
fn the_shadow_map_is_no_coarser_than_the_scenes_sphere_and_finer_where_less_is_seen() {
    let scene = bounds(STREET.0, STREET.1);
    let params = EffectParams { map_size: 1024, ..EffectParams::default() };
    let texel = |far: f32| {
        let view = camera(Vec3::new(3.0, 2.0, 5.0), Vec3::new(-4.0, 1.0, -2.0), far);
        ShadowFit::new(&sun(Vec3::NEG_Y), &scene, &view, &params).expect("a scene").texel
    };
    assert!(texel(3000.0) <= 2.0 * scene.radius() / (1024.0 - 6.0) * 1.0001);
    assert!(texel(3.0) < 0.1 * texel(3000.0));
}

#[test]
fn a_moving_camera_moves_the_shadow_map_by_whole_texels() {
    let scene = bounds(STREET.0, STREET.1);
    let params = EffectParams { map_size: 1024, ..EffectParams::default() };
    let fit = |eye: Vec3| {
        let view = camera(eye, eye + Vec3::new(-0.5, -0.6, -0.4), 12.0);
        ShadowFit::new(&sun(Vec3::new(0.3, -1.0, 0.2)), &scene, &view, &params).expect("a scene")
    };
    let start = Vec3::new(3.0, 6.0, 5.0);
    let first = fit(start);
    let (mut same, mut kept) = (0, 0);
    for step in 0..200 {
        let moved = fit(start + Vec3::new(0.5, 0.0, 0.3) * (step as f32 * 0.2 * first.texel));
        if moved.texel != first.texel {
            continue;
        }
        kept += 1;
        let p = Vec3::new(1.0, 0.5, 2.0);
        let shift = moved.place(p).truncate() - first.place(p).truncate();
        assert!((shift - shift.round()).length() < 2e-3, "{shift}");
        same += i32::from(shift.round() == Vec2::ZERO);
    }
    assert!(kept > 100 && same > 1 && same < kept, "{kept} {same}");
}

#[test]
fn no_shadow_map_is_fitted_to_nothing() {
    let view = camera(Vec3::ZERO, Vec3::NEG_Z, 10.0);
    let params = EffectParams { map_size: 1024, ..EffectParams::default() };
    let scene = bounds(Vec3::NEG_ONE, Vec3::ONE);
    assert_eq!(ShadowFit::new(&sun(Vec3::NEG_Y), &Bounds::EMPTY, &view, &params), None);
    let dark = Sun { direction: Vec3::ZERO, color: Vec3::ONE };
    assert_eq!(ShadowFit::new(&dark, &scene, &view, &params), None);
    let dark = Sun { direction: Vec3::NAN, color: Vec3::ONE };
    assert_eq!(ShadowFit::new(&dark, &scene, &view, &params), None);
    // A degenerate camera, and a scene that is a single point, still get a map.
    let broken = View::new(Mat4::ZERO, Vec3::ZERO);
    for view in [view, broken] {
        for scene in [scene, bounds(Vec3::splat(3.0), Vec3::splat(3.0))] {
            for map_size in [16, 16_384] {
                let params = EffectParams { map_size, pcf: 8, ..params };
                let fit = ShadowFit::new(&sun(Vec3::NEG_Y), &scene, &view, &params).expect("a map");
                assert!(fit.texel > 0.0 && fit.texel.is_finite() && fit.place(scene.min).is_finite());
            }
        }
    }
}

#[test]
fn every_visible_point_between_the_depths_is_in_a_map_that_is_no_coarser_than_that_of_its_part() {
    let scene = bounds(STREET.0, STREET.1);
    for (direction, far) in
        [(Vec3::NEG_Y, 300.0), (Vec3::new(0.3, -1.0, 0.2), 300.0), (Vec3::new(1.0, -0.02, 0.3), 30.0)]
    {
        let view = camera(Vec3::new(3.0, 2.0, 5.0), Vec3::new(-4.0, 1.0, -2.0), far);
        let plane = depth_plane(&view);
        for cascades in 1..=8 {
            let params = EffectParams { map_size: 512, cascades, ..EffectParams::default() };
            let fits = Cascades::new(&sun(direction), &scene, &view, [0.5, 20.0], &params).fits;
            assert_eq!(fits.len(), cascades as usize);
            assert!(fits.windows(2).all(|pair| pair[0].texel < pair[1].texel), "the nearer the finer");
            let mut seen = 0;
            for i in 0..20_000u32 {
                let point = scene.min + (scene.max - scene.min) * random(i);
                let clip = view.clip_from_world * point.extend(1.0);
                let depth = plane.dot(point.extend(1.0));
                let outside = clip.x.abs().max(clip.y.abs()) > clip.w || clip.z < 0.0 || clip.z > clip.w;
                if outside || !(0.5..=20.0).contains(&depth) {
                    continue;
                }
                // Closed form: a perspective camera's clip `w` is the depth.
                assert!((depth - clip.w).abs() < 1e-3);
                seen += 1;
                // The depth range 0.5..2^4.5 is that of the pixels, rounded outwards to whole steps.
                let part = (depth / 0.5).ln() / (2f32.powf(4.5) / 0.5).ln() * cascades as f32;
                let first = fits.iter().position(|fit| fit.covers(fit.place(point), &params)).expect("in a map");
                assert!(first as f32 <= part + 1e-3, "{direction} {depth}: map {first}, part {part}");
            }
            assert!(seen > 300, "{seen}");
        }
    }
}

#[test]
fn there_are_only_as_many_maps_as_something_is_seen_in() {
    let scene = bounds(STREET.0, STREET.1);
    let params = EffectParams { map_size: 256, cascades: 4, ..EffectParams::default() };
    let count = |view: &View, depths: [f32; 2]| {
        let cascades = Cascades::new(&sun(Vec3::new(0.3, -1.0, 0.2)), &scene, view, depths, &params);
        assert!(cascades.fits.iter().all(|fit| fit.texel > 0.0 && fit.texel.is_finite()));
        cascades.fits.len()
    };
    let view = camera(Vec3::new(3.0, 2.0, 5.0), Vec3::new(-4.0, 1.0, -2.0), 300.0);
    assert_eq!(count(&view, [1.0, 20.0]), 4);
    // The nearer half of the depth range lies in front of the scene.
    let away = camera(Vec3::new(0.0, 5.0, 120.0), Vec3::ZERO, 300.0);
    assert!((1..4).contains(&count(&away, [0.2, 150.0])));
    // Invalid depth ranges fall back to all that the camera sees.
    for depths in [[0.0, 0.0], [0.0, f32::INFINITY], [f32::NAN; 2], [1e30, 1e38], [-1.0, 5.0]] {
        assert!((1..=4).contains(&count(&view, depths)), "{depths:?}");
    }
    // An orthographic camera has one scale for all depths, and no depth plane.
    let look = glam::camera::rh::view::look_at_mat4(Vec3::Y * 50.0, Vec3::ZERO, Vec3::Z);
    let flat = glam::camera::rh::proj::directx::orthographic(-4.0, 4.0, -4.0, 4.0, 100.0, 0.1);
    let flat = View::new(flat * look, Vec3::Y * 50.0);
    assert_eq!((count(&flat, [1.0, 20.0]), depth_plane(&flat)), (1, glam::Vec4::ZERO));
    let broken = View::new(Mat4::ZERO, Vec3::ZERO);
    assert_eq!(count(&broken, [1.0, 20.0]), 1);
    // A light without a direction, and a scene without a point, give no map.
    let none = |direction, scene: &Bounds| {
        let sun = Sun { direction, color: Vec3::ONE };
        Cascades::new(&sun, scene, &view, [1.0, 20.0], &params) == Cascades::default()
    };
    assert!(none(Vec3::ZERO, &scene) && none(Vec3::NEG_Y, &Bounds::EMPTY) && !none(Vec3::NEG_Y, &scene));
}

#[test]
fn a_cube_face_shows_a_direction_where_it_is_looked_up() {
    let center = Vec3::new(3.0, -1.0, 2.0);
    let mut seen = [0; cube::FACES];
    for i in 0..5000u32 {
        let direction = 2.0 * random(i) - 1.0;
        let (face, at) = cube::locate(direction);
        seen[face] += 1;
        assert!(at.cmpge(Vec2::splat(-1e-6)).all() && at.cmple(Vec2::splat(1.0 + 1e-6)).all());
        let clip = cube::view(face, center, 0.01, 100.0).clip_from_world * (center + direction * 5.0).extend(1.0);
        let screen = Vec2::new(clip.x / clip.w * 0.5 + 0.5, 0.5 - clip.y / clip.w * 0.5);
        assert!(clip.w > 0.0 && (screen - at).length() < 1e-5, "{direction}: {screen} {at}");
        assert!(clip.z >= 0.0 && clip.z <= clip.w);
    }
    assert!(seen.iter().all(|count| *count > 500), "{seen:?}");
    // The face table of the OpenGL specification: (s, t) of +x is (-z, -y), and that of -y is (x, -z).
    assert_eq!(cube::locate(Vec3::new(1.0, 0.0, -0.5)), (0, Vec2::new(0.75, 0.5)));
    assert_eq!(cube::locate(Vec3::new(0.5, -1.0, 0.5)), (3, Vec2::new(0.75, 0.25)));
    assert_eq!(cube::locate(Vec3::ZERO).0, 0);
}

#[test]
fn cube_faces_are_filtered_between_texel_centres() {
    let texels: Vec<[f32; 4]> = (0..16).map(|i| [(i % 4) as f32, (i / 4) as f32, 0.0, 9.0]).collect();
    assert_eq!(cube::sample(&texels, 4, Vec2::new(0.5, 0.125)), Vec3::new(1.5, 0.0, 0.0));
    assert_eq!(cube::sample(&texels, 4, Vec2::new(0.0, 1.0)), Vec3::new(0.0, 3.0, 0.0), "the border is extended");
    assert_eq!(cube::sample(&texels[..1], 1, Vec2::splat(0.3)), Vec3::ZERO);
}

/// Squares of side 1 at these places, each with vertices of its own.
fn squares(places: &[Vec3]) -> Geometry {
    let mut geometry = Geometry::default();
    for place in places {
        let at = |x: f32, y: f32| *place + Vec3::new(x, y, 0.0);
        let first = geometry.positions.len() as u32;
        geometry.positions.extend([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]);
        geometry.triangles.extend([[first, first + 1, first + 2], [first + 3, first + 4, first + 5]]);
    }
    geometry.batches.push(Batch { material: 0, first: 0, count: geometry.triangles.len() as u32 });
    geometry
}

#[test]
fn panes_are_connected_glass() {
    let geometry = squares(&[Vec3::ZERO, Vec3::new(5.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(5.0, 1.5, 0.0)]);
    let panes = panes::find(&geometry, &[true]);
    assert_eq!(panes.len(), 3);
    assert_eq!((panes[0].triangles, panes[1].triangles, panes[2].triangles), (4, 2, 2));
    assert_eq!(panes[0].bounds, bounds(Vec3::ZERO, Vec3::new(2.0, 1.0, 0.0)));
    assert!(panes::find(&geometry, &[false]).is_empty() && panes::find(&geometry, &[]).is_empty());
    assert!(panes::find(&Geometry::default(), &[true]).is_empty());
}

#[test]
fn spheres_of_glass_are_no_panes() {
    let sphere = Sphere { center: Vec3::ZERO, radius: 1.0, material: 0 };
    let geometry = Geometry { spheres: vec![sphere; 2], ..squares(&[Vec3::ZERO]) };
    let panes = panes::find(&geometry, &[true]);
    assert_eq!((panes.len(), panes[0].triangles), (1, 2));
    let alone = Geometry { spheres: vec![sphere], ..Geometry::default() };
    assert!(panes::find(&alone, &[true]).is_empty());
}

#[test]
fn the_panes_that_cover_most_of_the_picture_get_the_probes() {
    let view = camera(Vec3::ZERO, Vec3::NEG_Z, 100.0);
    // Three squares from far to near, and one behind the camera.
    let places = [-20.0, -10.0, -5.0, 3.0].map(|z| Vec3::new(-0.5, -0.5, z));
    let geometry = squares(&places);
    let panes = panes::find(&geometry, &[true]);
    let scene = Bounds::of_scene(&geometry);
    let mut probes = Probes::default();
    let depths = |probes: &[panes::Probe]| probes.iter().map(|probe| probe.center.z).collect::<Vec<_>>();
    assert_eq!(depths(probes.choose(&panes, &scene, &view, 2)), [-5.0, -10.0]);
    assert_eq!(depths(probes.choose(&panes, &scene, &view, 64)), [-5.0, -10.0, -20.0]);
    let chosen = probes.choose(&panes, &scene, &view, 64);
    assert_eq!(panes::nearest(chosen, Vec3::new(0.0, 0.0, -16.0)), Some(2));
    assert_eq!(panes::nearest(&[], Vec3::ZERO), None);
    // Closed form of the projected area of a square of side 1 at distance 5, in units of half the picture's sides.
    let frustum = Frustum::new(&view.clip_from_world).expect("a camera");
    let side = 1.0 / (5.0 * 0.5f64.tan());
    assert!((frustum.area_of(&panes[2].bounds, view.eye) - side * side).abs() < 1e-6);
    // Half of this square is outside the picture.
    let edge = 5.0 * 0.5f32.tan();
    let half = bounds(Vec3::new(edge - 0.5, -0.5, -5.0), Vec3::new(edge + 0.5, 0.5, -5.0));
    assert!((frustum.area_of(&half, view.eye) - 0.5 * side * side).abs() < 1e-5);
    assert_eq!(frustum.area_of(&panes[3].bounds, view.eye), 0.0);
    assert_eq!(frustum.area_of(&bounds(Vec3::NEG_ONE, Vec3::ONE), view.eye), 4.0);
}
