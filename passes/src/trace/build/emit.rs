//! Writes the wide tree that was planned.

use super::collapse::{Plan, Subtree};
use super::input::Triangles;
use super::leaf_format::LeafFormat;
use crate::trace::simd::LANES;
use crate::trace::tree::{Bounds, Child, Node, STACK};
use curitiba_pipeline::progress::Progress;
use rayon::prelude::*;

/// Levels of wide nodes that follow the binary tree. Below them, subtrees are rebuilt by division into eight equal parts, so that their
/// depth is bounded.
pub(crate) const FREE_DEPTH: usize = 24;
/// Greatest number of levels. 2³¹ triangles, cut into 8 equal parts at each level, are parts of 2 after 10 levels; one level more is a
/// margin.
pub(crate) const MAX_DEPTH: usize = FREE_DEPTH + 11;
/// The traversal stack suffices: each node on a path leaves at most 7 siblings on the stack, and the last node needs room for eight.
const _: () = assert!(MAX_DEPTH * (LANES - 1) + LANES <= STACK);

/// Least number of nodes or leaves that a thread takes at a time where the work for each is small.
pub(crate) const GRAIN: usize = 4096;

/// The wide tree as it is written.
pub(crate) struct Emitted<L> {
    /// Nodes, each before its subtrees.
    pub(crate) nodes: Vec<Node>,
    pub(crate) leaves: Vec<L>,
    pub(crate) root: Child,
}

/// Writes the tree: first the layout of nodes and leaves, then the leaves, and then the nodes with their boxes. `None` if cancelled, which
/// is checked before each part of the first step and before each of the other two.
pub(crate) fn emit<L: LeafFormat>(plan: &Plan, triangles: &Triangles<'_>, progress: &Progress) -> Option<Emitted<L>> {
    let layout = Layout::new(&Source { plan, triangles, most: L::MOST }, progress)?;
    if progress.is_cancelled() {
        return None;
    }
    let (mut leaves, mut leaf_bounds) = (Vec::new(), Vec::new());
    let leaf = |leaf: usize| L::new(triangles, layout.leaf(leaf));
    let count = layout.ends.len();
    (0..count).into_par_iter().with_min_len(GRAIN / LANES).map(leaf).unzip_into_vecs(&mut leaves, &mut leaf_bounds);
    let bounds_of = |child: Child, nodes: &[Bounds]| {
        if child.is_leaf() { leaf_bounds[child.index()] } else { nodes[child.index()] }
    };
    if progress.is_cancelled() {
        return None;
    }
    let mut node_bounds = vec![Bounds::EMPTY; layout.nodes.len()];
    for (slot, children) in layout.nodes.iter().enumerate().rev() {
        let used = children.iter().filter(|child| **child != Child::NONE);
        node_bounds[slot] = used.map(|child| bounds_of(*child, &node_bounds)).fold(Bounds::EMPTY, Bounds::union);
    }
    let node = |children: &[Child; LANES]| {
        let mut node = Node::EMPTY;
        for (lane, &child) in children.iter().enumerate().filter(|(_, child)| **child != Child::NONE) {
            node.set(lane, bounds_of(child, &node_bounds), child);
        }
        node
    };
    let nodes = layout.nodes.par_iter().with_min_len(GRAIN / LANES).map(node).collect();
    Some(Emitted { nodes, leaves, root: layout.root })
}

/// The nodes and leaves of the tree, before their boxes and triangle data are written.
#[derive(Default)]
struct Layout {
    /// Children of the nodes, each node before its subtrees.
    nodes: Vec<[Child; LANES]>,
    /// Ids of the triangles of all leaves, leaf after leaf.
    members: Vec<u32>,
    /// Index in `members` at which each leaf ends.
    ends: Vec<u32>,
    root: Child,
}

