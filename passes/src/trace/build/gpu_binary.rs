//! The binary tree in the layout that any GPU traverses: one ray a thread, the stack in private memory.
//!
//! A node of 64 bytes holds the boxes of its two children: Aila and Laine, "Understanding the Efficiency of Ray Traversal on GPUs", HPG
//! 2009, section 3. The tree is the binary tree of obvhs; subtrees of up to four triangles become leaves where the surface area heuristic
//! says so.

use super::effort::Quality;
use super::input::{Survey, Triangles};
use super::ploc::binary_tree;
use crate::trace::rounding;
use crate::trace::tree::{self, Bounds};
use bytemuck::{Pod, Zeroable};
use curitiba_pipeline::progress::Progress;
use curitiba_pipeline::scene::Geometry;
use obvhs::bvh2::Bvh2;

/// Flag in the id of a transparent triangle, whose hits the program must accept or reject.
pub const TRANSPARENT: u32 = tree::TRANSPARENT;
/// Flag of a child that is a leaf. The two bits below it hold the number of its triangles less 1, and the remaining bits the index of its
/// first triangle.
pub const LEAF: u32 = 1 << 31;
/// Shift of the bits that hold a leaf's count of triangles, less 1.
pub const COUNT_SHIFT: u32 = 29;
/// Entries of the traversal stack: at most one child a level waits, and a sky is one level more.
pub const STACK: usize = DEEPEST + 1;
/// The error bounds of the device programs, with their names in device code.
pub const BOUNDS: &[(&str, f32)] = rounding::OF_DEVICE;
/// Bounds of the plane test (`packet/plane_test.rs`), named as in [`BOUNDS`].
pub const PLANE_TEST: [(&str, f32); 3] = [
    ("DOUBT", rounding::DOUBT),
    ("SMALLEST_SQUARE", rounding::SMALLEST_SQUARE),
    ("LARGEST_SQUARE", rounding::LARGEST_SQUARE),
];

/// Limit on the number of triangles in a tree, so that a leaf can index each of them.
pub const MOST_TRIANGLES: usize = 1 << COUNT_SHIFT;

/// Levels that follow obvhs's tree. Below them, subtrees are rebuilt by halving: 2²⁹ triangles are 2²⁷ leaves of four, which is 27 levels.
const FREE_DEPTH: usize = 36;
/// Greatest number of levels.
const DEEPEST: usize = FREE_DEPTH + 28;
/// Levels whose halves are written in parallel.
const PARALLEL_DEPTH: usize = 6;
/// Greatest number of triangles in a leaf.
const MOST: u32 = 4;
/// Cost of testing a triangle, where opening a node costs 1.
const TRIANGLE_COST: f32 = 1.0;

/// The boxes of two children, and the children themselves.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct BinaryNode {
    /// For each child: low x, high x, low y, high y.
    pub xy: [[f32; 4]; 2],
    /// Low and high z of the first child, then of the second.
    pub z: [f32; 4],
    /// For each child: the index of a node, or a leaf marked by [`LEAF`].
    pub children: [u32; 2],
    unused: [u32; 2],
}

/// The tree, ready to be copied to a device.
#[derive(Debug, Clone, Default)]
pub struct BinaryTree {
    /// Nodes, each before its subtrees. Only the node that joins a sky to all else comes after its subtrees: it is the last.
    pub nodes: Vec<BinaryNode>,
    /// Three corners a triangle, as the bits of `f32`. The fourth component of the first corner is the triangle's id, with [`TRANSPARENT`].
    pub triangles: Vec<[[u32; 4]; 3]>,
    /// The node or leaf at the root of all but the sky ([`Geometry::sky`]); `None` if there is no such triangle.
    pub root: Option<u32>,
    /// The node or leaf at the root of all triangles, those of the sky included; `None` if there are none.
    pub whole: Option<u32>,
    /// Low and high corner of the bounds of all triangles.
    pub bounds: [[f32; 3]; 2],
}

