//! `refraction` and `final` with glass as defined by each material: the source of the device programs, compiled for the host with a tracer
//! that tests all triangles, compared with the processor's programs.

use super::caustics::{lens_words, photon_words};
use super::lights;
use super::spheres::sphere_words;
use super::{compiled_with, light_words, run, words};
use curitiba_cuda::focused::FocusedTables;
use curitiba_cuda::layout::{ASKS_FOCUSED, ASKS_STRAIGHT, NO_TEXTURE};
use curitiba_cuda::scene::{emissions, lights, shades};
use curitiba_cuda::sobol_table;
use curitiba_cuda::spheres::Packed;
use curitiba_cuda::ways::WayTables;
use curitiba_passes::adaptive::Sampling;
use curitiba_passes::cpu::{self, FindsFocused};
use curitiba_passes::effects::dielectric::Variant;
use curitiba_passes::effects::{LightTable, Preparation, open_shares};
use curitiba_passes::sampling::HemisphereSampler;
use curitiba_passes::trace::{Bvh, Hit, Quality, Ray, SphereTree, SurfacePoint, Tracer, WithSpheres};
use curitiba_pipeline::backend::{Glow, Light, NO_TRIANGLE, PixelCone, RayCounts, RayJob, Shade, Sun};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, GlassRule, GlassShadow, PathLimits, Shape};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, Fresnel, RayParams, RayProgram, Sampler, TextureLod};
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Batch, Geometry, Material, RenderScene, Sphere, TriangleRanges};
use glam::{Vec2, Vec3, Vec4};
use std::path::Path;

pub(crate) const SIZE: u32 = 28;
pub(crate) const PIXELS: usize = (SIZE * SIZE) as usize;
const BEYOND: Vec3 = Vec3::new(0.2, 0.5, 0.9);

/// A scene, the optical data of its materials, and the camera.
pub(crate) struct Scene {
    scene: RenderScene,
    dielectrics: Vec<Dielectric>,
    diffuse: Vec<Vec3>,
    /// The sky's colour and texture, for materials that are a sky.
    sky: Vec<Option<Glow>>,
    /// A material that is cut out where the texture's alpha is low.
    cut_out: Option<usize>,
    eye: Vec3,
    target: Vec3,
}

impl Scene {
    pub(crate) fn new(eye: Vec3, target: Vec3) -> Self {
        // Random texels: no mip level of this texture is like another.
        let texels =
            (0..64 * 48_u32).map(|i| [i, i * i, i * 7, 0].map(|code| (code.wrapping_mul(0x9e37_79b9) >> 24) as u8));
        let texture = Texture::new("random".to_owned(), 64, 48, texels.collect());
        let scene = RenderScene { textures: vec![texture], ..RenderScene::default() };
        Self { scene, dielectrics: Vec::new(), diffuse: Vec::new(), sky: Vec::new(), cut_out: None, eye, target }
    }

    /// Adds triangles with a new material and their own vertices; `normal` gives the normal of a corner from its position and the flat
    /// normal.
    pub(crate) fn add(
        &mut self,
        what: Dielectric,
        diffuse: Vec3,
        triangles: &[[Vec3; 3]],
        normal: impl Fn(Vec3, Vec3) -> Vec3,
    ) {
        let geometry = &mut self.scene.geometry;
        let (first, material) = (geometry.triangles.len() as u32, self.dielectrics.len() as u32);
        for corners in triangles {
            let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let vertex = geometry.positions.len() as u32;
            geometry.positions.extend(corners);
            geometry.normals.extend(corners.map(|corner| normal(corner, flat)));
            geometry
                .texcoords
                .extend(corners.map(|corner| Vec2::new(corner.x + 0.3 * corner.y, corner.z - 0.2 * corner.y)));
            geometry.triangles.push([vertex, vertex + 1, vertex + 2]);
        }
        geometry.batches.push(Batch { material, first, count: triangles.len() as u32 });
        self.scene.materials.push(Material::default());
        self.dielectrics.push(what);
        self.diffuse.push(diffuse);
        self.sky.push(None);
    }

    /// Adds triangles of a new material that is a sky.
    fn add_sky(&mut self, glow: Glow, triangles: &[[Vec3; 3]]) {
        self.add(Dielectric::default(), Vec3::ZERO, triangles, flat);
        self.sky[self.diffuse.len() - 1] = Some(glow);
        self.scene.materials[self.diffuse.len() - 1].sky = true;
        self.scene.geometry.sky = TriangleRanges::of_triangles(&self.scene.geometry, &self.scene.skies());
    }

