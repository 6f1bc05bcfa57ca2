//! A binary tree of boxes over spheres.

use super::sphere::roots;
use crate::trace::ray::{Hit, Ray};
use crate::trace::tree::Bounds;
use curitiba_pipeline::scene::{Geometry, Sphere};
use glam::{DVec3, Vec3};

/// Greatest number of spheres in a leaf.
const LEAF: usize = 4;
/// Bound on the number of levels: each level halves the spheres, and there are fewer than 2^32.
pub const DEPTH: usize = 40;
/// Replaces the reciprocal of a component that is 0. Slab distances are then huge instead of infinite, and no product is NaN.
const VERTICAL: f64 = 1e300;

/// The box of a sphere, rounded outwards.
fn around(sphere: &Sphere) -> Bounds {
    let (low, high) = (sphere.center - sphere.radius, sphere.center + sphere.radius);
    Bounds { low: low.map(f32::next_down), high: high.map(f32::next_up) }
}

/// The children or the spheres of a node.
#[derive(Debug, Clone, Copy)]
pub enum Content {
    /// Inner node: index of the first child; the second one follows it.
    Nodes(u32),
    /// Leaf: index of its first sphere in the list, and their number.
    Spheres(u32, u32),
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    content: Content,
}

/// A sphere in a leaf.
#[derive(Debug, Clone, Copy)]
struct Entry {
    sphere: Sphere,
    id: u32,
    /// Whether hits on the sphere need the accept closure.
    transparent: bool,
}

/// Spheres in a tree, so that a ray is tested only against those near it.
///
/// The results do not depend on the tree. A sphere is hit if the ray meets its box, in `f64`, and its surface, in `f32`; and a node's box
/// is met by every ray that meets a box inside it. Of equal distances the lowest id wins.
#[derive(Debug, Default)]
pub struct SphereTree {
    nodes: Vec<Node>,
    entries: Vec<Entry>,
}

/// A ray, prepared for slab tests.
struct Slabs {
    origin: DVec3,
    reciprocal: DVec3,
    t_min: f64,
}

impl Slabs {
    /// `None` for rays that hit nothing.
    fn new(ray: &Ray) -> Option<Self> {
        let sound = ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != Vec3::ZERO;
        let asks = sound && ray.t_min < ray.t_max;
        if !asks {
            return None;
        }
        let reciprocal = ray.direction.as_dvec3().map(|d| if d == 0.0 { VERTICAL } else { 1.0 / d });
        Some(Self { origin: ray.origin.as_dvec3(), reciprocal, t_min: ray.t_min.into() })
    }

    /// Distance at which the ray enters a box; `None` if it does not meet the box between its `t_min` and `t_max`.
    fn enters(&self, bounds: &Bounds, t_max: f32) -> Option<f64> {
        let low = (bounds.low.as_dvec3() - self.origin) * self.reciprocal;
        let high = (bounds.high.as_dvec3() - self.origin) * self.reciprocal;
        let enters = low.min(high).max_element().max(self.t_min);
        (enters <= low.max(high).min_element().min(t_max.into())).then_some(enters)
    }
}

impl SphereTree {
    /// Builds the tree over all spheres of a scene. `transparent[material]` says whether hits on that material need the accept closure;
    /// materials beyond its end are opaque.
    #[must_use]
    pub fn build(geometry: &Geometry, transparent: &[bool]) -> Self {
        let first = geometry.triangles.len() as u32;
        let entry = |(sphere, id): (&Sphere, u32)| Entry {
            sphere: *sphere,
            id,
            transparent: transparent.get(sphere.material as usize) == Some(&true),
        };
        let mut tree = Self { nodes: Vec::new(), entries: geometry.spheres.iter().zip(first..).map(entry).collect() };
        if !tree.entries.is_empty() {
            tree.nodes.push(Node {
                bounds: around(&tree.entries[0].sphere),
                content: Content::Spheres(0, tree.entries.len() as u32),
            });
            tree.divide(0, 0..tree.entries.len());
        }
        tree
    }

