//! Attributes and colour of the pixels of a tile, each computed once, after the nearest triangle is known.

use super::frame::{Frame, Part, Placed};
use super::surface::{TILE, TileSurface};
use super::tile::{LANES, Tile};
use super::vertex::{ScreenVertex, UNITS};
use curitiba_pipeline::backend::{NO_TRIANGLE, Shade};
use curitiba_pipeline::scene::Batch;
use curitiba_pipeline::scene::texture::Texture;
use glam::{Vec2, Vec3, Vec4};
use std::ops::{Add, Mul, Range, Sub};

/// Share of the diffuse colour that is seen without light: the report's ambient term.
const AMBIENT: f32 = 0.3;

/// Vectors that start in the last columns reach beyond the row.
const ROW: usize = TILE + LANES;

/// Attributes of one row of a tile, one array a component.
#[derive(Debug)]
pub(super) struct Rows {
    position: [[f32; ROW]; 3],
    normal: [[f32; ROW]; 3],
    light: [f32; ROW],
    diffuse: [[f32; ROW]; 4],
    unlit: [[f32; ROW]; 4],
    texel: [[f32; ROW]; 4],
    triangle: [u32; ROW],
    batch: Batch,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            position: [[0.0; ROW]; 3],
            normal: [[0.0; ROW]; 3],
            light: [0.0; ROW],
            diffuse: [[0.0; ROW]; 4],
            unlit: [[0.0; ROW]; 4],
            texel: [[0.0; ROW]; 4],
            triangle: [NO_TRIANGLE; ROW],
            batch: Batch { material: 0, first: 0, count: 0 },
        }
    }
}

/// Barycentric coordinates along a row of pixels, exact until they are divided.
#[derive(Debug, Clone, Copy)]
struct Barycentric {
    /// Edge functions opposite to corners 1 and 2 at the first pixel, and the doubled area. Products of 24-bit integers:
    /// exact in 64-bit floats, as are their sums.
    edges: [f64; 2],
    area: f64,
    scale: f64,
    /// What a step to the right, and one down, adds to the edge functions.
    right: [f64; 2],
    down: [f64; 2],
    inv_w: [f32; 3],
}

impl Barycentric {
    /// Columns count from the pixel (x, y) of the viewport.
    #[inline(always)]
    fn new([v0, v1, v2]: &[ScreenVertex; 3], x: i32, y: i32) -> Self {
        let dx = f64::from(x * UNITS + UNITS / 2 - v0.x);
        let dy = f64::from(y * UNITS + UNITS / 2 - v0.y);
        let (x1, y1) = (f64::from(v1.x - v0.x), f64::from(v1.y - v0.y));
        let (x2, y2) = (f64::from(v2.x - v0.x), f64::from(v2.y - v0.y));
        let area = x1 * y2 - y1 * x2;
        let pixel = f64::from(UNITS);
        Self {
            edges: [dx * y2 - dy * x2, x1 * dy - y1 * dx],
            area,
            scale: 1.0 / area,
            right: [y2 * pixel, -y1 * pixel],
            down: [-x2 * pixel, x1 * pixel],
            inv_w: [v0.inv_w, v1.inv_w, v2.inv_w],
        }
    }

    /// Screen-space coordinates times `1 / w`, of the three corners.
    #[inline(always)]
    fn weights(&self, column: f64) -> [f32; 3] {
        let e1 = self.edges[0] + self.right[0] * column;
        let e2 = self.edges[1] + self.right[1] * column;
        let e0 = self.area - e1 - e2;
        [
            (e0 * self.scale) as f32 * self.inv_w[0],
            (e1 * self.scale) as f32 * self.inv_w[1],
            (e2 * self.scale) as f32 * self.inv_w[2],
        ]
    }

    /// Perspective-correct coordinates of corners 1 and 2.
    #[inline(always)]
    fn at(&self, column: f64) -> [f32; 2] {
        let [w0, w1, w2] = self.weights(column);
        let scale = 1.0 / (w0 + w1 + w2);
        [w1 * scale, w2 * scale]
    }

    /// A filtered texel at the first pixel's row. The derivatives of `uv = sum(l_k uv_k / w_k) / sum(l_k / w_k)`, where the
    /// screen-space coordinates `l_k` are linear, are `sum(l_k' (uv_k - uv) / w_k) / sum(l_k / w_k)`.
    #[inline(always)]
    fn texel(&self, column: f64, texture: &Texture, corners: &[Vec2; 3]) -> Vec4 {
        let [w0, w1, w2] = self.weights(column);
        let scale = 1.0 / (w0 + w1 + w2);
        let uv = corners[0] + (corners[1] - corners[0]) * (w1 * scale) + (corners[2] - corners[0]) * (w2 * scale);
        let derivative = |step: [f64; 2]| {
            let (s1, s2) = ((step[0] * self.scale) as f32, (step[1] * self.scale) as f32);
            let sum = (corners[0] - uv) * ((-s1 - s2) * self.inv_w[0])
                + (corners[1] - uv) * (s1 * self.inv_w[1])
                + (corners[2] - uv) * (s2 * self.inv_w[2]);
            sum * scale
        };
        texture.sample(uv, texture.lod(derivative(self.right), derivative(self.down)))
    }
}

