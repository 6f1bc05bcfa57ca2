//! The wide tree from obvhs's binary one.

use super::block::Block;
use super::lanes::LANES;
use super::node::{Child, Node};
use super::query::Bounds;
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Levels of nodes that follow the binary tree; below them, subtrees are rebuilt by halving, whose depth is bounded.
const FREE_DEPTH: usize = 24;
/// Levels of nodes at most: 2³¹ triangles cut into 8 equal parts until 8 are left take 10 levels, until 3 are left 11.
pub(super) const MAX_DEPTH: usize = FREE_DEPTH + 11;
/// Every node on the way down leaves at most 7 siblings on the stack.
const _: () = assert!(MAX_DEPTH * (LANES - 1) < super::stack::STACK);

/// Costs of the surface area heuristic: opening a node and testing a block, each one vector test of eight.
const NODE_COST: f32 = 1.0;
const BLOCK_COST: f32 = 1.3;

/// Sum of the areas of all nodes over that of the root, above which obvhs does not optimise its tree: the search for a
/// better place prunes by area, and among thousands of equal boxes looks at all of them for each. Scenes have 50 to 300.
const MAX_OVERLAP: f64 = 1000.0;

/// A triangle to build on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Input {
    pub(super) corners: [Vec3; 3],
    /// Id with [`TRANSPARENT`](super::block::TRANSPARENT).
    pub(super) id: u32,
}

/// How much time to spend on the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    pub(super) search: PlocSearchDistance,
    pub(super) threshold: usize,
    pub(super) reinsertion: f32,
}

/// Where the leaves of a tree are kept, and what they cost.
pub(super) trait Leaves: Default {
    /// Triangles in a leaf at most.
    const MOST: usize;
    /// What testing a leaf of so many triangles costs, where opening a node costs [`NODE_COST`].
    fn cost(triangles: usize) -> f32;
    /// Adds a leaf and returns its number; `members` are indices into `triangles`.
    fn add(&mut self, triangles: &[Input], members: &[u32]) -> usize;
    /// Says that no leaf will be added.
    fn finish(&mut self) {}
}

impl Leaves for Vec<Block> {
    const MOST: usize = LANES;

    fn cost(_: usize) -> f32 {
        BLOCK_COST
    }

    fn add(&mut self, triangles: &[Input], members: &[u32]) -> usize {
        let mut block = Block::EMPTY;
        for (lane, &member) in members.iter().enumerate() {
            let triangle = &triangles[member as usize];
            block.set(lane, triangle.corners, triangle.id);
        }
        self.push(block);
        self.len() - 1
    }

    fn finish(&mut self) {
        self.shrink_to_fit();
    }
}

/// The tree.
pub(super) struct Built<L> {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: L,
    pub(super) root: Child,
    pub(super) bounds: Bounds,
}

/// Builds the tree; `triangles` have finite corners.
pub(super) fn build<L: Leaves>(triangles: &[Input], effort: Effort) -> Built<L> {
    let bounds = triangles.iter().fold(Bounds::EMPTY, |all, triangle| all.union(Bounds::of(&triangle.corners)));
    let binary = binary_tree(triangles, bounds, effort);
    let plan = Plan::new::<L>(&binary, triangles);
    let mut emitter = Emitter { plan: &plan, binary: &binary, triangles, nodes: Vec::new(), leaves: L::default() };
    let root = if triangles.is_empty() { Child::NONE } else { emitter.emit(0, 0) };
    let Emitter { mut nodes, mut leaves, .. } = emitter;
    nodes.shrink_to_fit();
    leaves.finish();
    Built { nodes, leaves, root, bounds }
}

