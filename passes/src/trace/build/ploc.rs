//! Builds the binary tree with obvhs (PLOC: parallel locally-ordered clustering).

use super::effort::{Effort, Search};
use super::input::{InputLeaf, Survey, Triangles};
use bytemuck::Zeroable;
use curitiba_pipeline::progress::Progress;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};
use rayon::prelude::*;

/// Overlap (see [`overlap`]) above which reinsertion is skipped: its search for a better place prunes by area, and among thousands of equal
/// boxes it visits all of them for each candidate. Ordinary scenes have an overlap of 50 to 300.
const MAX_OVERLAP: f64 = 1000.0;

/// Greatest growth of a leaf's box on each side, as a share of its longest side.
const GROWTH: f32 = 1.0 / 64.0;

/// Nodes that a thread takes at a time.
const GRAIN: usize = 8192;

/// The binary tree over leaves of one triangle or two: `prim_count` triangles from id `first_index` on.
///
/// Two consecutive triangles that share an edge are one leaf if the box around both is small enough ([`Survey::new`]): meshes are full of
/// such pairs, and obvhs has half the work.
///
/// obvhs's clustering merges neighbours that prefer each other. It loses its linear time where costs tie (a row of equal boxes merges one
/// pair a pass), overflow or are NaN. So obvhs is given boxes scaled to a unit cube and grown on each side by a pseudo-random length, at
/// most about 1/64 of their longest side. Only the topology of its tree is used, and the areas of its boxes, which weight costs.
///
/// `None` if cancelled. That is checked before the library clusters and before it optimises, but not inside either.
pub(crate) fn binary_tree(
    triangles: &Triangles<'_>,
    survey: Survey,
    effort: Effort,
    progress: &Progress,
) -> Option<Bvh2> {
    let count = survey.leaves.len();
    if count == 0 {
        return Some(Bvh2::default());
    }
    let bounds = survey.bounds;
    let low = bounds.low.as_dvec3();
    let scale = 1.0 / (bounds.high.as_dvec3() - low).max_element().max(f64::from(f32::MIN_POSITIVE));
    let leaf = |few: &InputLeaf| {
        let (first, count) = (few.first(), few.count());
        let alone = triangles.extent(first);
        let own = if count == 2 { alone.union(triangles.extent(first + 1)) } else { alone };
        let least = Vec3A::from(((own.low.as_dvec3() - low) * scale).as_vec3());
        let most = Vec3A::from(((own.high.as_dvec3() - low) * scale).as_vec3());
        let size = (most - least).max_element() * GROWTH + 1.0e-6;
        let [below, above] = noise(first);
        Bvh2Node::new(Aabb::new(least - below * size, most + above * size), count, first)
    };
    let mut builder = PlocBuilder::new();
    survey.leaves.par_iter().with_min_len(GRAIN).map(leaf).collect_into_vec(&mut builder.current_nodes);
    drop(survey);
    builder.next_nodes = touched(count);
    builder.mortons = touched(count.div_ceil(2));
    if progress.is_cancelled() {
        return None;
    }
    let mut tree = Bvh2 { nodes: touched(2 * count - 1), ..Bvh2::default() };
    // Morton codes are computed in a cube: in the scene's own box, random growth along a flat side would fill the highest bits of the code.
    let cube = Aabb::new(Vec3A::splat(-2.0 * GROWTH), Vec3A::splat(1.0 + 2.0 * GROWTH));
    let (precision, threshold) = (SortPrecision::U64, effort.threshold);
    match effort.search {
        Search::One => builder.build_ploc_from_leaves::<1, false>(&mut tree, cube, precision, threshold),
        Search::Five => builder.build_ploc_from_leaves::<5, false>(&mut tree, cube, precision, threshold),
        Search::ThirtyTwo => builder.build_ploc_from_leaves::<32, false>(&mut tree, cube, precision, threshold),
    }
    drop(builder);
    if progress.is_cancelled() {
        return None;
    }
    if effort.reinsertion > 0.0 && overlap(&tree) < MAX_OVERLAP {
        ReinsertionOptimizer::default().run(&mut tree, effort.reinsertion, None);
    }
    Some(tree)
}

/// A list of zeros, written by all threads so that each page is touched in parallel. obvhs itself writes most of its memory first from one
/// thread, which would wait for the pages.
fn touched<T: Zeroable + Send>(count: usize) -> Vec<T> {
    (0..count).into_par_iter().with_min_len(GRAIN).map(|_| T::zeroed()).collect()
}

/// Sum of the surface areas of all nodes over that of the root; the same for any number of threads.
fn overlap(tree: &Bvh2) -> f64 {
    let area = |node: &Bvh2Node| f64::from(node.aabb().half_area());
    let parts: Vec<f64> = tree.nodes.par_chunks(GRAIN).map(|nodes| nodes.iter().map(area).sum()).collect();
    parts.iter().sum::<f64>() / area(&tree.nodes[0])
}

/// Six pseudo-random numbers in 0..1, ten bits each, from a counter (SplitMix64: Steele, Lea and Flood, "Fast Splittable Pseudorandom
/// Number Generators", OOPSLA 2014).
fn noise(counter: u32) -> [Vec3A; 2] {
    let mut word = (u64::from(counter) + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    word = (word ^ word >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    word = (word ^ word >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^= word >> 31;
    let at = |place: u32| (word >> (10 * place) & 1023) as f32 * (1.0 / 1024.0);
    [Vec3A::new(at(0), at(1), at(2)), Vec3A::new(at(3), at(4), at(5))]
}
