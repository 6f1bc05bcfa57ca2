//! Conversion of OBJ text to a plain form that `tobj` accepts.
//!
//! `tobj` rejects a whole file for one bad number or index. This filter reads each statement first, counts and drops what cannot be
//! used, and passes on only finite `v`, `vt` and `vn`, triangles with positive indices in range, and one `o` with a running number
//! for every run of faces with the same object, material and set of attributes.

use super::super::super::Needs;
use super::super::super::context::Context;
use super::super::super::error::SceneError;
use super::super::lines::{Lines, number, split_word, text, words};
use crate::diagnostic::Warnings;
use glam::Vec3;
use std::collections::{HashMap, HashSet};
use std::io::{BufRead, Read, Write};

/// Bytes of text produced at a time.
const BLOCK: usize = 1 << 16;
/// Approximate memory of a triangle in `tobj` and here: its indices, and its share of vertices.
const TRIANGLE_BYTES: u64 = 60;
/// Additional memory of a run in `tobj` and here: a model with its lists, and a group.
const RUN_BYTES: u64 = 512;
/// Memory of a position in `tobj` and here.
const POSITION_BYTES: u64 = 24;

/// Consecutive faces with the same object, material and set of attributes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Run {
    /// Index into [`Sanitiser::objects`].
    pub(super) object: u32,
    /// Index into [`Sanitiser::materials`].
    pub(super) material: u32,
    /// Whether every corner has texture coordinates.
    pub(super) texcoords: bool,
    /// Whether every corner has a normal.
    pub(super) normals: bool,
}

/// Indices of a corner, counted from 0.
#[derive(Debug, Clone, Copy)]
struct Corner {
    position: usize,
    texcoord: Option<usize>,
    normal: Option<usize>,
}

/// Distinct names in order of appearance.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub(super) list: Vec<String>,
    index: HashMap<String, u32>,
}

impl Names {
    fn index_of(&mut self, name: String) -> u32 {
        *self.index.entry(name).or_insert_with_key(|name| {
            self.list.push(name.clone());
            self.list.len() as u32 - 1
        })
    }
}

/// A reader that yields plain OBJ text, made from a file's bytes on demand.
pub(super) struct Sanitiser<'b, 'c, 'f> {
    lines: Lines<'b>,
    context: &'c mut Context<'f>,
    out: Vec<u8>,
    consumed: usize,
    positions: Vec<Vec3>,
    unusable: HashSet<usize>,
    texcoords: usize,
    normals: usize,
    object: u32,
    material: u32,
    run_length: usize,
    /// Number of triangles at which a run ends; the next polygon begins a new run. `tobj` reads each run as one model.
    max_run: usize,
    /// Whether colours are needed and some position has one; every position is then passed on with a colour.
    colored: bool,
    corners: Vec<Corner>,
    unbooked: u64,
    pub(super) runs: Vec<Run>,
    pub(super) objects: Names,
    pub(super) materials: Names,
    /// The arguments of `mtllib` statements, with their line numbers.
    pub(super) libraries: Vec<(u64, String)>,
    pub(super) warnings: Warnings,
    /// Why reading stopped before the end, if it did.
    pub(super) failure: Option<SceneError>,
}

impl<'b, 'c, 'f> Sanitiser<'b, 'c, 'f> {
    pub(super) fn new(bytes: &'b [u8], max_run: usize, context: &'c mut Context<'f>) -> Self {
        let mut all = Lines::new(bytes);
        let mut statements = std::iter::from_fn(|| all.next());
        let is_colored = |line: &[u8]| matches!(split_word(line), (b"v", rest) if color_of(rest).is_some());
        let colored = context.needs.colors && statements.any(|(_, line)| is_colored(&line));
        let mut objects = Names::default();
        let mut materials = Names::default();
        Self {
            lines: Lines::new(bytes),
            context,
            out: Vec::with_capacity(BLOCK + BLOCK / 4),
            consumed: 0,
            positions: Vec::new(),
            unusable: HashSet::new(),
            texcoords: 0,
            normals: 0,
            object: objects.index_of("default".to_owned()),
            material: materials.index_of("default".to_owned()),
            run_length: 0,
            max_run,
            colored,
            corners: Vec::new(),
            unbooked: 0,
            runs: Vec::new(),
            objects,
            materials,
            libraries: Vec::new(),
            warnings: Warnings::default(),
            failure: None,
        }
    }

