//! One set of rays, traced in all modes of both sides.

use crate::api::Scene;
use crate::contest::{Contestant, Times, rounds};
use crate::rays::{self, Count, Differences, Keep, Mode, Question, Rays};
use curitiba::passes::trace::Bvh;
use serde::Serialize;

#[derive(Serialize)]
pub struct Side {
    name: String,
    million_rays_per_cpu_second: f64,
    million_rays_per_second: f64,
    times: Times,
}

#[derive(Serialize)]
pub struct RayRow {
    rays: &'static str,
    threads: usize,
    count: u64,
    hits: u64,
    /// Differences between our answers and those of Embree's fastest mode, over trees without the robust flag.
    differences: Differences,
    robust_differences: Differences,
    ours: Side,
    ours_single: Side,
    embree: Side,
    embree_single: Side,
    embree_robust: Side,
    /// Our rays per processor second, divided by those of Embree's mode that was the fastest in the first round, over trees without the robust flag.
    ratio: f64,
    ratio_robust: f64,
    /// The same ratio for single rays.
    ratio_single: f64,
    /// Rate of every mode, ours and Embree's, in the first round, in million rays per processor second.
    first_round: Vec<(String, f64)>,
}

/// A tree of Embree, with its name.
pub struct Tree {
    pub name: String,
    pub scene: Scene,
    pub robust: bool,
    pub streams: bool,
}

/// A pool with this number of threads.
pub fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
}

fn side(contestant: &Contestant<'_>, rays: u64) -> Side {
    let Contestant { name, times, .. } = contestant;
    Side {
        name: name.clone(),
        million_rays_per_cpu_second: rays as f64 / times.cost() / 1e6,
        million_rays_per_second: rays as f64 / times.wall() / 1e6,
        times: times.clone(),
    }
}

/// Measures one set of rays in all modes.
pub fn duel(set: &Rays, bvh: &Bvh, trees: &[Tree], threads: usize, count: usize) -> RayRow {
    let workers = pool(threads);
    let mut modes = Vec::new();
    for tree in trees {
        let mut kinds = vec![Mode::Single];
        for coherent in [false, true] {
            kinds.push(Mode::Packets { coherent });
            if tree.streams {
                kinds.push(Mode::Stream { coherent });
            }
        }
        modes.extend(kinds.into_iter().map(|mode| (tree, mode)));
    }
    let enter = |(tree, mode): (&Tree, Mode)| -> String { format!("{}, {}", tree.name, mode.name()) };
    let fastest = |contestants: &[Contestant<'_>], wanted: &dyn Fn(&Tree, Mode) -> bool| {
        let candidates = modes.iter().zip(contestants).filter(|((tree, mode), _)| wanted(tree, *mode));
        let best = candidates.min_by(|a, b| a.1.times.cost().total_cmp(&b.1.times.cost()));
        *best.expect("there is a tree of each kind").0
    };
    let mut first: Vec<Contestant<'_>> = modes
        .iter()
        .map(|&(tree, mode)| Contestant::new(enter((tree, mode)), move || rays::theirs(set, &tree.scene, mode, &Count)))
        .collect();
    rounds(&mut first, 1, &workers);
    let best = fastest(&first, &|tree, _| !tree.robust);
    let single = fastest(&first, &|tree, mode| !tree.robust && mode == Mode::Single);
    let robust = fastest(&first, &|tree, _| tree.robust);

    let our_modes = match set.question {
        Question::Fans => vec![Mode::Near, Mode::Fans, Mode::Packets { coherent: true }],
        _ => vec![Mode::Packets { coherent: true }],
    };
    let mine = Keep::new(set);
    let alone = rays::ours(set, bvh, Mode::Single, &mine);
    for &mode in &our_modes {
        let keep = Keep::new(set);
        let together = rays::ours(set, bvh, mode, &keep);
        assert_eq!(alone, together, "{}: ours find the same hits one by one and as {}", set.name, mode.name());
        assert_eq!(mine.counts(), keep.counts(), "{}: in the same packets, as {}", set.name, mode.name());
        if !matches!(mode, Mode::Near | Mode::Fans) {
            let own = mine.differences(&keep);
            assert_eq!((own.hit, own.distance, own.triangle), (0, 0, 0), "{}: and the same ones", set.name);
        }
    }
    let mut our_first: Vec<Contestant<'_>> = our_modes
        .iter()
        .map(|&mode| Contestant::new(format!("curitiba, {}", mode.name()), move || rays::ours(set, bvh, mode, &Count)))
        .collect();
    rounds(&mut our_first, 1, &workers);
    let cheapest = our_first.iter().zip(&our_modes).min_by(|a, b| a.0.times.cost().total_cmp(&b.0.times.cost()));
    let our_mode = *cheapest.expect("we have a mode").1;
    let compare = |(tree, mode): (&Tree, Mode)| {
        let theirs = Keep::new(set);
        rays::theirs(set, &tree.scene, mode, &theirs);
        mine.differences(&theirs)
    };
    let (differences, robust_differences) = (compare(best), compare(robust));
    let allowed = set.count / 1000 + 10;
    assert!(differences.hit + differences.distance <= allowed, "{}: {differences:?}", set.name);

    let peer =
        |(tree, mode)| Contestant::new(enter((tree, mode)), move || rays::theirs(set, &tree.scene, mode, &Count));
    let mut final_round = vec![
        Contestant::new(format!("curitiba, {}", our_mode.name()), || rays::ours(set, bvh, our_mode, &Count)),
        peer(best),
        peer(robust),
        Contestant::new("curitiba, single", || rays::ours(set, bvh, Mode::Single, &Count)),
        peer(single),
    ];
    rounds(&mut final_round, count, &workers);
    let [ours, embree, embree_robust, ours_single, embree_single] =
        std::array::from_fn(|index| side(&final_round[index], set.count));
    let ratio = |a: &Side, b: &Side| a.million_rays_per_cpu_second / b.million_rays_per_cpu_second;
    let row = RayRow {
        rays: set.name,
        threads,
        count: set.count,
        hits: final_round[0].result,
        differences,
        robust_differences,
        ratio: ratio(&ours, &embree),
        ratio_robust: ratio(&ours, &embree_robust),
        ratio_single: ratio(&ours_single, &embree_single),
        first_round: our_first
            .iter()
            .chain(&first)
            .map(|mode| (mode.name.clone(), set.count as f64 / mode.times.cost() / 1e6))
            .collect(),
        ours,
        ours_single,
        embree,
        embree_single,
        embree_robust,
    };
    println!(
        "  {:16} {threads} threads  ours {:6.1} ({})  embree {:6.1} ({})  ratio {:5.2}  robust {:6.1} {:5.2}  single {:5.1} {:5.1} {:5.2}  differ {:?}",
        row.rays,
        row.ours.million_rays_per_cpu_second,
        our_mode.name(),
        row.embree.million_rays_per_cpu_second,
        row.embree.name,
        row.ratio,
        row.embree_robust.million_rays_per_cpu_second,
        row.ratio_robust,
        row.ours_single.million_rays_per_cpu_second,
        row.embree_single.million_rays_per_cpu_second,
        row.ratio_single,
        (differences.hit, differences.distance, differences.triangle),
    );
    if set.question == Question::Fans {
        let own: Vec<String> =
            row.first_round[..our_modes.len()].iter().map(|(name, rate)| format!("{name} {rate:.1}")).collect();
        println!("    {}", own.join(", "));
    }
    row
}