/// A vertex attribute at the corners of a part of a triangle.
#[inline(always)]
fn attribute<T>(frame: &Frame<'_>, placed: &Placed<'_>, values: &[T]) -> [T; 3]
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let [a, b, c] = frame.geometry.triangles[placed.triangle as usize].map(|vertex| values[vertex as usize]);
    match placed.clipped {
        None => [a, b, c],
        Some(part) => part.weights.map(|[u, v]| a + (b - a) * u + (c - a) * v),
    }
}

/// Whether the alpha of its texture leaves a triangle at a pixel of the viewport.
pub(super) fn is_solid(frame: &Frame<'_>, placed: &Placed<'_>, x: i32, y: i32) -> bool {
    let shade = &frame.job.shades[frame.geometry.material_of(placed.triangle) as usize];
    let (Some(texture), Some(cutoff)) = (shade.texture, shade.alpha_cutoff) else { return true };
    let uv = attribute(frame, placed, &frame.geometry.texcoords);
    let texture = &frame.job.scene.textures[texture as usize];
    let texel = Barycentric::new(&placed.corners, x, y).texel(0.0, texture, &uv);
    texel.w * shade.diffuse.w >= cutoff
}

/// Which attributes are needed.
#[derive(Clone, Copy)]
struct Wanted {
    color: bool,
    position: bool,
    normals: bool,
    light: bool,
}

/// Writes the attachments of a tile.
#[inline(always)]
pub(super) fn shade(frame: &Frame<'_>, tile: &Tile, rows: &mut Rows, surface: &mut TileSurface<'_>) {
    let asked = frame.job.attachments;
    let light = frame.job.sun.is_some() && (asked.color || asked.position) && !frame.geometry.normals.is_empty();
    let wanted = Wanted { color: asked.color, position: asked.position, normals: light || asked.normal, light };
    rows.batch.count = 0;
    for row in 0..surface.height {
        match tile.row(row) {
            Some(parts) => rows.shade(frame, wanted, parts, row, surface),
            None => clear(frame, row, surface),
        }
    }
}

fn clear(frame: &Frame<'_>, row: usize, surface: &mut TileSurface<'_>) {
    if let Some(pixels) = surface.color(row) {
        pixels.fill(frame.job.clear_color.to_array());
    }
    if let Some(pixels) = surface.position(row) {
        pixels.fill([0.0; 4]);
    }
    if let Some(pixels) = surface.normal(row) {
        pixels.fill([0.0; 4]);
    }
    if let Some(pixels) = surface.triangle(row) {
        pixels.fill(NO_TRIANGLE);
    }
}

impl Rows {
    #[inline(always)]
    fn shade(
        &mut self,
        frame: &Frame<'_>,
        wanted: Wanted,
        parts: &[u32; TILE],
        row: usize,
        surface: &mut TileSurface<'_>,
    ) {
        let mut column = 0;
        while column < surface.width {
            let part = parts[column];
            let mut end = column + 1;
            while end < surface.width && parts[end] == part {
                end += 1;
            }
            if part == Part::NONE.0 {
                self.triangle[column..end].fill(NO_TRIANGLE);
            } else {
                self.interpolate(frame, wanted, Part(part), column..end, (surface.x, surface.y + row));
            }
            column = end;
        }
        if wanted.normals {
            self.light(frame, wanted);
        }
        if let Some(pixels) = surface.color(row) {
            self.color(frame);
            store(pixels, &self.triangle, &self.texel, frame.job.clear_color.to_array());
        }
        if let Some(pixels) = surface.position(row) {
            let [x, y, z] = &self.position;
            store4(pixels, &self.triangle, [x, y, z, &self.light], [0.0; 4]);
        }
        if let Some(pixels) = surface.normal(row) {
            let [x, y, z] = &self.normal;
            store4(pixels, &self.triangle, [x, y, z, &[0.0; ROW]], [0.0; 4]);
        }
        if let Some(pixels) = surface.triangle(row) {
            pixels.copy_from_slice(&self.triangle[..pixels.len()]);
        }
    }

