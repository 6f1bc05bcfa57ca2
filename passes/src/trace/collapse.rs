//! Which nodes of a binary tree become nodes and leaves of the wide one.

use super::build::Leaves;
use super::lanes::LANES;
use obvhs::bvh2::Bvh2;
use std::sync::atomic::{AtomicU64, Ordering};

/// Cost of opening a node, one vector test of eight, in the surface area heuristic; children cost [`Leaves::CHILD_COST`]
/// more, and leaves [`Leaves::cost`].
const NODE_COST: f32 = 1.0;

/// Nodes of a subtree up to which it is planned, and written, in one go. How large a subtree is is found out by counting up
/// to that: trees are far from balanced.
const SMALL: usize = 1 << 12;
/// Levels of nodes whose halves are planned side by side, at most.
const DEEPEST: u32 = 64;

/// What the collapse knows of a subtree.
#[derive(Debug, Clone, Copy)]
struct Summary {
    triangles: u32,
    /// `cost[i]`: the least cost of the subtree as at most `i + 1` children of one node.
    cost: [f32; LANES - 1],
}

/// The decisions about one binary node.
///
/// Three bits for each number of children from 2 to 7: how many of them the left half gets, 0 if one child fewer is as
/// good. Three bits: how many children, less 2, the node has if it is opened; three: how many of them the left half gets.
/// One bit: it is a leaf. One bit: it is a large subtree, whose parts are written side by side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Choice(u32);

impl Choice {
    const OPENED: u32 = 3 * (LANES as u32 - 2);
    const LEAF: u32 = 1 << 24;
    const LARGE: u32 = 1 << 25;

    /// Whether the subtree, as one child, is a leaf.
    pub(super) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Whether the subtree is large enough that its parts are written side by side.
    pub(super) fn is_large(self) -> bool {
        self.0 & Self::LARGE != 0
    }

    /// How many children each half of the subtree provides, as one child that is no leaf.
    pub(super) fn opened(self) -> [usize; 2] {
        let children = (self.0 >> Self::OPENED & 7) as usize + 2;
        let left = (self.0 >> (Self::OPENED + 3) & 7) as usize;
        [left, children - left]
    }

    /// How many of `children` children, 2 to 7, the left half gets; 0 if one child fewer is as good.
    pub(super) fn share(self, children: usize) -> usize {
        (self.0 >> (3 * (children - 2)) & 7) as usize
    }
}

/// The cheapest collapse of a binary tree into nodes of eight and leaves (Ylitie, Karras and Laine, "Efficient Incoherent
/// Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3.1).
pub(super) struct Plan {
    /// By binary node: the choice in the lower half, the bits of the cost in the upper.
    nodes: Vec<AtomicU64>,
}

impl Plan {
    pub(super) fn new<L: Leaves>(tree: &Bvh2) -> Self {
        let plan = Self { nodes: tree.nodes.iter().map(|_| AtomicU64::new(0)).collect() };
        if !tree.nodes.is_empty() {
            plan.whole::<L>(tree, 0, 0);
        }
        plan
    }

    pub(super) fn choice(&self, index: usize) -> Choice {
        Choice(self.nodes[index].load(Ordering::Relaxed) as u32)
    }

    /// What a ray that meets the bounds of a subtree costs there, as one child.
    pub(super) fn cost(&self, index: usize) -> f32 {
        f32::from_bits((self.nodes[index].load(Ordering::Relaxed) >> 32) as u32)
    }

    fn set(&self, index: u32, choice: u32, cost: f32) {
        self.nodes[index as usize].store(u64::from(cost.to_bits()) << 32 | u64::from(choice), Ordering::Relaxed);
    }

    /// Plans a subtree, the halves of a large one side by side.
    fn whole<L: Leaves>(&self, tree: &Bvh2, index: u32, depth: u32) -> Summary {
        let most = if depth < DEEPEST { SMALL } else { usize::MAX };
        if let Some(summary) = self.subtree::<L>(tree, index, most) {
            return summary;
        }
        let first = tree.nodes[index as usize].first_index;
        let half = |index: u32| self.whole::<L>(tree, index, depth + 1);
        let (left, right) = rayon::join(|| half(first), || half(first + 1));
        self.inner::<L>(tree, (index, Choice::LARGE), &left, &right)
    }

    /// Plans a subtree, of any depth; does nothing if it has more nodes than `most`.
    fn subtree<L: Leaves>(&self, tree: &Bvh2, root: u32, most: usize) -> Option<Summary> {
        // Each node before its left half, that before its right half: backwards, both halves of a node lie on the stack
        // when it is reached.
        let mut order = Vec::new();
        let mut pending = vec![root];
        while let Some(index) = pending.pop() {
            if order.len() == most {
                return None;
            }
            order.push(index);
            let node = &tree.nodes[index as usize];
            if !node.is_leaf() {
                pending.extend([node.first_index + 1, node.first_index]);
            }
        }
        let mut done: Vec<Summary> = Vec::new();
        for &index in order.iter().rev() {
            let node = &tree.nodes[index as usize];
            let summary = if node.is_leaf() {
                let cost = L::cost(node.prim_count as usize);
                self.set(index, Choice::LEAF, cost);
                Summary { triangles: node.prim_count, cost: [node.aabb().half_area() * cost; LANES - 1] }
            } else {
                let (left, right) = (done.pop(), done.pop());
                let both = left.zip(right);
                let (left, right) = both.expect("both halves come before their parent");
                self.inner::<L>(tree, (index, 0), &left, &right)
            };
            done.push(summary);
        }
        done.pop()
    }

    /// Plans a node with two halves; `size` is [`Choice::LARGE`] or 0.
    #[inline]
    fn inner<L: Leaves>(&self, tree: &Bvh2, (index, size): (u32, u32), left: &Summary, right: &Summary) -> Summary {
        let area = tree.nodes[index as usize].aabb().half_area();
        let triangles = left.triangles + right.triangles;
        let mut splits = [(f32::INFINITY, 1_u32); LANES + 1];
        let mut opened = (f32::INFINITY, 0, 1);
        for (children, split) in splits.iter_mut().enumerate().skip(2) {
            let mut best = (f32::INFINITY, 1);
            for share in 1..children {
                let cost = left.cost[share - 1] + right.cost[children - share - 1];
                if cost < best.0 {
                    best = (cost, share as u32);
                }
            }
            *split = best;
            let cost = best.0 + area * (NODE_COST + L::CHILD_COST * children as f32);
            if cost < opened.0 {
                opened = (cost, children as u32 - 2, best.1);
            }
        }
        let mut choice = size | (opened.2 << 3 | opened.1) << Choice::OPENED;
        let mut cost = [opened.0; LANES - 1];
        if triangles as usize <= L::MOST {
            let leaf = area * L::cost(triangles as usize);
            if leaf <= opened.0 {
                cost[0] = leaf;
                choice |= Choice::LEAF;
            }
        }
        for children in 2..LANES {
            cost[children - 1] = cost[children - 2];
            if splits[children].0 < cost[children - 2] {
                cost[children - 1] = splits[children].0;
                choice |= splits[children].1 << (3 * (children - 2));
            }
        }
        self.set(index, choice, cost[0] / area);
        Summary { triangles, cost }
    }
}
