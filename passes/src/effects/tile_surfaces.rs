//! The surfaces of a tile's pixels and their light, found before the pixels are computed. The shadow rays of a tile are
//! traced together, as packets.

use super::coverage::Coverage;
use super::light::{SHADOWED, shares_of_light};
use super::pass::{Pass, Pixel};
use super::surface::{Surface, Surfaces};
use super::tile::{Area, TILE};
use super::visible_pixels::VisiblePixels;
use crate::trace::{
    Detected, Hit, Kernel, LANES, PACKET, Packet, Simd, SurfacePoints, Tracer, at_vertices, vector_at, vertices,
};
use glam::Vec3;

/// Results for a pixel that are known before it is computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// The light's share; `None` where it was not computed.
    pub(super) light: Option<f32>,
    /// The surface and the direction in which it is seen; `None` for pixels that the survey left out.
    pub(super) surface: Option<(Surface, Vec3)>,
    /// Origin of rays to the viewer's side of that surface.
    pub(super) origin: Vec3,
    /// The ambient occlusion; `None` where it was not computed.
    pub(super) occlusion: Option<f32>,
}

impl Known {
    pub(super) const NOTHING: Self = Self { light: None, surface: None, origin: Vec3::ZERO, occlusion: None };
}

/// The known results of a tile's pixels, and the buffers for finding them.
#[derive(Debug, Default)]
pub struct TileSurfaces {
    /// By place in the tile; empty where the program computes each pixel by itself.
    known: Vec<Known>,
    /// The pixels whose surfaces are looked for.
    shown: VisiblePixels,
    packets: Vec<Packet>,
    /// For each ray, its pixel's place in the tile.
    places: Vec<u16>,
    blocked: Vec<u16>,
    /// Glass surfaces that rays cross: index of the ray, and distance.
    crossings: Vec<(u32, f32)>,
    distances: Vec<f32>,
}

impl TileSurfaces {
    /// The known results of the pixel at a place of the tile; nothing if the tile was not surveyed.
    pub(super) fn known(&self, place: usize) -> Known {
        self.known.get(place).copied().unwrap_or(Known::NOTHING)
    }

    /// The known results of the pixel at a place of a surveyed tile.
    pub(super) fn at(&self, place: usize) -> &Known {
        &self.known[place]
    }

    pub(super) fn at_mut(&mut self, place: usize) -> &mut Known {
        &mut self.known[place]
    }

    /// Finds the surfaces of the wanted pixels of a tile, and forgets everything else about the tile.
    pub(super) fn survey<T: Tracer, C: Coverage>(
        &mut self,
        pass: &Pass<'_, T, C>,
        area: Area,
        wanted: impl Fn(Pixel, u32) -> bool,
    ) {
        self.clear();
        let of_triangles = |pixel, id| pass.sphere(id).is_none() && wanted(pixel, id);
        Detected::cached().run(Survey { surfaces: self, pass, area, wanted: of_triangles });
        if !T::SPHERES {
            return;
        }
        for (place, pixel) in area.pixels() {
            let sphere = pass.triangle(pixel).filter(|id| pass.sphere(*id).is_some() && wanted(pixel, *id));
            if let Some(id) = sphere {
                let seen @ (surface, _) = pass.surface_at(pixel, id, pass.normal(pixel));
                self.known[place].surface = Some(seen);
                self.known[place].origin = surface.origin(surface.facing);
            }
        }
    }

    /// Forgets all pixels, as if no tile had been surveyed.
    pub(super) fn forget(&mut self) {
        self.known.clear();
        self.shown.forget();
    }

    /// Forgets the previous tile, and makes room for the next.
    pub(super) fn clear(&mut self) {
        self.known.clear();
        self.known.resize(TILE * TILE, Known::NOTHING);
        self.packets.clear();
        self.places.clear();
        self.crossings.clear();
    }

    fn push(&mut self, place: usize, origin: Vec3, direction: Vec3) {
        let lane = self.places.len() % PACKET;
        if lane == 0 {
            self.packets.push(Packet::new(0.0, f32::INFINITY));
        }
        if let Some(packet) = self.packets.last_mut() {
            packet.set(lane, origin, direction);
        }
        self.places.push(place as u16);
    }

