//! Marching a ray through the picture.

use super::camera::{Piece, ScreenCamera};
use super::pyramid::Pyramid;
use curitiba_pipeline::scene::TriangleRanges;
use glam::Vec3;

/// Relative rounding error of a nearness. The tolerance is this times the nearness of the ray's start or of the surface, whichever is greater.
pub const ROUNDING: f32 = 1.0 / (1 << 18) as f32;

/// Distance behind a block's exit, in pixels, at which the column and row of the next block are computed, so that rounding does not keep a
/// ray in the same block. The test of the next block begins at the exit itself.
pub const STEP: f32 = 1.0 / 256.0;

/// Least extent of a line across the screen, in pixels; a shorter line stays in its column or row.
pub const LEAST_SPAN: f32 = 1e-4;

/// The result of a march: whether the picture shows what the ray hits, and where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The ray hits the surface that the pixel with this index shows.
    Pixel(usize),
    /// The ray hits nothing up to the end of the scene.
    Nothing,
    /// The picture does not show what the ray hits.
    Missing,
}

/// A ray projected to the screen. It ends at the screen's border, the near plane or the far end: infinite distance in
/// perspective, else the far plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Column, row and nearness of the start.
    pub start: Vec3,
    /// Vector from the start to the end.
    pub span: Vec3,
    /// Whether the line ends at the far end, not at the screen's border or the near plane.
    pub far: bool,
}

impl Line {
    /// The line of a ray. `None` if the start is not in front of the eye in perspective, the direction is 0, or the line is not finite.
    #[must_use]
    pub fn new(camera: &ScreenCamera, position: Vec3, direction: Vec3, [width, height]: [u32; 2]) -> Option<Self> {
        let start = camera.place(position);
        let [column, row, depth] =
            [camera.columns, camera.rows, camera.depths].map(|row| row.truncate().dot(direction));
        // Derivative of column, row and nearness along the ray, up to a positive factor that depends on the place.
        let step = if camera.perspective() {
            Vec3::new(column - start.x * depth, row - start.y * depth, -start.z * depth)
        } else {
            Vec3::new(column, row, -depth)
        };
        let until = |place: f32, step: f32, low: f32, high: f32| match step {
            step if step > 0.0 => ((high - place) / step).max(0.0),
            step if step < 0.0 => ((low - place) / step).max(0.0),
            _ => f32::MAX,
        };
        let beside = until(start.x, step.x, 0.0, width as f32).min(until(start.y, step.y, 0.0, height as f32));
        let along = until(start.z, step.z, camera.down.w, camera.right.w);
        let span = step * beside.min(along);
        let known = start.is_finite()
            && span.is_finite()
            && beside.min(along) < f32::MAX
            && (!camera.perspective() || start.z > 0.0);
        known.then_some(Self { start, span, far: step.z < 0.0 && along <= beside })
    }
}

/// The picture that rays are marched through.
#[derive(Debug, Clone, Copy)]
pub struct Screen<'a> {
    /// The camera of the picture.
    pub camera: &'a ScreenCamera,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Positions by pixel.
    pub position: &'a [[f32; 4]],
    /// Normals by pixel.
    pub normal: &'a [[f32; 4]],
    /// The pyramid of the same picture.
    pub pyramid: &'a Pyramid,
    /// Triangle ids by pixel, and which of them are glass; `None` in a picture without glass.
    pub glass: Option<(&'a [u32], &'a TriangleRanges)>,
    /// Greatest depth behind a surface at which a ray still hits it, in scene units.
    pub thickness: f32,
}

/// What happens to a ray in a pixel that it crosses.
enum Crossing {
    /// The ray goes on.
    None,
    /// The ray hits the surface that the pixel shows.
    Met,
    /// The ray hits something that the picture does not show.
    Hidden,
}

impl Screen<'_> {
    /// Marches a ray from a position of the picture. With `from_inside`, the position's own pixel shows a
    /// surface behind the position. Otherwise this pixel shows the surface that the ray leaves, and is not tested.
    #[must_use]
    pub fn ask(&self, position: Vec3, direction: Vec3, from_inside: bool) -> Answer {
        let Some(line) = Line::new(self.camera, position, direction, self.size) else { return Answer::Missing };
        let Line { start, span, far } = line;
        let least = STEP / span.x.abs().max(span.y.abs()).max(STEP);
        let rounding = ROUNDING * start.z.abs();
        let last = self.pyramid.depth() - 1;
        let [columns, rows] = self.size;
        // `enter` and `t` are fractions of the line: where the ray enters the block, and a place in that block.
        let (mut enter, mut t, mut level, mut first) = (0.0_f32, 0.0_f32, 0, !from_inside);
        for _ in 0..self.most_steps() {
            if t >= 1.0 {
                break;
            }
            let (x, y) = (start.x + span.x * t, start.y + span.y * t);
            let column = (x.max(0.0) as u32).min(columns - 1) >> level;
            let row = (y.max(0.0) as u32).min(rows - 1) >> level;
            let side = (1u32 << level) as f32;
            let leaves = |first: u32, start: f32, span: f32| match span {
                span if span > LEAST_SPAN => ((first as f32 + 1.0) * side - start) / span,
                span if span < -LEAST_SPAN => (first as f32 * side - start) / span,
                _ => 1.0,
            };
            let exit = leaves(column, start.x, span.x).min(leaves(row, start.y, span.y)).max(t).min(1.0);
            let deepest = start.z + span.z * if span.z < 0.0 { exit } else { enter };
            if first {
                first = false;
            } else if deepest <= self.pyramid.nearest(level, column, row) {
                if level > 0 {
                    level -= 1;
                    continue;
                }
                match self.cross(&line, direction, [enter, exit], [column, row], rounding) {
                    Crossing::None => {}
                    Crossing::Met => return Answer::Pixel(row as usize * columns as usize + column as usize),
                    Crossing::Hidden => return Answer::Missing,
                }
            }
            (enter, t) = (exit, exit + least);
            level = (level + 1).min(last);
        }
        if far && t >= 1.0 { Answer::Nothing } else { Answer::Missing }
    }

    /// Limit of the steps of a march. It is more than any ray needs: every pixel of the longest line, and all levels down and up.
    fn most_steps(&self) -> u32 {
        4 * (self.size[0] + self.size[1]) + 256
    }

    /// The result of a ray in a pixel that it crosses between two fractions of its line.
    #[inline]
    fn cross(
        &self,
        line: &Line,
        direction: Vec3,
        shares: [f32; 2],
        [column, row]: [u32; 2],
        rounding: f32,
    ) -> Crossing {
        let index = row as usize * self.size[0] as usize + column as usize;
        let Some(piece) = Piece::new(self.camera, self.position[index], self.normal[index]) else {
            return Crossing::None;
        };
        let [(ray_in, seen_in), (ray_out, seen_out)] = shares.map(|share| {
            let place = line.start + line.span * share;
            (place.z, piece.nearness(place.x, place.y))
        });
        let tolerance = rounding.max(ROUNDING * piece.place.z.abs());
        let [before_in, before_out] = [ray_in >= seen_in - tolerance, ray_out >= seen_out - tolerance];
        if before_in && before_out {
            return Crossing::None;
        }
        // A ray deeper behind the surface passes behind it, or comes out from behind it.
        let meets = before_in || self.camera.is_within(ray_in, seen_in, self.thickness);
        let is_glass = || self.glass.is_some_and(|(triangles, glass)| glass.contains(triangles[index]));
        if meets && piece.normal.dot(direction) < 0.0 && !is_glass() { Crossing::Met } else { Crossing::Hidden }
    }
}
