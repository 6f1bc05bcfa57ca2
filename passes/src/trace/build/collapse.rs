//! Plans the collapse: which nodes of the binary tree become nodes of the wide tree, and which become leaves.

use super::leaf_format::LeafFormat;
use crate::trace::simd::{Detected, F8, Kernel, LANES, Plain, Simd, lower};
use curitiba_pipeline::progress::Progress;
use obvhs::bvh2::Bvh2;
use std::marker::PhantomData;

/// Cost of opening a node in the surface area heuristic: one slab test of eight boxes. Each child adds [`LeafFormat::CHILD_COST`], a leaf
/// costs [`LeafFormat::cost`].
const NODE_COST: f32 = 1.0;

/// The first `nodes / SHARE` nodes of the binary tree are large: their halves are planned and written in parallel. obvhs fills its node
/// list from the end. So the first `n` nodes are those of its last merges, when about `n` clusters were left, and the subtrees below them
/// are of similar sizes; a cut by depth would give very unequal ones.
const SHARE: usize = 512;
/// Greatest depth at which the halves of a node are still planned in parallel.
const DEEPEST: u32 = 64;

/// The data of a half (the subtree of one child) from which its parent in the binary tree plans its own collapse.
#[derive(Debug, Clone, Copy)]
struct Summary {
    triangles: u32,
    /// Lane `i` holds the least cost of the subtree when it supplies at most `i + 1` children to one node. Costs are sums over nodes and
    /// leaves, each times half its surface area. The last lane is not used.
    cost: F8,
}

/// The decisions about one binary node, packed into bits.
///
/// * For each number of children from 2 to 7, three bits: how many of those children come from the left half; 0 if one child fewer costs no
///   more.
/// * Three bits: the number of children, less 2, if the node becomes a wide node.
/// * Three bits: how many of those come from the left half.
/// * One bit: the node becomes a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Choice(u32);

impl Choice {
    const OPENED: u32 = 3 * (LANES as u32 - 2);
    const LEAF: u32 = 1 << 24;

    /// Whether the subtree becomes a leaf, not a node, where it is a single child of a wide node.
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// How many children come from the left and from the right half if the subtree becomes a wide node.
    pub(crate) fn opened(self) -> [usize; 2] {
        let children = (self.0 >> Self::OPENED & 7) as usize + 2;
        let left = (self.0 >> (Self::OPENED + 3) & 7) as usize;
        [left, children - left]
    }

    /// How many of `children` children (2 to 7) come from the left half; 0 if one child fewer costs no more.
    pub(crate) fn share(self, children: usize) -> usize {
        (self.0 >> (3 * (children - 2)) & 7) as usize
    }
}

/// A binary node and the decisions about it.
#[derive(Debug, Clone, Copy)]
struct Entry {
    choice: Choice,
    /// Cost of the subtree as one child, for a ray that meets its bounds. Until it is computed, the field holds half the surface area of
    /// the bounds.
    cost: f32,
    /// Index of the first entry after the subtree.
    end: u32,
    /// Index in [`Plan::triangles`] of the first triangle of the subtree.
    first: u32,
}

/// The cheapest collapse of a binary tree into nodes of eight children and leaves (Ylitie, Karras and Laine, "Efficient Incoherent Ray
/// Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3.1).
///
/// It holds the whole tree without its boxes, in depth-first order; the nodes of the binary tree itself are scattered over memory.
pub(crate) struct Plan {
    /// The nodes in depth-first order: a node, its left half, its right half. For a large subtree, its root only.
    entries: Vec<Entry>,
    /// The triangles from left to right; empty for a large subtree.
    triangles: Vec<u32>,
    /// The halves of a large subtree, which are planned in parallel; `None` for a subtree that is not large.
    halves: Option<Box<[Plan; 2]>>,
}

impl Plan {
    /// The plan of a tree that has nodes; `None` if cancelled, which is checked before each part that a thread takes.
    pub(crate) fn new<L: LeafFormat>(tree: &Bvh2, progress: &Progress) -> Option<Self> {
        let planner = Planner::<L> { tree, large: tree.nodes.len() / SHARE, progress, leaf: PhantomData };
        Some(planner.whole(0, 0)?.0)
    }

    /// The subtree at the root.
    pub(crate) fn root(&self) -> Subtree<'_> {
        Subtree { plan: self, index: 0 }
    }
}

