//! The wide tree in the layout that a GPU traverses, one ray a thread.
//!
//! Nodes have eight children whose boxes are quantised to 8 bits a plane, outwards: Ylitie, Karras and Laine, "Efficient
//! Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3. Leaves have up to three triangles.
//! The tree is built and collapsed as [`Bvh`](crate::trace::Bvh) is, with the costs of this layout.

use super::builder::{self, Built};
use super::effort::Quality;
use super::emit::{GRAIN, MAX_DEPTH};
use super::input::Triangles;
use super::leaf_format::LeafFormat;
use crate::trace::rounding;
use crate::trace::simd::LANES;
use crate::trace::tree::{self, Bounds, Child, Node};
use bytemuck::{Pod, Zeroable};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;
use rayon::prelude::*;

/// Flag in the id of a transparent triangle, whose hits the program must accept or reject.
pub const TRANSPARENT: u32 = tree::TRANSPARENT;
/// Entries of the traversal stack: at most one a level, and two to spare.
pub const STACK: usize = MAX_DEPTH + 2;

/// The error bounds of the device programs, with their names in device code.
pub const BOUNDS: &[(&str, f32)] = rounding::OF_DEVICE;
/// A triangle's normal must be at least this share of the product of the lengths of its edges, or device code does not trust it.
pub const DEVICE_SHARPEST: f64 = rounding::DEVICE_SHARPEST;

/// Greatest number of triangles in a leaf: three bits of a child's description count them in unary.
const LEAF: usize = 3;
/// Cost of testing a triangle, where opening a node of eight boxes costs 1.
const TRIANGLE_COST: f32 = 0.3;

/// A node of eight children: 80 bytes.
///
/// Along each axis, a plane of child `s` lies at `corner + q * 2^(exponent - 127)`, where `q` is byte `s` of that axis's eight. A child's
/// slot says in which octant of the node it lies: bit 0 of the slot is set on the high side along x, bit 1 along y, bit 2 along z. Where
/// several children compete for a slot, some lie in other slots.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct DeviceNode {
    /// Low corner of the node's box, the origin of the quantised coordinates.
    pub corner: [f32; 3],
    /// Biased exponents of the quantisation step along x, y and z.
    pub exponents: [u8; 3],
    /// Bit `s` is set where slot `s` holds a node.
    pub inner: u8,
    /// Index of the first child node; the other child nodes follow in the order of their slots.
    pub first_child: u32,
    /// Index of the first triangle of the node's leaves, counted in triangles of three vectors each.
    pub first_triangle: u32,
    /// One byte a slot. 0: empty. `0x20 | 24 + slot`: a node. Else a leaf: the number of its triangles in unary (1, 3, 7) times 32, plus
    /// the offset of its first triangle from `first_triangle`.
    pub children: [u8; LANES],
    /// Low planes by axis.
    pub low: [[u8; LANES]; 3],
    /// High planes by axis.
    pub high: [[u8; LANES]; 3],
}

/// The tree, ready to be copied to a device.
#[derive(Debug, Clone, Default)]
pub struct DeviceTree {
    /// Nodes, the root first; empty if the tree holds no triangle.
    pub nodes: Vec<DeviceNode>,
    /// Three vectors a triangle: its corners. The fourth component of the first one holds the bits of the triangle's id, with
    /// [`TRANSPARENT`].
    pub triangles: Vec<[[f32; 4]; 3]>,
    /// Low and high corner of the bounds of its triangles.
    pub bounds: [[f32; 3]; 2],
}

/// The ids of a leaf's triangles.
struct Members {
    count: usize,
    ids: [u32; LEAF],
}

impl Members {
    fn as_slice(&self) -> &[u32] {
        &self.ids[..self.count]
    }
}

impl LeafFormat for Members {
    const MOST: usize = LEAF;
    const CHILD_COST: f32 = 0.0;

    fn cost(triangles: usize) -> f32 {
        triangles as f32 * TRIANGLE_COST
    }

    fn new(triangles: &Triangles<'_>, members: &[u32]) -> (Self, Bounds) {
        let mut ids = [0; LEAF];
        ids[..members.len()].copy_from_slice(members);
        (Self { count: members.len(), ids }, triangles.bounds(members))
    }
}

impl DeviceTree {
    /// Builds the tree over all triangles but those of a sky ([`Geometry::sky`]), with rayon's global pool; arguments as for
    /// [`Bvh::build`](crate::trace::Bvh::build).
    ///
    /// # Panics
    /// If there are 2³¹ triangles or more.
    #[must_use]
    pub fn build(geometry: &Geometry, transparent: &[bool], quality: Quality) -> Self {
        Self::over(&Triangles::new(geometry, transparent), quality)
    }

