//! The bodies of glass meshes at which photons are shot.

use crate::trace::Bounds;
use curitiba_pipeline::glass::{Dielectric, Shape, connected};
use curitiba_pipeline::scene::Geometry;
use glam::DVec3;

/// Greatest number of targets. If there are more separate bodies, all of them are one target.
const MOST: usize = 1024;

/// Stored for a triangle that belongs to no target.
const NONE: u16 = u16::MAX;

/// Bodies that are near each other: photons are shot from one disc, perpendicular to the light, that covers all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Middle of the disc, and of a sphere around the bodies, world.
    pub center: DVec3,
    /// Radius of the disc.
    pub radius: f64,
    /// Radius of the sphere.
    pub reach: f64,
    /// Whether bodies of glass that are no targets touch the target's bounding box: a photon may be in such a body before it meets the target.
    pub among_bodies: bool,
}

/// All targets of a scene: the bodies of meshes whose glass bends light. Bodies whose bounding boxes overlap are one target.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Targets {
    list: Vec<Target>,
    /// For each triangle the number of its target, or [`NONE`]. Empty without targets.
    of: Vec<u16>,
}

impl Targets {
    /// The targets of a scene in light that travels in the unit direction `along`. `is_disc` says whether the light is a disc, so that its direction
    /// varies.
    #[must_use]
    pub fn of(geometry: &Geometry, dielectrics: &[Dielectric], along: DVec3, is_disc: bool) -> Self {
        let solid = |material: u32| dielectrics.get(material as usize).filter(|glass| glass.shape == Shape::Solid);
        let bends = |material: u32| dielectrics.get(material as usize).is_some_and(Dielectric::bends_light);
        let mut bounds: Vec<Bounds> = Vec::new();
        // Triangles with the parts that they belong to.
        let mut parts: Vec<(u32, usize)> = Vec::new();
        let corners = |triangle: u32| Bounds::of(&geometry.corners(triangle));
        for material in (0..dielectrics.len() as u32).filter(|material| bends(*material)) {
            let triangles = triangles_of(geometry, material);
            let first = bounds.len();
            for (triangle, part) in triangles.iter().zip(connected(geometry, &triangles)) {
                let part = first + part as usize;
                bounds.resize(bounds.len().max(part + 1), Bounds::EMPTY);
                bounds[part] = bounds[part].union(corners(*triangle));
                parts.push((*triangle, part));
            }
        }
        if parts.is_empty() {
            return Self::default();
        }
        let (boxes, target_of) = together(&bounds);
        let spheres = geometry.spheres.iter().filter(|sphere| solid(sphere.material).is_some());
        let spheres =
            spheres.map(|sphere| Bounds { low: sphere.center - sphere.radius, high: sphere.center + sphere.radius });
        let straight = (0..dielectrics.len() as u32).filter(|material| solid(*material).is_some() && !bends(*material));
        let straight = straight.map(|material| {
            triangles_of(geometry, material).into_iter().map(corners).fold(Bounds::EMPTY, Bounds::union)
        });
        let others: Vec<Bounds> = spheres.chain(straight).collect();
        let target = |bounds: &Bounds| Target {
            center: 0.5 * (bounds.low.as_dvec3() + bounds.high.as_dvec3()),
            radius: 0.0,
            reach: 0.0,
            among_bodies: others.iter().any(|other| other.touches(bounds)),
        };
        let mut list: Vec<Target> = boxes.iter().map(target).collect();
        let mut of = vec![NONE; geometry.triangles.len()];
        for (triangle, part) in parts {
            let number = target_of[part];
            of[triangle as usize] = number as u16;
            let target = &mut list[number];
            for corner in geometry.corners(triangle) {
                let from = corner.as_dvec3() - target.center;
                target.reach = target.reach.max(from.length());
                target.radius = target.radius.max(from.reject_from_normalized(along).length());
            }
        }
        if is_disc {
            // The sphere covers the bodies from all directions.
            list.iter_mut().for_each(|target| target.radius = target.reach);
        }
        Self { list, of }
    }

    /// All targets.
    #[must_use]
    pub fn list(&self) -> &[Target] {
        &self.list
    }

    /// The number of the target that a triangle belongs to; `None` for other triangles and for spheres.
    #[inline]
    #[must_use]
    pub fn at(&self, id: u32) -> Option<usize> {
        self.of.get(id as usize).filter(|target| **target != NONE).map(|target| usize::from(*target))
    }

    /// How many of `photons` are shot at each target: by the area of the discs, so that all photons have the same power but for rounding.
    #[must_use]
    pub fn shares(&self, photons: u32) -> Vec<u32> {
        let area = |target: &Target| target.radius * target.radius;
        let whole: f64 = self.list.iter().map(area).sum();
        let (mut before, mut shares) = (0.0, Vec::with_capacity(self.list.len()));
        let mut shot = 0;
        for target in &self.list {
            before += area(target);
            let until = if whole > 0.0 { (f64::from(photons) * (before / whole)).round() as u32 } else { 0 };
            shares.push(until - shot);
            shot = until;
        }
        shares
    }
}

fn triangles_of(geometry: &Geometry, material: u32) -> Vec<u32> {
    let batches = geometry.batches.iter().filter(|batch| batch.material == material);
    batches.flat_map(|batch| batch.first..batch.first + batch.count).collect()
}

/// Joins boxes that touch, until none do. Returns the joined boxes, and for each box the number of the joined box that it is in.
fn together(parts: &[Bounds]) -> (Vec<Bounds>, Vec<usize>) {
    if parts.len() > MOST {
        return (vec![parts.iter().copied().fold(Bounds::EMPTY, Bounds::union)], vec![0; parts.len()]);
    }
    let mut groups: Vec<(Bounds, Vec<usize>)> = Vec::new();
    for (part, bounds) in parts.iter().enumerate() {
        let (mut bounds, mut members) = (*bounds, vec![part]);
        while let Some(at) = groups.iter().position(|(other, _)| other.touches(&bounds)) {
            let (other, more) = groups.remove(at);
            bounds = bounds.union(other);
            members.extend(more);
        }
        groups.push((bounds, members));
    }
    let mut of = vec![0; parts.len()];
    for (number, (_, members)) in groups.iter().enumerate() {
        members.iter().for_each(|part| of[*part] = number);
    }
    (groups.into_iter().map(|(bounds, _)| bounds).collect(), of)
}