/// obvhs's tree with one triangle a leaf.
///
/// Its clustering merges neighbours that prefer each other, and loses its linear time when costs tie (a row of equal
/// boxes merges one pair a pass), overflow or are NaN. So it is given boxes scaled to a unit cube and grown on each side
/// by a pseudo-random 1/64 of their size at most; only the topology of its tree is used.
fn binary_tree(triangles: &[Input], bounds: Bounds, effort: Effort) -> Bvh2 {
    let low = bounds.low.as_dvec3();
    let scale = 1.0 / (bounds.high.as_dvec3() - low).max_element().max(f64::from(f32::MIN_POSITIVE));
    let boxes: Vec<Aabb> = triangles
        .iter()
        .zip(0_u32..)
        .map(|(triangle, index)| {
            let own = Bounds::of(&triangle.corners);
            let least = ((own.low.as_dvec3() - low) * scale).as_vec3();
            let most = ((own.high.as_dvec3() - low) * scale).as_vec3();
            let size = (most - least).max_element() * (1.0 / 64.0) + 1.0e-6;
            Aabb::new(Vec3A::from(least - size * noise(2 * index)), Vec3A::from(most + size * noise(2 * index + 1)))
        })
        .collect();
    let indices = (0..triangles.len() as u32).collect();
    let mut tree = PlocBuilder::new().build(effort.search, &boxes, indices, SortPrecision::U64, effort.threshold);
    drop(boxes);
    let area = |node: &Bvh2Node| f64::from(node.aabb().half_area());
    if let Some(root) = tree.nodes.first() {
        let overlap = tree.nodes.iter().map(area).sum::<f64>() / area(root);
        if overlap < MAX_OVERLAP {
            ReinsertionOptimizer::default().run(&mut tree, effort.reinsertion, None);
        }
    }
    tree
}

/// Three numbers in 0..1 from a counter (the integer hash PCG, Jarzynski and Olano, JCGT 9(3), 2020).
fn noise(counter: u32) -> Vec3 {
    let next = |state: u32| {
        let state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    };
    let x = next(counter);
    let y = next(x);
    let z = next(y);
    Vec3::new(x as f32, y as f32, z as f32) * (1.0 / 4_294_967_296.0)
}

/// What the collapse knows of a binary node.
#[derive(Clone, Copy)]
struct Subtree {
    bounds: Bounds,
    triangles: u32,
    /// `cost[i]`: the least cost of the subtree as at most `i + 1` children of one node.
    cost: [f32; LANES - 1],
}

/// The cheapest collapse of a binary tree into nodes of eight and blocks of eight (Ylitie, Karras and Laine, "Efficient
/// Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3.1).
struct Plan {
    subtrees: Vec<Subtree>,
}

impl Plan {
    fn new<L: Leaves>(binary: &Bvh2, triangles: &[Input]) -> Self {
        let empty = Subtree { bounds: Bounds::EMPTY, triangles: 0, cost: [0.0; LANES - 1] };
        let mut plan = Self { subtrees: vec![empty; binary.nodes.len()] };
        for &index in parents_first(binary).iter().rev() {
            let node = &binary.nodes[index as usize];
            let first = node.first_index as usize;
            plan.subtrees[index as usize] = if node.is_leaf() {
                let triangle = &triangles[binary.primitive_indices[first] as usize];
                let bounds = Bounds::of(&triangle.corners);
                Subtree { bounds, triangles: 1, cost: [bounds.half_area() * L::cost(1); LANES - 1] }
            } else {
                plan.inner::<L>(first)
            };
        }
        plan
    }

    fn inner<L: Leaves>(&self, first: usize) -> Subtree {
        let (left, right) = (&self.subtrees[first], &self.subtrees[first + 1]);
        let bounds = left.bounds.union(right.bounds);
        let triangles = left.triangles + right.triangles;
        let area = bounds.half_area();
        let opened = self.split(first, LANES).0 + area * NODE_COST;
        let mut cost = [opened; LANES - 1];
        if triangles as usize <= L::MOST {
            cost[0] = cost[0].min(area * L::cost(triangles as usize));
        }
        for children in 2..LANES {
            cost[children - 1] = cost[children - 2].min(self.split(first, children).0);
        }
        Subtree { bounds, triangles, cost }
    }

    /// The least cost of the pair at `first` as `children` children in total, and how many of them the left one gets.
    fn split(&self, first: usize, children: usize) -> (f32, usize) {
        let (left, right) = (&self.subtrees[first].cost, &self.subtrees[first + 1].cost);
        let mut best = (f32::INFINITY, 1);
        for share in 1..children {
            let cost = left[share - 1] + right[children - share - 1];
            if cost < best.0 {
                best = (cost, share);
            }
        }
        best
    }
}