    /// Builds the tree over the triangles of the sky, as [`Self::build`] does over the others; `None` if there is no sky.
    ///
    /// # Panics
    /// As [`Self::build`].
    #[must_use]
    pub fn of_sky(geometry: &Geometry, transparent: &[bool], quality: Quality) -> Option<Self> {
        Triangles::new(geometry, transparent).sky().map(|sky| Self::over(&sky, quality))
    }

    fn over(triangles: &Triangles<'_>, quality: Quality) -> Self {
        let Built { mut nodes, leaves, mut root, bounds, triangles: count } =
            builder::build::<Members>(triangles, quality);
        if root == Child::NONE {
            return Self::default();
        }
        if root.is_leaf() {
            // The root must be a node, so a tree of one leaf gets a node around it.
            let mut alone = Node::EMPTY;
            alone.set(0, bounds, root);
            (nodes, root) = (vec![alone], Child::node(0));
        }
        let slots: Vec<Slots> = nodes.par_iter().with_min_len(GRAIN).map(Slots::of).collect();
        let Layout { places, ids } = Layout::new(root, &nodes, &slots, &leaves, count);
        let node = |place: &Place| DeviceNode::new(&nodes[place.node], &slots[place.node], &leaves, place);
        let triangle = |&id: &u32| {
            let ([a, b, c], id) = (triangles.corners(id), triangles.marked(id));
            [a.extend(f32::from_bits(id)), b.extend(0.0), c.extend(0.0)].map(|corner| corner.to_array())
        };
        Self {
            nodes: places.par_iter().with_min_len(GRAIN).map(node).collect(),
            triangles: ids.par_iter().with_min_len(GRAIN).map(triangle).collect(),
            bounds: [bounds.low.to_array(), bounds.high.to_array()],
        }
    }

    /// Memory of nodes and triangles, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice())
    }
}

/// A node's place in the device's order, and the places of its children and triangles.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    /// Index of the node in the tree that was built.
    node: usize,
    first_child: u32,
    first_triangle: u32,
}

/// The order of nodes and triangles on the device.
struct Layout {
    places: Vec<Place>,
    /// Ids of the triangles, leaf after leaf.
    ids: Vec<u32>,
}

impl Layout {
    /// The layout of a tree. The child nodes of a node are consecutive, in the order of their slots; so are the triangles of its leaves.
    fn new(root: Child, nodes: &[Node], slots: &[Slots], leaves: &[Members], triangles: usize) -> Self {
        let mut layout = Self { places: Vec::with_capacity(nodes.len()), ids: Vec::with_capacity(triangles) };
        layout.places.push(Place::default());
        let mut pending = vec![(root.index(), 0)];
        while let Some((node, place)) = pending.pop() {
            let Self { places, ids } = &mut layout;
            places[place] = Place { node, first_child: places.len() as u32, first_triangle: ids.len() as u32 };
            for (_, lane) in slots[node].taken() {
                let child = nodes[node].children[lane];
                if child.is_leaf() {
                    ids.extend_from_slice(leaves[child.index()].as_slice());
                } else {
                    pending.push((child.index(), places.len()));
                    places.push(Place::default());
                }
            }
        }
        layout
    }
}

