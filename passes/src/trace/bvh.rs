//! The bounding volume hierarchy of the processor backend.

use super::block::Block;
use super::build::{self, Effort};
use super::bundle;
use super::clear::{ClearAbove, Plane};
use super::dispatch::{Detected, Lanes, Work};
use super::fan::CountOpen;
use super::lanes::{NO_LANES, Simd, first_lane, without_first};
use super::nearby::{Gather, Nearby, Neighbourhood};
use super::node::{Child, Node};
use super::parallel;
use super::query::{Bounds, Query};
use super::stack::Stack;
use super::triangles::Triangles;
use super::{Decided, Estimates, Fan, Hit, Packet, PacketHits, Ray, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;
use obvhs::ploc::PlocSearchDistance;

/// How much time [`Bvh::build`] spends on the tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// For geometry that is traced little.
    Fast,
    /// What measured best over a frame of about ten million rays.
    #[default]
    Balanced,
    /// For geometry that is traced long.
    Slow,
}

impl Quality {
    pub(super) fn effort(self, triangles: usize) -> Effort {
        // Reinsertion searches the whole tree for each candidate: its share shrinks where there are many.
        let share = |most: f32| (most / triangles.max(1) as f32).min(1.0);
        match self {
            Self::Fast => Effort { search: PlocSearchDistance::Minimum, threshold: 0, reinsertion: 0.0 },
            Self::Balanced => {
                Effort { search: PlocSearchDistance::Low, threshold: 0, reinsertion: 0.03 * share(4.0e5) }
            }
            Self::Slow => Effort { search: PlocSearchDistance::VeryHigh, threshold: 1, reinsertion: share(1.0e6) },
        }
    }
}

/// A tree of nodes with eight children and blocks of eight triangles, tested by vector instructions.
///
/// * Watertight: no ray passes between triangles that share an edge or a vertex (see [`super`] for the reference).
/// * Results do not depend on the tree, the instruction set or the number of threads: what a ray hits, and at what
///   distance, is a function of the ray, the triangle and the bounds of the scene; of equal distances the lowest id wins.
/// * Triangles with a corner that is not finite, or with an index out of range, are left out. Degenerate triangles are
///   kept and never hit. Coordinates above 10¹⁸ overflow the triangle test and are missed.
/// * Memory is [`Self::bytes`], 65 to 90 bytes a triangle; while it is built, 110 to 160 in all.
pub struct Bvh {
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    pub(super) root: Child,
    pub(super) bounds: Bounds,
    pub(super) lanes: Detected,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh")
            .field("nodes", &self.nodes.len())
            .field("blocks", &self.blocks.len())
            .field("lanes", &self.lanes())
            .finish()
    }
}

impl Bvh {
    /// Builds the tree over all triangles, with rayon's global pool.
    ///
    /// `transparent[material]` says whether hits on that material need the accept closure; materials beyond its end are
    /// opaque.
    ///
    /// # Panics
    /// If there are 2³¹ triangles or more.
    #[must_use]
    pub fn build(geometry: &Geometry, transparent: &[bool], quality: Quality) -> Self {
        let built = build::build::<Block>(&Triangles::new(geometry, transparent), quality);
        Self {
            nodes: built.nodes,
            blocks: built.leaves,
            root: built.root,
            bounds: built.bounds,
            lanes: Detected::best(),
        }
    }

    /// The same tree, traversed with another instruction set; nothing if the processor lacks it. For tests and benches.
    #[must_use]
    pub fn with_lanes(self, lanes: Lanes) -> Option<Self> {
        Some(Self { lanes: Detected::new(lanes)?, ..self })
    }

    /// The instruction set in use.
    #[must_use]
    pub fn lanes(&self) -> Lanes {
        self.lanes.lanes()
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Memory of nodes and triangles, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.blocks.as_slice())
    }
}

impl Bvh {
    /// Has what will be visited later brought near.
    #[inline(always)]
    pub(super) fn prefetch<S: Simd>(&self, simd: S, child: Child) {
        if child.is_block() {
            simd.prefetch(&self.blocks[child.index()]);
        } else {
            simd.prefetch(&self.nodes[child.index()]);
        }
    }
}

/// The walks, compiled once for whatever `accept` is: it is called for transparent triangles only.
impl Bvh {
    fn find_closest(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        self.lanes.run(Closest { bvh: self, ray, accept })
    }

    fn find_any(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        self.lanes.run(Occluded { bvh: self, ray, accept })
    }

    fn count_open_rays(&self, fan: &Fan<'_>, accept: &mut dyn FnMut(&Hit) -> bool) -> u32 {
        self.lanes.run(CountOpen { bvh: self, fan, accept })
    }
}

