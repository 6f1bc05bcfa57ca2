//! Which flat glass lies in one plane, so that one mirror serves it.
//!
//! A plane is that of a triangle, in `f64`. Another triangle lies in it where its corners do within what rounding explains: positions are
//! off by [`ROUNDING`] of their largest coordinate, and a plane through three such points is off by as much times the sum of the absolute
//! barycentric coordinates of the place. Larger triangles are asked first, so the planes that others are compared with are the best known.
//! So the panes of a facade are one mirror, and a mirror is never farther from its glass than the positions themselves may be.

use super::bounds::Bounds;
use curitiba_pipeline::memory::{Refused, with_capacity};
use curitiba_pipeline::scene::{Geometry, TriangleRanges};
use glam::{DVec3, Vec3, Vec4};
use std::collections::HashMap;

/// Largest error of a position over its largest coordinate: two units in the last place of each coordinate, of the products and sums that
/// moved it, make at most 3.5 of the whole.
pub const ROUNDING: f64 = 1.0 / (1 << 21) as f64;

/// Largest sine between a shading normal and the plane that it is a normal of, besides what rounding of positions may lean the plane: a
/// milliradian, three times what normals in 16-bit floats are off. Glass whose normals lean more is bent, or has bumps, and mirrors otherwise
/// than its plane.
pub const MAX_SINE: f64 = 1e-3;

/// Most that it may be with rounding. Positions that tell a plane no better tell no mirror.
const LARGEST_SINE: f64 = 0.5 / CELLS;

/// Of triangles that lie in no plane: degenerate or bent.
pub const NO_PLANE: u32 = u32::MAX;

/// Cells of normals that a unit is cut into.
const CELLS: f64 = 32.0;

/// Whether a shading normal is that of a plane, on either side: a unit vector, and the square of the sine that is allowed.
#[must_use]
#[inline]
pub fn agrees(normal: Vec3, plane: Vec4) -> bool {
    let square = normal.length_squared();
    square > 0.0 && normal.cross(plane.truncate()).length_squared() <= plane.w * square
}

/// A plane in which flat glass lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlassPlane {
    /// Unit normal, on either side.
    pub normal: DVec3,
    /// The dot product of the normal and a point of the plane, less this, is 0.
    pub offset: f64,
    /// What its glass is off it: corners of triangles that rounding moved.
    pub slack: f64,
    /// Largest sine between it and its shading normals.
    pub max_sine: f64,
    /// Around its glass.
    pub bounds: Bounds,
}

impl GlassPlane {
    /// Distance of a point in front of the plane, below 0 behind it.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// What [`agrees`] asks for.
    #[must_use]
    pub fn agreement(&self) -> Vec4 {
        self.normal.as_vec3().extend((self.max_sine * self.max_sine) as f32)
    }
}

/// Triangles of glass that follow each other and lie in one plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Run {
    /// The first triangle.
    pub first: u32,
    /// The one after the last.
    pub end: u32,
    /// Index of the plane, or [`NO_PLANE`].
    pub plane: u32,
    padding: u32,
}

/// The glass of a scene by the planes that it lies in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Glazing {
    /// Ordered by their largest triangles, the largest first.
    pub planes: Vec<GlassPlane>,
    /// All triangles of glass, ascending.
    pub runs: Vec<Run>,
}

/// What a plane was made from: a triangle, and how well it tells the plane.
struct Facet {
    middle: DVec3,
    /// Error of its corners.
    rounding: f64,
    /// Its shortest height.
    height: f64,
}

impl Facet {
    /// How far the plane may be from where a point at this distance from its middle should be: the sum of the absolute barycentric
    /// coordinates is at most `1 + 2 r / height`.
    fn error_at(&self, distance: f64) -> f64 {
        self.rounding * (1.0 + 2.0 * distance / self.height)
    }
}

fn rounding_of(corners: &[DVec3; 3]) -> f64 {
    corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max) * ROUNDING
}

/// A unit normal and the shortest height; `None` for a triangle without an area.
fn measure([a, b, c]: &[DVec3; 3]) -> Option<(DVec3, f64)> {
    let doubled = (*b - *a).cross(*c - *a);
    let longest = (*b - *a).length().max((*c - *b).length()).max((*a - *c).length());
    let height = doubled.length() / longest;
    let normal = doubled.try_normalize()?;
    (height > 0.0 && height.is_finite()).then_some((normal, height))
}

/// The cells that a unit vector may lie in that agrees with this one; one or two along each axis.
fn cells(normal: DVec3) -> impl Iterator<Item = [i8; 3]> {
    // A little more, for rounding.
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
    /// Of the materials that are glass.
    ///
    /// # Errors
    /// If there is not enough memory for 12 bytes a triangle of glass.
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
        // By triangle, in the order of their ids.
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

    /// The plane of a triangle, [`NO_PLANE`] for glass that lies in none; `None` for what is not glass.
    #[must_use]
    #[inline]
    pub fn plane_of(&self, triangle: u32) -> Option<u32> {
        let next = self.runs.partition_point(|run| run.first <= triangle);
        self.runs[..next].last().filter(|run| triangle < run.end).map(|run| run.plane)
    }
}

/// Planes in the making.
#[derive(Default)]
struct Planes {
    planes: Vec<GlassPlane>,
    facets: Vec<Facet>,
    /// Indices of the planes by the cell of their normals.
    cells: HashMap<[i8; 3], Vec<u32>>,
}

impl Planes {
    /// The plane that a triangle lies in, a new one if none is known.
    fn plane_of(&mut self, geometry: &Geometry, triangle: u32) -> u32 {
        let corners = geometry.corners(triangle).map(Vec3::as_dvec3);
        let Some((own, height)) = measure(&corners) else { return NO_PLANE };
        let shading =
            geometry.triangles[triangle as usize].map(|vertex| geometry.normals.get(vertex as usize).copied());
        let flat = |plane: Vec4| shading.iter().flatten().all(|normal| agrees(*normal, plane));
        // The direction of a sliver is not known, that of its normals is.
        let shown = shading[0].and_then(Vec3::try_normalize).map_or(own, Vec3::as_dvec3);
        let rounding = rounding_of(&corners);
        // How far it is off a plane, where it lies in it.
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