    fn needs(&self) -> Needs {
        self.context.needs
    }

    fn warn(&mut self, line: u64, what: &'static str, remedy: &'static str, detail: impl FnOnce() -> String) {
        self.warnings.add(self.context.file, what, remedy, || {
            let detail = detail();
            if detail.is_empty() { format!("line {line}") } else { format!("line {line}: {detail}") }
        });
    }

    fn statement(&mut self, line: u64, statement: &[u8]) {
        let (keyword, rest) = split_word(statement);
        match keyword {
            b"" => {}
            b"v" => self.position(line, rest),
            b"vt" => {
                if self.needs().textures {
                    // A texture coordinate may consist of one number only.
                    let usable = are_finite(rest, 1);
                    if !usable {
                        self.warn(line, "texture coordinates that are not finite numbers", "0 serves", || text(rest));
                    }
                    self.emit_numbers(b"vt", if usable { rest } else { b"" }, 2);
                }
                self.texcoords += 1;
                self.unbooked += 8;
            }
            b"vn" => {
                if self.needs().normals {
                    let usable = are_finite(rest, 3);
                    if !usable {
                        let remedy = "computed from the faces";
                        self.warn(line, "normals that are not three finite numbers", remedy, || text(rest));
                    }
                    self.emit_numbers(b"vn", if usable { rest } else { b"" }, 3);
                }
                self.normals += 1;
                self.unbooked += 12;
            }
            b"f" | b"fo" => self.face(line, rest),
            b"o" | b"g" => {
                let name = if rest.is_empty() { "default".to_owned() } else { text(rest) };
                self.object = self.objects.index_of(name);
            }
            b"usemtl" => {
                let name = if rest.is_empty() { "default".to_owned() } else { text(rest) };
                self.material = self.materials.index_of(name);
            }
            b"mtllib" => self.libraries.push((line, text(rest))),
            // Smoothing groups and rendering attributes have no effect here.
            b"s" | b"vp" | b"mg" | b"lod" | b"usemap" | b"maplib" | b"shadow_obj" | b"trace_obj" | b"bevel"
            | b"c_interp" | b"d_interp" => {}
            b"l" | b"p" => self.warn(line, "lines and points", "left out", String::new),
            b"curv" | b"curv2" | b"surf" | b"cstype" | b"deg" | b"bmat" | b"step" | b"parm" | b"trim" | b"hole"
            | b"scrv" | b"sp" | b"end" | b"con" | b"ctech" | b"stech" => {
                self.warn(line, "free-form curves and surfaces", "left out", || text(keyword));
            }
            // The statement is not quoted: the file may be of another kind, with private contents.
            _ => self.warn(line, "unknown statements", "ignored", String::new),
        }
    }

    fn position(&mut self, line: u64, rest: &[u8]) {
        let values = finite_numbers(rest, 3);
        if values.is_none() {
            self.warn(line, "vertices that are not three finite numbers", "their faces are left out", || text(rest));
            self.unusable.insert(self.positions.len());
        }
        self.emit_numbers(b"v", if values.is_some() { rest } else { b"" }, 3);
        if self.colored {
            self.out.pop();
            for color in color_of(rest).unwrap_or([1.0; 3]) {
                self.out.extend_from_slice(format!(" {color}").as_bytes());
            }
            self.out.push(b'\n');
        }
        self.positions.push(values.map_or(Vec3::ZERO, Vec3::from_array));
        self.unbooked += POSITION_BYTES;
    }

