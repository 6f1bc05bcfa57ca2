//! Exact spheres in device memory.

use crate::device::{Address, Buffer, Device};
use crate::layout::{Sphere, SphereNode, Spheres};
use curitiba_passes::trace::{SphereContent, SphereTree, gpu_tree};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::{Geometry, RenderScene};
use glam::Vec3;

/// The spheres of a scene, ready to be copied to a device.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Packed {
    /// The nodes of the processor's tree, the root first.
    pub nodes: Vec<SphereNode>,
    /// The spheres in the order of the tree.
    pub list: Vec<Sphere>,
    /// Id of the first sphere: the number of triangles.
    pub first: u32,
    /// Low and high corner of the bounds of all spheres.
    pub bounds: [[f32; 3]; 2],
}

impl Packed {
    /// Packs the spheres of a scene; `transparent` is as in [`SphereTree::build`].
    #[must_use]
    pub fn of(geometry: &Geometry, transparent: &[bool]) -> Self {
        let (tree, first) = (SphereTree::build(geometry, transparent), geometry.triangles.len() as u32);
        let node = |([low, high], content): ([Vec3; 2], SphereContent)| {
            let (first, count) = match content {
                SphereContent::Nodes(first) => (first, 0),
                SphereContent::Spheres(first, count) => (first, count),
            };
            SphereNode { low: low.to_array(), first, high: high.to_array(), count }
        };
        let nodes: Vec<SphereNode> = tree.nodes().map(node).collect();
        let bounds = nodes.first().map_or([[0.0; 3]; 2], |root| [root.low, root.high]);
        let mut list: Vec<Sphere> = tree
            .in_order()
            .map(|(sphere, id, transparent)| Sphere {
                center: sphere.center.to_array(),
                radius: sphere.radius,
                id: if transparent { id | gpu_tree::TRANSPARENT } else { id },
                ..Sphere::default()
            })
            .collect();
        for (place, (_, id, _)) in (0..).zip(tree.in_order()) {
            list[(id - first) as usize].place = place;
        }
        Self { nodes, list, first, bounds }
    }

    /// The struct at [`crate::layout::Params::spheres`], with the nodes and the spheres at these addresses. If `traced` is false, rays hit no
    /// sphere.
    #[must_use]
    pub fn described(&self, nodes: Address, list: Address, traced: bool) -> Spheres {
        let node_count = if traced { self.nodes.len() as u32 } else { 0 };
        let [low, high] = self.bounds;
        Spheres { nodes, list, node_count, first: self.first, low, high }
    }
}

/// The spheres of a scene on the device. A scene without any takes no memory.
#[derive(Debug, Default)]
pub(crate) struct SphereBuffers {
    nodes: Buffer<SphereNode>,
    list: Buffer<Sphere>,
    described: Buffer<Spheres>,
    node_count: u64,
}

impl SphereBuffers {
    /// Copies the spheres of a scene to the device. `transparent` says by material whether the device program decides if a hit counts; `None` if
    /// rays hit no sphere.
    pub fn new(device: &Device, scene: &RenderScene, transparent: Option<&[bool]>) -> Result<Self, BackendError> {
        if scene.geometry.spheres.is_empty() {
            return Ok(Self::default());
        }
        let packed = Packed::of(&scene.geometry, transparent.unwrap_or(&[]));
        let nodes = device.upload("the nodes of the tree of exact spheres", &packed.nodes)?;
        let list = device.upload("exact spheres", &packed.list)?;
        let described = packed.described(nodes.address(device), list.address(device), transparent.is_some());
        let node_count = u64::from(described.node_count);
        Ok(Self { described: device.upload("where exact spheres are", &[described])?, nodes, list, node_count })
    }

    /// The address of the struct [`Spheres`]; 0 in a scene without spheres.
    pub fn address(&self, device: &Device) -> Address {
        self.described.address(device)
    }

    /// Size in bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.nodes.bytes() + self.list.bytes() + self.described.bytes()
    }

    /// Number of nodes of the tree; 0 if there are no spheres or rays hit none.
    pub fn node_count(&self) -> u64 {
        self.node_count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene;

    #[test]
    fn each_sphere_lies_once_in_the_tree_within_its_boxes_and_is_found_by_its_id() {
        for count in [1, 4, 5, 1000_u32] {
            let place = |index: u32| Vec3::new((index as f32).cos(), (index as f32).sin(), -0.1 * index as f32);
            let sphere = |index| scene::Sphere { center: place(index), radius: 0.01, material: index % 2 };
            let spheres = (0..count).map(sphere).collect();
            let geometry = Geometry { triangles: vec![[0, 1, 2]; 7], spheres, ..Geometry::default() };
            let packed = Packed::of(&geometry, &[false, true]);
            assert_eq!((packed.first, packed.list.len()), (7, count as usize));
            for (index, sphere) in geometry.spheres.iter().enumerate() {
                let found = packed.list[packed.list[index].place as usize];
                assert_eq!((Vec3::from(found.center), found.radius), (sphere.center, sphere.radius));
                let flag = if sphere.material == 1 { gpu_tree::TRANSPARENT } else { 0 };
                assert_eq!(found.id, (7 + index as u32) | flag);
            }
            let mut waiting = vec![(0, packed.bounds)];
            let mut seen = vec![0; count as usize];
            while let Some((place, [low, high])) = waiting.pop() {
                let node: SphereNode = packed.nodes[place as usize];
                let within = |at: [f32; 3]| (0..3).all(|axis| low[axis] <= at[axis] && at[axis] <= high[axis]);
                assert!(within(node.low) && within(node.high), "a box lies in that around it");
                if node.count == 0 {
                    waiting.extend([node.first, node.first + 1].map(|child| (child, [node.low, node.high])));
                }
                for place in node.first..node.first + node.count {
                    let Sphere { center, radius, .. } = packed.list[place as usize];
                    assert!((0..3).all(|axis| node.low[axis] <= center[axis] - radius));
                    assert!((0..3).all(|axis| node.high[axis] >= center[axis] + radius));
                    seen[place as usize] += 1;
                }
            }
            assert!(seen.iter().all(|times| *times == 1));
            assert_eq!(packed.described(1, 2, false).node_count, 0, "not traced");
            assert_eq!(packed.described(1, 2, true).node_count as usize, packed.nodes.len());
        }
        assert_eq!(Packed::of(&Geometry::default(), &[]), Packed::default());
    }
}
