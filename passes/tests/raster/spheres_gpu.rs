//! Exact spheres in the wgpu rasteriser, pixel by pixel against the closed form in `f64`, beside the processor's rasteriser.

use crate::common::{ALL, Random};
use crate::scenes::marked;
use crate::spheres::{Eye, meets_lines_of_sight, scene, shades};
use crate::support::rasteriser;
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_passes::raster::gpu::WgpuRasteriser;
use curitiba_pipeline::backend::{
    Attachments, Cone, GBuffer, Glow, Light, LoadStore, NO_TRIANGLE, RasterJob, Rasteriser, Rect, Shade, Sun, View,
};
use curitiba_pipeline::executor::{Engines, Renderer, Silent};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::pixel_samples::PixelSamples;
use curitiba_pipeline::plan::{Plan, Settings, Work};
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::project;
use curitiba_pipeline::scene::{Geometry, Material, RenderScene, Sphere};
use glam::camera::rh::view::look_to_mat4;
use glam::{DMat4, DVec2, DVec3, DVec4, Mat4, Vec3, Vec4};
use std::path::Path;
use std::sync::Arc;

/// Distance from a sphere's outline, as a share of the picture's longer side. A pixel whose centre is closer may show the sphere or not.
const OUTLINE: f64 = 1e-6;
/// Relative difference of depths. If two surfaces differ by less, a pixel may show either one.
const TIE: f64 = 2e-6;
/// Greatest error of a normal, times the cosine of the angle between the normal and the line of sight. The factor is needed because the
/// hit at the outline moves without bound if the line of sight moves.
const NORMAL: f64 = 5e-7;
/// Smallest cosine that is used as such a factor; smaller ones are replaced by it.
const RIM: f64 = 0.01;
/// Greatest relative error of a depth, times the same cosine.
const DEPTH: f64 = 8e-7;

const SUN: Sun = Sun { direction: Vec3::new(0.36, -0.8, -0.48), color: Vec3::new(0.9, 0.8, 0.7) };

fn sphere(x: f32, y: f32, z: f32, radius: f32, material: u32) -> Sphere {
    Sphere { center: Vec3::new(x, y, z), radius, material }
}

/// A scene of spheres alone, with three materials.
fn of_spheres(spheres: Vec<Sphere>) -> Arc<RenderScene> {
    let geometry = Geometry { spheres, ..Geometry::default() };
    Arc::new(RenderScene { geometry, materials: vec![Material::default(); 3], ..RenderScene::default() })
}

fn job<'a>(scene: &'a RenderScene, shades: &'a [Shade], view: View, [width, height]: [u32; 2]) -> RasterJob<'a> {
    RasterJob {
        scene,
        program: RasterProgram::Deferred,
        view,
        lights: &[],
        sun: Some(SUN),
        shades,
        culled: &[],
        viewport: Rect { x: 0, y: 0, width, height },
        clear_color: Vec4::new(0.1, 0.2, 0.3, 0.0),
        attachments: ALL,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore { store_depth: true, ..LoadStore::default() },
    }
}

/// Perspective without a far plane.
fn infinite(tangent: f32, near: f32) -> Mat4 {
    Mat4::from_cols(Vec4::X / tangent, Vec4::Y / tangent, Vec4::NEG_W, Vec4::Z * near)
}

fn draw(rasteriser: &mut dyn Rasteriser, scene: &Arc<RenderScene>, job: &RasterJob<'_>) -> GBuffer {
    rasteriser.upload(scene).expect("uploads");
    again(rasteriser, job)
}

fn again(rasteriser: &mut dyn Rasteriser, job: &RasterJob<'_>) -> GBuffer {
    let mut target = marked(job.viewport.width, job.viewport.height, job.attachments);
    if job.load_store.store_depth {
        target.depth = vec![-77.0; job.viewport.width as usize * job.viewport.height as usize];
    }
    rasteriser.draw(job, &mut target).expect("draws");
    rasteriser.read_back(job, job.attachments, &mut target).expect("reads back");
    target
}