    /// Adds exact spheres, each with a new material. All triangles must be added before, because spheres come behind them.
    pub(crate) fn add_spheres(&mut self, spheres: &[(Dielectric, Vec3, Sphere)]) {
        for (what, diffuse, sphere) in spheres {
            let material = self.dielectrics.len() as u32;
            self.scene.geometry.spheres.push(Sphere { material, ..*sphere });
            self.scene.materials.push(Material::default());
            self.dielectrics.push(*what);
            self.diffuse.push(*diffuse);
            self.sky.push(None);
        }
    }

    /// The same scene seen from elsewhere.
    pub(crate) fn seen(self, eye: Vec3, target: Vec3) -> Self {
        Self { eye, target, ..self }
    }

    /// The same scene with holes in this material.
    pub(crate) fn cut_out(self, material: usize) -> Self {
        Self { cut_out: Some(material), ..self }
    }

    /// The same scene, whose glass materials are changed by `change`, which gets the material's number.
    pub(crate) fn of_glass(mut self, change: impl Fn(usize, &mut Dielectric)) -> Self {
        let glass = self.dielectrics.iter_mut().enumerate().filter(|(_, what)| what.shape != Shape::Opaque);
        glass.for_each(|(material, what)| change(material, what));
        self
    }

    /// The material of a triangle or sphere.
    fn material_of(&self, id: u32) -> u32 {
        let geometry = &self.scene.geometry;
        geometry.sphere(id).map_or_else(|| geometry.material_of(id), |sphere| sphere.material)
    }

    fn is_glass(&self, id: u32) -> bool {
        self.dielectrics[self.material_of(id) as usize].shape != Shape::Opaque
    }

    /// The processor's tree over the triangles.
    pub(crate) fn tree(&self) -> Bvh {
        Bvh::build(&self.scene.geometry, &vec![true; self.dielectrics.len()], Quality::default())
    }

    pub(crate) fn is_sphere(&self, id: u32) -> bool {
        self.scene.geometry.sphere(id).is_some()
    }
}

/// A box whose outer faces are counter-clockwise.
pub(crate) fn cuboid(low: Vec3, high: Vec3) -> Vec<[Vec3; 3]> {
    let corner = |i: usize| {
        Vec3::new(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).map(|ids| ids.map(corner)).collect()
}

/// A triangulated sphere.
fn ball(center: Vec3, radius: f32) -> Vec<[Vec3; 3]> {
    let (rings, sectors) = (10, 16);
    let at = |ring: u32, sector: u32| {
        let (polar, azimuth) = (
            std::f32::consts::PI * ring as f32 / rings as f32,
            std::f32::consts::TAU * (sector % sectors) as f32 / sectors as f32,
        );
        center + radius * Vec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin())
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for sector in 0..sectors {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            if ring > 0 {
                triangles.push([a, b, d]);
            }
            if ring + 1 < rings {
                triangles.push([a, d, c]);
            }
        }
    }
    triangles
}

pub(crate) fn flat(_: Vec3, normal: Vec3) -> Vec3 {
    normal
}

pub(crate) fn solid(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, filter: Vec3::ONE, ..Dielectric::default() }
}

/// A tinted ball with water in it, a veiled box that overlaps another of a higher priority, an absorbing wall and a pane, over a floor.
pub(crate) fn several() -> Scene {
    with_several(Scene::new(Vec3::new(0.3, 1.4, 5.0), Vec3::new(0.0, 0.7, 0.0)))
}

/// [`several`] under a sky of pictures that contains a cloud. A second sky lies on the faces of a box. It is added later, and at equal distances
/// the faces of the box are seen.
pub(crate) fn under_a_sky() -> Scene {
    let mut scene = Scene::new(Vec3::new(0.3, 1.4, 5.0), Vec3::new(0.0, 0.7, 0.0));
    let picture = Glow { color: Vec3::new(0.6, 0.8, 1.0), texture: Some(0) };
    scene.add_sky(picture, &cuboid(Vec3::splat(-30.0), Vec3::splat(31.0)));
    let cloud = Glow { color: Vec3::new(2.0, 1.5, 1.0), texture: None };
    scene.add_sky(cloud, &cuboid(BOX[0], BOX[1]));
    let mut scene = with_several(scene);
    scene.add_sky(cloud, &cuboid(Vec3::new(-9.0, 2.0, -9.0), Vec3::new(-3.0, 2.5, 12.0)));
    scene
}

/// A box of [`several`].
const BOX: [Vec3; 2] = [Vec3::new(-0.4, 0.1, -2.5), Vec3::new(0.4, 1.6, -2.0)];

