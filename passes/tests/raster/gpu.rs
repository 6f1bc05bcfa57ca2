//! Tests of the wgpu rasteriser that need no second rasteriser: memory, depth, positions, ties and errors.

use crate::common::{self, ALL};
use crate::scenes::{self, Setup, hills, marked, plain};
use crate::support::rasteriser;
use curitiba_passes::raster::gpu::{AdapterChoice, AdapterKind, WgpuRasteriser, adapters};
use curitiba_pipeline::backend::{
    Attachments, GBuffer, Glow, LoadStore, NO_TRIANGLE, RasterJob, Rasteriser, Rect, Shade, View,
};
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::pixel_samples::PixelSamples;
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Batch, Geometry, RenderScene};
use glam::{DMat4, DVec3, DVec4, Mat4, Vec2, Vec3, Vec4};
use std::sync::Arc;

fn all_attachment_sets() -> impl Iterator<Item = Attachments> {
    (0_u32..16).map(|bits| Attachments {
        color: bits & 1 != 0,
        position: bits & 2 != 0,
        normal: bits & 4 != 0,
        triangle: bits & 8 != 0,
    })
}

fn render(rasteriser: &mut WgpuRasteriser, job: &RasterJob<'_>, width: u32, height: u32) -> GBuffer {
    let mut target = marked(width, height, job.attachments);
    rasteriser.draw(job, &mut target).expect("draws");
    rasteriser.read_back(job, job.attachments, &mut target).expect("reads back");
    target
}

#[test]
fn attachments_not_asked_for_are_neither_created_nor_change_the_others() {
    if rasteriser().is_none() {
        return;
    }
    let setup = hills(20);
    let (width, height) = (75, 40);
    let mut full = None;
    // The full set comes first, because the others are compared with it.
    for attachments in all_attachment_sets().collect::<Vec<_>>().into_iter().rev() {
        let mut rasteriser = rasteriser().expect("there was one");
        rasteriser.upload(&setup.scene).expect("uploads");
        assert_eq!(rasteriser.memory().attachments, 0);
        let job = setup.job(width, height, attachments);
        let target = render(&mut rasteriser, &job, width, height);
        let Attachments { color, position, normal, triangle } = attachments;
        let pixel = 16 * (u64::from(color) + u64::from(position) + u64::from(normal)) + 4 * u64::from(triangle);
        let depth = if attachments == Attachments::default() { 0 } else { 4 };
        // Shading a pixel reads the id of the visible triangle, which takes 4 bytes.
        let seen = if color || position || normal { 4 } else { 0 };
        let expected = (pixel + depth + seen) * u64::from(width * height);
        assert_eq!(rasteriser.memory().attachments, expected, "{attachments:?}");
        let full = full.get_or_insert_with(|| target.clone());
        let expected = GBuffer {
            color: if color { full.color.clone() } else { Vec::new() },
            position: if position { full.position.clone() } else { Vec::new() },
            normal: if normal { full.normal.clone() } else { Vec::new() },
            triangle: if triangle { full.triangle.clone() } else { Vec::new() },
            depth: Vec::new(),
            ..*full
        };
        assert!(target == expected, "{attachments:?} differs from the full set");
    }
}

#[test]
fn of_a_sky_its_colour_alone_is_written() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let shades = [common::grey(); 2];
    let mut drawn = |is_sky: bool, asked: Attachments| {
        let scene = Arc::new(common::before(is_sky));
        rasteriser.upload(&scene).expect("uploads");
        render(&mut rasteriser, &common::job(&scene, &shades, common::camera(1.25), 150, 120, asked), 150, 120)
    };
    let (with, without) = (drawn(true, ALL), drawn(false, ALL));
    common::hides_sky(&with, &without);
    // If only ids are asked for, the draws of different materials are merged, except the draw of a sky.
    let ids = Attachments { triangle: true, ..Attachments::default() };
    assert!(drawn(true, ids).triangle == with.triangle);
}