/// A hit of a line of sight.
#[derive(Clone, Copy)]
struct Met {
    depth: f64,
    id: u32,
    normal: DVec3,
    /// Cosine between the normal and the line of sight.
    rim: f64,
}

/// The lines of sight of a job in `f64`, from its own matrix.
struct Sight<'a> {
    job: &'a RasterJob<'a>,
    matrix: DMat4,
    inverse: DMat4,
    eye: DVec3,
    size: DVec2,
}

impl<'a> Sight<'a> {
    fn new(job: &'a RasterJob<'a>) -> Self {
        let (matrix, eye) = job.view.projection();
        let (matrix, eye) = (matrix.as_dmat4(), eye.as_dvec3());
        let size = DVec2::new(f64::from(job.viewport.width), f64::from(job.viewport.height));
        Self { job, matrix, inverse: matrix.inverse(), eye, size }
    }

    /// The line of sight through a place of the picture, in pixels: its start on the near plane, relative to the eye, and its direction.
    fn line(&self, at: DVec2) -> (DVec3, DVec3) {
        let place = (at / self.size * 2.0 - 1.0) * DVec2::new(1.0, -1.0);
        let [near, far] = [1.0, 0.0].map(|depth| self.inverse * DVec4::new(place.x, place.y, depth, 1.0));
        let direction = far.truncate() * near.w - near.truncate() * far.w;
        (near.truncate() / near.w, direction.normalize())
    }

    fn depth(&self, point: DVec3) -> f64 {
        let clip = self.matrix * point.extend(1.0);
        if clip.w > 0.0 { clip.z / clip.w } else { f64::INFINITY }
    }

    /// The square of half the chord of a line in a sphere, in squared radii; it is negative if the line misses. Then the chord's midpoint,
    /// relative to the sphere's centre.
    fn chord(&self, sphere: &Sphere, (start, direction): (DVec3, DVec3)) -> (f64, DVec3) {
        let from = start - (sphere.center.as_dvec3() - self.eye);
        let middle = from - from.dot(direction) * direction;
        (1.0 - middle.length_squared() / f64::from(sphere.radius).powi(2), middle)
    }

    /// The hits of the line of sight through a pixel's centre between the near and the far plane, nearest first. The flag tells whether an
    /// outline, an edge, the near or far plane, or a second surface is so close that rounding may decide.
    fn meets(&self, x: u32, y: u32) -> (Vec<Met>, bool) {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let (mut met, mut is_open) = (Vec::new(), false);
        let geometry = &self.job.scene.geometry;
        let (start, direction) = self.line(at);
        let outline = OUTLINE * self.size.max_element();
        let beside = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|side| self.line(at + side * outline));
        for id in 0..geometry.triangles.len() as u32 {
            let [a, b, c] = geometry.corners(id).map(|corner| corner.as_dvec3() - self.eye);
            let across = (b - a).cross(c - a);
            let point = start + direction * ((a - start).dot(across) / direction.dot(across));
            let share = |b: DVec3, c: DVec3| (b - point).cross(c - point).dot(across) / across.length_squared();
            let shares = [share(b, c), share(c, a), share(a, b)];
            let least = shares.into_iter().fold(1.0, f64::min);
            is_open |= least.abs() < 2e-3;
            if least >= 0.0 {
                let normal = across.normalize();
                met.push(Met { depth: self.depth(point), id, normal, rim: 1.0 });
            }
        }
        for (sphere, id) in geometry.spheres.iter().zip(geometry.triangles.len() as u32..) {
            let (half, middle) = self.chord(sphere, (start, direction));
            if half.abs() < 0.1 {
                is_open |= beside.iter().any(|line| (self.chord(sphere, *line).0 >= 0.0) != (half >= 0.0));
            }
            if half < 0.0 {
                continue;
            }
            let radius = f64::from(sphere.radius);
            let is_culled = self.job.culled.get(sphere.material as usize) == Some(&true);
            for side in [-1.0, 1.0].into_iter().take(if is_culled { 1 } else { 2 }) {
                let normal = (middle / radius + direction * (side * half.sqrt())).normalize();
                let depth = self.depth(sphere.center.as_dvec3() - self.eye + normal * radius);
                met.push(Met { depth, id, normal, rim: half.sqrt() });
            }
        }
        // Without a far plane, no hit can be too close to one.
        let far = if self.inverse.w_axis.w.abs() < 1e-12 { 0.0 } else { 1e-7 };
        is_open |= met.iter().any(|met| (met.depth - 1.0).abs() < TIE || met.depth.abs() < far);
        met.retain(|met| (0.0..=1.0).contains(&met.depth));
        met.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        is_open |= met.len() > 1 && met[0].id != met[1].id && met[0].depth - met[1].depth < TIE * met[0].depth;
        (met, is_open)
    }
}