/// A subtree of a plan.
#[derive(Clone, Copy)]
pub(crate) struct Subtree<'a> {
    plan: &'a Plan,
    index: u32,
}

impl<'a> Subtree<'a> {
    fn entry(self) -> &'a Entry {
        &self.plan.entries[self.index as usize]
    }

    /// The decisions about the root of the subtree.
    pub(crate) fn choice(self) -> Choice {
        self.entry().choice
    }

    /// Cost of the subtree as one child, for a ray that meets its bounds.
    pub(crate) fn cost(self) -> f32 {
        self.entry().cost
    }

    /// Whether the subtree is large enough that its parts are written in parallel.
    pub(crate) fn is_large(self) -> bool {
        self.plan.halves.is_some()
    }

    /// The two halves of the subtree. The root must not be a leaf.
    #[inline]
    pub(crate) fn halves(self) -> [Self; 2] {
        match &self.plan.halves {
            Some(halves) => [halves[0].root(), halves[1].root()],
            None => {
                let left = Self { index: self.index + 1, ..self };
                [left, Self { index: left.entry().end, ..self }]
            }
        }
    }

    /// Appends the triangles of the subtree to a list, from left to right.
    #[inline]
    pub(crate) fn triangles(self, list: &mut Vec<u32>) {
        match &self.plan.halves {
            Some(halves) => halves.iter().for_each(|half| half.root().triangles(list)),
            None => list.extend_from_slice(self.own_triangles()),
        }
    }

    /// Number of triangles in the subtree.
    pub(crate) fn count(self) -> usize {
        match &self.plan.halves {
            Some(halves) => halves.iter().map(|half| half.root().count()).sum(),
            None => self.own_triangles().len(),
        }
    }

    /// The triangles of a subtree whose plan has no `halves`.
    #[inline]
    fn own_triangles(self) -> &'a [u32] {
        let entry = self.entry();
        let behind =
            self.plan.entries.get(entry.end as usize).map_or(self.plan.triangles.len(), |next| next.first as usize);
        &self.plan.triangles[entry.first as usize..behind]
    }
}

struct Planner<'a, L> {
    tree: &'a Bvh2,
    /// Nodes of the binary tree with a smaller index are large: their halves may be planned in parallel.
    large: usize,
    progress: &'a Progress,
    leaf: PhantomData<fn() -> L>,
}

impl<L: LeafFormat> Planner<'_, L> {
    /// Plans a subtree, the halves of a large one side by side.
    fn whole(&self, index: u32, depth: u32) -> Option<(Plan, Summary)> {
        if self.progress.is_cancelled() {
            return None;
        }
        let node = &self.tree.nodes[index as usize];
        if index as usize >= self.large || depth >= DEEPEST || node.is_leaf() {
            return Some(Detected::cached().run(Small { planner: self, root: index }));
        }
        let half = |index: u32| self.whole(index, depth + 1);
        let (left, right) = rayon::join(|| half(node.first_index), || half(node.first_index + 1));
        let (left, right) = (left?, right?);
        let (choice, cost, summary) = Self::inner(Plain, node.aabb().half_area(), &left.1, &right.1);
        let entry = Entry { choice, cost, end: 1, first: 0 };
        Some((Plan { entries: vec![entry], triangles: Vec::new(), halves: Some(Box::new([left.0, right.0])) }, summary))
    }

    /// Plans a node with two halves. The loops over the numbers of children are loops over lanes, so they become vector code.
    #[inline(always)]
    fn inner<S: Simd>(simd: S, area: f32, left: &Summary, right: &Summary) -> (Choice, f32, Summary) {
        let triangles = left.triangles + right.triangles;
        let (costs, shares) = splits(&left.cost.0, &right.cost.0);
        let mut totals = [f32::INFINITY; LANES];
        for lane in 1..LANES {
            totals[lane] = costs[lane] + area * (NODE_COST + L::CHILD_COST * (lane + 1) as f32);
        }
        let mut least = totals;
        for half in [4, 2, 1] {
            for lane in 0..half {
                least[lane] = lower(least[lane], least[lane + half]);
            }
        }
        let opened = least[0];
        // Of equal costs, the one with the fewest children.
        let mut children = 2;
        for lane in (1..LANES).rev() {
            children = if totals[lane] == opened { lane + 1 } else { children };
        }
        let mut choice = (shares[children - 1] << 3 | (children as u32 - 2)) << Choice::OPENED;
        let mut single = opened;
        if triangles as usize <= L::MOST {
            let leaf = area * L::cost(triangles as usize);
            if leaf <= opened {
                single = leaf;
                choice |= Choice::LEAF;
            }
        }
        let mut cost = costs;
        cost[0] = single;
        for step in [1, 2, 4] {
            let before = cost;
            for lane in step..LANES {
                cost[lane] = lower(before[lane], before[lane - step]);
            }
        }
        let mut better = [0; LANES];
        for lane in 1..LANES - 1 {
            better[lane] = if costs[lane] < cost[lane - 1] { shares[lane] << (3 * (lane - 1)) } else { 0 };
        }
        choice |= better.into_iter().fold(0, |all, bits| all | bits);
        // Stored as one vector: a vector load that follows several scalar stores to the same place would stall.
        let cost = simd.store(simd.load(&F8(cost)));
        (Choice(choice), single / area, Summary { triangles, cost })
    }
}

