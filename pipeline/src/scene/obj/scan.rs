//! The first pass over a file: its numbers, and the state at the beginning of each piece.

use super::super::Needs;
use super::super::error::SceneError;
use super::super::parallel::concatenate;
use super::lines::{Lines, number, split_word, text, words};
use super::{Allowance, Purse};
use bytemuck::Zeroable;
use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::path::Path;

/// The numbers of `v`, `vt` and `vn` statements. Invalid statements are stored as zeros, and their indices are listed in ascending
/// order.
#[derive(Default)]
pub(super) struct Numbers {
    pub(super) positions: Vec<Vec3>,
    /// Vertex colours; white for lines without one. Empty if colours are not needed, or no line has one.
    pub(super) colors: Vec<Vec4>,
    /// Empty if not needed.
    pub(super) texcoords: Vec<Vec2>,
    /// Empty if not needed.
    pub(super) normals: Vec<Vec3>,
    pub(super) bad_positions: Vec<u32>,
    pub(super) bad_texcoords: Vec<u32>,
    pub(super) bad_normals: Vec<u32>,
}

/// The state at the beginning of a piece.
#[derive(Debug, Clone)]
pub(super) struct Start {
    /// Number of statements of each kind before the piece.
    pub(super) positions: u64,
    pub(super) texcoords: u64,
    pub(super) normals: u64,
    /// The current names of object and material.
    pub(super) object: String,
    pub(super) material: String,
}

/// The contents of a piece.
#[derive(Default)]
pub(super) struct Scan {
    numbers: Numbers,
    texcoords: u64,
    normals: u64,
    /// The last names that the piece sets; `None` if it sets none.
    object: Option<String>,
    material: Option<String>,
}

/// The name in an `o`, `g` or `usemtl` statement; `default` if it is empty.
pub(super) fn name_of(rest: &[u8]) -> String {
    if rest.is_empty() { "default".to_owned() } else { text(rest) }
}