impl BinaryTree {
    /// Builds the tree over all triangles with finite corners; arguments as for [`Bvh::build`](crate::trace::Bvh::build). The result does
    /// not depend on the number of threads.
    ///
    /// # Panics
    /// If there are [`MOST_TRIANGLES`] or more.
    #[must_use]
    pub fn build(geometry: &Geometry, transparent: &[bool], quality: Quality) -> Self {
        assert!(geometry.triangles.len() < MOST_TRIANGLES, "a tree holds fewer than 2^29 triangles");
        let ground = Part::of(&Triangles::new(geometry, transparent), quality);
        let sky = Triangles::new(geometry, transparent).sky().and_then(|sky| Part::of(&sky, quality));
        let root = ground.as_ref().map(|part| part.top.reference);
        let part = match (ground, sky) {
            (Some(ground), Some(sky)) => {
                let mut both = Part::new();
                let [ground, sky] = [ground, sky].map(|part| both.append(part));
                let (place, bounds) = (both.nodes.len(), ground.bounds.union(sky.bounds));
                both.nodes.push(node_of(ground, sky));
                both.top = Top { reference: place as u32, bounds, cost: 0.0 };
                both
            }
            (one, other) => match one.or(other) {
                Some(part) => part,
                None => return Self::default(),
            },
        };
        let Bounds { low, high } = part.top.bounds;
        Self {
            nodes: part.nodes,
            triangles: part.triangles,
            root,
            whole: Some(part.top.reference),
            bounds: [low.to_array(), high.to_array()],
        }
    }

    /// Memory of nodes and triangles, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice())
    }
}

/// The root of a subtree that was written.
#[derive(Debug, Clone, Copy)]
struct Top {
    reference: u32,
    bounds: Bounds,
    /// Cost of the subtree for a ray that meets its box, times half the surface area of the box.
    cost: f32,
}

/// Subtrees that were written one after the other, and the root of the last one.
struct Part {
    nodes: Vec<BinaryNode>,
    triangles: Vec<[[u32; 4]; 3]>,
    top: Top,
}

struct Source<'a> {
    triangles: &'a Triangles<'a>,
    binary: &'a Bvh2,
}

