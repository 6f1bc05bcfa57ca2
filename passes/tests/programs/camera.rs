//! Programs whose rays start at the camera, against the rasteriser, the programs that read its G-buffer, and closed
//! forms.

use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{
    Attachments, FromCamera, GBuffer, Glow, Lamp, LoadStore, NO_TRIANGLE, PixelCone, RasterJob, Rasteriser as _,
    RayBackend as _, RayJob, Rect, Shade, Sun, View,
};
use curitiba_pipeline::camera_programs::{CameraParams, SurfaceKind};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RasterProgram, RayParams, RayProgram};
use curitiba_pipeline::scene::{Batch, Material, RenderScene};
use glam::camera::rh;
use glam::{Mat4, Vec3, Vec4};
use std::f32::consts::PI;
use std::sync::Arc;

const ALL: Attachments = Attachments { color: true, position: true, normal: true, triangle: true };
const SIDE: u32 = 96;

/// A scene, with the passes' tables of its materials, its lights and its camera.
#[derive(Default)]
struct World {
    scene: RenderScene,
    shades: Vec<Shade>,
    surfaces: Vec<SurfaceKind>,
    sun: Option<Sun>,
    lamp: Option<Lamp>,
    eye: Vec3,
    target: Vec3,
    beyond: Vec3,
}

impl World {
    fn seen(eye: Vec3, target: Vec3) -> Self {
        Self { eye, target, ..Self::default() }
    }

    fn material(&mut self, diffuse: Vec3, kind: SurfaceKind) -> u32 {
        self.scene.materials.push(Material { name: format!("material {}", self.shades.len()), ..Material::default() });
        self.shades.push(Shade { diffuse: diffuse.extend(1.0), ..Shade::WHITE });
        self.surfaces.push(kind);
        self.shades.len() as u32 - 1
    }

    /// A parallelogram around `center`; `x` and `y` are half its sides, and its normal is that of `x.cross(y)`.
    fn quad(&mut self, material: u32, center: Vec3, x: Vec3, y: Vec3) {
        let geometry = &mut self.scene.geometry;
        let (first, id) = (geometry.positions.len() as u32, geometry.triangles.len() as u32);
        geometry.positions.extend([center - x - y, center + x - y, center + x + y, center - x + y]);
        geometry.normals.extend([x.cross(y).normalize(); 4]);
        geometry.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        geometry.batches.push(Batch { material, first: id, count: 2 });
    }

    /// A box whose faces look outwards, or inwards.
    fn cuboid(&mut self, material: u32, center: Vec3, half: Vec3, inwards: bool) {
        let (x, y, z) = (Vec3::X * half.x, Vec3::Y * half.y, Vec3::Z * half.z);
        for (out, a, b) in [(x, y, z), (y, z, x), (z, x, y)] {
            for sign in [1.0, -1.0] {
                let a = if inwards { -a } else { a };
                self.quad(material, center + out * sign, a * sign, b);
            }
        }
    }

    /// A floor with three boxes on it, under the sky and in the sun.
    fn yard() -> Self {
        let mut world = Self::seen(Vec3::new(3.0, 4.0, 6.0), Vec3::ZERO);
        let paint = [Vec3::new(0.8, 0.7, 0.6), Vec3::new(0.2, 0.6, 0.9), Vec3::new(0.9, 0.3, 0.2)];
        let [floor, blue, red] = paint.map(|color| world.material(color, SurfaceKind::Painted));
        world.quad(floor, Vec3::ZERO, Vec3::Z * 5.0, Vec3::X * 5.0);
        world.cuboid(blue, Vec3::new(-1.0, 1.0, -0.5), Vec3::new(0.6, 1.0, 0.4), false);
        world.cuboid(red, Vec3::new(1.2, 0.5, 0.3), Vec3::splat(0.5), false);
        world.cuboid(blue, Vec3::new(0.3, 0.3, 2.2), Vec3::new(0.8, 0.3, 0.2), false);
        world.sun = Some(Sun { direction: Vec3::new(0.5, -0.6, 0.45).normalize(), color: Vec3::ONE });
        world
    }

    fn view(&self) -> View {
        let up = if (self.target - self.eye).normalize().y.abs() > 0.99 { Vec3::X } else { Vec3::Y };
        let to_view: Mat4 = rh::view::look_at_mat4(self.eye, self.target, up);
        View::new(rh::proj::directx::perspective(0.9, 1.0, 1000.0, 0.05) * to_view, self.eye)
    }

