//! Groups flat glass by plane, so that one mirror serves all glass in a plane.
//!
//! One triangle defines a plane, in `f64`. Another triangle lies in that plane if its corners do, up to rounding errors.
//! Positions have an error of [`ROUNDING`] times their largest coordinate. At a given place, the error of a plane through
//! three such points is this error times the sum of the place's absolute barycentric coordinates. Larger triangles are
//! visited first, because they define planes most exactly. So the panes of a facade become one mirror, and a mirror is
//! never farther from its glass than the error of the glass's positions plus the error of the mirror's plane.

use super::bounds::Bounds;
use curitiba_pipeline::memory::{Refused, with_capacity};
use curitiba_pipeline::scene::{Geometry, TriangleRanges};
use glam::{DVec3, Vec3, Vec4};
use std::collections::HashMap;

/// Largest error of a position relative to its largest coordinate. Products and sums that transform a position give each
/// coordinate an error of at most two units in the last place, so the three together are off by at most 3.5 units.
pub const ROUNDING: f64 = 1.0 / (1 << 21) as f64;

/// Greatest sine between a plane's normal and its shading normals, in addition to the tilt by the rounding of positions:
/// a milliradian, three times the error of normals in 16-bit floats. Glass with larger deviations is bent or bumpy, and
/// does not mirror as its plane would.
pub const MAX_SINE: f64 = 1e-3;

/// Limit of the greatest sine, including the tilt by rounding. A triangle whose positions determine a plane less well is in no mirror.
const LARGEST_SINE: f64 = 0.5 / CELLS;

/// Plane index of triangles that lie in no plane: degenerate or bent.
pub const NO_PLANE: u32 = u32::MAX;

/// Number of cells per unit of each component of a normal, in the grid that planes are looked up in.
const CELLS: f64 = 32.0;

/// Whether the sine between a shading normal, of any length but 0, and a plane's normal is within a limit. The two may point to opposite
/// sides of the plane. `plane` is the plane's unit normal and, in `w`, the square of the limit.
#[must_use]
#[inline]
pub fn agrees(normal: Vec3, plane: Vec4) -> bool {
    let square = normal.length_squared();
    square > 0.0 && normal.cross(plane.truncate()).length_squared() <= plane.w * square
}

/// A plane in which flat glass lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlassPlane {
    /// Unit normal, which may point to either side of the plane.
    pub normal: DVec3,
    /// Dot product of the normal and a point of the plane.
    pub offset: f64,
    /// Greatest distance between the plane and a corner of the plane's glass, which is due to rounding.
    pub slack: f64,
    /// Greatest sine between the plane's normal and the shading normals of glass in the plane.
    pub max_sine: f64,
    /// The box around the glass in the plane.
    pub bounds: Bounds,
}

impl GlassPlane {
    /// Signed distance of a point: above 0 in front of the plane, below 0 behind it.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// The plane as [`agrees`] takes it.
    #[must_use]
    pub fn agreement(&self) -> Vec4 {
        self.normal.as_vec3().extend((self.max_sine * self.max_sine) as f32)
    }
}

/// Consecutive glass triangles that lie in the same plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Run {
    /// The first triangle.
    pub first: u32,
    /// The triangle after the last.
    pub end: u32,
    /// Index of the plane, or [`NO_PLANE`].
    pub plane: u32,
    padding: u32,
}

/// The glass of a scene, grouped by plane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Glazing {
    /// Ordered by the area of each plane's largest triangle, in descending order.
    pub planes: Vec<GlassPlane>,
    /// All glass triangles, in ascending order.
    pub runs: Vec<Run>,
}

/// The triangle that defined a plane: the numbers that determine the plane's error.
struct Facet {
    middle: DVec3,
    /// Position error of the triangle's corners.
    rounding: f64,
    /// The triangle's shortest height.
    height: f64,
}

impl Facet {
    /// Error of the plane at `distance` from the triangle's centre: the sum of the absolute barycentric coordinates there is
    /// at most `1 + 2 distance / height`.
    fn error_at(&self, distance: f64) -> f64 {
        self.rounding * (1.0 + 2.0 * distance / self.height)
    }
}

fn rounding_of(corners: &[DVec3; 3]) -> f64 {
    corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max) * ROUNDING
}

/// Unit normal and shortest height of a triangle; `None` if it has no area.
fn measure([a, b, c]: &[DVec3; 3]) -> Option<(DVec3, f64)> {
    let doubled = (*b - *a).cross(*c - *a);
    let longest = (*b - *a).length().max((*c - *b).length()).max((*a - *c).length());
    let height = doubled.length() / longest;
    let normal = doubled.try_normalize()?;
    (height > 0.0 && height.is_finite()).then_some((normal, height))
}

/// The cells that may contain the unit normals of planes that agree with this normal: two or three along each axis.
fn cells(normal: DVec3) -> impl Iterator<Item = [i8; 3]> {
    // With a margin for rounding.
    let reach = 1.01 * LARGEST_SINE;
    let range = move |value: f64| {
        let cell = |value: f64| (value * CELLS).floor() as i8;
        cell(value - reach)..=cell(value + reach)
    };
    range(normal.x).flat_map(move |x| range(normal.y).flat_map(move |y| range(normal.z).map(move |z| [x, y, z])))
}