    /// Traces all rays, and returns how many there are.
    fn trace<T: Tracer>(&mut self, tracer: &T, mut stops: impl FnMut(u32, &Hit, &mut Vec<(u32, f32)>) -> bool) -> u64 {
        let Self { packets, blocked, crossings, .. } = self;
        blocked.clear();
        blocked.resize(packets.len(), 0);
        tracer.occluded_packets(packets, blocked, |ray, hit| stops(ray as u32, hit, crossings));
        self.places.len() as u64
    }

    /// Forgets the light at pixels whose ray crosses glass and is not blocked. A program that calls this needs more than a
    /// share of the light at these pixels.
    pub(super) fn forget_light_through_glass(&mut self) {
        for (ray, _) in &self.crossings {
            let ray = *ray as usize;
            if self.blocked[ray / PACKET] >> (ray % PACKET) & 1 == 0 {
                self.known[usize::from(self.places[ray])].light = None;
            }
        }
    }

    /// Writes the light's share along every ray to the known results of the ray's pixel.
    fn note_answers(&mut self) {
        let Self { known, places, blocked, crossings, distances, .. } = self;
        shares_of_light(SHADOWED, places.len(), blocked, crossings, distances, |ray, share| {
            known[usize::from(places[ray])].light = Some(share);
        });
    }
}

/// The SIMD kernel that finds the surfaces of a tile.
struct Survey<'a, T, C, W> {
    surfaces: &'a mut TileSurfaces,
    pass: &'a Pass<'a, T, C>,
    area: Area,
    wanted: W,
}

impl<T: Tracer, C: Coverage, W: Fn(Pixel, u32) -> bool> Kernel<()> for Survey<'_, T, C, W> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { surfaces: TileSurfaces { known, shown, .. }, pass, area, wanted } = self;
        let fetch = |pixel: usize| simd.prefetch(&pass.job.normal[pixel]);
        shown.collect(simd, (pass, area), wanted, fetch);
        for lanes in shown.sixteens() {
            let geometry = &pass.job.scene.geometry;
            let corners = at_vertices(simd, &geometry.positions, &vertices(simd, &geometry.triangles, lanes.triangles));
            let stored = simd.gather(pass.job.position, lanes.pixels);
            let normals = simd.gather(pass.job.normal, lanes.pixels);
            for half in 0..2 {
                let points = SurfacePoints::snap(&corners, &stored, half);
                let surfaces = Surfaces::new(&points, &normals, half, pass.job.eye);
                let near = points.near(simd);
                for (lane, &place) in lanes.places[half * LANES..][..LANES].iter().enumerate() {
                    let index = half * LANES + lane;
                    if lanes.used >> index & 1 == 0 {
                        return;
                    }
                    let known = &mut known[usize::from(place)];
                    if near >> lane & 1 == 0 {
                        known.surface = Some(surfaces.get(&points, lane));
                        known.origin = surfaces.origin(lane);
                    } else {
                        let point = pass.point_of(lanes.triangles[index], vector_at(&stored, index));
                        let seen @ (surface, _) = pass.surface_of(point, vector_at(&normals, index));
                        known.surface = Some(seen);
                        known.origin = surface.origin(surface.facing);
                    }
                }
            }
        }
    }
}

/// Computes the light of a tile. `origin` is called for each pixel with its known results. `origin` returns the light's share if that needs no ray,
/// or the origin of the shadow ray, or neither if the pixel's light is not computed here. `stops` says whether a hit of a ray stops light.
///
/// Returns the number of rays.
pub(super) fn prepare_light<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    area: Area,
    surfaces: &mut TileSurfaces,
    mut origin: impl FnMut(Pixel, &Known) -> (Option<f32>, Option<Vec3>),
    mut stops: impl FnMut(u32, &Hit, &mut Vec<(u32, f32)>) -> bool,
) -> u64 {
    for (place, pixel) in area.pixels() {
        let (share, start) = origin(pixel, &surfaces.known[place]);
        surfaces.known[place].light = share;
        if let Some(start) = start {
            surfaces.push(place, start, pass.to_light);
        }
    }
    let rays = surfaces.trace(pass.tracer, &mut stops);
    surfaces.note_answers();
    rays
}

