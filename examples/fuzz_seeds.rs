//! Writes the seeds of the fuzz targets, each into the folder of its target: `fuzz_seeds fuzz/corpus`.

#[path = "../pipeline/tests/fuzz_targets/mod.rs"]
#[allow(dead_code, reason = "the bodies are run elsewhere")]
mod fuzz_targets;
#[path = "../passes/tests/fuzz_render/input.rs"]
#[allow(dead_code, reason = "the inputs are run elsewhere")]
mod input;
#[path = "../pipeline/tests/fuzz_targets/seeds.rs"]
mod seeds;

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let Some(corpus) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: fuzz_seeds FOLDER");
        std::process::exit(2);
    };
    let names = fuzz_targets::TARGETS.iter().map(|target| target.name).chain(["shader", "script"]);
    let loaders = names
        .flat_map(|target| seeds::of(target).into_iter().map(move |(name, bytes)| (target, name.to_owned(), bytes)));
    let renders = input::seeds().into_iter().map(|(name, bytes)| ("render", name, bytes));
    for (target, name, bytes) in loaders.chain(renders) {
        let folder = corpus.join(target);
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}
