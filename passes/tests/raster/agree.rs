//! The two rasterisers draw the same G-buffers, within tolerances.

use crate::common::ALL;
use crate::scenes::{Setup, bumpy, cut_out, grazing, hills, marked, soup, tinted};
use crate::support::rasteriser;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{Cone, GBuffer, Light, NO_TRIANGLE, RasterJob, Rasteriser, Rect};
use glam::{DVec2, Vec3, Vec4};

/// Greatest difference of positions (relative to the distance from the eye), normals, cosines and untextured colours,
/// besides [`slack`].
const TOLERANCE: f32 = 1e-4;
/// Greatest difference of a component of a textured colour. The processor filters in 32-bit floats and computes
/// derivatives exactly. Devices may round the weights of texels and levels to 1/256 (Vulkan 1.3, section 16.9.1), and
/// compute derivatives as differences between neighbouring pixels.
const TEXTURED_TOLERANCE: f32 = 0.02;
/// Greatest displacement of the interpolation, in pixels. Both rasterisers take attributes from the exact corners, in 32-bit floats. A pixel
/// that only the snapped triangle covers shows a nearby point of the exact one in both.
const ROUNDING: f64 = 1.0 / 2048.0;
/// The same limit if a device interpolates. Some devices interpolate between corners that they snapped to 1/256 pixel: two corners with an
/// error of 1/512 pixel in each direction.
const SNAPPING: f64 = 1.0 / 256.0;

/// The difference of a triangle's interpolated values that a displacement explains, as a fraction of the difference
/// between its corners. It is large where the triangle is hardly wider than the displacement, and 0 for triangles that
/// reach behind the camera.
fn slack(job: &RasterJob<'_>, triangle: u32, displacement: f64) -> f32 {
    let size = DVec2::new(f64::from(job.viewport.width), f64::from(job.viewport.height));
    let from_world = job.view.clip_from_world;
    let clip = job.scene.geometry.corners(triangle).map(|p| (from_world * p.extend(1.0)).as_dvec4());
    if clip.iter().any(|c| c.w <= 0.0) {
        return 0.0;
    }
    let [a, b, c] = clip.map(|c| 0.5 * size * c.truncate().truncate() / c.w);
    let longest = (a - b).length().max((b - c).length()).max((c - a).length());
    let lowest_height = (b - a).perp_dot(c - a).abs() / longest;
    (2.0 * displacement / lowest_height).min(1.0) as f32
}

/// 1 if `value` is above `limit` or NaN, else 0.
fn exceeds(value: f32, limit: f32) -> usize {
    usize::from(value.is_nan() || value > limit)
}

/// Greatest difference between two of three vectors.
fn spread([a, b, c]: [Vec3; 3]) -> f32 {
    (a - b).length().max((b - c).length()).max((c - a).length())
}

/// Differences of two G-buffers of one view: counts of pixels, and greatest differences.
#[derive(Debug, Default)]
struct Agreement {
    pixels: usize,
    /// Covered in one buffer and empty in the other.
    coverage: usize,
    /// Covered in both by different triangles.
    triangle: usize,
    /// Covered in both by the same triangle; the next three count pixels among these.
    same: usize,
    position: usize,
    normal: usize,
    cosine: usize,
    /// Counted where both show the same triangle, or both show none.
    color: usize,
    /// Beyond the tolerance, but within the slack.
    excused_positions: usize,
    excused_normals: usize,
    worst_position: f32,
    worst_normal: f32,
    worst_cosine: f32,
    /// Among pixels of the same triangle.
    worst_color: f32,
}

