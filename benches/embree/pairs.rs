//! Visibility of pairs of triangles beside the plain loop over Embree: 64 segments a pair in packets of sixteen, every one traced.

use crate::contest::{Contestant, Times, rounds};
use crate::duel::{Tree, pool};
use crate::rng::Numbers;
use curitiba::passes::trace::{Bvh, PACKET, Packet, Quality, SurfacePoint};
use curitiba::passes::visibility::{Class, Estimator, NearPairs, Options, PairSource as _, Row, Surfaces};
use curitiba::pipeline::scene::Geometry;
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

/// Triangles of which the near pairs are taken.
const ROWS: usize = 300;
/// The share by which pairs are near, as without a choice.
const NEAR: f64 = 0.01;
/// Segments a pair, as without a choice.
const SEGMENTS: usize = 64;
/// Point sets of the plain loop; a pair takes one of them.
const SETS: usize = 64;
/// Pairs that a thread takes at a time.
const GRAIN: usize = 256;

#[derive(Serialize)]
pub struct PairRow {
    threads: usize,
    pairs: usize,
    /// Of those, that are decided without a segment.
    exact: usize,
    /// Mean of the visibilities that both know, ours and theirs, and how far a pair's two differ on average.
    means: [f64; 2],
    difference: f64,
    ours: Times,
    embree_name: String,
    embree: Times,
    embree_robust: Times,
    /// Ours over the fastest Embree: pairs a processor second, pairs a second.
    ratio: f64,
    ratio_robust: f64,
    ratio_wall: f64,
}

/// Of each of some triangles, chosen by a seed, the pairs that the program takes without a choice.
fn near(surfaces: &Surfaces) -> Vec<[u32; 2]> {
    let mut numbers = Numbers::new(25);
    let (mut source, mut pairs) = (NearPairs::new(surfaces, NEAR), Vec::new());
    for _ in 0..ROWS {
        let row = (numbers.unit() * surfaces.len() as f32) as u32;
        source.seek([row.into(), 0]).expect("rows are places");
        let first = pairs.len();
        source.fill(1, &mut pairs).expect("it needs no file");
        let mut index = 0;
        pairs.retain(|pair| {
            index += 1;
            index <= first || pair[0] == row
        });
    }
    pairs
}

/// A triangle as the plain loop sees it: corners off the surface by their error bounds, as ours, and the front.
struct Patch {
    corners: [Vec3; 3],
    normal: Vec3,
}

/// Points for the segments of a pair.
struct PointSet {
    /// Shares of the second and third corner, of both triangles.
    shares: [[f32; SEGMENTS]; 4],
}

impl PointSet {
    /// Points of the plastic sequence in four dimensions, turned by a number each (Roberts 2018): as even as what a plain loop takes.
    #[allow(clippy::needless_range_loop, reason = "an index stands for a place in several arrays")]
    fn new(numbers: &mut Numbers) -> Self {
        // The root of x⁵ = x + 1.
        const ROOT: f64 = 1.167_303_978_261_418_7;
        let turns = [(); 4].map(|()| f64::from(numbers.unit()));
        let mut shares = [[0.0; SEGMENTS]; 4];
        for index in 0..SEGMENTS {
            let at = |axis: usize| (turns[axis] + index as f64 * ROOT.powi(-1 - axis as i32)).fract();
            for side in 0..2 {
                let (root, part) = (at(2 * side).sqrt(), at(2 * side + 1));
                shares[2 * side][index] = (root * (1.0 - part)) as f32;
                shares[2 * side + 1][index] = (root * part) as f32;
            }
        }
        Self { shares }
    }
}

/// The visibility of a pair by one segment after the other; NaN if none leaves both fronts.
fn plain(tree: &Tree, patches: &[Patch], sets: &[PointSet], [a, b]: [u32; 2]) -> f32 {
    let (p, q) = (&patches[a as usize], &patches[b as usize]);
    let shares = &sets[(a ^ b.wrapping_mul(31)) as usize % SETS].shares;
    let [[ab, ac], [de, df]] =
        [p, q].map(|patch| [patch.corners[1] - patch.corners[0], patch.corners[2] - patch.corners[0]]);
    let (mut valid, mut blocked) = (0, 0);
    for first in (0..SEGMENTS).step_by(PACKET) {
        let mut packet = Packet::new(0.0, 1.0);
        let (mut leaving, mut arriving) = ([0.0_f32; PACKET], [0.0_f32; PACKET]);
        for axis in 0..3 {
            for lane in 0..PACKET {
                let place = first + lane;
                let from = p.corners[0][axis] + shares[0][place] * ab[axis] + shares[1][place] * ac[axis];
                let to = q.corners[0][axis] + shares[2][place] * de[axis] + shares[3][place] * df[axis];
                let along = to - from;
                packet.origin[axis][lane] = from;
                packet.direction[axis][lane] = along;
                leaving[lane] += p.normal[axis] * along;
                arriving[lane] -= q.normal[axis] * along;
            }
        }
        for lane in 0..PACKET {
            packet.active |= u16::from((leaving[lane] > 0.0) & (arriving[lane] > 0.0)) << lane;
        }
        if packet.active != 0 {
            valid += packet.active.count_ones();
            blocked += tree.scene.occluded16(&packet, true, |_, _| true).count_ones();
        }
    }
    (valid - blocked) as f32 / valid as f32
}

