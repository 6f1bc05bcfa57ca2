//! Generated scenes, of kinds that the available files lack. Each has about the requested number of triangles.

use crate::rng::Numbers;
use curitiba::pipeline::scene::{Group, Mesh, Object, Scene};
use glam::{DVec3, Mat4, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, TAU};

/// Names for [`scene`], each with a description.
pub const KINDS: [(&str, &str); 5] = [
    ("room", "a closed hall with windows and rows of chairs, as conference rooms have"),
    ("far", "the same, a hundred times its length from the origin"),
    ("foliage", "trees of single leaves on uneven ground"),
    ("needles", "triangles 500 times as long as wide, in all directions"),
    ("soup", "triangles of no order in a cube"),
];

/// A scene of a kind, with about `triangles` triangles.
///
/// # Errors
/// If there is no such kind.
pub fn scene(kind: &str, triangles: u32) -> Result<Scene, String> {
    let mut numbers = Numbers::new(1);
    let corners = match kind {
        "room" | "far" => room(triangles),
        "foliage" => foliage(triangles, &mut numbers),
        "needles" => needles(triangles, &mut numbers),
        "soup" => soup(triangles, &mut numbers),
        _ => {
            let valid = KINDS.map(|(name, is)| format!("{name} ({is})")).join(", ");
            return Err(format!("there is no scene `{kind}`; there are square and {valid}"));
        }
    };
    let offset = if kind == "far" { DVec3::new(2400.0, 0.0, -2400.0) } else { DVec3::ZERO };
    Ok(of(&corners, offset))
}

/// A scene of triangles that share no vertices, moved by `offset`.
fn of(corners: &[[Vec3; 3]], offset: DVec3) -> Scene {
    let count = corners.len() as u32;
    let positions = corners.iter().flatten().map(|&corner| (corner.as_dvec3() + offset).as_vec3()).collect();
    let normals = corners.iter().flat_map(|&[a, b, c]| [(b - a).cross(c - a).normalize_or(Vec3::Y); 3]).collect();
    let triangles = (0..count).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect();
    let mesh = Mesh {
        positions,
        normals,
        groups: vec![Group { material: 0, triangles }],
        name: "all".to_owned(),
        ..Mesh::default()
    };
    let object = Object { name: "all".to_owned(), mesh: 0, transform: Mat4::IDENTITY };
    Scene { meshes: vec![mesh], objects: vec![object], materials: vec![Default::default()], ..Scene::default() }
}

fn quad(corners: &mut Vec<[Vec3; 3]>, [a, b, c, d]: [Vec3; 4]) {
    corners.extend([[a, b, c], [a, c, d]]);
}

/// Adds a box between two corners.
fn block(corners: &mut Vec<[Vec3; 3]>, low: Vec3, high: Vec3) {
    let at = |x: bool, y: bool, z: bool| {
        let pick = |of_high: bool, low: f32, high: f32| if of_high { high } else { low };
        Vec3::new(pick(x, low.x, high.x), pick(y, low.y, high.y), pick(z, low.z, high.z))
    };
    for side in [false, true] {
        quad(corners, [at(side, false, false), at(side, true, false), at(side, true, true), at(side, false, true)]);
        quad(corners, [at(false, side, false), at(false, side, true), at(true, side, true), at(true, side, false)]);
        quad(corners, [at(false, false, side), at(true, false, side), at(true, true, side), at(false, true, side)]);
    }
}

/// Adds an upright tube with this number of sides and open ends.
fn tube(corners: &mut Vec<[Vec3; 3]>, foot: Vec3, radius: f32, height: f32, sides: u32) {
    let at = |side: u32, y: f32| {
        let (sin, cos) = (side as f32 / sides as f32 * TAU).sin_cos();
        foot + Vec3::new(radius * cos, y, radius * sin)
    };
    for side in 0..sides {
        quad(corners, [at(side, 0.0), at(side, height), at(side + 1, height), at(side + 1, 0.0)]);
    }
}