    fn divide(&mut self, node: usize, range: std::ops::Range<usize>) {
        let entries = &mut self.entries[range.clone()];
        let boxes = entries.iter().map(|entry| around(&entry.sphere));
        self.nodes[node].bounds = boxes.reduce(Bounds::union).unwrap_or(self.nodes[node].bounds);
        self.nodes[node].content = Content::Spheres(range.start as u32, range.len() as u32);
        if range.len() <= LEAF {
            return;
        }
        let centers = || entries.iter().map(|entry| entry.sphere.center);
        let extent = centers().fold(Vec3::NEG_INFINITY, Vec3::max) - centers().fold(Vec3::INFINITY, Vec3::min);
        let axis = extent.max_position();
        let middle = entries.len() / 2;
        entries.select_nth_unstable_by(middle, |a, b| {
            a.sphere.center[axis].total_cmp(&b.sphere.center[axis]).then(a.id.cmp(&b.id))
        });
        let first = self.nodes.len();
        let (copy, middle) = (self.nodes[node], range.start + middle);
        self.nodes.extend([copy; 2]);
        self.nodes[node].content = Content::Nodes(first as u32);
        self.divide(first, range.start..middle);
        self.divide(first + 1, middle..range.end);
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Memory of nodes and spheres, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.entries.as_slice())
    }

    /// The nodes, the root first: the low and high corner of each box, and what is in it.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = ([Vec3; 2], Content)> {
        self.nodes.iter().map(|node| ([node.bounds.low, node.bounds.high], node.content))
    }

    /// The spheres in the order in which the leaves name them: each with its id, and whether hits on it need the accept closure.
    pub fn in_order(&self) -> impl ExactSizeIterator<Item = (Sphere, u32, bool)> {
        self.entries.iter().map(|entry| (entry.sphere, entry.id, entry.transparent))
    }

    /// The nearest accepted hit of a ray; see [`Tracer::closest`](crate::trace::Tracer::closest).
    pub fn closest(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        self.visit(ray, |entry, ray| {
            for t in roots(ray, &entry.sphere).into_iter().flatten() {
                let hit = Hit { t, triangle: entry.id, u: 0.0, v: 0.0 };
                let nearer = nearest.is_none_or(|other| t < other.t || t == other.t && entry.id < other.triangle);
                if t > ray.t_min && t < ray.t_max && nearer && (!entry.transparent || accept(&hit)) {
                    nearest = Some(hit);
                    break;
                }
            }
            nearest.map_or(ray.t_max, |hit| hit.t)
        });
        nearest
    }

    /// Whether there is any accepted hit; see [`Tracer::occluded`](crate::trace::Tracer::occluded).
    pub fn occluded(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        let mut blocked = false;
        self.visit(ray, |entry, ray| {
            for t in roots(ray, &entry.sphere).into_iter().flatten().filter(|t| *t > ray.t_min && *t < ray.t_max) {
                let hit = Hit { t, triangle: entry.id, u: 0.0, v: 0.0 };
                blocked = blocked || !entry.transparent || accept(&hit);
            }
            if blocked { f32::NEG_INFINITY } else { ray.t_max }
        });
        blocked
    }

    /// Whether a sphere may reach into a ball. Errs on the side of `true`.
    #[must_use]
    pub fn reaches(&self, center: Vec3, radius: f32) -> bool {
        let near = |bounds: &Bounds| {
            let (low, high) = (bounds.low.as_dvec3(), bounds.high.as_dvec3());
            let nearest = center.as_dvec3().clamp(low, high);
            // A distance that is NaN counts as near.
            let is_far = nearest.distance(center.as_dvec3()) > f64::from(radius) * 1.001;
            !is_far
        };
        let mut stack = [0_u32; DEPTH];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            if !near(&node.bounds) {
                continue;
            }
            match node.content {
                Content::Nodes(first) => {
                    (stack[waiting], stack[waiting + 1]) = (first, first + 1);
                    waiting += 2;
                }
                Content::Spheres(..) => return true,
            }
        }
        false
    }

    /// Calls `each` for the spheres whose boxes a ray meets, near nodes first. `each` returns the distance beyond which hits are no longer
    /// of interest.
    fn visit(&self, ray: &Ray, mut each: impl FnMut(&Entry, &Ray) -> f32) {
        let Some(slabs) = Slabs::new(ray) else { return };
        let mut t_max = ray.t_max;
        let mut stack = [(0_u32, 0.0_f64); DEPTH];
        let mut waiting = 0;
        if let Some(root) = self.nodes.first()
            && let Some(enters) = slabs.enters(&root.bounds, t_max)
        {
            stack[0] = (0, enters);
            waiting = 1;
        }
        while waiting > 0 {
            waiting -= 1;
            let (node, enters) = stack[waiting];
            if enters > f64::from(t_max) {
                continue;
            }
            match self.nodes[node as usize].content {
                Content::Nodes(first) => {
                    let of = |node: u32| Some((node, slabs.enters(&self.nodes[node as usize].bounds, t_max)?));
                    let (one, other) = (of(first), of(first + 1));
                    // The nearer child is pushed last, so that it is visited next.
                    let swapped = matches!((one, other), (Some((_, a)), Some((_, b))) if a < b);
                    for child in if swapped { [other, one] } else { [one, other] }.into_iter().flatten() {
                        stack[waiting] = child;
                        waiting += 1;
                    }
                }
                Content::Spheres(first, count) => {
                    for entry in &self.entries[first as usize..][..count as usize] {
                        if slabs.enters(&around(&entry.sphere), t_max).is_some() {
                            t_max = each(entry, ray);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(mut state: u32) -> impl FnMut() -> f32 {
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        }
    }

    fn scattered(count: usize) -> Geometry {
        let mut random = numbers(7);
        let sphere = |index: usize| {
            let center = Vec3::new(random(), random(), random()) * 10.0;
            Sphere { center, radius: 0.02 + random().abs() * 0.6, material: (index * 3 / count.max(1)) as u32 }
        };
        Geometry { spheres: (0..count).map(sphere).collect(), triangles: vec![[0; 3]; 5], ..Geometry::default() }
    }

    /// Every hit of a ray within its interval, in `f64`: distance, id, and half the length of the chord in radii (0 for a grazing ray).
    fn all(geometry: &Geometry, ray: &Ray) -> Vec<(f64, u32, f64)> {
        let mut hits = Vec::new();
        for (sphere, id) in geometry.spheres.iter().zip(geometry.triangles.len() as u32..) {
            let direction = ray.direction.as_dvec3();
            let from = ray.origin.as_dvec3() - sphere.center.as_dvec3();
            let a = direction.dot(direction);
            let b = -from.dot(direction) / a;
            let radius = f64::from(sphere.radius);
            let square = radius * radius - (from + b * direction).length_squared();
            if square >= 0.0 {
                let half = (square / a).sqrt();
                hits.extend([b - half, b + half].map(|t| (t, id, half / radius)));
            }
        }
        hits.retain(|(t, ..)| *t > f64::from(ray.t_min) && *t < f64::from(ray.t_max));
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        hits
    }

    #[test]
    fn what_a_ray_meets_is_what_all_spheres_in_f64_say() {
        for count in [0, 1, 4, 5, 9, 300, 3000] {
            let geometry = scattered(count);
            let transparent = [false, true, false];
            let tree = SphereTree::build(&geometry, &transparent);
            let glassy = |id: u32| geometry.sphere(id).expect("a sphere").material == 1;
            let mut random = numbers(count as u32 + 1);
            let (mut met, mut asked_all) = (0, 0);
            for index in 0..3000 {
                let mut vector = || Vec3::new(random(), random(), random());
                let mut direction = vector().normalize_or(Vec3::X);
                // Every fifth ray runs along an axis, with zeros of both signs.
                if index % 5 == 0 {
                    direction = [Vec3::X, Vec3::NEG_Y, Vec3::new(-0.0, 0.0, 1.0)][index % 3];
                }
                let ray = Ray { origin: vector() * 8.0, direction, t_min: 0.0, t_max: [f32::INFINITY, 3.0][index % 2] };
                let hits = all(&geometry, &ray);
                let clear = hits.iter().all(|(t, _, half)| *half > 1e-2 && *t > 1e-3);
                if !clear {
                    continue;
                }
                let nearest = tree.closest(&ray, &mut |_| true);
                assert_eq!(nearest.map(|hit| hit.triangle), hits.first().map(|(_, id, _)| *id), "{count} {index}");
                if let (Some(hit), Some((t, ..))) = (nearest, hits.first()) {
                    assert!((f64::from(hit.t) - t).abs() < 1e-4, "{hit:?} {t}");
                    met += 1;
                }
                // Where no hit on glass is accepted, rays pass through it, and `accept` sees each crossing.
                let opaque = hits.iter().find(|(_, id, _)| !glassy(*id)).map(|(_, id, _)| *id);
                let mut shown = Vec::new();
                assert_eq!(tree.closest(&ray, &mut |_| false).map(|hit| hit.triangle), opaque);
                let blocked = tree.occluded(&ray, &mut |hit| {
                    shown.push((hit.triangle, hit.t));
                    false
                });
                assert_eq!(blocked, opaque.is_some());
                assert_eq!(tree.occluded(&ray, &mut |_| true), !hits.is_empty());
                if !blocked {
                    assert_eq!(shown.len(), hits.len());
                    asked_all += usize::from(!shown.is_empty());
                }
            }
            assert!(count < 300 || (met > 200 && asked_all > 20), "{count}: {met} {asked_all}");
        }
    }

    #[test]
    fn a_ball_is_reached_where_one_sphere_does() {
        let geometry = scattered(800);
        let tree = SphereTree::build(&geometry, &[]);
        let mut random = numbers(3);
        let (mut near, mut far) = (0, 0);
        for _ in 0..2000 {
            let (center, radius) = (Vec3::new(random(), random(), random()) * 12.0, random().abs());
            let reached = |sphere: &Sphere| sphere.center.distance(center) <= sphere.radius + radius;
            let truly = geometry.spheres.iter().any(reached);
            assert!(tree.reaches(center, radius) || !truly);
            (near, far) = (near + usize::from(truly), far + usize::from(!tree.reaches(center, radius)));
        }
        assert!(near > 100 && far > 100, "{near} {far}");
        assert!(!SphereTree::default().reaches(Vec3::ZERO, 1e9));
    }

    #[test]
    fn rays_that_are_none_and_spheres_in_one_place_do_no_harm() {
        let sphere = Sphere { center: Vec3::ONE, radius: 0.5, material: 0 };
        let geometry = Geometry { spheres: vec![sphere; 1000], ..Geometry::default() };
        let tree = SphereTree::build(&geometry, &[]);
        let ray = Ray { origin: Vec3::new(1.0, 1.0, 5.0), direction: Vec3::NEG_Z, t_min: 0.0, t_max: 9.0 };
        assert_eq!(tree.closest(&ray, &mut |_| true), Some(Hit { t: 3.5, triangle: 0, u: 0.0, v: 0.0 }));
        for none in [
            Ray { origin: Vec3::NAN, ..ray },
            Ray { direction: Vec3::ZERO, ..ray },
            Ray { direction: Vec3::INFINITY, ..ray },
            Ray { t_max: 0.0, ..ray },
            Ray { t_max: f32::NAN, ..ray },
            Ray { t_max: 3.5, ..ray },
            Ray { t_min: 4.5, ..ray },
        ] {
            assert_eq!(
                (tree.closest(&none, &mut |_| true), tree.occluded(&none, &mut |_| true)),
                (None, false),
                "{none:?}"
            );
        }
    }
}