fn cell(normal: DVec3) -> [i8; 3] {
    (normal * CELLS).floor().to_array().map(|value| value as i8)
}

impl Glazing {
    /// Groups the triangles of the glass materials.
    ///
    /// # Errors
    /// If there is not enough memory for 16 bytes a triangle of glass.
    pub fn find(geometry: &Geometry, glass: &[bool]) -> Result<Self, Refused> {
        let ranges = TriangleRanges::new(geometry, glass);
        // Exact spheres have ids after the triangles, and no plane.
        let last = geometry.triangles.len() as u32;
        let known = ranges.as_slice().iter().map(|&[first, end]| first.min(last)..end.min(last));
        let count = known.clone().map(|range| range.len()).sum();
        let mut by_area: Vec<(f32, u32)> = with_capacity(count)?;
        by_area.extend(known.flatten().map(|triangle| {
            let [a, b, c] = geometry.corners(triangle);
            ((b - a).cross(c - a).length_squared(), triangle)
        }));
        by_area.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut found = Planes::default();
        // Pairs of triangle and plane, in ascending order of triangles.
        let mut plane_of: Vec<(u32, u32)> = with_capacity(count)?;
        plane_of.extend(by_area.iter().map(|(_, triangle)| (*triangle, found.plane_of(geometry, *triangle))));
        plane_of.sort_unstable();
        let mut runs: Vec<Run> = Vec::new();
        let mut put = |first: u32, end: u32, plane: u32| match runs.last_mut() {
            Some(run) if run.end == first && run.plane == plane => run.end = end,
            _ => runs.push(Run { first, end, plane, padding: 0 }),
        };
        plane_of.iter().for_each(|(triangle, plane)| put(*triangle, triangle + 1, *plane));
        for &[first, end] in ranges.as_slice().iter().filter(|[_, end]| *end > last) {
            put(first.max(last), end, NO_PLANE);
        }
        Ok(Self { planes: found.planes, runs })
    }

    /// The plane of a triangle; [`NO_PLANE`] for glass that lies in none; `None` for triangles that are not glass.
    #[must_use]
    #[inline]
    pub fn plane_of(&self, triangle: u32) -> Option<u32> {
        let next = self.runs.partition_point(|run| run.first <= triangle);
        self.runs[..next].last().filter(|run| triangle < run.end).map(|run| run.plane)
    }
}

/// The planes found so far.
#[derive(Default)]
struct Planes {
    planes: Vec<GlassPlane>,
    facets: Vec<Facet>,
    /// Indices of the planes, by the cell of their normal.
    cells: HashMap<[i8; 3], Vec<u32>>,
}

impl Planes {
    /// The plane that a triangle lies in; adds a plane if it lies in none found so far.
    fn plane_of(&mut self, geometry: &Geometry, triangle: u32) -> u32 {
        let corners = geometry.corners(triangle).map(Vec3::as_dvec3);
        let Some((own, height)) = measure(&corners) else { return NO_PLANE };
        let shading =
            geometry.triangles[triangle as usize].map(|vertex| geometry.normals.get(vertex as usize).copied());
        let flat = |plane: Vec4| shading.iter().flatten().all(|normal| agrees(*normal, plane));
        // Planes are looked up by a shading normal if there is one: the geometric normal of a sliver is less exact.
        let shown = shading[0].and_then(Vec3::try_normalize).map_or(own, Vec3::as_dvec3);
        let rounding = rounding_of(&corners);
        // The greatest distance of a corner of the triangle from a plane; `None` if the triangle does not lie in the plane.
        let off = |plane: &GlassPlane, facet: &Facet| {
            let all = corners.each_ref().map(|corner| plane.distance(*corner).abs());
            let explained =
                |(corner, off): (&DVec3, &f64)| *off <= rounding + facet.error_at(corner.distance(facet.middle));
            let lies_in = corners.iter().zip(&all).all(explained) && flat(plane.agreement());
            lies_in.then(|| all.into_iter().fold(0.0, f64::max))
        };
        let candidates = [shown, -shown].into_iter().flat_map(cells).filter_map(|cell| self.cells.get(&cell));
        let lies_in = |index: &u32| Some((*index, off(&self.planes[*index as usize], &self.facets[*index as usize])?));
        if let Some((index, slack)) = candidates.flatten().filter_map(lies_in).min_by_key(|(index, _)| *index) {
            let plane = &mut self.planes[index as usize];
            plane.slack = plane.slack.max(slack);
            plane.bounds = geometry.corners(triangle).into_iter().fold(plane.bounds, Bounds::with);
            return index;
        }
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let bounds = geometry.corners(triangle).into_iter().fold(Bounds::EMPTY, Bounds::with);
        let max_sine = MAX_SINE + 2.0 * rounding / height;
        let plane = GlassPlane { normal: own, offset: own.dot(middle), slack: 0.0, max_sine, bounds };
        if max_sine > LARGEST_SINE || !flat(plane.agreement()) {
            return NO_PLANE;
        }
        let index = self.planes.len() as u32;
        self.planes.push(plane);
        self.facets.push(Facet { middle, rounding, height });
        self.cells.entry(cell(own)).or_default().push(index);
        index
    }
}
