//! Generated scenes with several materials, for the tests of both rasterisers.
#![allow(dead_code, reason = "each test uses a part")]

use crate::common::perspective;
use curitiba_pipeline::backend::{Attachments, GBuffer, Glow, LoadStore, NormalMap, RasterJob, Rect, Shade, Sun, View};
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::scene::texture::{Texture, Wrap};
use curitiba_pipeline::scene::{Batch, Geometry, RenderScene};
use glam::{Vec2, Vec3, Vec4};
use std::sync::Arc;

/// A scene with its materials, its light and its camera.
pub struct Setup {
    pub name: &'static str,
    pub scene: Arc<RenderScene>,
    pub shades: Vec<Shade>,
    pub eye: Vec3,
    pub target: Vec3,
    pub near: f32,
    pub far: f32,
    pub sun: Option<Sun>,
}

impl Setup {
    /// The camera, for frames of `width` x `height` pixels.
    pub fn view(&self, width: u32, height: u32) -> View {
        let look = glam::camera::rh::view::look_at_mat4(self.eye, self.target, Vec3::Y);
        let clip_from_world = perspective(1.0, width as f32 / height as f32, self.near, self.far) * look;
        View::new(clip_from_world, self.eye)
    }

    /// A job whose viewport is the whole frame.
    pub fn job(&self, width: u32, height: u32, attachments: Attachments) -> RasterJob<'_> {
        RasterJob {
            scene: &self.scene,
            program: RasterProgram::Deferred,
            view: self.view(width, height),
            lights: &[],
            sun: self.sun,
            shades: &self.shades,
            culled: &[],
            viewport: Rect { x: 0, y: 0, width, height },
            clear_color: Vec4::new(0.25, 0.5, 0.75, 1.0),
            attachments,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        }
    }
}

pub fn sun() -> Option<Sun> {
    Some(Sun { direction: Vec3::new(-0.4, -1.0, -0.3).normalize(), color: Vec3::new(1.0, 0.95, 0.8) })
}

pub fn plain(diffuse: [f32; 3]) -> Shade {
    Shade { diffuse: Vec3::from(diffuse).extend(1.0), ..Shade::default() }
}

/// Hills of `2 * side * side` triangles in four materials, seen from above one corner.
pub fn hills(side: u32) -> Setup {
    let height = |x: f32, z: f32| {
        2.0 * (0.31 * x).sin() * (0.27 * z).cos()
            + 0.7 * (1.3 * x + 0.4).sin() * (1.7 * z).sin()
            + 0.1 * (5.1 * x + 3.7 * z).sin()
    };
    let at = |i: u32, j: u32| {
        let [x, z] = [i, j].map(|k| 40.0 * (k as f32 / side as f32 - 0.5));
        Vec3::new(x, height(x, z), z)
    };
    let grid = || (0..=side).flat_map(|j| (0..=side).map(move |i| (i, j)));
    let positions: Vec<Vec3> = grid().map(|(i, j)| at(i, j)).collect();
    let step = 0.01;
    let normals = positions.iter().map(|p| {
        let slope_x = height(p.x + step, p.z) - height(p.x - step, p.z);
        let slope_z = height(p.x, p.z + step) - height(p.x, p.z - step);
        Vec3::new(-slope_x, 2.0 * step, -slope_z).normalize()
    });
    let triangles: Vec<[u32; 3]> = (0..side)
        .flat_map(|j| (0..side).map(move |i| j * (side + 1) + i))
        .flat_map(|a| [[a, a + side + 1, a + 1], [a + 1, a + side + 1, a + side + 2]])
        .collect();
    let count = triangles.len() as u32;
    let cuts = [0, count / 4, count / 2, 3 * (count / 4), count];
    let batch = |material: u32| {
        let [first, end] = [cuts[material as usize], cuts[material as usize + 1]];
        Batch { material, first, count: end - first }
    };
    let geometry = Geometry {
        normals: normals.collect(),
        positions,
        triangles,
        batches: (0..4).map(batch).collect(),
        ..Geometry::default()
    };
    Setup {
        name: "hills",
        scene: Arc::new(RenderScene { geometry, ..RenderScene::default() }),
        shades: vec![plain([0.8, 0.3, 0.2]), plain([0.2, 0.7, 0.3]), plain([0.3, 0.4, 0.9]), plain([0.7, 0.7, 0.6])],
        eye: Vec3::new(16.0, 9.0, 18.0),
        target: Vec3::new(-2.0, -1.0, -3.0),
        near: 0.1,
        far: 200.0,
        sun: sun(),
    }
}

/// The triangles of [`common::soup`](crate::common::soup), and its camera.
pub fn soup(kind: u32, count: usize) -> Setup {
    Setup {
        name: "soup",
        scene: Arc::new(crate::common::soup(kind, count, 1)),
        shades: vec![plain([0.9, 0.5, 0.1])],
        eye: Vec3::ZERO,
        target: -Vec3::Z,
        near: 0.1,
        far: 100.0,
        sun: sun(),
    }
}