/// Shading from the ids of the visible triangles gives the same attachments as fragments that write them.
#[test]
fn shading_each_pixel_once_gives_what_drawing_gives() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let (width, height) = (241, 160);
    let scenes = [hills(30), scenes::grazing(), scenes::cut_out(), scenes::tinted(), scenes::bumpy(1.0)];
    for setup in scenes.into_iter().chain([scenes::shining(), scenes::soup(0, 600), scenes::soup(4, 600)]) {
        rasteriser.upload(&setup.scene).expect("uploads");
        let plain = setup.job(width, height, ALL);
        let ahead = setup.target - setup.eye;
        let mirrored = View {
            clip_plane: Some(ahead.normalize().extend(-0.3 * ahead.length())),
            ..plain.view.mapped(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)))
        };
        for view in [plain.view, mirrored] {
            let job = RasterJob { view, ..plain };
            let [shaded, drawn] = [true, false].map(|shades| {
                rasteriser.set_shades_pixels(shades);
                render(&mut rasteriser, &job, width, height)
            });
            assert!(shaded.triangle == drawn.triangle, "{}", setup.name);
            let covered = shaded.triangle.iter().filter(|id| **id != NO_TRIANGLE).count();
            let differ = |limit: f32, [a, b]: [&[[f32; 4]]; 2]| {
                let is_near = |a: Vec4, b: Vec4| (a - b).abs().max_element() <= limit;
                a.iter().zip(b).filter(|(a, b)| !is_near(Vec4::from(**a), Vec4::from(**b))).count()
            };
            let differ = [
                differ(1e-3 * ahead.length(), [&shaded.position, &drawn.position]),
                differ(5e-3, [&shaded.normal, &drawn.normal]),
                differ(0.02, [&shaded.color, &drawn.color]),
            ];
            let name = format!("{}, mirrored {}", setup.name, view.clip_plane.is_some());
            println!("{name}: of {covered} pixels {differ:?} differ");
            // Near the horizon of a plane and at outlines of narrow triangles, interpolation between snapped corners differs.
            assert!(covered > 100 && differ.iter().all(|count| 100 * count <= covered), "{name}: {differ:?}");
        }
    }
}

/// The G-buffer's position of a pixel is the point where the line of sight through the pixel's centre hits the triangle.
#[test]
fn positions_lie_on_the_triangle_and_on_the_ray_of_the_pixel() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let (width, height) = (250u32, 200u32);
    let shades = [common::grey()];
    for kind in [0, 3, 4, 5] {
        let scene = Arc::new(common::soup(kind, 80, 1));
        rasteriser.upload(&scene).expect("uploads");
        let job = common::job(&scene, &shades, common::camera(1.25), width, height, ALL);
        let clip_from_world = job.view.clip_from_world.as_dmat4();
        let mut beside = [0.0; 2];
        for (beside, shades_pixels) in beside.iter_mut().zip([true, false]) {
            rasteriser.set_shades_pixels(shades_pixels);
            let drawn = render(&mut rasteriser, &job, width, height);
            let (mut covered, mut far) = (0_u32, 0);
            for (index, id) in drawn.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
                let [a, b, c] = scene.geometry.corners(*id).map(|corner| corner.as_dvec3());
                let [x, y, z, _] = drawn.position[index].map(f64::from);
                let position = DVec3::new(x, y, z);
                let size = [a, b, c].iter().fold(1.0, |most: f64, corner| most.max(corner.abs().max_element()));
                let distance = (position - a).dot((b - a).cross(c - a).normalize()).abs();
                let unit = size * f64::from(f32::EPSILON);
                assert!(distance <= 8.0 * unit, "kind {kind}: {distance:e} off a plane of {size}");
                let clip = clip_from_world * position.extend(1.0);
                let [across, down] = [clip.x, -clip.y].map(|place| 0.5 * place / clip.w + 0.5);
                let centre = [index as u32 % width, index as u32 / width].map(|place| f64::from(place) + 0.5);
                let off = [across * f64::from(width) - centre[0], down * f64::from(height) - centre[1]];
                let most = off[0].abs().max(off[1].abs());
                // Devices snap the corners of what they draw, to 1/16 pixel at the coarsest.
                let rounding = 1e-4 + 4.0 * unit * f64::from(width) / clip.w;
                assert!(most <= 1.0 / 16.0 + rounding, "kind {kind}: {most} pixels off");
                covered += 1;
                far += u32::from(most > rounding);
                *beside += 0.5 * (off[0] * off[0] + off[1] * off[1]);
            }
            // A few pixels are covered only by the snapped triangle. They show the nearest point of the exact one.
            assert!(covered > 5000 && (!shades_pixels || 100 * far < covered), "kind {kind}: {far} of {covered}");
            *beside = (*beside / f64::from(covered)).sqrt();
        }
        println!("kind {kind}: {:.1e} pixels beside the centre, of fragments {:.1e}", beside[0], beside[1]);
    }
}

