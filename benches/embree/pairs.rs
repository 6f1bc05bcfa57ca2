//! Visibility of pairs of triangles: our estimator beside a plain loop over Embree, which traces 64 segments for each
//! pair, in packets of sixteen.

use crate::contest::{Contestant, Times, rounds};
use crate::duel::{Tree, pool};
use crate::rng::Numbers;
use curitiba::passes::trace::{Bvh, PACKET, Packet, Quality, SurfacePoint};
use curitiba::passes::visibility::{Class, Estimator, NearPairs, Options, PairSource as _, Row, Surfaces};
use curitiba::pipeline::scene::Geometry;
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

/// Number of triangles whose near pairs are measured.
const ROWS: usize = 300;
/// Form factor from which a pair counts as near; the program's default.
const NEAR: f64 = 0.01;
/// Segments for each pair; the program's default.
const SEGMENTS: usize = 64;
/// Number of point sets of the plain loop; each pair takes one of them.
const SETS: usize = 64;
/// Number of pairs that a thread takes at once.
const GRAIN: usize = 256;

#[derive(Serialize)]
pub struct PairRow {
    threads: usize,
    pairs: usize,
    /// Pairs that are decided without a segment.
    exact: usize,
    /// Mean visibility by our estimator and by the loop, over the pairs for which both have a value, and the mean difference of a pair.
    means: [f64; 2],
    difference: f64,
    ours: Times,
    embree_name: String,
    embree: Times,
    embree_robust: Times,
    /// Our rate over that of the fastest Embree: in pairs per processor second, and for `ratio_wall` in pairs per second.
    ratio: f64,
    ratio_robust: f64,
    ratio_wall: f64,
}

/// The near pairs, by the program's default, of some triangles that a seed chooses.
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

/// A triangle for the plain loop: its front normal, and its corners, moved off the surface by their error bounds as our
/// estimator does it.
struct Patch {
    corners: [Vec3; 3],
    normal: Vec3,
}

/// Points for the segments of a pair.
struct PointSet {
    /// Weights of the second and third corner, for both triangles.
    shares: [[f32; SEGMENTS]; 4],
}

impl PointSet {
    /// Points of the plastic sequence in four dimensions, with a random shift of each dimension (Roberts 2018). This is the most
    /// even distribution that a plain loop can have.
    #[allow(clippy::needless_range_loop, reason = "an index stands for a place in several arrays")]
    fn new(numbers: &mut Numbers) -> Self {
        // Root of x⁵ = x + 1.
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

/// The visibility of a pair, traced segment by segment; NaN if no segment leaves both fronts.
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

/// Measures our estimator and every Embree tree on the near pairs of a scene.
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