    fn job<'a>(
        &'a self,
        scene: &'a RenderScene,
        program: RayProgram,
        params: RayParams,
        filters: &'a [bool],
    ) -> RayJob<'a> {
        RayJob {
            from_camera: Some(FromCamera {
                view: self.view(),
                picture: [SIDE; 2],
                lamp: self.lamp,
                surfaces: &self.surfaces,
            }),
            scene,
            program,
            params,
            fidelity: Fidelity::Corrected,
            seed: 0,
            eye: self.eye,
            cone: PixelCone::default(),
            lights: &[],
            sun: self.sun,
            origin: [0; 2],
            width: SIDE,
            height: SIDE,
            position: &[],
            normal: &[],
            color: &[],
            triangle: &[],
            shared: None,
            beyond: self.beyond,
            dielectrics: &[],
            shades: &self.shades,
            glass: filters,
            shadow_glass: filters,
        }
    }

    fn filters(&self) -> Vec<bool> {
        self.surfaces.iter().map(|kind| kind.passes_light()).collect()
    }

    /// The picture of a program.
    fn run(&self, program: RayProgram, params: RayParams) -> Image {
        let (scene, filters) = (Arc::new(self.scene.clone()), self.filters());
        run_job(&scene, &filters, &self.job(&scene, program, params, &filters))
    }

    /// The colour of a picture's middle pixel. No other pixel is traced.
    fn middle(&self, program: RayProgram, params: RayParams) -> Vec3 {
        let (scene, filters) = (Arc::new(self.scene.clone()), self.filters());
        let whole = self.job(&scene, program, params, &filters);
        let image = run_job(&scene, &filters, &RayJob { origin: [SIDE / 2; 2], width: 1, height: 1, ..whole });
        Vec4::from_array(image.pixels[0]).truncate()
    }

    /// The rasteriser's G-buffer.
    fn drawn(&self) -> GBuffer {
        let scene = Arc::new(self.scene.clone());
        let job = RasterJob {
            scene: &scene,
            program: RasterProgram::Deferred,
            view: self.view(),
            lights: &[],
            sun: self.sun,
            shades: &self.shades,
            culled: &[],
            viewport: Rect { x: 0, y: 0, width: SIDE, height: SIDE },
            clear_color: Vec4::ZERO,
            attachments: ALL,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        };
        let mut target = GBuffer::try_new(SIDE, SIDE, ALL).expect("memory");
        CpuRasteriser::new().draw(&job, &mut target).expect("a whole job");
        target
    }

    /// The picture of a program that reads the G-buffer.
    fn deferred(&self, drawn: &GBuffer, program: RayProgram, params: RayParams) -> Image {
        let scene = Arc::new(self.scene.clone());
        let none = vec![false; self.shades.len()];
        let job = RayJob {
            from_camera: None,
            position: &drawn.position,
            normal: &drawn.normal,
            color: &drawn.color,
            triangle: &drawn.triangle,
            ..self.job(&scene, program, params, &none)
        };
        run_job(&scene, &none, &job)
    }
}

fn run_job(scene: &Arc<RenderScene>, filters: &[bool], job: &RayJob<'_>) -> Image {
    let mut rays = CpuRays::new();
    rays.build(scene, filters).expect("a structure");
    let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
    rays.run(job, &mut output, &Progress::default()).expect("a whole job");
    output
}

fn params(program: RayProgram) -> RayParams {
    program.info().defaults()
}

fn with(program: RayProgram, camera: CameraParams) -> RayParams {
    RayParams { camera, ..params(program) }
}

/// Greatest difference of a component.
fn off(found: Vec3, expected: Vec3) -> f32 {
    (found - expected).abs().max_element()
}

