//! Rays of one direction, tile by tile, against the same rays traced one by one: with shared lists of triangles, and
//! where such lists are too long or useless.

use super::packets::crossings_as_alone;
use crate::trace_scenes::{Random, SETS, accepts, bounds, geometry, quads, soup, terrain};
use curitiba_passes::trace::{Bvh, PACKET, Packet, Quality, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

/// Number of packets in a tile.
const TILE: usize = 16;

type Triangles = Vec<[Vec3; 3]>;

/// Scenes of two materials, both moved and scaled in the same way.
fn scenes() -> Vec<(String, Geometry)> {
    let mut random = Random::new(8);
    let kinds: Vec<(&str, Triangles, Triangles)> = vec![
        ("soup", soup(1500, 0.15, &mut random), soup(500, 0.15, &mut random)),
        ("large triangles", soup(200, 1.0, &mut random), soup(100, 1.0, &mut random)),
        ("terrain", terrain(60), soup(60, 0.2, &mut random)),
        ("quads", quads(200, &mut random), quads(60, &mut random)),
        ("needles", needles(600, &mut random), needles(100, &mut random)),
    ];
    let mut scenes = Vec::new();
    for (name, opaque, glass) in kinds {
        for (scale, offset) in
            [(1.0, Vec3::ZERO), (2.0, Vec3::new(900.0, -40.0, 3000.0)), (3e-4, Vec3::ZERO), (5e4, Vec3::X)]
        {
            let place = |triangles: &Triangles| triangles.iter().map(|t| t.map(|p| p * scale + offset)).collect();
            let geometry = geometry(&[(0, place(&opaque)), (1, place(&glass))]);
            scenes.push((format!("{name}, times {scale}, at {offset}"), geometry));
        }
    }
    scenes.push((
        "coordinates that overflow the margins".into(),
        geometry(&[(0, vec![[Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 1e12)])]),
    ));
    scenes.push(("nothing".into(), geometry(&[])));
    scenes
}

/// Long and thin triangles, some without area.
fn needles(count: usize, random: &mut Random) -> Triangles {
    (0..count)
        .map(|index| {
            let (from, along) = (random.cube(), random.direction());
            let aside = random.cube() * [1e-2, 1e-4, 1e-7, 0.0][index % 4];
            [from, from + along, from + along * 0.5 + aside]
        })
        .collect()
}

/// Tiles of rays from a scene's surfaces, from corners of triangles, and from random places, within patches of several
/// sizes.
fn tiles(geometry: &Geometry, bvh: &Bvh, direction: Vec3, random: &mut Random) -> Vec<Packet> {
    let (low, high) = bounds(geometry);
    let (center, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let mut packets = Vec::new();
    for patch in [1.0, 0.2, 0.03, 0.003] {
        let middle = center + random.cube() * half * 0.7;
        let (t_min, t_max) = if random.below(3) == 0 { (0.0, half.length() * 0.3) } else { (0.0, f32::INFINITY) };
        let t_min = if random.below(6) == 0 { half.length() * 0.01 } else { t_min };
        for _ in 0..TILE {
            let mut packet = Packet::new(t_min, t_max);
            for lane in 0..PACKET {
                let near = middle + random.cube() * half * patch;
                let towards = Ray { origin: near, direction: random.direction(), t_min: 0.0, t_max: f32::INFINITY };
                let origin = match random.below(8) {
                    0 => continue,
                    1 => near,
                    2 if !geometry.positions.is_empty() => {
                        let corner = geometry.positions[random.below(geometry.positions.len())];
                        corner - direction * half.length() * random.unit() * 0.5
                    }
                    3 if random.below(20) == 0 => Vec3::new(near.x, f32::NAN, near.z),
                    _ => match bvh.closest(&towards, |_| true) {
                        Some(hit) => SurfacePoint::from_hit(geometry, &hit).spawn(direction),
                        None => near,
                    },
                };
                packet.set(lane, origin, direction);
            }
            packets.push(packet);
        }
    }
    packets
}

fn directions() -> [Vec3; 6] {
    [
        Vec3::new(0.5, 0.7, -0.3).normalize(),
        Vec3::new(-0.9, 0.1, 0.2).normalize(),
        Vec3::Y,
        Vec3::new(-0.0, 0.0, -1.0),
        Vec3::new(0.6, -0.0, 0.8),
        Vec3::new(1.0, 1.0, 1.0).normalize(),
    ]
}

#[test]
fn rays_of_one_direction_find_together_what_they_find_one_by_one() {
    let (mut rays, mut met) = (0, 0);
    for (name, geometry) in scenes() {
        for lanes in SETS {
            let Some(bvh) = Bvh::build(&geometry, &[false, true], Quality::Balanced).with_instruction_set(lanes) else {
                continue;
            };
            let mut random = Random::new(21);
            for direction in directions() {
                let packets = tiles(&geometry, &bvh, direction, &mut random);
                for (tile, packets) in packets.chunks(TILE).enumerate() {
                    let mut blocked = [u16::MAX; TILE];
                    bvh.occluded_packets(packets, &mut blocked, |_, hit| accepts(hit));
                    for (index, packet) in packets.iter().enumerate() {
                        for lane in 0..PACKET {
                            let active = packet.active >> lane & 1 == 1;
                            let alone = active && bvh.occluded(&packet.ray(lane), accepts);
                            let ray = packet.ray(lane);
                            let together = blocked[index] >> lane & 1 == 1;
                            assert_eq!(
                                together, alone,
                                "{name}, {lanes:?}, tile {tile}, packet {index}, lane {lane}: {ray:?}"
                            );
                            rays += usize::from(active);
                            met += usize::from(alone);
                        }
                    }
                }
            }
        }
    }
    assert!(met > rays / 20 && met < rays - rays / 20, "the test saw hits and misses: {met} of {rays}");
}

#[test]
fn rays_of_one_direction_are_shown_every_transparent_hit_where_nothing_stops_them() {
    let mut random = Random::new(5);
    let geometry = geometry(&[(1, soup(1500, 0.1, &mut random)), (0, soup(60, 0.2, &mut random))]);
    let bvh = Bvh::build(&geometry, &[false, true], Quality::Balanced);
    let mut crossings = 0;
    for direction in directions() {
        for packets in tiles(&geometry, &bvh, direction, &mut random).chunks(TILE) {
            crossings += crossings_as_alone(&bvh, packets);
        }
    }
    assert!(crossings > 1000, "{crossings}");
}
