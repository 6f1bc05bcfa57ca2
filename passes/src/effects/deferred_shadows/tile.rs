//! The light of a tile's pixels, computed together. Estimates (`estimate.rs`) decide most pixels with certainty. For
//! the others, ray origins are computed sixteen at a time, by the same operations as for a single pixel, and the rays
//! are traced as packets.

use super::estimate::{Draw, Sketch};
use super::light::{Light, is_lit, light_at};
use super::sides::{ALL, dot, sides_of_corners, signs};
use crate::effects::light::SHADOWED;
use crate::effects::tile::{Area, PART, PARTS, TILE, corner_of, part_of};
use crate::effects::visible_pixels::{Sixteen, VisiblePixels};
use crate::effects::{Coverage, Pass};
use crate::trace::{
    Decided, Detected, F16, Hit, Kernel, LANES, Mask, PACKET, Packet, Simd, SurfacePoints, Tracer, at_vertices,
    vertices,
};
use curitiba_pipeline::backend::RayJob;
use glam::{Vec3, Vec4};

/// Greatest number of pixels that are computed one by one; more are computed sixteen at a time.
const FEW: usize = 7;

/// The shadows of a tile, and the buffers for finding them.
#[derive(Debug, Default)]
pub struct Tile {
    /// One bit a pixel, by part: pixels in shadow.
    dark: [u16; PARTS],
    /// Pixels in shadow whose triangle faces away from the light.
    turned: [u16; PARTS],
    sketch: Box<Sketch>,
    decided: Box<Decided>,
    /// Lit pixels that show triangles and whose light no sketch decides.
    shown: VisiblePixels,
    /// The first packets are the current tile's; later ones are left from other tiles.
    packets: Vec<Packet>,
    /// For each ray, its pixel's place in the tile.
    places: Vec<[u8; PACKET]>,
    blocked: Vec<u16>,
}

impl Tile {
    /// Forgets the previous pass.
    pub(in crate::effects) fn forget(&mut self) {
        self.shown.forget();
    }

    /// Computes the light of a tile's pixels, and returns the number of rays.
    pub(super) fn prepare<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>, area: &Area) -> u64 {
        let rays = self.triangles(pass, area);
        if T::SPHERES { rays + self.spheres(pass, area) } else { rays }
    }

    /// Computes the light of the pixels that show spheres, one by one, and returns the number of rays.
    fn spheres<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>, area: &Area) -> u64 {
        let mut rays = 0;
        for (place, pixel) in area.pixels().filter(|(_, pixel)| is_lit(pass, *pixel)) {
            let Some(id) = pass.triangle(pixel).filter(|id| pass.sphere(*id).is_some()) else { continue };
            let is_dark = match light_at(pass, id, &pass.point_at(pixel, id)) {
                Light::Certain(share) => share == SHADOWED,
                Light::Lifted(lifted) => pass.light_at_lifted(&lifted, &mut rays) == SHADOWED,
                Light::Ray(origin) => {
                    rays += 1;
                    !pass.sees_light(origin, |hit| pass.covers(hit))
                }
            };
            let (part, lane) = part_of(place);
            self.dark[part] |= u16::from(is_dark) << lane;
        }
        rays
    }

    /// Computes the light of the pixels that show triangles, and returns the number of rays.
    fn triangles<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>, area: &Area) -> u64 {
        (self.dark, self.turned) = ([0; PARTS], [0; PARTS]);
        self.places.clear();
        let simd = Detected::cached();
        let is_sketched = pass.tracer.decides() && simd.run(Draw { sketch: &mut self.sketch, pass, area });
        let mut rays = 0;
        if is_sketched {
            rays += self.decide(pass, area);
        } else {
            simd.run(Collect { shown: &mut self.shown, pass, area });
        }
        if self.shown.len() <= FEW {
            return rays + self.one_by_one(pass) + self.lift(pass, area);
        }
        simd.run(Rays { tile: self, pass });
        let packets = &self.packets[..self.places.len()];
        self.blocked.clear();
        self.blocked.resize(packets.len(), 0);
        let accept = |_, hit: &Hit| pass.covers(hit);
        if is_sketched {
            pass.tracer.occluded_undecided(packets, &mut self.blocked, accept);
        } else {
            pass.tracer.occluded_packets(packets, &mut self.blocked, accept);
        }
        for ((packet, places), blocked) in packets.iter().zip(&self.places).zip(&self.blocked) {
            rays += u64::from(packet.active.count_ones());
            darken(&mut self.dark, places, packet.active & blocked);
        }
        rays + self.lift(pass, area)
    }

    /// Lights the pixels whose triangle faces away from the light although the round surface that it approximates does not. Returns the number of
    /// rays.
    fn lift<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>, area: &Area) -> u64 {
        let mut rays = 0;
        if pass.job.scene.geometry.normals.is_empty() {
            return rays;
        }
        for (part, mut turned) in self.turned.into_iter().enumerate() {
            let (left, top) = corner_of(part);
            while turned != 0 {
                let lane = turned.trailing_zeros() as usize % PACKET;
                turned &= turned - 1;
                let pixel = (area.y + top + lane / PART) * area.stride + area.x + left + lane % PART;
                let (triangle, stored) = (pass.job.triangle[pixel], Vec4::from_array(pass.job.position[pixel]));
                if let Light::Lifted(lifted) = light_at(pass, triangle, &pass.point_of(triangle, stored.truncate()))
                    && pass.light_at_lifted(&lifted, &mut rays) != SHADOWED
                {
                    self.dark[part] &= !(1 << lane);
                }
            }
        }
        rays
    }

    /// Computes the light of few pixels, one by one, and returns the number of rays.
    fn one_by_one<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>) -> u64 {
        let mut rays = 0;
        for (place, pixel, triangle) in self.shown.iter() {
            let stored = Vec4::from_array(pass.job.position[pixel]).truncate();
            let (part, lane) = part_of(place);
            let is_dark = match light_at(pass, triangle, &pass.point_of(triangle, stored)) {
                Light::Certain(share) => share == SHADOWED,
                Light::Lifted(_) => {
                    self.turned[part] |= 1 << lane;
                    true
                }
                Light::Ray(origin) => {
                    rays += 1;
                    !pass.sees_light(origin, |hit| pass.covers(hit))
                }
            };
            self.dark[part] |= u16::from(is_dark) << lane;
        }
        rays
    }

    /// Sets the light of the pixels for which the tile's sketch decides it with certainty, and puts all other lit pixels into `shown`.
    /// Returns the number of rays that these decisions replace.
    fn decide<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>, area: &Area) -> u64 {
        let Self { dark, turned, sketch, decided, shown, .. } = self;
        *turned = sketch.dark;
        if sketch.is_of_use {
            pass.tracer.decide(&sketch.estimates, decided);
        } else {
            decided.clear();
        }
        shown.clear();
        let mut rays = 0;
        for (part, dark) in dark.iter_mut().enumerate() {
            let (left, top) = corner_of(part);
            let certain = decided.stopped[part] | decided.open[part];
            rays += u64::from(certain.count_ones());
            *dark = sketch.dark[part] | decided.stopped[part];
            let mut rest = sketch.shown[part] & !(sketch.dark[part] | certain);
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize % PACKET;
                rest &= rest - 1;
                let (x, y) = (left + lane % PART, top + lane / PART);
                let pixel = (area.y + y) * area.stride + area.x + x;
                shown.push(y * TILE + x, pixel, sketch.estimates.triangle[part][lane]);
            }
        }
        rays
    }

    /// Writes the light's share of all pixels.
    pub(super) fn write(&self, rows: &mut [&mut [[f32; 4]]; TILE]) {
        Detected::cached().run(Write { dark: &self.dark, rows });
    }
}

