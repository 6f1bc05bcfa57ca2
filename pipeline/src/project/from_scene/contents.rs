//! What of a scene is looked at: the box of all of it, or of most of it, and the shell around it if there is one.

use super::clean;
use crate::scene::Scene;
use glam::DVec3;
use std::f64::consts::PI;

/// A bounding box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub low: DVec3,
    pub high: DVec3,
}

impl Extent {
    /// The box around both.
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

/// Boxes of what a scene holds.
#[derive(Debug)]
pub(super) struct Contents {
    /// The box of all triangles.
    pub whole: Extent,
    /// The box of what is looked at.
    pub focus: Extent,
    /// What is around all else.
    pub shell: Option<Shell>,
}

/// The triangles of one object that have one material, and their box.
#[derive(Debug, Clone, Copy)]
struct Part {
    object: usize,
    group: usize,
    extent: Extent,
}

impl Contents {
    /// `None` for a scene without a triangle.
    pub fn of(scene: &Scene) -> Option<Self> {
        let parts = parts(scene);
        let around = |parts: &mut dyn Iterator<Item = &Part>| parts.map(|part| part.extent).reduce(Extent::with);
        let whole = around(&mut parts.iter())?;
        // Only the part with the largest box can be around all others.
        let outer =
            (0..parts.len()).max_by(|a, b| parts[*a].extent.diagonal().total_cmp(&parts[*b].extent.diagonal()))?;
        let inner = around(&mut parts.iter().enumerate().filter(|(index, _)| *index != outer).map(|(_, part)| part));
        let found = inner.and_then(|inner| Some((inner, Shell::around(scene, &parts[outer], inner)?)));
        let (looked_at, shell) = found.map_or((whole, None), |(inner, shell)| (inner, Some(shell)));
        let left_out = shell.is_some().then(|| (parts[outer].object, parts[outer].group));
        Some(Self { whole, focus: focus(scene, looked_at, left_out), shell })
    }
}

/// The parts of a scene that have a triangle with finite corners.
fn parts(scene: &Scene) -> Vec<Part> {
    let mut parts = Vec::new();
    for (index, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        // By vertex: the number of groups up to the last that used it.
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
            parts.extend(extent.map(|extent| Part { object: index, group, extent }));
        }
    }
    parts
}

/// The bounding box of most triangles, if a few far ones (a sky, a plane to the horizon) make the whole box more than three
/// times as large; otherwise the whole box. The walls of a room around finely tessellated things make it at most that. The
/// triangles of the (object, group) `left_out` are not examined.
fn focus(scene: &Scene, whole: Extent, left_out: Option<(usize, usize)>) -> Extent {
    /// Most triangles that are examined.
    const MOST: usize = 1 << 16;
    /// Share of their corners that may lie beyond the box on each side.
    const BEYOND: f64 = 0.03;
    let groups = || {
        scene.objects.iter().enumerate().flat_map(|(index, object)| {
            let mesh = &scene.meshes[object.mesh as usize];
            let groups = mesh.groups.iter().enumerate().filter(move |(group, _)| Some((index, *group)) != left_out);
            groups.map(move |(_, group)| (object, mesh, group))
        })
    };
    let step = groups().map(|(_, _, group)| group.triangles.len()).sum::<usize>().div_ceil(MOST).max(1);
    let mut corners: [Vec<f32>; 3] = Default::default();
    let mut number = 0;
    for (object, mesh, group) in groups() {
        for triangle in &group.triangles {
            number += 1;
            if number % step != 0 {
                continue;
            }
            let placed = triangle.iter().filter_map(|corner| mesh.positions.get(*corner as usize));
            let placed = placed.map(|position| object.transform.transform_point3(*position));
            for corner in placed.filter(|corner| corner.is_finite()) {
                corners.iter_mut().zip(corner.to_array()).for_each(|(list, value)| list.push(value));
            }
        }
    }
    let mut bounds = [DVec3::ZERO; 2];
    for (axis, mut list) in corners.into_iter().enumerate() {
        if list.is_empty() {
            return whole;
        }
        list.sort_unstable_by(f32::total_cmp);
        let beyond = (list.len() as f64 * BEYOND) as usize;
        bounds[0][axis] = scene.origin[axis] + f64::from(list[beyond]);
        bounds[1][axis] = scene.origin[axis] + f64::from(list[list.len() - 1 - beyond]);
    }
    let [low, high] = bounds;
    let most = Extent { low, high };
    if most.diagonal() > 0.0 && whole.diagonal() > 3.0 * most.diagonal() { most } else { whole }
}

