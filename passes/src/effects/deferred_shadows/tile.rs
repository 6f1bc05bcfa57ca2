//! The light of a tile's pixels, found out together: where their rays start is computed sixteen pixels at a time, by the
//! operations of a single pixel, and the rays go down the tree as packets.

use super::corrected::{CLEARLY, Light, is_lit, light_at};
use crate::effects::lights::Area;
use crate::effects::occlusion::SHADOWED;
use crate::effects::shown::{PIXELS, Shown, Sixteen};
use crate::effects::{Coverage, Pass};
use crate::trace::{Detected, LANES, Mask, PACKET, Packet, Points, Simd, Tracer, Work, at_vertices, half_of, vertices};
use curitiba_pipeline::backend::RayJob;
use glam::{Vec3, Vec4};

/// What is known of a tile, and the buffers that it takes to find out.
#[derive(Debug, Default)]
pub struct Tile {
    /// The light's share by place; empty where pixels are computed one by one.
    share: Vec<f32>,
    shown: Shown,
    /// Those of the tile come first.
    packets: Vec<Packet>,
    /// The place of each ray.
    places: Vec<[u8; PACKET]>,
    blocked: Vec<u16>,
}

impl Tile {
    /// The light's share at a place of the tile, if the tile was looked at.
    #[inline(always)]
    pub(super) fn share(&self, place: usize) -> Option<f32> {
        self.share.get(place).copied()
    }

    /// Finds out the light of a tile's pixels, and returns the number of rays that it took.
    pub(super) fn prepare<T: Tracer, C: Coverage>(&mut self, pass: &Pass<'_, T, C>, area: Area) -> u64 {
        self.share.clear();
        self.share.resize(PIXELS, 1.0);
        self.places.clear();
        Detected::cached().run(Rays { tile: self, pass, area });
        let packets = &self.packets[..self.places.len()];
        self.blocked.clear();
        self.blocked.resize(packets.len(), 0);
        pass.tracer.occluded_packets(packets, &mut self.blocked, |_, hit| pass.coverage.covers(hit));
        let mut rays = 0;
        for ((packet, places), blocked) in packets.iter().zip(&self.places).zip(&self.blocked) {
            rays += u64::from(packet.active.count_ones());
            darken(&mut self.share, places, packet.active & blocked);
        }
        rays
    }
}

/// Puts the pixels of some lanes into shadow.
fn darken(share: &mut [f32], places: &[u8; PACKET], mut lanes: u16) {
    while lanes != 0 {
        share[usize::from(places[lanes.trailing_zeros() as usize])] = SHADOWED;
        lanes &= lanes - 1;
    }
}

/// What prepares the rays of a tile.
struct Rays<'a, T, C> {
    tile: &'a mut Tile,
    pass: &'a Pass<'a, T, C>,
    area: Area,
}

impl<T: Tracer, C: Coverage> Work<()> for Rays<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tile, pass, area } = self;
        tile.shown.collect(simd, (pass, area), |pixel, _| is_lit(pass, pixel), |_| ());
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
            darken(&mut tile.share, lanes.places, lanes.used & dark);
            packet.active = lanes.used & !dark;
            if packet.active != 0 {
                tile.places.push(*lanes.places);
            }
        }
    }
}

/// One bit a pixel.
struct Sides {
    /// Those whose triangle is turned away from the light.
    dark: u16,
    /// Those of whom that, or where their rays start, is not certain.
    doubtful: u16,
}

impl Sixteen<'_> {
    /// Finds where rays to the light start, and puts them into a packet.
    #[inline(always)]
    fn prepare<S: Simd>(&self, simd: S, job: &RayJob<'_>, to_light: &Vec3, packet: &mut Packet) -> Sides {
        // A copy, since what is written might else be what it is read from; by parts, since a whole may have to be waited for.
        let light = Vec3::new(to_light.x, to_light.y, to_light.z);
        let geometry = &job.scene.geometry;
        let vertices = vertices(simd, &geometry.triangles, self.triangles);
        let stored = simd.gather(job.position, self.pixels);
        let corners = at_vertices(simd, &geometry.positions, &vertices);
        let normals = (!geometry.normals.is_empty()).then(|| at_vertices(simd, &geometry.normals, &vertices));
        let (mut dark, mut doubtful) = (0, 0);
        for half in 0..2 {
            let points = Points::snap(&corners, &stored, half);
            let normal = points.normals(simd);
            let (above, below) = match &normals {
                Some([a, b, c]) => {
                    let (above_a, below_a) = sides(simd, normal, half_of(simd, a, half));
                    let (above_b, below_b) = sides(simd, normal, half_of(simd, b, half));
                    let (above_c, below_c) = sides(simd, normal, half_of(simd, c, half));
                    (above_a & above_b & above_c, below_a & below_b & below_c)
                }
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

    /// Looks at the doubtful pixels one by one, and returns all that are dark.
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
                Light::Certain(_) => dark |= 1 << lane,
                Light::Ray(origin) => packet.set(lane, origin, pass.to_light),
            }
        }
        dark
    }
}

/// The lanes of eight.
const ALL: Mask = (1 << LANES) - 1;

/// As [`Vec3::dot`].
#[inline(always)]
fn dot<S: Simd>(simd: S, [ax, ay, az]: [S::Vector; 3], [bx, by, bz]: [S::Vector; 3]) -> S::Vector {
    simd.add(simd.add(simd.mul(ax, bx), simd.mul(ay, by)), simd.mul(az, bz))
}

/// The lanes above 0, and those below.
#[inline(always)]
fn signs<S: Simd>(simd: S, a: S::Vector) -> (Mask, Mask) {
    let zero = simd.splat(0.0);
    let (not_above, not_below) = (simd.at_most(a, zero), simd.at_most(zero, a));
    (not_below & !not_above, not_above & !not_below)
}

/// Where the normal at a corner is clearly on the side of the triangle's normal, and where on the other.
#[inline(always)]
fn sides<S: Simd>(simd: S, normal: [S::Vector; 3], corner: [S::Vector; 3]) -> (Mask, Mask) {
    let cosine = dot(simd, normal, corner);
    let least = simd.mul(simd.splat(CLEARLY), simd.max_or(dot(simd, corner, corner), simd.splat(1.0)));
    let opposite = simd.sub(simd.splat(0.0), cosine);
    let above = simd.at_most(least, cosine) & !simd.at_most(cosine, least);
    (above, simd.at_most(least, opposite) & !simd.at_most(opposite, least))
}