/// A hall of 24 x 4 x 16 with three windows, and with chairs of 12-sided tubes and curved backs.
fn room(triangles: u32) -> Vec<[Vec3; 3]> {
    let mut corners = Vec::new();
    let (size, thickness) = (Vec3::new(24.0, 4.0, 16.0), 0.3);
    for y in [-thickness, size.y] {
        block(
            &mut corners,
            Vec3::new(-thickness, y, -thickness),
            Vec3::new(size.x + thickness, y + thickness, size.z + thickness),
        );
    }
    for z in [-thickness, size.z] {
        block(&mut corners, Vec3::new(0.0, 0.0, z), Vec3::new(size.x, size.y, z + thickness));
    }
    block(&mut corners, Vec3::new(size.x, 0.0, 0.0), Vec3::new(size.x + thickness, size.y, size.z));
    block(&mut corners, Vec3::new(-thickness, 0.0, 0.0), Vec3::new(0.0, 1.0, size.z));
    block(&mut corners, Vec3::new(-thickness, 3.0, 0.0), Vec3::new(0.0, size.y, size.z));
    for pillar in 0..4 {
        let z = size.z / 3.0 * pillar as f32 - 0.5;
        block(&mut corners, Vec3::new(-thickness, 1.0, z.max(0.0)), Vec3::new(0.0, 3.0, (z + 1.0).min(size.z)));
    }
    let mut chair = Vec::new();
    block(&mut chair, Vec3::new(-0.25, 0.45, -0.25), Vec3::new(0.25, 0.5, 0.25));
    for (x, z) in [(-0.22, -0.22), (-0.22, 0.22), (0.22, -0.22), (0.22, 0.22)] {
        tube(&mut chair, Vec3::new(x, 0.0, z), 0.02, 0.45, 12);
    }
    let at = |step: u32, y: u32| {
        let angle = step as f32 / 16.0 * FRAC_PI_2 - FRAC_PI_2 / 2.0;
        Vec3::new(0.35 * angle.sin(), 0.55 + 0.06 * y as f32, 0.35 * angle.cos() - 0.1)
    };
    for step in 0..16 {
        for y in 0..8 {
            quad(&mut chair, [at(step, y), at(step, y + 1), at(step + 1, y + 1), at(step + 1, y)]);
        }
    }
    let chairs = (triangles as usize / chair.len()).max(1);
    let columns = ((chairs as f32 * size.x / size.z).sqrt().ceil() as usize).max(1);
    let rows = chairs.div_ceil(columns);
    for index in 0..chairs {
        let place = Vec2::new((index % columns) as f32 + 0.5, (index / columns) as f32 + 0.5);
        let place = place / Vec2::new(columns as f32, rows as f32) * Vec2::new(size.x, size.z);
        // If there are more chairs than the floor holds, they are scaled down.
        let scale = (size.x / columns as f32 / 0.7).min(1.0);
        corners.extend(chair.iter().map(|triangle| triangle.map(|p| p * scale + Vec3::new(place.x, 0.0, place.y))));
    }
    corners
}

fn foliage(triangles: u32, numbers: &mut Numbers) -> Vec<[Vec3; 3]> {
    const TREES: u32 = 12;
    let mut corners = Vec::new();
    let ground = |x: u32, z: u32| {
        let (x, z) = (x as f32 - 16.0, z as f32 - 16.0);
        Vec3::new(x, 0.4 * (0.7 * x).sin() * (0.5 * z).cos(), z)
    };
    for x in 0..32 {
        for z in 0..32 {
            quad(&mut corners, [ground(x, z), ground(x, z + 1), ground(x + 1, z + 1), ground(x + 1, z)]);
        }
    }
    let leaves = (triangles as usize).saturating_sub(corners.len()) as u32 / 2 / TREES;
    for tree in 0..TREES {
        let foot = Vec3::new((tree % 4) as f32 * 7.0 - 10.5, -0.5, (tree / 4) as f32 * 8.0 - 8.0)
            + Vec3::new(numbers.unit(), 0.0, numbers.unit()) * 2.0;
        tube(&mut corners, foot, 0.25, 4.0, 16);
        for _ in 0..leaves {
            // Leaves are denser near the surface of the crown than inside.
            let place =
                foot + Vec3::Y * 5.5 + numbers.direction() * Vec3::new(2.6, 2.2, 2.6) * numbers.unit().powf(0.25);
            let along = numbers.direction() * 0.12;
            let across = along.any_orthonormal_vector() * 0.035;
            let (middle, tip) = (place + along * 0.5, place + along);
            corners.extend([[place, middle - across, tip], [place, tip, middle + across]]);
        }
    }
    corners
}

fn needles(triangles: u32, numbers: &mut Numbers) -> Vec<[Vec3; 3]> {
    let needle = |_| {
        let place = Vec3::new(numbers.unit(), numbers.unit(), numbers.unit()) * 10.0;
        let along = numbers.direction() * 2.0;
        [place, place + along, place + along.any_orthonormal_vector() * 0.004]
    };
    (0..triangles).map(needle).collect()
}

fn soup(triangles: u32, numbers: &mut Numbers) -> Vec<[Vec3; 3]> {
    let size = 2.0 / (triangles as f32).cbrt();
    let triangle = |_| {
        let place = Vec3::new(numbers.unit(), numbers.unit(), numbers.unit());
        [place, place + numbers.direction() * size, place + numbers.direction() * size]
    };
    (0..triangles).map(triangle).collect()
}
