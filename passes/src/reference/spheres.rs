//! Exact spheres in `f64`, and a tree over them.

use crate::trace::{DoubleHit, DoubleRay};
use curitiba_pipeline::scene::{Geometry, Sphere};
use glam::DVec3;

/// Memory of a sphere in the tree, bytes.
pub(super) const BYTES_PER_SPHERE: u64 = 200;

/// Greatest number of spheres in a leaf.
const LEAF: usize = 4;
/// By how much a box is larger than its spheres, relative to their coordinates: far more than rounding, so that results do not depend on
/// the tree.
const SLACK: f64 = 1.0e-9;

/// A binary tree, halved by the order of the centres along the longest side.
#[derive(Debug)]
pub(super) struct Spheres {
    nodes: Vec<Node>,
    /// The spheres with their ids.
    spheres: Vec<(u32, Sphere)>,
}

#[derive(Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// For a leaf, the index of its first sphere. For an inner node, the index of its second child; the first child follows the node.
    first: usize,
    /// Number of spheres in a leaf; 0 for an inner node.
    count: usize,
}

impl Spheres {
    /// The tree over all spheres of a scene.
    pub fn build(geometry: &Geometry) -> Self {
        let first = geometry.triangles.len() as u32;
        let mut spheres: Vec<(u32, Sphere)> = (first..).zip(geometry.spheres.iter().copied()).collect();
        let mut nodes = Vec::new();
        if !spheres.is_empty() {
            divide(&mut spheres, 0, &mut nodes);
        }
        Self { nodes, spheres }
    }

    /// The nearest hit that `accept` accepts; of hits at one distance, the one with the lowest id.
    pub fn first(&self, ray: &DoubleRay, mut accept: impl FnMut(&DoubleHit) -> bool) -> Option<DoubleHit> {
        let mut best: Option<DoubleHit> = None;
        self.walk(ray, |hit| {
            let nearer = best.is_none_or(|best| (hit.t, hit.triangle) < (best.t, best.triangle));
            if nearer && accept(&hit) {
                best = Some(hit);
            }
            best.map_or(f64::INFINITY, |best| best.t)
        });
        best
    }

    /// Whether there is a hit for which `stops` returns true.
    pub fn any(&self, ray: &DoubleRay, mut stops: impl FnMut(&DoubleHit) -> bool) -> bool {
        let mut blocked = false;
        self.walk(ray, |hit| {
            blocked = blocked || stops(&hit);
            if blocked { f64::NEG_INFINITY } else { f64::INFINITY }
        });
        blocked
    }

    /// Passes the hits of a ray to `visit`, which returns the distance beyond which no more hits are wanted.
    fn walk(&self, ray: &DoubleRay, mut visit: impl FnMut(DoubleHit) -> f64) {
        if self.nodes.is_empty() || !(ray.origin.is_finite() && ray.direction.is_finite()) {
            return;
        }
        let (mut limit, mut open) = (ray.t_max, vec![0]);
        while let Some(index) = open.pop() {
            let node: &Node = &self.nodes[index];
            if !node.meets(ray, limit) {
                continue;
            }
            if node.count == 0 {
                open.extend([node.first, index + 1]);
                continue;
            }
            for (id, sphere) in &self.spheres[node.first..node.first + node.count] {
                for t in crossed(sphere, ray).into_iter().flatten() {
                    if t > ray.t_min && t < ray.t_max {
                        limit = limit.min(visit(DoubleHit { t, u: 0.0, v: 0.0, triangle: *id }));
                    }
                }
            }
        }
    }
}

impl Node {
    /// Whether the ray meets the box before the distance `limit`.
    fn meets(&self, ray: &DoubleRay, limit: f64) -> bool {
        let (mut enter, mut leave) = (ray.t_min, limit);
        for axis in 0..3 {
            let (low, high) = (self.low[axis] - ray.origin[axis], self.high[axis] - ray.origin[axis]);
            if ray.direction[axis] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let (a, b) = (low / ray.direction[axis], high / ray.direction[axis]);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        enter <= leave
    }
}

/// The distances at which a line of unit direction crosses a sphere, the lower first; `None` twice if it misses. The middle of the chord is
/// the point nearest to the centre, and half the chord follows from Pythagoras.
fn crossed(sphere: &Sphere, ray: &DoubleRay) -> [Option<f64>; 2] {
    let (from, radius) = (ray.origin - sphere.center.as_dvec3(), f64::from(sphere.radius));
    let middle = -from.dot(ray.direction);
    let distance = (from + middle * ray.direction).length();
    let square = (radius - distance) * (radius + distance);
    if square < 0.0 {
        return [None; 2];
    }
    let half = square.sqrt();
    [Some(middle - half), Some(middle + half)]
}

/// Adds the nodes over these spheres; the first sphere has the index `first`.
fn divide(spheres: &mut [(u32, Sphere)], first: usize, nodes: &mut Vec<Node>) {
    let of = |sphere: &Sphere| (sphere.center.as_dvec3(), f64::from(sphere.radius));
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (_, sphere) in spheres.iter() {
        let (center, radius) = of(sphere);
        (low, high) = (low.min(center - radius), high.max(center + radius));
    }
    let (slack, size) = (SLACK * low.abs().max(high.abs()).max_element(), high - low);
    let (index, count) = (nodes.len(), spheres.len());
    nodes.push(Node { low: low - slack, high: high + slack, first, count });
    if count <= LEAF {
        return;
    }
    let axis = size.max_position();
    spheres.sort_unstable_by(|a, b| a.1.center[axis].total_cmp(&b.1.center[axis]));
    let (near, far) = spheres.split_at_mut(count / 2);
    divide(near, first, nodes);
    let second = nodes.len();
    divide(far, first + near.len(), nodes);
    (nodes[index].first, nodes[index].count) = (second, 0);
}

#[cfg(test)]
mod tests {
    use super::super::points::mix;
    use super::*;
    use glam::Vec3;

