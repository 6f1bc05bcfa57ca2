//! Procedural textures. Each tiles without a seam from side to side, and most also from top to bottom. They are painted from hashes and
//! noise and are the same on every machine. Brightness is quantised in coarse steps, so that the files stay small.

use super::math::{fractal, hash01, noise, smoothstep};
use glam::{Vec2, Vec3};

/// The textures of the square's materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Picture {
    Setts,
    Basalt,
    Slabs,
    SettStone,
    BasaltStone,
    SlabStone,
    Granite,
    Ashlar,
    PlasterWhite,
    PlasterCream,
    PlasterOchre,
    PlasterRose,
    Azulejo,
    RoofTiles,
    Terracotta,
    Timber,
    Checker,
    Bottles,
    Bark,
    Foliage,
    Canopy,
    Water,
    Garden,
    Forest,
    Sky,
}

const fn rgb(red: u8, green: u8, blue: u8) -> Vec3 {
    Vec3::new(red as f32 / 255.0, green as f32 / 255.0, blue as f32 / 255.0)
}

impl Picture {
    pub(super) const ALL: [Picture; 25] = [
        Self::Setts,
        Self::Basalt,
        Self::Slabs,
        Self::SettStone,
        Self::BasaltStone,
        Self::SlabStone,
        Self::Granite,
        Self::Ashlar,
        Self::PlasterWhite,
        Self::PlasterCream,
        Self::PlasterOchre,
        Self::PlasterRose,
        Self::Azulejo,
        Self::RoofTiles,
        Self::Terracotta,
        Self::Timber,
        Self::Checker,
        Self::Bottles,
        Self::Bark,
        Self::Foliage,
        Self::Canopy,
        Self::Water,
        Self::Garden,
        Self::Forest,
        Self::Sky,
    ];

    /// File name, width and height in pixels.
    pub(super) fn file(self) -> (&'static str, u32, u32) {
        match self {
            Self::Setts => ("calcada.png", 512, 512),
            Self::Basalt => ("basalto.png", 256, 256),
            Self::Slabs => ("lajes.png", 256, 256),
            Self::SettStone => ("cubo.png", 64, 64),
            Self::BasaltStone => ("cubo_basalto.png", 64, 64),
            Self::SlabStone => ("laje.png", 128, 128),
            Self::Granite => ("granito.png", 256, 256),
            Self::Ashlar => ("cantaria.png", 256, 256),
            Self::PlasterWhite => ("reboco_branco.png", 128, 128),
            Self::PlasterCream => ("reboco_creme.png", 128, 128),
            Self::PlasterOchre => ("reboco_ocre.png", 128, 128),
            Self::PlasterRose => ("reboco_rosa.png", 128, 128),
            Self::Azulejo => ("azulejo.png", 128, 128),
            Self::RoofTiles => ("telha.png", 256, 256),
            Self::Terracotta => ("barro.png", 128, 128),
            Self::Timber => ("madeira.png", 128, 128),
            Self::Checker => ("ladrilho.png", 64, 64),
            Self::Bottles => ("garrafas.png", 128, 128),
            Self::Bark => ("casca.png", 64, 64),
            Self::Foliage => ("folhagem.png", 128, 128),
            Self::Canopy => ("copa.png", 128, 128),
            Self::Water => ("agua.png", 128, 128),
            Self::Garden => ("quintal.png", 128, 128),
            Self::Forest => ("monte.png", 256, 256),
            Self::Sky => ("ceu.png", 512, 256),
        }
    }

    /// The texels, top row first.
    pub(super) fn texels(self) -> Vec<[u8; 4]> {
        let (_, width, height) = self.file();
        let mut texels = Vec::with_capacity(width as usize * height as usize);
        for row in 0..height {
            for column in 0..width {
                // In 0..1 with v upwards, at the centre of the texel.
                let at = Vec2::new((column as f32 + 0.5) / width as f32, 1.0 - (row as f32 + 0.5) / height as f32);
                let grain = hash01(column, row, self as u32);
                let color = self.color(at, grain) * 85.0;
                // Quantised to steps of three in 255.
                let [red, green, blue] = color.to_array().map(|value| (value.clamp(0.0, 85.0) + 0.5) as u8 * 3);
                texels.push([red, green, blue, 255]);
            }
        }
        texels
    }