/// Ours and every tree of Embree on the near pairs of a scene.
pub fn measure(geometry: &Geometry, trees: &[Tree], threads: usize, count: usize) -> PairRow {
    let surfaces = Surfaces::new(geometry, &[]);
    let pairs = near(&surfaces);
    let bvh = Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::default());
    let estimator = Estimator::new(&surfaces, &bvh, Options::default()).expect("options of our own");
    let patches: Vec<Patch> = (0..geometry.triangles.len() as u32)
        .map(|id| {
            let corners = geometry.corners(id);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            let start = |corner: Vec3| {
                let point = SurfacePoint::snap(geometry, id, corner);
                point.spawn(point.normal)
            };
            Patch { corners: corners.map(start), normal }
        })
        .collect();
    let mut numbers = Numbers::new(64);
    let sets: Vec<PointSet> = (0..SETS).map(|_| PointSet::new(&mut numbers)).collect();
    let theirs = |tree: &Tree, seen: &mut Vec<f32>| {
        let each = pairs.par_iter().with_min_len(GRAIN);
        each.map(|pair| plain(tree, &patches, &sets, *pair)).collect_into_vec(seen);
        pairs.len() as u64
    };
    let workers = pool(threads);
    let mut found: Vec<Vec<f32>> = trees.iter().map(|_| Vec::new()).collect();
    let mut rows: Vec<Row> = Vec::new();
    let mut contestants = vec![Contestant::new("curitiba", || {
        estimator.rows(&pairs, &mut rows);
        pairs.len() as u64
    })];
    for (tree, seen) in trees.iter().zip(&mut found) {
        contestants.push(Contestant::new(tree.name.clone(), || theirs(tree, seen)));
    }
    rounds(&mut contestants, count, &workers);
    let times: Vec<Times> = contestants.iter().map(|contestant| contestant.times.clone()).collect();
    drop(contestants);
    let fastest = |robust: bool| {
        let candidates = (0..trees.len()).filter(|&index| trees[index].robust == robust);
        let cost = |index: usize| times[index + 1].cost();
        candidates.min_by(|&a, &b| cost(a).total_cmp(&cost(b))).expect("there is a tree of each kind")
    };
    let (best, careful) = (fastest(false), fastest(true));
    let both: Vec<[f64; 2]> = rows
        .iter()
        .zip(&found[best])
        .filter_map(|(row, theirs)| Some([row.visibility?, f64::from(*theirs)]).filter(|[_, theirs]| !theirs.is_nan()))
        .collect();
    let mean = |of: &dyn Fn(&[f64; 2]) -> f64| both.iter().map(of).sum::<f64>() / both.len().max(1) as f64;
    let (ours, embree, embree_robust) = (times[0].clone(), times[best + 1].clone(), times[careful + 1].clone());
    let row = PairRow {
        threads,
        pairs: pairs.len(),
        exact: rows.iter().filter(|row| row.class != Class::Sampled).count(),
        means: [mean(&|both| both[0]), mean(&|both| both[1])],
        difference: mean(&|[ours, theirs]| (ours - theirs).abs()),
        ratio: embree.cost() / ours.cost(),
        ratio_robust: embree_robust.cost() / ours.cost(),
        ratio_wall: embree.wall() / ours.wall(),
        ours,
        embree_name: trees[best].name.clone(),
        embree,
        embree_robust,
    };
    let rate = |times: &Times| 1e-3 * row.pairs as f64 / times.wall();
    println!(
        "  pairs on {threads}: {} of which {} exact; {:.1} thousand a second, {} {:.1}, robust {:.1}: ratio {:.2} (robust {:.2}, clock {:.2}); mean {:.4} and {:.4}, differing by {:.4}",
        row.pairs,
        row.exact,
        rate(&row.ours),
        row.embree_name,
        rate(&row.embree),
        rate(&row.embree_robust),
        row.ratio,
        row.ratio_robust,
        row.ratio_wall,
        row.means[0],
        row.means[1],
        row.difference,
    );
    row
}
