//! Bounding boxes of a scene's parts.

use crate::scene::{Group, Mesh, Scene};
use glam::{DVec3, Vec3};

/// A bounding box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub low: DVec3,
    pub high: DVec3,
}

impl Extent {
    /// The box around this box and another.
    pub fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn center(self) -> DVec3 {
        (self.low + self.high) * 0.5
    }

    pub fn diagonal(self) -> f64 {
        self.low.distance(self.high)
    }

    pub fn corners(self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 0 { self.low[axis] } else { self.high[axis] };
            DVec3::new(side(0), side(1), side(2))
        })
    }
}

/// The triangles of one object that have one material, and their box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    pub object: usize,
    pub group: usize,
    pub material: u32,
    pub extent: Extent,
}

/// The box around parts; `None` without any.
pub(super) fn around<'p>(parts: impl IntoIterator<Item = &'p Part>) -> Option<Extent> {
    parts.into_iter().map(|part| part.extent).reduce(Extent::with)
}

/// Every n-th of the triangles of several lists, counted from the first list on. Triangles between them cost no time.
pub(super) struct Every {
    step: usize,
    /// Number of triangles since the last one that was taken.
    passed: usize,
}

impl Every {
    /// Takes every `step`-th triangle, the first after `step - 1` others; `step` is at least 1.
    pub fn nth(step: usize) -> Self {
        Self { step, passed: 0 }
    }

    /// The triangles to take of the next list.
    pub fn of<'t>(&mut self, triangles: &'t [[u32; 3]]) -> impl Iterator<Item = &'t [u32; 3]> + use<'t> {
        let first = self.step - 1 - self.passed;
        self.passed = (self.passed + triangles.len()) % self.step;
        triangles.iter().skip(first).step_by(self.step)
    }
}

/// The parts of a scene that have a triangle with finite corners. Their boxes are exact, except in scenes that place large meshes
/// very often: there some boxes may be too large.
pub(super) fn parts(scene: &Scene) -> Vec<Part> {
    /// Greatest number of vertices and corners that are placed one by one for meshes that were placed before.
    const MOST: usize = 1 << 26;
    parts_within(scene, MOST)
}

/// [`parts`], where `left` vertices and corners may be placed one by one for meshes that were placed before. Once they are used up, the box
/// of such a mesh is placed instead of its vertices.
fn parts_within(scene: &Scene, mut left: usize) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut is_placed = vec![false; scene.meshes.len()];
    // By mesh, where it is needed: the box of each group in model space.
    let mut models: Vec<Option<Vec<Option<Extent>>>> = vec![None; scene.meshes.len()];
    for (index, object) in scene.objects.iter().enumerate() {
        let number = object.mesh as usize;
        let mesh = &scene.meshes[number];
        let place = |position: Vec3| {
            let placed = object.transform.transform_point3(position);
            placed.is_finite().then(|| placed.as_dvec3() + scene.origin)
        };
        let again = std::mem::replace(&mut is_placed[number], true);
        let cost = mesh.positions.len() + mesh.groups.iter().map(|group| 3 * group.triangles.len()).sum::<usize>();
        let boxes: Vec<Option<Extent>> = if again && cost > left {
            let in_model = |position: Vec3| position.is_finite().then(|| position.as_dvec3());
            let model = models[number].get_or_insert_with(|| boxes(mesh, in_model));
            let placed = |extent: Extent| around_points(extent.corners().map(|corner| place(corner.as_vec3())));
            model.iter().map(|extent| extent.and_then(placed)).collect()
        } else {
            if again {
                left -= cost;
            }
            boxes(mesh, place)
        };
        for (group, (extent, list)) in boxes.into_iter().zip(&mesh.groups).enumerate() {
            parts.extend(extent.map(|extent| Part { object: index, group, material: list.material, extent }));
        }
    }
    parts
}