#[test]
fn pixels_of_needles_show_the_nearest_place_of_the_triangle() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let (width, height) = (250u32, 200u32);
    let shades = [common::grey()];
    // Needles, and triangles smaller than a pixel.
    for (kind, count) in [(1, 20_000), (2, 40_000)] {
        let scene = Arc::new(common::soup(kind, count, 1));
        rasteriser.upload(&scene).expect("uploads");
        let job = common::job(&scene, &shades, common::camera(1.25), width, height, ALL);
        let [by_pixel, by_fragment] = [true, false].map(|shades_pixels| {
            rasteriser.set_shades_pixels(shades_pixels);
            let pixels = common::beside_nearest(&job, &render(&mut rasteriser, &job, width, height));
            let beyond = |most: f64| pixels.iter().filter(|pixel| pixel.off > pixel.rounding + most).count();
            (pixels.len(), beyond(0.0), beyond(1.0 / 128.0))
        });
        println!(
            "kind {kind}: of {} pixels {} and {} off their place; of fragments {by_fragment:?}",
            by_pixel.0, by_pixel.1, by_pixel.2
        );
        assert!(by_pixel.0 > 5000 && 1000 * by_pixel.1 < by_pixel.0 && by_pixel.2 == 0, "kind {kind}: {by_pixel:?}");
        // Control: positions that the device interpolates on needles are off.
        assert!(kind != 1 || 10 * by_fragment.1 > by_fragment.0, "kind {kind}: {by_fragment:?}");
    }
}

/// Nothing is loaded, and the depth is stored.
const STORED: LoadStore = LoadStore { load_color: false, load_depth: false, store_depth: true };
/// Side of the pictures that the depth of planes is tested in.
const SIDE: u32 = 128;

/// The last `SIDE` columns and rows of a job's picture.
fn last_pixels(rasteriser: &mut WgpuRasteriser, job: &RasterJob<'_>) -> GBuffer {
    let origin = [job.viewport.width, job.viewport.height].map(|side| side - SIDE);
    let mut target = GBuffer { origin, ..marked(SIDE, SIDE, job.attachments) };
    if job.load_store.store_depth {
        target.depth = vec![f32::NAN; target.triangle.len()];
    }
    rasteriser.draw(job, &mut target).expect("draws");
    rasteriser.read_back(job, job.attachments, &mut target).expect("reads back");
    target
}

/// A job for a picture that is `times` as wide and high, whose lower right corner has the pixels of the given job of `SIDE` x `SIDE` pixels.
fn in_the_corner_of(times: u32, job: RasterJob<'_>) -> RasterJob<'_> {
    let (scale, side) = (1.0 / f64::from(times), SIDE * times);
    let map = DMat4::from_translation(DVec3::new(1.0 - scale, scale - 1.0, 0.0))
        * DMat4::from_scale(DVec3::new(scale, scale, 1.0));
    RasterJob { view: job.view.mapped(map), viewport: Rect { x: 0, y: 0, width: side, height: side }, ..job }
}

/// Counts pixels that show the nearer and the farther of two layers. The farther layer has the triangle ids below `behind`.
fn count(seen: &mut [usize; 2], drawn: &GBuffer, behind: u32) {
    for id in drawn.triangle.iter().filter(|id| **id != NO_TRIANGLE) {
        seen[usize::from(*id < behind)] += 1;
    }
}

const IDS: Attachments = Attachments { color: false, position: false, normal: false, triangle: true };

/// Number of pixels that show the nearer and the farther of two layers of small triangles, 60 m from the eye.
fn seen_of_layers(rasteriser: &mut WgpuRasteriser, gap: f32, times: u32, snapped_depth: bool) -> [usize; 2] {
    let mut seen = [0; 2];
    for (tilt, seed) in [0.3, 0.8, 1.1, 1.3].into_iter().flat_map(|tilt| (0..4).map(move |seed| (tilt, seed))) {
        let (scene, behind) = common::layers(seed, tilt, gap);
        let (scene, shades) = (Arc::new(scene), [common::grey()]);
        rasteriser.upload(&scene).expect("uploads");
        for near in [0.01, 0.1, 1.0, 10.0] {
            let view = View::new(common::perspective(1.0, 1.0, near, 100.0), Vec3::ZERO);
            let job = RasterJob { snapped_depth, ..common::job(&scene, &shades, view, SIDE, SIDE, IDS) };
            count(&mut seen, &last_pixels(rasteriser, &in_the_corner_of(times, job)), behind);
        }
    }
    seen
}

/// The depth of a triangle is that of its own plane. The depth that devices interpolate is less exact: they snap corners, and in the far
/// corner of a picture they have fewer digits.
#[test]
fn of_two_layers_close_together_the_nearer_one_is_seen() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let mut interpolated = [0; 4];
    for ((gap, times), interpolated) in
        [(8e-4, 1), (1e-4, 1), (8e-4, 16), (1e-4, 16)].into_iter().zip(&mut interpolated)
    {
        let [nearer, farther] = seen_of_layers(&mut rasteriser, gap, times, false);
        [_, *interpolated] = seen_of_layers(&mut rasteriser, gap, times, true);
        let side = times * SIDE;
        println!(
            "{gap} m apart, side {side}: {farther} of {} pixels, as interpolated {interpolated}",
            nearer + farther
        );
        assert!(nearer > 50_000, "{nearer}");
        assert_eq!(farther, 0, "{gap} m apart, side {side}, {}", rasteriser.adapter());
    }
    assert!(interpolated[3] > 1000, "control: {interpolated:?}");
    // At 60 m the last bit of a float is 4 micrometres, so layers closer to each other than this mix.
    let [_, mixed] = seen_of_layers(&mut rasteriser, 2e-6, 1, false);
    assert!(mixed > 1000, "control: {mixed} of layers 2 micrometres apart");
}

