//! Hipped and gabled roofs. A roof is a list of slopes; a slope is drawn as one tiled polygon, as waves, or as courses
//! of overlapping pan and cover tiles.

use super::detail::Detail;
use super::math::{cos_sin, hash01};
use super::mesh::{Builder, Frame};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// How far the eaves stand out, metres.
pub(super) const EAVES: f32 = 0.42;
/// Thickness of the tiles' edge, metres.
const EDGE: f32 = 0.07;
/// Width of a column of tiles and visible length of a tile, metres.
const TILE: Vec2 = Vec2::new(0.24, 0.36);

/// How roofs are tiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tiling {
    /// Pieces across a column of tiles; 0 for painted tiles.
    pub pieces: u32,
    /// Whether courses overlap.
    pub courses: bool,
}

impl Tiling {
    /// All tilings, from painted to the finest.
    pub(super) const ALL: [Tiling; 8] = [
        Tiling { pieces: 0, courses: false },
        Tiling { pieces: 2, courses: false },
        Tiling { pieces: 4, courses: false },
        Tiling { pieces: 2, courses: true },
        Tiling { pieces: 4, courses: true },
        Tiling { pieces: 6, courses: true },
        Tiling { pieces: 8, courses: true },
        Tiling { pieces: 12, courses: true },
    ];
}

/// A plane part of a roof: `width` metres along the eaves, `length` metres up the slope. Both sides lean inwards by `cut` metres
/// per metre of slope.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slope {
    /// `x` along the eaves, `y` up the slope, `z` off the surface.
    frame: Frame,
    width: f32,
    length: f32,
    cut: f32,
    seed: u32,
}

impl Slope {
    fn columns(&self) -> u32 {
        (self.width / TILE.x).ceil() as u32
    }

    fn courses(&self) -> u32 {
        (self.length / TILE.y).ceil() as u32
    }

    /// Length of the slope at a distance `x` along the eaves.
    fn height_at(&self, x: f32) -> f32 {
        if self.cut == 0.0 { self.length } else { (x.min(self.width - x).max(0.0) / self.cut).min(self.length) }
    }

    /// Greatest number of triangles that [`Self::build`] makes.
    pub(super) fn triangles(&self, tiling: Tiling) -> usize {
        if tiling.pieces == 0 {
            return 2;
        }
        let across = (self.columns() * tiling.pieces) as usize;
        if !tiling.courses {
            return across * 2;
        }
        // Courses shorten towards the ridge where the sides lean.
        (0..self.courses()).map(|course| self.course(course, tiling).1 as usize * 4).sum()
    }

    /// The first piece of a course, its number of pieces, and the distances of its lower and upper edge from the eaves.
    fn course(&self, course: u32, tiling: Tiling) -> (u32, u32, f32, f32) {
        let across = self.columns() * tiling.pieces;
        let (low, high) = (course as f32 * TILE.y, ((course + 1) as f32 * TILE.y).min(self.length));
        let step = self.width / across as f32;
        let first = (self.cut * low / step).floor() as u32;
        let first = first.min(across / 2);
        (first, across - 2 * first, low, high)
    }

    /// Builds the slope.
    pub(super) fn build(&self, builder: &mut Builder, tiling: Tiling) {
        if tiling.pieces == 0 {
            let top = self.cut * self.length;
            let corners = [
                Vec3::ZERO,
                Vec3::new(self.width, 0.0, 0.0),
                Vec3::new(self.width - top, self.length, 0.0),
                Vec3::new(top, self.length, 0.0),
            ];
            let triangle = self.width - 2.0 * top < 1e-3;
            builder.polygon(Surface::RoofTiles, &self.frame, if triangle { &corners[..3] } else { &corners });
            return;
        }
        if tiling.courses {
            for course in 0..self.courses() {
                self.build_course(builder, tiling, course);
            }
        } else {
            let across = self.columns() * tiling.pieces;
            builder.grid(Surface::RoofTiles, across, 1, |column, row| {
                let x = self.width * column as f32 / across as f32;
                let y = if row == 0 { 0.0 } else { self.height_at(x) };
                self.vertex(x, y, 0.0, column, tiling.pieces, Vec2::ZERO)
            });
        }
    }

    /// A strip of tiles whose lower edge rises above the course below, and the lip that closes the step.
    fn build_course(&self, builder: &mut Builder, tiling: Tiling, course: u32) {
        const STEP: f32 = 0.022;
        let (first, count, low, high) = self.course(course, tiling);
        let across = self.columns() * tiling.pieces;
        let at = |column: u32| self.width * (first + column) as f32 / across as f32;
        let shift = |column: u32| {
            // Each tile shows another part of the clay texture.
            let tile = (first + column) / tiling.pieces;
            Vec2::new(hash01(tile / 2, course, self.seed), hash01(tile / 2, course, self.seed + 1)) * 0.2
        };
        builder.grid(Surface::Terracotta, count, 1, |column, row| {
            let (y, lift) = if row == 0 { (low, STEP) } else { (high, 0.0) };
            let x = at(column);
            self.vertex(x, y.min(self.height_at(x)), lift, first + column, tiling.pieces, shift(column))
        });
        builder.grid(Surface::Terracotta, count, 1, |column, row| {
            let lift = if row == 0 { -0.006 } else { STEP };
            let x = at(column);
            let (position, _, metres) =
                self.vertex(x, low.min(self.height_at(x)), lift, first + column, tiling.pieces, shift(column));
            (position, self.frame.direction(Vec3::NEG_Y), metres)
        });
    }

