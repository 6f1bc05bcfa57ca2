//! The plan of the town: which houses stand where.

use super::cafe;
use super::detail::Detail;
use super::house::{Ground, House};
use super::math::{Random, hash};
use super::mesh::{Builder, Frame};
use super::roof::{self, Slope};
use super::surface::Surface;
use glam::Vec3;

/// Frame at the left end of the cafe's facade, as seen from the square. A viewer who looks along the facade has the fountain
/// almost straight ahead, so the pane mirrors the fountain at a grazing angle.
pub(super) fn cafe_frame() -> Frame {
    Frame::facing(Vec3::new(-1.0, 0.0, -15.0), Vec3::new(0.7373, 0.0, -0.6756))
}

/// Plan of a house: width, bays, storeys, wall, paint, ground floor, roof and balconies.
type Plan = (f32, u32, &'static [f32], Surface, Surface, Ground, roof::Kind, &'static [usize]);

use Ground::{Arcade, Cafe, Home, Shops};
use Surface::{Glazed, PaintGreen, PaintRed, PaintWhite, PlasterCream, PlasterOchre, PlasterRose, PlasterWhite};
use roof::Kind::{Gable, Hip};

const FAR: &[Plan] = &[
    (9.2, 4, &[3.6, 3.2, 3.0], PlasterOchre, PaintWhite, Home, Gable, &[1]),
    (15.6, 5, &[4.6, 3.6], PlasterWhite, PaintGreen, Arcade, Hip, &[1]),
    (7.2, 3, &[3.5, 3.2, 2.9], Glazed, PaintWhite, Shops, Gable, &[1, 2]),
    (9.6, 4, &[3.6, 3.3], PlasterRose, PaintWhite, Home, Gable, &[]),
    (8.4, 3, &[3.7, 3.3, 3.1], PlasterCream, PaintRed, Shops, Gable, &[1]),
];

const LEFT: &[Plan] = &[
    (9.4, 4, &[3.5, 3.2], PlasterCream, PaintGreen, Home, Gable, &[]),
    (8.2, 3, &[3.6, 3.3, 3.0], PlasterWhite, PaintRed, Shops, Gable, &[1]),
    (10.2, 4, &[3.7, 3.4], PlasterRose, PaintWhite, Home, Gable, &[1]),
    (7.4, 3, &[3.6, 3.2, 2.8], PlasterWhite, PaintGreen, Shops, Gable, &[2]),
    (10.0, 4, &[3.8, 3.3], PlasterOchre, PaintWhite, Shops, Hip, &[1]),
];

const RIGHT: &[Plan] = &[
    (9.0, 4, &[3.6, 3.1], PlasterWhite, PaintGreen, Home, Gable, &[]),
    (8.0, 3, &[3.5, 3.2, 2.4], PlasterOchre, PaintWhite, Shops, Gable, &[1]),
    (10.4, 4, &[3.6, 3.3], PlasterRose, PaintWhite, Home, Hip, &[]),
];

const NEAR: &[Plan] = &[
    (9.6, 4, &[3.6, 3.2], PlasterWhite, PaintGreen, Shops, Gable, &[]),
    (8.0, 3, &[3.6, 3.2, 2.6], PlasterOchre, PaintWhite, Home, Gable, &[]),
    (9.2, 4, &[3.6, 3.0], PlasterRose, PaintWhite, Shops, Gable, &[]),
];

const CAFE: &[Plan] = &[
    (cafe::WIDTH, 4, &[3.9, 3.1], PlasterCream, PaintGreen, Cafe, Hip, &[]),
    (8.6, 3, &[3.6, 3.2], PlasterWhite, PaintRed, Home, Gable, &[]),
    (9.2, 4, &[3.5, 3.0], PlasterOchre, PaintWhite, Shops, Gable, &[]),
];

