//! Small scenes for tests, traced by brute force.

use crate::cpu;
use crate::trace::{BruteForce, Bvh, Quality, Ray, SphereTree, Tracer};
use curitiba_pipeline::backend::{Light, NO_TRIANGLE, NormalMap, PixelCone, RayCounts, RayJob, Shade, Sun};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Batch, Material, RenderScene, Sphere};
use glam::{DVec3, Mat3, Vec2, Vec3, Vec4};

/// A scene under construction, with the material tables that passes take.
#[derive(Default)]
pub struct World {
    pub scene: RenderScene,
    pub shades: Vec<Shade>,
    pub glass: Vec<bool>,
    pub shadow_glass: Vec<bool>,
    pub sun: Option<Sun>,
    /// Several lights, or a positional one, in place of `sun`.
    pub lights: Vec<Light>,
    /// The colour of rays that leave the scene.
    pub beyond: Vec3,
    /// Glass properties by material.
    pub dielectrics: Vec<Dielectric>,
    /// Whether `dielectrics` is used; else all glass is the report's.
    pub bodies: bool,
}

/// The colour of the light that most worlds have.
pub const SUN_COLOR: Vec3 = Vec3::new(0.9, 0.8, 0.7);

impl World {
    /// A world without surfaces, with light that travels in this direction.
    pub fn lit_along(direction: Vec3) -> Self {
        Self { sun: Some(Sun { direction: direction.normalize(), color: SUN_COLOR }), ..Self::default() }
    }

    /// Triangles at random around the origin. Their vertex normals agree with the triangle's, point to the other side,
    /// or have random directions each.
    pub fn scattered() -> Self {
        let mut state = 5_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        let mut world = Self::lit_along(Vec3::new(0.4, -1.0, 0.3));
        let paint = world.paint(Vec3::splat(0.5));
        for index in 0..300 {
            let mut vector = || Vec3::new(random(), random(), random());
            let center = vector() * 4.0;
            let corners = [0, 1, 2].map(|_| center + vector());
            let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(Vec3::Y);
            let bend = [0.2, 0.2, 3.0][index % 3];
            let flat = if index % 2 == 0 { flat } else { -flat };
            world.triangle(paint, corners, [0, 1, 2].map(|_| (flat + vector() * bend).normalize_or(flat)));
        }
        world
    }

    fn material(&mut self, shade: Shade, glass: bool) -> u32 {
        let material = Material { name: format!("material {}", self.shades.len()), ..Material::default() };
        self.scene.materials.push(material);
        self.shades.push(shade);
        self.glass.push(glass);
        self.shadow_glass.push(glass);
        let shape = if glass { Shape::Pane } else { Shape::Opaque };
        self.dielectrics.push(Dielectric { shape, filter: Vec3::ONE, index: 1.5, ..Dielectric::default() });
        self.shades.len() as u32 - 1
    }

    /// An opaque material.
    pub fn paint(&mut self, diffuse: Vec3) -> u32 {
        let shade = Shade { diffuse: diffuse.extend(1.0), ..Shade::default() };
        self.material(shade, false)
    }

    /// Glass, for radiance and shadow rays.
    pub fn glass(&mut self) -> u32 {
        let shade = Shade::default();
        self.material(shade, true)
    }

    /// A material of glass with these properties.
    pub fn dielectric(&mut self, dielectric: Dielectric) -> u32 {
        self.bodies = true;
        let material = self.glass();
        self.dielectrics[material as usize] = dielectric;
        material
    }

    /// Cuts out a material where the first of two texels side by side lies, or everywhere.
    pub fn cut_out(&mut self, material: u32, everywhere: bool) {
        let alpha = if everywhere { 0 } else { 255 };
        let texels = vec![[255, 255, 255, 0], [255, 255, 255, alpha]];
        self.scene.textures.push(Texture::new("holes".to_owned(), 2, 1, texels));
        let shade = &mut self.shades[material as usize];
        shade.texture = Some(self.scene.textures.len() as u32 - 1);
        shade.alpha_cutoff = Some(0.5);
    }