/// Reads the numbers of every piece; a piece stops when the memory allowance is used up.
pub(super) fn scan(pieces: &[Lines<'_>], needs: Needs, allowance: &Allowance) -> Vec<Scan> {
    pieces.par_iter().with_max_len(1).map(|piece| scan_piece(piece.clone(), needs, allowance)).collect()
}

fn scan_piece(mut lines: Lines<'_>, needs: Needs, allowance: &Allowance) -> Scan {
    let Needs { textures, normals, colors, .. } = needs;
    let mut found = Scan::default();
    let about = lines.about();
    found.numbers.positions.reserve_exact(about.positions);
    found.numbers.texcoords.reserve_exact(if textures { about.texcoords } else { 0 });
    found.numbers.normals.reserve_exact(if normals { about.normals } else { 0 });
    let mut purse = Purse::new(allowance);
    while let Some((_, statement)) = lines.next() {
        let (keyword, rest) = split_word(&statement);
        let numbers = &mut found.numbers;
        // Each number exists in its piece and then, for a moment, in the list of the whole file too.
        let bytes = match keyword {
            b"v" => {
                let values = finite_numbers(rest, 3);
                push(&mut numbers.positions, &mut numbers.bad_positions, values.map(Vec3::from_array), Vec3::ZERO);
                let color = if colors { color_of(rest) } else { None };
                if color.is_some() || !numbers.colors.is_empty() {
                    numbers.colors.resize(numbers.positions.len() - 1, Vec4::ONE);
                    numbers.colors.push(color.unwrap_or(Vec4::ONE));
                }
                if numbers.colors.is_empty() { 24 } else { 56 }
            }
            b"vt" => {
                found.texcoords += 1;
                if textures {
                    // A texture coordinate may consist of one number only.
                    let values = finite_numbers(rest, 1).map(|[u, v, _]| Vec2::new(u, v));
                    push(&mut numbers.texcoords, &mut numbers.bad_texcoords, values, Vec2::ZERO);
                    16
                } else {
                    0
                }
            }
            b"vn" => {
                found.normals += 1;
                if normals {
                    let values = finite_numbers(rest, 3).map(Vec3::from_array);
                    push(&mut numbers.normals, &mut numbers.bad_normals, values, Vec3::ZERO);
                    24
                } else {
                    0
                }
            }
            b"o" | b"g" => {
                found.object = Some(name_of(rest));
                0
            }
            b"usemtl" => {
                found.material = Some(name_of(rest));
                0
            }
            _ => 0,
        };
        if !purse.spend(bytes) {
            break;
        }
    }
    found
}

fn push<T>(list: &mut Vec<T>, bad: &mut Vec<u32>, value: Option<T>, otherwise: T) {
    if value.is_none() {
        bad.push(list.len() as u32);
    }
    list.push(value.unwrap_or(otherwise));
}

/// Concatenates the numbers of all pieces, and computes the state at the beginning of each piece.
pub(super) fn combine(scans: Vec<Scan>, file: &Path) -> Result<(Numbers, Vec<Start>), SceneError> {
    let mut start = Start { positions: 0, texcoords: 0, normals: 0, object: name_of(b""), material: name_of(b"") };
    let mut starts = Vec::with_capacity(scans.len());
    let mut numbers = Numbers::default();
    for scan in &scans {
        starts.push(start.clone());
        let bad = |list: &mut Vec<u32>, found: &[u32], first: u64| {
            list.extend(found.iter().map(|place| (first + u64::from(*place)) as u32));
        };
        bad(&mut numbers.bad_positions, &scan.numbers.bad_positions, start.positions);
        bad(&mut numbers.bad_texcoords, &scan.numbers.bad_texcoords, start.texcoords);
        bad(&mut numbers.bad_normals, &scan.numbers.bad_normals, start.normals);
        start.positions += scan.numbers.positions.len() as u64;
        start.texcoords += scan.texcoords;
        start.normals += scan.normals;
        if let Some(name) = &scan.object {
            start.object.clone_from(name);
        }
        if let Some(name) = &scan.material {
            start.material.clone_from(name);
        }
    }
    let most = start.positions.max(start.texcoords).max(start.normals);
    let limit = u64::from(u32::MAX);
    if most >= limit {
        return Err(SceneError::file(file, format!("{most} vertices, texture coordinates or normals are too many"))
            .help(format!("valid: fewer than {limit} of each")));
    }
    let (mut positions, mut texcoords, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let colored = scans.iter().any(|scan| !scan.numbers.colors.is_empty());
    let mut colors = Vec::new();
    for Scan { mut numbers, .. } in scans {
        if colored {
            numbers.colors.resize(numbers.positions.len(), Vec4::ONE);
        }
        colors.push(numbers.colors);
        positions.push(numbers.positions);
        texcoords.push(numbers.texcoords);
        normals.push(numbers.normals);
    }
    numbers.positions = whole(positions);
    numbers.colors = if colored { whole(colors) } else { Vec::new() };
    numbers.texcoords = whole(texcoords);
    numbers.normals = whole(normals);
    Ok((numbers, starts))
}

fn whole<T: Copy + Zeroable + Send + Sync>(mut lists: Vec<Vec<T>>) -> Vec<T> {
    if lists.len() == 1 {
        return lists.remove(0);
    }
    concatenate(&lists.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

/// The vertex colour that some programs write after a position, as display values. `None` unless exactly three numbers follow it.
fn color_of(rest: &[u8]) -> Option<Vec4> {
    let mut behind = words(rest).skip(3);
    let [red, green, blue] = std::array::from_fn(|_| behind.next().and_then(number));
    let color = Vec4::new(red?, green?, blue?, 1.0);
    behind.next().is_none().then_some(color)
}

/// Reads all positions again, relative to an origin. The difference is taken in `f64`, before rounding to `f32`.
pub(super) fn positions_from(pieces: &[Lines<'_>], origin: DVec3) -> Vec<Vec3> {
    let read = |piece: &Lines<'_>| {
        let mut lines = piece.clone();
        let mut positions = Vec::with_capacity(lines.about().positions);
        while let Some((_, statement)) = lines.next() {
            if let (b"v", rest) = split_word(&statement) {
                positions.push(position_from(rest, origin).unwrap_or(Vec3::ZERO));
            }
        }
        positions
    };
    whole(pieces.par_iter().with_max_len(1).map(read).collect())
}

fn position_from(rest: &[u8], origin: DVec3) -> Option<Vec3> {
    finite_numbers(rest, 3)?;
    let mut read = words(rest).map(|word| std::str::from_utf8(word).ok()?.parse::<f64>().ok());
    let position = DVec3::new(read.next()??, read.next()??, read.next()??);
    Some((position - origin).as_vec3())
}

/// Up to three finite numbers, with zeros for missing ones. `None` if there are fewer than `least`, or one is not a finite number.
fn finite_numbers(rest: &[u8], least: usize) -> Option<[f32; 3]> {
    let mut values = [0.0; 3];
    let mut found = 0;
    for (value, word) in values.iter_mut().zip(words(rest)) {
        *value = number(word).filter(|value| value.is_finite())?;
        found += 1;
    }
    (found >= least).then_some(values)
}