struct Write<'a, 'o> {
    dark: &'a [u16; PARTS],
    rows: &'a mut [&'o mut [[f32; 4]]; TILE],
}

impl Kernel<()> for Write<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let shares = [1.0, SHADOWED].map(|share| {
            let mut shares = F16([share; PACKET]);
            for share in shares.0.iter_mut().skip(3).step_by(4) {
                *share = 1.0;
            }
            shares
        });
        let (lit, dark) = (simd.wide_load(&shares[0]), simd.wide_load(&shares[1]));
        for (part, pixels) in self.dark.iter().enumerate() {
            let (left, top) = corner_of(part);
            for row in 0..PART {
                let pixels = usize::from(pixels >> (row * PART) & 0xf);
                let values = simd.wide_store(simd.wide_select(COMPONENTS[pixels], dark, lit));
                let out: &mut [f32] = bytemuck::cast_slice_mut(&mut self.rows[top + row][..]);
                // Parts of the tile beyond the image's border have no pixels.
                match out.get_mut(4 * left..4 * (left + PART)) {
                    Some(out) => out.copy_from_slice(&values.0),
                    None => out.iter_mut().skip(4 * left).zip(values.0).for_each(|(out, value)| *out = value),
                }
            }
        }
    }
}

/// For each mask of four pixels, the mask of their sixteen components.
const COMPONENTS: [Mask; 16] = {
    let mut components = [0; 16];
    let mut pixels = 0;
    while pixels < 16 {
        let spread = (pixels & 1) | (pixels & 2) << 3 | (pixels & 4) << 6 | (pixels & 8) << 9;
        components[pixels] = spread as Mask * 0xf;
        pixels += 1;
    }
    components
};

/// Puts the pixels of some lanes into shadow.
fn darken(dark: &mut [u16; PARTS], places: &[u8; PACKET], mut lanes: u16) {
    while lanes != 0 {
        let (part, lane) = part_of(usize::from(places[lanes.trailing_zeros() as usize % PACKET]));
        dark[part] |= 1 << lane;
        lanes &= lanes - 1;
    }
}

