//! The sets of rays, and the ways in which both sides trace them.

use crate::api::Scene;
use crate::flush::Flush;
use crate::layout::StreamBuffer;
use crate::scenes::Subject;
use curitiba::passes::effects::{Area, Pixel, TILE};
use curitiba::passes::sampling::hash::{self, pixel_key};
use curitiba::passes::sampling::hemisphere::{Basis, cosine};
use curitiba::passes::trace::{Bvh, Candidates, Fan, Hit, PACKET, Packet, PacketHits, SurfacePoint, Tracer};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// The question that rays ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// The nearest hit.
    Closest,
    /// Whether the ray hits anything.
    Occluded,
    /// Whether each ray hits anything, for fans of rays from one origin.
    Fans,
}

/// A set of rays in packets, ordered by tile.
pub struct Rays {
    pub name: &'static str,
    pub question: Question,
    pub packets: Vec<Packet>,
    /// For fans: the hemisphere's normal, for each packet.
    pub above: Vec<Vec3>,
    /// For fans: the directions of each packet.
    pub directions: Vec<[Vec3; PACKET]>,
    /// End of each tile in `packets`.
    tiles: Vec<usize>,
    pub count: u64,
}

impl Rays {
    fn new(name: &'static str, question: Question) -> Self {
        Self {
            name,
            question,
            packets: Vec::new(),
            above: Vec::new(),
            directions: Vec::new(),
            tiles: Vec::new(),
            count: 0,
        }
    }

    fn push(&mut self, packet: Packet) {
        if packet.active != 0 {
            self.count += u64::from(packet.active.count_ones());
            self.packets.push(packet);
        }
    }

    fn push_fan(&mut self, packet: Packet, above: Vec3) {
        self.directions.push(std::array::from_fn(|lane| packet.ray(lane).direction));
        self.above.push(above);
        self.push(packet);
    }

    /// A packet as a fan.
    fn fan(&self, index: usize) -> Fan<'_> {
        let packet = &self.packets[index];
        let (origin, above) = (packet.ray(0).origin, Some(self.above[index]));
        Fan { origin, above, t_min: packet.t_min, t_max: packet.t_max, directions: &self.directions[index] }
    }

    fn end_tile(&mut self) {
        if self.tiles.last().copied().unwrap_or(0) < self.packets.len() {
            self.tiles.push(self.packets.len());
        }
    }

    /// The range of packets of each tile.
    fn ranges(&self) -> Vec<std::ops::Range<usize>> {
        let mut start = 0;
        self.tiles.iter().map(|&end| std::mem::replace(&mut start, end)..end).collect()
    }
}

/// Primary rays, shadow rays, and sixteen short and sixteen long occlusion rays from each pixel of every eighth tile.
pub fn generate(subject: &Subject, bvh: &Bvh, size: u32) -> Vec<Rays> {
    let view = &subject.view;
    let geometry = &subject.scene.geometry;
    let mut primary = Rays::new("primary", Question::Closest);
    let mut shadow = Rays::new("shadow", Question::Occluded);
    let mut short = Rays::new("occlusion short", Question::Fans);
    let mut long = Rays::new("occlusion long", Question::Fans);
    let low = geometry.positions.iter().fold(Vec3::INFINITY, |low, p| low.min(*p));
    let high = geometry.positions.iter().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
    let diagonal = (high - low).length();
    let side = size as usize / TILE;
    for tile in 0..side * side {
        let (x, y) = (tile % side * TILE, tile / side * TILE);
        let area = Area { x, y, width: TILE, height: TILE, stride: size as usize };
        let pixels: Vec<Pixel> = area.pixels().map(|(_, pixel)| pixel).collect();
        let mut shadows = Packet::new(0.0, f32::INFINITY);
        let mut filled = 0;
        for pixels in pixels.chunks(PACKET) {
            let mut packet = Packet::new(0.0, f32::INFINITY);
            for (lane, pixel) in pixels.iter().enumerate() {
                packet.set(lane, view.eye, view.direction(pixel.x, pixel.y, size));
            }
            primary.push(packet);
            for (lane, pixel) in pixels.iter().enumerate() {
                let ray = packet.ray(lane);
                let Some(hit) = bvh.closest(&ray, |_| true) else { continue };
                let point = SurfacePoint::from_hit(geometry, &hit);
                let facing = if point.normal.dot(ray.direction) > 0.0 { -point.normal } else { point.normal };
                if facing.dot(view.to_light) > 0.0 {
                    shadows.set(filled, point.spawn(view.to_light), view.to_light);
                    filled += 1;
                    if filled == PACKET {
                        shadow.push(std::mem::replace(&mut shadows, Packet::new(0.0, f32::INFINITY)));
                        filled = 0;
                    }
                }
                if tile % 8 == 0 {
                    let key = pixel_key(pixel.x, pixel.y, 0);
                    let origin = point.spawn(facing);
                    let mut fan = Packet::new(0.0, view.radius);
                    for (sample, direction) in directions(key, facing).into_iter().enumerate() {
                        fan.set(sample, origin, direction);
                    }
                    short.push_fan(fan, facing);
                    long.push_fan(Packet { t_max: diagonal, ..fan }, facing);
                }
            }
        }
        shadow.push(shadows);
        for rays in [&mut primary, &mut shadow, &mut short, &mut long] {
            rays.end_tile();
        }
    }
    vec![primary, shadow, short, long]
}

