//! A tree of boxes over the triangles that block, searched with shafts and with distances.
//!
//! [`Bvh`](crate::trace::Bvh) only traces rays; pairs need the triangles inside a volume, and the largest area in each subtree.

use crate::trace::Bounds;
use curitiba_pipeline::scene::Geometry;

/// Number of children of a node, and of triangles of a leaf.
pub(super) const WIDE: usize = 8;
/// Bins of the surface area heuristic.
const BINS: usize = 16;
/// From this depth on (each node counts three), triangles are halved by their order, which bounds the depth.
const DEEP: usize = 48;

/// Flag of a child that is a leaf.
pub(super) const LEAF: u32 = 1 << 31;
/// No child.
pub(super) const NONE: u32 = u32::MAX;

/// Eight boxes by axis; unused lanes have empty boxes.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct Node {
    pub(super) low: [[f32; WIDE]; 3],
    pub(super) high: [[f32; WIDE]; 3],
    /// For each child: the index of a node, or the index of a leaf with [`LEAF`] set, or [`NONE`].
    pub(super) children: [u32; WIDE],
}

/// Eight triangles, `[corner][axis]`. Unused lanes hold NaN and the id [`NONE`].
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct Leaf {
    pub(super) corners: [[[f32; WIDE]; 3]; 3],
    pub(super) ids: [u32; WIDE],
}

/// The tree; its root is node 0, unless it is empty.
#[derive(Debug, Default)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
}

#[derive(Debug, Clone, Copy)]
struct Item {
    extent: Bounds,
    id: u32,
}

/// A range of items that becomes a child.
#[derive(Clone, Copy)]
struct Part {
    first: usize,
    end: usize,
    extent: Bounds,
}

impl Tree {
    /// The tree over the triangles with finite corners for which `wanted` returns true.
    pub(super) fn build(geometry: &Geometry, wanted: impl Fn(u32) -> bool) -> Self {
        let mut items: Vec<Item> = (0..geometry.triangles.len() as u32)
            .filter(|id| wanted(*id))
            .filter_map(|id| {
                let extent = Bounds::of(&geometry.corners(id));
                (extent.low.is_finite() && extent.high.is_finite()).then_some(Item { extent, id })
            })
            .collect();
        let mut tree = Self::default();
        if !items.is_empty() {
            let end = items.len();
            tree.node(geometry, &mut items, Part { first: 0, end, extent: Bounds::EMPTY }, 0);
        }
        tree
    }

    /// Appends the node over a part, and everything below it.
    fn node(&mut self, geometry: &Geometry, items: &mut [Item], part: Part, depth: usize) -> u32 {
        let mut parts = vec![part];
        // Of the parts that are too large for a leaf, divides the one with the largest surface, until there are eight parts.
        while parts.len() < WIDE {
            let largest = (0..parts.len())
                .filter(|index| parts[*index].end - parts[*index].first > WIDE)
                .max_by(|a, b| parts[*a].extent.half_area().total_cmp(&parts[*b].extent.half_area()));
            let Some(largest) = largest else { break };
            let whole = parts.swap_remove(largest);
            let middle = whole.first + divide(&mut items[whole.first..whole.end], depth);
            for (first, end) in [(whole.first, middle), (middle, whole.end)] {
                let extent = items[first..end].iter().fold(Bounds::EMPTY, |all, item| all.union(item.extent));
                parts.push(Part { first, end, extent });
            }
        }
        if let [only] = &mut parts[..] {
            only.extent = items[only.first..only.end].iter().fold(Bounds::EMPTY, |all, item| all.union(item.extent));
        }
        let index = self.nodes.len();
        let none =
            Node { low: [[f32::INFINITY; WIDE]; 3], high: [[f32::NEG_INFINITY; WIDE]; 3], children: [NONE; WIDE] };
        self.nodes.push(none);
        for (lane, part) in parts.into_iter().enumerate() {
            for axis in 0..3 {
                self.nodes[index].low[axis][lane] = part.extent.low[axis];
                self.nodes[index].high[axis][lane] = part.extent.high[axis];
            }
            let child = if part.end - part.first <= WIDE {
                self.leaf(geometry, &items[part.first..part.end])
            } else {
                self.node(geometry, items, part, depth + 3)
            };
            self.nodes[index].children[lane] = child;
        }
        index as u32
    }

    fn leaf(&mut self, geometry: &Geometry, items: &[Item]) -> u32 {
        let mut leaf = Leaf { corners: [[[f32::NAN; WIDE]; 3]; 3], ids: [NONE; WIDE] };
        for (lane, item) in items.iter().enumerate() {
            for (corner, position) in geometry.corners(item.id).into_iter().enumerate() {
                for axis in 0..3 {
                    leaf.corners[corner][axis][lane] = position[axis];
                }
            }
            leaf.ids[lane] = item.id;
        }
        self.leaves.push(leaf);
        LEAF | (self.leaves.len() - 1) as u32
    }
}

/// Reorders items into two non-empty parts and returns where the second begins, by the binned surface area heuristic (Wald, "On fast
/// Construction of SAH-based Bounding Volume Hierarchies", 2007).
fn divide(items: &mut [Item], depth: usize) -> usize {
    let half = items.len() / 2;
    if depth >= DEEP {
        return half;
    }
    let middles = items.iter().fold(Bounds::EMPTY, |all, item| all.union(Bounds::of(&[item.extent.middle()])));
    let side = middles.high - middles.low;
    let bin = |axis: usize, item: &Item| {
        let place = (item.extent.middle()[axis] - middles.low[axis]) / side[axis] * BINS as f32;
        (place as usize).min(BINS - 1)
    };
    let mut best = (f32::INFINITY, 0, 0);
    for axis in (0..3).filter(|axis| side[*axis] > 0.0) {
        let mut bins = [(Bounds::EMPTY, 0_usize); BINS];
        for item in items.iter() {
            let (extent, count) = &mut bins[bin(axis, item)];
            (*extent, *count) = (extent.union(item.extent), *count + 1);
        }
        let cost = |bins: &[(Bounds, usize)]| {
            let join =
                |(all, sum): (Bounds, usize), (extent, count): &(Bounds, usize)| (all.union(*extent), sum + count);
            let (extent, count) = bins.iter().fold((Bounds::EMPTY, 0), join);
            if count == 0 { f32::INFINITY } else { extent.half_area() * count as f32 }
        };
        for border in 1..BINS {
            let cost = cost(&bins[..border]) + cost(&bins[border..]);
            if cost < best.0 {
                best = (cost, axis, border);
            }
        }
    }
    let (cost, axis, border) = best;
    if !cost.is_finite() {
        return half;
    }
    let mut split = 0;
    for index in 0..items.len() {
        if bin(axis, &items[index]) < border {
            items.swap(index, split);
            split += 1;
        }
    }
    if split == 0 || split == items.len() { half } else { split }
}