/// The exact depth of a triangle's plane at a pixel's centre, and its change if a corner moves by `unit` times its distance from the eye.
/// For a camera without perspective, the distance is from the middle of the view volume.
fn exact_depth(job: &RasterJob<'_>, id: u32, [x, y]: [f64; 2], unit: f64) -> [f64; 2] {
    let (matrix, offset) = job.view.projection();
    let inverse = matrix.as_dmat4().inverse();
    let [a, b, c] = job.scene.geometry.corners(id).map(|corner| corner.as_dvec3() - offset.as_dvec3());
    let normal = (b - a).cross(c - a).normalize();
    let plane = normal.extend(-normal.dot(a));
    let [width, height] = [job.viewport.width, job.viewport.height].map(f64::from);
    let start = inverse * DVec4::new(2.0 * x / width - 1.0, 1.0 - 2.0 * y / height, 0.0, 1.0);
    let depth = -plane.dot(start) / plane.dot(inverse.z_axis);
    let is_parallel = matrix.row(3).truncate() == Vec3::ZERO;
    let middle = if is_parallel { inverse.w_axis + inverse.z_axis * 0.5 } else { inverse.z_axis };
    let middle = middle.truncate() / middle.w;
    let farthest = [a, b, c].map(|corner| (corner - middle).length()).into_iter().fold(0.0, f64::max);
    let at = start + inverse.z_axis * depth;
    [depth, unit * farthest * (at.w / plane.dot(inverse.z_axis)).abs()]
}

/// Cameras of all kinds, and triangles that reach behind the eye.
#[test]
fn depth_is_that_of_planes_through_corners_that_are_off_by_a_few_units_in_the_last_place() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let shades = [common::grey()];
    let (tilted, _) = common::layers(3, 1.2, 0.5);
    let mut far = tilted.clone();
    let eye = Vec3::new(100_000.0, 2000.0, -30_000.0);
    far.geometry.positions.iter_mut().for_each(|position| *position += eye);
    let corner = |x: f32, z: f32| Vec3::new(1000.0 * x, -1.7 + 3.0 * x - 0.2 * z, 1000.0 * z);
    let [left, right] = [-1.0, 1.0].map(|x| [corner(x, 1.0), corner(x, -1.0)]);
    let floor = common::triangles(&[[left[0], right[0], left[1]], [left[1], right[0], right[1]]]);
    let lens = common::perspective(1.0, 1.0, 0.1, 100.0);
    let parallel = Mat4::from_cols(
        Vec4::new(0.08, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 0.08, 0.0, 0.0),
        Vec4::new(0.0, 0.0, 0.01, 0.0),
        Vec4::new(0.0, 0.0, 1.0, 1.0),
    );
    let centred = View::new(lens, Vec3::ZERO);
    let moved = View::new(lens * Mat4::from_translation(-eye), eye);
    let mirrored = centred.mapped(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    let whole = Rect { x: 0, y: 0, width: SIDE, height: SIDE };
    let [tilted, far, floor] = [tilted, far, floor].map(Arc::new);
    let cases = [
        ("perspective", &tilted, centred, 1),
        ("far from the origin", &far, View { clip_from_eye: Some(lens), ..moved }, 1),
        ("without perspective", &tilted, View::new(parallel, Vec3::ZERO), 1),
        ("one of several samples", &tilted, centred.of_sample(whole, PixelSamples::new(4).expect("valid"), 1), 1),
        ("mirrored", &tilted, View { clip_plane: Some(Vec4::new(0.0, 0.0, -1.0, -55.0)), ..mirrored }, 1),
        ("reaching behind the eye", &floor, centred, 1),
        ("in a corner", &tilted, centred, 16),
    ];
    for (name, scene, view, times) in cases {
        rasteriser.upload(scene).expect("uploads");
        let drawn = [false, true].map(|snapped_depth| {
            let job = RasterJob { snapped_depth, ..common::job(scene, &shades, view, SIDE, SIDE, ALL) };
            last_pixels(&mut rasteriser, &in_the_corner_of(times, RasterJob { load_store: STORED, ..job }))
        });
        let job = in_the_corner_of(times, common::job(scene, &shades, view, SIDE, SIDE, ALL));
        let off = |buffer: &GBuffer, pixel: usize| {
            let [x, y] = [pixel as u32 % SIDE, pixel as u32 / SIDE].map(|at| at + SIDE * (times - 1));
            let [exact, unit] = exact_depth(
                &job,
                buffer.triangle[pixel],
                [x, y].map(|at| f64::from(at) + 0.5),
                f64::from(f32::EPSILON),
            );
            (f64::from(buffer.depth[pixel]) - exact).abs() / (unit + exact * f64::from(f32::EPSILON))
        };
        let (mut covered, mut changed, mut worst) = (0, 0, [0.0; 2]);
        for pixel in (0..drawn[0].triangle.len()).filter(|pixel| drawn[0].triangle[*pixel] != NO_TRIANGLE) {
            covered += 1;
            if drawn[1].triangle[pixel] == drawn[0].triangle[pixel] {
                changed += usize::from(drawn[0].depth[pixel].to_bits() != drawn[1].depth[pixel].to_bits());
                worst[1] = off(&drawn[1], pixel).max(worst[1]);
            }
            worst[0] = off(&drawn[0], pixel).max(worst[0]);
        }
        println!(
            "{name}: off by {:.2} units, the device's depth by {:.2}; {changed} of {covered} differ",
            worst[0], worst[1]
        );
        // Counted in pixels, the corner is as far from the middle of the picture as the edge of a picture by a lens of 165 degrees.
        let most = if times == 1 { 3.0 } else { 12.0 };
        assert!(covered > 400 && worst[0] < most, "{name}: {covered}, {worst:?}");
        assert!(changed * 10 > covered, "{name}: the device's depth was kept, {changed} of {covered}");
    }
}