/// Errors of a picture against the closed form.
#[derive(Debug, Default)]
struct Errors {
    /// Pixels that show another surface than the closed form.
    ids: usize,
    /// Pixels for which rounding may decide the surface; they are not compared.
    open: usize,
    /// Pixels that show a sphere.
    spheres: usize,
    /// Greatest error of a normal and relative error of a depth, both times the cosine; greatest error of a position, relative to the error
    /// that rounding and the normal explain.
    normal: f64,
    depth: f64,
    position: f64,
    /// Greatest error of the light's cosine and of a colour, times the cosine of the line of sight.
    light: f64,
    color: f64,
}

impl Errors {
    fn of(sight: &Sight<'_>, drawn: &GBuffer) -> Self {
        let mut errors = Self::default();
        let [width, height] = [sight.job.viewport.width, sight.job.viewport.height];
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let (met, is_open) = sight.meets(x, y);
            if is_open {
                errors.open += 1;
                continue;
            }
            let pixel = (y * width + x) as usize;
            let expected = met.first().map_or(NO_TRIANGLE, |met| met.id);
            if drawn.triangle[pixel] != expected {
                errors.ids += 1;
                continue;
            }
            match met.first() {
                Some(met) => errors.add(sight, drawn, pixel, met),
                None => assert_eq!(drawn.color[pixel], sight.job.clear_color.to_array(), "{x} {y}"),
            }
        }
        errors
    }

    fn add(&mut self, sight: &Sight<'_>, drawn: &GBuffer, pixel: usize, met: &Met) {
        let Some(sphere) = sight.job.scene.geometry.sphere(met.id) else { return };
        self.spheres += 1;
        let rim = met.rim.max(RIM);
        let [position, normal, color] = [&drawn.position, &drawn.normal, &drawn.color].map(|it| Vec4::from(it[pixel]));
        let off = normal.truncate().as_dvec3().distance(met.normal);
        self.normal = self.normal.max(off * rim);
        self.depth = self.depth.max((f64::from(drawn.depth[pixel]) / met.depth - 1.0).abs() * rim);
        let radius = f64::from(sphere.radius);
        let place = sphere.center.as_dvec3() + met.normal * radius;
        let rounding = f64::from(f32::EPSILON) * (place.abs().max_element() + radius);
        let off = position.truncate().as_dvec3().distance(place);
        self.position = self.position.max(off / (rounding + radius * NORMAL / rim));
        let exact = met.normal.dot(-SUN.direction.as_dvec3()).clamp(0.0, 1.0);
        self.light = self.light.max((f64::from(position.w) - exact).abs() * rim);
        let shade = sight.job.shades[sphere.material as usize];
        let glow = shade.glow.map_or(Vec3::ZERO, |glow| glow.color).extend(0.0);
        let lit = shade.diffuse * 0.3 + shade.diffuse * SUN.color.extend(1.0) * exact as f32 + glow;
        self.color = self.color.max(f64::from((color - lit).abs().max_element()) * rim);
    }

    fn assert(&self, name: &str) {
        assert_eq!(self.ids, 0, "{name}: {self:?}");
        assert!(self.normal <= NORMAL && self.depth <= DEPTH && self.position <= 1.0, "{name}: {self:?}");
        assert!(self.light <= NORMAL && self.color <= 2.0 * NORMAL, "{name}: {self:?}");
    }
}

