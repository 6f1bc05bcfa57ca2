//! Builds the wide tree: from obvhs's binary tree to nodes and leaves.

use super::collapse::Plan;
use super::effort::Quality;
use super::emit::{Emitted, emit};
use super::input::{Survey, Triangles};
use super::leaf_format::LeafFormat;
use super::ploc::binary_tree;
use crate::trace::tree::{Bounds, Child, Node};
use curitiba_pipeline::progress::Progress;

/// Steps of a build: the survey of the triangles, the binary tree, its collapse, and the writing.
pub(crate) const STEPS: u64 = 4;

/// The wide tree, with leaves in the layout `L`.
pub(crate) struct Built<L> {
    pub(crate) nodes: Vec<Node>,
    pub(crate) leaves: Vec<L>,
    pub(crate) root: Child,
    pub(crate) bounds: Bounds,
    /// Number of triangles in the tree.
    pub(crate) triangles: usize,
}

/// Builds the tree over the triangles with finite corners. The result does not depend on the number of threads.
pub(crate) fn build<L: LeafFormat>(triangles: &Triangles<'_>, quality: Quality) -> Built<L> {
    build_until(triangles, quality, &Progress::default()).expect("nobody asks to give it up")
}

/// As [`build`], but may be cancelled; `None` then. Cancellation is checked between the four steps and, except in obvhs's step, between the
/// parts that threads take. The caller has started `progress`, which advances by one for each step.
pub(crate) fn build_until<L: LeafFormat>(
    triangles: &Triangles<'_>,
    quality: Quality,
    progress: &Progress,
) -> Option<Built<L>> {
    let survey = Survey::new(triangles, L::MOST, progress)?;
    progress.advance(1);
    let (bounds, count) = (survey.bounds, survey.triangles);
    let tree = binary_tree(triangles, survey, quality.effort(count), progress)?;
    progress.advance(1);
    if tree.nodes.is_empty() {
        return Some(Built { nodes: Vec::new(), leaves: Vec::new(), root: Child::NONE, bounds, triangles: 0 });
    }
    let plan = Plan::new::<L>(&tree, progress)?;
    drop(tree);
    progress.advance(1);
    let Emitted { nodes, leaves, root } = emit(&plan, triangles, progress)?;
    progress.advance(1);
    Some(Built { nodes, leaves, root, bounds, triangles: count })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Bvh;
    use crate::trace::simd::LANES;
    use curitiba_pipeline::progress::Cancellation;
    use curitiba_pipeline::scene::{Batch, Geometry, TriangleRanges};
    use glam::Vec3;
    use std::sync::atomic::{AtomicBool, Ordering, fence};

    /// A wavy surface of `count` triangles; every 97th of them lies on one spot. Large counts make several threads
    /// share the work.
    fn waves(count: u32) -> Geometry {
        let mut geometry = Geometry::default();
        for triangle in 0..count {
            let (x, z) = ((triangle % 181) as f32, (triangle / 181) as f32);
            let y = (x * 0.3).sin() + (z * 0.2).cos();
            for [dx, dz] in [[0.0, 0.0], [1.0, 0.1], [0.3, 1.0]] {
                geometry.positions.push(if triangle % 97 == 0 {
                    Vec3::new(dx, 9.0, dz)
                } else {
                    Vec3::new(x + dx, y, z + dz)
                });
            }
            geometry.triangles.push([3 * triangle, 3 * triangle + 1, 3 * triangle + 2]);
        }
        geometry.batches.push(Batch { material: 0, first: 0, count });
        geometry
    }

    fn bytes(bvh: &Bvh) -> (String, String) {
        (format!("{:?}", bvh.tree.nodes), format!("{:?}", bvh.tree.leaves))
    }

    #[test]
    fn the_tree_is_the_same_bit_by_bit_whatever_the_number_of_threads() {
        let geometry = waves(40_000);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| Bvh::build(&geometry, &[], Quality::Balanced))
        };
        let one = with(1);
        let all = bytes(&one);
        for threads in [2, 3, 8] {
            assert!(bytes(&with(threads)) == all, "{threads} threads");
        }
        // The comparison can fail: another effort gives another tree.
        assert!(bytes(&Bvh::build(&geometry, &[], Quality::Fast)) != all);
    }

    #[test]
    fn a_build_that_is_given_up_gives_nothing_and_one_that_is_not_the_tree() {
        // Half of the triangles are of a sky, which has a tree of its own.
        let mut geometry = waves(60_000);
        geometry.batches =
            vec![Batch { material: 0, first: 0, count: 30_000 }, Batch { material: 1, first: 30_000, count: 30_000 }];
        geometry.sky = TriangleRanges::of_triangles(&geometry, &[false, true]);
        let whole = bytes(&Bvh::build(&geometry, &[], Quality::Balanced));
        let stop = Cancellation::new();
        stop.cancel();
        assert!(Bvh::build_until(&geometry, &[], Quality::Balanced, &Progress::until(&stop)).is_none());
        // Cancelled after each of the four steps of both trees, by another thread: at most the running step is completed.
        let mut given_up = [0; 2];
        for after in (0..2 * STEPS).cycle().take(80) {
            let (stop, over) = (Cancellation::new(), AtomicBool::new(false));
            let progress = Progress::until(&stop);
            let (built, asked) = std::thread::scope(|scope| {
                let watcher = scope.spawn(|| {
                    while !over.load(Ordering::Relaxed) && (progress.get().1 == 0 || progress.get().0 < after) {
                        std::hint::spin_loop();
                    }
                    stop.cancel();
                    fence(Ordering::SeqCst);
                    progress.get().0
                });
                let built = Bvh::build_until(&geometry, &[], Quality::Balanced, &progress);
                over.store(true, Ordering::Relaxed);
                (built, watcher.join().expect("the watcher does not panic"))
            });
            let end = progress.get().0;
            assert!(end - asked <= 1, "{asked} steps were done when it was asked, {end} at last");
            match built {
                Some(bvh) => assert!(end == 2 * STEPS && bytes(&bvh) == whole),
                None => given_up[usize::from(end >= STEPS)] += 1,
            }
        }
        assert!(given_up.iter().all(|count| *count > 0), "{given_up:?}");
    }

    #[test]
    fn every_triangle_is_in_one_block_and_every_box_holds_what_is_below_it() {
        for count in [1, 2, 9, 500, 40_000] {
            let geometry = waves(count);
            let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
            let mut seen = vec![0; count as usize];
            let mut pending = vec![(bvh.tree.root, bvh.tree.bounds)];
            let inside = |outer: Bounds, inner: Bounds| outer.union(inner) == outer;
            while let Some((child, bounds)) = pending.pop() {
                if child.is_leaf() {
                    let leaf = &bvh.tree.leaves[child.index()];
                    for lane in (0..LANES).filter(|&lane| !leaf.corners(lane)[0][0].is_nan()) {
                        seen[leaf.triangle(lane) as usize] += 1;
                        assert!(inside(bounds, Bounds::of(&leaf.corners(lane).map(Vec3::from))));
                    }
                    continue;
                }
                let node = &bvh.tree.nodes[child.index()];
                for lane in (0..LANES).filter(|&lane| node.children[lane] != Child::NONE) {
                    let own = node.bounds(lane);
                    assert!(inside(bounds, own));
                    pending.push((node.children[lane], own));
                }
            }
            assert!(seen.iter().all(|&times| times == 1), "{count} triangles");
        }
    }
}