fn quantum(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

/// The coordinate of a quantised plane, rounded as a device rounds it.
fn plane(corner: f32, quantum: f32, steps: u8) -> f32 {
    // The product is exact, so this is one rounding, fused or not.
    corner + f32::from(steps) * quantum
}

/// The smallest exponent, 1 to 254 and biased as in the bits of an `f32`, with which 255 steps reach from `low` to `high`.
fn exponent(low: f32, high: f32) -> u8 {
    let step = (f64::from(high) - f64::from(low)) / 255.0;
    let mut exponent = ((step as f32).to_bits() >> 23).clamp(1, 254) as u8;
    while exponent < 254 && plane(low, quantum(exponent), 255) < high {
        exponent += 1;
    }
    exponent
}

impl DeviceNode {
    /// The device node for a node of the tree, with its children in their slots.
    fn new(node: &Node, slots: &Slots, leaves: &[Members], place: &Place) -> Self {
        let whole = node.whole();
        let mut written = Self {
            corner: whole.low.to_array(),
            exponents: [0, 1, 2].map(|axis| exponent(whole.low[axis], whole.high[axis])),
            first_child: place.first_child,
            first_triangle: place.first_triangle,
            ..Self::zeroed()
        };
        let mut offset = 0;
        for (slot, lane) in slots.taken() {
            written.quantise(slot, node.bounds(lane));
            let child = node.children[lane];
            if child.is_leaf() {
                let count = leaves[child.index()].count;
                written.children[slot] = (0b111_u8 >> (LEAF - count)) << 5 | offset;
                offset += count as u8;
            } else {
                written.inner |= 1 << slot;
                written.children[slot] = 0x20 | (24 + slot as u8);
            }
        }
        written
    }

    /// Writes the box of a slot, rounded outwards.
    fn quantise(&mut self, slot: usize, bounds: Bounds) {
        for axis in 0..3 {
            let (corner, quantum) = (self.corner[axis], quantum(self.exponents[axis]));
            let steps = |coordinate: f32| (f64::from(coordinate) - f64::from(corner)) / f64::from(quantum);
            // The conversion to `u8` truncates: `floor` and `ceil` are function calls unless the compiler may use the processor's
            // instruction.
            let mut low = steps(bounds.low[axis]) as u8;
            while low > 0 && plane(corner, quantum, low) > bounds.low[axis] {
                low -= 1;
            }
            let most = steps(bounds.high[axis]);
            let mut high = (most as u8).saturating_add(u8::from(f64::from(most as u8) < most));
            while high < u8::MAX && plane(corner, quantum, high) < bounds.high[axis] {
                high += 1;
            }
            (self.low[axis][slot], self.high[axis][slot]) = (low, high);
        }
    }

    /// The box of a slot, dequantised: low and high corner.
    #[must_use]
    pub fn bounds(&self, slot: usize) -> [[f32; 3]; 2] {
        [&self.low, &self.high].map(|planes| {
            [0, 1, 2].map(|axis: usize| plane(self.corner[axis], quantum(self.exponents[axis]), planes[axis][slot]))
        })
    }
}

/// Marks children and slots that are assigned; lower than any distance that is compared.
const OUT: f32 = f32::NEG_INFINITY;

/// Index of the first occurrence of a value in a list.
fn first_of(values: &[f32; LANES], value: f32) -> usize {
    (0..LANES).rev().fold(0, |first, index| if values[index] == value { index } else { first })
}

/// For each slot, the lane that its child has in the node that was built; `None` for an empty slot.
struct Slots([Option<u8>; LANES]);

impl Slots {
    /// Assigns children to slots greedily: first the pair of child and slot in which the child lies farthest towards the slot's corner.
    fn of(node: &Node) -> Self {
        let used = |lane: &usize| node.children[*lane] != Child::NONE;
        let whole = node.whole();
        let center = (whole.low + whole.high) * 0.5;
        // How far each child lies towards the corner of each slot; `OUT` for children that are assigned already.
        let mut along = [[OUT; LANES]; LANES];
        for lane in (0..LANES).filter(used) {
            let bounds = node.bounds(lane);
            let from_center = (bounds.low + bounds.high) * 0.5 - center;
            // NaN where coordinates overflow; `max` replaces it, and then any slot serves.
            along[lane] = std::array::from_fn(|slot| from_center.dot(towards(slot)).max(f32::MIN));
        }
        let mut taken = [None; LANES];
        for _ in (0..LANES).filter(used) {
            let farthest = along.map(|slots| slots.into_iter().fold(OUT, f32::max));
            let lane = first_of(&farthest, farthest.into_iter().fold(OUT, f32::max));
            let slot = first_of(&along[lane], farthest[lane]);
            taken[slot] = Some(lane as u8);
            along[lane] = [OUT; LANES];
            for slots in &mut along {
                slots[slot] = OUT;
            }
        }
        Self(taken)
    }

    /// The slots in use, each with the lane of its child.
    fn taken(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.0.iter().enumerate().filter_map(|(slot, lane)| Some((slot, usize::from((*lane)?))))
    }
}

/// Direction from the centre of a box to the corner of a slot.
fn towards(slot: usize) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|axis| if slot >> axis & 1 == 1 { 1.0 } else { -1.0 }))
}

#[cfg(test)]
mod tests {
    use super::super::soup::soup;
    use super::*;
    use curitiba_pipeline::scene::TriangleRanges;

