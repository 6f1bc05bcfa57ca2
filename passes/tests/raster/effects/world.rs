//! Small scenes, their G-buffers, and effects on them by rasterisation and by ray tracing.

use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{
    Attachments, EffectJob, EffectStats, GBuffer, LoadStore, PixelCone, RasterJob, Rasteriser, RayBackend, RayJob,
    Rect, Shade, Sun, View,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RasterProgram, RayParams};
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram};
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Batch, Material, RenderScene};
use glam::camera::rh;
use glam::{Mat4, Vec2, Vec3, Vec4};
use std::sync::Arc;

pub const BACKGROUND: [f32; 4] = [0.1, 0.2, 0.4, 0.25];

/// A scene under construction, with the passes' tables of its materials.
#[derive(Default)]
pub struct World {
    pub scene: RenderScene,
    pub shades: Vec<Shade>,
    pub glass: Vec<bool>,
    pub sun: Option<Sun>,
}

impl World {
    /// A world without surfaces, with white light that travels in this direction.
    pub fn lit_along(direction: Vec3) -> Self {
        Self { sun: Some(Sun { direction: direction.normalize(), color: Vec3::splat(0.9) }), ..Self::default() }
    }

    fn material(&mut self, shade: Shade, glass: bool) -> u32 {
        let material = Material { name: format!("material {}", self.shades.len()), ..Material::default() };
        self.scene.materials.push(material);
        self.shades.push(shade);
        self.glass.push(glass);
        self.shades.len() as u32 - 1
    }

    pub fn paint(&mut self, diffuse: Vec3) -> u32 {
        let shade = Shade { diffuse: diffuse.extend(1.0), ..Shade::default() };
        self.material(shade, false)
    }

    pub fn pane(&mut self) -> u32 {
        let diffuse = Vec4::new(1.0, 0.0, 1.0, 0.0);
        self.material(Shade { diffuse, ..Shade::default() }, true)
    }

    /// A material that is cut out in the left half: two texels side by side, the left one transparent.
    pub fn half_cut_out(&mut self) -> u32 {
        let texels = vec![[255, 255, 255, 0], [255; 4]];
        self.scene.textures.push(Texture::new("half".to_owned(), 2, 1, texels));
        let texture = Some(self.scene.textures.len() as u32 - 1);
        let shade =
            Shade { diffuse: Vec4::ONE, emission: Vec4::ZERO, texture, alpha_cutoff: Some(0.5), ..Shade::default() };
        self.material(shade, false)
    }

    /// A parallelogram around `center`; `x` and `y` are half its sides, and its normal is that of `x.cross(y)`. Texture
    /// coordinates run from (0.25, 0.25) at `center - x - y` to (0.75, 0.75): between two texel centres.
    pub fn quad(&mut self, material: u32, center: Vec3, x: Vec3, y: Vec3) {
        let geometry = &mut self.scene.geometry;
        let first = geometry.positions.len() as u32;
        geometry.positions.extend([center - x - y, center + x - y, center + x + y, center - x + y]);
        geometry.normals.extend([x.cross(y).normalize(); 4]);
        let texcoords = [[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]];
        geometry.texcoords.extend(texcoords.map(Vec2::from_array));
        let id = geometry.triangles.len() as u32;
        geometry.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        geometry.batches.push(Batch { material, first: id, count: 2 });
    }

    /// A horizontal square around the origin, seen from above.
    pub fn ground(&mut self, half: f32) {
        let grey = self.paint(Vec3::splat(0.7));
        self.quad(grey, Vec3::ZERO, Vec3::Z * half, Vec3::X * half);
    }

    /// An axis-parallel box of one material with outward faces.
    pub fn block(&mut self, material: u32, center: Vec3, half: Vec3) {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for side in [1.0, -1.0] {
                let (u, v) = (Vec3::new(axis.z, axis.x, axis.y), Vec3::new(axis.y, axis.z, axis.x));
                self.quad(material, center + axis * half * side, u * half * side, v * half);
            }
        }
    }

    /// The world through a square camera with a field of view of 60 degrees.
    pub fn seen(self, eye: Vec3, target: Vec3, side: u32) -> Shot {
        let up = if (target - eye).normalize().y.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::Y };
        let projection = rh::proj::directx::perspective(60f32.to_radians(), 1.0, 500.0, 0.01);
        self.through(View::new(projection * rh::view::look_at_mat4(eye, target, up), eye), side, side)
    }

    pub fn through(self, view: View, width: u32, height: u32) -> Shot {
        let Self { scene, shades, glass, sun } = self;
        let scene = Arc::new(scene);
        let attachments = Attachments { color: true, position: true, normal: true, triangle: true };
        let job = RasterJob {
            scene: &scene,
            program: RasterProgram::Deferred,
            view,
            lights: &[],
            sun,
            shades: &shades,
            culled: &[],
            viewport: Rect { x: 0, y: 0, width, height },
            clear_color: Vec4::from_array(BACKGROUND),
            attachments,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        };
        let mut raster = CpuRasteriser::new();
        let mut buffer = GBuffer::new(width, height, attachments);
        raster.upload(&scene).expect("host memory");
        raster.draw(&job, &mut buffer).expect("drawn");
        Shot { scene, shades, glass, sun, view, buffer, raster }
    }
}

