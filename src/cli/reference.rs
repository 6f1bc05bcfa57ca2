//! `curitiba reference`: renders the picture that rows are compared with.

use super::progress::Bars;
use super::reference_args::ReferenceArgs;
use super::render_output::check_extension;
use super::{Failure, bench_parts, check_references, failure, set_threads};
use curitiba::bench::Case;
use curitiba::pipeline::files::{check_outputs, record_files_read};
use curitiba::pipeline::image::{Layer, write_displayed, write_exr_of};
use curitiba::reference::{Made, ReferenceError, References};
use curitiba::{Choice, OpenError};
use std::time::Duration;

impl From<ReferenceError> for Failure {
    fn from(error: ReferenceError) -> Self {
        match error {
            ReferenceError::Open(error) => error.into(),
            ReferenceError::Render(error) => OpenError::Render(error).into(),
            error @ (ReferenceError::Picture(_) | ReferenceError::NoPicture(_) | ReferenceError::NoNoise) => {
                Self::Usage(error.to_string())
            }
            error => Self::work(error),
        }
    }
}

/// Renders the reference, stores it, and writes it to a requested file.
pub fn run(args: &ReferenceArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    let shard = bench_parts::shard(args.shard)?;
    let output = args.output.as_deref();
    if let Some(path) = output {
        check_extension(path)?;
        check_outputs([(path, "reference")])?;
    }
    let folder = args.references.clone().unwrap_or_else(References::default_folder);
    check_references(&folder, "--references names another folder")?;
    record_files_read();
    let case = Case::new(&args.path, args.settings(), Choice::CPU)?;
    let mut references = References::new(folder.clone(), Duration::ZERO);
    let mut bars = Bars::default();
    let made = references.make(&case, args.of.into(), args.samples, shard, &mut bars)?;
    drop(bars);
    let warnings = references.take_warnings();
    warnings.iter().for_each(|warning| failure::print_warning(warning));
    let (reference, took) = match made {
        Made::Whole(reference, took) => (reference, took),
        Made::Part(part) => {
            crate::say!("shard {shard}: {} of {} blocks, {} of them were there", part.mine, part.blocks, part.found);
            let joins = "the same command without --shard joins them";
            crate::say!("{} of {} blocks are in {}; {joins}", part.kept, part.blocks, folder.display());
            return Ok(());
        }
    };
    let size = [reference.picture.width, reference.picture.height];
    crate::say!("{}: {}, {} x {}", args.path.display(), reference.what, size[0], size[1]);
    crate::say!("standard error {:.5} (root mean square over pixels and colours)", reference.own_error);
    match took {
        Some(took) => crate::say!("rendered in {:.1} s", took.as_secs_f64()),
        None => crate::say!("it was kept already"),
    }
    if let Some(path) = output {
        check_outputs([(path, "reference")])?;
        let layer = Layer { name: "reference", channels: ["R", "G", "B", "A"], image: &reference.picture };
        let exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
        let written = match exr {
            true => write_exr_of(path, layer, Some(case.display.space)),
            false => write_displayed(path, &reference.picture, case.display),
        };
        written.map_err(|error| Failure::Work(format!("{}: {error}", path.display())))?;
        crate::say!("wrote {}", path.display());
    }
    if warnings.is_empty() {
        crate::say!("kept as {} in {}", reference.key, folder.display());
    }
    Ok(())
}
