//! Traverses the tree with one prepared ray: nearest hit, or occlusion.

use crate::trace::ray::{Hit, Ray, Recent};
use crate::trace::simd::{Kernel, NO_LANES, Simd, first_lane, without_first};
use crate::trace::tree::{Child, Leaf, Node, PreparedRay, Stack, WideTree};

/// See [`Tracer::closest`](crate::trace::Tracer::closest).
pub(crate) struct Closest<'a, A> {
    pub(crate) tree: &'a WideTree,
    pub(crate) ray: &'a Ray,
    pub(crate) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Kernel<Option<Hit>> for Closest<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Option<Hit> {
        let ray = PreparedRay::new(self.ray, &self.tree.bounds)?;
        let mut best = None;
        closest(simd, self.tree, self.tree.root, &ray, &mut best, &mut self.accept);
        best
    }
}

/// Finds the nearest hit of a prepared ray below `entry` that is nearer than `best`, or as near with a lower id, and that `accept` accepts.
#[inline(always)]
pub(crate) fn closest<S: Simd>(
    simd: S,
    tree: &WideTree,
    entry: Child,
    ray: &PreparedRay,
    best: &mut Option<Hit>,
    accept: &mut impl FnMut(&Hit) -> bool,
) {
    let mut limit = best.map_or(ray.line.t_max, |best| best.t);
    let mut stack = Stack::new();
    let mut current = entry;
    if current == Child::NONE {
        return;
    }
    loop {
        if current.is_leaf() {
            approach(simd, &tree.leaves[current.index()], ray, (&mut limit, best), accept);
        } else if let Some(next) = visit_ordered(simd, &tree.nodes[current.index()], ray, limit, &mut stack) {
            current = next;
            continue;
        }
        loop {
            let Some(entry) = stack.pop() else { return };
            if f32::from_bits((entry >> 32) as u32) <= limit {
                current = Child(entry as u32);
                break;
            }
        }
    }
}

/// Updates the nearest hit with the hits on a leaf.
#[inline(always)]
pub(crate) fn approach<S: Simd>(
    simd: S,
    leaf: &Leaf,
    ray: &PreparedRay,
    (limit, best): (&mut f32, &mut Option<Hit>),
    accept: &mut impl FnMut(&Hit) -> bool,
) {
    leaf.intersect(simd, ray, limit, |hit, transparent, limit| {
        let nearer = match &*best {
            None => hit.t < *limit,
            Some(best) => hit.t < best.t || hit.t == best.t && hit.triangle < best.triangle,
        };
        if nearer && (!transparent || accept(&hit)) {
            *limit = hit.t;
            *best = Some(hit);
        }
        false
    });
}

/// Pushes the children that the ray meets up to `limit`, the nearest on top, and returns the nearest instead of pushing
/// it.
///
/// The high half of an entry is the bits of the distance, which order like the distance since it is not negative; the
/// low half is the child.
#[inline(always)]
fn visit_ordered<S: Simd>(simd: S, node: &Node, ray: &PreparedRay, limit: f32, stack: &mut Stack) -> Option<Child> {
    let (mut lanes, enter) = ray.slabs(simd, &node.planes, limit);
    if lanes == NO_LANES {
        return None;
    }
    let first = first_lane(lanes);
    lanes = without_first(lanes);
    if lanes == NO_LANES {
        return Some(node.children[first]);
    }
    let enter = simd.store(enter);
    let entry = |lane: usize| u64::from(enter.0[lane].to_bits()) << 32 | u64::from(node.children[lane].0);
    let mut nearest = entry(first);
    let start = stack.len();
    while lanes != NO_LANES {
        let other = entry(first_lane(lanes));
        lanes = without_first(lanes);
        stack.push(nearest.max(other));
        nearest = nearest.min(other);
    }
    if stack.len() - start > 1 {
        stack.sort_from(start);
    }
    Some(Child(nearest as u32))
}

/// See [`Tracer::occluded`](crate::trace::Tracer::occluded).
pub(crate) struct Occluded<'a, A> {
    pub(crate) tree: &'a WideTree,
    pub(crate) ray: &'a Ray,
    pub(crate) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Kernel<bool> for Occluded<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> bool {
        match PreparedRay::new(self.ray, &self.tree.bounds) {
            Some(ray) => occluded(simd, self.tree, self.tree.root, &ray, &mut self.accept),
            None => false,
        }
    }
}

/// Whether a prepared ray hits anything below `entry` that `accept` accepts.
#[inline(always)]
pub(crate) fn occluded<S: Simd>(
    simd: S,
    tree: &WideTree,
    entry: Child,
    ray: &PreparedRay,
    accept: &mut impl FnMut(&Hit) -> bool,
) -> bool {
    let mut stack = Stack::new();
    let mut current = entry;
    if current == Child::NONE {
        return false;
    }
    loop {
        if current.is_leaf() {
            if blocked(simd, &tree.leaves[current.index()], ray, accept) {
                return true;
            }
        } else if let Some(next) = visit(simd, &tree.nodes[current.index()], ray, &mut stack) {
            current = next;
            continue;
        }
        match stack.pop() {
            Some(entry) => current = Child(entry as u32),
            None => return false,
        }
    }
}

