//! Streams of the pairs that are examined; only a part of the pairs is in memory at a time.

use super::Surfaces;
use super::shaft::Pair;
use super::tree::{LEAF, NONE, Tree, WIDE};
use glam::Vec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// A position in a stream of pairs; its meaning is the stream's own.
pub type Cursor = [u64; 2];

/// A stream of pairs, in an order that depends only on the scene and the request.
pub trait PairSource {
    /// Appends the next pairs: about `most`, and at most about two million more. Appends none at the end of the stream.
    ///
    /// # Errors
    /// If the source is faulty; the message says what is wrong, and where.
    fn fill(&mut self, most: usize, pairs: &mut Vec<[u32; 2]>) -> Result<(), String>;

    /// Position of the next pair.
    fn cursor(&self) -> Cursor;

    /// Continues from a position that [`Self::cursor`] returned.
    ///
    /// # Errors
    /// If the source cannot go there.
    fn seek(&mut self, cursor: Cursor) -> Result<(), String>;

    /// How much of the source is done, and how much there is, in units of the source (not pairs).
    fn progress(&self) -> [u64; 2];
}

/// Every pair once, with `a < b`: their number grows with the square of the number of triangles.
#[derive(Debug, Clone)]
pub struct AllPairs {
    triangles: u64,
    next: Cursor,
}

impl AllPairs {
    /// The pairs of that many triangles.
    #[must_use]
    pub fn new(triangles: usize) -> Self {
        Self { triangles: triangles as u64, next: [0, 1] }
    }
}

impl PairSource for AllPairs {
    fn fill(&mut self, most: usize, pairs: &mut Vec<[u32; 2]>) -> Result<(), String> {
        let [mut a, mut b] = self.next;
        for _ in 0..most {
            if b >= self.triangles {
                (a, b) = (a + 1, a + 2);
            }
            if b >= self.triangles {
                break;
            }
            pairs.push([a as u32, b as u32]);
            b += 1;
        }
        self.next = [a, b];
        Ok(())
    }

    fn cursor(&self) -> Cursor {
        self.next
    }

    fn seek(&mut self, cursor: Cursor) -> Result<(), String> {
        self.next = cursor;
        Ok(())
    }

    fn progress(&self) -> [u64; 2] {
        let (n, [a, b]) = (self.triangles, self.next);
        let all = n * n.saturating_sub(1) / 2;
        let rows = a.min(n) * (2 * n).saturating_sub(a.min(n) + 1) / 2;
        [(rows + b.saturating_sub(a + 1)).min(all), all]
    }
}

/// One triangle paired with every other.
#[derive(Debug, Clone)]
pub struct RowPairs {
    triangles: u64,
    row: u32,
    next: u64,
}

impl RowPairs {
    /// The pairs of the triangle `row` among `triangles`.
    #[must_use]
    pub fn new(triangles: usize, row: u32) -> Self {
        Self { triangles: triangles as u64, row, next: 0 }
    }
}

impl PairSource for RowPairs {
    fn fill(&mut self, most: usize, pairs: &mut Vec<[u32; 2]>) -> Result<(), String> {
        let end = self.triangles.min(self.next + most as u64);
        let others = (self.next..end).map(|other| other as u32).filter(|other| *other != self.row);
        pairs.extend(others.map(|other| [self.row, other]));
        self.next = end;
        Ok(())
    }

    fn cursor(&self) -> Cursor {
        [self.next, 0]
    }

    fn seek(&mut self, cursor: Cursor) -> Result<(), String> {
        self.next = cursor[0];
        Ok(())
    }

    fn progress(&self) -> [u64; 2] {
        [self.next, self.triangles]
    }
}

/// Windows (see [`WINDOW`]) that are searched together.
const ROWS: u64 = 32;
/// Greatest number of partner ids in a window. A window is a part of a row, the pairs of one triangle; this bounds the memory of a search.
const WINDOW: u64 = 1 << 16;

/// Pairs of triangles that face each other, of which one may receive at least the share `least` of what leaves the other. The bound is `F
/// <= A / (π d²)`: `A` is the larger area and `d` the distance of their boxes (Hanrahan, Salzman and Aupperle, "A Rapid Hierarchical
/// Radiosity Algorithm", 1991). Pairs have `a < b` and come in ascending order.
#[derive(Debug)]
pub struct NearPairs<'a> {
    surfaces: &'a Surfaces,
    tree: Tree,
    /// For each child of each node: the largest area, the lowest id and the highest id of its triangles.
    below: Vec<[(f64, u32, u32); WIDE]>,
    areas: Vec<f64>,
    least: f64,
    /// The current row, and its first id that is still to be searched.
    next: Cursor,
}

