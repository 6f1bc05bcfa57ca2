//! Houses: walls, granite trim, the openings of each storey, and a roof.

use super::detail::Detail;
use super::facade::{self, Opening};
use super::math::Random;
use super::mesh::{Builder, Frame, Sides};
use super::opening;
use super::roof::{self, Slope};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// The kind of the ground floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ground {
    /// A door in one bay, windows in the others.
    Home,
    /// A door in every bay.
    Shops,
    /// Round arches before a covered walk.
    Arcade,
    /// The cafe with the large pane.
    Cafe,
    /// A house behind others: its ground floor is not seen.
    Hidden,
}

/// A house.
#[derive(Debug, Clone)]
pub(super) struct House {
    /// Left end of the facade on the ground, as seen from outside.
    pub frame: Frame,
    pub width: f32,
    pub depth: f32,
    /// Heights of the storeys, metres, the ground floor first.
    pub storeys: Vec<f32>,
    pub bays: u32,
    pub wall: Surface,
    pub paint: Surface,
    pub ground: Ground,
    pub roof: roof::Kind,
    /// Indices of the storeys whose windows open onto balconies; 0 is the ground floor.
    pub balconies: Vec<usize>,
    pub seed: u32,
}

impl House {
    /// Height of the eaves.
    pub(super) fn height(&self) -> f32 {
        self.storeys.iter().sum()
    }

    fn hidden(&self) -> bool {
        self.ground == Ground::Hidden
    }

    /// Builds the house without the slopes of its roof, which it returns.
    pub(super) fn build(&self, builder: &mut Builder, detail: Detail) -> Vec<Slope> {
        let mut random = Random::new(self.seed);
        let height = self.height();
        self.facade(builder, detail, &mut random);
        let sides = Sides::LEFT.and(Sides::RIGHT).and(Sides::BACK);
        let (low, high) = (Vec3::new(0.0, 0.0, -self.depth), Vec3::new(self.width, height, 0.0));
        builder.cuboid(self.wall, &self.frame, low, high, sides);
        self.trim(builder, detail);
        self.chimney(builder, detail, &mut random);
        let eaves = self.frame.moved(0.0, height, 0.0);
        let rise = 0.44 + 0.06 * random.unit();
        let size = [self.width, self.depth];
        let roof = roof::Roof { size, rise, kind: self.roof, wall: self.wall, seed: self.seed };
        roof::build(builder, &eaves, &roof, detail)
    }

    fn facade(&self, builder: &mut Builder, detail: Detail, random: &mut Random) {
        let bay = self.width / self.bays as f32;
        let arc = detail.curve(8);
        let center = |index: u32| bay * (index as f32 + 0.5);
        let mut openings = Vec::new();
        let mut windows = Vec::new();
        let mut doors = Vec::new();
        let mut floor = 0.0;
        for (storey, &height) in self.storeys.iter().enumerate() {
            let upper = storey > 0;
            let balcony = self.balconies.contains(&storey);
            for index in 0..self.bays {
                let x = center(index);
                if upper || self.hidden() {
                    if self.hidden() && storey + 1 < self.storeys.len() {
                        continue;
                    }
                    let bottom = floor + if balcony { 0.12 } else { 0.85 };
                    let opening = Opening::new(x, 1.08, bottom, floor + height.min(3.3) - 0.75);
                    windows.push((opening, !balcony));
                    openings.push(opening);
                    continue;
                }
                match self.ground {
                    Ground::Home if index != self.seed % self.bays => {
                        let opening = Opening::new(x, 1.08, 1.05, height - 0.72);
                        windows.push((opening, true));
                        openings.push(opening);
                    }
                    Ground::Home | Ground::Shops => {
                        let wide = if self.ground == Ground::Shops { (bay - 1.0).min(1.7) } else { 1.35 };
                        let top = height - 0.62;
                        let round = self.ground == Ground::Shops && self.seed.is_multiple_of(2);
                        let opening =
                            if round { Opening::arch(x, wide, 0.16, top) } else { Opening::new(x, wide, 0.16, top) };
                        doors.push(opening);
                        openings.push(opening);
                    }
                    Ground::Arcade => openings.push(Opening::arch(x, bay - 0.85, 0.0, height - 0.45)),
                    Ground::Cafe | Ground::Hidden => {}
                }
            }
            if balcony && upper {
                // One long balcony where the bays are narrow, else one for each window.
                let spans: Vec<[f32; 2]> = if bay < 2.2 {
                    vec![[center(0) - 0.95, center(self.bays - 1) + 0.95]]
                } else {
                    (0..self.bays).map(|index| [center(index) - 0.9, center(index) + 0.9]).collect()
                };
                for span in spans {
                    opening::balcony(builder, &self.frame, span, floor + 0.12, detail);
                }
            }
            floor += height;
        }
        if self.ground == Ground::Cafe {
            openings.extend(super::cafe::openings());
        }
        let size = Vec2::new(self.width, self.height());
        // Coarse windows and doors are laid onto the wall. Only arcades and the cafe have holes in it.
        let laid = !detail.at_least(if self.hidden() { 2 } else { 1 });
        if laid {
            openings.retain(|opening| !doors.contains(opening) && !windows.iter().any(|(window, _)| window == opening));
        }
        facade::wall(builder, self.wall, &self.frame, size, &openings, arc);
        for (opening, sill) in &windows {
            if laid && self.hidden() {
                builder.rectangle(Surface::Room, &self.frame, opening.min, opening.max, 0.03);
            } else {
                opening::window(builder, &self.frame, opening, self.paint, *sill, detail, random);
            }
        }
        for opening in &doors {
            opening::door(builder, &self.frame, opening, self.paint, detail);
        }
        match self.ground {
            Ground::Arcade => self.arcade(builder, detail, &openings),
            Ground::Cafe => super::cafe::build(builder, &self.frame, detail),
            _ => {}
        }
    }