/// For each group of a mesh, the box around the corners of its triangles. `place` says where a position is; positions without a place
/// are left out.
fn boxes(mesh: &Mesh, place: impl Fn(Vec3) -> Option<DVec3>) -> Vec<Option<Extent>> {
    // For each vertex: 1 plus the index of the last group that used it, 0 before the first.
    let mut used = vec![0; mesh.positions.len()];
    let of_group = |(group, list): (usize, &Group)| {
        around_points(list.triangles.iter().flatten().map(|corner| {
            let used = used.get_mut(*corner as usize).filter(|used| **used <= group)?;
            *used = group + 1;
            place(mesh.positions[*corner as usize])
        }))
    };
    mesh.groups.iter().enumerate().map(of_group).collect()
}

/// The box around the points that are there; `None` without any.
fn around_points(points: impl IntoIterator<Item = Option<DVec3>>) -> Option<Extent> {
    points.into_iter().flatten().map(|at| Extent { low: at, high: at }).reduce(Extent::with)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Object;
    use glam::{Mat4, Quat};

    #[test]
    fn every_nth_triangle_is_counted_over_all_lists() {
        let lists = [3, 0, 7, 1, 12, 2, 40].map(|count| (0..count).map(|i| [i; 3]).collect::<Vec<[u32; 3]>>());
        for step in [1, 2, 3, 5, 11, 64, 100] {
            let (mut every, mut number) = (Every::nth(step), 0_usize);
            for list in &lists {
                let mut counted = Vec::new();
                for triangle in list {
                    number += 1;
                    if number.is_multiple_of(step) {
                        counted.push(triangle);
                    }
                }
                assert_eq!(every.of(list).collect::<Vec<_>>(), counted, "{step}");
            }
        }
    }

    /// Two groups of a mesh, placed by each of these transforms.
    fn placed(transforms: &[Mat4]) -> Scene {
        let positions = [[0.1, 0.2, 0.3], [1.7, -0.4, 0.9], [-2.3, 5.1, 0.7], [0.6, 0.5, -3.3], [f32::NAN, 0.0, 0.0]];
        let groups = vec![
            Group { material: 3, triangles: vec![[0, 1, 2]] },
            Group { material: 4, triangles: vec![[1, 2, 3], [0, 1, 4], [0, 1, 9]] },
        ];
        let mesh = Mesh { positions: positions.map(Vec3::from_array).to_vec(), groups, ..Mesh::default() };
        let object = |transform: &Mat4| Object { name: String::new(), mesh: 0, transform: *transform };
        let origin = DVec3::new(1e6, 0.0, -1e6);
        Scene { meshes: vec![mesh], objects: transforms.iter().map(object).collect(), origin, ..Scene::default() }
    }

    #[test]
    fn a_mesh_placed_often_has_the_boxes_of_its_vertices_or_some_around_them() {
        let scaled = Mat4::from_scale(Vec3::new(2.5, -0.3, 7.0));
        let moved = [Mat4::IDENTITY, scaled, Mat4::from_translation(Vec3::new(0.7, 3.1, -8.2)) * scaled];
        let scene = placed(&moved);
        let exact = parts_within(&scene, usize::MAX);
        assert_eq!(exact.len(), 6);
        // Without a rotation the box of a box is that of its vertices.
        assert_eq!(parts_within(&scene, 0), exact);
        let turned = moved.map(|transform| transform * Mat4::from_quat(Quat::from_rotation_y(0.7)));
        let scene = placed(&turned);
        let (exact, around) = (parts_within(&scene, usize::MAX), parts_within(&scene, 0));
        assert_eq!(around[..2], exact[..2], "the first placement is exact");
        for (exact, around) in exact.iter().zip(&around).skip(2) {
            let (inner, outer) = (exact.extent, around.extent);
            assert!(outer.low.cmple(inner.low + 1e-5).all() && outer.high.cmpge(inner.high - 1e-5).all());
            assert!(outer.diagonal() > inner.diagonal() && outer.diagonal() < 2.0 * inner.diagonal());
            assert_eq!((exact.object, exact.group, exact.material), (around.object, around.group, around.material));
        }
        // The first of the repeated placements is still exact if there is room for its 5 vertices and 12 corners.
        assert_eq!(parts_within(&scene, 17)[..4], exact[..4]);
        assert_ne!(parts_within(&scene, 17)[4..], exact[4..]);
    }
}