impl<'a> NearPairs<'a> {
    /// `least` must be above 0. At 1, only pairs are left whose boxes are no farther apart than the square root of `A / π`.
    #[must_use]
    pub fn new(surfaces: &'a Surfaces, least: f64) -> Self {
        let tree = Tree::build(surfaces.geometry(), |_| true);
        let areas: Vec<f64> = (0..surfaces.len() as u32).map(|id| surfaces.area(id)).collect();
        let mut below = vec![[(0.0, u32::MAX, 0); WIDE]; tree.nodes.len()];
        // Children follow their node, so this goes backwards.
        for index in (0..tree.nodes.len()).rev() {
            for lane in 0..WIDE {
                let child = tree.nodes[index].children[lane];
                let join = |(area, low, high): (f64, u32, u32), (other, l, h): (f64, u32, u32)| {
                    (area.max(other), low.min(l), high.max(h))
                };
                below[index][lane] = if child == NONE {
                    (0.0, u32::MAX, 0)
                } else if child & LEAF == 0 {
                    below[child as usize].into_iter().fold((0.0, u32::MAX, 0), join)
                } else {
                    let ids = tree.leaves[(child & !LEAF) as usize].ids.iter().filter(|id| **id != NONE);
                    ids.fold((0.0, u32::MAX, 0), |all, id| join(all, (areas[*id as usize], *id, *id)))
                };
            }
        }
        Self { surfaces, tree, below, areas, least, next: [0, 0] }
    }

    /// The partners of `a` with ids from `first` to before `end`, ascending.
    fn row(&self, a: u32, first: u32, end: u32) -> Vec<u32> {
        let mut found = Vec::new();
        let [low, high] = self.extent(a);
        let own = self.areas[a as usize];
        let near = |area: f64, square: f64| own.max(area) >= self.least * PI * square;
        let mut stack = if self.tree.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index as usize];
            for lane in 0..WIDE {
                let (child, (area, least, most)) = (node.children[lane], self.below[index as usize][lane]);
                if child == NONE || most < first || least >= end {
                    continue;
                }
                let box_low = Vec3::new(node.low[0][lane], node.low[1][lane], node.low[2][lane]);
                let box_high = Vec3::new(node.high[0][lane], node.high[1][lane], node.high[2][lane]);
                if !near(area, gap([low, high], [box_low, box_high])) {
                    continue;
                }
                if child & LEAF == 0 {
                    stack.push(child);
                    continue;
                }
                for id in self.tree.leaves[(child & !LEAF) as usize].ids {
                    if id != NONE
                        && (first..end).contains(&id)
                        && near(self.areas[id as usize], gap([low, high], self.extent(id)))
                        && Pair::new(self.surfaces, [a, id]).is_some()
                    {
                        found.push(id);
                    }
                }
            }
        }
        found.sort_unstable();
        found
    }

    fn extent(&self, id: u32) -> [Vec3; 2] {
        let [a, b, c] = self.surfaces.geometry().corners(id);
        [a.min(b).min(c), a.max(b).max(c)]
    }
}

/// The square of the distance between two boxes.
fn gap([low, high]: [Vec3; 2], [other_low, other_high]: [Vec3; 2]) -> f64 {
    let apart = (other_low.as_dvec3() - high.as_dvec3()).max(low.as_dvec3() - other_high.as_dvec3());
    apart.max(glam::DVec3::ZERO).length_squared()
}

impl PairSource for NearPairs<'_> {
    fn fill(&mut self, most: usize, pairs: &mut Vec<[u32; 2]>) -> Result<(), String> {
        let count = self.areas.len() as u64;
        let (start, wanted) = (pairs.len(), most.max(1));
        while pairs.len() - start < wanted && self.next[0] < count {
            // The next windows in order; they are searched in parallel.
            let windows: Vec<(u32, u32, u32)> = (0..ROWS)
                .scan(self.next, |[row, first], _| {
                    *first = (*first).max(*row + 1);
                    let window = (*row as u32, *first as u32, (*first + WINDOW).min(count) as u32);
                    let valid = *row < count;
                    *first += WINDOW;
                    if *first >= count {
                        (*row, *first) = (*row + 1, 0);
                    }
                    valid.then_some(window)
                })
                .collect();
            let found: Vec<Vec<u32>> =
                windows.par_iter().map(|(row, first, end)| self.row(*row, *first, *end)).collect();
            for ((row, _, end), found) in windows.iter().zip(found) {
                pairs.extend(found.into_iter().map(|other| [*row, other]));
                let end = u64::from(*end);
                self.next = if end >= count { [u64::from(*row) + 1, 0] } else { [u64::from(*row), end] };
            }
        }
        Ok(())
    }

    fn cursor(&self) -> Cursor {
        self.next
    }

    fn seek(&mut self, cursor: Cursor) -> Result<(), String> {
        self.next = cursor;
        Ok(())
    }

    fn progress(&self) -> [u64; 2] {
        [self.next[0], self.areas.len() as u64]
    }
}