impl Agreement {
    /// Compares two drawings of `job`, whose attributes may be displaced by `displacement` pixels.
    fn of(job: &RasterJob<'_>, a: &GBuffer, b: &GBuffer, displacement: f64) -> Self {
        assert_eq!((a.width, a.height), (b.width, b.height));
        let geometry = &job.scene.geometry;
        let mut this = Self { pixels: a.triangle.len(), ..Self::default() };
        for pixel in 0..this.pixels {
            let [id_a, id_b] = [a, b].map(|buffer| buffer.triangle[pixel]);
            let known = id_a == id_b && (id_a as usize) < geometry.triangles.len();
            let (mut slack_position, mut slack_normal, mut color_tolerance) = (0.0, 0.0, TOLERANCE);
            if known {
                let normals = geometry.triangles[id_a as usize].map(|vertex| geometry.normals[vertex as usize]);
                let slack = slack(job, id_a, displacement);
                let corners = geometry.corners(id_a);
                // Interpolation in 32-bit floats has an error of some units in the last place of the corners.
                let largest = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
                slack_position = slack * spread(corners) + 16.0 * f32::EPSILON * largest;
                slack_normal = slack * spread(normals);
                if let Some(map) = job.shades[geometry.material_of(id_a) as usize].normal_map {
                    let levels = &job.scene.textures[map.texture as usize].levels[0].texels;
                    let varies = levels.iter().any(|texel| *texel != levels[0]);
                    // A component of a vector is twice a texel's component, and the tangent frame turns as much as the
                    // normal.
                    let steep = map.scale.abs().max(1.0);
                    slack_normal = 2.0 * steep * (slack_normal + TOLERANCE)
                        + if varies { 2.0 * steep * TEXTURED_TOLERANCE } else { 0.0 };
                }
                let textured = job.shades[geometry.material_of(id_a) as usize].texture.is_some();
                color_tolerance = slack_normal + if textured { TEXTURED_TOLERANCE } else { TOLERANCE };
            }
            let [color_a, color_b] = [a, b].map(|buffer| Vec4::from(buffer.color[pixel]));
            let difference = color_a - color_b;
            let difference = if difference.is_nan() { f32::NAN } else { difference.abs().max_element() };
            if id_a != id_b {
                let coverage = id_a == NO_TRIANGLE || id_b == NO_TRIANGLE;
                *(if coverage { &mut this.coverage } else { &mut this.triangle }) += 1;
                continue;
            }
            this.color += exceeds(difference, color_tolerance);
            if id_a == NO_TRIANGLE {
                continue;
            }
            this.same += 1;
            this.worst_color = this.worst_color.max(difference);
            let [position_a, position_b] = [a, b].map(|buffer| Vec4::from(buffer.position[pixel]));
            let distance = (position_a.truncate() - job.view.eye).length();
            let position = (position_a - position_b).truncate().length();
            this.position += exceeds(position, TOLERANCE * distance + slack_position);
            this.worst_position = this.worst_position.max(position / distance);
            let cosine = (position_a.w - position_b.w).abs();
            this.cosine += exceeds(cosine, TOLERANCE + slack_normal);
            this.worst_cosine = this.worst_cosine.max(cosine);
            let [normal_a, normal_b] = [a, b].map(|buffer| Vec4::from(buffer.normal[pixel]));
            let normal = (normal_a - normal_b).length();
            this.normal += exceeds(normal, TOLERANCE + slack_normal);
            this.worst_normal = this.worst_normal.max(normal);
            this.excused_positions += usize::from(position > TOLERANCE * distance);
            this.excused_normals += usize::from(normal > TOLERANCE);
        }
        this
    }

    /// The first requirement that fails, if any.
    fn verdict(&self, allowed: Allowed) -> Result<(), &'static str> {
        let above = |count: usize, of: usize, share: f64| count as f64 > share * of as f64;
        match self {
            _ if self.same * 10 < self.pixels => Err("fewer than 10 % of the pixels show the same triangle"),
            _ if above(self.coverage, self.pixels, allowed.coverage) => Err("coverage"),
            _ if above(self.triangle, self.pixels, allowed.triangle) => Err("triangle"),
            _ if above(self.position, self.same, allowed.vector) => Err("position"),
            _ if above(self.normal, self.same, allowed.vector) => Err("normal"),
            _ if above(self.cosine, self.same, allowed.vector) => Err("cosine"),
            _ if above(self.color, self.pixels, allowed.color) => Err("color"),
            _ => Ok(()),
        }
    }
}

/// Greatest shares of pixels that may differ.
#[derive(Debug, Clone, Copy)]
struct Allowed {
    coverage: f64,
    triangle: f64,
    vector: f64,
    color: f64,
}

const STRICT: Allowed = Allowed { coverage: 1e-4, triangle: 2e-3, vector: 0.0, color: 1e-3 };
/// For needles far thinner than a pixel. They gain or lose pixels along their whole length where a corner rounds
/// differently, and devices compute their attributes from areas that nearly vanish.
const NEEDLES: Allowed = Allowed { coverage: 1e-3, triangle: 5e-3, vector: 1e-3, color: 1e-3 };

/// For holes of a texture, which end where the filtered alpha of a mip level is one half. On an H200, 20 of 187,500 pixels are in a hole for
/// only one of the two rasterisers.
const CUT: Allowed = Allowed { coverage: 3e-4, ..STRICT };

/// For normal maps seen from far away: levels of detail differ, and light ends abruptly at the horizon of the surface.
const BUMPS: Allowed = Allowed { vector: 2e-3, ..STRICT };

