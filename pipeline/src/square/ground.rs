//! The paving: fields of setts between bands of slabs, and rings of both around the fountain.
//!
//! The paving is a list of patches. A patch is drawn either as one flat piece with the joints painted on, or stone by
//! stone, each with its own tilt and bevelled edges over a bed of earth. Flat pieces share the vertices on their common
//! edges: where one ended along another's edge, rounding would open a crack that shows the earth.

mod joined;

use super::FOUNTAIN;
use super::math::{cos_sin, hash, hash01};
use super::mesh::{Builder, Frame};
use super::surface::Surface;
use glam::{Vec2, Vec3};
use joined::Corners;

/// Depth of the bed below the stones' tops, metres.
const BED: f32 = 0.03;
/// Side of a field of setts with its band, metres.
const FIELD: f32 = 7.5;
/// Width of a band of slabs, metres.
const BAND: f32 = 0.8;
/// Half the side of the square around the fountain in which rings replace the fields, metres.
const HALF: f32 = 2.0 * FIELD;
/// The region where single stones are worth building, near the cameras: from and to (x, z), metres.
const STONES: [Vec2; 2] = [Vec2::new(-6.0, -31.0), Vec2::new(48.5, 33.5)];

/// How much of the paving in [`STONES`] is built stone by stone. All other paving consists of flat pieces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Paving {
    /// Nothing: all patches are flat pieces.
    Flat,
    /// Slabs are stones.
    Slabs,
    /// Slabs and setts are stones with flat tops.
    Stones,
    /// Slabs and setts are stones with domed tops.
    Domed,
}

impl Paving {
    pub(super) const ALL: [Paving; 4] = [Self::Flat, Self::Slabs, Self::Stones, Self::Domed];
}

#[derive(Debug, Clone, Copy)]
enum Shape {
    /// A rectangle, by its lower and upper corner (x, z). [`Patch::flat_pieces`] lists its corners anticlockwise seen from above.
    Rectangle { min: Vec2, max: Vec2 },
    /// The part of a ring around the fountain between two radii and two angles (in turns).
    Ring { radii: [f32; 2], turns: [f32; 2] },
    /// The part between a circle and the square that encloses the rings, between two angles.
    Spandrel { radius: f32, turns: [f32; 2] },
}

impl Shape {
    /// The point at fractions `(s, t)` of the patch.
    fn at(self, s: f32, t: f32) -> Vec2 {
        match self {
            Self::Rectangle { min, max } => min + (max - min) * Vec2::new(s, t),
            Self::Ring { radii, turns } => FOUNTAIN + direction(turns, t) * (radii[0] + (radii[1] - radii[0]) * s),
            Self::Spandrel { radius, turns } => {
                let out = direction(turns, t);
                let edge = out * (HALF / out.abs().max_element());
                FOUNTAIN + (out * radius).lerp(edge, s)
            }
        }
    }
}

fn direction(turns: [f32; 2], t: f32) -> Vec2 {
    // At `t` 0 and 1 the angle is an exact multiple of an eighth of a turn, so that corners of neighbouring patches agree.
    let turn = turns[0] + (turns[1] - turns[0]) * t;
    let (cos, sin) = cos_sin(f64::from(turn));
    Vec2::new(cos as f32, sin as f32)
}

#[derive(Debug, Clone, Copy)]
struct Patch {
    shape: Shape,
    surface: Surface,
    /// Number of stones along `s` and `t`.
    stones: [u32; 2],
    /// Number of flat pieces along `s` and `t`: curved sides need several.
    pieces: [u32; 2],
    /// Whether the texture is rotated by a quarter turn, as in bands along x and in about half of the fields.
    turned: bool,
    near: bool,
}

impl Patch {
    /// Whether the patch is drawn stone by stone.
    fn in_stones(&self, paving: Paving) -> bool {
        match paving {
            Paving::Flat => false,
            Paving::Slabs => self.near && self.surface == Surface::Slabs,
            Paving::Stones | Paving::Domed => self.near,
        }
    }

    /// The flat pieces. Each has four corners as fractions `(s, t)`, anticlockwise seen from above.
    fn flat_pieces(&self) -> impl Iterator<Item = [Vec2; 4]> {
        let [columns, rows] = self.pieces;
        let at = move |column: u32, row: u32| Vec2::new(column as f32 / columns as f32, row as f32 / rows as f32);
        (0..columns).flat_map(move |column| {
            (0..rows).map(move |row| {
                let (right, up) = (column + 1, row + 1);
                [at(column, row), at(column, up), at(right, up), at(right, row)]
            })
        })
    }