fn with_several(mut scene: Scene) -> Scene {
    let opaque = Dielectric::default();
    scene.add(opaque, Vec3::new(0.8, 0.7, 0.5), &cuboid(Vec3::new(-6.0, -0.5, -6.0), Vec3::new(6.0, 0.0, 6.0)), flat);
    scene.add(opaque, Vec3::new(0.9, 0.1, 0.2), &cuboid(BOX[0], BOX[1]), flat);
    let center = Vec3::new(-1.2, 1.0, 0.0);
    let round = move |corner: Vec3, _: Vec3| (corner - center).normalize();
    let tinted = Dielectric { extinction: Vec3::new(0.1, 0.4, 0.9), ..solid(1.5) };
    scene.add(tinted, Vec3::ONE, &ball(center, 0.9), round);
    scene.add(solid(1.33), Vec3::ONE, &ball(center, 0.6), round);
    let filter = Vec3::new(0.9, 1.0, 0.8);
    let veiled = Dielectric { veil: 0.3, filter, priority: 1, transmission_texture: Some(0), ..solid(1.8) };
    scene.add(veiled, Vec3::splat(0.6), &cuboid(Vec3::new(0.6, 0.1, -0.5), Vec3::new(1.4, 1.3, 0.4)), flat);
    scene.add(solid(1.2), Vec3::ONE, &cuboid(Vec3::new(1.1, 0.2, -0.3), Vec3::new(2.0, 0.9, 0.2)), flat);
    let wall = Dielectric {
        shape: Shape::Thin,
        index: 1.5,
        thickness: 0.2,
        extinction: Vec3::new(2.0, 0.5, 0.1),
        filter: Vec3::new(1.0, 0.8, 0.9),
        ..Dielectric::default()
    };
    let upright = |x: f32, z: f32| {
        let at = |x: f32, y: f32| Vec3::new(x, y, z);
        [[at(x, 0.1), at(x + 0.9, 0.1), at(x + 0.9, 1.8)], [at(x, 0.1), at(x + 0.9, 1.8), at(x, 1.8)]]
    };
    scene.add(wall, Vec3::ONE, &upright(-0.3, 1.2), flat);
    let pane = Dielectric { shape: Shape::Pane, index: 1.5, filter: Vec3::ONE, ..Dielectric::default() };
    scene.add(pane, Vec3::ONE, &upright(0.7, 1.4), flat);
    scene
}

/// The camera in water, in a room.
pub(crate) fn under_water() -> Scene {
    let mut scene = Scene::new(Vec3::new(0.1, 0.2, 0.3), Vec3::new(-0.3, 0.4, -1.0));
    scene.add(
        Dielectric::default(),
        Vec3::new(0.9, 0.8, 0.4),
        &cuboid(Vec3::new(-4.0, -2.0, -3.5), Vec3::new(4.0, -1.0, -3.0)),
        flat,
    );
    let water = Dielectric { extinction: Vec3::new(0.5, 0.2, 0.05), ..solid(1.33) };
    scene.add(water, Vec3::ONE, &cuboid(Vec3::splat(-1.0), Vec3::splat(1.0)), flat);
    scene.add(solid(1.5), Vec3::ONE, &cuboid(Vec3::new(-0.9, 0.0, -0.8), Vec3::new(-0.3, 0.7, -0.2)), flat);
    scene
}

/// Extinction of the water around the camera of [`among_things_under_water`], and of the vessel around the water.
const WATER: Vec3 = Vec3::new(0.5, 0.2, 0.05);
const VESSEL: Vec3 = Vec3::new(0.02, 0.1, 0.6);

/// The camera in water in a vessel of glass, before a wall and a ball that are in the water too.
fn among_things_under_water() -> Scene {
    let mut scene = Scene::new(Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.3, 0.0, -1.0));
    let block = |half: f32| cuboid(Vec3::splat(-half), Vec3::splat(half));
    scene.add(Dielectric { extinction: VESSEL, ..solid(1.5) }, Vec3::ONE, &block(1.6), flat);
    scene.add(Dielectric { extinction: WATER, ..solid(1.33) }, Vec3::ONE, &block(1.4), flat);
    let opaque = Dielectric::default();
    let wall = cuboid(Vec3::new(-1.0, -1.1, -1.2), Vec3::new(0.5, 1.2, -1.0));
    scene.add(opaque, Vec3::new(0.8, 0.7, 0.5), &wall, flat);
    let center = Vec3::new(0.3, -0.2, -0.2);
    let round = move |corner: Vec3, _: Vec3| (corner - center).normalize();
    scene.add(opaque, Vec3::new(0.3, 0.9, 0.6), &ball(center, 0.35), round);
    scene.add(opaque, Vec3::ONE, &cuboid(Vec3::new(-4.0, -2.5, -4.0), Vec3::new(4.0, -2.0, 4.0)), flat);
    scene
}

pub(crate) struct GBuffer {
    position: Vec<[f32; 4]>,
    normal: Vec<[f32; 4]>,
    color: Vec<[f32; 4]>,
    pub(crate) triangle: Vec<u32>,
}

