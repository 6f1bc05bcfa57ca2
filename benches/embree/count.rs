//! Runs one kind of work once, in a function of its own, so that its instructions can be counted
//! (`benches/embree/instructions.sh`).

use crate::api::{Build, Embree};
use crate::duel::pool;
use crate::rays::{self, Count, Mode, Question};
use crate::scenes;
use crate::tree;
use curitiba::passes::trace::{Bvh, Quality};
use std::path::Path;
use std::sync::Arc;

/// The function whose instructions callgrind counts.
#[inline(never)]
pub fn counted_region(work: &mut (dyn FnMut() -> u64 + Send)) -> u64 {
    std::hint::black_box(work())
}

/// Runs `build`, or the rays of this name, once on one thread: with our tracer (`embree` is `None`) or with an Embree.
///
/// # Errors
/// The reason why it cannot be done.
pub fn count(
    kind: &str,
    scene: &str,
    folder: Option<&Path>,
    size: u32,
    embree: Option<&Arc<Embree>>,
) -> Result<(), String> {
    let subject = scenes::open(scene, folder, size)?;
    let geometry = &subject.scene.geometry;
    let workers = pool(1);
    let name = embree.map_or_else(|| "curitiba".to_owned(), |embree| format!("embree {}", embree.version));
    let build = Build { high: false, robust: false, threads: 1 };
    let counted = |mut work: Box<dyn FnMut() -> u64 + Send + '_>| workers.install(|| counted_region(&mut work));
    if kind == "build" {
        match embree {
            None => counted(Box::new(|| Bvh::build(geometry, &[], Quality::Balanced).node_count() as u64)),
            Some(embree) => {
                let mut input = Some(tree::input(geometry, &[]));
                let mut built = Ok(0);
                counted(Box::new(|| {
                    let input = input.take().expect("it is built once");
                    built = tree::commit(embree, input, build).map(|scene| scene.bytes() as u64);
                    0
                }));
                built?
            }
        };
        println!("{name}, build: {} triangles", geometry.triangles.len());
        return Ok(());
    }
    let bvh = Bvh::build(geometry, &[], Quality::Balanced);
    let sets = rays::generate(&subject, &bvh, size);
    let known = || sets.iter().map(|set| set.name).collect::<Vec<_>>().join(", ");
    let set =
        sets.iter().find(|set| set.name == kind).ok_or_else(|| format!("{kind}: known are build, {}", known()))?;
    let hits = match embree {
        None => {
            let mode = if set.question == Question::Fans { Mode::Near } else { Mode::Packets { coherent: true } };
            counted(Box::new(|| rays::ours(set, &bvh, mode, &Count)))
        }
        Some(embree) => {
            let scene = tree::commit(embree, tree::input(geometry, &[]), build)?;
            counted(Box::new(move || rays::theirs(set, &scene, Mode::Packets { coherent: true }, &Count)))
        }
    };
    println!("{name}, {kind}: {} rays, {hits} hits", set.count);
    Ok(())
}