/// The triangles include needles, triangles that cross the near plane, and triangles with corners behind the eye.
#[test]
fn every_depth_is_a_number_near_the_corners_of_its_triangle() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let (shades, mut looked_at) = ([common::grey()], 0);
    for kind in 0..6 {
        let scene = Arc::new(common::soup(kind, 400, 7));
        rasteriser.upload(&scene).expect("uploads");
        let job = common::job(&scene, &shades, common::camera(1.0), SIDE, SIDE, ALL);
        let drawn = last_pixels(&mut rasteriser, &RasterJob { load_store: STORED, ..job });
        for (id, depth) in drawn.triangle.iter().zip(&drawn.depth) {
            assert!((0.0..=1.0).contains(depth), "{kind}: {depth}");
            if *id == NO_TRIANGLE {
                continue;
            }
            let corners = scene.geometry.corners(*id).map(|corner| job.view.clip_from_world * corner.extend(1.0));
            if corners.iter().all(|corner| corner.w > 0.1) {
                let depths = corners.map(|corner| corner.z / corner.w);
                let [low, high] =
                    [depths.iter().copied().fold(1.0, f32::min), depths.iter().copied().fold(0.0, f32::max)];
                let beyond = (low - depth).max(depth - high);
                assert!(beyond <= (high - low) + 1e-6 * high, "{kind}: triangle {id}: {depth} of {low} to {high}");
                looked_at += 1;
            }
        }
    }
    assert!(looked_at > 10_000, "{looked_at}");
}

#[test]
fn attachments_in_16_bit_floats_take_half_the_memory_and_are_the_32_bit_ones_rounded() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let (width, height) = (75, 40);
    let full = render(&mut rasteriser, &setup.job(width, height, ALL), width, height);
    let before = rasteriser.memory().attachments;
    for half in all_attachment_sets() {
        let job = RasterJob { half, ..setup.job(width, height, ALL) };
        let found = render(&mut rasteriser, &job, width, height);
        assert!(found.triangle == full.triangle, "ids are whole numbers, whatever {half:?} says");
        let channels = [
            (half.color, &found.color, &full.color),
            (half.position, &found.position, &full.position),
            (half.normal, &found.normal, &full.normal),
        ];
        for (half, found, full) in channels {
            if !half {
                assert!(found == full);
                continue;
            }
            assert!(found != full, "control: something was rounded");
            let mut kept = found.clone();
            PixelFormat::Rgba16Float.round(&mut kept);
            assert!(kept == *found, "what is read back are 16-bit floats");
            // Devices may round to nearest or towards zero, so the error is at most one unit of 11 significant bits.
            for (found, full) in found.as_flattened().iter().zip(full.as_flattened()) {
                let unit = (full.abs() / 1024.0).max(2f32.powi(-24));
                assert!((found - full).abs() <= unit, "{found} {full}");
            }
        }
    }
    let mut alone = crate::support::rasteriser().expect("there was one");
    alone.upload(&setup.scene).expect("uploads");
    render(&mut alone, &RasterJob { half: ALL, ..setup.job(width, height, ALL) }, width, height);
    let pixels = u64::from(width * height);
    assert_eq!((before, alone.memory().attachments), (60 * pixels, (3 * 8 + 4 + 4 + 4) * pixels));
}