    /// Attributes of a run of pixels that see one part. Vectors may reach beyond the run: what follows overwrites that.
    #[inline(always)]
    fn interpolate(
        &mut self,
        frame: &Frame<'_>,
        wanted: Wanted,
        part: Part,
        run: Range<usize>,
        (left, y): (usize, usize),
    ) {
        let geometry = frame.geometry;
        let placed = frame.place(part);
        self.triangle[run.clone()].fill(placed.triangle);
        if !(wanted.position | wanted.normals | wanted.color) {
            return;
        }
        let barycentric = Barycentric::new(&placed.corners, (left + run.start) as i32, y as i32);
        let positions = if wanted.position { attribute(frame, &placed, &geometry.positions) } else { [Vec3::ZERO; 3] };
        let normals = if wanted.normals { attribute(frame, &placed, &geometry.normals) } else { [Vec3::ZERO; 3] };
        for column in run.clone().step_by(LANES) {
            let first = (column - run.start) as f64;
            let (mut u, mut v) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                [u[lane], v[lane]] = barycentric.at(first + lane as f64);
            }
            if wanted.position {
                blend(&mut self.position, column, &positions, &u, &v);
            }
            if wanted.normals {
                blend(&mut self.normal, column, &normals, &u, &v);
            }
        }
        if wanted.color {
            if placed.triangle.wrapping_sub(self.batch.first) >= self.batch.count {
                let next = geometry.batches.partition_point(|batch| batch.first <= placed.triangle);
                self.batch = geometry.batches[next - 1];
            }
            let shade = &frame.job.shades[self.batch.material as usize];
            self.material(frame, shade, &placed, &barycentric, run);
        }
    }

    #[inline(always)]
    fn material(
        &mut self,
        frame: &Frame<'_>,
        shade: &Shade,
        placed: &Placed<'_>,
        barycentric: &Barycentric,
        run: Range<usize>,
    ) {
        let unlit = if shade.texture.is_some() { shade.emission + AMBIENT } else { shade.diffuse * AMBIENT };
        for component in 0..4 {
            self.diffuse[component][run.clone()].fill(shade.diffuse[component]);
            self.unlit[component][run.clone()].fill(unlit[component]);
            self.texel[component][run.clone()].fill(1.0);
        }
        if let Some(texture) = shade.texture {
            let texture = &frame.job.scene.textures[texture as usize];
            let uv = attribute(frame, placed, &frame.geometry.texcoords);
            for column in run.clone() {
                let texel = barycentric.texel((column - run.start) as f64, texture, &uv);
                for component in 0..4 {
                    self.texel[component][column] = texel[component];
                }
            }
        }
    }

    /// Normalises the normals, and computes the light's cosine.
    #[inline(always)]
    fn light(&mut self, frame: &Frame<'_>, wanted: Wanted) {
        let towards = frame.job.sun.map_or(Vec3::ZERO, |sun| -sun.direction);
        let [nx, ny, nz] = &mut self.normal;
        for column in 0..ROW {
            let (x, y, z) = (nx[column], ny[column], nz[column]);
            let squared = x * x + y * y + z * z;
            let scale = if squared > 0.0 { 1.0 / squared.sqrt() } else { 0.0 };
            let (x, y, z) = (x * scale, y * scale, z * scale);
            (nx[column], ny[column], nz[column]) = (x, y, z);
            let cosine = x * towards.x + y * towards.y + z * towards.z;
            self.light[column] = if wanted.light & (cosine > 0.0) { cosine } else { 0.0 };
        }
    }

    /// Shades; the result takes the place of the texels.
    #[inline(always)]
    fn color(&mut self, frame: &Frame<'_>) {
        let light_color = frame.job.sun.map_or(Vec4::ZERO, |sun| sun.color.extend(1.0));
        for component in 0..4 {
            let (diffuse, unlit) = (&self.diffuse[component], &self.unlit[component]);
            let texel = &mut self.texel[component];
            for column in 0..ROW {
                let lit = diffuse[column] * light_color[component] * self.light[column];
                texel[column] *= lit + unlit[column];
            }
        }
    }
}

#[inline(always)]
fn blend(rows: &mut [[f32; ROW]; 3], column: usize, [a, b, c]: &[Vec3; 3], u: &[f32; LANES], v: &[f32; LANES]) {
    let (ab, ac) = (*b - *a, *c - *a);
    for (component, row) in rows.iter_mut().enumerate() {
        let output: &mut [f32; LANES] = (&mut row[column..column + LANES]).try_into().expect("as many as lanes");
        for lane in 0..LANES {
            output[lane] = a[component] + u[lane] * ab[component] + v[lane] * ac[component];
        }
    }
}

#[inline(always)]
fn store(pixels: &mut [[f32; 4]], triangles: &[u32; ROW], [x, y, z, w]: &[[f32; ROW]; 4], background: [f32; 4]) {
    store4(pixels, triangles, [x, y, z, w], background);
}

#[inline(always)]
fn store4(pixels: &mut [[f32; 4]], triangles: &[u32; ROW], components: [&[f32; ROW]; 4], background: [f32; 4]) {
    let [x, y, z, w] = components;
    for (column, pixel) in pixels.iter_mut().enumerate().take(TILE) {
        let value = [x[column], y[column], z[column], w[column]];
        *pixel = if triangles[column] == NO_TRIANGLE { background } else { value };
    }
}
