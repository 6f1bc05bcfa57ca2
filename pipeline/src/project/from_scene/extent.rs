//! Bounding boxes of a scene's parts.

use crate::scene::Scene;
use glam::DVec3;

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
#[derive(Debug, Clone, Copy)]
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

/// The parts of a scene that have a triangle with finite corners.
pub(super) fn parts(scene: &Scene) -> Vec<Part> {
    let mut parts = Vec::new();
    for (index, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        // For each vertex: 1 plus the index of the last group that used it, 0 before the first.
        let mut used = vec![0; mesh.positions.len()];
        for (group, list) in mesh.groups.iter().enumerate() {
            let mut extent: Option<Extent> = None;
            for corner in list.triangles.iter().flatten() {
                let Some(used) = used.get_mut(*corner as usize).filter(|used| **used <= group) else { continue };
                *used = group + 1;
                let placed = object.transform.transform_point3(mesh.positions[*corner as usize]);
                if placed.is_finite() {
                    let at = placed.as_dvec3() + scene.origin;
                    let at = Extent { low: at, high: at };
                    extent = Some(extent.map_or(at, |extent| extent.with(at)));
                }
            }
            parts.extend(extent.map(|extent| Part { object: index, group, material: list.material, extent }));
        }
    }
    parts
}
