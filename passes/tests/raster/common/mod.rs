//! Scenes, and an independent rasteriser for comparison: it tests every pixel against every triangle, in wide integers
//! and floats.
#![allow(dead_code, reason = "each test binary uses a part")]

pub mod reference;

use curitiba_pipeline::backend::{Attachments, GBuffer, LoadStore, NO_TRIANGLE, RasterJob, Rect, Shade, Sun, View};
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::scene::{Batch, Geometry, Material, RenderScene, TriangleRanges};
use glam::{DVec2, DVec3, Mat4, Vec2, Vec3, Vec4};

/// All attachments.
pub const ALL: Attachments = Attachments { color: true, position: true, normal: true, triangle: true };

/// PCG-RXS-M-XS: random numbers for tests.
pub struct Random(pub u32);

impl Random {
    pub fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.0 >> ((self.0 >> 28) + 4)) ^ self.0).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    }

    /// A number in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 8) as f32 / 16_777_216.0
    }

    /// A number in -1..1.
    pub fn signed(&mut self) -> f32 {
        self.unit() * 2.0 - 1.0
    }

    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

/// Right-handed perspective with reversed depth: 1 at `near`, 0 at `far`.
pub fn perspective(fov_y: f32, aspect: f32, near: f32, far: f32) -> Mat4 {
    let focal = 1.0 / (fov_y * 0.5).tan();
    Mat4::from_cols(
        Vec4::new(focal / aspect, 0.0, 0.0, 0.0),
        Vec4::new(0.0, focal, 0.0, 0.0),
        Vec4::new(0.0, 0.0, near / (far - near), -1.0),
        Vec4::new(0.0, 0.0, near * far / (far - near), 0.0),
    )
}

/// A camera at the origin that looks along -z.
pub fn camera(aspect: f32) -> View {
    View::new(perspective(1.0, aspect, 0.1, 100.0), Vec3::ZERO)
}

/// A view whose world x and y are pixels of a viewport of this size (y down). World z in -1..=0 is the negative depth.
pub fn pixels(width: u32, height: u32) -> View {
    let (w, h) = (width as f32, height as f32);
    let clip_from_world = Mat4::from_cols(
        Vec4::new(2.0 / w, 0.0, 0.0, 0.0),
        Vec4::new(0.0, -2.0 / h, 0.0, 0.0),
        Vec4::new(0.0, 0.0, -1.0, 0.0),
        Vec4::new(-1.0, 1.0, 0.0, 1.0),
    );
    View::new(clip_from_world, Vec3::new(w * 0.5, h * 0.5, 1.0))
}

/// A scene of one material. Normals are sums over the adjacent triangles; a vertex of one triangle has that triangle's
/// normal.
pub fn scene(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> RenderScene {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for triangle in &triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        for vertex in triangle {
            normals[*vertex as usize] += (b - a).cross(c - a);
        }
    }
    let normals = normals.into_iter().map(|normal| normal.normalize_or(Vec3::Y)).collect();
    let texcoords = positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
    let batches = vec![Batch { material: 0, first: 0, count: triangles.len() as u32 }];
    let geometry = Geometry { positions, normals, texcoords, triangles, batches, ..Geometry::default() };
    RenderScene { geometry, materials: vec![Material::default()], ..RenderScene::default() }
}