/// Draws with both rasterisers, on the GPU with both ways of shading, and compares each with the closed form. Returns the processor's
/// errors.
fn agree(gpu: &mut WgpuRasteriser, name: &str, scene: &Arc<RenderScene>, job: &RasterJob<'_>) -> Errors {
    let sight = Sight::new(job);
    let cpu = Errors::of(&sight, &draw(&mut CpuRasteriser::new(), scene, job));
    println!("{name}: cpu {cpu:?}");
    for shades_pixels in [false, true] {
        gpu.set_shades_pixels(shades_pixels);
        let wgpu = Errors::of(&sight, &draw(gpu, scene, job));
        println!("{name}: wgpu {wgpu:?}");
        wgpu.assert(name);
        assert_eq!((cpu.ids, cpu.spheres), (0, wgpu.spheres), "{name}: cpu {cpu:?}");
        let pixels = (job.viewport.width * job.viewport.height) as usize;
        assert!(50 * wgpu.open <= pixels, "{name}: {} of {pixels} pixels are not compared", wgpu.open);
    }
    cpu
}

#[test]
fn every_pixel_shows_what_its_line_of_sight_meets() {
    let Some(mut rasteriser) = rasteriser() else { return };
    for shades_pixels in [false, true] {
        rasteriser.set_shades_pixels(shades_pixels);
        meets_lines_of_sight(&mut rasteriser, 2.0);
    }
}

/// Spheres in front of, in and behind a wall, cut by the near plane, around the eye; in perspective and without; a culled one.
#[test]
fn the_closed_form_is_met_before_in_and_behind_triangles() {
    let Some(mut gpu) = rasteriser() else { return };
    let scene = Arc::new(scene());
    let mut shades = shades();
    shades[2].glow = Some(Glow { color: Vec3::new(0.25, 0.5, 0.125), texture: None });
    let towards = Vec3::new(0.1, -0.05, -1.0).normalize();
    for (name, at, perspective, size, culled) in [
        ("in front", Vec3::ZERO, true, [200, 150], [false; 3]),
        ("within", Vec3::new(0.1, 0.2, -3.9), true, [131, 97], [false; 3]),
        ("parallel", Vec3::new(0.3, 0.1, 1.0), false, [160, 160], [false; 3]),
        ("around the eye", Vec3::new(0.0, 0.0, 4.0), true, [64, 64], [false; 3]),
        ("culled", Vec3::new(0.0, 0.0, 4.0), true, [64, 64], [false, false, true]),
    ] {
        let view = Eye { at, towards, perspective, size }.view();
        let job = RasterJob { culled: &culled, ..job(&scene, &shades, view, size) };
        let found = agree(&mut gpu, name, &scene, &job);
        assert!(found.spheres > 100, "{name}: {found:?}");
        for (name, view) in [
            ("mirrored", view.mapped(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)))),
            ("a sample", view.of_sample(job.viewport, PixelSamples::new(4).expect("four"), 1)),
        ] {
            agree(&mut gpu, name, &scene, &RasterJob { view, ..job });
        }
    }
    // Control: spheres that are half a percent larger, which is a tenth of a pixel or less, differ from the closed form.
    let eye = Eye { at: Vec3::ZERO, towards, perspective: true, size: [200, 150] };
    let exact = job(&scene, &shades, eye.view(), eye.size);
    let mut larger = (*scene).clone();
    larger.geometry.spheres.iter_mut().for_each(|sphere| sphere.radius *= 1.005);
    let larger = Arc::new(larger);
    let drawn = draw(&mut gpu, &larger, &job(&larger, &shades, eye.view(), eye.size));
    let errors = Errors::of(&Sight::new(&exact), &drawn);
    assert!(errors.ids > 5 && errors.position > 10.0, "{errors:?}");
}