#[test]
fn rays_through_centres_meet_what_the_rasteriser_draws() {
    let mut world = World::yard();
    // Each triangle has its own colour, so that colours identify triangles.
    let triangles = world.scene.geometry.triangles.len() as u32;
    world.scene.geometry.batches = (0..triangles).map(|id| Batch { material: id, first: id, count: 1 }).collect();
    (world.shades, world.surfaces, world.scene.materials) = (Vec::new(), Vec::new(), Vec::new());
    for id in 0..triangles {
        world.material(Vec3::new(id as f32 + 1.0, 0.0, 0.0), SurfaceKind::Painted);
    }
    let differing = |drawn: &GBuffer, traced: &Image| {
        let shown = |pixel: &[f32; 4]| if pixel[0] == 0.0 { NO_TRIANGLE } else { pixel[0] as u32 - 1 };
        drawn.triangle.iter().zip(&traced.pixels).filter(|(id, pixel)| **id != shown(pixel)).count()
    };
    let drawn = world.drawn();
    let traced = world.run(RayProgram::Albedo, params(RayProgram::Albedo));
    // The rasteriser snaps corners to fractions of a pixel, so at edges it may show a neighbouring triangle.
    let differ = differing(&drawn, &traced);
    println!("{differ} of {} pixels differ", SIDE * SIDE);
    assert!(differ <= 6, "{differ}");
    let seen = drawn.triangle.iter().filter(|id| **id != NO_TRIANGLE).count();
    assert!(seen > 4000, "{seen}");
    world.eye.x += 0.3;
    let moved = differing(&drawn, &world.run(RayProgram::Albedo, params(RayProgram::Albedo)));
    assert!(moved > 100, "control: a camera that stands elsewhere: {moved}");
}

#[test]
fn a_part_of_a_picture_is_the_picture_there_for_any_number_of_threads() {
    let mut world = World::yard();
    world.lamp = Some(Lamp { position: Vec3::new(0.0, 4.0, 1.0), color: Vec3::ONE });
    let camera =
        CameraParams { light_width: 0.6, light_depth: 0.4, aperture: 0.05, focus: 6.0, ..CameraParams::default() };
    let (scene, filters) = (Arc::new(world.scene.clone()), world.filters());
    for program in [RayProgram::Whitted, RayProgram::PathTracing, RayProgram::CameraOcclusion] {
        let params = RayParams { samples: 3, depth: 2, camera, ..params(program) };
        let job = world.job(&scene, program, params, &filters);
        let whole = run_job(&scene, &filters, &job);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        assert_eq!(one.install(|| run_job(&scene, &filters, &job)).pixels, whole.pixels, "{program:?}");
        let part = run_job(&scene, &filters, &RayJob { origin: [17, 41], width: 30, height: 20, ..job });
        for (index, pixel) in part.pixels.iter().enumerate() {
            let (x, y) = (index % 30 + 17, index / 30 + 41);
            assert_eq!(*pixel, whole.pixels[y * SIDE as usize + x], "{program:?} {x},{y}");
        }
        let other = run_job(&scene, &filters, &RayJob { seed: 1, ..job });
        assert_ne!(other.pixels, whole.pixels, "control: another seed");
        // The sequence continues: the mean of two halves is the whole.
        let half = |first| {
            let params = RayParams { samples: 2, first, ..job.params };
            run_job(&scene, &filters, &RayJob { params, ..job })
        };
        let (a, b) = (half(0), half(2));
        let four = run_job(&scene, &filters, &RayJob { params: RayParams { samples: 4, ..job.params }, ..job });
        for index in 0..four.pixels.len() {
            let mean = (Vec4::from_array(a.pixels[index]) + Vec4::from_array(b.pixels[index])) * 0.5;
            assert!((mean - Vec4::from_array(four.pixels[index])).abs().max_element() < 1e-6, "{program:?} {index}");
        }
    }
}

#[test]
fn shadows_are_those_of_the_program_that_starts_from_a_g_buffer() {
    let world = World::yard();
    let drawn = world.drawn();
    let deferred = world.deferred(&drawn, RayProgram::DeferredShadows, RayParams::default());
    let no_ambient = CameraParams { ambient: 0.0, ..CameraParams::default() };
    let whitted = world.run(RayProgram::Whitted, with(RayProgram::Whitted, no_ambient));
    let lambert = world.run(RayProgram::Lambert, with(RayProgram::Lambert, no_ambient));
    let (mut lit, mut dark, mut differ) = (0, 0, 0);
    for (index, share) in deferred.pixels.iter().enumerate().filter(|(index, _)| drawn.triangle[*index] != NO_TRIANGLE)
    {
        let facing = drawn.position[index][3] > 0.0;
        let expected = if facing && share[0] == 1.0 { lambert.pixels[index] } else { [0.0, 0.0, 0.0, 1.0] };
        if off(Vec4::from_array(whitted.pixels[index]).truncate(), Vec4::from_array(expected).truncate()) > 1e-6 {
            differ += 1;
        }
        *(if expected[0] > 0.0 { &mut lit } else { &mut dark }) += 1;
    }
    println!("{lit} lit, {dark} dark, {differ} differ");
    // The two may disagree about the surface of an edge pixel, and about a shadow's border through a pixel's centre.
    assert!(differ <= 10 && lit > 1000 && dark > 1000, "{lit} lit, {dark} dark, {differ} differ");
}

