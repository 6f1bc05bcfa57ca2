//! The second pass over a file: faces, with indices counted from the file's beginning, and all warnings.

use super::super::Needs;
use super::lines::{Lines, split_word, text, words};
use super::scan::{Numbers, Start, name_of};
use super::{Allowance, Purse};
use crate::diagnostic::Warnings;
use std::collections::HashMap;
use std::path::Path;

/// Approximate memory of a triangle: its corners, its indices, and its share of vertices.
const TRIANGLE_BYTES: u64 = 60;
/// Additional memory of a run: a mesh with its lists, and a group.
const RUN_BYTES: u64 = 512;
/// Marks a missing texture coordinate or normal of a corner.
const NONE: u32 = u32::MAX;

/// Consecutive faces with the same object, material and set of attributes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Run {
    /// Index of the object's name in [`Faces::objects`], or in `Runs::objects` after the pieces are assembled.
    pub(super) object: u32,
    /// Index of the material's name in [`Faces::materials`], or in `Runs::materials` after the pieces are assembled.
    pub(super) material: u32,
    /// Whether every corner has texture coordinates.
    pub(super) texcoords: bool,
    /// Whether every corner has a normal.
    pub(super) normals: bool,
}

/// The part of a run that lies in one piece of the file: indices of its first triangle in the lists of [`Faces`], and its number of
/// triangles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub(super) run: Run,
    pub(super) first: u32,
    pub(super) first_texcoords: u32,
    pub(super) first_normals: u32,
    pub(super) count: u32,
}

/// The faces of one piece of the file, cut into triangles.
#[derive(Default)]
pub(super) struct Faces {
    /// Position indices of each triangle's corners.
    pub(super) positions: Vec<[u32; 3]>,
    /// Texture coordinate indices and normal indices of each triangle's corners; each list only has the triangles of runs with that
    /// attribute.
    pub(super) texcoords: Vec<[u32; 3]>,
    pub(super) normals: Vec<[u32; 3]>,
    /// First triangle and number of triangles of each polygon that has more than one.
    pub(super) polygons: Vec<[u32; 2]>,
    pub(super) parts: Vec<Part>,
    /// The names that the indices in [`Run`] refer to.
    pub(super) objects: Names,
    pub(super) materials: Names,
    /// The arguments of `mtllib` statements, with their line numbers.
    pub(super) libraries: Vec<(u64, String)>,
    pub(super) warnings: Warnings,
}

/// Distinct names in order of appearance.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub(super) list: Vec<String>,
    index: HashMap<String, u32>,
}

impl Names {
    pub(super) fn index_of(&mut self, name: &str) -> u32 {
        if let Some(index) = self.index.get(name) {
            return *index;
        }
        let index = self.list.len() as u32;
        self.list.push(name.to_owned());
        self.index.insert(name.to_owned(), index);
        index
    }
}

/// Indices of a corner, counted from 0; [`NONE`] for a missing attribute.
#[derive(Debug, Clone, Copy)]
struct Corner {
    position: u32,
    texcoord: u32,
    normal: u32,
}

struct Reader<'n> {
    numbers: &'n Numbers,
    file: &'n Path,
    textures: bool,
    shading: bool,
    /// Number of statements of each kind so far, from the beginning of the file.
    positions: u64,
    texcoords: u64,
    normals: u64,
    object: u32,
    material: u32,
    corners: Vec<Corner>,
    faces: Faces,
}

/// Reads the faces of a piece; stops when the memory allowance is used up.
pub(super) fn read(
    mut lines: Lines<'_>,
    start: Start,
    numbers: &Numbers,
    needs: Needs,
    file: &Path,
    allowance: &Allowance,
) -> Faces {
    let Needs { textures, normals: shading, .. } = needs;
    let mut faces = Faces { positions: Vec::with_capacity(lines.about().faces), ..Faces::default() };
    let object = faces.objects.index_of(&start.object);
    let material = faces.materials.index_of(&start.material);
    let Start { positions, texcoords, normals, .. } = start;
    let corners = Vec::new();
    let mut reader =
        Reader { numbers, file, textures, shading, positions, texcoords, normals, object, material, corners, faces };
    let mut purse = Purse::new(allowance);
    while let Some((line, statement)) = lines.next() {
        let held = reader.held();
        reader.statement(line, &statement);
        if !purse.spend(reader.held() - held) {
            break;
        }
    }
    drop(purse);
    reader.faces
}

