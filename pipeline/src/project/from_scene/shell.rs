//! The shell around everything else of a scene: a sky dome, a sky box, or the walls of a closed room.

use super::clean;
use super::extent::{Extent, Part, around};
use crate::scene::{Group, Material, Scene};
use glam::DVec3;
use std::f64::consts::PI;

/// Words that names of skies contain, in lower case.
const SKIES: [&str; 11] =
    ["sky", "dome", "cloud", "heaven", "atmosph", "himmel", "cielo", "nuvem", "nuvens", "panorama", "hdri"];
/// Words that contain one of [`SKIES`] and do not name a sky.
const NO_SKIES: [&str; 3] = ["skylight", "skyscraper", "skyline"];

/// A shell around everything else of a scene, with faces that look inwards, such as a sky dome or the walls of a closed room. It
/// may be open below. A ball or a house whose faces look outwards is not a shell. A shell that is a sky by its name may look
/// outwards.
#[derive(Debug)]
pub(super) struct Shell {
    /// Name of its object, or of its material where the object has several.
    pub name: String,
    /// Whether the shell hides its contents from a camera outside: not all of its materials are single-sided.
    pub hides: bool,
    /// Whether it is a sky: by its name, because it is round, or because it is a sky box, whose sides have one material each, far larger
    /// than its contents.
    pub is_sky: bool,
    /// Corners, anticlockwise as seen from the front.
    triangles: Vec<[DVec3; 3]>,
}

/// The shell around all other parts of a scene, and whether each of `parts` belongs to it. Candidates are the largest part, all
/// parts of its object, and the flat parts in the sides of the box around all parts. A candidate of several parts is taken only
/// if it is a sky.
pub(super) fn outermost(scene: &Scene, parts: &[Part]) -> Option<(Shell, Vec<bool>)> {
    let largest = parts.iter().max_by(|a, b| a.extent.diagonal().total_cmp(&b.extent.diagonal()))?;
    let same = |part: &Part| (part.object, part.group) == (largest.object, largest.group);
    let whole = around(parts)?;
    let chosen: [&dyn Fn(&Part) -> bool; 3] =
        [&same, &|part| part.object == largest.object, &|part| is_side(part, whole)];
    chosen.into_iter().find_map(|chosen| {
        let members: Vec<bool> = parts.iter().map(chosen).collect();
        let of = |member: bool| parts.iter().zip(&members).filter(move |(_, is)| **is == member).map(|(part, _)| part);
        let (shell, inner) = (of(true).collect::<Vec<_>>(), around(of(false))?);
        // If other parts had the sky's material, they would become sky too.
        let is_apart = of(false).all(|part| shell.iter().all(|member| member.material != part.material));
        let found = Shell::around(scene, &shell, inner, is_apart)?;
        (found.is_sky || shell.len() == 1).then_some((found, members))
    })
}

/// Whether a part is in a side of the box around all parts, as the sides of sky boxes are: flat, and nearly as large as the side of the
/// box.
fn is_side(part: &Part, whole: Extent) -> bool {
    /// `FLAT`: most extent of its short side, and most distance from the box's side. `LARGE`: least extent of its long sides. All
    /// are shares of the box.
    const FLAT: f64 = 0.02;
    const LARGE: f64 = 0.9;
    let (size, own) = (whole.high - whole.low, part.extent.high - part.extent.low);
    let along = |axis: usize| {
        let near = |gap: f64| gap <= FLAT * size[axis];
        let beside = near(part.extent.low[axis] - whole.low[axis]) || near(whole.high[axis] - part.extent.high[axis]);
        let across = (0..3).filter(|other| *other != axis).all(|other| own[other] >= LARGE * size[other]);
        near(own[axis]) && beside && across
    };
    (0..3).any(along)
}

fn group_of<'s>(scene: &'s Scene, part: &Part) -> &'s Group {
    &scene.meshes[scene.objects[part.object].mesh as usize].groups[part.group]
}

fn material_of<'s>(scene: &'s Scene, part: &Part) -> Option<&'s Material> {
    scene.materials.get(part.material as usize)
}

/// Whether the name of a part's object, mesh or material says that it is a sky.
fn is_named_sky(scene: &Scene, part: &Part) -> bool {
    let object = &scene.objects[part.object];
    let mesh = &scene.meshes[object.mesh as usize];
    let material = material_of(scene, part).map_or("", |material| &material.name);
    [&object.name, &mesh.name, material].into_iter().any(|name| {
        let mut name = name.to_lowercase();
        NO_SKIES.iter().for_each(|word| name = name.replace(word, ""));
        SKIES.iter().any(|word| name.contains(word))
    })
}