fn render(rasteriser: &mut dyn Rasteriser, setup: &Setup, job: &RasterJob<'_>, width: u32, height: u32) -> GBuffer {
    let mut target = marked(width, height, job.attachments);
    rasteriser.upload(&setup.scene).expect("uploads");
    rasteriser.draw(job, &mut target).expect("draws");
    if rasteriser.needs_read_back() {
        rasteriser.read_back(job, job.attachments, &mut target).expect("reads back");
    }
    target
}

fn setups() -> Vec<(Setup, Allowed)> {
    let scenes = [hills(160), hills(16), grazing(), tinted(), bumpy(0.0)];
    let kinds = [0, 2, 3, 4, 5, 6];
    // Triangles smaller than a pixel, and needles, must be many to cover anything.
    let soups = kinds.map(|kind| soup(kind, if kind == 2 { 20_000 } else { 3000 }));
    let strict = scenes.into_iter().chain(soups).map(|setup| (setup, STRICT));
    strict.chain([(cut_out(), CUT), (soup(1, 20_000), NEEDLES), (bumpy(1.0), BUMPS)]).collect()
}

const WIDTH: u32 = 500;
const HEIGHT: u32 = 375;

/// Draws a job with both rasterisers and prints their differences. Returns the processor's picture, and the scene and attachment that exceed
/// `allowed`, if any.
fn compare(
    gpu: &mut dyn Rasteriser,
    setup: &Setup,
    job: &RasterJob<'_>,
    (allowed, displacement): (Allowed, f64),
) -> (GBuffer, Option<(&'static str, &'static str)>) {
    let a = render(&mut CpuRasteriser::new(), setup, job, WIDTH, HEIGHT);
    let agreement = Agreement::of(job, &a, &render(gpu, setup, job, WIDTH, HEIGHT), displacement);
    println!("{}: {agreement:?}", setup.name);
    (a, agreement.verdict(allowed).err().map(|what| (setup.name, what)))
}

