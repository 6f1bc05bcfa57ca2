//! Exact spheres: the line of sight of each pixel is intersected with the sphere itself, in `f64`.
//!
//! A pixel shows a sphere where the intersection is nearer to the eye than the triangle of the pixel. Spheres are drawn
//! after all triangles and change no other pixels, so this code does not change pictures without spheres.

use super::shade::lights::sum_of_lights;
use super::surface::{TILE, TileSurface};
use super::tile::Tile;
use crate::raster::spheres::covered_pixels;
use curitiba_pipeline::backend::{NO_TRIANGLE, RasterJob};
use curitiba_pipeline::scene::Sphere;
use glam::{DMat4, DVec3, DVec4, Vec3, Vec4};
use std::ops::Range;

/// Ambient share of the diffuse colour, the same as for triangles.
const AMBIENT: f32 = 0.3;

/// The spheres of a draw.
pub(super) struct Screen<'a> {
    job: &'a RasterJob<'a>,
    /// Matrix from positions relative to the eye to clip space, and the inverse matrix.
    matrix: DMat4,
    inverse: DMat4,
    eye: DVec3,
    size: [f64; 2],
    /// The spheres that may be seen: index, and the columns and rows of the viewport that each covers, with a margin.
    seen: Vec<(u32, [Range<usize>; 2])>,
}

/// The point where a line of sight hits a sphere.
struct Met {
    /// Depth: 1 near, 0 far.
    depth: f32,
    /// Outward unit normal.
    normal: DVec3,
    /// Position relative to the eye.
    position: DVec3,
}

impl<'a> Screen<'a> {
    /// The spheres of a job, except those of hidden materials; `None` if the scene has no spheres.
    pub fn new(job: &'a RasterJob<'a>, hidden: &[bool]) -> Option<Self> {
        let spheres = &job.scene.geometry.spheres;
        if spheres.is_empty() {
            return None;
        }
        let (matrix, eye) = job.view.projection();
        let (matrix, eye) = (matrix.as_dmat4(), eye.as_dvec3());
        let size = [job.viewport.width, job.viewport.height].map(f64::from);
        let mut screen = Self { job, matrix, inverse: matrix.inverse(), eye, size, seen: Vec::new() };
        let shown = |sphere: &&Sphere| hidden.get(sphere.material as usize) != Some(&true);
        for (sphere, index) in spheres.iter().zip(0..).filter(|(sphere, _)| shown(sphere)) {
            if let Some(pixels) = covered_pixels(sphere, (&screen.matrix, eye), size) {
                screen.seen.push((index, pixels));
            }
        }
        Some(screen)
    }

    /// The first hit of the line of sight through a pixel's centre with a sphere, between the near and the far plane.
    fn meets(&self, sphere: &Sphere, x: usize, y: usize) -> Option<Met> {
        let [width, height] = self.size;
        let at = [(x as f64 + 0.5) / width * 2.0 - 1.0, 1.0 - (y as f64 + 0.5) / height * 2.0];
        let [near, far] = [1.0, 0.0].map(|depth| self.inverse * DVec4::new(at[0], at[1], depth, 1.0));
        let start = near.truncate() / near.w;
        // Scaled so that there is no division by the far `w`, which may be 0.
        let direction = (far.truncate() * near.w - near.truncate() * far.w).normalize();
        let end = if far.w > 0.0 { (far.truncate() / far.w - start).dot(direction) } else { f64::INFINITY };
        let center = sphere.center.as_dvec3() - self.eye;
        let (from, radius) = (start - center, f64::from(sphere.radius));
        let b = -from.dot(direction);
        let nearest = from + b * direction;
        let half = radius * radius - nearest.length_squared();
        let half = (half >= 0.0).then(|| half.sqrt())?;
        // The second hit is on the inner side of the sphere, which culling removes.
        let inside = self.job.culled.get(sphere.material as usize) != Some(&true);
        let mut sides = [(-half, true), (half, inside)].into_iter().filter(|(_, shown)| *shown);
        let (step, _) = sides.find(|(step, _)| (0.0..=end).contains(&(b + step)))?;
        let normal = (nearest + direction * step).normalize_or(DVec3::Y);
        let position = center + normal * radius;
        let clip = self.matrix * position.extend(1.0);
        Some(Met { depth: (clip.z / clip.w).clamp(0.0, 1.0) as f32, normal, position })
    }

    fn sphere(&self, index: u32) -> &Sphere {
        &self.job.scene.geometry.spheres[index as usize]
    }

    /// Draws the spheres of a tile over its triangles. `shown` receives one sphere index for each pixel of the tile,
    /// [`NO_TRIANGLE`] where no sphere is seen; it stays empty if no sphere's rectangle overlaps the tile.
    pub fn draw(&self, tile: &mut Tile, surface: &TileSurface<'_>, shown: &mut Vec<u32>) {
        shown.clear();
        for (index, [columns, rows]) in &self.seen {
            let columns = columns.start.max(surface.x)..columns.end.min(surface.x + surface.width);
            let rows = rows.start.max(surface.y)..rows.end.min(surface.y + surface.height);
            if columns.is_empty() || rows.is_empty() {
                continue;
            }
            shown.resize(TILE * TILE, NO_TRIANGLE);
            for y in rows {
                for x in columns.clone() {
                    let (column, row) = (x - surface.x, y - surface.y);
                    if let Some(met) = self.meets(self.sphere(*index), x, y)
                        && tile.cover(column, row, met.depth)
                    {
                        shown[row * TILE + column] = *index;
                    }
                }
            }
        }
    }

    /// Writes the attachments of the pixels of a tile that show spheres.
    pub fn shade(&self, shown: &[u32], surface: &mut TileSurface<'_>) {
        let first = self.job.scene.geometry.triangles.len() as u32;
        let towards = self.job.sun.map_or(Vec3::ZERO, |sun| -sun.direction);
        let light_color = self.job.sun.map_or(Vec4::ZERO, |sun| sun.color.extend(1.0));
        for (row, indices) in shown.chunks(TILE).enumerate().take(surface.height) {
            for (column, index) in indices.iter().enumerate().filter(|(_, index)| **index != NO_TRIANGLE) {
                let sphere = self.sphere(*index);
                let Some(met) = self.meets(sphere, surface.x + column, surface.y + row) else { continue };
                let normal = met.normal.as_vec3();
                let mut light = normal.dot(towards).clamp(0.0, 1.0);
                let mut arriving = light_color * light;
                if !self.job.lights.is_empty() {
                    let point = (met.position + self.eye).as_vec3();
                    arriving = sum_of_lights(self.job.lights, point, |towards| normal.dot(towards).clamp(0.0, 1.0));
                    light = arriving.w;
                }
                if let Some(pixels) = surface.color(row) {
                    let shade = &self.job.shades[sphere.material as usize];
                    let glow = shade.glow.map_or(Vec3::ZERO, |glow| glow.color);
                    let color = shade.diffuse * AMBIENT + shade.diffuse * arriving + glow.extend(0.0);
                    pixels[column] = color.to_array();
                }
                if let Some(pixels) = surface.position(row) {
                    pixels[column] = (met.position + self.eye).as_vec3().extend(light).to_array();
                }
                if let Some(pixels) = surface.normal(row) {
                    pixels[column] = normal.extend(0.0).to_array();
                }
                if let Some(pixels) = surface.triangle(row) {
                    pixels[column] = first + index;
                }
            }
        }
    }
}