pub(crate) fn rasterised(scene: &Scene, tree: &impl Tracer) -> GBuffer {
    let geometry: &Geometry = &scene.scene.geometry;
    let forward = (scene.target - scene.eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let mut seen = GBuffer { position: Vec::new(), normal: Vec::new(), color: Vec::new(), triangle: Vec::new() };
    for pixel in 0..SIZE * SIZE {
        let [x, y] = [pixel % SIZE, pixel / SIZE].map(|i| (i as f32 + 0.5) / SIZE as f32 - 0.5);
        let direction = (forward + right * x - up * y).normalize();
        let ray = Ray { origin: scene.eye, direction, t_min: 0.0, t_max: f32::INFINITY };
        // Where the camera sees a sky, only the colour is written.
        let shown = tree.closest(&ray, |_: &Hit| true).filter(|hit| !geometry.sky.contains(hit.triangle));
        let Some(hit) = shown else {
            seen.position.push([0.0; 4]);
            seen.normal.push([0.0; 4]);
            seen.color.push(BEYOND.extend(1.0).to_array());
            seen.triangle.push(NO_TRIANGLE);
            continue;
        };
        let color = (0.7 * scene.diffuse[scene.material_of(hit.triangle) as usize]).extend(1.0).to_array();
        seen.color.push(color);
        seen.triangle.push(hit.triangle);
        if let Some(sphere) = geometry.sphere(hit.triangle) {
            let point = SurfacePoint::on_sphere_by(sphere, &ray, hit.t);
            seen.position.push(point.position.extend(1.0).to_array());
            seen.normal.push(point.normal.extend(0.0).to_array());
            continue;
        }
        let at = |values: &[Vec3]| {
            let [a, b, c] = geometry.triangles[hit.triangle as usize].map(|vertex| values[vertex as usize]);
            a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
        };
        seen.position.push(at(&geometry.positions).extend(1.0).to_array());
        seen.normal.push(at(&geometry.normals).normalize().extend(0.0).to_array());
    }
    seen
}

/// The parameters of a program.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub program: RayProgram,
    pub fresnel: Fresnel,
    pub shadow: GlassShadow,
    pub depth: u32,
    pub lod: TextureLod,
    /// Lights that replace the directional one: several lights, or one with a place.
    pub lights: &'a [Light],
    /// Diameter of directional lights' discs in degrees; 0 for points.
    pub sun: f32,
    /// Occlusion rays of a point; 0 for none.
    pub samples: u32,
    /// For a batch of the Sobol sequences: the number of points before it. `None`: the occlusion rays are stratified, and their number is a square.
    pub after: Option<u32>,
    /// All glass is panes, whatever the materials say.
    pub panes: bool,
    /// Number of photons that are shot at meshes, and the radius over which they are averaged, which is chosen where it is 0.
    pub photons: (u32, f32),
    /// How paths are divided and cut off.
    pub divided: Divided,
}

/// The number of ways into which rough glass and the spectrum divide a path, the limits that cut it off, and the seed of the random numbers.
#[derive(Clone, Copy)]
pub(crate) struct Divided {
    pub paths: u32,
    pub wavelengths: u32,
    pub limits: PathLimits,
    pub seed: u32,
}

/// A path is neither divided nor cut off.
pub(crate) const WHOLE: Divided = Divided { paths: 1, wavelengths: 1, limits: PathLimits::DEFAULT, seed: 0 };

/// The largest difference of a colour, the number of ray kinds whose counts differ, and the number of pixels that show glass.
pub(crate) fn differences(program: &Path, scene: &Scene, asked: Asked<'_>) -> (f32, usize, usize) {
    let (mut largest, mut shown) = (0.0_f32, 0);
    let differ = each_pixel(program, scene, asked, |seen, pixel, [found, expected]| {
        let difference = (found - expected).abs();
        largest = if difference.is_nan() { f32::INFINITY } else { largest.max(difference.max_element()) };
        let triangle = seen.triangle[pixel];
        shown += usize::from(triangle != NO_TRIANGLE && scene.is_glass(triangle));
    });
    (largest, differ, shown)
}

/// Hands each pixel, with what the device program and the processor compute there, to `visit`. Returns the number of ray kinds whose counts
/// differ.
pub(crate) fn each_pixel(
    program: &Path,
    scene: &Scene,
    asked: Asked<'_>,
    visit: impl FnMut(&GBuffer, usize, [Vec3; 2]),
) -> usize {
    let (geometry, triangles) = (&scene.scene.geometry, &scene.tree());
    if geometry.spheres.is_empty() {
        return each_pixel_on(triangles, program, scene, asked, visit);
    }
    let spheres = &SphereTree::build(geometry, &vec![true; scene.dielectrics.len()]);
    each_pixel_on(&WithSpheres { triangles, spheres }, program, scene, asked, visit)
}