    /// A textured material; `texels` are two texels side by side.
    pub fn picture(&mut self, texels: [[u8; 4]; 2], alpha_cutoff: Option<f32>) -> u32 {
        self.scene.textures.push(Texture::new("picture".to_owned(), 2, 1, texels.to_vec()));
        let texture = Some(self.scene.textures.len() as u32 - 1);
        self.material(
            Shade { diffuse: Vec4::ONE, emission: Vec4::ZERO, texture, alpha_cutoff, ..Shade::default() },
            false,
        )
    }

    /// A triangle; texture coordinates are (0, 0), (1, 0), (0, 1).
    pub fn triangle(&mut self, material: u32, corners: [Vec3; 3], normals: [Vec3; 3]) {
        let geometry = &mut self.scene.geometry;
        let first = geometry.positions.len() as u32;
        geometry.positions.extend(corners);
        geometry.normals.extend(normals);
        geometry.texcoords.extend([Vec2::ZERO, Vec2::X, Vec2::Y]);
        let id = geometry.triangles.len() as u32;
        geometry.triangles.push([first, first + 1, first + 2]);
        match geometry.batches.last_mut() {
            Some(batch) if batch.material == material => batch.count += 1,
            _ => geometry.batches.push(Batch { material, first: id, count: 1 }),
        }
    }

    /// A parallelogram around `center`; `x` and `y` are half its sides, and its winding and normal are those of
    /// `x.cross(y)`. Texture coordinates run from (0, 0) at `center - x - y` to (1, 1).
    pub fn quad(&mut self, material: u32, center: Vec3, x: Vec3, y: Vec3) {
        let normal = x.cross(y).normalize();
        let corners = [center - x - y, center + x - y, center + x + y, center - x + y];
        self.triangle(material, [corners[0], corners[1], corners[3]], [normal; 3]);
        self.triangle(material, [corners[2], corners[3], corners[1]], [normal; 3]);
        let texcoords = &mut self.scene.geometry.texcoords;
        let first = texcoords.len() - 3;
        texcoords[first..].copy_from_slice(&[Vec2::ONE, Vec2::Y, Vec2::X]);
    }

    /// Gives a material a normal map of two texels side by side, and every vertex of the world a tangent. On a quad the
    /// tangent follows the first side and the bitangent the second.
    pub fn bump(&mut self, material: u32, texels: [[u8; 4]; 2], scale: f32) {
        self.scene.textures.push(Texture::new("bumps".to_owned(), 2, 1, texels.to_vec()));
        let texture = self.scene.textures.len() as u32 - 1;
        self.shades[material as usize].normal_map = Some(NormalMap { texture, scale });
        let geometry = &mut self.scene.geometry;
        geometry.tangents = vec![Vec4::ZERO; geometry.positions.len()];
        for triangle in &geometry.triangles {
            let [a, b, c] = triangle.map(|corner| geometry.positions[corner as usize]);
            let [ta, tb, tc] = triangle.map(|corner| geometry.texcoords[corner as usize]);
            let (first, second) = (tb - ta, tc - ta);
            let along = ((b - a) * second.y - (c - a) * first.y) / first.perp_dot(second);
            for corner in triangle.map(|corner| corner as usize) {
                let normal = geometry.normals[corner];
                let tangent = (along - normal * along.dot(normal)).normalize_or(normal.any_orthonormal_vector());
                let side = 1f32.copysign(first.perp_dot(second) * (b - a).cross(c - a).dot(normal));
                geometry.tangents[corner] = tangent.extend(side);
            }
        }
    }

    /// Adds an exact sphere; materials must be added in ascending order.
    pub fn sphere(&mut self, material: u32, center: Vec3, radius: f32) {
        self.scene.geometry.spheres.push(Sphere { center, radius, material });
    }

    /// The tree over the exact spheres, with the alpha test evaluated at every hit.
    pub fn spheres(&self) -> SphereTree {
        SphereTree::build(&self.scene.geometry, &vec![true; self.scene.materials.len()])
    }

