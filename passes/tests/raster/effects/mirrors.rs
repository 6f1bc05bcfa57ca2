//! Planar mirrors against rays in `f64` that share no code with them.

use super::world::{BACKGROUND, Shot, World, mean};
use curitiba_passes::raster::effects::bounds::Bounds;
use curitiba_passes::raster::effects::mirrors::{Mirrors, Survey};
use curitiba_passes::raster::effects::planes::Glazing;
use curitiba_pipeline::backend::{Attachments, GBuffer, LoadStore, NO_TRIANGLE, RasterJob, Rasteriser, Rect, View};
use curitiba_pipeline::programs::{RasterProgram, RayParams};
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram::CubeReflection, EffectProgram::PlanarReflection};
use glam::camera::rh;
use glam::{DVec3, Mat4, Vec3, Vec4};

pub const SIDE: u32 = 160;

/// Near distance of the cameras.
const NEAR: f32 = 0.05;

/// A camera in `f64`.
#[derive(Clone, Copy)]
pub struct Camera {
    pub eye: Vec3,
    pub forward: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    /// Half the side of the picture at distance 1; without perspective, half the side in scene units.
    pub half: f64,
    pub perspective: bool,
}

impl Camera {
    pub fn new(eye: Vec3, target: Vec3, half: f64) -> Self {
        let forward = (target.as_dvec3() - eye.as_dvec3()).normalize();
        let up = if forward.y.abs() > 0.99 { DVec3::NEG_Z } else { DVec3::Y };
        let right = forward.cross(up).normalize();
        Self { eye, forward, right, up: right.cross(forward), half, perspective: true }
    }

    pub fn view(&self) -> View {
        let (near, far) = (NEAR, 500.0);
        let direction = self.forward.as_vec3();
        let up = self.up.as_vec3();
        if !self.perspective {
            let half = self.half as f32;
            let projection = rh::proj::directx::orthographic(-half, half, -half, half, far, near);
            let to_view = rh::view::look_to_mat4(self.eye, direction, up);
            return View::new(projection * to_view, self.eye - direction * (far * 65_536.0));
        }
        let projection = rh::proj::directx::perspective(2.0 * self.half.atan() as f32, 1.0, far, near);
        let view = |eye: Vec3| -> Mat4 { projection * rh::view::look_to_mat4(eye, direction, up) };
        let far_eye = self.eye.length() > 100.0;
        View { clip_from_eye: far_eye.then(|| view(Vec3::ZERO)), ..View::new(view(self.eye), self.eye) }
    }

    /// Origin and direction of the ray through a place of the picture, in pixels.
    pub fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let place = |at: f64| (2.0 * at / f64::from(SIDE) - 1.0) * self.half;
        let aside = self.right * place(x) - self.up * place(y);
        let eye = self.eye.as_dvec3();
        if self.perspective { (eye, (self.forward + aside).normalize()) } else { (eye + aside, self.forward) }
    }
}

/// The nearest triangle in front of a ray's origin, among glass or among all others, and its distance (Möller and
/// Trumbore, 1997).
pub fn nearest(shot: &Shot, origin: DVec3, direction: DVec3, glass: bool) -> Option<(u32, f64)> {
    let geometry = &shot.scene.geometry;
    let mut best: Option<(u32, f64)> = None;
    for triangle in 0..geometry.triangles.len() as u32 {
        let [a, b, c] = geometry.corners(triangle).map(Vec3::as_dvec3);
        let (u, v) = (b - a, c - a);
        let across = direction.cross(v);
        let scale = 1.0 / u.dot(across);
        let from = origin - a;
        let first = from.dot(across) * scale;
        if !(0.0..=1.0).contains(&first) {
            continue;
        }
        let aside = from.cross(u);
        let second = direction.dot(aside) * scale;
        let t = v.dot(aside) * scale;
        let hit = second >= 0.0 && first + second <= 1.0 && t > 1e-9 && best.is_none_or(|(_, least)| t < least);
        // Few triangles are hit, so the material is only looked up after a hit.
        if hit && shot.glass[geometry.material_of(triangle) as usize] == glass {
            best = Some((triangle, t));
        }
    }
    best
}