    fn vertex(&self, x: f32, y: f32, lift: f32, column: u32, pieces: u32, shift: Vec2) -> (Vec3, Vec3, Vec2) {
        const WAVE: f32 = 0.045;
        let (cos, sin) = cos_sin(f64::from(column % pieces) / f64::from(pieces));
        let height = WAVE * (0.5 - 0.5 * cos as f32);
        let slope = WAVE * std::f32::consts::PI / TILE.x * sin as f32;
        let normal = Vec3::new(-slope, 0.0, 1.0).normalize();
        let position = self.frame.point(Vec3::new(x, y, height + lift));
        (position, self.frame.direction(normal), Vec2::new(x, y) + shift)
    }
}

/// The kinds of roof.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Four slopes.
    Hip,
    /// Two slopes, the ridge along the facade, walls up to the ridge at both ends.
    Gable,
}

/// A roof over a rectangular house.
#[derive(Debug, Clone, Copy)]
pub(super) struct Roof {
    /// Width of the facade and depth of the house, metres.
    pub size: [f32; 2],
    /// Slope: metres up per metre inwards; 0.466 is 25 degrees.
    pub rise: f32,
    pub kind: Kind,
    /// Material of the walls under a gable.
    pub wall: Surface,
    pub seed: u32,
}

/// Adds the parts of a roof other than its slopes (edges, caps, gable walls), and returns the slopes. `frame` is at the left end of
/// the facade, at the height of the eaves.
pub(super) fn build(builder: &mut Builder, frame: &Frame, roof: &Roof, detail: Detail) -> Vec<Slope> {
    let Roof { size: [width, depth], rise, kind, wall, seed } = *roof;
    let side = if kind == Kind::Hip { EAVES } else { 0.0 };
    // Plan of the eaves: left and right x, back and front z.
    let (left, right, back, front) = (-side, width + side, -depth - EAVES, EAVES);
    let half = (front - back) / 2.0;
    let stretch = (1.0 + rise * rise).sqrt();
    let (up, out) = (rise / stretch, 1.0 / stretch);
    let ridge = EDGE + half * rise;
    let corner = |x: f32, z: f32| Vec3::new(x, EDGE, z);
    let slope = |from: Vec3, along: Vec3, inward: Vec3, width: f32, cut: f32| {
        let (x, y) = (frame.direction(along), frame.direction(inward * out + Vec3::Y * up));
        let frame = Frame { origin: frame.point(from), x, y, z: x.cross(y) };
        Slope { frame, width, length: half * stretch, cut, seed }
    };
    let hip = kind == Kind::Hip;
    let cut = if hip { out } else { 0.0 };
    let mut slopes = vec![
        slope(corner(left, front), Vec3::X, Vec3::NEG_Z, right - left, cut),
        slope(corner(right, back), Vec3::NEG_X, Vec3::Z, right - left, cut),
    ];
    let (ridge_left, ridge_right) = if hip { (left + half, right - half) } else { (left, right) };
    let middle = (front + back) / 2.0;
    let (a, b) = (Vec3::new(ridge_left, ridge, middle), Vec3::new(ridge_right, ridge, middle));
    let round = detail.curve(4).clamp(4, 12);
    let capped = detail.at_least(1);
    let mut cap = |from: Vec3, to: Vec3| {
        if !capped {
            return;
        }
        builder.tube(Surface::RoofTiles, frame, round, &[(from, 0.10), (to, 0.10)]);
    };
    cap(a, b);
    let ends = [(corner(left, front), a), (corner(left, back), a), (corner(right, front), b), (corner(right, back), b)];
    for (from, to) in ends {
        cap(from + Vec3::Y * 0.02, to);
    }
    if hip {
        slopes.push(slope(corner(left, back), Vec3::Z, Vec3::X, front - back, cut));
        slopes.push(slope(corner(right, front), Vec3::NEG_Z, Vec3::NEG_X, front - back, cut));
    } else {
        let crown = ridge - 0.01;
        let shoulder = EDGE + EAVES * rise - 0.01;
        let end = |x: f32| {
            [
                Vec3::new(x, 0.0, 0.0),
                Vec3::new(x, shoulder, 0.0),
                Vec3::new(x, crown, middle),
                Vec3::new(x, shoulder, -depth),
                Vec3::new(x, 0.0, -depth),
            ]
        };
        builder.polygon(wall, frame, &end(0.0));
        let mut other = end(width);
        other.reverse();
        builder.polygon(wall, frame, &other);
    }
    eaves(builder, frame, [left, right, back, front], hip);
    slopes
}

/// The edge of the tiles and the boards under it.
fn eaves(builder: &mut Builder, frame: &Frame, [left, right, back, front]: [f32; 4], all: bool) {
    let at = Vec3::new;
    let mut edge = |from: Vec3, to: Vec3| {
        builder.polygon(Surface::RoofTiles, frame, &[from, to, to + Vec3::Y * EDGE, from + Vec3::Y * EDGE]);
    };
    edge(at(left, 0.0, front), at(right, 0.0, front));
    edge(at(right, 0.0, back), at(left, 0.0, back));
    if all {
        edge(at(left, 0.0, back), at(left, 0.0, front));
        edge(at(right, 0.0, front), at(right, 0.0, back));
    }
    let mut board = |min: Vec2, max: Vec2| {
        let corners = [at(min.x, 0.0, min.y), at(max.x, 0.0, min.y), at(max.x, 0.0, max.y), at(min.x, 0.0, max.y)];
        builder.polygon(Surface::Timber, frame, &corners);
    };
    board(Vec2::new(left, front - EAVES), Vec2::new(right, front));
    board(Vec2::new(left, back), Vec2::new(right, back + EAVES));
    if all {
        board(Vec2::new(left, back + EAVES), Vec2::new(left + EAVES, front - EAVES));
        board(Vec2::new(right - EAVES, back + EAVES), Vec2::new(right, front - EAVES));
    }
}