    /// The nearest exact sphere along a line, in `f64`: the distance, its id and the point.
    fn nearest_sphere(&self, eye: Vec3, direction: Vec3) -> Option<(f64, u32, DVec3)> {
        let (eye, direction) = (eye.as_dvec3(), direction.as_dvec3().normalize());
        let first = self.scene.geometry.triangles.len() as u32;
        let hits = self.scene.geometry.spheres.iter().zip(first..).filter_map(|(sphere, id)| {
            let (from, radius) = (eye - sphere.center.as_dvec3(), f64::from(sphere.radius));
            let b = -from.dot(direction);
            let square = radius * radius - (from + b * direction).length_squared();
            let half = (square >= 0.0).then(|| square.sqrt())?;
            let t = [b - half, b + half].into_iter().find(|t| *t > 0.0)?;
            Some((t, id, eye + direction * t))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Gives every vertex this normal.
    pub fn bend_normals(&mut self, normal: Vec3) {
        self.scene.geometry.normals.fill(normal.normalize());
    }

    /// Scales, rotates and moves everything, the light included.
    pub fn transform(&mut self, rotation: Mat3, scale: f32, offset: Vec3) {
        let geometry = &mut self.scene.geometry;
        geometry.positions.iter_mut().for_each(|p| *p = rotation * *p * scale + offset);
        geometry.normals.iter_mut().for_each(|n| *n = (rotation * *n).normalize());
        if let Some(sun) = &mut self.sun {
            sun.direction = (rotation * sun.direction).normalize();
        }
    }

    /// The brute-force reference tracer, with the alpha test evaluated at every hit, as in the backend.
    pub fn brute_force(&self) -> BruteForce {
        BruteForce::new(&self.scene.geometry, &vec![true; self.scene.materials.len()])
    }

    /// The tracer of the backend.
    pub fn tree(&self) -> Bvh {
        Bvh::build(&self.scene.geometry, &vec![true; self.scene.materials.len()], Quality::default())
    }

    /// The greatest cosine of a light that arrives at a point.
    fn cosine(&self, point: Vec3, normal: Vec3) -> f32 {
        let arriving = self.lights.iter().map(|light| light.at(point)).filter(|arriving| arriving.factor > 0.0);
        let of_sun = self.sun.map_or(0.0, |sun| normal.dot(-sun.direction).max(0.0));
        arriving.map(|arriving| normal.dot(arriving.towards)).fold(of_sun, f32::max)
    }

    /// The lit colour of a material at this light cosine.
    pub fn lit(&self, material: u32, cos: f32) -> Vec3 {
        let diffuse = self.shades[material as usize].diffuse.truncate();
        diffuse * SUN_COLOR * cos.max(0.0) + 0.3 * diffuse
    }
}

/// The colour of background pixels.
pub const BACKGROUND: [f32; 4] = [0.1, 0.2, 0.4, 0.25];

/// A G-buffer of a world with one pixel for each target.
pub struct Shot<'w> {
    world: &'w World,
    eye: Vec3,
    /// The cone of its pixels; its width is 0 unless a test sets it.
    pub cone: PixelCone,
    width: u32,
    pub position: Vec<[f32; 4]>,
    pub normal: Vec<[f32; 4]>,
    pub color: Vec<[f32; 4]>,
    pub triangle: Vec<u32>,
}

impl<'w> Shot<'w> {
    /// Fills one pixel for each target with what lies in its direction, as the report's raster pass writes it.
    pub fn of(world: &'w World, eye: Vec3, targets: impl IntoIterator<Item = Vec3>) -> Self {
        let mut shot = Self {
            world,
            eye,
            cone: PixelCone::default(),
            width: 0,
            position: Vec::new(),
            normal: Vec::new(),
            color: Vec::new(),
            triangle: Vec::new(),
        };
        let tracer = world.brute_force();
        for target in targets {
            shot.push(&tracer, (target - eye).normalize());
        }
        shot.width = shot.position.len() as u32;
        shot
    }

    /// The same pixels as rows of `width`.
    pub fn rows(self, width: u32) -> Self {
        assert_eq!(self.position.len() % width as usize, 0);
        Self { width, ..self }
    }

    /// The same G-buffer, used with another world whose first triangles are those of this one.
    pub fn in_world(self, world: &'w World) -> Self {
        Self { world, ..self }
    }

    fn push(&mut self, tracer: &BruteForce, direction: Vec3) {
        let ray = Ray { origin: self.eye, direction, t_min: 0.0, t_max: f32::INFINITY };
        let nearest = tracer.candidates(&ray).min_by(|a, b| a.0.x.total_cmp(&b.0.x));
        let sphere = self.world.nearest_sphere(self.eye, direction);
        if let Some((_, id, at)) = sphere.filter(|(t, ..)| nearest.is_none_or(|nearest| *t < nearest.0.x)) {
            return self.push_sphere(id, at);
        }
        let Some((DVec3 { x: t, y: u, z: v }, triangle, _)) = nearest else {
            self.position.push([0.0; 4]);
            self.normal.push([0.0; 4]);
            self.color.push(BACKGROUND);
            self.triangle.push(NO_TRIANGLE);
            return;
        };
        let geometry = &self.world.scene.geometry;
        let position = (self.eye.as_dvec3() + direction.as_dvec3() * t).as_vec3();
        let [a, b, c] = geometry.triangles[triangle as usize].map(|vertex| geometry.normals[vertex as usize]);
        let (u, v) = (u as f32, v as f32);
        let normal = (a * (1.0 - u - v) + b * u + c * v).normalize();
        let cos = self.world.cosine(position, normal);
        let material = geometry.material_of(triangle);
        let glass = self.world.glass[material as usize];
        self.position.push(position.extend(cos).to_array());
        self.normal.push(normal.extend(0.0).to_array());
        let lit = self.world.lit(material, cos).extend(1.0).to_array();
        self.color.push(if glass { [1.0, 0.0, 1.0, 0.0] } else { lit });
        self.triangle.push(triangle);
    }

    fn push_sphere(&mut self, id: u32, at: DVec3) {
        let sphere = self.world.scene.geometry.sphere(id).expect("it was found");
        let normal = (at - sphere.center.as_dvec3()).normalize().as_vec3();
        let cos = self.world.cosine(at.as_vec3(), normal);
        let glass = self.world.glass[sphere.material as usize];
        let lit = self.world.lit(sphere.material, cos).extend(1.0).to_array();
        self.position.push(at.as_vec3().extend(cos).to_array());
        self.normal.push(normal.extend(0.0).to_array());
        self.color.push(if glass { [1.0, 0.0, 1.0, 0.0] } else { lit });
        self.triangle.push(id);
    }

    /// A job of a program over this G-buffer.
    pub fn job(&self, program: RayProgram, fidelity: Fidelity, params: RayParams) -> RayJob<'_> {
        RayJob {
            from_camera: None,
            origin: [0; 2],
            scene: &self.world.scene,
            program,
            params,
            fidelity,
            seed: 0,
            eye: self.eye,
            cone: self.cone,
            lights: &self.world.lights,
            sun: self.world.sun,
            width: self.width,
            height: (self.position.len() as u32).checked_div(self.width).unwrap_or(0),
            position: &self.position,
            normal: &self.normal,
            color: &self.color,
            triangle: &self.triangle,
            shared: None,
            shades: &self.world.shades,
            glass: &self.world.glass,
            shadow_glass: &self.world.shadow_glass,
            beyond: self.world.beyond,
            dielectrics: if self.world.bodies { &self.world.dielectrics } else { &[] },
        }
    }

    /// The picture of a program, and its ray counts.
    pub fn run(&self, program: RayProgram, fidelity: Fidelity, params: RayParams) -> (Vec<[f32; 4]>, RayCounts) {
        self.run_on(&self.world.brute_force(), &self.job(program, fidelity, params))
    }

    /// As [`Self::run`], on another tracer.
    pub fn run_on(&self, tracer: &impl Tracer, job: &RayJob<'_>) -> (Vec<[f32; 4]>, RayCounts) {
        // NaN marks pixels that no program has written.
        let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
        let stats = cpu::trace(tracer, job, &mut output, &Progress::default()).expect("a complete job");
        (output.pixels, stats.rays)
    }
}

/// Cell centres of a square grid on a parallelogram, row by row.
pub fn grid(side: u32, center: Vec3, x: Vec3, y: Vec3) -> impl Iterator<Item = Vec3> {
    let at = move |i: u32| (2.0 * (i as f32 + 0.5) / side as f32) - 1.0;
    (0..side * side).map(move |i| center + x * at(i % side) + y * at(i / side))
}

/// Asserts that two colours agree; `what` names the pixel in the message.
#[track_caller]
pub fn assert_close(found: [f32; 4], expected: Vec3, tolerance: f32, what: impl std::fmt::Display) {
    let difference = (Vec4::from_array(found).truncate() - expected).abs().max_element();
    assert!(difference <= tolerance, "{what}: {found:?} is not {expected} (off by {difference})");
}