#[cfg(test)]
mod tests {
    use super::{Survey, TileSurfaces};
    use crate::effects::coverage::Opaque;
    use crate::effects::dielectric::{Focused, Media, Targets};
    use crate::effects::pass::Pass;
    use crate::effects::tests::world::{Shot, World, grid};
    use crate::effects::tile::{Area, PART, TILE, corner_of, part_of};
    use crate::trace::{Detected, InstructionSet};
    use curitiba_pipeline::backend::NO_TRIANGLE;
    use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
    use curitiba_pipeline::scene::TriangleRanges;
    use glam::Vec3;
    use std::collections::BTreeSet;

    #[test]
    fn every_pixel_of_a_tile_has_a_place_of_its_own() {
        for (width, height) in [(16, 16), (7, 16), (16, 1), (1, 1), (5, 9)] {
            let area = Area { x: 32, y: 48, width, height, stride: 100 };
            let places: BTreeSet<usize> = area.pixels().map(|(place, _)| place).collect();
            assert_eq!(places.len(), width * height);
            for (place, pixel) in area.pixels() {
                assert_eq!((pixel.x as usize, pixel.y as usize), (32 + place % TILE, 48 + place / TILE));
                assert_eq!(pixel.index, pixel.y as usize * 100 + pixel.x as usize);
                let (part, lane) = part_of(place);
                let (left, top) = corner_of(part);
                assert_eq!((left + lane % PART, top + lane / PART), (place % TILE, place / TILE));
            }
        }
    }

    #[test]
    fn the_surfaces_of_a_tile_are_those_of_its_pixels_one_by_one() {
        let world = World::scattered();
        let geometry = &world.scene.geometry;
        // Of every four targets, two are inside a triangle, one at a corner and one at the middle of an edge. Near a border,
        // rays start farther inside the triangle.
        let targets = grid(16, Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Y * 4.0).enumerate().map(|(index, target)| {
            let [a, b, _] = geometry.corners(index as u32);
            [target, target, a, a.midpoint(b)][index % 4]
        });
        let mut shot = Shot::of(&world, Vec3::new(1.0, 2.0, 12.0), targets).rows(16);
        // A stored normal of length 0, and a stored position at the eye, which has no viewing direction.
        shot.normal[0] = [0.0; 4];
        shot.position[1] =
            shot.job(RayProgram::Ssao, Fidelity::Corrected, RayParams::default()).eye.extend(0.0).to_array();
        let job = shot.job(RayProgram::Ssao, Fidelity::Corrected, RayParams::default());
        let pass = Pass {
            job: &job,
            tracer: &world.tree(),
            coverage: Opaque,
            to_light: Vec3::ZERO,
            light_color: Vec3::ZERO,
            occlusion: None,
            strata: 0,
            open_share: Vec::new(),
            glass: TriangleRanges::default(),
            shadow_glass: TriangleRanges::default(),
            around_eye: Media::NONE,
            spectrum: Vec::new(),
            facets: Vec::new(),
            targets: Targets::default(),
            focused: Focused::default(),
            disc: None,
            eye: None,
            progress: None,
        };
        let area = Area { x: 0, y: 0, width: TILE, height: TILE, stride: TILE };
        for simd in [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable]
            .into_iter()
            .filter_map(Detected::new)
        {
            let mut surfaces = TileSurfaces::default();
            surfaces.clear();
            simd.run(Survey {
                surfaces: &mut surfaces,
                pass: &pass,
                area,
                wanted: |_, triangle: u32| !triangle.is_multiple_of(5),
            });
            let (mut found, mut drawn) = (0, 0);
            for (place, pixel) in area.pixels() {
                let known = surfaces.known(place);
                let triangle = job.triangle[pixel.index];
                if triangle == NO_TRIANGLE || triangle.is_multiple_of(5) {
                    assert_eq!(known.surface, None);
                    continue;
                }
                let alone @ (surface, _) = pass.surface_at(pixel, triangle, pass.normal(pixel));
                assert_eq!(
                    (known.surface, known.origin),
                    (Some(alone), surface.origin(surface.facing)),
                    "{simd:?} {place}"
                );
                found += 1;
                drawn += usize::from(surface.is_drawn_in());
            }
            assert!(found > 100 && drawn > 10 && found - drawn > 50, "{found} {drawn}");
        }
    }
}