/// All nodes, each before its children.
fn parents_first(binary: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut pending = Vec::new();
    if !binary.nodes.is_empty() {
        pending.push(0);
    }
    while let Some(index) = pending.pop() {
        order.push(index);
        let node = &binary.nodes[index as usize];
        if !node.is_leaf() {
            pending.extend([node.first_index + 1, node.first_index]);
        }
    }
    order
}

struct Emitter<'a, L> {
    plan: &'a Plan,
    binary: &'a Bvh2,
    triangles: &'a [Input],
    nodes: Vec<Node>,
    leaves: L,
}

impl<L: Leaves> Emitter<'_, L> {
    /// Emits the subtree of a binary node under `depth` wide nodes.
    fn emit(&mut self, index: usize, depth: usize) -> Child {
        let subtree = &self.plan.subtrees[index];
        let count = subtree.triangles as usize;
        let binary = &self.binary.nodes[index];
        let as_leaf = subtree.bounds.half_area() * L::cost(count);
        if binary.is_leaf() || count <= L::MOST && as_leaf <= subtree.cost[0] {
            return self.leaf(&self.gather(index));
        }
        if depth >= FREE_DEPTH {
            let mut members = self.gather(index);
            return self.halve(&mut members);
        }
        let mut members = Vec::with_capacity(LANES);
        self.children(index, LANES, true, &mut members);
        let slot = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (lane, &member) in members.iter().enumerate() {
            let child = self.emit(member, depth + 1);
            self.nodes[slot].set(lane, self.plan.subtrees[member].bounds, child);
        }
        Child::node(slot)
    }

    /// Lists the binary nodes that become the children of one wide node; `open` when the node itself is that node.
    fn children(&self, index: usize, allowed: usize, open: bool, found: &mut Vec<usize>) {
        let binary = &self.binary.nodes[index];
        let cost = &self.plan.subtrees[index].cost;
        if !open && (binary.is_leaf() || allowed == 1) {
            found.push(index);
        } else if !open && cost[allowed - 1] == cost[allowed - 2] {
            self.children(index, allowed - 1, false, found);
        } else {
            let first = binary.first_index as usize;
            let share = self.plan.split(first, allowed).1;
            self.children(first, share, false, found);
            self.children(first + 1, allowed - share, false, found);
        }
    }

    /// The triangles below a binary node.
    fn gather(&self, index: usize) -> Vec<u32> {
        let mut members = Vec::with_capacity(self.plan.subtrees[index].triangles as usize);
        let mut pending = vec![index];
        while let Some(index) = pending.pop() {
            let node = &self.binary.nodes[index];
            let first = node.first_index as usize;
            if node.is_leaf() {
                members.push(self.binary.primitive_indices[first]);
            } else {
                pending.extend([first + 1, first]);
            }
        }
        members
    }

    fn leaf(&mut self, members: &[u32]) -> Child {
        Child::block(self.leaves.add(self.triangles, members))
    }

    /// Emits triangles as a tree of equal parts, cut along the longest axis.
    fn halve(&mut self, members: &mut [u32]) -> Child {
        if members.len() <= L::MOST {
            return self.leaf(members);
        }
        let triangles = self.triangles;
        let bounds = bounds_of(triangles, members);
        let axis = (bounds.high - bounds.low).max_position();
        let key = |&member: &u32| {
            let [a, b, c] = triangles[member as usize].corners.map(|corner| corner[axis] / 3.0);
            (a + b + c, member)
        };
        members.sort_unstable_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        });
        let slot = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        let part = members.len().div_ceil(LANES);
        for (lane, part) in members.chunks_mut(part).enumerate() {
            let bounds = bounds_of(triangles, part);
            let child = self.halve(part);
            self.nodes[slot].set(lane, bounds, child);
        }
        Child::node(slot)
    }
}

fn bounds_of(triangles: &[Input], members: &[u32]) -> Bounds {
    members.iter().fold(Bounds::EMPTY, |all, &member| all.union(Bounds::of(&triangles[member as usize].corners)))
}
