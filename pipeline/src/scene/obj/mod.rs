//! Wavefront OBJ files with their material libraries.
//!
//! Objects and groups (`o`, `g`) become objects by name. If a name occurs with several materials or at several places in the file,
//! equal vertices are shared again, so that computed normals are smooth across them. Smoothing groups (`s`) are not read: where
//! normals are missing, the crease angle decides (see `render`).
//!
//! A file is cut at line ends into pieces, which all threads read in parallel. The first pass ([`scan`]) reads the numbers of every
//! piece and counts them. The second pass ([`faces`]) reads the faces, for which the counts before each piece must be known. Then
//! the vertices of each run of faces are made ([`weld`]), and runs that belong together are joined ([`join`]). The result depends
//! neither on the cuts nor on the number of threads.
//!
//! If a file's contents are far from its origin, the positions are read again, relative to an origin near them, so that no digit is lost
//! ([`super::origin`]).
//!
//! The crate `tobj` is not used: it reads a file sequentially, rejects a whole file for one bad number, and holds over 100 bytes for
//! every face. A reader built on `tobj` is the reference in tests: both readers must return the same scene for every file whose
//! contents are not far from its origin.

mod faces;
mod join;
mod lines;
mod mtl;
mod runs;
mod scan;
#[cfg(test)]
mod serial;
#[cfg(test)]
mod tests;
mod weld;

use super::Scene;
use super::context::Context;
use super::error::SceneError;
use super::origin::{bounds, origin_for};
use crate::diagnostic::Warnings;
use faces::Faces;
use glam::DVec3;
use lines::{Lines, pieces, split_word, text};
use mtl::Library;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Least and largest size of a piece in bytes: small enough that all threads finish at about the same time.
const PIECE: [usize; 2] = [1 << 16, 1 << 22];
/// Number of triangles at which a run of faces ends; the next polygon begins a new run. Vertices that a file lists twice are merged
/// only if they are in different runs, so this number affects the result and must not depend on the number of threads.
const MAX_RUN: usize = 1 << 20;
/// Number of used bytes above which a thread books them with the [`Allowance`].
const BLOCK: u64 = 1 << 16;

pub(crate) fn read(bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    let shares = 8 * rayon::current_num_threads();
    read_in_pieces(bytes, (bytes.len() / shares).clamp(PIECE[0], PIECE[1]), MAX_RUN, context)
}

/// [`read`] with given approximate sizes of pieces (bytes) and runs (triangles).
fn read_in_pieces(bytes: &[u8], piece: usize, max_run: usize, context: &mut Context<'_>) -> Result<Scene, SceneError> {
    const WHAT: &str = "the vertices and faces";
    let file = context.file;
    let pieces = pieces(bytes, piece);
    let mut needs = context.needs;
    // Texture coordinates are also needed if only a normal map reads them.
    needs.textures |= needs.normals && needs.normal_maps && names_normal_map(&pieces, context);
    let allowance = Allowance::new(context);
    let scans = scan::scan(&pieces, needs, &allowance);
    allowance.settle(WHAT, context)?;
    let (mut numbers, starts) = scan::combine(scans, file)?;
    let origin = bounds(&numbers.positions).map_or(DVec3::ZERO, origin_for);
    if origin != DVec3::ZERO {
        numbers.positions = Vec::new();
        numbers.positions = scan::positions_from(&pieces, origin);
    }

    let allowance = Allowance::new(context);
    let read = |(piece, start): (&Lines<'_>, scan::Start)| {
        faces::read(piece.clone(), start, &numbers, needs, file, &allowance)
    };
    let faces: Vec<Faces> = pieces.par_iter().zip(starts).with_max_len(1).map(read).collect();
    allowance.settle(WHAT, context)?;

    let mut warnings = Warnings::default();
    let mut library = Library::default();
    for part in &faces {
        warnings.merge(part.warnings.clone());
    }
    for (line, argument) in faces.iter().flat_map(|part| &part.libraries) {
        mtl::read_libraries(argument, *line, &mut library, context, &mut warnings)?;
    }
    let runs = runs::runs(&faces, max_run);
    // Materials are numbered in the order in which faces first name them.
    let mut material_index = vec![None; runs.materials.len()];
    let mut materials = Vec::with_capacity(runs.list.len());
    for (run, _) in &runs.list {
        let name = &runs.materials[run.material as usize];
        let index = *material_index[run.material as usize]
            .get_or_insert_with(|| material_of(&mut library, name, context, &mut warnings));
        materials.push(index);
    }
    let welded = weld::weld(&runs, &faces, &numbers);
    drop((faces, numbers));
    let mut scene = join::join(&runs, welded, &materials, &library.coordinates, context)?;
    scene.origin = origin;
    scene.materials = library.table.materials;
    scene.textures = library.textures;
    scene.warnings = warnings;
    Ok(scene)
}

/// Whether a material in the file's libraries has a normal map. `false` for an unreadable library; that error is reported later.
fn names_normal_map(pieces: &[Lines<'_>], context: &mut Context<'_>) -> bool {
    let named: Vec<String> = pieces
        .par_iter()
        .flat_map_iter(|piece| {
            let (mut lines, mut named) = (piece.clone(), Vec::new());
            while let Some((_, statement)) = lines.next() {
                let (keyword, rest) = split_word(&statement);
                if keyword == b"mtllib" {
                    named.push(text(rest));
                }
            }
            named
        })
        .collect();
    let (mut library, mut unheard) = (Library::default(), Warnings::default());
    for argument in named {
        if mtl::read_libraries(&argument, 0, &mut library, context, &mut unheard).is_err() {
            return false;
        }
    }
    library.table.materials.iter().any(|material| material.normal_texture.is_some())
}

/// The index of the material that faces name. Faces before any `usemtl` have the name `default`, for which no warning is counted.
fn material_of(library: &mut Library, name: &str, context: &Context<'_>, warnings: &mut Warnings) -> u32 {
    let mut unspoken = Warnings::default();
    let warnings = if name == "default" { &mut unspoken } else { warnings };
    library.table.get_or_default(name, context.file, warnings)
}

/// Memory that the threads of a load may use. Each thread books memory before it goes on, and stops when none is left.
struct Allowance {
    left: u64,
    used: AtomicU64,
}

impl Allowance {
    fn new(context: &Context<'_>) -> Self {
        Self { left: context.budget.left(), used: AtomicU64::new(0) }
    }

    /// Books `bytes`; returns `false` if the allowance is exceeded.
    fn take(&self, bytes: u64) -> bool {
        self.used.fetch_add(bytes, Ordering::Relaxed).saturating_add(bytes) <= self.left
    }

    /// Books the threads' sum with the load's budget. Fails if the threads had to stop.
    fn settle(self, what: &str, context: &mut Context<'_>) -> Result<(), SceneError> {
        context.budget.take(context.file, what, self.used.into_inner())
    }
}

/// Bytes that a thread has used but not yet booked.
struct Purse<'a> {
    allowance: &'a Allowance,
    unbooked: u64,
}

impl<'a> Purse<'a> {
    fn new(allowance: &'a Allowance) -> Self {
        Self { allowance, unbooked: 0 }
    }

    /// Counts `bytes`; returns `false` if the allowance is exceeded.
    fn spend(&mut self, bytes: u64) -> bool {
        self.unbooked += bytes;
        self.unbooked <= BLOCK || self.book()
    }

    fn book(&mut self) -> bool {
        self.allowance.take(std::mem::take(&mut self.unbooked))
    }
}

impl Drop for Purse<'_> {
    fn drop(&mut self) {
        self.book();
    }
}