/// A scene of separate triangles.
pub fn triangles(corners: &[[Vec3; 3]]) -> RenderScene {
    let positions = corners.iter().flatten().copied().collect();
    scene(positions, (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// A triangle in front of a larger one of another material, which may be a sky.
pub fn before(is_sky: bool) -> RenderScene {
    let near = [Vec3::new(-1.0, -1.0, -4.0), Vec3::new(1.5, -0.5, -4.0), Vec3::new(0.0, 1.2, -4.5)];
    let far = [Vec3::new(-30.0, -9.0, -9.0), Vec3::new(30.0, -9.0, -9.0), Vec3::new(0.0, 9.0, -12.0)];
    let mut scene = triangles(&[near, far]);
    scene.geometry.batches = [0, 1].map(|material| Batch { material, first: material, count: 1 }).to_vec();
    scene.materials = [false, is_sky].map(|sky| Material { sky, ..Material::default() }).to_vec();
    scene.geometry.sky = TriangleRanges::of_triangles(&scene.geometry, &scene.skies());
    scene
}

/// Asserts that pictures of [`before`] with and without a sky differ in one respect: a sky only writes its colour, and no other attachment.
#[track_caller]
pub fn hides_sky(with: &GBuffer, without: &GBuffer) {
    assert!(with.color == without.color);
    let mut seen = [0, 0];
    for (index, id) in without.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
        let written = |buffer: &GBuffer| (buffer.position[index], buffer.normal[index], buffer.triangle[index]);
        let expected = if *id == 1 { ([0.0; 4], [0.0; 4], NO_TRIANGLE) } else { written(without) };
        assert_eq!(written(with), expected, "pixel {index}");
        seen[*id as usize] += 1;
    }
    assert!(seen.iter().all(|count| *count > 500), "{seen:?}");
}

/// A plain material.
pub fn grey() -> Shade {
    Shade { diffuse: Vec4::new(0.8, 0.6, 0.4, 1.0), emission: Vec4::new(0.0, 0.1, 0.0, 1.0), ..Shade::default() }
}

/// A job for the whole target, with a light.
pub fn job<'a>(
    scene: &'a RenderScene,
    shades: &'a [Shade],
    view: View,
    width: u32,
    height: u32,
    attachments: Attachments,
) -> RasterJob<'a> {
    RasterJob {
        scene,
        program: RasterProgram::Deferred,
        view,
        lights: &[],
        sun: Some(Sun { direction: Vec3::new(0.36, -0.48, -0.8), color: Vec3::new(0.9, 0.8, 0.7) }),
        shades,
        culled: &[],
        viewport: Rect { x: 0, y: 0, width, height },
        clear_color: Vec4::new(0.1, 0.2, 0.3, 0.4),
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    }
}

/// Triangles of one kind in front of [`camera`]. `kind`: 0 mixed sizes, 1 needles, 2 smaller than a pixel, 3 huge, 4
/// partly behind the camera, 5 through the near plane, 6 through the far plane.
pub fn soup(kind: u32, count: usize, seed: u32) -> RenderScene {
    let mut random = Random(seed.wrapping_mul(9_781).wrapping_add(kind));
    let mut corners = Vec::new();
    while corners.len() < count {
        let depth = 2.0 + 30.0 * random.unit() * random.unit();
        let centre = Vec3::new(random.signed() * depth * 0.6, random.signed() * depth * 0.6, -depth);
        let corner = |random: &mut Random, size: f32| centre + random.vector() * size;
        corners.push(match kind {
            0 => {
                let size = depth * 0.4 * random.unit().powi(2);
                [0; 3].map(|_| corner(&mut random, size))
            }
            1 => {
                let end = random.vector() * depth * 0.5;
                [centre - end, centre + end, centre + random.vector() * depth * 0.002]
            }
            2 => [0; 3].map(|_| corner(&mut random, depth * 0.006)),
            3 => [0; 3].map(|_| corner(&mut random, depth * 0.2) + random.vector() * 3000.0 * random.unit()),
            4 => [0; 3].map(|_| random.vector() * 8.0),
            5 => [0; 3].map(|_| Vec3::new(random.signed() * 0.2, random.signed() * 0.2, -0.1 + random.signed() * 0.08)),
            _ => [0; 3]
                .map(|_| Vec3::new(random.signed() * 60.0, random.signed() * 60.0, -100.0 + random.signed() * 60.0)),
        });
    }
    triangles(&corners)
}

/// A field of hills of `2 * cells^2` triangles with shared vertices, and a camera in which it covers three quarters of
/// the picture.
pub fn terrain(cells: u32) -> (RenderScene, View) {
    let height = |x: f32, z: f32| {
        0.6 * (x * 0.9).sin() * (z * 0.7).cos()
            + 0.25 * (x * 2.3 + 1.0).sin() * (z * 2.9).sin()
            + 0.05 * (x * 9.0).cos()
    };
    let mut positions = Vec::new();
    for row in 0..=cells {
        for column in 0..=cells {
            let (x, z) = (column as f32 / cells as f32 * 10.0 - 5.0, row as f32 / cells as f32 * 10.0 - 5.0);
            positions.push(Vec3::new(x, height(x, z), z));
        }
    }
    let mut triangles = Vec::new();
    for row in 0..cells {
        for column in 0..cells {
            let a = row * (cells + 1) + column;
            let (b, c, d) = (a + 1, a + cells + 1, a + cells + 2);
            triangles.push([a, c, b]);
            triangles.push([b, c, d]);
        }
    }
    let eye = Vec3::new(0.0, 4.6, 4.2);
    let back = (eye - Vec3::new(0.0, -0.6, 0.1)).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let world_from_view =
        Mat4::from_cols(right.extend(0.0), back.cross(right).extend(0.0), back.extend(0.0), eye.extend(1.0));
    let view = world_from_view.inverse();
    let clip_from_world = perspective(60f32.to_radians(), 1.0, 0.1, 100.0) * view;
    (scene(positions, triangles), View::new(clip_from_world, eye))
}