    /// Texture coordinates in metres of the point `at`, which lies at `fractions` of the patch.
    fn metres(&self, fractions: Vec2, at: Vec2) -> Vec2 {
        match self.shape {
            Shape::Rectangle { .. } => metres(at, self.turned),
            // Joints follow the circle: the texture repeats a whole number of times around it.
            Shape::Ring { radii, turns } => {
                let turn = turns[0] + (turns[1] - turns[0]) * fractions.y;
                let repeats = (radii[1] * std::f32::consts::TAU / self.surface.metres()).round();
                let across = if self.surface == Surface::Slabs { 0.8 / (radii[1] - radii[0]) } else { 1.0 };
                Vec2::new(turn * repeats * self.surface.metres(), fractions.x * (radii[1] - radii[0]) * across)
            }
            Shape::Spandrel { .. } => at,
        }
    }
}

/// Whether a place lies in [`STONES`].
fn near(at: Vec2) -> bool {
    at.cmpge(STONES[0]).all() && at.cmple(STONES[1]).all()
}

fn patches(coarse: bool) -> Vec<Patch> {
    let mut patches = Vec::new();
    let mut rectangle = |min: Vec2, max: Vec2, surface: Surface, turned: bool| {
        let size = max - min;
        let center = (min + max) / 2.0;
        let stone = if surface == Surface::Slabs { Vec2::new(0.8, 1.2) } else { Vec2::splat(0.125) };
        let stone = if size.x > size.y { Vec2::new(stone.y, stone.x) } else { stone };
        let stones = (size / stone).round().max(Vec2::ONE);
        patches.push(Patch {
            shape: Shape::Rectangle { min, max },
            surface,
            stones: [stones.x as u32, stones.y as u32],
            pieces: [1, 1],
            turned,
            near: near(center),
        });
    };
    let step = if coarse { 2 } else { 1 };
    for column in (-4..8i32).step_by(step) {
        for row in (-4..8i32).step_by(step) {
            if (0..4).contains(&column) && (0..4).contains(&row) {
                continue;
            }
            let min = FOUNTAIN - Vec2::splat(HALF) + Vec2::new(column as f32, row as f32) * FIELD;
            let max = min + Vec2::splat(FIELD * step as f32);
            rectangle(min, Vec2::new(max.x, min.y + BAND), Surface::Slabs, true);
            rectangle(Vec2::new(min.x, min.y + BAND), Vec2::new(min.x + BAND, max.y), Surface::Slabs, false);
            let turned = hash(column as u32, row as u32, 3).is_multiple_of(2);
            let (low, high) = (min + Vec2::splat(BAND), max);
            if coarse || !near(low) || !near(high) {
                rectangle(low, high, Surface::Setts, turned);
                continue;
            }
            // A dark frame in each field.
            let (low_1, high_1) = (low + Vec2::splat(0.7), high - Vec2::splat(0.7));
            let (low_2, high_2) = (low_1 + Vec2::splat(0.36), high_1 - Vec2::splat(0.36));
            for (a, b, c, d, surface) in
                [(low, low_1, high_1, high, Surface::Setts), (low_1, low_2, high_2, high_1, Surface::Basalt)]
            {
                rectangle(a, Vec2::new(d.x, b.y), surface, turned);
                rectangle(Vec2::new(a.x, c.y), d, surface, turned);
                rectangle(Vec2::new(a.x, b.y), Vec2::new(b.x, c.y), surface, turned);
                rectangle(Vec2::new(c.x, b.y), Vec2::new(d.x, c.y), surface, turned);
            }
            rectangle(low_2, high_2, Surface::Setts, turned);
        }
    }
    // Rings from under the fountain's steps outwards: inner and outer radius, surface, width of a stone.
    let rings = [
        (5.85, 6.9, Surface::Slabs, 0.9),
        (6.9, 7.4, Surface::Basalt, 0.125),
        (7.4, 9.2, Surface::Setts, 0.125),
        (9.2, 9.8, Surface::Slabs, 0.6),
        (9.8, 10.5, Surface::Basalt, 0.125),
        (10.5, 11.7, Surface::Setts, 0.125),
        (11.7, 12.4, Surface::Basalt, 0.125),
        (12.4, 13.2, Surface::Slabs, 0.8),
    ];
    let sectors = 8;
    for sector in 0..sectors {
        let turns = [sector as f32 / sectors as f32, (sector + 1) as f32 / sectors as f32];
        let pieces = if coarse { 1 } else { 6 };
        for &(inner, outer, surface, stone) in &rings {
            let arc = (inner + outer) / 2.0 * std::f32::consts::TAU / sectors as f32;
            let along = if surface == Surface::Slabs { 1.1 } else { stone };
            patches.push(Patch {
                shape: Shape::Ring { radii: [inner, outer], turns },
                surface,
                stones: [((outer - inner) / stone).round().max(1.0) as u32, (arc / along).round() as u32],
                pieces: [1, pieces],
                turned: false,
                near: true,
            });
        }
        patches.push(Patch {
            shape: Shape::Spandrel { radius: 13.2, turns },
            surface: Surface::Setts,
            stones: [32, 92],
            pieces: [1, pieces],
            turned: false,
            near: true,
        });
    }
    patches
}

