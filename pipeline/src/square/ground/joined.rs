//! Vertices that neighbouring flat pieces share.

use super::Shape;
use glam::{IVec2, Vec2};
use std::collections::HashMap;

/// Tolerance in metres: points this near to each other are the same, and points this near to an edge lie on it. It is more than
/// rounding moves a point, and less than the length of any piece.
const SAME: f32 = 1e-3;
/// Side of the grid cells in which points are looked up, metres.
const SQUARE: f32 = 2.0;

/// The corners of pieces in a grid; points within [`SAME`] of each other are stored once.
#[derive(Debug, Default)]
pub(super) struct Corners(HashMap<IVec2, Vec<Vec2>>);

impl Corners {
    pub(super) fn add(&mut self, at: Vec2) {
        if self.find(at).is_none() {
            self.0.entry(square(at)).or_default().push(at);
        }
    }

    /// The corners in all grid cells that overlap the box from `a` to `b`, enlarged by [`SAME`].
    fn around(&self, a: Vec2, b: Vec2) -> impl Iterator<Item = Vec2> {
        let (from, to) = (square(a.min(b) - SAME), square(a.max(b) + SAME));
        let squares = (from.y..=to.y).flat_map(move |y| (from.x..=to.x).map(move |x| IVec2::new(x, y)));
        squares.filter_map(|square| self.0.get(&square)).flatten().copied()
    }

    /// The stored corner within [`SAME`] of a point.
    fn find(&self, at: Vec2) -> Option<Vec2> {
        self.around(at, at).find(|other| other.distance_squared(at) < SAME * SAME)
    }

    /// The border of a piece of `shape`. `piece` holds the fractions of its corners.
    pub(super) fn border(&self, shape: Shape, piece: [Vec2; 4]) -> Border {
        let sides: [Vec<BorderVertex>; 4] = std::array::from_fn(|index| {
            let (from, to) = (piece[index], piece[(index + 1) % 4]);
            let [a, b] = [from, to].map(|fractions| {
                let at = shape.at(fractions.x, fractions.y);
                self.find(at).unwrap_or(at)
            });
            let (along, length) = (b - a, a.distance(b));
            let mut inner: Vec<(f32, Vec2)> = self
                .around(a, b)
                .map(|at| ((at - a).dot(along) / (length * length), at))
                .filter(|(share, _)| share * length > SAME && (1.0 - share) * length > SAME)
                .filter(|(share, at)| (a + along * share).distance(*at) < SAME)
                .collect();
            inner.sort_by(|a, b| a.0.total_cmp(&b.0));
            let first = BorderVertex { fractions: from, at: a };
            let inner = inner.into_iter().map(|(share, at)| BorderVertex { fractions: from.lerp(to, share), at });
            std::iter::once(first).chain(inner).collect()
        });
        // A fan from a corner has no degenerate triangle if neither side at that corner holds further vertices.
        let start = (0..4).find(|&index| sides[index].len() == 1 && sides[(index + 3) % 4].len() == 1);
        let mut vertices = sides.concat();
        vertices.rotate_left(sides[..start.unwrap_or(0)].iter().map(Vec::len).sum());
        Border { vertices, is_fan: start.is_some() }
    }
}

/// A vertex of a border: its fractions in the shape, and its position.
#[derive(Debug, Clone, Copy)]
pub(super) struct BorderVertex {
    pub(super) fractions: Vec2,
    pub(super) at: Vec2,
}

/// The border of a piece, anticlockwise seen from above: its four corners, and between them the corners of neighbouring pieces.
pub(super) struct Border {
    pub(super) vertices: Vec<BorderVertex>,
    /// Whether a triangle fan from the first vertex fills the piece; otherwise the fan needs a vertex in the middle.
    pub(super) is_fan: bool,
}

impl Border {
    pub(super) fn triangles(&self) -> usize {
        self.vertices.len() - if self.is_fan { 2 } else { 0 }
    }
}

fn square(at: Vec2) -> IVec2 {
    (at / SQUARE).floor().as_ivec2()
}
