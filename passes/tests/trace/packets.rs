//! Packets of rays against the same rays traced one by one: all answers agree bit for bit.

use crate::trace_scenes::{Random, SETS, accepts, bits, bounds, geometry, quads, soup, terrain};
use curitiba_passes::trace::{Bvh, PACKET, Packet, PacketHits, Quality, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;
use std::collections::BTreeSet;

fn scenes() -> Vec<(&'static str, Geometry)> {
    let mut random = Random::new(31);
    let mut twice = soup(300, 0.3, &mut random);
    twice.extend(twice.clone());
    let far: Vec<_> = soup(800, 0.2, &mut random).iter().map(|t| t.map(|p| p * 5.0 + Vec3::splat(1000.0))).collect();
    vec![
        (
            "soup, a third of it transparent",
            geometry(&[(0, soup(2000, 0.1, &mut random)), (1, soup(1000, 0.1, &mut random))]),
        ),
        ("large triangles", geometry(&[(1, soup(300, 1.0, &mut random))])),
        ("terrain", geometry(&[(0, terrain(60))])),
        ("axis-aligned quads", geometry(&[(0, quads(200, &mut random)), (1, quads(80, &mut random))])),
        ("every triangle twice", geometry(&[(0, twice)])),
        ("far from the origin", geometry(&[(0, far)])),
        ("nothing", geometry(&[])),
    ]
}

/// The centre of a scene, and half its size.
fn extent(geometry: &Geometry) -> (Vec3, Vec3) {
    let (low, high) = bounds(geometry);
    ((low + high) / 2.0, (high - low) / 2.0)
}

/// Rays from one point through a grid; with a wide field of view they go to every octant.
fn pinhole(geometry: &Geometry, fov: f32, packets: usize, random: &mut Random) -> Vec<Packet> {
    let (center, half) = extent(geometry);
    let eye = center + random.direction() * half * 1.3;
    let forward = (center + random.cube() * half * 0.2 - eye).normalize_or(Vec3::X);
    let right = forward.any_orthonormal_vector();
    let up = right.cross(forward);
    let side = (packets as f32).sqrt().ceil();
    (0..packets)
        .map(|index| {
            let mut packet = Packet::new(0.0, f32::INFINITY);
            for lane in 0..PACKET {
                let x = (index as f32 % side) * 4.0 + (lane % 4) as f32;
                let y = (index as f32 / side).floor() * 4.0 + (lane / 4) as f32;
                let [x, y] = [x, y].map(|k| (k + 0.5) / (4.0 * side) * 2.0 - 1.0);
                packet.set(lane, eye, (forward + right * x * fov + up * y * fov).normalize());
            }
            packet
        })
        .collect()
}

/// Rays in one direction from a patch; some lanes are idle.
fn parallel(geometry: &Geometry, direction: Vec3, packets: usize, random: &mut Random) -> Vec<Packet> {
    let (center, half) = extent(geometry);
    let corner = center + random.cube() * half;
    (0..packets)
        .map(|_| {
            let t_max = if random.below(3) == 0 { half.length() * random.unit() } else { f32::INFINITY };
            let t_min = if random.below(4) == 0 { half.length() * random.unit() * 0.2 } else { 0.0 };
            let mut packet = Packet::new(t_min, t_max);
            let near = corner + random.cube() * half * 0.2;
            for lane in 0..PACKET {
                if random.below(5) > 0 {
                    // Origins at integers make rays hit edges and corners of the quads.
                    let origin = near + random.cube() * half * 0.05;
                    let origin = if lane % 4 == 0 { origin.round() } else { origin };
                    packet.set(lane, origin, direction);
                }
            }
            packet
        })
        .collect()
}

/// Rays without anything in common, including rays that hit nothing.
fn scattered(geometry: &Geometry, packets: usize, random: &mut Random) -> Vec<Packet> {
    let (center, half) = extent(geometry);
    (0..packets)
        .map(|_| {
            let mut packet = Packet::new(0.0, f32::INFINITY);
            for lane in 0..PACKET {
                let origin = center + random.cube() * half;
                let direction = match random.below(12) {
                    0 => Vec3::ZERO,
                    1 => Vec3::new(f32::NAN, 1.0, 0.0),
                    2 => Vec3::X,
                    3 => Vec3::new(0.0, -1.0, 0.0),
                    _ => random.direction(),
                };
                packet.set(lane, if random.below(40) == 0 { Vec3::INFINITY } else { origin }, direction);
            }
            packet
        })
        .collect()
}

fn all_packets(geometry: &Geometry) -> Vec<Packet> {
    let mut random = Random::new(77);
    let mut packets = Vec::new();
    packets.extend(pinhole(geometry, 0.5, 16, &mut random));
    packets.extend(pinhole(geometry, 0.02, 16, &mut random));
    packets.extend(pinhole(geometry, 3.0, 40, &mut random));
    let tilted = Vec3::new(0.6, -0.39, 0.7).normalize();
    for direction in [tilted, Vec3::NEG_Y, Vec3::Z, Vec3::new(-0.6, 0.0, 0.8), Vec3::new(-0.0, -0.8, -0.6)] {
        packets.extend(parallel(geometry, direction, 20, &mut random));
    }
    packets.extend(scattered(geometry, 12, &mut random));
    packets
}

#[test]
fn packets_find_what_their_rays_find_one_by_one() {
    let (mut rays, mut met) = (0, 0);
    for (name, geometry) in scenes() {
        let packets = all_packets(&geometry);
        for lanes in SETS {
            let Some(bvh) = Bvh::build(&geometry, &[false, true], Quality::Balanced).with_instruction_set(lanes) else {
                continue;
            };
            let mut hits = vec![PacketHits::NONE; packets.len()];
            bvh.closest_packets(&packets, &mut hits, |_, hit| accepts(hit));
            let mut blocked = vec![u16::MAX; packets.len()];
            bvh.occluded_packets(&packets, &mut blocked, |_, hit| accepts(hit));
            for (index, packet) in packets.iter().enumerate() {
                for lane in 0..PACKET {
                    let active = packet.active >> lane & 1 == 1;
                    let alone = if active { bvh.closest(&packet.ray(lane), accepts) } else { None };
                    let place = format!("{name}, {lanes:?}, packet {index}, ray {lane}: {:?}", packet.ray(lane));
                    assert_eq!(hits[index].get(lane), alone, "{place}");
                    assert_eq!(blocked[index] >> lane & 1 == 1, alone.is_some(), "{place}");
                    rays += 1;
                    met += usize::from(alone.is_some());
                }
            }
        }
    }
    assert!(met > rays / 20 && met < rays, "the test saw hits and misses: {met} of {rays}");
}

#[test]
fn packets_show_every_transparent_hit_of_rays_that_nothing_stops() {
    let mut random = Random::new(5);
    let geometry = geometry(&[(1, soup(1500, 0.2, &mut random)), (0, soup(60, 0.2, &mut random))]);
    let packets = all_packets(&geometry);
    let bvh = Bvh::build(&geometry, &[false, true], Quality::Balanced);
    let crossings = crossings_as_alone(&bvh, &packets);
    assert!(crossings > 1000, "{crossings}");
}

/// Asserts that an unblocked ray of a packet is shown the same transparent hits as a single ray. Returns the number of hits.
pub fn crossings_as_alone(bvh: &Bvh, packets: &[Packet]) -> usize {
    let mut blocked = vec![0; packets.len()];
    let mut shown = vec![BTreeSet::new(); packets.len() * PACKET];
    bvh.occluded_packets(packets, &mut blocked, |ray, hit| {
        shown[ray].insert(bits(hit));
        false
    });
    let mut crossings = 0;
    for (index, packet) in packets.iter().enumerate() {
        for lane in packet.lanes().filter(|lane| blocked[index] >> lane & 1 == 0) {
            let mut alone = BTreeSet::new();
            let stopped = bvh.occluded(&packet.ray(lane), |hit| {
                alone.insert(bits(hit));
                false
            });
            assert!(!stopped);
            assert_eq!(shown[index * PACKET + lane], alone);
            crossings += alone.len();
        }
    }
    crossings
}

#[test]
fn the_comparison_notices_a_ray_that_is_left_out() {
    let geometry = geometry(&[(0, terrain(20))]);
    let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
    let mut packets = parallel(&geometry, Vec3::NEG_Y, 4, &mut Random::new(3));
    for packet in &mut packets {
        packet.origin = [[0.25; PACKET], [5.0; PACKET], [0.5; PACKET]];
        packet.direction = [[0.0; PACKET], [-1.0; PACKET], [0.0; PACKET]];
        (packet.t_min, packet.t_max, packet.active) = (0.0, f32::INFINITY, u16::MAX);
    }
    let mut before = vec![0; 4];
    bvh.occluded_packets(&packets, &mut before, |_, _| true);
    assert_eq!(before, [u16::MAX; 4], "rays from above hit the terrain");
    packets[2].active &= !(1 << 7);
    let mut after = vec![0; 4];
    bvh.occluded_packets(&packets, &mut after, |_, _| true);
    assert_eq!(after, [u16::MAX, u16::MAX, !(1 << 7), u16::MAX]);
}