/// Control: number of pixels in which the usual quadratic equation, from the eye in 32-bit floats, is wrong about a hit of the first sphere.
fn wrong_as_usual(sight: &Sight<'_>) -> usize {
    let sphere = &sight.job.scene.geometry.spheres[0];
    let [width, height] = [sight.job.viewport.width, sight.job.viewport.height];
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)));
    let is_wrong = |at: &DVec2| {
        let (start, direction) = sight.line(*at);
        let (from, along) = ((start - (sphere.center.as_dvec3() - sight.eye)).as_vec3(), direction.as_vec3());
        let b = from.dot(along);
        let discriminant = b * b - (from.length_squared() - sphere.radius * sphere.radius);
        (sight.chord(sphere, (start, direction)).0 >= 0.0) != (discriminant >= 0.0)
    };
    pixels.filter(is_wrong).count()
}

/// Spheres far smaller and far larger than their distance.
#[test]
fn neither_distance_nor_size_loses_the_outline() {
    let Some(mut gpu) = rasteriser() else { return };
    let shades = shades();
    let size = [90, 90];
    let at_eye = |lens: Mat4, eye: Vec3| View { clip_from_eye: Some(lens), ..View::new(Mat4::IDENTITY, eye) };
    // A radius of 1e-4 at the distance 1e4, through a lens that sees 3e-8 of it.
    let small = of_spheres(vec![sphere(3e-5, -2e-5, -1e4, 1e-4, 1)]);
    let far = of_spheres(vec![sphere(1024.0, -512.0, -1e4, 1e-4, 1)]);
    // The eye is two units above a planet and looks at the horizon, and down. Then it is just above, just below and on a surface.
    let planet = of_spheres(vec![sphere(0.0, -1_000_002.0, 0.0, 1e6, 1)]);
    let down = look_to_mat4(Vec3::ZERO, Vec3::new(0.1, -1.0, 0.2), Vec3::X);
    let unit = |gap: f32| of_spheres(vec![sphere(0.0, -1.0 - gap, 0.0, 1.0, 2)]);
    let cases = [
        ("small and far", small, at_eye(infinite(1.5e-8, 1.0), Vec3::ZERO)),
        ("with an eye elsewhere", far, at_eye(infinite(1.5e-8, 1.0), Vec3::new(1024.0, -512.0, 0.0))),
        ("a horizon", planet.clone(), View::new(infinite(0.05, 0.1), Vec3::ZERO)),
        ("a planet", planet, View::new(infinite(1.0, 0.1) * down, Vec3::ZERO)),
        ("just above", unit(1e-4), View::new(infinite(1.0, 1e-5) * down, Vec3::ZERO)),
        ("just below", unit(-1e-4), View::new(infinite(1.0, 1e-5) * down, Vec3::ZERO)),
        ("on it", unit(0.0), View::new(infinite(1.0, 1e-5) * look_to_mat4(Vec3::ZERO, Vec3::Z, Vec3::Y), Vec3::ZERO)),
        ("its centre", unit(-1.0), View::new(infinite(1.0, 0.5) * down, Vec3::ZERO)),
    ];
    for (name, scene, view) in cases {
        let found = agree(&mut gpu, name, &scene, &job(&scene, &shades, view, size));
        assert!(name == "on it" || found.spheres > 1000, "{name}: {found:?}");
        if name == "small and far" {
            let wrong = wrong_as_usual(&Sight::new(&job(&scene, &shades, view, size)));
            println!("{name}: the usual method is wrong in {wrong} of 8100 pixels");
            assert!(wrong > 2000, "control: {wrong}");
        }
    }
}