#[test]
fn the_two_rasterisers_draw_the_same() {
    let Some(mut gpu) = rasteriser() else { return };
    let mut failed = Vec::new();
    for (setup, allowed) in setups() {
        let job = setup.job(WIDTH, HEIGHT, ALL);
        // With one shading for each pixel, and with one for each fragment.
        for (shades_pixels, displacement) in [(true, ROUNDING), (false, SNAPPING)] {
            gpu.set_shades_pixels(shades_pixels);
            let (_, wrong) = compare(&mut gpu, &setup, &job, (allowed, displacement));
            failed.extend(wrong);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn a_camera_that_is_shifted_is_found_out_in_every_scene() {
    let Some(mut gpu) = rasteriser() else { return };
    for (setup, allowed) in setups() {
        let job = setup.job(WIDTH, HEIGHT, ALL);
        let a = render(&mut CpuRasteriser::new(), &setup, &job, WIDTH, HEIGHT);
        let shift = Vec3::new(0.01, 0.0, 0.0);
        let shifted = Setup { eye: setup.eye + shift, target: setup.target + shift, ..setup };
        let job = shifted.job(WIDTH, HEIGHT, ALL);
        let b = render(&mut gpu, &shifted, &job, WIDTH, HEIGHT);
        let agreement = Agreement::of(&job, &a, &b, ROUNDING);
        assert!(agreement.verdict(allowed).is_err(), "{}: {agreement:?}", shifted.name);
    }
}

#[test]
fn one_wrong_attachment_is_found_out() {
    let setup = cut_out();
    let job = setup.job(WIDTH, HEIGHT, ALL);
    let good = render(&mut CpuRasteriser::new(), &setup, &job, WIDTH, HEIGHT);
    let verdict = |spoil: &dyn Fn(&mut GBuffer)| {
        let mut bad = good.clone();
        spoil(&mut bad);
        Agreement::of(&job, &good, &bad, ROUNDING).verdict(STRICT)
    };
    assert_eq!(verdict(&|_| {}), Ok(()));
    let (covered, _) = good.triangle.iter().enumerate().find(|(_, id)| **id != NO_TRIANGLE).expect("one is covered");
    assert_eq!(verdict(&|bad| bad.position[covered][1] += 0.1), Err("position"));
    assert_eq!(verdict(&|bad| bad.position[covered][3] = f32::NAN), Err("cosine"));
    assert_eq!(verdict(&|bad| bad.normal[covered][0] += 0.001), Err("normal"));
    let some = 0..good.triangle.len() / 300;
    assert_eq!(verdict(&|bad| bad.color[some.clone()].fill([f32::NAN; 4])), Err("color"));
    let few: Vec<usize> =
        (0..good.triangle.len()).filter(|pixel| good.triangle[*pixel] != NO_TRIANGLE).take(800).collect();
    assert_eq!(verdict(&|bad| few[..30].iter().for_each(|pixel| bad.triangle[*pixel] = NO_TRIANGLE)), Err("coverage"));
    assert_eq!(verdict(&|bad| few.iter().for_each(|pixel| bad.triangle[*pixel] ^= 1)), Err("triangle"));
}

#[test]
fn both_leave_out_the_same_back_faces() {
    let Some(mut gpu) = rasteriser() else { return };
    let mut covered = Vec::new();
    for turn in [false, true] {
        let mut setup = hills(40);
        if turn {
            let mut scene = (*setup.scene).clone();
            scene.geometry.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
            setup.scene = std::sync::Arc::new(scene);
        }
        let culled = vec![true; setup.shades.len()];
        let job = RasterJob { culled: &culled, ..setup.job(150, 90, ALL) };
        let [a, b] =
            [render(&mut CpuRasteriser::new(), &setup, &job, 150, 90), render(&mut gpu, &setup, &job, 150, 90)];
        let agreement = Agreement::of(&job, &a, &b, ROUNDING);
        let wrong = agreement.coverage
            + agreement.triangle.saturating_sub(8)
            + agreement.position
            + agreement.normal
            + agreement.cosine
            + agreement.color;
        // Up to eight of 13,500 pixels may show a neighbour where triangles meet.
        assert!(agreement.same > 1000 && wrong == 0, "{agreement:?}");
        covered.push(a.triangle.iter().filter(|id| **id != NO_TRIANGLE).count());
    }
    covered.sort_unstable();
    assert!(covered[0] < covered[1] / 2, "one side of the hills is seen: {covered:?}");
}

#[test]
fn both_leave_what_is_outside_of_the_viewport() {
    let Some(mut gpu) = rasteriser() else { return };
    let setup = hills(40);
    let viewport = Rect { x: 37, y: 11, width: 70, height: 60 };
    let job = RasterJob { viewport, ..setup.job(70, 60, ALL) };
    let [a, b] = [render(&mut CpuRasteriser::new(), &setup, &job, 150, 90), render(&mut gpu, &setup, &job, 150, 90)];
    let agreement = Agreement::of(&job, &a, &b, ROUNDING);
    // The marked pixels count as one triangle. Together with the drawn part, everything must agree.
    assert_eq!(agreement.verdict(STRICT), Ok(()), "{agreement:?}");
    let marks = |buffer: &GBuffer| buffer.triangle.iter().filter(|id| **id == 0xdead_beef).count();
    assert_eq!((marks(&a), marks(&b)), (150 * 90 - 70 * 60, 150 * 90 - 70 * 60));
}

#[test]
fn both_add_the_same_lights() {
    let Some(mut gpu) = rasteriser() else { return };
    let (mut failed, mut compared) = (Vec::new(), 0);
    for (setup, allowed) in [(hills(160), STRICT), (bumpy(0.0), STRICT), (bumpy(1.0), BUMPS)] {
        let (span, sun) = ((setup.eye - setup.target).length(), setup.sun.expect("a sun"));
        let attenuation = [1.0, 0.0, 2.0 / (span * span)];
        let place = setup.target + Vec3::new(0.3, 0.8, 0.2) * span;
        let bulb = Light {
            place: Some(place),
            direction: Vec3::ZERO,
            color: Vec3::new(0.9, 0.4, 0.2),
            attenuation,
            range: 3.0 * span,
            cone: None,
        };
        let cone = Some(Cone { inner: 0.95, outer: 0.6, exponent: 2.0 });
        let place = Some(setup.target + Vec3::new(-0.4, 0.9, 0.1) * span);
        let spot = Light { place, direction: Vec3::new(0.3, -0.9, 0.1).normalize(), cone, ..bulb };
        let day = Light { place: None, direction: sun.direction, color: sun.color * 0.5, ..bulb };
        let lights = [bulb, spot, day];
        let job = RasterJob { sun: None, lights: &lights, ..setup.job(WIDTH, HEIGHT, ALL) };
        let (a, wrong) = compare(&mut gpu, &setup, &job, (allowed, ROUNDING));
        failed.extend(wrong);
        // Control: without the spot light and the sun, the pictures differ.
        let fewer = RasterJob { lights: &lights[..1], ..job };
        let other = Agreement::of(&job, &a, &render(&mut gpu, &setup, &fewer, WIDTH, HEIGHT), ROUNDING);
        assert!(other.verdict(allowed).is_err(), "{}", setup.name);
        // After that, a job with one directional light is drawn as before.
        let plain = setup.job(WIDTH, HEIGHT, ALL);
        failed.extend(compare(&mut gpu, &setup, &plain, (allowed, ROUNDING)).1);
        compared += 1;
    }
    assert!(compared == 3 && failed.is_empty(), "{compared} {failed:?}");
}