impl Tracer for Bvh {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.find_closest(ray, &mut accept)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        self.find_any(ray, &mut accept)
    }

    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        self.lanes.run(ClearAbove { bvh: self, plane: Plane { origin, normal }, t_max })
    }

    fn gather(&self, around: &Neighbourhood, nearby: &mut Nearby) -> bool {
        self.lanes.run(Gather { bvh: self, around, nearby })
    }

    fn count_open(&self, fan: &Fan<'_>, mut accept: impl FnMut(&Hit) -> bool) -> u32 {
        self.count_open_rays(fan, &mut accept)
    }

    fn closest_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        assert_eq!(packets.len(), hits.len(), "one result for each packet");
        bundle::closest_packets(self, packets, hits, &mut accept);
    }

    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        assert_eq!(packets.len(), blocked.len(), "one result for each packet");
        bundle::occluded_packets::<true>(self, packets, blocked, &mut accept);
    }

    fn occluded_undecided(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        assert_eq!(packets.len(), blocked.len(), "one result for each packet");
        bundle::occluded_packets::<false>(self, packets, blocked, &mut accept);
    }

    const DECIDES: bool = true;

    fn decide(&self, estimates: &Estimates, decided: &mut Decided) {
        self.lanes.run(Decide { bvh: self, estimates, decided });
    }
}

struct Decide<'a> {
    bvh: &'a Bvh,
    estimates: &'a Estimates,
    decided: &'a mut Decided,
}

impl Work<()> for Decide<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        parallel::decide(simd, self.bvh, self.estimates, self.decided);
    }
}

pub(super) struct Closest<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) ray: &'a Ray,
    pub(super) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Work<Option<Hit>> for Closest<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Option<Hit> {
        let query = Query::new(self.ray, &self.bvh.bounds)?;
        let mut best = None;
        closest(simd, self.bvh, self.bvh.root, &query, &mut best, &mut self.accept);
        best
    }
}

/// Finds the nearest hit of a prepared ray below `entry` that is nearer than `best` and that `accept` takes.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    simd: S,
    bvh: &Bvh,
    entry: Child,
    query: &Query,
    best: &mut Option<Hit>,
    accept: &mut impl FnMut(&Hit) -> bool,
) {
    let mut limit = best.map_or(query.line.t_max, |best| best.t);
    let mut stack = Stack::new();
    let mut current = entry;
    if current == Child::NONE {
        return;
    }
    loop {
        if current.is_block() {
            approach(simd, &bvh.blocks[current.index()], query, (&mut limit, best), accept);
        } else if let Some(next) = visit_ordered(simd, &bvh.nodes[current.index()], query, limit, &mut stack) {
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

/// Keeps the nearest hit of a block.
#[inline(always)]
pub(super) fn approach<S: Simd>(
    simd: S,
    block: &Block,
    query: &Query,
    (limit, best): (&mut f32, &mut Option<Hit>),
    accept: &mut impl FnMut(&Hit) -> bool,
) {
    block.intersect(simd, query, limit, |hit, transparent, limit| {
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

/// Pushes the children that the ray meets up to `limit`, nearest on top, and returns the nearest instead of pushing it.
///
/// An entry is the bits of the distance, which order as the distance does since it is not negative, above the child.
#[inline(always)]
fn visit_ordered<S: Simd>(simd: S, node: &Node, query: &Query, limit: f32, stack: &mut Stack) -> Option<Child> {
    let (mut lanes, enter) = query.slabs(simd, &node.planes, limit);
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

struct Occluded<'a, A> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    accept: A,
}

impl<A: FnMut(&Hit) -> bool> Work<bool> for Occluded<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> bool {
        match Query::new(self.ray, &self.bvh.bounds) {
            Some(query) => occluded(simd, self.bvh, self.bvh.root, &query, &mut self.accept),
            None => false,
        }
    }
}

/// Whether a prepared ray hits anything below `entry` that `accept` takes.
#[inline(always)]
pub(super) fn occluded<S: Simd>(
    simd: S,
    bvh: &Bvh,
    entry: Child,
    query: &Query,
    accept: &mut impl FnMut(&Hit) -> bool,
) -> bool {
    let mut stack = Stack::new();
    let mut current = entry;
    if current == Child::NONE {
        return false;
    }
    loop {
        if current.is_block() {
            if blocked(simd, &bvh.blocks[current.index()], query, accept) {
                return true;
            }
        } else if let Some(next) = visit(simd, &bvh.nodes[current.index()], query, &mut stack) {
            current = next;
            continue;
        }
        match stack.pop() {
            Some(entry) => current = Child(entry as u32),
            None => return false,
        }
    }
}

/// Whether a triangle of the block stops the ray.
#[inline(always)]
pub(super) fn blocked<S: Simd>(simd: S, block: &Block, query: &Query, accept: &mut impl FnMut(&Hit) -> bool) -> bool {
    block.stops(simd, &query.line, || *query, accept)
}

/// Pushes the children that the ray meets, and returns one of them instead of pushing it.
#[inline(always)]
fn visit<S: Simd>(simd: S, node: &Node, query: &Query, stack: &mut Stack) -> Option<Child> {
    let (mut lanes, _) = query.slabs(simd, &node.planes, query.line.t_max);
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