#[test]
fn attachments_stay_between_frames_and_follow_the_size() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let first = render(&mut rasteriser, &setup.job(64, 64, ALL), 64, 64);
    let memory = rasteriser.memory();
    assert_eq!(render(&mut rasteriser, &setup.job(64, 64, ALL), 64, 64), first);
    assert_eq!(rasteriser.memory(), memory);
    for size in 1..40 {
        render(&mut rasteriser, &setup.job(size, size, ALL), size, size);
    }
    let kept: u64 = (36..40).map(|size| 60 * size * size).sum();
    assert_eq!(rasteriser.memory().attachments, kept, "a bounded number of sets is kept");
    assert_eq!(render(&mut rasteriser, &setup.job(64, 64, ALL), 64, 64), first);
}

#[test]
fn only_what_the_scene_has_is_uploaded() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let (vertices, triangles) = (21 * 21, 2 * 20 * 20);
    assert_eq!(rasteriser.memory().geometry, 24 * vertices + 12 * triangles);
    let mut bare = (*setup.scene).clone();
    bare.geometry.normals.clear();
    let bare = Arc::new(bare);
    rasteriser.upload(&bare).expect("uploads");
    assert_eq!(rasteriser.memory().geometry, 12 * vertices + 12 * triangles);
    let attachments = Attachments { position: true, triangle: true, ..Attachments::default() };
    let job = RasterJob { scene: &bare, ..setup.job(64, 64, attachments) };
    let target = render(&mut rasteriser, &job, 64, 64);
    assert!(target.triangle.iter().any(|id| *id != NO_TRIANGLE));
    assert!(target.position.iter().all(|position| position[3] == 0.0), "no normals, no cosine");
    let job = RasterJob { attachments: ALL, ..job };
    let message = rasteriser.draw(&job, &mut marked(64, 64, ALL)).expect_err("no normals").to_string();
    assert!(message.contains("without normals"), "{message}");
}

#[test]
fn textures_are_uploaded_when_a_material_or_a_shade_reads_them() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = scenes::grazing();
    rasteriser.upload(&setup.scene).expect("uploads");
    // In generated scenes the shades name textures, and the materials do not.
    assert_eq!(rasteriser.memory().textures, 0);
    let position = Attachments { position: true, ..Attachments::default() };
    render(&mut rasteriser, &setup.job(32, 32, position), 32, 32);
    assert_eq!(rasteriser.memory().textures, 0, "positions need no texture");
    render(&mut rasteriser, &setup.job(32, 32, ALL), 32, 32);
    let texels =
        |texture: &Texture| -> u64 { texture.levels.iter().map(|level| u64::from(level.width * level.height)).sum() };
    assert_eq!(rasteriser.memory().textures, setup.scene.textures.iter().map(|t| 4 * texels(t)).sum::<u64>());
}

#[test]
fn only_the_viewport_is_cleared_and_drawn() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let (width, height) = (150, 90);
    let viewport = Rect { x: 37, y: 11, width: 70, height: 60 };
    let alone = render(&mut rasteriser, &setup.job(70, 60, ALL), 70, 60);
    let job = RasterJob { viewport, ..setup.job(70, 60, ALL) };
    let target = render(&mut rasteriser, &job, width, height);
    let untouched = marked(1, 1, ALL);
    for y in 0..height {
        for x in 0..width {
            let pixel = (y * width + x) as usize;
            let (column, row) = (x.wrapping_sub(viewport.x), y.wrapping_sub(viewport.y));
            let inside = column < viewport.width && row < viewport.height;
            let (from, index) =
                if inside { (&alone, (row * viewport.width + column) as usize) } else { (&untouched, 0) };
            assert_eq!(target.color[pixel], from.color[index], "{x}, {y}");
            assert_eq!(target.position[pixel], from.position[index], "{x}, {y}");
            assert_eq!(target.normal[pixel], from.normal[index], "{x}, {y}");
            assert_eq!(target.triangle[pixel], from.triangle[index], "{x}, {y}");
        }
    }
}