/// A world with a camera and its G-buffer.
pub struct Shot {
    pub scene: Arc<RenderScene>,
    pub shades: Vec<Shade>,
    pub glass: Vec<bool>,
    pub sun: Option<Sun>,
    pub view: View,
    pub buffer: GBuffer,
    pub raster: CpuRasteriser,
}

impl Shot {
    pub fn job(&self, program: EffectProgram, params: EffectParams) -> EffectJob<'_> {
        EffectJob {
            scene: &self.scene,
            program,
            params,
            seed: 0,
            view: self.view,
            sun: self.sun,
            width: self.buffer.width,
            height: self.buffer.height,
            resident: true,
            position: &self.buffer.position,
            normal: &self.buffer.normal,
            color: &self.buffer.color,
            triangle: &self.buffer.triangle,
            shades: &self.shades,
            glass: &self.glass,
        }
    }

    /// The effect's picture by raster, and its statistics. Pixels that are not written stay NaN.
    pub fn effect(&mut self, program: EffectProgram, params: EffectParams) -> (Vec<[f32; 4]>, EffectStats) {
        let mut raster = std::mem::take(&mut self.raster);
        let mut output = Image::filled(self.buffer.width, self.buffer.height, [f32::NAN; 4]);
        let stats = raster.effect(&self.job(program, params), &mut output, &Progress::default()).expect("a whole job");
        self.raster = raster;
        (output.pixels, stats)
    }

    /// The picture of the ray program that computes the same.
    pub fn rays(&self, program: EffectProgram, params: RayParams) -> Vec<[f32; 4]> {
        let mut rays = CpuRays::new();
        rays.build(&self.scene, &vec![true; self.glass.len()]).expect("host memory");
        let none = vec![false; self.glass.len()];
        let job = RayJob {
            from_camera: None,
            origin: [0; 2],
            scene: &self.scene,
            program: program.info().counterpart,
            params,
            fidelity: Fidelity::Corrected,
            seed: 0,
            eye: self.view.eye,
            cone: PixelCone::default(),
            lights: &[],
            sun: self.sun,
            width: self.buffer.width,
            height: self.buffer.height,
            position: &self.buffer.position,
            normal: &self.buffer.normal,
            color: &self.buffer.color,
            triangle: &self.buffer.triangle,
            shared: None,
            shades: &self.shades,
            glass: &self.glass,
            shadow_glass: &none,
            beyond: Vec3::ZERO,
            dielectrics: &[],
        };
        let mut output = Image::filled(self.buffer.width, self.buffer.height, [f32::NAN; 4]);
        rays.run(&job, &mut output, &Progress::default()).expect("a whole job");
        output.pixels
    }

    pub fn position(&self, index: usize) -> Vec3 {
        Vec4::from_array(self.buffer.position[index]).truncate()
    }

    /// Indices of the pixels whose surface position satisfies `holds`.
    pub fn pixels_where(&self, holds: impl Fn(Vec3) -> bool) -> Vec<usize> {
        let shown = |index: &usize| self.buffer.triangle[*index] != curitiba_pipeline::backend::NO_TRIANGLE;
        let found: Vec<usize> =
            (0..self.buffer.triangle.len()).filter(shown).filter(|index| holds(self.position(*index))).collect();
        assert!(found.len() > 50, "the picture shows too little of it: {} pixels", found.len());
        found
    }
}

/// An orthographic camera straight above the origin, which sees `half` in each direction.
pub fn from_above(half: f32) -> View {
    let eye = Vec3::Y * 50.0;
    let projection = rh::proj::directx::orthographic(-half, half, -half, half, 100.0, 0.1);
    View::new(projection * rh::view::look_at_mat4(eye, Vec3::ZERO, Vec3::NEG_Z), eye)
}

pub fn mean(values: impl IntoIterator<Item = f32>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        sum += f64::from(value);
        count += 1;
    }
    sum / f64::from(count.max(1))
}

pub fn matrix_of(rows: [Vec4; 4]) -> Mat4 {
    Mat4::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose()
}