/// Finds the pixels of a tile on which light falls.
struct Collect<'a, T, C> {
    shown: &'a mut VisiblePixels,
    pass: &'a Pass<'a, T, C>,
    area: &'a Area,
}

impl<T: Tracer, C: Coverage> Kernel<()> for Collect<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { shown, pass, area } = self;
        shown.collect(simd, (pass, *area), |pixel, id| pass.sphere(id).is_none() && is_lit(pass, pixel), |_| ());
    }
}

/// The SIMD kernel that prepares the rays of a tile.
struct Rays<'a, T, C> {
    tile: &'a mut Tile,
    pass: &'a Pass<'a, T, C>,
}

impl<T: Tracer, C: Coverage> Kernel<()> for Rays<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tile, pass } = self;
        for lanes in tile.shown.sixteens() {
            let index = tile.places.len();
            if index == tile.packets.len() {
                tile.packets.push(Packet::new(0.0, f32::INFINITY));
            }
            let packet = &mut tile.packets[index];
            let Sides { mut dark, doubtful } = lanes.prepare(simd, pass.job, &pass.to_light, packet);
            if doubtful & lanes.used != 0 {
                dark = lanes.settle(pass, packet, dark, doubtful);
            }
            darken(&mut tile.dark, lanes.places, lanes.used & dark);
            darken(&mut tile.turned, lanes.places, lanes.used & dark);
            packet.active = lanes.used & !dark;
            if packet.active != 0 {
                tile.places.push(*lanes.places);
            }
        }
    }
}

/// One bit a pixel.
struct Sides {
    /// Pixels whose triangle faces away from the light.
    dark: u16,
    /// Pixels for which `dark` or the ray's origin is uncertain.
    doubtful: u16,
}

impl Sixteen<'_> {
    /// Computes the origins of rays to the light, and puts the rays into a packet.
    #[inline(always)]
    fn prepare<S: Simd>(&self, simd: S, job: &RayJob<'_>, to_light: &Vec3, packet: &mut Packet) -> Sides {
        // A copy, because the compiler must assume that `packet` may alias `to_light`. Copied by component, because a
        // load of the whole vector may stall on the stores of its parts.
        let light = Vec3::new(to_light.x, to_light.y, to_light.z);
        let geometry = &job.scene.geometry;
        let vertices = vertices(simd, &geometry.triangles, self.triangles);
        let stored = simd.gather(job.position, self.pixels);
        let corners = at_vertices(simd, &geometry.positions, &vertices);
        let normals = (!geometry.normals.is_empty()).then(|| at_vertices(simd, &geometry.normals, &vertices));
        let (mut dark, mut doubtful) = (0, 0);
        for half in 0..2 {
            let points = SurfacePoints::snap(&corners, &stored, half);
            let normal = points.normals(simd);
            let (above, below) = match &normals {
                Some(corners) => sides_of_corners(simd, normal, corners, half),
                None => {
                    let [x, y, z] = points.positions(simd);
                    let [eye_x, eye_y, eye_z] = [simd.splat(job.eye.x), simd.splat(job.eye.y), simd.splat(job.eye.z)];
                    let to_eye = [simd.sub(eye_x, x), simd.sub(eye_y, y), simd.sub(eye_z, z)];
                    signs(simd, dot(simd, normal, to_eye))
                }
            };
            let towards = dot(simd, normal, [simd.splat(light.x), simd.splat(light.y), simd.splat(light.z)]);
            let zero = simd.splat(0.0);
            let turned = above & simd.at_most(towards, zero) | below & simd.at_most(zero, towards);
            dark |= turned << (half * LANES);
            doubtful |= (!(above | below) & ALL | points.near(simd)) << (half * LANES);
            for lane in 0..LANES {
                let origin = points.point(lane).spawn(light);
                packet.origin[0][half * LANES + lane] = origin.x;
                packet.origin[1][half * LANES + lane] = origin.y;
                packet.origin[2][half * LANES + lane] = origin.z;
            }
        }
        for (axis, direction) in packet.direction.iter_mut().zip([light.x, light.y, light.z]) {
            *axis = [direction; PACKET];
        }
        Sides { dark: dark as u16, doubtful: doubtful as u16 }
    }

    /// Computes the doubtful pixels one by one, and returns the mask of all dark pixels.
    #[cold]
    fn settle<T, C>(&self, pass: &Pass<'_, T, C>, packet: &mut Packet, mut dark: u16, doubtful: u16) -> u16
    where
        T: Tracer,
        C: Coverage,
    {
        for lane in (0..PACKET).filter(|lane| (doubtful & self.used) >> lane & 1 == 1) {
            let (triangle, stored) = (self.triangles[lane], pass.job.position[self.pixels[lane] as usize]);
            let point = pass.point_of(triangle, Vec4::from_array(stored).truncate());
            dark &= !(1 << lane);
            match light_at(pass, triangle, &point) {
                Light::Certain(_) | Light::Lifted(_) => dark |= 1 << lane,
                Light::Ray(origin) => packet.set(lane, origin, pass.to_light),
            }
        }
        dark
    }
}