fn each_pixel_on<T: Tracer>(
    tree: &T,
    program: &Path,
    scene: &Scene,
    asked: Asked<'_>,
    mut visit: impl FnMut(&GBuffer, usize, [Vec3; 2]),
) -> usize {
    let seen = rasterised(scene, tree);
    with_job(scene, &seen, asked, |job| {
        let mut expected = Image::filled(SIZE, SIZE, [0.0; 4]);
        let stats = cpu::trace(tree, job, &mut expected, &Progress::default()).expect("the job is whole");
        each_pixel_of(program, job, (&expected, stats.rays), |pixel, colors| visit(&seen, pixel, colors))
    })
}

/// Hands the job over a scene's G-buffer to `run`.
pub(crate) fn with_job<R>(scene: &Scene, seen: &GBuffer, asked: Asked<'_>, run: impl FnOnce(&RayJob<'_>) -> R) -> R {
    let shade = |material: usize| {
        if scene.sky[material].is_some() {
            return Shade { diffuse: Vec4::W, glow: scene.sky[material], ..Shade::default() };
        }
        let alpha_cutoff = (scene.cut_out == Some(material)).then_some(0.5);
        let is_opaque = scene.dielectrics[material].shape == Shape::Opaque;
        let texture = (is_opaque || alpha_cutoff.is_some()).then_some(0);
        let emission = if asked.lights.is_empty() { Vec4::ZERO } else { Vec4::new(0.2, 0.1, 0.0, 0.0) };
        Shade { diffuse: scene.diffuse[material].extend(1.0), texture, emission, alpha_cutoff, ..Shade::default() }
    };
    let shades: Vec<Shade> = (0..scene.diffuse.len()).map(shade).collect();
    let glass: Vec<bool> = scene.dielectrics.iter().map(|dielectric| dielectric.shape != Shape::Opaque).collect();
    let sun = Sun { direction: Vec3::new(-0.4, -0.8, -0.5).normalize(), color: Vec3::new(0.9, 0.8, 0.7) };
    let params = RayParams {
        samples: asked.samples,
        sampler: if asked.after.is_some() { Sampler::Sobol } else { Sampler::Strata },
        first: asked.after.unwrap_or(0),
        first_sun: asked.after.unwrap_or(0),
        radius: 1.3,
        index: 1.1,
        depth: asked.depth,
        fresnel: asked.fresnel,
        shadow: asked.shadow,
        glass: if asked.panes { GlassRule::Pane } else { GlassRule::Auto },
        texture_lod: asked.lod,
        sun: asked.sun,
        sun_samples: 5,
        paths: asked.divided.paths,
        wavelengths: asked.divided.wavelengths,
        photons: asked.photons.0,
        photon_radius: asked.photons.1,
        limits: asked.divided.limits,
        ..RayParams::default()
    };
    let job = RayJob {
        from_camera: None,
        origin: [0; 2],
        scene: &scene.scene,
        program: asked.program,
        params,
        fidelity: Fidelity::Corrected,
        seed: asked.divided.seed,
        eye: scene.eye,
        cone: PixelCone { width: 0.0, spread: 1.0 / SIZE as f32 },
        lights: asked.lights,
        sun: asked.lights.is_empty().then_some(sun),
        width: SIZE,
        height: SIZE,
        position: &seen.position,
        normal: &seen.normal,
        color: &seen.color,
        triangle: &seen.triangle,
        shared: None,
        shades: &shades,
        glass: &glass,
        shadow_glass: &glass,
        beyond: BEYOND,
        dielectrics: if asked.panes { &[] } else { &scene.dielectrics },
    };
    run(&job)
}

/// Hands each pixel of a job to `visit`, with the results of the device program and of the processor. Returns the number of ray kinds whose
/// counts differ.
pub(crate) fn each_pixel_of(
    program: &Path,
    job: &RayJob<'_>,
    (expected, rays): (&Image, RayCounts),
    mut visit: impl FnMut(usize, [Vec3; 2]),
) -> usize {
    let found = pixels_of(program, job, Sampling::All);
    assert_eq!(found.len(), expected.pixels.len());
    let mut counts = [0_u64; 4];
    for (pixel, (found, expected)) in found.iter().zip(&expected.pixels).enumerate() {
        let color = Vec3::from([0, 1, 2].map(|channel| f32::from_bits(found[channel])));
        visit(pixel, [color, Vec3::from_slice(expected)]);
        counts.iter_mut().zip(&found[4..]).for_each(|(count, found)| *count += u64::from(*found));
    }
    // Shadow rays of `final` are not compared. The processor traces some of a tile's rays to one light together first, and traces those through
    // glass again; it also lights surfaces that add nothing to the pixel.
    let shadow = if job.program == RayProgram::Final { counts[3] } else { rays.shadow };
    let expected = [rays.reflected, rays.refracted, rays.lost, shadow];
    counts.iter().zip(&expected).filter(|(a, b)| a != b).count()
}