/// The colour of a flat-shaded surface.
fn shaded(shot: &Shot, triangle: u32) -> [f32; 3] {
    let geometry = &shot.scene.geometry;
    let diffuse = shot.shades[geometry.material_of(triangle) as usize].diffuse.truncate();
    let normal = geometry.normals[geometry.triangles[triangle as usize][0] as usize];
    let sun = shot.sun.expect("a light");
    (diffuse * 0.3 + diffuse * sun.color * normal.dot(-sun.direction).max(0.0)).to_array()
}

/// The mirrored colour at a place of the picture; `None` where the eye sees no glass there.
fn mirrored(shot: &Shot, camera: &Camera, x: f64, y: f64) -> Option<[f32; 3]> {
    let (origin, direction) = camera.ray(x, y);
    let (pane, distance) = nearest(shot, origin, direction, true)?;
    if distance * direction.dot(camera.forward) < f64::from(NEAR) {
        return None;
    }
    if nearest(shot, origin, direction, false).is_some_and(|(_, other)| other < distance) {
        return None;
    }
    let [a, b, c] = shot.scene.geometry.corners(pane).map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a).normalize();
    let onward = direction - 2.0 * normal * normal.dot(direction);
    let start = origin + direction * distance + onward * 1e-6;
    Some(nearest(shot, start, onward, false).map_or([0.0; 3], |(triangle, _)| shaded(shot, triangle)))
}

fn is_near(found: [f32; 4], expected: [f32; 3]) -> bool {
    (0..3).all(|i| (found[i] - expected[i]).abs() < 1e-5) && found[3] == 1.0
}

/// Compares every pixel that shows only glass within a distance of `reach` pixels: it must have the colour that one of
/// the rays there hits. Returns the number of compared pixels, and the number of those with the colour that the ray
/// through their centre hits.
fn compare(shot: &Shot, camera: &Camera, found: &[[f32; 4]], reach: f64, what: &str) -> (usize, usize) {
    let (compared, exact, wrong) = differing(shot, camera, found, reach, usize::MAX);
    println!("{what}: {compared} pixels of glass, {exact} as the ray through the centre");
    assert!(compared > 300, "{what}: {compared} pixels");
    // A face seen edge-on may be thinner than the grid to which corners are snapped, and cover a pixel that none of the compared rays hits.
    assert!(wrong.len() * 5000 <= compared, "{what}: {} of {compared} wrong, as {:?}", wrong.len(), wrong.first());
    (compared, exact)
}

/// A pixel, its colour, and the expected colour.
type Wrong = ([u32; 2], [f32; 4], [f32; 3]);

/// Number of compared pixels, number of exact pixels, and the wrong pixels. The search ends after `most` + 1 wrong ones.
fn differing(shot: &Shot, camera: &Camera, found: &[[f32; 4]], reach: f64, most: usize) -> (usize, usize, Vec<Wrong>) {
    let (mut compared, mut exact, mut wrong) = (0, 0, Vec::new());
    for (index, pixel) in found.iter().enumerate() {
        let (x, y) = ((index as u32 % SIDE) as f64 + 0.5, (index as u32 / SIDE) as f64 + 0.5);
        let Some(middle) = mirrored(shot, camera, x, y) else { continue };
        if is_near(*pixel, middle) {
            (compared, exact) = (compared + 1, exact + 1);
            continue;
        }
        // The rays around a pixel may all miss a sharp corner between them.
        let around = (0..48u32).map(|i| {
            let (turn, away) = (f64::from(i) * std::f64::consts::TAU / 24.0, reach * if i < 24 { 1.0 } else { 0.5 });
            mirrored(shot, camera, x + turn.cos() * away, y + turn.sin() * away)
        });
        let Some(around) = around.collect::<Option<Vec<_>>>() else { continue };
        compared += 1;
        if !around.iter().any(|color| is_near(*pixel, *color)) {
            wrong.push(([index as u32 % SIDE, index as u32 / SIDE], *pixel, middle));
            if wrong.len() > most {
                break;
            }
        }
    }
    (compared, exact, wrong)
}