/// Triangles of a square of `cells` x `cells` cells, whose inner corners are moved within the square, so that two
/// layers share no corners.
fn layer(half: f32, cells: u32, toward: f32, seed: u32, tilt: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (up, normal) = (Vec3::new(0.0, tilt.cos(), -tilt.sin()), Vec3::new(0.0, tilt.sin(), tilt.cos()));
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let mut positions = Vec::new();
    for row in 0..=cells {
        for column in 0..=cells {
            let inner = row > 0 && row < cells && column > 0 && column < cells;
            let jitter = if inner { [random(), random()] } else { [0.0; 2] };
            let [x, y] = [(column, jitter[0]), (row, jitter[1])]
                .map(|(cell, jitter)| ((cell as f32 + 0.6 * jitter) / cells as f32 * 2.0 - 1.0) * half);
            positions.push(Vec3::X * x + up * y + normal * toward + Vec3::NEG_Z * 60.0);
        }
    }
    let at = |row: u32, column: u32| row * (cells + 1) + column;
    let cell = |(row, column)| {
        let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1)];
        [[a, b, c], [c, b, d]]
    };
    (positions, (0..cells).flat_map(|row| (0..cells).map(move |column| (row, column))).flat_map(cell).collect())
}

/// Two layers 60 m from [`camera`], tilted by `tilt` radians, the nearer one `gap` in front of the other. Also returns the number of
/// triangles of the farther layer, which come first.
pub fn layers(seed: u32, tilt: f32, gap: f32) -> (RenderScene, u32) {
    let (mut positions, mut triangles) = layer(12.0, 23, 0.0, 2 * seed, tilt);
    let behind = triangles.len() as u32;
    let (nearer, more) = layer(12.5, 29, gap, 2 * seed + 1, tilt);
    triangles.extend(more.iter().map(|corners| corners.map(|corner| corner + positions.len() as u32)));
    positions.extend(nearer);
    (scene(positions, triangles), behind)
}

/// Distance on the screen between a pixel's stored position and the nearest point of its triangle.
#[derive(Debug, Clone, Copy)]
pub struct Beside {
    /// Distance, in pixels, from the point of the exact triangle that is nearest to the pixel's centre.
    pub off: f64,
    /// The part of the distance that rounding explains, in pixels.
    pub rounding: f64,
    /// Whether the centre is outside of the triangle.
    pub is_outside: bool,
}

/// The distances of all pixels of a drawing that show a triangle in front of the camera.
pub fn beside_nearest(job: &RasterJob<'_>, target: &GBuffer) -> Vec<Beside> {
    let size = DVec2::new(target.width.into(), target.height.into());
    let screen = |position: DVec3| {
        let clip = job.view.clip_from_world.as_dmat4() * position.extend(1.0);
        ((DVec2::new(clip.x, -clip.y) / clip.w * 0.5 + 0.5) * size, clip.w)
    };
    let covered = target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE);
    let pixels = covered.filter_map(|(index, id)| {
        let corners = job.scene.geometry.corners(*id).map(|corner| screen(corner.as_dvec3()));
        let centre = DVec2::new((index as u32 % target.width).into(), (index as u32 / target.width).into()) + 0.5;
        let place = nearest(corners.map(|(place, _)| place), centre);
        let position = Vec4::from(target.position[index]).truncate().as_dvec3();
        let (seen, depth) = screen(position);
        let rounding = 1e-4 + 8.0 * f64::from(f32::EPSILON) * position.length() * size.x / depth;
        let beside = Beside { off: seen.distance(place), rounding, is_outside: place != centre };
        corners.iter().all(|(_, depth)| *depth > 0.1).then_some(beside)
    });
    pixels.collect()
}

/// The point of a triangle that is nearest to `point`.
fn nearest([a, b, c]: [DVec2; 3], point: DVec2) -> DVec2 {
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(point - from));
    if sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0) {
        return point;
    }
    let on = |from: DVec2, to: DVec2| {
        let along = to - from;
        from + along * ((point - from).dot(along) / along.length_squared().max(1e-30)).clamp(0.0, 1.0)
    };
    let of_edges = [on(a, b), on(b, c), on(c, a)];
    of_edges.into_iter().min_by(|a, b| a.distance(point).total_cmp(&b.distance(point))).expect("three edges")
}