impl Layout {
    fn new(source: &Source<'_>, progress: &Progress) -> Option<Self> {
        let mut subtrees = Vec::new();
        below(source.plan.root(), 0, &mut subtrees);
        let write = |&(subtree, depth): &(Subtree<'_>, usize)| {
            if progress.is_cancelled() {
                return None;
            }
            let mut writer = Writer { source, layout: Self::for_about(subtree.count()), written: None };
            let root = writer.write(subtree, depth);
            Some(Self { root, ..writer.layout })
        };
        let parts = subtrees.par_iter().with_max_len(1).map(write).collect::<Option<Vec<Self>>>()?;
        let total = |count: fn(&Self) -> usize| parts.iter().map(count).sum::<usize>();
        let layout = Self {
            nodes: Vec::with_capacity(total(|part| part.nodes.len())),
            members: Vec::with_capacity(total(|part| part.members.len())),
            ends: Vec::with_capacity(total(|part| part.ends.len())),
            root: Child::NONE,
        };
        let mut writer = Writer { source, layout, written: Some(parts.into_iter()) };
        let root = writer.write(source.plan.root(), 0);
        Some(Self { root, ..writer.layout })
    }

    /// Lists with room for a subtree of about that many triangles: on many threads, lists that grow wait for each other in the allocator.
    fn for_about(triangles: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(triangles / 16),
            members: Vec::with_capacity(triangles),
            ends: Vec::with_capacity(triangles / 2),
            root: Child::NONE,
        }
    }

    /// Ids of the triangles of a leaf.
    fn leaf(&self, leaf: usize) -> &[u32] {
        let first = if leaf == 0 { 0 } else { self.ends[leaf - 1] as usize };
        &self.members[first..self.ends[leaf] as usize]
    }

    /// Appends a subtree that was written separately, and returns its root as it is numbered here.
    fn append(&mut self, part: &Self) -> Child {
        let (first_node, first_leaf, first_member) = (self.nodes.len(), self.ends.len(), self.members.len() as u32);
        let shift = |child: Child| match child {
            Child::NONE => Child::NONE,
            child if child.is_leaf() => Child::leaf(child.index() + first_leaf),
            child => Child::node(child.index() + first_node),
        };
        self.nodes.extend(part.nodes.iter().map(|children| children.map(shift)));
        self.members.extend_from_slice(&part.members);
        self.ends.extend(part.ends.iter().map(|end| end + first_member));
        shift(part.root)
    }

    fn add_node(&mut self) -> usize {
        self.nodes.push([Child::NONE; LANES]);
        self.nodes.len() - 1
    }

    /// Makes a leaf of the members that were added since the last leaf.
    fn end_leaf(&mut self) -> Child {
        self.ends.push(self.members.len() as u32);
        Child::leaf(self.ends.len() - 1)
    }
}

/// Whether a subtree at that depth (number of wide nodes above it) is written separately from the nodes above it.
fn is_part(subtree: Subtree<'_>, depth: usize) -> bool {
    !subtree.is_large() || depth >= FREE_DEPTH
}

/// Lists the subtrees that are written in parallel, with their depths, in the order of the tree.
fn below<'a>(subtree: Subtree<'a>, depth: usize, found: &mut Vec<(Subtree<'a>, usize)>) {
    if subtree.choice().is_leaf() {
        return;
    }
    if is_part(subtree, depth) {
        found.push((subtree, depth));
        return;
    }
    for &child in Children::new(subtree).as_slice() {
        below(child, depth + 1, found);
    }
}

/// The subtrees that become the children of one wide node.
struct Children<'a> {
    count: usize,
    subtrees: [Subtree<'a>; LANES],
}

impl<'a> Children<'a> {
    /// The children of a subtree that is not a leaf. Occlusion rays visit the last child first, so leaves come last, and the cheapest
    /// subtrees just before them.
    fn new(subtree: Subtree<'a>) -> Self {
        let mut found = Self { count: 0, subtrees: [subtree; LANES] };
        for (half, allowed) in subtree.halves().into_iter().zip(subtree.choice().opened()) {
            found.add(half, allowed);
        }
        let mut keys = [u64::MAX; LANES];
        for (place, (key, subtree)) in keys.iter_mut().zip(found.as_slice()).enumerate() {
            let costs_less = u64::from(descending(subtree.cost()));
            *key = u64::from(subtree.choice().is_leaf()) << 35 | costs_less << 3 | place as u64;
        }
        sort(&mut keys);
        let subtrees = keys.map(|key| found.subtrees[key as usize % LANES]);
        Self { subtrees, ..found }
    }