/// Boxes on both sides of a pane at `at` with this normal, and one box that the pane cuts.
fn boxes(at: Vec3, normal: Vec3, half: f32) -> World {
    let mut world = World::lit_along(Vec3::new(0.4, -1.0, -0.3));
    let normal = normal.normalize();
    let across = normal.any_orthonormal_vector();
    let up = normal.cross(across);
    let paints: Vec<u32> = (1..8)
        .map(|index| world.paint(Vec3::new((index & 1) as f32, (index >> 1 & 1) as f32, (index >> 2 & 1) as f32)))
        .collect();
    for i in 0..24u32 {
        let (turn, away) = (i as f32 * 2.4, 0.35 * (i as f32).sqrt());
        let side = if i % 3 == 0 { -1.0 } else { 1.0 };
        let off = normal * side * (0.15 + 0.21 * (i % 7) as f32) + (across * turn.cos() + up * turn.sin()) * away;
        world.block(paints[i as usize % 7], at + off, Vec3::new(0.1, 0.14, 0.08));
    }
    // This box is half in front of the mirror and half behind it.
    world.block(paints[3], at + across * 0.3, Vec3::new(0.12, 0.2, 0.16));
    let glass = world.pane();
    world.quad(glass, at, across * half, up * half);
    world
}

/// Computes the mirrored picture, and checks its statistics.
fn run(world: World, camera: &Camera, what: &str) -> (Shot, Vec<[f32; 4]>) {
    let mut shot = world.through(camera.view(), SIDE, SIDE);
    let (found, stats) = shot.effect(PlanarReflection, EffectParams::default());
    assert_eq!(stats.map_count, 1, "{what}");
    assert_eq!(stats.triangles, shot.scene.geometry.triangles.len() as u64 - 2, "{what}: all but the pane");
    assert_eq!(stats.glass_pixels[1], 0, "{what}");
    (shot, found)
}

/// Distance, in pixels, that allows for corners snapped to 1/256 pixel.
const SNAPPED: f64 = 1.0 / 128.0;

#[test]
fn every_pixel_of_a_mirror_shows_what_its_ray_meets() {
    let planes = [Vec3::Z, Vec3::Y, Vec3::new(0.3, 0.8, -0.5), Vec3::new(-1.0, 0.1, 0.2)];
    for normal in planes {
        let unit = normal.normalize();
        let (across, up) = (unit.any_orthonormal_vector(), unit.cross(unit.any_orthonormal_vector()));
        // Eyes in front of the mirror, behind it, and at two grazing angles.
        for (away, aside) in [(3.0, 0.4), (-3.0, -0.7), (1.2, 3.0), (-0.4, 3.5)] {
            let eye = unit * away + across * aside + up * 0.3;
            let camera = Camera::new(eye, Vec3::ZERO, 0.45);
            let what = format!("{normal} from {eye}");
            let (shot, found) = run(boxes(Vec3::ZERO, normal, 1.5), &camera, &what);
            let (compared, exact) = compare(&shot, &camera, &found, SNAPPED, &what);
            assert!(exact as f64 > 0.98 * compared as f64, "{what}: {exact} of {compared}");
            // Pixels that are not glass keep their colour.
            for (index, pixel) in found.iter().enumerate() {
                let id = shot.buffer.triangle[index];
                if id == NO_TRIANGLE || !shot.glass[shot.scene.geometry.material_of(id) as usize] {
                    assert_eq!(*pixel, shot.buffer.color[index], "{what}");
                }
            }
        }
    }
}