/// The cheapest ways to split children between two halves. Lane `i` is for `i + 1` children: the least cost, and the number of children
/// that the left half supplies.
#[inline(always)]
fn splits(left: &[f32; LANES], right: &[f32; LANES]) -> ([f32; LANES], [u32; LANES]) {
    let mut costs = [f32::INFINITY; LANES];
    let mut shares = [1; LANES];
    let mut padded = [f32::INFINITY; 2 * LANES];
    padded[LANES..].copy_from_slice(right);
    for share in 1..LANES {
        for lane in 0..LANES {
            let cost = left[share - 1] + padded[LANES + lane - share];
            let better = cost < costs[lane];
            costs[lane] = if better { cost } else { costs[lane] };
            shares[lane] = if better { share as u32 } else { shares[lane] };
        }
    }
    (costs, shares)
}

/// Plans a subtree of any depth on one thread.
struct Small<'a, L> {
    planner: &'a Planner<'a, L>,
    root: u32,
}

impl<L: LeafFormat> Kernel<(Plan, Summary)> for Small<'_, L> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (Plan, Summary) {
        let nodes = &self.planner.tree.nodes;
        // Room for as many entries as most subtrees have, so that the lists rarely grow.
        let mut entries = Vec::with_capacity(4 * SHARE);
        let mut triangles = Vec::with_capacity(4 * SHARE);
        let mut pending = Vec::with_capacity(DEEPEST as usize);
        let mut next = Some(self.root);
        while let Some(index) = next {
            let node = &nodes[index as usize];
            let area = node.aabb().half_area();
            // An inner node's end is not known yet and is set below; a leaf ends here.
            let end = entries.len() as u32 + 1;
            let first = triangles.len() as u32;
            next = if node.is_leaf() {
                triangles.extend(node.first_index..node.first_index + node.prim_count);
                entries.push(Entry { choice: Choice(Choice::LEAF), cost: area, end, first });
                pending.pop()
            } else {
                entries.push(Entry { choice: Choice(0), cost: area, end: 0, first });
                pending.push(node.first_index + 1);
                if let Some(right) = nodes.get(node.first_index as usize + 1) {
                    simd.prefetch(right);
                }
                Some(node.first_index)
            };
        }
        // Going backwards, both halves of a node are on top of the stack when the node is reached.
        let mut done: Vec<(u32, Summary)> = Vec::with_capacity(DEEPEST as usize);
        let mut behind = triangles.len() as u32;
        for entry in entries.iter_mut().rev() {
            let area = entry.cost;
            if entry.choice.is_leaf() {
                let count = behind - entry.first;
                entry.cost = L::cost(count as usize);
                let cost = simd.store(simd.splat(area * entry.cost));
                done.push((entry.end, Summary { triangles: count, cost }));
            } else {
                let both = done.pop().zip(done.pop());
                let ((_, left), (end, right)) = both.expect("both halves come before their parent");
                let (choice, cost, summary) = Planner::<L>::inner(simd, area, &left, &right);
                *entry = Entry { choice, cost, end, ..*entry };
                done.push((end, summary));
            }
            behind = entry.first;
        }
        let (_, summary) = done.pop().expect("there is a root");
        entries.shrink_to_fit();
        triangles.shrink_to_fit();
        (Plan { entries, triangles, halves: None }, summary)
    }
}
