//! Exact spheres as programs read them: behind the nodes and the triangles of the tree over the triangles.
//!
//! The spheres' tree has the nodes of the processor's tree, in the layout of `trace/build/gpu_binary.rs`. Up to four spheres are one leaf.

use crate::trace::gpu_binary::{BinaryNode, BinaryTree, COUNT_SHIFT, LEAF, TRANSPARENT};
use crate::trace::{SphereContent, SphereTree};
use bytemuck::Zeroable;
use curitiba_pipeline::scene::{Geometry, Sphere};
use glam::Vec3;

/// What programs need of the spheres besides the nodes, which lie behind those of the triangles.
#[derive(Debug)]
pub struct DeviceSpheres {
    /// The root of the spheres' tree; `None` if there are no spheres, or if no ray can hit them.
    pub root: Option<u32>,
    /// Two vectors a sphere (`programs/spheres.wgsl`).
    pub list: Vec<[[u32; 4]; 2]>,
}

impl DeviceSpheres {
    /// The spheres of a scene, with the arguments of [`SphereTree::build`]. Their nodes are appended to a tree over the scene's triangles, whose
    /// bounds grow to include the spheres. A tree without triangles gets a node without children as its root, because programs for scenes with
    /// spheres do not check whether there are triangles. If `traced` is false, no ray can hit the spheres.
    pub fn new(geometry: &Geometry, transparent: &[bool], triangles: &mut BinaryTree, traced: bool) -> Self {
        let tree = SphereTree::build(geometry, transparent);
        let list = list(&tree, geometry.triangles.len() as u32);
        let Some(([low, high], _)) = tree.nodes().next().filter(|_| traced) else { return Self { root: None, list } };
        let [all_low, all_high] = triangles.bounds.map(Vec3::from);
        let bounds = if triangles.whole.is_some() { [all_low.min(low), all_high.max(high)] } else { [low, high] };
        triangles.bounds = bounds.map(|corner| corner.to_array());
        if triangles.root.is_none() {
            let place = triangles.nodes.len() as u32;
            let mut nothing = BinaryNode::zeroed();
            nothing.children = [super::layout::NONE; 2];
            triangles.nodes.push(nothing);
            triangles.root = Some(place);
            triangles.whole = triangles.whole.or(triangles.root);
        }
        let root = append(&tree, &mut triangles.nodes);
        Self { root: Some(root), list }
    }
}

/// Appends the inner nodes of a tree that is not empty, and returns its root.
fn append(tree: &SphereTree, nodes: &mut Vec<BinaryNode>) -> u32 {
    let all: Vec<([Vec3; 2], SphereContent)> = tree.nodes().collect();
    // The reference to each node; inner nodes are numbered in their order.
    let mut place = nodes.len() as u32;
    let references: Vec<u32> = all
        .iter()
        .map(|(_, content)| match content {
            SphereContent::Spheres(first, count) => LEAF | (count - 1) << COUNT_SHIFT | first,
            SphereContent::Nodes(_) => {
                place += 1;
                place - 1
            }
        })
        .collect();
    for (_, content) in &all {
        let SphereContent::Nodes(first) = *content else { continue };
        let children = [first as usize, first as usize + 1];
        let [[a_low, a_high], [b_low, b_high]] = children.map(|child| all[child].0);
        let mut node = BinaryNode::zeroed();
        node.xy = [[a_low.x, a_high.x, a_low.y, a_high.y], [b_low.x, b_high.x, b_low.y, b_high.y]];
        node.z = [a_low.z, a_high.z, b_low.z, b_high.z];
        node.children = children.map(|child| references[child]);
        nodes.push(node);
    }
    references[0]
}