#[test]
fn ten_thousand_spheres_are_those_of_the_closed_form() {
    let Some(mut gpu) = rasteriser() else { return };
    let shades = shades();
    let mut random = Random(9);
    let mut spheres: Vec<Sphere> = (0..10_000)
        .map(|index| {
            let at = random.vector() * Vec3::new(6.0, 6.0, 8.0) - Vec3::new(0.0, 0.0, 9.0);
            Sphere { center: at, radius: 0.02 + 0.2 * random.unit().powi(4), material: index % 3 }
        })
        .collect();
    spheres.sort_by_key(|sphere| sphere.material);
    let scene = of_spheres(spheres);
    let eye = Eye { at: Vec3::ZERO, towards: Vec3::NEG_Z, perspective: true, size: [160, 120] };
    let job = job(&scene, &shades, eye.view(), eye.size);
    let found = agree(&mut gpu, "ten thousand", &scene, &job);
    assert!(found.spheres > 10_000, "{found:?}");
    // Control: with the spheres in another order, pixels show other ids.
    let mut other = (*scene).clone();
    other.geometry.spheres.swap(0, 1);
    other.geometry.spheres.rotate_left(1);
    let other = Arc::new(other);
    let drawn = draw(&mut gpu, &other, &RasterJob { scene: &other, ..job });
    assert!(Errors::of(&Sight::new(&job), &drawn).ids > 10_000);
}

#[test]
fn of_equal_spheres_the_first_stays() {
    let Some(mut gpu) = rasteriser() else { return };
    let one = sphere(0.2, 0.1, -4.0, 1.0, 1);
    let scene = of_spheres(vec![one, Sphere { material: 2, ..one }]);
    let view = View::new(infinite(1.0, 0.1), Vec3::ZERO);
    let drawn = draw(&mut gpu, &scene, &job(&scene, &shades(), view, [64, 64]));
    let count = |id: u32| drawn.triangle.iter().filter(|found| **found == id).count();
    assert!(count(0) > 100 && count(1) == 0, "{} {}", count(0), count(1));
}

#[test]
fn attachments_not_asked_for_do_not_change_the_others() {
    let Some(mut gpu) = rasteriser() else { return };
    let (scene, shades) = (Arc::new(scene()), shades());
    let eye = Eye { at: Vec3::ZERO, towards: Vec3::NEG_Z, perspective: true, size: [75, 60] };
    let whole = job(&scene, &shades, eye.view(), eye.size);
    for shades_pixels in [false, true] {
        gpu.set_shades_pixels(shades_pixels);
        let full = draw(&mut gpu, &scene, &whole);
        for bits in 1_u32..16 {
            let [color, position, normal, triangle] = [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1);
            let attachments = Attachments { color, position, normal, triangle };
            let drawn = again(&mut gpu, &RasterJob { attachments, ..whole });
            let kept = |asked: bool, channel: &[[f32; 4]]| if asked { channel.to_vec() } else { Vec::new() };
            assert!(drawn.color == kept(color, &full.color), "{attachments:?}");
            assert!(drawn.position == kept(position, &full.position), "{attachments:?}");
            assert!(drawn.normal == kept(normal, &full.normal), "{attachments:?}");
            assert!(!triangle || drawn.triangle == full.triangle, "{attachments:?}");
            assert!(drawn.depth == full.depth, "{attachments:?}");
        }
        let half = Attachments { normal: true, position: true, color: true, triangle: false };
        let drawn = again(&mut gpu, &RasterJob { half, ..whole });
        let is_near = |(a, b): (&[f32; 4], &[f32; 4])| {
            Vec4::from(*a).distance(Vec4::from(*b)) < 0.02 * (1.0 + Vec4::from(*b).length())
        };
        assert!(drawn.triangle == full.triangle && drawn.position.iter().zip(&full.position).all(is_near));
    }
}