    /// The covered walk behind the arches, with shop doors in its back wall.
    fn arcade(&self, builder: &mut Builder, detail: Detail, openings: &[Opening]) {
        const WALK: f32 = 3.4;
        const THICK: f32 = 0.55;
        let height = self.storeys[0] - 0.3;
        let arc = detail.curve(8);
        let arches: Vec<&Opening> = openings.iter().filter(|opening| opening.round).collect();
        for arch in &arches {
            facade::reveal(builder, Surface::Granite, &self.frame, arch, [0.06, -THICK], false, arc);
            facade::surround(builder, &self.frame, arch, [0.34, 0.06], !detail.at_least(1), arc);
            // Imposts from which the arch springs.
            let spring = arch.max.y - arch.size().x / 2.0;
            if detail.at_least(1) {
                for x in [arch.min.x, arch.max.x] {
                    let (low, high) = (Vec3::new(x - 0.06, spring - 0.2, -THICK), Vec3::new(x + 0.06, spring, 0.10));
                    builder.cuboid(Surface::Granite, &self.frame, low, high, Sides::ALL);
                }
            }
        }
        let (low, high) = (Vec3::new(0.0, 0.0, -WALK), Vec3::new(self.width, height, 0.0));
        let sides = Sides::LEFT.and(Sides::RIGHT).and(Sides::TOP);
        builder.hollow(Surface::PlasterWhite, &self.frame, low, high, sides);
        builder.rectangle_up(Surface::Slabs, &self.frame, Vec2::new(0.0, -WALK), Vec2::new(self.width, 0.0), 0.02);
        let back = self.frame.moved(0.0, 0.02, -WALK);
        let doors: Vec<Opening> =
            arches.iter().map(|arch| Opening::new((arch.min.x + arch.max.x) / 2.0, 1.5, 0.14, height - 0.75)).collect();
        facade::wall(builder, Surface::PlasterWhite, &back, Vec2::new(self.width, height - 0.02), &doors, arc);
        for door in &doors {
            opening::door(builder, &back, door, self.paint, detail);
        }
        // The inner face of the front wall: panes mirror it.
        let behind =
            Frame { origin: self.frame.point(Vec3::new(self.width, 0.0, -THICK)), ..self.frame }.turned(0.0, -1.0);
        let mirrored: Vec<Opening> = arches
            .iter()
            .map(|arch| Opening::arch(self.width - (arch.min.x + arch.max.x) / 2.0, arch.size().x, 0.0, arch.max.y))
            .collect();
        facade::wall(builder, Surface::PlasterWhite, &behind, Vec2::new(self.width, height), &mirrored, arc);
    }