#[test]
fn occlusion_has_the_mean_of_the_program_that_starts_from_a_g_buffer() {
    let world = World::yard();
    let drawn = world.drawn();
    let mean = |image: &Image| {
        let seen = image.pixels.iter().zip(&drawn.triangle).filter(|(_, id)| **id != NO_TRIANGLE);
        let (sum, count) = seen.fold((0.0, 0), |(sum, count), (pixel, _)| (sum + f64::from(pixel[0]), count + 1));
        sum / f64::from(count)
    };
    let at = |radius| {
        let linear = RayParams { samples: 64, radius, intensity: 1.0, ..RayParams::default() };
        let deferred = mean(&world.deferred(&drawn, RayProgram::Ssao, linear));
        let ours = RayParams { samples: 64, radius, ..params(RayProgram::CameraOcclusion) };
        (mean(&world.run(RayProgram::CameraOcclusion, ours)), deferred)
    };
    let (ours, deferred) = at(1.0);
    let (wider, _) = at(2.0);
    println!("{ours} from the camera, {deferred} from the G-buffer; radius 2: {wider}");
    assert!((ours - deferred).abs() < 4e-3, "{ours} {deferred}");
    assert!((wider - deferred).abs() > 2e-2, "control: another radius: {wider}");
}

/// A floor of this albedo, seen from straight above.
fn floor(albedo: Vec3) -> World {
    let mut world = World::seen(Vec3::new(0.0, 3.0, 0.0), Vec3::ZERO);
    let paint = world.material(albedo, SurfaceKind::Painted);
    world.quad(paint, Vec3::ZERO, Vec3::Z * 50.0, Vec3::X * 50.0);
    world
}

/// The point of [`floor`] at the middle pixel's centre.
fn middle_of_floor(world: &World) -> Vec3 {
    let pixel = (SIDE * SIDE / 2 + SIDE / 2) as usize;
    Vec4::from_array(world.drawn().position[pixel]).truncate()
}

#[test]
fn direct_light_has_its_closed_forms() {
    let albedo = Vec3::new(0.5, 0.25, 0.75);
    let mut world = floor(albedo);
    let place = Vec3::new(0.7, 1.3, -0.4);
    let color = Vec3::new(1.0, 0.5, 2.0);
    world.lamp = Some(Lamp { position: place, color });
    let at = middle_of_floor(&world);
    let direct = |camera: CameraParams, samples| {
        let params = RayParams { depth: 0, samples, camera, ..params(RayProgram::PathTracing) };
        world.middle(RayProgram::PathTracing, params)
    };
    // Closed form for a point light: albedo I cos / (π d²).
    let (way, intensity) = (place - at, 7.0);
    let expected = albedo * color * (intensity * way.y / (PI * way.length().powi(3)));
    let point = CameraParams { radiance: intensity, ..CameraParams::default() };
    let found = direct(point, 0);
    assert!(off(found, expected) < 2e-6 * expected.max_element(), "{found} {expected}");
    assert!(off(direct(CameraParams { radiance: 7.1, ..point }, 0), expected) > 1e-3, "control: another intensity");
    // A rectangle parallel to the floor, straight above: albedo L F. F is the sum of the form factors of four
    // rectangles that each have the point below a corner (Howell, configuration B-4).
    world.lamp = Some(Lamp { position: Vec3::new(at.x, 1.5, at.z), color });
    let direct = |camera: CameraParams, samples| {
        let params = RayParams { depth: 0, samples, camera, ..params(RayProgram::PathTracing) };
        world.middle(RayProgram::PathTracing, params)
    };
    let (width, depth, radiance) = (1.6_f32, 0.8_f32, 3.0);
    let (x, y) = (0.5 * width / 1.5, 0.5 * depth / 1.5);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let factor = 4.0 / (2.0 * PI) * (x / rx * (y / rx).atan() + y / ry * (x / ry).atan());
    let expected = albedo * color * (radiance * factor);
    let rectangle = CameraParams { radiance, light_width: width, light_depth: depth, ..CameraParams::default() };
    let found = direct(rectangle, 4096);
    println!("rectangle: {found}, closed form {expected}");
    // Samples within the pixel move the point on the floor by at most 0.02.
    assert!(off(found, expected) < 2e-3 * expected.max_element(), "{found} {expected}");
    let wider = direct(CameraParams { light_width: 1.7, ..rectangle }, 4096);
    assert!(off(wider, expected) > 2e-2 * expected.max_element(), "control: a wider light: {wider}");
}