/// Houses side by side that face `outward`. `start` is the left end of the row, as seen from outside.
fn row(start: Vec3, outward: Vec3, plans: &[Plan], depth: f32, seed: u32) -> Vec<House> {
    let mut frame = Frame::facing(start, outward);
    let mut houses = Vec::new();
    for (index, &(width, bays, storeys, wall, paint, ground, roof, balconies)) in plans.iter().enumerate() {
        let house = House {
            frame,
            width,
            depth,
            storeys: storeys.to_vec(),
            bays,
            wall,
            paint,
            ground,
            roof,
            balconies: balconies.to_vec(),
            seed: hash(seed, index as u32, 0x40) & 0xffff,
        };
        // The next house adjoins this one, also under the projecting eaves of a hipped roof.
        frame = frame.moved(width, 0.0, 0.0);
        houses.push(house);
    }
    houses
}

/// The houses around the square.
fn square_houses() -> Vec<House> {
    let mut houses = row(Vec3::new(46.6, 0.0, 34.0), Vec3::NEG_Z, FAR, 9.0, 1);
    houses.extend(row(Vec3::new(52.0, 0.0, -18.6), Vec3::NEG_X, LEFT, 9.0, 2));
    houses.extend(row(Vec3::new(-3.4, 0.0, 29.5), Vec3::X, RIGHT, 9.0, 3));
    let start = cafe_frame();
    houses.extend(row(start.origin, start.z, CAFE, 9.0, 4));
    houses
}

/// Houses in the streets behind, seen only above the others.
fn back_houses(rows: usize) -> Vec<House> {
    let mut random = Random::new(0xbac);
    let walls = [PlasterWhite, PlasterCream, PlasterWhite, PlasterOchre, PlasterRose, PlasterWhite];
    let mut houses = Vec::new();
    let mut place = |x: f32, z: f32, outward: Vec3, random: &mut Random| {
        let width = random.between(9.0, 13.0);
        let storeys = [3.6, random.between(2.8, 3.4), if random.chance(0.45) { 2.7 } else { 0.6 }];
        houses.push(House {
            frame: Frame::facing(Vec3::new(x + random.between(-1.0, 1.0), 0.0, z + random.between(-1.5, 1.5)), outward),
            width,
            depth: random.between(7.5, 8.8),
            storeys: if storeys[2] > 1.0 { storeys.to_vec() } else { storeys[..2].to_vec() },
            bays: 3,
            wall: walls[(random.unit() * 6.0) as usize % 6],
            paint: PaintWhite,
            ground: Ground::Hidden,
            roof: if random.chance(0.4) { Hip } else { Gable },
            balconies: Vec::new(),
            seed: (random.unit() * 60_000.0) as u32,
        });
    };
    for row in 0..rows {
        let z = 53.0 + 15.5 * row as f32;
        for column in 0..8 {
            let x = -14.0 + 15.0 * column as f32 + if row % 2 == 1 { 6.0 } else { 0.0 };
            // The church stands here.
            if (55.0..92.0).contains(&x) && z > 50.0 && z < 92.0 {
                continue;
            }
            place(x, z, Vec3::NEG_Z, &mut random);
        }
    }
    for row in 0..rows {
        for column in 0..4 {
            let (x, z) = (70.0 + 15.5 * row as f32, -30.0 + 15.5 * column as f32);
            place(x, z, Vec3::NEG_X, &mut random);
        }
    }
    houses
}

/// Builds all houses and the church, without the slopes of their roofs, which it returns.
pub(super) fn build(builder: &mut Builder, detail: Detail) -> Vec<Slope> {
    let mut slopes = Vec::new();
    for house in square_houses() {
        slopes.extend(house.build(builder, detail));
    }
    // These houses are seen only from afar, from behind or over other roofs.
    for house in row(Vec3::new(16.5, 0.0, -36.5), Vec3::Z, NEAR, 9.0, 5) {
        slopes.extend(house.build(builder, detail.lower()));
    }
    for house in back_houses(if detail.at_least(1) { 3 } else { 2 }) {
        slopes.extend(house.build(builder, detail));
    }
    let church = Frame::facing(Vec3::new(80.0, 0.0, 57.0), Vec3::new(-0.35, 0.0, -1.0));
    slopes.extend(super::church::build(builder, &church, detail));
    slopes
}