/// Bands and tiles of a picture have the same pixels as the whole picture.
#[test]
fn a_part_of_the_picture_is_the_same_as_the_whole() {
    let Some(mut gpu) = rasteriser() else { return };
    let (scene, shades) = (Arc::new(scene()), shades());
    let eye = Eye { at: Vec3::ZERO, towards: Vec3::NEG_Z, perspective: true, size: [200, 150] };
    let whole = job(&scene, &shades, eye.view(), eye.size);
    for shades_pixels in [false, true] {
        gpu.set_shades_pixels(shades_pixels);
        let full = draw(&mut gpu, &scene, &whole);
        for (origin, [width, height]) in [([0, 64], [200, 64]), ([64, 0], [64, 128]), ([128, 128], [72, 22])] {
            let mut part = GBuffer { origin, ..marked(width, height, ALL) };
            part.depth = vec![-77.0; (width * height) as usize];
            gpu.draw(&whole, &mut part).expect("draws");
            gpu.read_back(&whole, ALL, &mut part).expect("reads back");
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let (here, there) = ((y * width + x) as usize, ((y + origin[1]) * 200 + x + origin[0]) as usize);
                assert_eq!(part.triangle[here], full.triangle[there], "{origin:?} {x} {y}");
                assert!(part.position[here] == full.position[there] && part.color[here] == full.color[there]);
                assert!(part.normal[here] == full.normal[there] && part.depth[here] == full.depth[there]);
            }
        }
    }
}

/// A pass that loads the colour and depth of an earlier one: spheres of both passes hide each other.
#[test]
fn a_later_pass_goes_on_from_the_depth_of_spheres() {
    let Some(mut gpu) = rasteriser() else { return };
    let all = scene();
    let shades = shades();
    let [mut first, mut second] = [all.clone(), all.clone()];
    first.geometry.spheres.retain(|sphere| sphere.material == 1);
    second.geometry.spheres.retain(|sphere| sphere.material == 2);
    let [first, second, all] = [first, second, all].map(Arc::new);
    let eye = Eye { at: Vec3::ZERO, towards: Vec3::NEG_Z, perspective: true, size: [200, 150] };
    for shades_pixels in [false, true] {
        gpu.set_shades_pixels(shades_pixels);
        let whole = draw(&mut gpu, &all, &job(&all, &shades, eye.view(), eye.size));
        let mut target = draw(&mut gpu, &first, &job(&first, &shades, eye.view(), eye.size));
        let differs = target.position != whole.position;
        let load_store = LoadStore { load_color: true, load_depth: true, store_depth: true };
        let job = RasterJob { load_store, ..job(&second, &shades, eye.view(), eye.size) };
        gpu.upload(&second).expect("uploads");
        gpu.draw(&job, &mut target).expect("draws");
        gpu.read_back(&job, ALL, &mut target).expect("reads back");
        assert!(differs && target.position == whole.position && target.color == whole.color);
        assert!(target.normal == whole.normal && target.depth == whole.depth);
    }
}

#[test]
fn several_lights_are_those_of_the_processor() {
    let Some(mut gpu) = rasteriser() else { return };
    let (scene, shades) = (Arc::new(scene()), shades());
    let eye = Eye { at: Vec3::ZERO, towards: Vec3::NEG_Z, perspective: true, size: [120, 90] };
    let sun = Light {
        place: None,
        direction: SUN.direction,
        color: SUN.color,
        attenuation: [1.0, 0.0, 0.1],
        range: f32::INFINITY,
        cone: None,
    };
    let place = Some(Vec3::new(1.0, 2.0, -1.0));
    let spot = Light {
        place,
        cone: Some(Cone { inner: 0.95, outer: 0.6, exponent: 0.0 }),
        direction: Vec3::new(-0.2, -0.6, -1.0).normalize(),
        ..sun
    };
    let lights = [sun, Light { place, color: Vec3::new(3.0, 1.0, 2.0), ..sun }, spot];
    let job = RasterJob { lights: &lights, sun: None, ..job(&scene, &shades, eye.view(), eye.size) };
    let cpu = draw(&mut CpuRasteriser::new(), &scene, &job);
    for shades_pixels in [false, true] {
        gpu.set_shades_pixels(shades_pixels);
        let wgpu = draw(&mut gpu, &scene, &job);
        let (mut compared, mut lit) = (0, 0);
        for (pixel, id) in wgpu.triangle.iter().enumerate().filter(|(_, id)| (2..NO_TRIANGLE).contains(*id)) {
            if cpu.triangle[pixel] != *id {
                continue;
            }
            compared += 1;
            let [a, b] = [&cpu, &wgpu].map(|drawn| Vec4::from(drawn.color[pixel]));
            assert!(a.distance(b) < 2e-4 * (1.0 + a.length()), "{pixel}: {a} {b}");
            let alone = shades[scene.geometry.sphere(*id).expect("one").material as usize].diffuse * 0.3;
            lit += usize::from(a.distance(alone) > 0.1);
        }
        assert!(compared > 500 && lit > 300, "{compared} {lit}");
    }
}