/// The scene without its pane, drawn by any camera, with or without culling of back faces.
fn drawn(shot: &mut Shot, view: View, culled: bool) -> Vec<[f32; 4]> {
    let attachments = Attachments { color: true, ..Attachments::default() };
    let mut raster = std::mem::take(&mut shot.raster);
    let mut target = GBuffer::new(SIDE, SIDE, attachments);
    // The pane's batch comes last.
    let mut scene = (*shot.scene).clone();
    scene.geometry.batches.pop();
    let job = RasterJob {
        scene: &scene,
        program: RasterProgram::Deferred,
        view,
        lights: &[],
        sun: shot.sun,
        shades: &shot.shades,
        culled: &vec![culled; shot.glass.len()],
        viewport: Rect { x: 0, y: 0, width: SIDE, height: SIDE },
        clear_color: Vec4::ZERO,
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    };
    raster.draw(&job, &mut target).expect("drawn");
    shot.raster = raster;
    target.color.iter().map(|[r, g, b, _]| [*r, *g, *b, 1.0]).collect()
}

#[test]
fn the_comparison_finds_out_a_missing_cut_an_eye_that_is_not_mirrored_and_culling() {
    let camera = Camera::new(Vec3::new(0.4, 0.3, 3.0), Vec3::ZERO, 0.45);
    let mut shot = boxes(Vec3::ZERO, Vec3::Z, 1.5).through(camera.view(), SIDE, SIDE);
    let glazing = Glazing::find(&shot.scene.geometry, &shot.glass).expect("host memory");
    let job = shot.job(PlanarReflection, EffectParams::default());
    let survey = Survey::new(&job, &glazing, &mut Vec::new()).expect("host memory");
    let bounds = Bounds::of_scene(&shot.scene.geometry);
    let mirrors = Mirrors::choose(&glazing, &survey, &bounds, &shot.view, 1);
    let mirrored = mirrors.chosen[0].view;
    let unturned = View { clip_plane: mirrored.clip_plane, ..shot.view };
    let mut wrong = |view: View, culled: bool| {
        let picture = drawn(&mut shot, view, culled);
        let (compared, _, wrong) = differing(&shot, &camera, &picture, SNAPPED, 300);
        assert!(compared > 300);
        wrong.len()
    };
    let right = wrong(mirrored, false);
    let (uncut, unturned, culled) =
        (wrong(View { clip_plane: None, ..mirrored }, false), wrong(unturned, false), wrong(mirrored, true));
    println!(
        "wrong pixels: {right}; without the cut {uncut}, not mirrored {unturned}, without faces wound backwards {culled}"
    );
    assert!(right < 4 && uncut > 300 && unturned > 300 && culled > 300);
}

#[test]
fn grazing_views_show_what_the_rays_meet() {
    // The eye is just above a wide mirror, as low as 1/300 of its distance from the mirror's middle.
    for height in [0.5, 0.1, 0.02] {
        let eye = Vec3::new(0.2, height, 6.0);
        let camera = Camera::new(eye, Vec3::new(0.0, height * 0.2, -2.0), 0.3);
        let what = format!("{height} above");
        let (shot, found) = run(boxes(Vec3::ZERO, Vec3::Y, 10.0), &camera, &what);
        compare(&shot, &camera, &found, SNAPPED, &what);
    }
}

#[test]
fn far_from_the_origin_mirrors_show_what_the_rays_meet() {
    // Positions are rounded by a millimetre there, but the same positions are drawn and mirrored.
    for away in [1e3, 1e4] {
        let at = Vec3::new(away, 0.5 * away, -away);
        let camera = Camera::new(at + Vec3::new(0.5, 0.5, 3.0), at, 0.45);
        let what = format!("{away} away");
        let (shot, found) = run(boxes(at, Vec3::Z, 1.5), &camera, &what);
        compare(&shot, &camera, &found, SNAPPED, &what);
    }
}