/// Number of triangles of the paving that [`build`] makes.
pub(super) fn triangles(paving: Paving, coarse: bool) -> usize {
    let patches = patches(coarse);
    let corners = flat_corners(&patches, paving);
    let triangles = |patch: &Patch| {
        if patch.in_stones(paving) {
            let stones = patch.stones[0] as usize * patch.stones[1] as usize;
            stones * if paving == Paving::Domed { 20 } else { 10 }
        } else {
            patch.flat_pieces().map(|piece| corners.border(patch.shape, piece).triangles()).sum()
        }
    };
    patches.iter().map(triangles).sum()
}

/// The corners of all flat pieces.
fn flat_corners(patches: &[Patch], paving: Paving) -> Corners {
    let mut corners = Corners::default();
    for patch in patches.iter().filter(|patch| !patch.in_stones(paving)) {
        patch.flat_pieces().flatten().for_each(|at| corners.add(patch.shape.at(at.x, at.y)));
    }
    corners
}

/// Builds the paving and the earth around and under it.
pub(super) fn build(paving: Paving, coarse: bool) -> Builder {
    let mut builder = Builder::default();
    let earth = Frame::upright(Vec3::new(FOUNTAIN.x, -BED, FOUNTAIN.y));
    let wide = 420.0;
    let corner = |x: f32, z: f32| Vec3::new(x * wide, 0.0, z * wide);
    let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    builder.polygon(Surface::Garden, &earth, &corners);
    let patches = patches(coarse);
    let corners = flat_corners(&patches, paving);
    for (index, patch) in patches.iter().enumerate() {
        if patch.in_stones(paving) {
            stones(&mut builder, patch, index as u32, paving == Paving::Domed);
        } else {
            flat(&mut builder, patch, &corners);
        }
    }
    builder
}

/// Texture coordinates, in metres, of a point; rotated by a quarter turn if `turned`.
fn metres(at: Vec2, turned: bool) -> Vec2 {
    if turned { Vec2::new(at.y + 1.7, at.x) } else { at }
}

fn flat(builder: &mut Builder, patch: &Patch, corners: &Corners) {
    for piece in patch.flat_pieces() {
        let mut vertex = |fractions: Vec2, at: Vec2| {
            builder.vertex(Vec3::new(at.x, 0.0, at.y), Vec3::Y, patch.metres(fractions, at), patch.surface)
        };
        let border = corners.border(patch.shape, piece);
        let around: Vec<u32> = border.vertices.iter().map(|found| vertex(found.fractions, found.at)).collect();
        let whole = if border.is_fan {
            around.windows(2).skip(1).map(|edge| [around[0], edge[0], edge[1]]).collect()
        } else {
            let middle = (piece[0] + piece[2]) / 2.0;
            let middle = vertex(middle, patch.shape.at(middle.x, middle.y));
            let next = around.iter().cycle().skip(1);
            around.iter().zip(next).map(|(&from, &to)| [middle, from, to]).collect::<Vec<_>>()
        };
        whole.into_iter().for_each(|triangle| builder.triangle(patch.surface, triangle));
    }
}

/// Builds one bevelled block for each stone of a patch. Joints are wide enough to see and narrower than the bevel.
fn stones(builder: &mut Builder, patch: &Patch, seed: u32, domed: bool) {
    let [columns, rows] = patch.stones;
    let (joint, bevel, uneven) =
        if patch.surface == Surface::Slabs { (0.006, 0.008, 0.004) } else { (0.007, 0.012, 0.007) };
    let count = columns as usize * rows as usize;
    builder.reserve(
        stone_surface(patch.surface),
        count * if domed { 13 } else { 20 },
        count * if domed { 20 } else { 10 },
    );
    for row in 0..rows {
        for column in 0..columns {
            let corner = |right: u32, up: u32| {
                // Corners move a little at random; neighbouring stones share the corner.
                let (c, r) = (column + right, row + up);
                let inner = c > 0 && c < columns && r > 0 && r < rows;
                let wander = if inner { 0.12 } else { 0.0 };
                let (dc, dr) = (hash01(c, r, seed) - 0.5, hash01(c, r, seed ^ 0x55) - 0.5);
                let s = (c as f32 + wander * dc) / columns as f32;
                let t = (r as f32 + wander * dr) / rows as f32;
                patch.shape.at(s, t)
            };
            let corners = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
            let id = hash(column, row, seed.wrapping_mul(31));
            stone(builder, patch, corners, [joint, bevel, uneven], id, domed);
        }
    }
}