    /// Plinth, corner stones, bands between the storeys and the cornice.
    fn trim(&self, builder: &mut Builder, detail: Detail) {
        let (width, height) = (self.width, self.height());
        let frame = &self.frame;
        let cornice = [(0.0, -0.36), (0.09, -0.32), (0.10, -0.20), (0.26, -0.08), (0.31, -0.06), (0.31, 0.0)];
        let plain = [(0.05, -0.30), (0.30, -0.06), (0.30, 0.0)];
        let profile: &[(f32, f32)] = if detail.at_least(1) && !self.hidden() { &cornice } else { &plain };
        let sides: &[(f32, f32, f32, f32, f32)] = &[
            // Origin x and z, outward x and z, length.
            (0.0, 0.0, 0.0, 1.0, width),
            (width, -self.depth, 0.0, -1.0, width),
            (0.0, -self.depth, -1.0, 0.0, self.depth),
            (width, 0.0, 1.0, 0.0, self.depth),
        ];
        let count = if self.roof == roof::Kind::Hip {
            4
        } else if self.hidden() {
            1
        } else {
            2
        };
        for &(x, z, out_x, out_z, length) in &sides[..count] {
            let side = frame.moved(x, height, z).turned(out_x, out_z);
            let past = if count == 4 { 0.31 } else { 0.0 };
            facade::moulding(builder, Surface::Granite, &side, [-past, length + past], profile);
        }
        if self.hidden() || !detail.at_least(1) {
            return;
        }
        let mut floor = 0.0;
        for &storey in &self.storeys[..self.storeys.len() - 1] {
            floor += storey;
            let (low, high) = (Vec3::new(0.0, floor - 0.26, 0.0), Vec3::new(width, floor - 0.08, 0.045));
            let sides = Sides::FRONT.and(Sides::TOP).and(Sides::BOTTOM);
            builder.cuboid(Surface::Granite, frame, low, high, sides);
        }
        let top = height - 0.34;
        for end in [0.0, 1.0] {
            let mut block = |low: f32, high: f32, wide: f32, out: f32| {
                let (from, to) = if end == 0.0 { (0.0, wide) } else { (width - wide, width) };
                let sides = Sides::ALL.without(Sides::BACK).without(Sides::BOTTOM);
                builder.cuboid(Surface::Granite, frame, Vec3::new(from, low, 0.0), Vec3::new(to, high, out), sides);
            };
            if detail.at_least(2) {
                let count = (top / 0.42).round();
                for index in 0..count as u32 {
                    let (low, high) = (top * index as f32 / count, top * (index + 1) as f32 / count);
                    let wide = if index.is_multiple_of(2) { 0.52 } else { 0.36 };
                    block(low + 0.006, high - 0.006, wide, 0.06);
                }
            } else {
                block(0.0, top, 0.42, 0.06);
            }
        }
        if self.ground == Ground::Home {
            // The plinth stops at the door's surround.
            let door = self.width / self.bays as f32 * ((self.seed % self.bays) as f32 + 0.5);
            for (from, to) in [(0.42, door - 0.875), (door + 0.875, width - 0.42)] {
                let (low, high) = (Vec3::new(from, 0.0, 0.0), Vec3::new(to, 0.62, 0.05));
                let sides = Sides::FRONT.and(Sides::TOP);
                builder.cuboid(Surface::Granite, frame, low, high, sides);
            }
        }
    }

    fn chimney(&self, builder: &mut Builder, detail: Detail, random: &mut Random) {
        if !detail.at_least(1) && self.hidden() {
            return;
        }
        let x = self.width * if random.chance(0.5) { 0.25 } else { 0.72 };
        let base = self.frame.moved(x, self.height(), -self.depth * random.between(0.55, 0.75));
        let (wide, high) = (random.between(0.30, 0.5), 2.6 + random.between(0.0, 0.7));
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let sides = Sides::ALL.without(Sides::BOTTOM);
        builder.cuboid(self.wall, &base, at(-wide, 0.2, -0.26), at(wide, high, 0.26), sides);
        builder.cuboid(
            Surface::Granite,
            &base,
            at(-wide - 0.07, high, -0.33),
            at(wide + 0.07, high + 0.1, 0.33),
            Sides::ALL,
        );
        if detail.at_least(2) {
            for x in [-wide * 0.5, wide * 0.5] {
                let pot = base.moved(x, high + 0.1, 0.0);
                let round = detail.round(8);
                builder.lathe(
                    Surface::Terracotta,
                    &pot,
                    round,
                    &[(0.13, 0.0), (0.10, 0.34), (0.13, 0.38), (0.09, 0.38)],
                );
            }
        }
    }
}
