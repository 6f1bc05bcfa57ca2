//! Writes the seeds of the fuzz targets, each into the folder of its target: `fuzz_seeds fuzz/corpus`.

#[path = "../tests/fuzz_targets/mod.rs"]
#[allow(dead_code, reason = "the bodies are run elsewhere")]
mod fuzz_targets;
#[path = "../tests/fuzz_targets/seeds.rs"]
mod seeds;

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let Some(corpus) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: fuzz_seeds FOLDER");
        std::process::exit(2);
    };
    for target in fuzz_targets::TARGETS {
        let folder = corpus.join(target.name);
        std::fs::create_dir_all(&folder)?;
        for (name, bytes) in seeds::of(target.name) {
            std::fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(())
}