    fn random(number: &mut u64) -> f64 {
        *number = mix(*number);
        (*number >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The squared distance from the centre along a ray is a parabola; the quadratic formula gives the places where it is the squared radius.
    fn by_formula(geometry: &Geometry, ray: &DoubleRay) -> Vec<(f64, u32)> {
        let mut found = Vec::new();
        for (sphere, id) in geometry.spheres.iter().zip(0..) {
            let (from, radius) = (ray.origin - sphere.center.as_dvec3(), f64::from(sphere.radius));
            let (b, c) = (2.0 * from.dot(ray.direction), from.dot(from) - radius * radius);
            let root = (b * b - 4.0 * c).sqrt();
            found.extend([-1.0, 1.0].map(|side| (0.5 * (side * root - b), id)));
        }
        found.retain(|(t, _)| *t > ray.t_min && *t < ray.t_max);
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        found
    }

    #[test]
    fn the_tree_finds_what_each_sphere_alone_tells() {
        let (mut state, mut geometry) = (1, Geometry::default());
        for _ in 0..300 {
            let center = DVec3::from([(); 3].map(|()| random(&mut state))).as_vec3() * 10.0;
            let radius = (0.05 + random(&mut state)) as f32;
            geometry.spheres.push(Sphere { center, radius, material: 0 });
        }
        let (tree, mut met, mut refused) = (Spheres::build(&geometry), 0, 0);
        for _ in 0..2000 {
            let [origin, way] = [(); 2].map(|()| DVec3::from([(); 3].map(|()| random(&mut state) * 12.0 - 1.0)));
            let direction = (way - origin).normalize();
            let ray = DoubleRay { origin, direction, t_min: 0.0, t_max: 2.0 + 10.0 * random(&mut state) };
            let expected = by_formula(&geometry, &ray);
            let odd = |id: u32| id % 2 == 1;
            let nearest = |found: Option<DoubleHit>, expected: Option<&(f64, u32)>| match (found, expected) {
                (None, None) => true,
                (Some(hit), Some((t, id))) => (hit.t - t).abs() < 1e-9 && hit.triangle == *id,
                _ => false,
            };
            assert!(nearest(tree.first(&ray, |_| true), expected.first()), "{ray:?}");
            let of_odd = expected.iter().find(|(_, id)| odd(*id));
            assert!(nearest(tree.first(&ray, |hit| odd(hit.triangle)), of_odd), "{ray:?}");
            assert_eq!(tree.any(&ray, |hit| odd(hit.triangle)), of_odd.is_some());
            let mut all = 0;
            let counts = |_: &DoubleHit| {
                all += 1;
                false
            };
            assert!(!tree.any(&ray, counts));
            assert_eq!(all, expected.len(), "every hit is told once");
            met += usize::from(!expected.is_empty());
            refused += usize::from(of_odd.is_some() && !odd(expected[0].1));
        }
        assert!(met > 1000 && refused > 100, "control: {met} rays met any, {refused} one behind another");
    }

    #[test]
    fn a_ray_that_leaves_a_sphere_does_not_meet_its_start_again() {
        let sphere = Sphere { center: Vec3::new(3e3, -2e3, 1e3), radius: 0.02, material: 0 };
        let geometry = Geometry { spheres: vec![sphere], ..Geometry::default() };
        let (tree, mut state) = (Spheres::build(&geometry), 3);
        for _ in 0..1000 {
            let out = DVec3::from([(); 3].map(|()| random(&mut state) - 0.5)).normalize();
            let across = out.any_orthonormal_vector();
            let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
            let lean = 2.0 * random(&mut state) - 1.0;
            let direction = (out * lean + across).normalize();
            // At the distance from the surface at which the reference starts its rays.
            let origin = center + out * radius + out * (3e-8_f64.copysign(lean));
            let ray = DoubleRay { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
            let found = tree.first(&ray, |_| true);
            let cosine = -direction.dot(out);
            let chord = 2.0 * radius * cosine;
            match lean > 0.0 {
                true => assert_eq!(found, None),
                false if cosine < 0.02 => {}
                false => assert!(found.is_some_and(|hit| (hit.t - chord).abs() < 1e-7 / cosine), "{found:?} {chord}"),
            }
        }
    }
}