/// A shell around all else of a scene that shows its faces to the inside, such as a sky dome or the walls of a closed room. It may
/// be open below. A ball or a house whose faces look outwards is none.
#[derive(Debug)]
pub(super) struct Shell {
    /// Name of its object, or of its material where the object has several.
    pub name: String,
    /// Whether a camera outside of it sees nothing else: its material is not single-sided.
    pub hides: bool,
    /// Corners, anticlockwise as seen from the front.
    triangles: Vec<[DVec3; 3]>,
}

impl Shell {
    /// The shell that a part is around what has the box `inner`.
    fn around(scene: &Scene, part: &Part, inner: Extent) -> Option<Self> {
        /// Most triangles that are examined.
        const MOST: usize = 1 << 20;
        /// By how much of the part's size a corner of the inner box may lie beyond its box: those of a square terrain do under a
        /// round dome.
        const BEYOND: f64 = 0.05;
        /// Number of directions upwards in which it is looked for, and in how many it may be open.
        const DIRECTIONS: u32 = 64;
        const OPEN: u32 = 3;
        let slack = (part.extent.high - part.extent.low) * BEYOND;
        let [low, high] = [part.extent.low - slack, part.extent.high + slack];
        let beside = inner.low.x >= low.x && inner.low.z >= low.z && inner.high.cmple(high).all();
        let object = &scene.objects[part.object];
        let mesh = &scene.meshes[object.mesh as usize];
        let group = &mesh.groups[part.group];
        if !beside || inner.diagonal() <= 0.0 || group.triangles.len() > MOST {
            return None;
        }
        let placed = |corner: u32| {
            let position = mesh.positions.get(corner as usize)?;
            let placed = object.transform.transform_point3(*position);
            placed.is_finite().then(|| placed.as_dvec3() + scene.origin)
        };
        let mirrored = object.transform.determinant() < 0.0;
        let corners = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(placed);
            let (a, b, c) = (a?, b?, c?);
            Some(if mirrored { [a, c, b] } else { [a, b, c] })
        };
        let triangles = group.triangles.iter().filter_map(corners).collect();
        let material = scene.materials.get(group.material as usize);
        let of_material = || material.and_then(|material| clean(&material.name));
        let own = clean(&object.name).filter(|_| mesh.groups.len() == 1);
        let hides = material.is_none_or(|material| !material.single_sided);
        let shell = Self { name: own.or_else(of_material).unwrap_or_default(), hides, triangles };
        let mut open = 0;
        for number in 0..DIRECTIONS {
            open += u32::from(!shell.closes(inner.center(), upwards(number, DIRECTIONS)));
            if open > OPEN {
                return None;
            }
        }
        Some(shell)
    }

    /// Whether it is met in a direction, and the outermost of its faces there looks back.
    fn closes(&self, from: DVec3, direction: DVec3) -> bool {
        let hits = self.triangles.iter().filter_map(|corners| hit(corners, from, direction));
        hits.max_by(|a, b| a.0.total_cmp(&b.0)).is_some_and(|(_, is_front)| is_front)
    }

    /// Distance to it along a unit direction.
    pub fn distance(&self, from: DVec3, direction: DVec3) -> Option<f64> {
        let hits = self.triangles.iter().filter_map(|corners| hit(corners, from, direction));
        hits.map(|(distance, _)| distance).min_by(f64::total_cmp)
    }
}

/// Directions spread evenly over the sky above an elevation of ten degrees.
fn upwards(number: u32, count: u32) -> DVec3 {
    /// Sine of ten degrees.
    const LOWEST: f64 = 0.17;
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let height = LOWEST + (1.0 - LOWEST) * (f64::from(number) + 0.5) / f64::from(count);
    let (sin, cos) = (golden * f64::from(number)).sin_cos();
    let level = (1.0 - height * height).sqrt();
    DVec3::new(level * cos, height, level * sin)
}

/// Distance at which a ray meets a triangle, and whether it meets the front (Möller and Trumbore).
fn hit([a, b, c]: &[DVec3; 3], from: DVec3, direction: DVec3) -> Option<(f64, bool)> {
    let (to_b, to_c) = (b - a, c - a);
    let across = direction.cross(to_c);
    let determinant = to_b.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let offset = from - a;
    let u = offset.dot(across) / determinant;
    let around = offset.cross(to_b);
    let v = direction.dot(around) / determinant;
    let distance = to_c.dot(around) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some((distance, determinant > 0.0))
}