/// All walls emit and reflect alike. After `n` bounces the radiance is a geometric series in the albedo, on every path.
#[test]
fn a_closed_furnace_has_the_radiance_of_the_geometric_series() {
    let mut world = World::seen(Vec3::new(0.3, 0.2, 0.1), Vec3::new(-1.0, -0.4, -0.7));
    let (albedo, emission) = (Vec3::new(0.6, 0.9, 0.3), Vec3::new(0.5, 0.1, 2.0));
    let paint = world.material(albedo, SurfaceKind::Painted);
    world.shades[0].glow = Some(Glow { color: emission, texture: None });
    world.cuboid(paint, Vec3::ZERO, Vec3::new(1.0, 1.5, 2.0), true);
    // A box inside changes nothing.
    world.cuboid(paint, Vec3::new(-0.6, -1.0, -1.2), Vec3::splat(0.3), false);
    for depth in [0, 1, 5, 16] {
        let image =
            world.run(RayProgram::PathTracing, RayParams { depth, samples: 2, ..params(RayProgram::PathTracing) });
        let series = |albedo: f32| (0..=depth).map(|bounce| f64::from(albedo).powi(bounce as i32)).sum::<f64>() as f32;
        let expected = emission * Vec3::new(series(albedo.x), series(albedo.y), series(albedo.z));
        let worst =
            image.pixels.iter().map(|pixel| off(Vec4::from_array(*pixel).truncate(), expected)).fold(0.0, f32::max);
        println!("depth {depth}: {expected}, worst {worst:.1e}");
        assert!(worst < 2e-6 * expected.max_element(), "{depth}: {worst}");
        // Control: with one bounce less, the error is the series' last term.
        assert!(emission.x * albedo.x.powi(depth as i32) > 100.0 * worst);
    }
}

#[test]
fn light_falls_undimmed_through_holes_of_panes() {
    let mut world = floor(Vec3::splat(0.5));
    world.sun = Some(Sun { direction: Vec3::new(0.6, -0.8, 0.0), color: Vec3::ONE });
    let whitted = params(RayProgram::Whitted);
    let bare = world.middle(RayProgram::Whitted, whitted);
    let pane = world.material(Vec3::ONE, SurfaceKind::Clear);
    // Beside the camera's ray, in the way of the sun.
    world.quad(pane, Vec3::new(-0.75, 1.0, 0.0), Vec3::Z * 0.4, Vec3::X * 0.4);
    assert!(off(world.middle(RayProgram::Whitted, whitted), bare) > 1e-3, "control: a whole pane");
    // All of the pane is cut out.
    world.scene.geometry.colors = vec![Vec4::new(1.0, 1.0, 1.0, 0.0); world.scene.geometry.positions.len()];
    let shade = &mut world.shades[pane as usize];
    (shade.vertex_colors, shade.alpha_cutoff) = (true, Some(0.5));
    assert_eq!(world.middle(RayProgram::Whitted, whitted), bare);
}