impl Reader<'_> {
    fn held(&self) -> u64 {
        self.faces.positions.len() as u64 * TRIANGLE_BYTES + self.faces.parts.len() as u64 * RUN_BYTES
    }

    fn warn(&mut self, line: u64, what: &'static str, remedy: &'static str, detail: impl FnOnce() -> String) {
        self.faces.warnings.add(self.file, what, remedy, || {
            let detail = detail();
            if detail.is_empty() { format!("line {line}") } else { format!("line {line}: {detail}") }
        });
    }

    fn statement(&mut self, line: u64, statement: &[u8]) {
        let (keyword, rest) = split_word(statement);
        match keyword {
            b"" => {}
            b"v" => {
                if holds(&self.numbers.bad_positions, self.positions) {
                    let what = "vertices that are not three finite numbers";
                    self.warn(line, what, "their faces are left out", || text(rest));
                }
                self.positions += 1;
            }
            b"vt" => {
                if holds(&self.numbers.bad_texcoords, self.texcoords) {
                    self.warn(line, "texture coordinates that are not finite numbers", "0 serves", || text(rest));
                }
                self.texcoords += 1;
            }
            b"vn" => {
                if holds(&self.numbers.bad_normals, self.normals) {
                    let what = "normals that are not three finite numbers";
                    self.warn(line, what, "computed from the faces", || text(rest));
                }
                self.normals += 1;
            }
            b"f" | b"fo" => self.face(line, rest),
            b"o" | b"g" => self.object = self.faces.objects.index_of(&name_of(rest)),
            b"usemtl" => self.material = self.faces.materials.index_of(&name_of(rest)),
            b"mtllib" => self.faces.libraries.push((line, text(rest))),
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

    fn face(&mut self, line: u64, rest: &[u8]) {
        let mut corners = std::mem::take(&mut self.corners);
        corners.clear();
        for word in words(rest) {
            match self.corner(word) {
                Ok(corner) => corners.push(corner),
                Err(what) => {
                    self.warn(line, what, "the face is left out", || format!("`{}`", text(word)));
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
        let mut field = |count: u64| -> Result<u32, &'static str> {
            let Some(field) = fields.next().filter(|field| !field.is_empty()) else { return Ok(NONE) };
            let index = integer(field).ok_or(MALFORMED)?;
            // Counted from 1, or backwards from the last one read.
            let index = if index < 0 { index + count as i64 } else { index - 1 };
            // All counts are below `NONE`.
            if (0..count as i64).contains(&index) { Ok(index as u32) } else { Err(OUT_OF_RANGE) }
        };
        let position = field(self.positions)?;
        if position == NONE {
            return Err(MALFORMED);
        }
        let texcoord = field(self.texcoords)?;
        let normal = field(self.normals)?;
        // Some exporters end corners with a slash: `1/1/1/`.
        if fields.next().is_some_and(|rest| !rest.is_empty()) || fields.next().is_some() {
            return Err(MALFORMED);
        }
        if holds(&self.numbers.bad_positions, u64::from(position)) {
            return Err("faces with vertices that are not three finite numbers");
        }
        Ok(Corner {
            position,
            texcoord: if self.textures { texcoord } else { NONE },
            normal: if self.shading { normal } else { NONE },
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
            texcoords: corners.iter().all(|corner| corner.texcoord != NONE),
            normals: corners.iter().all(|corner| corner.normal != NONE),
        };
        let faces = &mut self.faces;
        let first = faces.positions.len() as u32;
        let triangles = corners.len() as u32 - 2;
        match faces.parts.last_mut().filter(|part| part.run == run) {
            Some(part) => part.count += triangles,
            None => faces.parts.push(Part {
                run,
                first,
                first_texcoords: faces.texcoords.len() as u32,
                first_normals: faces.normals.len() as u32,
                count: triangles,
            }),
        }
        if triangles > 1 {
            faces.polygons.push([first, triangles]);
        }
        let at = |offset: usize| corners[(apex + offset) % corners.len()];
        for second in 1..=triangles as usize {
            let triangle = [at(0), at(second), at(second + 1)];
            faces.positions.push(triangle.map(|corner| corner.position));
            if run.texcoords {
                faces.texcoords.push(triangle.map(|corner| corner.texcoord));
            }
            if run.normals {
                faces.normals.push(triangle.map(|corner| corner.normal));
            }
        }
    }

    /// The number of reflex corners of a polygon, and the index of the first of them (0 if there is none).
    fn inward_corners(&self, corners: &[Corner]) -> (usize, usize) {
        let at = |index: usize| {
            let position = corners[index % corners.len()].position;
            self.numbers.positions[position as usize].as_dvec3()
        };
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
}

/// Whether an ascending list contains a number.
fn holds(list: &[u32], place: u64) -> bool {
    !list.is_empty() && list.binary_search_by_key(&place, |held| u64::from(*held)).is_ok()
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