/// For each pixel of a job that a host program runs: the four channels of its colour, and the rays that are reflected, refracted, lost, and
/// traced to the light.
pub(crate) fn pixels_of(program: &Path, job: &RayJob<'_>, sampling: Sampling<'_>) -> Vec<[u32; 8]> {
    run(program, "", &serialised(job, sampling)).as_chunks().0.to_vec()
}

/// A job as a host program reads it: each triangle has corners of its own.
fn serialised(job: &RayJob<'_>, sampling: Sampling<'_>) -> Vec<u32> {
    let geometry = &job.scene.geometry;
    let corners = || geometry.triangles.iter().flatten().map(|vertex| *vertex as usize);
    let mut input = vec![geometry.triangles.len() as u32];
    input.extend(words(corners().map(|vertex| geometry.positions[vertex])));
    input.extend(words(corners().map(|vertex| geometry.normals[vertex])));
    let texcoord = |vertex: usize| geometry.texcoords.get(vertex).copied().unwrap_or_default();
    input.extend(corners().flat_map(|vertex| texcoord(vertex).to_array()).map(f32::to_bits));
    input.extend(geometry.materials());
    let none = Texture::new("none".to_owned(), 1, 1, vec![[0; 4]]);
    let texture = job.scene.textures.first().unwrap_or(&none);
    let texels = texture.levels.iter().flat_map(|level| &level.texels);
    input.extend([texture.levels[0].width, texture.levels[0].height, texels.clone().count() as u32]);
    input.extend(texels.map(|texel| u32::from_le_bytes(*texel)));
    // Where all glass is panes, the optical data of materials is not read.
    let none = vec![Dielectric::default(); job.shades.len()];
    let dielectrics = if job.dielectrics.is_empty() { &none[..] } else { job.dielectrics };
    input.push(dielectrics.len() as u32);
    for (dielectric, shade) in dielectrics.iter().zip(shades(job)) {
        input.push(dielectric.shape as u32);
        input.push(dielectric.index.to_bits());
        input.extend(words([dielectric.extinction, dielectric.filter]));
        input.extend([dielectric.veil, dielectric.thickness].map(f32::to_bits));
        input.push(dielectric.priority.into());
        input.push(dielectric.transmission_texture.unwrap_or(NO_TEXTURE));
        input.extend(shade.diffuse.map(f32::to_bits));
        input.extend([shade.texture, shade.flags, shade.cutoff.to_bits()]);
        input.extend(shade.glow.map(f32::to_bits));
        input.push(shade.glow_texture);
    }
    let sun = job.sun.unwrap_or(Sun { direction: Vec3::ZERO, color: Vec3::ZERO });
    input.extend([job.params.index.to_bits(), job.params.depth]);
    input.push(job.params.fresnel as u32);
    let transparent = vec![true; job.shades.len()];
    let focused = FindsFocused::new(&transparent).of("host", job, &Progress::default()).expect("few spheres");
    let lenses = FocusedTables::of(job, &focused);
    let straight = matches!(job.params.shadow, GlassShadow::Straight | GlassShadow::Caustic);
    input.push(if straight { ASKS_STRAIGHT } else { 0 } | if lenses.is_some() { ASKS_FOCUSED } else { 0 });
    let asks = job.texture_lod() == TextureLod::Cones;
    input.extend([job.cone.width, job.cone.spread].map(|number| if asks { number.to_bits() } else { 0 }));
    input.extend(words([job.beyond, job.eye, -sun.direction, sun.color]));
    let table = LightTable::of(job).unwrap_or(LightTable { lights: Vec::new(), hidden: 0.0 });
    let lights = lights(&table.lights);
    input.push(lights.len() as u32);
    input.extend(lights.iter().flat_map(light_words));
    input.extend(emissions(job).into_iter().map(f32::to_bits));
    let Preparation { sampler, disc, .. } = Preparation::of(job).expect("few samples");
    let (height, points) = disc.as_ref().map_or((0.0, &[][..]), |disc| (disc.height(), disc.points()));
    input.extend([table.hidden.to_bits(), height.to_bits(), points.len() as u32]);
    input.extend(points.as_flattened());
    input.extend([job.width, job.height]);
    for pixel in 0..job.triangle.len() {
        let vectors = [job.position, job.normal, job.color].map(|image| Vec4::from_array(image[pixel]).truncate());
        input.extend(words(vectors));
        input.push(job.triangle[pixel]);
    }
    input.push(u32::from(!job.dielectrics.is_empty()));
    let (side, points) = match sampler {
        Some(HemisphereSampler::Strata { side }) => (side, Vec::new()),
        Some(HemisphereSampler::Sobol(points)) => (0, sobol_table::table(points)),
        None => (0, Vec::new()),
    };
    input.extend([job.params.samples, side, job.params.radius.to_bits(), points.len() as u32]);
    input.extend(points);
    let open = open_shares(job.params.samples, job.params.intensity);
    input.extend(open.into_iter().map(f32::to_bits));
    if Variant::of(job) == Variant::Ways {
        input.push(job.seed);
        input.extend(way_words(&WayTables::of(job, sampling), sampling.list()));
    }
    if !geometry.spheres.is_empty() || lenses.is_some() {
        input.push(u32::from(!geometry.spheres.is_empty()));
    }
    if !geometry.spheres.is_empty() {
        input.extend(sphere_words(&Packed::of(geometry, &transparent)));
        input.push(geometry.spheres.len() as u32);
        input.extend(geometry.spheres.iter().map(|sphere| sphere.material));
    }
    if let Some(lenses) = &lenses {
        input.extend(lens_words(lenses));
        input.extend(photon_words(focused.photons.clouds()));
    }
    input
}