fn half_area(bounds: Bounds) -> f32 {
    let size = bounds.high - bounds.low;
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// Cost of a leaf, times half the surface area of its bounds.
fn leaf_cost(bounds: Bounds, count: u32) -> f32 {
    half_area(bounds) * TRIANGLE_COST * count as f32
}

fn node_of(first: Top, second: Top) -> BinaryNode {
    let xy = |Bounds { low, high }| [low.x, high.x, low.y, high.y];
    let (a, b) = (first.bounds, second.bounds);
    BinaryNode {
        xy: [xy(a), xy(b)],
        z: [a.low.z, a.high.z, b.low.z, b.high.z],
        children: [first.reference, second.reference],
        unused: [0; 2],
    }
}

/// A reference, adjusted for nodes and triangles that were moved behind this many others.
fn moved(reference: u32, nodes: usize, triangles: usize) -> u32 {
    reference + if reference & LEAF == 0 { nodes } else { triangles } as u32
}

impl Part {
    fn new() -> Self {
        let bounds = Bounds::EMPTY;
        Self { nodes: Vec::new(), triangles: Vec::new(), top: Top { reference: 0, bounds, cost: 0.0 } }
    }

    /// The tree over some triangles; `None` without any.
    fn of(triangles: &Triangles<'_>, quality: Quality) -> Option<Self> {
        let to_the_end = &Progress::default();
        let survey = Survey::new(triangles, MOST as usize, to_the_end).expect("nobody asks to give it up");
        let (bounds, count) = (survey.bounds, survey.triangles);
        let binary = binary_tree(triangles, survey, quality.effort(count), to_the_end);
        let binary = binary.expect("nobody asks to give it up");
        if binary.nodes.is_empty() {
            return None;
        }
        let mut part = Source { triangles, binary: &binary }.side_by_side(0, 0);
        part.top.bounds = bounds;
        Some(part)
    }

    /// Appends a part, and returns its root as it is numbered here.
    fn append(&mut self, part: Self) -> Top {
        let (nodes, triangles) = (self.nodes.len(), self.triangles.len());
        self.nodes.extend(part.nodes.into_iter().map(|mut node| {
            node.children = node.children.map(|child| moved(child, nodes, triangles));
            node
        }));
        self.triangles.extend_from_slice(&part.triangles);
        Top { reference: moved(part.top.reference, nodes, triangles), ..part.top }
    }

    /// Joins two subtrees that were written after the node reserved at `place`. They become that node or, where that is cheaper, one leaf.
    fn join(&mut self, place: usize, first_triangle: usize, [first, second]: [Top; 2]) -> Top {
        let bounds = first.bounds.union(second.bounds);
        let cost = half_area(bounds) + first.cost + second.cost;
        let count = (self.triangles.len() - first_triangle) as u32;
        // Costs that cannot be compared (NaN, where areas overflow) leave the tree as it is.
        if count <= MOST && leaf_cost(bounds, count) <= cost {
            self.nodes.truncate(place);
            return leaf(first_triangle, count, bounds);
        }
        self.nodes[place] = node_of(first, second);
        Top { reference: place as u32, bounds, cost }
    }
}

fn leaf(first: usize, count: u32, bounds: Bounds) -> Top {
    Top { reference: LEAF | (count - 1) << COUNT_SHIFT | first as u32, bounds, cost: leaf_cost(bounds, count) }
}

impl Source<'_> {
    /// Writes the subtree at `index`, `depth` levels below the root; its halves are written in parallel.
    fn side_by_side(&self, index: usize, depth: usize) -> Part {
        let node = &self.binary.nodes[index];
        let mut part = Part::new();
        if depth == PARALLEL_DEPTH || node.prim_count > 0 {
            part.top = self.write(index, depth, &mut part);
            return part;
        }
        let half = |half: usize| self.side_by_side(node.first_index as usize + half, depth + 1);
        let (first, second) = rayon::join(|| half(0), || half(1));
        part.nodes.reserve_exact(1 + first.nodes.len() + second.nodes.len());
        part.triangles.reserve_exact(first.triangles.len() + second.triangles.len());
        part.nodes.push(BinaryNode::zeroed());
        let tops = [first, second].map(|half| part.append(half));
        part.top = part.join(0, 0, tops);
        part
    }

    /// Writes the subtree at `index`, `depth` levels below the root.
    fn write(&self, index: usize, depth: usize, part: &mut Part) -> Top {
        let node = &self.binary.nodes[index];
        if node.prim_count > 0 {
            let ids: Vec<u32> = (node.first_index..node.first_index + node.prim_count).collect();
            return self.write_leaf(&ids, part);
        }
        if depth == FREE_DEPTH {
            let mut members = Vec::new();
            self.members(index, &mut members);
            return self.halve(&mut members, part);
        }
        let (place, triangle) = (part.nodes.len(), part.triangles.len());
        part.nodes.push(BinaryNode::zeroed());
        let tops = [0, 1].map(|half| self.write(node.first_index as usize + half, depth + 1, part));
        part.join(place, triangle, tops)
    }

    fn write_leaf(&self, ids: &[u32], part: &mut Part) -> Top {
        let first = part.triangles.len();
        part.triangles.extend(ids.iter().map(|&id| {
            let ([a, b, c], id) = (self.triangles.corners(id), self.triangles.marked(id));
            let bits = |corner: glam::Vec3, last| [corner.x.to_bits(), corner.y.to_bits(), corner.z.to_bits(), last];
            [bits(a, id), bits(b, 0), bits(c, 0)]
        }));
        leaf(first, ids.len() as u32, self.triangles.bounds(ids))
    }

    /// Lists the triangles of a subtree of any depth.
    fn members(&self, index: usize, members: &mut Vec<u32>) {
        let mut pending = vec![index];
        while let Some(index) = pending.pop() {
            let node = &self.binary.nodes[index];
            if node.prim_count > 0 {
                members.extend(node.first_index..node.first_index + node.prim_count);
            } else {
                pending.extend([0, 1].map(|half| node.first_index as usize + half));
            }
        }
    }

    /// Writes triangles as a tree of halves, cut along the longest axis.
    fn halve(&self, members: &mut [u32], part: &mut Part) -> Top {
        if members.len() <= MOST as usize {
            return self.write_leaf(members, part);
        }
        let bounds = self.triangles.bounds(members);
        let axis = (bounds.high - bounds.low).max_position();
        let key = |member: &u32| {
            let [a, b, c] = self.triangles.corners(*member).map(|corner| corner[axis] / 3.0);
            (a + b + c, *member)
        };
        members.sort_unstable_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        });
        let place = part.nodes.len();
        part.nodes.push(BinaryNode::zeroed());
        let middle = members.len() / 2;
        let (first, second) = members.split_at_mut(middle);
        let tops = [self.halve(first, part), self.halve(second, part)];
        part.nodes[place] = node_of(tops[0], tops[1]);
        let bounds = tops[0].bounds.union(tops[1].bounds);
        Top { reference: place as u32, bounds, cost: half_area(bounds) + tops[0].cost + tops[1].cost }
    }
}