#[test]
fn positions_too_coarse_to_tell_a_plane_tell_no_mirror() {
    let at = Vec3::new(1e6, 5e5, -1e6);
    let camera = Camera::new(at + Vec3::new(0.5, 0.5, 3.0), at, 0.45);
    let mut shot = boxes(at, Vec3::new(0.3, 0.2, 1.0), 1.5).through(camera.view(), SIDE, SIDE);
    let (found, stats) = shot.effect(PlanarReflection, EffectParams::default());
    assert_eq!(found, shot.buffer.color);
    assert!(stats.glass_pixels[0] > 300 && stats.glass_pixels[0] == stats.glass_pixels[1], "{stats:?}");
}

#[test]
fn cameras_without_perspective_mirror_in_parallel() {
    for (eye, normal) in [
        (Vec3::new(1.0, 2.0, 4.0), Vec3::Z),
        (Vec3::new(-3.0, 1.0, 1.0), Vec3::new(0.2, 0.1, 1.0)),
        // The mirrored objects are behind the camera's near plane.
        (Vec3::new(0.05, 0.05, 0.2), Vec3::Z),
    ] {
        let camera = Camera { perspective: false, ..Camera::new(eye, Vec3::ZERO, 1.2) };
        let what = format!("parallel from {eye}");
        let (shot, found) = run(boxes(Vec3::ZERO, normal, 1.5), &camera, &what);
        let (origin, direction) = camera.ray(80.0, 80.0);
        assert!((origin - camera.eye.as_dvec3()).length() < 1e-6 && direction == camera.forward);
        compare(&shot, &Camera { eye: camera.eye, ..camera }, &found, SNAPPED, &what);
    }
}

#[test]
fn a_pane_seen_edge_on_needs_no_mirror_and_gives_none_a_wrong_one() {
    for off in [0.0, 1e-7, 1e-4] {
        let camera = Camera::new(Vec3::new(0.0, 0.2, 0.0) + Vec3::Z * off, Vec3::new(0.0, 0.0, off), 0.45);
        let mut shot = boxes(Vec3::ZERO, Vec3::Z, 0.1).through(camera.view(), SIDE, SIDE);
        let (found, stats) = shot.effect(PlanarReflection, EffectParams::default());
        assert!(found.iter().flatten().all(|value| value.is_finite()));
        assert!(stats.glass_pixels[0] < 2 * u64::from(SIDE), "{off}: {stats:?}");
    }
}

/// Root mean square difference and greatest difference, over the pixels that show glass.
fn difference(shot: &Shot, a: &[[f32; 4]], b: &[[f32; 4]]) -> (f64, f32) {
    let geometry = &shot.scene.geometry;
    let glass = |index: &usize| {
        let id = shot.buffer.triangle[*index];
        id != NO_TRIANGLE && shot.glass[geometry.material_of(id) as usize]
    };
    let pixels: Vec<usize> = (0..a.len()).filter(glass).collect();
    let square = |index: &usize| (0..3).map(|i| (a[*index][i] - b[*index][i]).powi(2)).sum::<f32>() / 3.0;
    let worst = |index: &usize| (0..3).map(|i| (a[*index][i] - b[*index][i]).abs()).fold(0.0, f32::max);
    (mean(pixels.iter().map(square)).sqrt(), pixels.iter().map(worst).fold(0.0, f32::max))
}

#[test]
fn mirrors_are_far_nearer_to_the_ray_program_than_cube_maps_are() {
    let camera = Camera::new(Vec3::new(0.6, 0.5, 2.5), Vec3::ZERO, 0.45);
    let mut shot = boxes(Vec3::ZERO, Vec3::Z, 1.5).through(camera.view(), SIDE, SIDE);
    let expected = shot.rays(PlanarReflection, RayParams::default());
    let (mirror, _) = shot.effect(PlanarReflection, EffectParams::default());
    let (cube, _) = shot.effect(CubeReflection, EffectParams { map_size: 512, ..EffectParams::default() });
    // Rays light a surface that is turned away from the light from its other side. So both shade alike only surfaces
    // that face the light.
    let (error, _) = difference(&shot, &mirror, &expected);
    let (other, _) = difference(&shot, &cube, &expected);
    println!("mirror {error:.5}, cube map {other:.5}");
    assert!(error < 0.2 * other, "{error} {other}");
}