/// The tables of programs that follow ways, as a host program reads them.
fn way_words(tables: &WayTables, samples: &[[u32; 4]]) -> Vec<u32> {
    let WayTables { faces, strata, facets, ways } = tables;
    let mut input = Vec::new();
    for face in faces {
        input.extend([face.spread.to_bits(), face.alpha.to_bits(), face.roughness_texture]);
        input.extend(face.mirrors.into_iter().chain([face.minimum, face.maximum, face.exponent]).map(f32::to_bits));
    }
    input.push(strata.len() as u32 / 4);
    input.extend(strata.iter().copied().map(f32::to_bits));
    input.push(ways.facet_count);
    input.extend(facets);
    input.extend([ways.asks, ways.cutoff.to_bits(), ways.reflections, ways.refractions, ways.chances, ways.offset]);
    input.push(samples.len() as u32);
    input.extend(samples.as_flattened());
    input
}

/// Rounding of the exponential function differs between libraries, and so does the order in which colours are summed.
pub(crate) const ROUNDING: f32 = 2e-5;

fn compiled_program(program: RayProgram, name: &str, change: Option<(&str, [&str; 2])>) -> Option<std::path::PathBuf> {
    let source = if program == RayProgram::Final { "glass_final.cpp" } else { "glass.cpp" };
    compiled_with(source, name, change)
}

#[test]
fn glass_of_the_device_programs_looks_as_on_the_processor() {
    for program in [RayProgram::Refraction, RayProgram::Final] {
        let name = format!("glass-{program:?}");
        let Some(compiled) = compiled_program(program, &name, None) else { return };
        for scene in [several(), under_water(), among_things_under_water(), under_a_sky()] {
            for (fresnel, shadow, depth, lod) in [
                (Fresnel::Exact, GlassShadow::Straight, 5, TextureLod::Zero),
                (Fresnel::Schlick, GlassShadow::Report, 2, TextureLod::Zero),
                (Fresnel::Exact, GlassShadow::Straight, 0, TextureLod::Zero),
                (Fresnel::Exact, GlassShadow::Straight, 3, TextureLod::Cones),
                (Fresnel::Schlick, GlassShadow::Report, 0, TextureLod::Cones),
            ] {
                let asked = Asked { fresnel, depth, lod, ..lights::asked(program, shadow, &[]) };
                let (largest, counts, shown) = differences(&compiled, &scene, asked);
                let what = format!("{program:?}, {fresnel:?}, {shadow:?}, depth {depth}, {lod:?}");
                assert!(largest < ROUNDING && counts == 0, "{what}: {largest}, {counts} counts differ");
                assert!(shown > PIXELS / 5, "{what}: {shown} pixels show glass");
            }
        }
    }
}

#[test]
fn a_wrong_word_of_the_device_programs_is_noticed() {
    let lod = TextureLod::Cones;
    let asked = |program| Asked { depth: 5, lod, ..lights::asked(program, GlassShadow::Straight, &[]) };
    for (program, scene, change) in [
        // Absorption over twice the distance.
        (
            RayProgram::Refraction,
            several(),
            ["(double)(-extinction * length)", "(double)(-extinction * 2.0f * length)"],
        ),
        // The ratio of the indices inverted.
        (
            RayProgram::Refraction,
            several(),
            [
                "index_in(params, border.after) / index_in(params, before)",
                "index_in(params, before) / index_in(params, border.after)",
            ],
        ),
        // Of overlapping bodies with equal priority, the one entered first wins.
        (RayProgram::Refraction, several(), ["priority <= priority) ++place", "priority < priority) ++place"]),
        // The texture is not read.
        (RayProgram::Refraction, several(), ["1.0f - (1.0f - body.veil) * clear", "body.veil"]),
        (RayProgram::Final, several(), ["1.0f - (1.0f - body.veil) * clear", "body.veil"]),
        // Cones do not widen with distance.
        (RayProgram::Refraction, several(), ["cone_along(next.cone, hit.t)", "next.cone"]),
        // The camera is in no body.
        (
            RayProgram::Refraction,
            under_water(),
            ["params.around_eye ? *(const Media *)params.around_eye : no_media()", "no_media()"],
        ),
        // Mirrors and glass see no sky.
        (
            RayProgram::Refraction,
            under_a_sky(),
            ["if (!pass.closest_or_sky(next.origin", "if (!pass.closest(next.origin"],
        ),
        // Shadows use the cosine inside of the body.
        (
            RayProgram::Final,
            several(),
            ["fmaxf(border.ratio, 1.0f / border.ratio)", "fminf(border.ratio, 1.0f / border.ratio)"],
        ),
    ] {
        let Some(compiled) = compiled_program(program, "glass-changed", Some(("bodies.cuh", change))) else { return };
        let (largest, _, _) = differences(&compiled, &scene, asked(program));
        assert!(largest > 1e-3, "{change:?} is not noticed: {largest}");
    }
}