    /// Checks that every triangle below a node lies in all boxes on its path, and returns the number of levels.
    fn check(tree: &DeviceTree, index: usize, inside: &[[[f32; 3]; 2]], seen: &mut Vec<u32>) -> usize {
        let node = &tree.nodes[index];
        let mut depth = 1;
        for slot in 0..LANES {
            let meta = node.children[slot];
            if meta == 0 {
                continue;
            }
            let boxes: Vec<_> = inside.iter().copied().chain([node.bounds(slot)]).collect();
            if node.inner >> slot & 1 == 1 {
                assert_eq!(usize::from(meta), 0x20 + 24 + slot);
                let before = (node.inner & ((1 << slot) - 1)).count_ones();
                depth = depth.max(1 + check(tree, (node.first_child + before) as usize, &boxes, seen));
                continue;
            }
            for triangle in 0..(meta >> 5).count_ones() {
                let corners = tree.triangles[(node.first_triangle + u32::from(meta & 31) + triangle) as usize];
                seen.push(corners[0][3].to_bits());
                for corner in corners {
                    for axis in 0..3 {
                        for [low, high] in &boxes {
                            assert!(low[axis] <= corner[axis] && corner[axis] <= high[axis]);
                        }
                    }
                }
            }
        }
        depth
    }

    #[test]
    fn every_triangle_is_in_the_tree_once_and_inside_all_boxes_on_its_way() {
        for (count, center, size) in
            [(1, 0.0, 1.0), (3, 5.0, 0.0), (4, 0.0, 0.1), (5000, 0.0, 0.02), (3000, 1.0e4, 0.001), (900, 0.0, 3.0e38)]
        {
            let geometry = soup(count, center, size);
            let tree = DeviceTree::build(&geometry, &[false, true], Quality::Balanced);
            let mut seen = Vec::new();
            let depth = check(&tree, 0, &[], &mut seen);
            assert!(depth <= MAX_DEPTH + 1);
            seen.sort_unstable_by_key(|id| id & !TRANSPARENT);
            let expected: Vec<u32> = (0..count).map(|id| if id < count / 2 { id } else { id | TRANSPARENT }).collect();
            assert_eq!(seen, expected);
            assert_eq!(tree.triangles.len(), count as usize);
        }
    }

    #[test]
    fn a_sky_is_in_a_tree_of_its_own() {
        let mut geometry = soup(900, 0.0, 0.1);
        assert!(DeviceTree::of_sky(&geometry, &[], Quality::Balanced).is_none());
        // The triangles of the second material are the sky.
        geometry.sky = TriangleRanges::of_triangles(&geometry, &[false, true]);
        let ground = DeviceTree::build(&geometry, &[false, true], Quality::Balanced);
        let sky = DeviceTree::of_sky(&geometry, &[false, true], Quality::Balanced).expect("there is one");
        for (tree, expected) in [(ground, 0..450), (sky, 450 | TRANSPARENT..900 | TRANSPARENT)] {
            let mut seen = Vec::new();
            check(&tree, 0, &[], &mut seen);
            seen.sort_unstable();
            assert_eq!(seen, expected.collect::<Vec<u32>>());
            let corners = || tree.triangles.iter().flatten();
            for axis in 0..3 {
                let (low, high) = (tree.bounds[0][axis], tree.bounds[1][axis]);
                assert_eq!(corners().map(|corner| corner[axis]).fold(f32::INFINITY, f32::min), low);
                assert_eq!(corners().map(|corner| corner[axis]).fold(f32::NEG_INFINITY, f32::max), high);
            }
        }
    }

    #[test]
    fn a_tree_of_nothing_has_no_node() {
        let tree = DeviceTree::build(&Geometry::default(), &[], Quality::Balanced);
        assert!(tree.nodes.is_empty() && tree.triangles.is_empty() && tree.bytes() == 0);
    }

    #[test]
    fn boxes_are_no_looser_than_their_quantum() {
        let geometry = soup(2000, 0.0, 0.02);
        let tree = DeviceTree::build(&geometry, &[], Quality::Balanced);
        let root = &tree.nodes[0];
        for axis in 0..3 {
            let (low, high) = (tree.bounds[0][axis], tree.bounds[1][axis]);
            let used = (0..LANES).filter(|slot| root.children[*slot] != 0);
            let most = used.map(|slot| root.bounds(slot)[1][axis]).fold(f32::NEG_INFINITY, f32::max);
            assert!(root.corner[axis] == low && most >= high && most - high <= quantum(root.exponents[axis]));
            assert!((high - low) / quantum(root.exponents[axis]) > 126.0, "a finer quantum would do");
        }
    }
}