    fn color(self, at: Vec2, grain: f32) -> Vec3 {
        match self {
            Self::Setts => setts(at, grain, 32, SETT),
            Self::Basalt => setts(at, grain, 16, BASALT),
            Self::Slabs => slabs(at, grain),
            Self::SettStone => stone(at, grain, SETT),
            Self::BasaltStone => stone(at, grain, BASALT),
            Self::SlabStone => granite(at, grain, 0.90),
            Self::Granite => granite(at, grain, 0.80),
            Self::Ashlar => ashlar(at, grain),
            Self::PlasterWhite => plaster(at, grain, rgb(238, 234, 224)),
            Self::PlasterCream => plaster(at, grain, rgb(234, 218, 182)),
            Self::PlasterOchre => plaster(at, grain, rgb(224, 180, 104)),
            Self::PlasterRose => plaster(at, grain, rgb(222, 168, 150)),
            Self::Azulejo => azulejo(at),
            Self::RoofTiles => roof_tiles(at, grain),
            Self::Terracotta => clay(fractal(at * 8.0, 8, 3, 71), grain),
            Self::Timber => timber(at, grain),
            Self::Checker => checker(at),
            Self::Bottles => bottles(at),
            Self::Bark => rgb(150, 132, 108) * (0.65 + 0.5 * fractal(at * Vec2::new(16.0, 4.0), 16, 2, 81)),
            Self::Foliage => foliage(at, rgb(118, 140, 68)),
            Self::Canopy => foliage(at, rgb(84, 106, 54)),
            Self::Water => rgb(120, 160, 165).lerp(rgb(205, 226, 226), ripple(at)),
            Self::Garden => garden(at, grain),
            Self::Forest => forest(at),
            Self::Sky => sky(at),
        }
    }
}

/// The cell of a grid whose odd rows are shifted by `shift` cells, and the place inside it in 0..1.
fn bond(at: Vec2, columns: u32, rows: u32, shift: f32) -> (u32, u32, Vec2) {
    let y = at.y * rows as f32;
    let row = y as u32 % rows;
    let x = at.x * columns as f32 + if row % 2 == 1 { shift } else { 0.0 };
    (x as u32 % columns, row, Vec2::new(x - x.floor(), y - y.floor()))
}

/// The fractional part, also of negative coordinates.
fn repeat(at: Vec2) -> Vec2 {
    at - at.floor()
}

fn granite(at: Vec2, grain: f32, level: f32) -> Vec3 {
    let cloud = fractal(at * 6.0, 6, 3, 11);
    let speck = smoothstep(0.86, 1.0, grain) * 0.26 - smoothstep(0.94, 1.0, 1.0 - grain) * 0.16;
    Vec3::new(1.0, 0.975, 0.93) * (level + 0.16 * (cloud - 0.5) - speck + 0.05 * (grain - 0.5))
}

const SETT: Vec3 = rgb(240, 229, 208);
const BASALT: Vec3 = rgb(150, 145, 136);

/// Rough stone; single setts show different parts of it.
fn stone(at: Vec2, grain: f32, color: Vec3) -> Vec3 {
    color * (0.84 + 0.24 * fractal(at * 4.0, 4, 3, 27) + 0.06 * (grain - 0.5))
}

/// Setts of 12.5 cm in courses, each of its own shade, with sand in the joints.
fn setts(at: Vec2, grain: f32, courses: u32, color: Vec3) -> Vec3 {
    let fine = 2 * courses;
    let wobble = Vec2::new(noise(at * fine as f32, fine, 21) - 0.5, noise(at * fine as f32, fine, 22) - 0.5);
    let (column, row, inside) = bond(repeat(at + wobble * (0.19 / courses as f32)), courses, courses, 0.45);
    let edge = (inside - Vec2::splat(0.5)).abs().max_element();
    let tone = hash01(column, row, 23);
    let warm = Vec3::new(1.0, 1.0, 1.0 - 0.06 * hash01(column, row, 24));
    let stone = color * warm * (0.87 + 0.18 * tone);
    let worn = stone * (1.04 - 0.4 * edge * edge) + Vec3::splat(0.05 * (grain - 0.5));
    worn.lerp(color * 0.35 + rgb(88, 80, 68) * 0.5, smoothstep(0.40, 0.47, edge) * 0.85)
}