/// What the camera sees directly in the body around it, by the closed form: the colour times exp(-extinction * distance).
#[test]
fn the_body_around_the_camera_absorbs_light_from_what_is_in_it() {
    let (scene, lod) = (among_things_under_water(), TextureLod::Zero);
    let is_right = |program: RayProgram, change: Option<(&str, [&str; 2])>| {
        let source = if program == RayProgram::Final { "glass_final.cpp" } else { "glass.cpp" };
        let compiled = compiled_with(source, &format!("glass-inside-{program:?}"), change)?;
        let asked = Asked { lod, ..lights::asked(program, GlassShadow::Straight, &[]) };
        let (mut opaque, mut off, mut around, mut unlike) = (0, 0.0_f32, 0.0_f32, 0.0_f32);
        each_pixel(&compiled, &scene, asked, |seen, pixel, [found, expected]| {
            let triangle = seen.triangle[pixel];
            if triangle == NO_TRIANGLE || scene.is_glass(triangle) {
                return;
            }
            let [position, color] = [&seen.position, &seen.color].map(|image| Vec3::from_slice(&image[pixel]));
            let way = position.as_dvec3().distance(scene.eye.as_dvec3());
            let of = |extinction: Vec3| color * (-extinction.as_dvec3() * way).map(f64::exp).as_vec3();
            opaque += 1;
            unlike = unlike.max((found - expected).abs().max_element());
            if program == RayProgram::Refraction {
                off = off.max((found - of(WATER)).abs().max_element());
                around = around.max((found - of(VESSEL)).abs().max_element());
            }
        });
        assert!(opaque > PIXELS / 5, "{opaque} pixels show what is in the water");
        let is_control = program == RayProgram::Refraction && change.is_none();
        assert!(!is_control || around > 0.05, "control: the body around the water takes others: {around}");
        Some(off < ROUNDING && unlike < ROUNDING)
    };
    for program in [RayProgram::Refraction, RayProgram::Final] {
        let Some(right) = is_right(program, None) else { return };
        assert!(right, "{program:?}");
    }
    for (program, header, change) in [
        (RayProgram::Final, "final.cuh", ["end.weight = weight_to_eye(pass);", "end.weight = share_of(1.0f);"]),
        (RayProgram::Refraction, "refraction.cuh", ["float3 seen = kept * xyz(color);", "float3 seen = xyz(color);"]),
        (RayProgram::Refraction, "bodies.cuh", ["around->list[around->length - 1]", "around->list[0]"]),
    ] {
        let Some(right) = is_right(program, Some((header, change))) else { return };
        assert!(!right, "{change:?} is not noticed");
    }
}

#[test]
fn a_wrong_word_of_what_is_said_of_a_sky_is_noticed() {
    for (program, header, change) in [
        // The sky wins over a surface at the same distance.
        (
            RayProgram::Refraction,
            "pass.cuh",
            ["float t_max = found ? hit.t : INFINITY;", "float t_max = found ? hit.t * 1.00001f : INFINITY;"],
        ),
        // The sky wins over every surface.
        (RayProgram::Final, "pass.cuh", ["float t_max = found ? hit.t : INFINITY;", "float t_max = INFINITY;"]),
        // The sky is lit.
        (RayProgram::Final, "final.cuh", ["is_black(color) || is_sky(params, triangle)", "is_black(color)"]),
    ] {
        let Some(compiled) = compiled_program(program, "sky-changed", Some((header, change))) else { return };
        let asked = Asked { depth: 5, ..lights::asked(program, GlassShadow::Straight, &[]) };
        let (largest, _, _) = differences(&compiled, &under_a_sky(), asked);
        assert!(largest > 1e-3, "{change:?} is not noticed: {largest}");
    }
}