/// The same triangle twice over the whole viewport, with two materials.
fn coincident() -> Setup {
    let corners = [Vec3::new(-20.0, -20.0, -2.0), Vec3::new(20.0, -20.0, -2.0), Vec3::new(0.0, 40.0, -2.0)];
    let geometry = Geometry {
        positions: corners.to_vec(),
        normals: vec![Vec3::Z; 3],
        texcoords: vec![Vec2::ZERO; 3],
        triangles: vec![[0, 1, 2]; 2],
        batches: (0..2).map(|i| Batch { material: i, first: i, count: 1 }).collect(),
        ..Geometry::default()
    };
    let white = Texture::new("white".to_owned(), 1, 1, vec![[255; 4]]);
    Setup {
        name: "coincident",
        scene: Arc::new(RenderScene { geometry, textures: vec![white], ..RenderScene::default() }),
        shades: vec![plain([1.0, 0.0, 0.0]), plain([0.0, 1.0, 0.0])],
        eye: Vec3::ZERO,
        target: -Vec3::Z,
        near: 0.1,
        far: 10.0,
        sun: None,
    }
}

#[test]
fn of_equal_depths_the_lower_triangle_stays() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = coincident();
    rasteriser.upload(&setup.scene).expect("uploads");
    let target = render(&mut rasteriser, &setup.job(33, 20, ALL), 33, 20);
    assert!(target.triangle.iter().all(|id| *id == 0));
    // Without a sun, every component is 0.3 of the diffuse colour.
    assert!(target.color.iter().all(|color| *color == [0.3, 0.0, 0.0, 0.3]), "{:?}", target.color[0]);
    // When the first triangle is cut out, the second is visible.
    let mut shades = setup.shades.clone();
    (shades[0].texture, shades[0].alpha_cutoff) = (Some(0), Some(f32::INFINITY));
    let job = RasterJob { shades: &shades, ..setup.job(33, 20, ALL) };
    let target = render(&mut rasteriser, &job, 33, 20);
    assert!(target.triangle.iter().all(|id| *id == 1));
}

/// Triangles in one plane perpendicular to an axis have the same depth to the last bit, for any corners and any camera.
#[test]
fn of_triangles_in_one_plane_across_an_axis_the_first_stays() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let shades = [common::grey()];
    let turned = glam::camera::rh::view::look_at_mat4(Vec3::new(3.1, 4.3, 9.7), Vec3::new(0.3, -1.7, 0.4), Vec3::Y);
    let view = View::new(common::perspective(1.0, 1.0, 0.1, 100.0) * turned, Vec3::new(3.1, 4.3, 9.7));
    let (mut covered, mut wrong) = (0, [0; 2]);
    for axis in 0..3 {
        // The triangles of the soup, projected onto a plane perpendicular to the axis.
        let mut all: Vec<[Vec3; 3]> = (0..30).map(|id| common::soup(4, 30, 3).geometry.corners(id)).collect();
        all.iter_mut().flatten().for_each(|corner| corner[axis] = -1.7);
        let mut drawn = |triangles: &[[Vec3; 3]], snapped_depth: bool| {
            let scene = Arc::new(common::triangles(triangles));
            rasteriser.upload(&scene).expect("uploads");
            let job = RasterJob { snapped_depth, ..common::job(&scene, &shades, view, SIDE, SIDE, IDS) };
            last_pixels(&mut rasteriser, &job).triangle
        };
        let mut expected = vec![NO_TRIANGLE; (SIDE * SIDE) as usize];
        for (id, triangle) in all.iter().enumerate().rev() {
            for (expected, id_there) in expected.iter_mut().zip(drawn(&[*triangle], false)) {
                *expected = if id_there == NO_TRIANGLE { *expected } else { id as u32 };
            }
        }
        covered += expected.iter().filter(|id| **id != NO_TRIANGLE).count();
        for (wrong, snapped_depth) in wrong.iter_mut().zip([false, true]) {
            *wrong +=
                expected.iter().zip(drawn(&all, snapped_depth)).filter(|(expected, id)| **expected != *id).count();
        }
    }
    println!("{} of {covered} pixels show another triangle, with the device's depth {}", wrong[0], wrong[1]);
    assert!(covered > 10_000 && wrong[0] == 0 && wrong[1] > 100, "{covered}, {wrong:?}");
}