/// Slabs of 120 by 80 cm in running bond.
fn slabs(at: Vec2, grain: f32) -> Vec3 {
    let (column, row, inside) = bond(at, 2, 3, 0.5);
    let tone = 0.90 + 0.06 * (hash01(column, row, 31) - 0.5);
    let from_edge = (0.5 - (inside - Vec2::splat(0.5)).abs()) * Vec2::new(1.2, 0.8);
    let joint = smoothstep(0.022, 0.008, from_edge.min_element());
    granite(at, grain, tone).lerp(rgb(104, 97, 86), joint)
}

/// Courses of 45 cm with blocks of 90 cm.
fn ashlar(at: Vec2, grain: f32) -> Vec3 {
    let (column, row, inside) = bond(at, 2, 4, 0.5);
    let tone = 0.74 + 0.10 * (hash01(column, row, 41) - 0.5);
    let from_edge = (0.5 - (inside - Vec2::splat(0.5)).abs()) * Vec2::new(0.9, 0.45);
    let joint = smoothstep(0.017, 0.007, from_edge.min_element());
    granite(at, grain, tone).lerp(rgb(150, 142, 128), joint)
}

fn plaster(at: Vec2, grain: f32, color: Vec3) -> Vec3 {
    let stain = fractal(at * Vec2::new(5.0, 5.0), 5, 4, 51);
    color * (0.93 + 0.12 * (stain - 0.5) + 0.02 * (grain - 0.5))
}

/// Glazed tiles of 15 cm, white with a blue star and corners that meet in a ring.
fn azulejo(at: Vec2) -> Vec3 {
    let (column, row, inside) = bond(at, 4, 4, 0.0);
    let from_center = inside - Vec2::splat(0.5);
    let corner = Vec2::splat(0.5) - from_center.abs();
    let star = from_center.abs().x * from_center.abs().y * 60.0 + from_center.length();
    let blue = rgb(58, 96, 168);
    let glaze = rgb(226, 230, 232) * (0.97 + 0.05 * hash01(column, row, 61));
    let mut ink = smoothstep(0.46, 0.40, star);
    ink = ink.max(smoothstep(0.05, 0.02, (corner.length() - 0.24).abs()));
    let joint = smoothstep(0.03, 0.01, corner.min_element());
    glaze.lerp(blue, ink * 0.85).lerp(rgb(168, 172, 172), joint)
}

fn clay(tone: f32, grain: f32) -> Vec3 {
    rgb(206, 122, 82).lerp(rgb(168, 88, 58), tone) * (0.97 + 0.06 * grain)
}

/// Pan and cover tiles, 24 cm a column and 36 cm a course, with the shade that their waves would cast.
fn roof_tiles(at: Vec2, grain: f32) -> Vec3 {
    let (column, row, inside) = bond(at, 12, 8, 0.0);
    let tone = hash01(column, row, 72);
    let lichen = smoothstep(0.60, 0.85, fractal(at * 5.0, 5, 4, 73));
    let wave = 1.0 - (2.0 * inside.x - 1.0).abs();
    let light = 0.62 + 0.45 * smoothstep(0.05, 0.7, wave);
    let lip = 1.0 - 0.35 * smoothstep(0.16, 0.0, inside.y);
    clay(0.75 * tone, grain).lerp(rgb(150, 128, 96), 0.55 * lichen) * light * lip
}

fn timber(at: Vec2, grain: f32) -> Vec3 {
    let (column, _, inside) = bond(at, 6, 1, 0.0);
    let fiber = noise(at * Vec2::new(48.0, 6.0), 48, 91);
    let gap = smoothstep(0.09, 0.03, 0.5 - (inside.x - 0.5).abs());
    rgb(128, 88, 56) * (0.75 + 0.3 * fiber + 0.15 * hash01(column, 0, 92) + 0.04 * grain) * (1.0 - 0.65 * gap)
}

fn checker(at: Vec2) -> Vec3 {
    let (column, row, inside) = bond(at, 4, 4, 0.0);
    let joint = smoothstep(0.04, 0.02, 0.5 - (inside - Vec2::splat(0.5)).abs().max_element());
    let tile = if (column + row) % 2 == 0 { rgb(206, 198, 180) } else { rgb(88, 62, 52) };
    tile.lerp(rgb(96, 90, 84), joint)
}

