//! Writes the wide tree that was planned.

use super::build::{FREE_DEPTH, Input, Leaves};
use super::collapse::Plan;
use super::lanes::LANES;
use super::node::{Child, Node};
use super::query::Bounds;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

/// The wide tree, its leaves still lists of triangles.
#[derive(Default)]
pub(super) struct Emitted {
    pub(super) nodes: Vec<Node>,
    /// Indices of the triangles of all leaves.
    pub(super) members: Vec<u32>,
    /// Where each leaf ends in `members`.
    pub(super) ends: Vec<u32>,
    pub(super) root: Child,
}

/// A subtree that is written, with its bounds.
struct Part {
    emitted: Emitted,
    bounds: Bounds,
}

/// Writes the tree, each node before its subtrees.
pub(super) fn emit<L: Leaves>(tree: &Bvh2, plan: &Plan, triangles: &[Input]) -> Emitted {
    if triangles.is_empty() {
        return Emitted::default();
    }
    let source = Source { tree, plan, triangles, most: L::MOST };
    let mut subtrees = Vec::new();
    source.below(0, 0, &mut subtrees);
    let write = |&(index, depth): &(usize, usize)| {
        let mut writer = Writer { source: &source, emitted: Emitted::default(), written: None };
        let (root, bounds) = writer.write(index, depth);
        Part { emitted: Emitted { root, ..writer.emitted }, bounds }
    };
    let parts: Vec<Part> = subtrees.par_iter().with_max_len(1).map(write).collect();
    let total = |count: fn(&Emitted) -> usize| parts.iter().map(|part| count(&part.emitted)).sum::<usize>();
    let emitted = Emitted {
        nodes: Vec::with_capacity(total(|part| part.nodes.len())),
        members: Vec::with_capacity(triangles.len()),
        ends: Vec::with_capacity(total(|part| part.ends.len())),
        root: Child::NONE,
    };
    let mut writer = Writer { source: &source, emitted, written: Some(parts.into_iter()) };
    let (root, _) = writer.write(0, 0);
    let mut emitted = Emitted { root, ..writer.emitted };
    emitted.nodes.shrink_to_fit();
    emitted
}

struct Source<'a> {
    tree: &'a Bvh2,
    plan: &'a Plan,
    triangles: &'a [Input],
    /// Triangles in a leaf at most.
    most: usize,
}

impl Source<'_> {
    /// Whether a subtree under so many wide nodes is written by itself.
    fn is_part(&self, index: usize, depth: usize) -> bool {
        !self.plan.choice(index).is_large() || depth >= FREE_DEPTH
    }

    /// Lists the subtrees that are written side by side and their depths, in the order of the tree.
    fn below(&self, index: usize, depth: usize, found: &mut Vec<(usize, usize)>) {
        if self.plan.choice(index).is_leaf() {
            return;
        }
        if self.is_part(index, depth) {
            found.push((index, depth));
            return;
        }
        for &child in self.children(index).as_slice() {
            self.below(child, depth + 1, found);
        }
    }

    /// The binary nodes that become the children of one wide node. Rays that ask only whether anything is in their way visit
    /// the last child first: so leaves come last, and before them the subtrees that cost less to look through.
    fn children(&self, index: usize) -> Children {
        let mut found = Children { count: 0, nodes: [0; LANES] };
        let [left, right] = self.plan.choice(index).opened();
        let first = self.tree.nodes[index].first_index as usize;
        self.add(first, left, &mut found);
        self.add(first + 1, right, &mut found);
        let (a_leaf, cost) = (|node: &usize| self.plan.choice(*node).is_leaf(), |node: &usize| self.plan.cost(*node));
        found.nodes[..found.count].sort_by(|a, b| a_leaf(a).cmp(&a_leaf(b)).then(cost(b).total_cmp(&cost(a))));
        found
    }

    /// Lists the triangles below a binary node, which may be deep.
    fn gather(&self, index: usize, members: &mut Vec<u32>) {
        let mut pending = [0; LANES];
        let mut count = 0;
        let mut index = index as u32;
        let mut deep = Vec::new();
        loop {
            let node = &self.tree.nodes[index as usize];
            if !node.is_leaf() {
                if count < LANES {
                    pending[count] = node.first_index + 1;
                    count += 1;
                } else {
                    deep.push(node.first_index + 1);
                }
                index = node.first_index;
                continue;
            }
            members.extend(node.first_index..node.first_index + node.prim_count);
            index = match deep.pop() {
                Some(next) => next,
                None if count > 0 => {
                    count -= 1;
                    pending[count]
                }
                None => return,
            };
        }
    }

    fn bounds(&self, members: &[u32]) -> Bounds {
        let of = |member: &u32| Bounds::of(&self.triangles[*member as usize].corners);
        members.iter().map(of).fold(Bounds::EMPTY, Bounds::union)
    }

    /// Adds a subtree as at most so many children.
    fn add(&self, index: usize, allowed: usize, found: &mut Children) {
        let choice = self.plan.choice(index);
        let mut children = allowed;
        while children > 1 && !self.tree.nodes[index].is_leaf() {
            let share = choice.share(children);
            if share > 0 {
                let first = self.tree.nodes[index].first_index as usize;
                self.add(first, share, found);
                return self.add(first + 1, children - share, found);
            }
            children -= 1;
        }
        found.nodes[found.count] = index;
        found.count += 1;
    }
}