#[test]
fn coplanar_panes_share_a_mirror_and_others_have_their_own() {
    // A rotated facade of panes, whose corners are rounded, and one pane that stands forward by a millimetre.
    let (right, up) = (Vec3::new(0.8, 0.0, -0.6), Vec3::Y);
    let out = right.cross(up);
    let mut world = boxes(Vec3::new(0.0, 0.0, 4.0), out, 0.001);
    let glass = world.pane();
    for i in 0..40u32 {
        let at = right * (1.3 * (i % 10) as f32 - 6.0) + up * (1.7 * (i / 10) as f32 - 3.0) - out * 7.3;
        world.quad(glass, if i == 17 { at + out * 1e-3 } else { at }, right * 0.5, up * 0.7);
    }
    let camera = Camera::new(Vec3::new(1.0, 0.0, 9.0), Vec3::ZERO, 0.8);
    let mut shot = world.through(camera.view(), SIDE, SIDE);
    let (found, stats) = shot.effect(PlanarReflection, EffectParams::default());
    let [glass, without] = stats.glass_pixels;
    assert!(stats.map_count == 2 && without == 0 && glass > 2000, "{stats:?}");
    assert_ne!(found, shot.buffer.color);
    // With one mirror, the pane that stands forward keeps its colour, and the statistics count its pixels.
    let (fewer, stats) = shot.effect(PlanarReflection, EffectParams { planes: 1, ..EffectParams::default() });
    let [all, without] = stats.glass_pixels;
    assert!(stats.map_count == 1 && all == glass && without > 20 && without < glass / 20, "{stats:?}");
    let (mut kept, mut same) = (0, 0);
    for index in 0..found.len() {
        if fewer[index] == found[index] {
            same += 1;
        } else {
            assert_eq!(fewer[index], shot.buffer.color[index]);
            kept += 1;
        }
    }
    assert!(kept <= without && same > 0, "{kept} of {without}");
}

#[test]
fn glass_that_is_bent_keeps_its_colour_and_is_counted() {
    let mut world = boxes(Vec3::ZERO, Vec3::Z, 1.5);
    // The pane's own normals lean by a degree.
    let first = world.scene.geometry.normals.len() - 4;
    for normal in &mut world.scene.geometry.normals[first..] {
        *normal = (*normal + Vec3::new(0.0, 0.02, 0.01)).normalize();
    }
    let camera = Camera::new(Vec3::new(0.4, 0.3, 3.0), Vec3::ZERO, 0.45);
    let mut shot = world.through(camera.view(), SIDE, SIDE);
    let (found, stats) = shot.effect(PlanarReflection, EffectParams::default());
    assert_eq!(found, shot.buffer.color);
    let [glass, without] = stats.glass_pixels;
    assert!(glass == without && glass > 300 && stats.maps.is_none() && stats.bytes == 0, "{stats:?}");
}

#[test]
fn no_mirror_is_drawn_where_no_glass_is_seen() {
    let camera = Camera::new(Vec3::new(0.4, 0.3, 3.0), Vec3::new(0.0, 0.0, 9.0), 0.45);
    let mut shot = boxes(Vec3::ZERO, Vec3::Z, 1.5).through(camera.view(), SIDE, SIDE);
    let (found, stats) = shot.effect(PlanarReflection, EffectParams::default());
    assert_eq!(found, shot.buffer.color);
    assert!(found.contains(&BACKGROUND));
    assert_eq!(
        (stats.maps, stats.map_count, stats.triangles, stats.bytes, stats.glass_pixels),
        (None, 0, 0, 0, [0; 2])
    );
}