/// Smooth waves of colour that differ between the directions; alpha is 0 or 1 in squares of 8 texels.
fn picture(name: &str, width: u32, height: u32) -> Texture {
    let texel = |x: u32, y: u32| {
        let wave = |frequency: f32, phase: f32| {
            let turn = frequency * (x as f32 / width as f32) + (phase + 3.0) * (y as f32 / height as f32);
            (127.5 + 120.0 * (std::f32::consts::TAU * turn.round_ties_even() * 0.25 + 6.0 * turn + phase).sin()) as u8
        };
        let solid = (x / 8 + y / 8).is_multiple_of(2);
        [wave(3.0, 0.0), wave(5.0, 1.0), wave(2.0, 2.0), if solid { 255 } else { 0 }]
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    Texture::new(name.to_owned(), width, height, texels)
}

/// Adds a parallelogram with texture coordinates from 0 to `repeat`.
fn parallelogram(geometry: &mut Geometry, corner: Vec3, u: Vec3, v: Vec3, repeat: Vec2, material: u32) {
    let first = geometry.positions.len() as u32;
    geometry.positions.extend([corner, corner + u, corner + v, corner + u + v]);
    geometry.normals.extend([u.cross(v).normalize(); 4]);
    geometry.texcoords.extend([Vec2::ZERO, repeat * Vec2::X, repeat * Vec2::Y, repeat]);
    geometry.batches.push(Batch { material, first: geometry.triangles.len() as u32, count: 2 });
    geometry.triangles.extend([[first, first + 1, first + 2], [first + 2, first + 1, first + 3]]);
}

/// The floor and walls of [`grazing`] with clamped and mirrored textures. All four surfaces emit light: one of a single colour, three by a
/// texture. One of these three has no diffuse texture.
pub fn shining() -> Setup {
    let mut setup = grazing();
    let mut scene = RenderScene::clone(&setup.scene);
    // Texture coordinates beyond 0..1 on all sides.
    scene.geometry.texcoords.iter_mut().for_each(|texcoord| *texcoord = *texcoord * 0.3 - Vec2::splat(0.8));
    let wraps = [[Wrap::Clamp, Wrap::Mirror], [Wrap::Mirror, Wrap::Repeat], [Wrap::Clamp; 2]];
    scene.textures = scene.textures.into_iter().zip(wraps).map(|(texture, wrap)| texture.wrapped(wrap)).collect();
    let glow = |texture| Some(Glow { color: Vec3::new(0.5, 0.25, 1.5), texture });
    for (shade, texture) in setup.shades.iter_mut().zip([Some(1), None, Some(2), Some(0)]) {
        shade.glow = glow(texture);
    }
    Setup { name: "light of their own", scene: Arc::new(scene), ..setup }
}

/// Textured floor and walls at grazing angles: from magnification to the last mip levels.
pub fn grazing() -> Setup {
    let mut geometry = Geometry::default();
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    parallelogram(&mut geometry, Vec3::new(-30.0, 0.0, 5.0), 60.0 * x, -120.0 * z, Vec2::new(20.0, 40.0), 0);
    parallelogram(&mut geometry, Vec3::new(-4.0, 0.0, 5.0), 4.0 * y, -60.0 * z, Vec2::new(1.0, 15.0), 1);
    parallelogram(&mut geometry, Vec3::new(6.0, 0.0, -30.0), -9.0 * x, 8.0 * y, Vec2::new(2.5, -1.5), 2);
    parallelogram(&mut geometry, Vec3::new(5.0, 0.0, 0.0), 2.0 * y, -12.0 * z, Vec2::ONE, 3);
    let textures = vec![picture("floor", 128, 128), picture("wall", 200, 75), picture("line", 64, 1)];
    let textured = |texture: u32, diffuse: Vec4, emission: Vec4| Shade {
        diffuse,
        emission,
        texture: Some(texture),
        ..Shade::default()
    };
    Setup {
        name: "grazing textures",
        scene: Arc::new(RenderScene { geometry, textures, ..RenderScene::default() }),
        shades: vec![
            textured(0, Vec4::new(0.9, 0.8, 0.7, 1.0), Vec4::ZERO),
            textured(1, Vec4::new(0.5, 0.6, 0.7, 0.5), Vec4::new(0.1, 0.0, 0.2, 0.0)),
            textured(2, Vec4::ONE, Vec4::splat(0.25)),
            plain([0.3, 0.9, 0.3]),
        ],
        eye: Vec3::new(0.3, 1.1, 4.0),
        target: Vec3::new(0.5, 0.8, -10.0),
        near: 0.1,
        far: 300.0,
        sun: sun(),
    }
}

/// Fences with holes, whose diffuse colour has an alpha of 0, in front of a wall; and a pane that has a cutoff but no texture.
pub fn cut_out() -> Setup {
    let mut geometry = Geometry::default();
    let (x, y) = (Vec3::X, Vec3::Y);
    for fence in 0..4 {
        let z = -3.0 - 2.0 * fence as f32;
        let slant = Vec3::new(9.0, 0.3, -1.0);
        parallelogram(&mut geometry, Vec3::new(-4.5, -3.0, z), slant, 6.0 * y, Vec2::new(3.0, 2.0), 0);
    }
    parallelogram(&mut geometry, Vec3::new(-9.0, -9.0, -14.0), 18.0 * x, 18.0 * y, Vec2::ONE, 1);
    parallelogram(&mut geometry, Vec3::new(-1.0, -1.0, -2.0), 2.0 * x, 2.0 * y, Vec2::ONE, 2);
    let fence = Shade { alpha_cutoff: Some(0.5), texture: Some(0), ..plain([0.8, 0.8, 0.8]) };
    let pane = Shade { diffuse: Vec4::new(1.0, 1.0, 1.0, 0.2), alpha_cutoff: Some(0.5), ..fence };
    Setup {
        name: "alpha cut",
        scene: Arc::new(RenderScene { geometry, textures: vec![picture("fence", 96, 64)], ..RenderScene::default() }),
        shades: vec![
            Shade { diffuse: Vec4::new(0.8, 0.8, 0.8, 0.0), ..fence },
            plain([0.2, 0.3, 0.9]),
            Shade { texture: None, ..pane },
        ],
        eye: Vec3::new(0.2, 0.1, 1.0),
        target: Vec3::new(0.0, 0.0, -10.0),
        near: 0.1,
        far: 50.0,
        sun: sun(),
    }
}

/// Hills with vertex colours, whose alpha cuts holes into every second material.
pub fn tinted() -> Setup {
    let mut setup = hills(40);
    let mut scene = RenderScene::clone(&setup.scene);
    let tint = |at: &Vec3| {
        let wave = |phase: f32| 0.5 + 0.5 * (0.9 * at.x + phase).sin() * (0.8 * at.z).cos();
        Vec4::new(wave(0.0), wave(2.0), wave(4.0), wave(5.0))
    };
    scene.geometry.colors = scene.geometry.positions.iter().map(tint).collect();
    setup.scene = Arc::new(scene);
    for (material, shade) in setup.shades.iter_mut().enumerate() {
        shade.vertex_colors = material < 3;
        shade.alpha_cutoff = (material % 2 == 0).then_some(0.4);
    }
    Setup { name: "vertex colours", ..setup }
}

/// Hills with normal maps, a repeating one and one that does not repeat, in several scales, with both signs of the
/// bitangent. With `waves` of 0 all texels are equal.
pub fn bumpy(waves: f32) -> Setup {
    let mut setup = hills(40);
    let mut scene = RenderScene::clone(&setup.scene);
    let map = |name: &str, size: u32, waves: f32| {
        let texel = |at: u32| {
            let [x, y] = [at % size, at / size].map(|at| at as f32 / size as f32 * std::f32::consts::TAU * waves);
            let vector = Vec3::new(0.8 * (x + 0.5).sin(), 0.6 * (x + y).cos(), 1.0).normalize();
            let [r, g, b] = (vector * 127.5 + 127.5).to_array().map(|value| value.round() as u8);
            [r, g, b, 255]
        };
        Texture::new(name.to_owned(), size, size, (0..size * size).map(texel).collect())
    };
    let first = scene.textures.len() as u32;
    scene.textures.push(map("waves", 32, 2.0 * waves));
    scene.textures.push(map("more waves", 64, 3.0 * waves).wrapped([Wrap::Clamp, Wrap::Mirror]));
    let tangent = |normal: &Vec3| {
        let along = (Vec3::X - *normal * normal.x).normalize();
        along.extend(if normal.z > 0.1 { -1.0 } else { 1.0 })
    };
    scene.geometry.texcoords = scene.geometry.positions.iter().map(|at| Vec2::new(at.x, -at.z) * 0.0625).collect();
    scene.geometry.tangents = scene.geometry.normals.iter().map(tangent).collect();
    setup.scene = Arc::new(scene);
    for (material, shade) in setup.shades.iter_mut().enumerate().take(3) {
        let scale = [1.0, 0.5, 2.0][material];
        shade.normal_map = Some(NormalMap { texture: first + material as u32 % 2, scale });
    }
    Setup { name: "normal maps", ..setup }
}

/// A target filled with a mark that no pass writes, to show which pixels were written.
pub fn marked(width: u32, height: u32, attachments: Attachments) -> GBuffer {
    let mut target = GBuffer::new(width, height, attachments);
    for channel in [&mut target.color, &mut target.position, &mut target.normal] {
        channel.fill([-77.0; 4]);
    }
    target.triangle.fill(0xdead_beef);
    target
}