/// A shelf of bottles before a dark board.
fn bottles(at: Vec2) -> Vec3 {
    let (column, row, inside) = bond(at, 12, 3, 0.0);
    let kind = hash01(column, row, 101);
    let tall = 0.62 + 0.24 * hash01(column, row, 102);
    let half = if inside.y < tall * 0.6 { 0.34 } else { 0.12 };
    let color = if kind < 0.35 {
        rgb(70, 110, 62)
    } else if kind < 0.6 {
        rgb(150, 92, 40)
    } else if kind < 0.8 {
        rgb(196, 180, 140)
    } else {
        rgb(140, 44, 40)
    };
    if inside.y < 0.07 {
        rgb(138, 98, 60)
    } else if inside.y < tall && (inside.x - 0.5).abs() < half {
        let label = inside.y > 0.2 && inside.y < 0.36;
        let sheen = 1.0 + 0.5 * smoothstep(0.12, 0.02, (inside.x - 0.36).abs());
        if label { rgb(220, 210, 180) } else { color * sheen }
    } else {
        rgb(58, 40, 28)
    }
}

fn foliage(at: Vec2, color: Vec3) -> Vec3 {
    let clump = fractal(at * 8.0, 8, 4, 111);
    let light = smoothstep(0.25, 0.75, clump);
    (color * (0.55 + 0.75 * light)).lerp(rgb(178, 176, 84), 0.25 * smoothstep(0.6, 0.9, noise(at * 32.0, 32, 115)))
}

fn ripple(at: Vec2) -> f32 {
    let warp = Vec2::new(noise(at * 4.0, 4, 121), noise(at * 4.0, 4, 122)) * 0.35;
    smoothstep(0.45, 0.85, fractal(at * 6.0 + warp * 6.0, 6, 3, 123))
}

fn garden(at: Vec2, grain: f32) -> Vec3 {
    let grass = fractal(at * 6.0, 6, 4, 131);
    let earth = smoothstep(0.52, 0.66, fractal(at * 4.0, 4, 4, 135));
    (rgb(128, 142, 78) * (0.7 + 0.55 * grass)).lerp(rgb(172, 150, 116), earth * 0.8) + Vec3::splat(0.04 * (grain - 0.5))
}

fn forest(at: Vec2) -> Vec3 {
    let crowns = noise(at * 64.0, 64, 141) * 0.6 + noise(at * 32.0, 32, 142) * 0.4;
    let stand = fractal(at * 5.0, 5, 4, 143);
    let meadow = smoothstep(0.56, 0.62, fractal(at * 4.0, 4, 3, 147));
    let trees = rgb(72, 98, 62).lerp(rgb(108, 122, 72), stand) * (0.62 + 0.62 * crowns);
    trees.lerp(rgb(136, 147, 88) * (0.92 + 0.16 * stand), meadow)
}

/// From the horizon (bottom) to the zenith, with soft clouds.
fn sky(at: Vec2) -> Vec3 {
    let height = at.y;
    let clear = rgb(214, 222, 222).lerp(rgb(146, 184, 218), smoothstep(0.0, 0.45, height));
    let clear = clear.lerp(rgb(88, 136, 192), smoothstep(0.35, 1.0, height));
    // Clouds lie flatter the nearer they are to the horizon.
    let stretched = Vec2::new(at.x * 8.0, 16.0 * height / (0.35 + height));
    let warp = fractal(stretched * 0.5, 4, 3, 151) - 0.5;
    let cover = fractal(stretched + Vec2::splat(1.3 * warp), 8, 5, 155);
    let cloud = smoothstep(0.50, 0.74, cover) * smoothstep(0.98, 0.7, height);
    // Divided by the sun's contribution, 1.13, where its light falls frontally.
    clear.lerp(rgb(240, 238, 232), 0.85 * cloud) * 0.88
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_repeats_without_a_seam() {
        for picture in Picture::ALL {
            let (name, width, height) = picture.file();
            let texels = picture.texels();
            let at = |x: u32, y: u32| texels[(y * width + x) as usize];
            let step = |a: [u8; 4], b: [u8; 4]| -> u32 { (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum() };
            // Across the left and right edge the change is at most 1.25 times the greatest change between columns inside.
            let across: u32 = (0..height).map(|y| step(at(width - 1, y), at(0, y))).sum();
            let inside = (0..width - 1).map(|x| (0..height).map(|y| step(at(x, y), at(x + 1, y))).sum::<u32>()).max();
            assert!(Some(across) <= inside.map(|most| most + most / 4), "{name}: {across} against {inside:?}");
        }
    }

    #[test]
    fn every_picture_is_in_the_list_once() {
        for (index, picture) in Picture::ALL.iter().enumerate() {
            assert_eq!(*picture as usize, index);
        }
    }
}