/// Sixteen cosine-distributed directions: one jittered direction in each cell of a 4 x 4 grid.
fn directions(key: u32, normal: Vec3) -> [Vec3; PACKET] {
    let basis = Basis::around(normal);
    std::array::from_fn(|sample| {
        let [x, y] = hash::dimensions(key, sample as u32).map(hash::unit);
        let cell = Vec2::new((sample % 4) as f32 + x, (sample / 4) as f32 + y) / 4.0;
        let direction = basis.to_world(cosine(cell.min(Vec2::splat(1.0 - f32::EPSILON))));
        direction - 2.0 * direction.dot(normal).min(0.0) * normal
    })
}

/// A way of tracing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Single,
    /// Ours: fans of rays from one origin.
    Fans,
    /// Ours: fans; where few triangles are near 16 fans, these triangles are gathered once.
    Near,
    /// Sixteen rays in one call (ours: sixteen packets in one call).
    Packets {
        coherent: bool,
    },
    /// Embree 3: all rays of a tile as one stream.
    Stream {
        coherent: bool,
    },
}

impl Mode {
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Fans => "fans",
            Self::Near => "fans near each other",
            Self::Packets { coherent: true } => "packets, coherent",
            Self::Packets { coherent: false } => "packets",
            Self::Stream { coherent: true } => "stream, coherent",
            Self::Stream { coherent: false } => "stream",
        }
    }
}

/// The receiver of hits: counts them in timed runs, keeps them in comparisons.
pub trait Sink: Sync {
    fn count(&self, packet: usize, lane: usize, hit: Option<Hit>) -> u64;
    /// Tells how many rays of a fan are blocked.
    fn count_fan(&self, packet: usize, blocked: u32) -> u64;
}

/// Counts hits.
pub struct Count;

impl Sink for Count {
    #[inline(always)]
    fn count(&self, _: usize, _: usize, hit: Option<Hit>) -> u64 {
        u64::from(hit.is_some())
    }

    #[inline(always)]
    fn count_fan(&self, _: usize, blocked: u32) -> u64 {
        blocked.into()
    }
}

const BLOCKED: Hit = Hit { t: 0.0, triangle: 0, u: 0.0, v: 0.0 };

/// Traces with our tree on the current pool, and returns the number of rays that hit.
pub fn ours(rays: &Rays, bvh: &Bvh, mode: Mode, sink: &impl Sink) -> u64 {
    let trace = |candidates: &mut Candidates, range: std::ops::Range<usize>| {
        let packets = &rays.packets[range.clone()];
        let mut hits = 0;
        match (mode, rays.question) {
            (Mode::Packets { .. }, Question::Closest) => {
                let mut found = [PacketHits::NONE; PACKET];
                bvh.closest_packets(packets, &mut found[..packets.len()], |_, _| true);
                for (index, (packet, found)) in packets.iter().zip(&found).enumerate() {
                    for lane in packet.lanes() {
                        hits += sink.count(range.start + index, lane, found.get(lane));
                    }
                }
            }
            (Mode::Packets { .. }, _) => {
                for (chunk, packets) in packets.chunks(PACKET).enumerate() {
                    let mut blocked = [0; PACKET];
                    bvh.occluded_packets(packets, &mut blocked[..packets.len()], |_, _| true);
                    for (index, packet) in packets.iter().enumerate() {
                        for lane in packet.lanes() {
                            let hit = (blocked[index] >> lane & 1 == 1).then_some(BLOCKED);
                            hits += sink.count(range.start + chunk * PACKET + index, lane, hit);
                        }
                    }
                }
            }
            (Mode::Fans, _) => {
                for index in range.clone() {
                    hits += sink.count_fan(index, PACKET as u32 - bvh.count_open(&rays.fan(index), |_| true));
                }
            }
            (Mode::Near, _) => {
                let fans: Vec<Fan<'_>> = range.clone().map(|index| rays.fan(index)).collect();
                let mut open = vec![0; fans.len()];
                bvh.count_open_near(&fans, &mut open, candidates, |_, _| true);
                for (index, open) in range.clone().zip(open) {
                    hits += sink.count_fan(index, PACKET as u32 - open);
                }
            }
            (_, question) => {
                for (index, packet) in packets.iter().enumerate() {
                    for lane in packet.lanes() {
                        let ray = packet.ray(lane);
                        let hit = match question {
                            Question::Closest => bvh.closest(&ray, |_| true),
                            _ => bvh.occluded(&ray, |_| true).then_some(BLOCKED),
                        };
                        hits += sink.count(range.start + index, lane, hit);
                    }
                }
            }
        }
        hits
    };
    rays.ranges().into_par_iter().map_init(Candidates::default, trace).sum()
}

