//! The tracer of the processor backend: the wide tree, and every traversal compiled for the processor's instruction set.

use super::build::{self, Built, Quality, Triangles};
use super::fan::{Candidates, ClearAbove, CountOpen, Gather, Neighbourhood};
use super::packet;
use super::parallel::{self, Decided, Estimates};
use super::ray::{Fan, Hit, PACKET, Packet, PacketHits, Ray, Recent, TOGETHER};
use super::simd::{Detected, InstructionSet, Kernel, Simd};
use super::single::{AnyHit, BlockedBy, Closest, Occluded};
use super::tracer::Tracer;
use super::tree::{Leaf, Plane, WideTree};
use curitiba_pipeline::progress::Progress;
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

/// A tree of nodes with eight children and leaves of eight triangles, tested by vector instructions.
///
/// * Watertight: no ray passes between triangles that share an edge or a vertex (see [`super`] for the reference).
/// * Results do not depend on the tree, the instruction set or the number of threads: what a ray hits, and at what
///   distance, is a function of the ray, the triangle and the bounds of the scene; of equal distances the lowest id wins.
/// * Triangles with a corner that is not finite, or with an index out of range, are left out. Degenerate triangles are
///   kept and never hit. Coordinates above 10¹⁸ overflow the triangle test and are missed.
/// * The triangles of a sky ([`Geometry::sky`]) are in a tree of their own, which only closest-hit queries search. The closest hit is the
///   nearer of the two trees' hits; of equal distances, the one that is not on the sky.
/// * Memory is [`Self::bytes`], 65 to 90 bytes a triangle; while it is built, 110 to 160 in all.
pub struct Bvh {
    pub(crate) tree: WideTree,
    /// The tree of the sky.
    sky: Option<Box<WideTree>>,
    instruction_set: Detected,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh")
            .field("nodes", &self.tree.nodes.len())
            .field("leaves", &self.tree.leaves.len())
            .field("instruction_set", &self.instruction_set())
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
        Self::build_until(geometry, transparent, quality, &Progress::default()).expect("nobody asks to give it up")
    }

    /// As [`Self::build`], but may be cancelled; `None` then. Cancellation is checked between the parts of the work that threads take. The
    /// clustering of the binary tree is a single part.
    ///
    /// # Panics
    /// As [`Self::build`].
    #[must_use]
    pub fn build_until(
        geometry: &Geometry,
        transparent: &[bool],
        quality: Quality,
        progress: &Progress,
    ) -> Option<Self> {
        let whole = |built: Built<Leaf>| WideTree {
            nodes: built.nodes,
            leaves: built.leaves,
            root: built.root,
            bounds: built.bounds,
        };
        let sky = Triangles::new(geometry, transparent).sky();
        progress.start(build::STEPS * if sky.is_some() { 2 } else { 1 });
        let tree = whole(build::build_until(&Triangles::new(geometry, transparent), quality, progress)?);
        let sky = match sky {
            Some(sky) => Some(Box::new(whole(build::build_until(&sky, quality, progress)?))),
            None => None,
        };
        Some(Self { tree, sky, instruction_set: Detected::best() })
    }

    /// The same tree, traversed with another instruction set; `None` if the processor lacks it. For tests and benches.
    #[must_use]
    pub fn with_instruction_set(self, set: InstructionSet) -> Option<Self> {
        Some(Self { instruction_set: Detected::new(set)?, ..self })
    }

    /// The instruction set in use.
    #[must_use]
    pub fn instruction_set(&self) -> InstructionSet {
        self.instruction_set.set()
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.tree.nodes.len()
    }

    /// Memory of nodes and triangles, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let of = |tree: &WideTree| size_of_val(tree.nodes.as_slice()) + size_of_val(tree.leaves.as_slice());
        of(&self.tree) + self.sky.as_ref().map_or(0, |sky| of(sky))
    }
}

/// The traversals. `accept` is called for transparent triangles only, so its dynamic calls through a trait object are rare. Because of the
/// trait object, each traversal is compiled once, not once for each closure.
impl Bvh {
    fn find_closest(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        let hit = self.instruction_set.run(Closest { tree: &self.tree, ray, accept: &mut *accept });
        if self.sky.is_some() { self.before_sky(ray, hit, accept) } else { hit }
    }

    /// The hit on the sky if it is nearer than `hit`, else `hit`.
    #[cold]
    fn before_sky(&self, ray: &Ray, hit: Option<Hit>, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        let Some(tree) = &self.sky else { return hit };
        let ray = &Ray { t_max: hit.map_or(ray.t_max, |hit| hit.t), ..*ray };
        self.instruction_set.run(Closest { tree, ray, accept }).or(hit)
    }