impl Shell {
    /// The shell that `parts` form around contents with the box `inner`; `None` if they form none. The shell is a sky only if `may_be_sky`
    /// is true.
    fn around(scene: &Scene, parts: &[&Part], inner: Extent, may_be_sky: bool) -> Option<Self> {
        /// Greatest number of triangles that are examined.
        const MOST: usize = 1 << 20;
        /// How far a corner of the inner box may lie beyond the shell's box, as a share of the shell's size. The corners of a
        /// square terrain under a round dome do so.
        const BEYOND: f64 = 0.05;
        /// `DIRECTIONS`: number of upward rays that are tested against the shell. `OPEN`: greatest number of these rays that may leave the
        /// contents without hitting the front of the shell.
        const DIRECTIONS: u32 = 64;
        const OPEN: u32 = 3;
        /// The diagonal of a sky box is more than `FAR` times that of its contents. The contents lie above the bottom of the box
        /// by more than the share `ABOVE` of its height: contents that stand on the bottom are in a room.
        const FAR: f64 = 4.0;
        const ABOVE: f64 = 0.1;
        let extent = around(parts.iter().copied())?;
        let slack = (extent.high - extent.low) * BEYOND;
        let [low, high] = [extent.low - slack, extent.high + slack];
        let beside = inner.low.x >= low.x && inner.low.z >= low.z && inner.high.cmple(high).all();
        let count = parts.iter().map(|part| group_of(scene, part).triangles.len()).sum::<usize>();
        if !beside || inner.diagonal() <= 0.0 || count > MOST {
            return None;
        }
        let materials = || parts.iter().filter_map(|part| material_of(scene, part));
        let (first, object) = (parts.first()?, &scene.objects[parts.first()?.object]);
        let is_whole = parts.iter().all(|part| part.object == first.object)
            && scene.meshes[object.mesh as usize].groups.len() == parts.len();
        let own = clean(&object.name).filter(|_| is_whole);
        let name = own.or_else(|| materials().find_map(|material| clean(&material.name))).unwrap_or_default();
        let triangles: Vec<_> = parts.iter().flat_map(|part| triangles_of(scene, part)).collect();
        let mut pictures: Vec<_> = parts.iter().map(|part| part.material).collect();
        pictures.sort_unstable();
        pictures.dedup();
        let (is_far, bottom) = (extent.diagonal() > FAR * inner.diagonal(), inner.low.y - extent.low.y);
        let floats = bottom > ABOVE * (extent.high.y - extent.low.y);
        let is_named = may_be_sky && parts.iter().all(|part| is_named_sky(scene, part));
        let is_boxed = parts.len() > 4 && pictures.len() == parts.len() && is_far && floats;
        let is_sky = may_be_sky && (is_named || is_boxed || is_round(&triangles, extent));
        let hides = parts.iter().any(|part| material_of(scene, part).is_none_or(|material| !material.single_sided));
        let shell = Self { name, hides, is_sky, triangles };
        let mut open = 0;
        for number in 0..DIRECTIONS {
            open += u32::from(!shell.closes(inner.center(), upwards(number, DIRECTIONS), is_named));
            if open > OPEN {
                return None;
            }
        }
        Some(shell)
    }

    /// Merges this shell and the shell `inner` inside it into one.
    pub fn around_another(mut self, inner: Self) -> Self {
        self.triangles.extend(inner.triangles);
        Self {
            name: inner.name,
            hides: self.hides || inner.hides,
            is_sky: self.is_sky && inner.is_sky,
            triangles: self.triangles,
        }
    }

    /// Whether a ray hits the shell, and its farthest hit is on a front face; with `may_look_away`, a hit on a back face counts too.
    fn closes(&self, from: DVec3, direction: DVec3, may_look_away: bool) -> bool {
        let hits = self.triangles.iter().filter_map(|corners| hit(corners, from, direction));
        hits.max_by(|a, b| a.0.total_cmp(&b.0)).is_some_and(|(_, is_front)| is_front || may_look_away)
    }

    /// Distance from a point to the shell's nearest hit along a unit direction; `None` without a hit.
    pub fn distance(&self, from: DVec3, direction: DVec3) -> Option<f64> {
        let hits = self.triangles.iter().filter_map(|corners| hit(corners, from, direction));
        hits.map(|(distance, _)| distance).min_by(f64::total_cmp)
    }
}

/// The triangles of a part in the world.
fn triangles_of<'s>(scene: &'s Scene, part: &Part) -> impl Iterator<Item = [DVec3; 3]> + use<'s> {
    let object = &scene.objects[part.object];
    let mesh = &scene.meshes[object.mesh as usize];
    let mirrored = object.transform.determinant() < 0.0;
    let placed = move |corner: u32| {
        let position = mesh.positions.get(corner as usize)?;
        let placed = object.transform.transform_point3(*position);
        placed.is_finite().then(|| placed.as_dvec3() + scene.origin)
    };
    group_of(scene, part).triangles.iter().filter_map(move |triangle| {
        let [a, b, c] = triangle.map(placed);
        let (a, b, c) = (a?, b?, c?);
        Some(if mirrored { [a, c, b] } else { [a, b, c] })
    })
}

/// Whether all corners lie on the ellipsoid that fills the box, or on the ellipsoid whose upper half fills it.
fn is_round(triangles: &[[DVec3; 3]], extent: Extent) -> bool {
    /// Least number of triangles; a box has fewer.
    const LEAST: usize = 24;
    /// How far a corner may be off, as a share of the radius.
    const OFF: f64 = 0.03;
    let half = (extent.high - extent.low) * 0.5;
    let sphere = (extent.center(), half);
    let dome = (DVec3::new(sphere.0.x, extent.low.y, sphere.0.z), DVec3::new(half.x, 2.0 * half.y, half.z));
    let fits = |(center, radii): (DVec3, DVec3)| {
        triangles.iter().flatten().all(|corner| (((*corner - center) / radii).length() - 1.0).abs() <= OFF)
    };
    triangles.len() >= LEAST && (fits(sphere) || fits(dome))
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

/// Distance at which a ray hits a triangle, and whether it hits the front (Möller and Trumbore).
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