#[cfg(test)]
mod tests {
    use super::super::soup::soup;
    use super::*;
    use glam::Vec3;

    /// Checks that every triangle below a reference lies in all boxes on its path, and returns the number of levels of nodes.
    fn check(tree: &BinaryTree, reference: u32, inside: &[[[f32; 2]; 3]], seen: &mut Vec<u32>) -> usize {
        if reference & LEAF != 0 {
            let (first, count) = (reference & ((1 << COUNT_SHIFT) - 1), (reference >> COUNT_SHIFT & 3) + 1);
            for corners in &tree.triangles[first as usize..(first + count) as usize] {
                seen.push(corners[0][3]);
                for corner in corners {
                    for (axis, bits) in corner[..3].iter().enumerate() {
                        let at = f32::from_bits(*bits);
                        assert!(inside.iter().all(|bounds| bounds[axis][0] <= at && at <= bounds[axis][1]));
                    }
                }
            }
            return 0;
        }
        let node = &tree.nodes[reference as usize];
        let below = |child: usize, seen: &mut Vec<u32>| {
            let ([xl, xh, yl, yh], z) = (node.xy[child], &node.z[2 * child..]);
            let boxes: Vec<_> = inside.iter().copied().chain([[[xl, xh], [yl, yh], [z[0], z[1]]]]).collect();
            assert!(node.children[child] & LEAF != 0 || node.children[child] > reference);
            check(tree, node.children[child], &boxes, seen)
        };
        1 + below(0, seen).max(below(1, seen))
    }

    fn check_all(geometry: &Geometry) -> usize {
        let tree = BinaryTree::build(geometry, &[false, true], Quality::Balanced);
        let mut seen = Vec::new();
        let depth = check(&tree, tree.root.expect("triangles"), &[], &mut seen);
        seen.sort_unstable_by_key(|id| id & !TRANSPARENT);
        let count = geometry.triangles.len() as u32;
        let expected: Vec<u32> = (0..count).map(|id| if id < count / 2 { id } else { id | TRANSPARENT }).collect();
        assert_eq!(seen, expected);
        assert!(depth <= STACK);
        depth
    }

    #[test]
    fn every_triangle_is_in_the_tree_once_and_inside_all_boxes_on_its_way() {
        for (count, center, size) in
            [(1, 0.0, 1.0), (3, 5.0, 0.0), (5, 0.0, 0.1), (5000, 0.0, 0.02), (3000, 1.0e4, 0.001), (900, 0.0, 3.0e38)]
        {
            check_all(&soup(count, center, size));
        }
    }

    #[test]
    fn a_tree_of_nothing_has_no_root() {
        let tree = BinaryTree::build(&Geometry::default(), &[], Quality::Balanced);
        assert!(tree.nodes.is_empty() && tree.triangles.is_empty() && tree.root.is_none() && tree.bytes() == 0);
    }

    #[test]
    fn what_clusters_into_a_chain_is_rebuilt_before_the_stack_overflows() {
        // Each triangle encloses the ones before it, so clustering adds them one at a time: one level a triangle.
        let mut geometry = soup(400, 0.0, 0.0);
        for (index, positions) in geometry.positions.chunks_mut(3).enumerate() {
            let size = 1.2_f32.powi(index as i32 - 200);
            positions.copy_from_slice(&[Vec3::ZERO, Vec3::X * size, Vec3::new(0.3, 1.0, 0.1) * size]);
        }
        assert!(check_all(&geometry) > FREE_DEPTH, "the case is not deep");
    }
}