    /// Writes the first `count` words as they are, with zeros for missing ones.
    fn emit_numbers(&mut self, keyword: &[u8], rest: &[u8], count: usize) {
        self.out.extend_from_slice(keyword);
        for word in words(rest).chain(std::iter::repeat(&b"0"[..])).take(count) {
            self.out.push(b' ');
            self.out.extend_from_slice(word);
        }
        self.out.push(b'\n');
    }

    fn face(&mut self, line: u64, rest: &[u8]) {
        let mut corners = std::mem::take(&mut self.corners);
        corners.clear();
        for word in words(rest) {
            match self.corner(word) {
                Ok(corner) => corners.push(corner),
                Err(what) => {
                    self.warn(line, what, "the face is left out", || format!("`{}`", text(word)));
                    corners.clear();
                    self.corners = corners;
                    return;
                }
            }
        }
        if corners.len() < 3 {
            self.warn(line, "faces with fewer than three corners", "left out", String::new);
        } else {
            self.triangulate(line, &corners);
        }
        self.corners = corners;
    }

    fn corner(&self, word: &[u8]) -> Result<Corner, &'static str> {
        const MALFORMED: &str = "face corners that are not of the form v, v/vt, v//vn or v/vt/vn";
        const OUT_OF_RANGE: &str = "faces with indices out of range";
        let mut fields = word.split(|byte| *byte == b'/');
        let mut field = |count: usize| -> Result<Option<usize>, &'static str> {
            let Some(field) = fields.next().filter(|field| !field.is_empty()) else { return Ok(None) };
            let index = integer(field).ok_or(MALFORMED)?;
            // Counted from 1, or backwards from the last one read.
            let index = if index < 0 { index + count as i64 } else { index - 1 };
            usize::try_from(index).ok().filter(|index| *index < count).map(Some).ok_or(OUT_OF_RANGE)
        };
        let position = field(self.positions.len())?.ok_or(MALFORMED)?;
        let texcoord = field(self.texcoords)?;
        let normal = field(self.normals)?;
        // Some exporters end corners with a slash: `1/1/1/`.
        if fields.next().is_some_and(|rest| !rest.is_empty()) || fields.next().is_some() {
            return Err(MALFORMED);
        }
        if !self.unusable.is_empty() && self.unusable.contains(&position) {
            return Err("faces with vertices that are not three finite numbers");
        }
        Ok(Corner {
            position,
            texcoord: texcoord.filter(|_| self.needs().textures),
            normal: normal.filter(|_| self.needs().normals),
        })
    }

    /// Cuts a polygon into a triangle fan around its first reflex corner, or around its first corner if none is reflex.
    fn triangulate(&mut self, line: u64, corners: &[Corner]) {
        let mut apex = 0;
        if corners.len() > 3 {
            let (inward, first) = self.inward_corners(corners);
            apex = first;
            if inward > 1 {
                self.warn(line, "polygons with several corners that point inwards", "cut as a fan", || {
                    format!("{} corners, {inward} inwards", corners.len())
                });
            }
        }
        let run = Run {
            object: self.object,
            material: self.material,
            texcoords: corners.iter().all(|corner| corner.texcoord.is_some()),
            normals: corners.iter().all(|corner| corner.normal.is_some()),
        };
        if self.runs.last() != Some(&run) || self.run_length >= self.max_run {
            let _ = writeln!(self.out, "o {}", self.runs.len());
            self.runs.push(run);
            self.unbooked += RUN_BYTES;
            self.run_length = 0;
        }
        let triangles = corners.len() - 2;
        self.run_length += triangles;
        self.unbooked += TRIANGLE_BYTES * triangles as u64;
        let at = |offset: usize| corners[(apex + offset) % corners.len()];
        for second in 1..=triangles {
            self.out.push(b'f');
            for corner in [at(0), at(second), at(second + 1)] {
                self.emit_corner(corner, run);
            }
            self.out.push(b'\n');
        }
    }

    fn emit_corner(&mut self, corner: Corner, run: Run) {
        self.out.push(b' ');
        push_integer(&mut self.out, corner.position + 1);
        if let Some(texcoord) = corner.texcoord.filter(|_| run.texcoords) {
            self.out.push(b'/');
            push_integer(&mut self.out, texcoord + 1);
        }
        if let Some(normal) = corner.normal.filter(|_| run.normals) {
            self.out.extend_from_slice(if run.texcoords { b"/" } else { b"//" });
            push_integer(&mut self.out, normal + 1);
        }
    }

    /// The number of reflex corners of a polygon, and the index of the first of them (0 if there is none).
    fn inward_corners(&self, corners: &[Corner]) -> (usize, usize) {
        let at = |index: usize| self.positions[corners[index % corners.len()].position].as_dvec3();
        let origin = at(0);
        // Twice the area as a vector (Newell's method).
        let area = (1..corners.len() - 1)
            .map(|i| (at(i) - origin).cross(at(i + 1) - origin))
            .fold(glam::DVec3::ZERO, |sum, cross| sum + cross);
        let tolerance = -1e-9 * area.length_squared();
        let inward = |index: &usize| {
            let (before, here, after) = (at(index + corners.len() - 1), at(*index), at(index + 1));
            (here - before).cross(after - here).dot(area) < tolerance
        };
        let mut found = (0..corners.len()).filter(inward);
        let first = found.next();
        (first.map_or(0, |_| 1 + found.count()), first.unwrap_or(0))
    }

    /// Produces the next block of text.
    fn refill(&mut self) {
        self.out.clear();
        self.consumed = 0;
        while self.out.len() < BLOCK && self.failure.is_none() {
            let Some((line, statement)) = self.lines.next() else { break };
            self.statement(line, &statement);
            if self.unbooked > BLOCK as u64 {
                let bytes = std::mem::take(&mut self.unbooked);
                self.failure = self.context.budget.take(self.context.file, "the vertices and faces", bytes).err();
            }
        }
    }
}