/// Up to eight binary nodes.
struct Children {
    count: usize,
    nodes: [usize; LANES],
}

impl Children {
    fn as_slice(&self) -> &[usize] {
        &self.nodes[..self.count]
    }
}

struct Writer<'a> {
    source: &'a Source<'a>,
    emitted: Emitted,
    /// The subtrees that are written already, in their order.
    written: Option<std::vec::IntoIter<Part>>,
}

impl Writer<'_> {
    /// Writes the subtree of a binary node under `depth` wide nodes.
    fn write(&mut self, index: usize, depth: usize) -> (Child, Bounds) {
        if self.source.plan.choice(index).is_leaf() {
            return self.leaf(index);
        }
        if self.source.is_part(index, depth)
            && let Some(written) = &mut self.written
        {
            let part = written.next().expect("every subtree is written");
            return self.append(part);
        }
        if depth >= FREE_DEPTH {
            let mut members = Vec::new();
            self.source.gather(index, &mut members);
            return self.halve(&mut members);
        }
        let slot = self.emitted.nodes.len();
        self.emitted.nodes.push(Node::EMPTY);
        let mut bounds = Bounds::EMPTY;
        for (lane, &child) in self.source.children(index).as_slice().iter().enumerate() {
            let (child, own) = self.write(child, depth + 1);
            self.emitted.nodes[slot].set(lane, own, child);
            bounds = bounds.union(own);
        }
        (Child::node(slot), bounds)
    }

    /// Copies a subtree behind what is written.
    fn append(&mut self, Part { emitted: part, bounds }: Part) -> (Child, Bounds) {
        let Emitted { nodes, members, ends, .. } = &mut self.emitted;
        let (first_node, first_leaf, first_member) = (nodes.len(), ends.len(), members.len() as u32);
        let shift = |child: Child| match child {
            Child::NONE => Child::NONE,
            child if child.is_block() => Child::block(child.index() + first_leaf),
            child => Child::node(child.index() + first_node),
        };
        nodes.extend(part.nodes.iter().map(|node| Node { children: node.children.map(shift), ..*node }));
        members.extend_from_slice(&part.members);
        ends.extend(part.ends.iter().map(|end| end + first_member));
        (shift(part.root), bounds)
    }

    /// Adds the triangles below a binary node as a leaf.
    fn leaf(&mut self, index: usize) -> (Child, Bounds) {
        let first = self.emitted.members.len();
        self.source.gather(index, &mut self.emitted.members);
        self.end_leaf(first)
    }

    fn end_leaf(&mut self, first: usize) -> (Child, Bounds) {
        let bounds = self.source.bounds(&self.emitted.members[first..]);
        self.emitted.ends.push(self.emitted.members.len() as u32);
        (Child::block(self.emitted.ends.len() - 1), bounds)
    }

    /// Writes triangles as a tree of equal parts, cut along the longest axis.
    fn halve(&mut self, members: &mut [u32]) -> (Child, Bounds) {
        if members.len() <= self.source.most {
            let first = self.emitted.members.len();
            self.emitted.members.extend_from_slice(members);
            return self.end_leaf(first);
        }
        let triangles = self.source.triangles;
        let bounds = self.source.bounds(members);
        let axis = (bounds.high - bounds.low).max_position();
        let key = |&member: &u32| {
            let [a, b, c] = triangles[member as usize].corners.map(|corner| corner[axis] / 3.0);
            (a + b + c, member)
        };
        members.sort_unstable_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        });
        let slot = self.emitted.nodes.len();
        self.emitted.nodes.push(Node::EMPTY);
        let part = members.len().div_ceil(LANES);
        for (lane, part) in members.chunks_mut(part).enumerate() {
            let (child, own) = self.halve(part);
            self.emitted.nodes[slot].set(lane, own, child);
        }
        (Child::node(slot), bounds)
    }
}