    fn find_any(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        self.instruction_set.run(Occluded { tree: &self.tree, ray, accept })
    }

    fn find_any_hit(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        self.instruction_set.run(AnyHit { tree: &self.tree, ray, accept })
    }

    fn find_blocked(&self, rays: &[Ray], recent: &mut Recent, blocks: &mut dyn FnMut(u32) -> bool) -> u64 {
        self.instruction_set.run(BlockedBy { tree: &self.tree, rays, recent, blocks })
    }

    fn count_open_rays(&self, fan: &Fan<'_>, accept: &mut dyn FnMut(&Hit) -> bool) -> u32 {
        self.instruction_set.run(CountOpen { tree: &self.tree, fan, accept })
    }

    fn find_closest_of_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    ) {
        let all = ClosestPackets { tree: &self.tree, packets, hits: &mut *hits, accept: &mut *accept };
        self.instruction_set.run(all);
        if self.sky.is_none() {
            return;
        }
        for (index, (packet, hits)) in packets.iter().zip(hits).enumerate() {
            for lane in packet.lanes() {
                let mut accept = |hit: &Hit| accept(index * PACKET + lane, hit);
                if let Some(hit) = self.before_sky(&packet.ray(lane), hits.get(lane), &mut accept) {
                    hits.set(lane, &hit);
                }
            }
        }
    }

    fn find_any_of_packets<const LISTS: bool>(
        &self,
        packets: &[Packet],
        blocked: &mut [u16],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    ) {
        self.instruction_set.run(OccludedPackets::<_, LISTS> { tree: &self.tree, packets, blocked, accept });
    }
}

impl Tracer for Bvh {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.find_closest(ray, &mut accept)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        self.find_any(ray, &mut accept)
    }

    fn any(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.find_any_hit(ray, &mut accept)
    }

    fn blocked_by(&self, rays: &[Ray], recent: &mut Recent, mut blocks: impl FnMut(u32) -> bool) -> u64 {
        self.find_blocked(rays, recent, &mut blocks)
    }

    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        self.instruction_set.run(ClearAbove { tree: &self.tree, plane: Plane { origin, normal }, t_max })
    }

    fn gather(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool {
        let instruction_set = self.instruction_set;
        instruction_set.run(Gather { tree: &self.tree, instruction_set, around, candidates })
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
        self.find_closest_of_packets(packets, hits, &mut accept);
    }

    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        assert_eq!(packets.len(), blocked.len(), "one result for each packet");
        self.find_any_of_packets::<true>(packets, blocked, &mut accept);
    }

    fn occluded_undecided(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        assert_eq!(packets.len(), blocked.len(), "one result for each packet");
        self.find_any_of_packets::<false>(packets, blocked, &mut accept);
    }

    fn decides(&self) -> bool {
        true
    }

    fn decide(&self, estimates: &Estimates, decided: &mut Decided) {
        self.instruction_set.run(Decide { tree: &self.tree, estimates, decided });
    }
}

struct ClosestPackets<'a, A> {
    tree: &'a WideTree,
    packets: &'a [Packet],
    hits: &'a mut [PacketHits],
    accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool> Kernel<()> for ClosestPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        packet::closest_packets(simd, self.tree, self.packets, self.hits, self.accept);
    }
}

/// Occlusion query for packets. With `LISTS`, packets of parallel rays are tested against lists of triangles where that is possible.
struct OccludedPackets<'a, A, const LISTS: bool> {
    tree: &'a WideTree,
    packets: &'a [Packet],
    blocked: &'a mut [u16],
    accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool, const LISTS: bool> Kernel<()> for OccludedPackets<'_, A, LISTS> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.blocked.fill(0);
        for (chunk, packets) in self.packets.chunks(TOGETHER).enumerate() {
            let first = chunk * TOGETHER;
            let (blocked, accept) = (&mut self.blocked[first..][..packets.len()], &mut self.accept);
            let mut accept = |ray: usize, hit: &Hit| accept(first * PACKET + ray, hit);
            if !(LISTS && parallel::occluded(simd, self.tree, packets, blocked, &mut accept)) {
                packet::occluded_packets(simd, self.tree, packets, blocked, accept);
            }
        }
    }
}

struct Decide<'a> {
    tree: &'a WideTree,
    estimates: &'a Estimates,
    decided: &'a mut Decided,
}

impl Kernel<()> for Decide<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        parallel::decide(simd, self.tree, self.estimates, self.decided);
    }
}