/// A renderer of a project of `xml_projects/glass`, with the processor's rays.
fn project(name: &str, raster: Box<dyn Rasteriser>, set: &[&str]) -> Renderer {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../xml_projects/glass/{name}.xml"));
    let project = project::load(&path).expect("the project loads");
    let set = set.iter().map(|value| (*value).to_owned()).collect();
    let settings = Settings { size: Some([96, 96]), set, ..Settings::default() };
    let plan = Plan::new(project, settings).expect("a plan");
    Renderer::new(plan, Engines::new(raster, Box::new(CpuRays::new())), &mut Silent).expect("engines")
}

fn picture(name: &str, raster: Box<dyn Rasteriser>, set: &[&str]) -> Image {
    project(name, raster, set).frame(&mut Silent).expect("a frame")
}

/// The share of pixels whose colours differ by more than 1/255.
fn differing(a: &Image, b: &Image) -> f64 {
    let differs = |(a, b): (&[f32; 4], &[f32; 4])| (Vec4::from(*a) - Vec4::from(*b)).abs().max_element() > 1.0 / 255.0;
    a.pixels.iter().zip(&b.pixels).filter(|pair| differs(*pair)).count() as f64 / a.pixels.len() as f64
}

#[test]
fn projects_with_spheres_have_the_same_pixels_and_pictures() {
    let Some(mut gpu) = rasteriser() else { return };
    for (name, set) in [
        ("Spheres", &["pass2.samples=1"][..]),
        ("Shells", &["pass2.samples=1"]),
        ("Caustics", &["pass2.samples=1", "pass2.sunsamples=1"]),
    ] {
        let mut renderer = project(name, Box::new(CpuRasteriser::new()), set);
        let cpu = renderer.frame(&mut Silent).expect("a frame");
        let Work::Raster { scene_set, view, viewport, .. } = renderer.plan().passes[0].work else {
            panic!("the first pass draws");
        };
        let scene = Arc::clone(renderer.scenes().nth(scene_set).expect("its scene"));
        let shade = |material: &Material| Shade { diffuse: material.diffuse, ..Shade::default() };
        let shades: Vec<Shade> = scene.materials.iter().map(shade).collect();
        let found = agree(&mut gpu, name, &scene, &job(&scene, &shades, view, [viewport.width, viewport.height]));
        assert!(found.spheres > 500, "{name}: {found:?}");
        for shades_pixels in [false, true] {
            let mut raster = rasteriser().expect("there was one");
            raster.set_shades_pixels(shades_pixels);
            let wgpu = picture(name, Box::new(raster), set);
            let share = differing(&cpu, &wgpu);
            println!("{name}: {share} of the pixels differ");
            assert!(share < 0.002, "{name}: {share}");
        }
        let other = picture(name, Box::new(CpuRasteriser::new()), &["pass2.samples=1", "pass2.shadow=report"]);
        assert!(differing(&cpu, &other) > 0.01, "control: other shadows");
    }
}