/// Different kinds of materials have different shaders, which all compute the same depth.
#[test]
fn of_equal_triangles_of_different_materials_the_first_stays() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let mut setup = coincident();
    let scene = Arc::make_mut(&mut setup.scene);
    scene.geometry.positions =
        vec![Vec3::new(-20.3, -21.7, -3.1), Vec3::new(23.9, -19.1, -7.7), Vec3::new(1.3, 41.1, -5.3)];
    let plain = setup.shades[0];
    let textured = Shade { texture: Some(0), ..plain };
    let kinds = [
        plain,
        textured,
        Shade { alpha_cutoff: Some(0.5), ..textured },
        Shade { glow: Some(Glow { color: Vec3::ONE, texture: None }), ..plain },
        Shade { glow: Some(Glow { color: Vec3::ONE, texture: Some(0) }), ..textured },
    ];
    rasteriser.upload(&setup.scene).expect("uploads");
    for (first, second) in kinds.iter().flat_map(|first| kinds.iter().map(move |second| (*first, *second))) {
        let shades = [first, second];
        let job = RasterJob { shades: &shades, ..setup.job(133, 120, ALL) };
        let target = render(&mut rasteriser, &job, 133, 120);
        assert!(target.triangle.iter().all(|id| *id == 0), "{first:?}, then {second:?}");
    }
}

#[test]
fn an_empty_scene_clears() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = Setup { scene: Arc::new(RenderScene::default()), shades: Vec::new(), ..hills(2) };
    rasteriser.upload(&setup.scene).expect("uploads");
    let job = setup.job(20, 10, ALL);
    let mut expected = GBuffer::new(20, 10, ALL);
    expected.color.fill(job.clear_color.to_array());
    assert_eq!(render(&mut rasteriser, &job, 20, 10), expected);
}

#[test]
fn jobs_that_do_not_fit_their_scene_or_target_are_errors() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(4);
    let job = setup.job(64, 64, ALL);
    let mut target = GBuffer::new(64, 64, ALL);
    let message = rasteriser.draw(&job, &mut target).expect_err("nothing uploaded").to_string();
    assert!(message.contains("not uploaded"), "{message}");
    rasteriser.upload(&setup.scene).expect("uploads");
    let message = rasteriser.read_back(&job, job.attachments, &mut target).expect_err("nothing drawn").to_string();
    assert!(message.contains("drawn last"), "{message}");
    let outside = Rect { x: 1, y: 0, width: 64, height: 64 };
    let message = rasteriser.draw(&RasterJob { viewport: outside, ..job }, &mut target).expect_err("outside");
    assert!(message.to_string().contains("not inside 64 x 64"), "{message}");
    let overflow = Rect { x: u32::MAX, y: 0, width: 2, height: 2 };
    rasteriser.draw(&RasterJob { viewport: overflow, ..job }, &mut target).expect_err("outside");
    let mut small = GBuffer::new(64, 64, Attachments { normal: false, ..ALL });
    let message = rasteriser.draw(&job, &mut small).expect_err("no normals").to_string();
    assert!(message.contains("`normal`"), "{message}");
    let message = rasteriser.draw(&RasterJob { shades: &setup.shades[..2], ..job }, &mut target).expect_err("shades");
    assert!(message.to_string().contains("material 2"), "{message}");
    let texture = [Vec4::ONE; 4].map(|_| Shade { texture: Some(7), ..setup.shades[0] });
    let message = rasteriser.draw(&RasterJob { shades: &texture, ..job }, &mut target).expect_err("no texture 7");
    assert!(message.to_string().contains("no texture 7"), "{message}");
    rasteriser.draw(&job, &mut target).expect("still works");
}

#[test]
fn adapters_are_listed_hardware_first_and_software_is_no_real_gpu() {
    let list = adapters();
    assert!(list.is_sorted_by_key(|adapter| adapter.kind));
    let hardware = list.iter().any(|adapter| adapter.kind != AdapterKind::Software);
    match WgpuRasteriser::new(AdapterChoice::RealGpu) {
        Ok(rasteriser) => {
            assert!(hardware);
            assert_ne!(rasteriser.adapter().kind, AdapterKind::Software);
        }
        Err(error) => {
            assert!(!hardware, "{error}");
            assert!(error.to_string().contains("`--raster cpu`"), "{error}");
        }
    }
}

#[test]
#[ignore = "runs in a child process of the next test, whose environment has no Vulkan driver"]
fn without_a_driver() {
    assert!(adapters().is_empty());
    let message = |choice| WgpuRasteriser::new(choice).expect_err("no driver").to_string();
    let (any, real) = (message(AdapterChoice::Any), message(AdapterChoice::RealGpu));
    assert!(any.contains("install the graphics driver") && any.contains("`--raster cpu`"), "{any}");
    assert!(real.contains("`--raster cpu`"), "{real}");
    println!("refused as it should");
}

#[cfg(target_os = "linux")]
#[test]
fn a_machine_without_a_driver_gets_an_error_that_says_what_to_do() {
    let output = std::process::Command::new(std::env::current_exe().expect("a path"))
        .args(["--exact", "gpu::without_a_driver", "--nocapture", "--include-ignored"])
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .output()
        .expect("runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("refused as it should"), "{text}");
}