/// See [`Tracer::any`](crate::trace::Tracer::any).
pub(crate) struct AnyHit<'a, A> {
    pub(crate) tree: &'a WideTree,
    pub(crate) ray: &'a Ray,
    pub(crate) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Kernel<Option<Hit>> for AnyHit<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Option<Hit> {
        let ray = PreparedRay::new(self.ray, &self.tree.bounds)?;
        any_hit(simd, self.tree, &ray, &mut self.accept)
    }
}

/// The first accepted hit of a prepared ray that the traversal finds.
#[inline(always)]
fn any_hit<S: Simd>(simd: S, tree: &WideTree, ray: &PreparedRay, accept: &mut impl FnMut(&Hit) -> bool) -> Option<Hit> {
    let t_max = ray.line.t_max;
    let mut found = None;
    let mut stack = Stack::new();
    let mut current = tree.root;
    if current == Child::NONE {
        return None;
    }
    loop {
        if current.is_leaf() {
            let stopped = tree.leaves[current.index()].intersect(simd, ray, &mut { t_max }, |hit, transparent, _| {
                let accepted = hit.t < t_max && (!transparent || accept(&hit));
                if accepted {
                    found = Some(hit);
                }
                accepted
            });
            if stopped {
                return found;
            }
        } else if let Some(next) = visit(simd, &tree.nodes[current.index()], ray, &mut stack) {
            current = next;
            continue;
        }
        current = Child(stack.pop()? as u32);
    }
}

/// Whether a triangle of the leaf stops the ray.
#[inline(always)]
pub(crate) fn blocked<S: Simd>(simd: S, leaf: &Leaf, ray: &PreparedRay, accept: &mut impl FnMut(&Hit) -> bool) -> bool {
    leaf.stops(simd, &ray.line, || *ray, accept)
}

/// See [`Tracer::blocked_by`](crate::trace::Tracer::blocked_by).
pub(crate) struct BlockedBy<'a, B> {
    pub(crate) tree: &'a WideTree,
    pub(crate) rays: &'a [Ray],
    pub(crate) recent: &'a mut Recent,
    pub(crate) blocks: B,
}

impl<B: FnMut(u32) -> bool> Kernel<u64> for BlockedBy<'_, B> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> u64 {
        let mut found = 0;
        for (index, ray) in self.rays.iter().enumerate() {
            if let Some(ray) = PreparedRay::new(ray, &self.tree.bounds) {
                found |= u64::from(blocked_by(simd, self.tree, &ray, self.recent, &mut self.blocks)) << index;
            }
        }
        found
    }
}

/// Whether a triangle whose id `blocks` accepts stops a prepared ray. The recent leaves are tested before the tree is
/// traversed.
#[inline(always)]
fn blocked_by<S: Simd>(
    simd: S,
    tree: &WideTree,
    ray: &PreparedRay,
    recent: &mut Recent,
    blocks: &mut impl FnMut(u32) -> bool,
) -> bool {
    for place in 0..Recent::LEAVES {
        let leaf = tree.leaves.get(recent.leaves[place] as usize);
        if leaf.is_some_and(|leaf| leaf.stops_by(simd, ray, blocks)) {
            recent.leaves[..=place].rotate_right(1);
            return true;
        }
    }
    let mut stack = Stack::new();
    let mut current = tree.root;
    if current == Child::NONE {
        return false;
    }
    loop {
        if current.is_leaf() {
            if tree.leaves[current.index()].stops_by(simd, ray, blocks) {
                recent.leaves.rotate_right(1);
                recent.leaves[0] = current.index() as u32;
                return true;
            }
        } else if let Some(next) = visit(simd, &tree.nodes[current.index()], ray, &mut stack) {
            current = next;
            continue;
        }
        match stack.pop() {
            Some(entry) => current = Child(entry as u32),
            None => return false,
        }
    }
}

/// Pushes the children that the ray meets, and returns one of them instead of pushing it.
#[inline(always)]
fn visit<S: Simd>(simd: S, node: &Node, ray: &PreparedRay, stack: &mut Stack) -> Option<Child> {
    let (mut lanes, _) = ray.slabs(simd, &node.planes, ray.line.t_max);
    if lanes == NO_LANES {
        return None;
    }
    let mut next = first_lane(lanes);
    lanes = without_first(lanes);
    while lanes != NO_LANES {
        stack.push(u64::from(node.children[next].0));
        next = first_lane(lanes);
        lanes = without_first(lanes);
    }
    Some(node.children[next])
}