/// Traces with Embree on the current pool, and returns the number of rays that hit.
pub fn theirs(rays: &Rays, scene: &Scene, mode: Mode, sink: &impl Sink) -> u64 {
    let is_closest = rays.question == Question::Closest;
    let longest = rays.ranges().iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let trace = |buffer: &mut StreamBuffer, range: std::ops::Range<usize>| {
        let _flush = Flush::on();
        let packets = &rays.packets[range.clone()];
        let mut hits = 0;
        if let Mode::Stream { coherent } = mode {
            scene.stream(packets, coherent, is_closest, buffer, |ray, hit| {
                hits += sink.count(range.start + ray / PACKET, ray % PACKET, hit);
            });
            return hits;
        }
        for (index, packet) in packets.iter().enumerate() {
            let index = range.start + index;
            match mode {
                Mode::Packets { coherent } if is_closest => {
                    scene.closest16(
                        packet,
                        coherent,
                        |_, _| true,
                        |lane, hit| {
                            hits += sink.count(index, lane, Some(hit));
                        },
                    );
                }
                Mode::Packets { coherent } => {
                    let blocked = scene.occluded16(packet, coherent, |_, _| true);
                    for lane in packet.lanes() {
                        hits += sink.count(index, lane, (blocked >> lane & 1 == 1).then_some(BLOCKED));
                    }
                }
                _ => {
                    for lane in packet.lanes() {
                        let hit = if is_closest {
                            scene.closest(packet, lane, |_, _| true)
                        } else {
                            scene.occluded(packet, lane, |_, _| true).then_some(BLOCKED)
                        };
                        hits += sink.count(index, lane, hit);
                    }
                }
            }
        }
        hits
    };
    rays.ranges().into_par_iter().map_init(|| StreamBuffer::new(longest), trace).sum()
}

/// The numbers of rays with different answers.
#[derive(Debug, Clone, Copy, Default, serde::Serialize)]
pub struct Differences {
    /// One side hits and the other does not.
    pub hit: u64,
    /// Both hit, at distances that differ by more than 1e-4 of the distance.
    pub distance: u64,
    /// Both hit different triangles at distances that agree: shared edges and coincident triangles.
    pub triangle: u64,
}

/// Keeps the distance and the triangle of each ray.
pub struct Keep(Vec<std::sync::atomic::AtomicU64>);

impl Keep {
    pub fn new(rays: &Rays) -> Self {
        Self((0..rays.packets.len() * PACKET).map(|_| u64::MAX.into()).collect())
    }

    pub fn differences(&self, other: &Self) -> Differences {
        let mut found = Differences::default();
        for (a, b) in self.0.iter().zip(&other.0) {
            let [a, b] = [a, b].map(|value| value.load(std::sync::atomic::Ordering::Relaxed));
            if a == b {
                continue;
            }
            if a == u64::MAX || b == u64::MAX {
                found.hit += 1;
                continue;
            }
            let [s, t] = [a, b].map(|value| f32::from_bits((value >> 32) as u32));
            if (s - t).abs() > 1e-4 * s.abs().max(t.abs()) {
                found.distance += 1;
            } else if a as u32 != b as u32 {
                found.triangle += 1;
            }
        }
        found
    }
}

impl Keep {
    /// Number of rays that hit, for each packet.
    pub fn counts(&self) -> Vec<usize> {
        let hit = |value: &std::sync::atomic::AtomicU64| value.load(std::sync::atomic::Ordering::Relaxed) != u64::MAX;
        self.0.chunks(PACKET).map(|packet| packet.iter().filter(|value| hit(value)).count()).collect()
    }
}

impl Sink for Keep {
    fn count(&self, packet: usize, lane: usize, hit: Option<Hit>) -> u64 {
        let value = hit.map_or(u64::MAX, |hit| u64::from(hit.t.to_bits()) << 32 | u64::from(hit.triangle));
        self.0[packet * PACKET + lane].store(value, std::sync::atomic::Ordering::Relaxed);
        u64::from(hit.is_some())
    }

    /// A fan tells only how many rays are blocked, so the first rays are marked.
    fn count_fan(&self, packet: usize, blocked: u32) -> u64 {
        for lane in 0..blocked as usize {
            self.count(packet, lane, Some(BLOCKED));
        }
        blocked.into()
    }
}