#[test]
fn mirrors_show_what_they_mirror_and_glass_of_index_1_is_not_there() {
    let mut world = World::yard();
    world.beyond = Vec3::new(0.1, 0.2, 0.4);
    let whitted = params(RayProgram::Whitted);
    let bare = world.run(RayProgram::Whitted, whitted);
    // A pane, and a body of glass that does not refract, in front of the whole picture.
    let before = world.eye.lerp(world.target, 0.1);
    let axis = (world.target - world.eye).normalize();
    let side = axis.cross(Vec3::Y).normalize();
    let up = side.cross(axis);
    for (kind, dims) in [(SurfaceKind::Glass, 1.0_f32), (SurfaceKind::Clear, 0.64)] {
        let mut covered = World { scene: world.scene.clone(), ..World::yard() };
        (covered.beyond, covered.shades, covered.surfaces) =
            (world.beyond, world.shades.clone(), world.surfaces.clone());
        let pane = covered.material(Vec3::ONE, kind);
        covered.quad(pane, before, side, up);
        covered.quad(pane, before + axis * 0.05, -side, up);
        let image = covered.run(RayProgram::Whitted, RayParams { index: 1.0, ..whitted });
        // The pane's own shadow falls behind the camera.
        let worst = bare
            .pixels
            .iter()
            .zip(&image.pixels)
            .map(|(bare, seen)| off(Vec4::from_array(*seen).truncate(), Vec4::from_array(*bare).truncate() * dims));
        let differ = worst.filter(|worst| *worst > 1e-5).count();
        println!("{kind:?}: {differ} pixels differ");
        assert!(differ <= 4, "{kind:?}: {differ}");
        let bent = covered.run(RayProgram::Whitted, RayParams { index: 1.5, ..whitted });
        let moved = bent.pixels.iter().zip(&image.pixels).filter(|(a, b)| a != b).count();
        assert_eq!(moved > 1000, kind == SurfaceKind::Glass, "control: an index of 1.5: {moved}");
    }
    // A floor that is a mirror, seen from above, shows the sky a fifth darker.
    let mut mirror = floor(Vec3::ONE);
    (mirror.surfaces[0], mirror.beyond) = (SurfaceKind::Metal, world.beyond);
    mirror.sun = world.sun;
    let found = mirror.middle(RayProgram::Whitted, whitted);
    assert!(off(found, world.beyond * 0.8) < 1e-6, "{found}");
    // After the last bounce everything is black.
    assert_eq!(mirror.middle(RayProgram::Whitted, RayParams { depth: 0, ..whitted }), Vec3::ZERO);
}

/// A half plane between a floor and a rectangular light. The light is hidden in the umbra and wholly visible far away.
/// In between, the visible share changes steadily from 0 to 1.
#[test]
fn a_rectangular_light_has_a_penumbra_whose_mean_is_the_share_that_is_seen() {
    let mut world = floor(Vec3::ONE);
    let wall = world.material(Vec3::ZERO, SurfaceKind::Painted);
    // The half plane x < 0 at height 1, below a light of width 1 at height 2. From a point of the floor at x, the part of the light
    // with x-coordinates q > -x is visible.
    world.quad(wall, Vec3::new(-25.0, 1.0, 0.0), Vec3::Z * 50.0, Vec3::X * 25.0);
    world.eye = Vec3::new(0.0, 0.9, 0.0);
    world.lamp = Some(Lamp { position: Vec3::new(0.0, 2.0, 0.0), color: Vec3::ONE });
    let camera = CameraParams { light_width: 1.0, light_depth: 1e-3, ambient: 0.0, ..CameraParams::default() };
    let image = world.run(RayProgram::Whitted, RayParams { samples: 1024, ..with(RayProgram::Whitted, camera) });
    let drawn = World {
        lamp: None,
        ..World { scene: world.scene.clone(), shades: world.shades.clone(), ..World::seen(world.eye, world.target) }
    }
    .drawn();
    let mut worst = 0.0_f64;
    for (index, pixel) in image.pixels.iter().enumerate() {
        let at = Vec4::from_array(drawn.position[index]).truncate().as_dvec3();
        // Sum over points q of the light. The ray from `at` passes to the right of the edge where x + (q - x) / 2 > 0,
        // so q > -x.
        let steps = 2000;
        let shares = (0..steps).map(|step| {
            let q = glam::DVec3::new((f64::from(step) + 0.5) / f64::from(steps) - 0.5, 2.0, 0.0);
            let seen = at.x + (q.x - at.x) * 0.5 > 0.0;
            if seen { (q - at).normalize().y } else { 0.0 }
        });
        let middle = (glam::DVec3::new(0.0, 2.0, 0.0) - at).normalize().y;
        let expected = middle * shares.sum::<f64>() / f64::from(steps);
        worst = worst.max((f64::from(pixel[0]) - expected).abs());
    }
    println!("worst {worst:.1e}");
    // The pixel is 0.009 wide, and the share changes by 1 for each unit.
    assert!(worst < 6e-3, "{worst}");
    let hard = world.run(
        RayProgram::Whitted,
        with(RayProgram::Whitted, CameraParams { light_width: 0.0, light_depth: 0.0, ..camera }),
    );
    let differ = hard.pixels.iter().zip(&image.pixels).filter(|(a, b)| (a[0] - b[0]).abs() > 0.1).count();
    assert!(differ > 1000, "control: a point has no penumbra: {differ}");
}