impl Read for Sanitiser<'_, '_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Sanitiser<'_, '_, '_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.consumed == self.out.len() {
            self.refill();
        }
        Ok(&self.out[self.consumed..])
    }

    fn consume(&mut self, amount: usize) {
        self.consumed += amount;
    }
}

/// The three numbers of a colour after a position; `None` unless exactly three numbers follow it.
fn color_of(rest: &[u8]) -> Option<[f32; 3]> {
    let all: Vec<&[u8]> = words(rest).collect();
    let [_, _, _, red, green, blue] = all[..] else { return None };
    Some([number(red)?, number(green)?, number(blue)?])
}

fn finite_numbers(rest: &[u8], least: usize) -> Option<[f32; 3]> {
    let mut values = [0.0; 3];
    let mut found = 0;
    for (value, word) in values.iter_mut().zip(words(rest)) {
        *value = number(word).filter(|value| value.is_finite())?;
        found += 1;
    }
    (found >= least).then_some(values)
}

fn are_finite(rest: &[u8], least: usize) -> bool {
    finite_numbers(rest, least).is_some()
}

/// A decimal integer with an optional sign. `None` for other text, and beyond 18 digits, which is far above any index.
fn integer(digits: &[u8]) -> Option<i64> {
    let (negative, digits) = match digits {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        all => (false, all),
    };
    if digits.is_empty() || digits.len() > 18 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits.iter().fold(0_i64, |value, digit| value * 10 + i64::from(digit - b'0'));
    Some(if negative { -value } else { value })
}

fn push_integer(out: &mut Vec<u8>, value: usize) {
    let mut digits = [0; 20];
    let mut at = digits.len();
    let mut rest = value;
    loop {
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    out.extend_from_slice(&digits[at..]);
}