/// The spheres in the order of the tree. Entry `id - first` also holds the place of the sphere `id` in this list; `first` is the least id.
fn list(tree: &SphereTree, first: u32) -> Vec<[[u32; 4]; 2]> {
    let entry = |(sphere, id, transparent): (Sphere, u32, bool)| {
        let [x, y, z] = sphere.center.to_array().map(f32::to_bits);
        [[x, y, z, sphere.radius.to_bits()], [if transparent { id | TRANSPARENT } else { id }, 0, 0, 0]]
    };
    let mut list: Vec<[[u32; 4]; 2]> = tree.in_order().map(entry).collect();
    for (place, (_, id, _)) in (0..).zip(tree.in_order()) {
        list[(id - first) as usize][1][1] = place;
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wgpu_rays::layout::NONE;

    /// Spheres on a spiral, behind one triangle.
    fn scene(count: u32) -> Geometry {
        let mut geometry = Geometry { triangles: vec![[0, 1, 2]], ..Geometry::default() };
        geometry.spheres = (0..count)
            .map(|index| {
                let turn = index as f32;
                let center = Vec3::new(turn.cos() * turn, turn.sin() * turn, -0.1 * turn);
                Sphere { center, radius: 0.1 + 0.01 * (index % 7) as f32, material: index % 2 }
            })
            .collect();
        geometry
    }

    /// The places of all spheres below a reference; checks that their boxes lie in `outer`.
    fn below(
        reference: u32,
        nodes: &[BinaryNode],
        found: &mut Vec<(u32, [Vec3; 2])>,
        outer: [Vec3; 2],
        first_node: u32,
    ) {
        if reference & LEAF != 0 {
            let (first, more) = (reference & ((1 << COUNT_SHIFT) - 1), reference >> COUNT_SHIFT & 3);
            found.extend((first..=first + more).map(|place| (place, outer)));
            return;
        }
        assert!(reference >= first_node, "no node of the triangles");
        let node = &nodes[reference as usize];
        for (child, (xy, z)) in
            node.children.into_iter().zip(node.xy.into_iter().zip([[node.z[0], node.z[1]], [node.z[2], node.z[3]]]))
        {
            let (low, high) = (Vec3::new(xy[0], xy[2], z[0]), Vec3::new(xy[1], xy[3], z[1]));
            assert!(low.cmpge(outer[0]).all() && high.cmple(outer[1]).all(), "a box lies in that around it");
            below(child, nodes, found, [low, high], first_node);
        }
    }

    #[test]
    fn each_sphere_lies_once_in_the_tree_in_all_of_its_boxes() {
        for count in [1, 4, 5, 1000] {
            let geometry = scene(count);
            let nodes = vec![BinaryNode::zeroed(); 3];
            let bounds = [[-1.0; 3], [1e4; 3]];
            let mut triangles = BinaryTree { nodes, root: Some(0), whole: Some(2), bounds, ..BinaryTree::default() };
            let spheres = DeviceSpheres::new(&geometry, &[false, true], &mut triangles, true);
            assert_eq!((triangles.root, triangles.whole), (Some(0), Some(2)));
            let outer = triangles.bounds.map(Vec3::from);
            assert_eq!(outer[1], Vec3::splat(1e4), "of triangles and spheres");
            let mut found = Vec::new();
            below(spheres.root.expect("traced"), &triangles.nodes, &mut found, outer, 3);
            let mut ids: Vec<u32> = found
                .iter()
                .map(|(place, [low, high])| {
                    let [sphere, [id, ..]] = spheres.list[*place as usize];
                    let index = (id & !TRANSPARENT) - 1;
                    let Sphere { center, radius, material } = geometry.spheres[index as usize];
                    assert_eq!(sphere.map(f32::from_bits), center.extend(radius).to_array());
                    assert_eq!(id & TRANSPARENT != 0, material == 1);
                    assert_eq!(spheres.list[index as usize][1][1], *place, "it is found by its id");
                    assert!((center - radius).cmpge(*low).all() && (center + radius).cmple(*high).all());
                    index
                })
                .collect();
            ids.sort_unstable();
            assert_eq!(ids, (0..count).collect::<Vec<_>>());
            assert_eq!(count <= 4, triangles.nodes.len() == 3, "few are a list");
        }
    }

    #[test]
    fn without_triangles_their_tree_has_a_root_without_children() {
        let mut triangles = BinaryTree::default();
        let spheres = DeviceSpheres::new(&scene(9), &[], &mut triangles, true);
        let root = triangles.root.expect("there is one") as usize;
        assert_eq!((triangles.nodes[root].children, triangles.whole), ([NONE; 2], triangles.root));
        assert!(triangles.bounds[0][0] < -2.9 && spheres.root.is_some());
        let mut untraced = BinaryTree::default();
        let spheres = DeviceSpheres::new(&scene(9), &[], &mut untraced, false);
        assert!(spheres.root.is_none() && untraced.root.is_none() && spheres.list.len() == 9);
    }
}