/// A room with a lamp, mirrors and glass. Paths that sample the lamp, and paths that hit it by chance, estimate the
/// same picture.
#[test]
fn paths_that_ask_for_the_lamp_and_paths_that_meet_it_agree() {
    let mut world = World::seen(Vec3::new(0.0, 1.0, 0.95), Vec3::new(0.0, 0.9, -1.0));
    let [grey, red] =
        [Vec3::splat(0.4), Vec3::new(0.5, 0.3, 0.2)].map(|color| world.material(color, SurfaceKind::Painted));
    let lamp = world.material(Vec3::ONE, SurfaceKind::Light);
    let glass = world.material(Vec3::ONE, SurfaceKind::Glass);
    let metal = world.material(Vec3::ONE, SurfaceKind::Metal);
    world.cuboid(grey, Vec3::Y, Vec3::ONE, true);
    world.cuboid(red, Vec3::new(-0.5, 0.3, -0.4), Vec3::new(0.2, 0.3, 0.2), false);
    world.cuboid(glass, Vec3::new(0.45, 0.9, -0.2), Vec3::new(0.2, 0.2, 0.2), false);
    world.cuboid(metal, Vec3::new(0.2, 0.2, -0.7), Vec3::new(0.2, 0.2, 0.1), false);
    world.quad(lamp, Vec3::new(0.0, 1.99, 0.0), Vec3::X * 0.5, Vec3::Z * 0.5);
    let camera = CameraParams { light_width: 1.0, light_depth: 1.0, radiance: 2.0, ..CameraParams::default() };
    let paths = RayParams { samples: 256, depth: 12, ..with(RayProgram::PathTracing, camera) };
    // Means over blocks of pixels, which reduce the remaining noise.
    let means = |image: &Image| {
        let mut blocks = vec![0.0_f64; 64];
        for (index, pixel) in image.pixels.iter().enumerate() {
            let (x, y) = (index % SIDE as usize / 12, index / SIDE as usize / 12);
            blocks[y * 8 + x] += f64::from(pixel[0] + pixel[1] + pixel[2]) / (3.0 * 144.0);
        }
        blocks
    };
    let rms =
        |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
    let met = means(&world.run(RayProgram::PathTracing, paths));
    world.lamp = Some(Lamp { position: Vec3::new(0.0, 1.99, 0.0), color: Vec3::ONE });
    let asked = means(&world.run(RayProgram::PathTracing, paths));
    let mean = met.iter().sum::<f64>() / 64.0;
    let off = rms(&met, &asked);
    println!("mean {mean:.4}, blocks differ by {off:.4}");
    assert!(off < 0.02 * mean, "{off} {mean}");
    let fewer = rms(&met, &means(&world.run(RayProgram::PathTracing, RayParams { depth: 1, ..paths })));
    assert!(fewer > 4.0 * off, "control: one bounce: {fewer}");
}

#[test]
fn what_is_missing_is_refused_by_name() {
    let world = World::yard();
    let (scene, filters) = (Arc::new(world.scene.clone()), world.filters());
    let job = world.job(&scene, RayProgram::Whitted, params(RayProgram::Whitted), &filters);
    let refused = |job: &RayJob<'_>| {
        let mut rays = CpuRays::new();
        rays.build(&scene, &filters).expect("a structure");
        rays.run(job, &mut Image::filled(job.width, job.height, [0.0; 4]), &Progress::default())
            .unwrap_err()
            .to_string()
    };
    assert!(refused(&RayJob { from_camera: None, ..job }).contains("its rays start at the camera"));
    assert!(refused(&RayJob { fidelity: Fidelity::Thesis, ..job }).contains("--fidelity corrected"));
    let start = job.from_camera.expect("one");
    let short = FromCamera { surfaces: &world.surfaces[1..], ..start };
    assert!(refused(&RayJob { from_camera: Some(short), ..job }).contains("`surfaces` has 2 entries for 3 materials"));
}