    /// Adds a subtree as at most `allowed` children.
    fn add(&mut self, subtree: Subtree<'a>, allowed: usize) {
        let choice = subtree.choice();
        for children in (2..=allowed).rev() {
            let share = choice.share(children);
            if share > 0 {
                let [left, right] = subtree.halves();
                self.add(left, share);
                return self.add(right, children - share);
            }
        }
        self.subtrees[self.count] = subtree;
        self.count += 1;
    }

    fn as_slice(&self) -> &[Subtree<'a>] {
        &self.subtrees[..self.count]
    }
}

/// Maps a cost to a number such that larger costs have smaller numbers, in the order of `total_cmp`.
fn descending(cost: f32) -> u32 {
    let bits = cost.to_bits();
    bits ^ if bits >> 31 == 0 { 0x7fff_ffff } else { 0 }
}

/// Sorts without branches, by a sorting network of 19 comparisons.
fn sort(keys: &mut [u64; LANES]) {
    const ROUNDS: [&[[usize; 2]]; 6] = [
        &[[0, 2], [1, 3], [4, 6], [5, 7]],
        &[[0, 4], [1, 5], [2, 6], [3, 7]],
        &[[0, 1], [2, 3], [4, 5], [6, 7]],
        &[[2, 4], [3, 5]],
        &[[1, 4], [3, 6]],
        &[[1, 2], [3, 4], [5, 6]],
    ];
    for [a, b] in ROUNDS.into_iter().flatten().copied() {
        (keys[a], keys[b]) = (keys[a].min(keys[b]), keys[a].max(keys[b]));
    }
}

struct Source<'a> {
    plan: &'a Plan,
    triangles: &'a Triangles<'a>,
    /// Greatest number of triangles in a leaf.
    most: usize,
}

struct Writer<'a> {
    source: &'a Source<'a>,
    layout: Layout,
    /// The subtrees that were written in parallel, in the order of the tree; `None` while one of those is being written.
    written: Option<std::vec::IntoIter<Layout>>,
}

impl Writer<'_> {
    /// Writes a subtree that has `depth` wide nodes above it.
    fn write(&mut self, subtree: Subtree<'_>, depth: usize) -> Child {
        if subtree.choice().is_leaf() {
            subtree.triangles(&mut self.layout.members);
            return self.layout.end_leaf();
        }
        if is_part(subtree, depth)
            && let Some(written) = &mut self.written
        {
            let part = written.next().expect("every subtree is written");
            return self.layout.append(&part);
        }
        if depth >= FREE_DEPTH {
            let mut members = Vec::new();
            subtree.triangles(&mut members);
            return self.halve(&mut members);
        }
        let slot = self.layout.add_node();
        for (lane, &child) in Children::new(subtree).as_slice().iter().enumerate() {
            self.layout.nodes[slot][lane] = self.write(child, depth + 1);
        }
        Child::node(slot)
    }

    /// Writes triangles as a tree of eight equal parts at each node, cut along the longest axis.
    fn halve(&mut self, members: &mut [u32]) -> Child {
        if members.len() <= self.source.most {
            self.layout.members.extend_from_slice(members);
            return self.layout.end_leaf();
        }
        let triangles = self.source.triangles;
        let bounds = triangles.bounds(members);
        let axis = (bounds.high - bounds.low).max_position();
        let key = |member: &u32| {
            let [a, b, c] = triangles.corners(*member).map(|corner| corner[axis] / 3.0);
            (a + b + c, *member)
        };
        members.sort_unstable_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        });
        let slot = self.layout.add_node();
        let part = members.len().div_ceil(LANES);
        for (lane, part) in members.chunks_mut(part).enumerate() {
            self.layout.nodes[slot][lane] = self.halve(part);
        }
        Child::node(slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_sorts_all_there_is() {
        // The 0-1 principle: a network that sorts all sequences of zeros and ones sorts everything.
        for bits in 0..1_u64 << LANES {
            let mut keys = std::array::from_fn(|lane| bits >> lane & 1);
            sort(&mut keys);
            assert!(keys.is_sorted(), "{bits:b}");
        }
    }

    #[test]
    fn keys_have_the_order_of_costs() {
        let costs = [f32::NEG_INFINITY, -2.0, -0.0, 0.0, 1.0e-40, 1.0, 1.5, f32::INFINITY, f32::NAN];
        assert!(costs.is_sorted_by(|a, b| a.total_cmp(b).is_lt() && descending(*a) > descending(*b)));
    }
}