/// The surface of single stones in a patch of this paving.
fn stone_surface(paving: Surface) -> Surface {
    match paving {
        Surface::Slabs => Surface::SlabStone,
        Surface::Basalt => Surface::BasaltStone,
        _ => Surface::SettStone,
    }
}

/// Builds one stone. `size` is half the joint's width, the bevel and the unevenness, metres.
fn stone(builder: &mut Builder, patch: &Patch, corners: [Vec2; 4], size: [f32; 3], id: u32, domed: bool) {
    let [joint, bevel, uneven] = size;
    let center = (corners[0] + corners[1] + corners[2] + corners[3]) / 4.0;
    // Unit vectors from the centre along `s` and `t`; corners are inset along both.
    let along = ((corners[3] + corners[2] - corners[0] - corners[1]) / 4.0).normalize_or(Vec2::X);
    let across = ((corners[1] + corners[2] - corners[0] - corners[3]) / 4.0).normalize_or(Vec2::Y);
    let inset = |by: f32| -> [Vec2; 4] {
        let ways = [along + across, along - across, -along - across, across - along];
        std::array::from_fn(|index| corners[index] + ways[index] * by)
    };
    let tilt = Vec2::new(hash01(id, 1, 0) - 0.5, hash01(id, 2, 0) - 0.5) * 2.0 * uneven;
    let lift = (hash01(id, 3, 0) - 1.0) * uneven;
    let extent = (corners[2] - corners[0]).abs().max(Vec2::splat(0.05));
    let top_at = |at: Vec2| {
        let slope = (at - center) / extent * tilt;
        Vec3::new(at.x, lift + slope.x + slope.y, at.y)
    };
    // Each stone shows another part of a plain texture.
    let shift = Vec2::new(hash01(id, 4, 0), hash01(id, 5, 0)) * 4.0;
    let metres = |at: Vec2| if patch.surface == Surface::Slabs { at } else { at * 0.15 + shift };
    let surface = stone_surface(patch.surface);
    let lower = inset(joint);
    let upper = inset(joint + bevel);
    let bottom = lower.map(|at| Vec3::new(at.x, -BED, at.y));
    let top = upper.map(top_at);
    let flat = (top[1] - top[0]).cross(top[3] - top[0]).normalize_or(Vec3::Y);
    if domed {
        let crown = top_at(center) + Vec3::Y * uneven;
        let middle = builder.vertex(crown, flat, metres(center), surface);
        let ring: [u32; 4] = std::array::from_fn(|index| {
            let out = Vec3::new(upper[index].x - center.x, 0.0, upper[index].y - center.y).normalize_or(Vec3::X);
            builder.vertex(top[index], (flat + out * 0.2).normalize(), metres(upper[index]), surface)
        });
        for index in 0..4 {
            builder.triangle(surface, [middle, ring[index], ring[(index + 1) % 4]]);
        }
        let below: [u32; 4] = std::array::from_fn(|index| {
            let out = Vec3::new(upper[index].x - center.x, 0.0, upper[index].y - center.y).normalize_or(Vec3::X);
            builder.vertex(bottom[index], (out + Vec3::Y * 0.3).normalize(), metres(lower[index]), surface)
        });
        // A ring of vertices between bottom and top rounds the shoulder.
        let shoulder = inset(joint + 0.3 * bevel);
        let waist: [u32; 4] = std::array::from_fn(|index| {
            let out = Vec3::new(upper[index].x - center.x, 0.0, upper[index].y - center.y).normalize_or(Vec3::X);
            let at = shoulder[index];
            let position = Vec3::new(at.x, top[index].y - 0.7 * bevel, at.y);
            builder.vertex(position, (out + Vec3::Y).normalize(), metres(at), surface)
        });
        for index in 0..4 {
            let next = (index + 1) % 4;
            builder.quad(surface, [waist[index], waist[next], ring[next], ring[index]]);
            builder.quad(surface, [below[index], below[next], waist[next], waist[index]]);
        }
        return;
    }
    let ring = std::array::from_fn(|index| builder.vertex(top[index], flat, metres(upper[index]), surface));
    builder.quad(surface, ring);
    for index in 0..4 {
        let next = (index + 1) % 4;
        let side = [bottom[index], bottom[next], top[next], top[index]];
        let normal = (side[1] - side[0]).cross(side[3] - side[0]).normalize_or(Vec3::Y);
        let shades = [lower[index], lower[next], upper[next], upper[index]];
        let quad = std::array::from_fn(|corner| builder.vertex(side[corner], normal, metres(shades[corner]), surface));
        builder.quad(surface, quad);
    }
}
