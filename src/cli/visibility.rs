//! `curitiba visibility`: visibility of many pairs of triangles.

use super::progress::Bars;
use super::visibility_args::{Pairs, VisibilityArgs};
use super::{Failure, failure, print_warnings, set_threads};
use curitiba::environment::peak_memory;
use curitiba::passes::trace::{Bvh, Quality};
use curitiba::passes::visibility::{
    AllPairs, Class, DeviceEstimator, Effort, Estimator, NearPairs, Options, PairSource, RowFinder, RowPairs, Surfaces,
};
use curitiba::pipeline::executor::{Observer as _, Progress, StepKind};
use curitiba::pipeline::files::{OutputError, Resumable, check_outputs, record_files_read};
use curitiba::pipeline::memory::mebibytes;
use curitiba::pipeline::project;
use curitiba::visibility::{self, Format, ListedPairs, Loaded, StreamError, Summary, Target};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Loads the scene, builds the structure, and streams the rows to the output.
pub fn run(args: &VisibilityArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    let options = args.options();
    options.check().map_err(Failure::Usage)?;
    let backend = args.backend.choice().ok_or_else(|| {
        Failure::Usage(
            "--backend fastest: pictures are measured for it; valid here: auto, cpu, wgpu, cuda, optix".to_owned(),
        )
    })?;
    let format = Format::of(&args.output).map_err(Failure::Usage)?;
    check_outputs([(&*args.output, "rows")])?;
    Resumable::at(&args.output).map_err(|error| OutputError::Io { path: args.output.clone(), error })?;
    // No file that is read may be replaced.
    record_files_read();
    let mut bars = Bars::default();
    let loaded = load(args, &mut bars)?;
    print_warnings(&loaded.warnings);
    let start = Instant::now();
    bars.begin(StepKind::Build, "triangles", &Arc::new(Progress::default()));
    let surfaces = Surfaces::new(&loaded.scene.geometry, &loaded.see_through);
    let device = visibility::segment_tracer(backend, &surfaces);
    let built = device.map(|device| match device {
        Some(device) => Ok(device),
        None => Err(Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::default())),
    });
    bars.end();
    let engine = match &built {
        Ok(Ok(device)) => Engine { name: device.name(), device: Some(device.device()) },
        _ => Engine { name: "cpu", device: None },
    };
    warn(&surfaces);
    let (mut source, pairs) = source(args, &surfaces)?;
    check_outputs([(&*args.output, "rows")])?;
    let target = Target {
        path: args.output.clone(),
        format,
        about: about(&loaded, &options, &pairs, engine.name),
        resume: args.resume,
    };
    let bvh;
    let mut finder: Box<dyn RowFinder> = match built.map_err(Failure::work)? {
        Ok(device) => Box::new(DeviceEstimator::new(&surfaces, device, options).map_err(Failure::Usage)?),
        Err(own) => {
            bvh = own;
            Box::new(Estimator::new(&surfaces, &bvh, options).map_err(Failure::Usage)?)
        }
    };
    let built = start.elapsed();
    let progress = Arc::new(Progress::default());
    let start = Instant::now();
    bars.begin(StepKind::Rays, "pairs", &progress);
    let summary = visibility::stream(&mut *finder, &mut *source, &target, &progress);
    bars.end();
    let summary = summary.map_err(|error| match error {
        StreamError::Pairs(message) => Failure::Input(message),
        StreamError::Interrupted(message) => Failure::Usage(message),
        error => Failure::work(error),
    })?;
    let times = [built.as_secs_f64(), start.elapsed().as_secs_f64()];
    print(args, &surfaces, &summary, &engine, times)
}

/// The engine that traced.
struct Engine {
    name: &'static str,
    device: Option<String>,
}

fn load(args: &VisibilityArgs, bars: &mut Bars) -> Result<Loaded, Failure> {
    let is_project = |path: &Path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"));
    let named = args.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(" + ");
    let project = match &args.files[..] {
        [only] if is_project(only) => {
            let project = project::load(only)?;
            failure::print_warnings_of(&project.problems);
            Some(project)
        }
        files if files.iter().any(|file| is_project(file)) => {
            return Err(Failure::Usage("a project stands alone: name one .xml, or scene files".to_owned()));
        }
        _ => None,
    };
    bars.begin(StepKind::Load, &named, &Arc::new(Progress::default()));
    let loaded = match &project {
        Some(project) => visibility::load_project(project, args.max_memory),
        None => visibility::load_files(&args.files, args.max_memory),
    };
    bars.end();
    Ok(loaded?)
}

fn warn(surfaces: &Surfaces) {
    if surfaces.duplicates() > 0 {
        failure::print_warning(&format!(
            "{} triangles lie in the place of another: neither blocks what the other sends",
            surfaces.duplicates()
        ));
    }
    if surfaces.see_through() > 0 {
        failure::print_warning(&format!(
            "{} triangles are of materials that are not opaque (glass, cut out by a texture): they block nothing",
            surfaces.see_through()
        ));
    }
}

fn source<'s>(args: &VisibilityArgs, surfaces: &'s Surfaces) -> Result<(Box<dyn PairSource + 's>, String), Failure> {
    let count = surfaces.len();
    Ok(match &args.pairs {
        Pairs::Near(least) => (Box::new(NearPairs::new(surfaces, *least)), format!("near:{least}")),
        Pairs::All => (Box::new(AllPairs::new(count)), "all".to_owned()),
        Pairs::Row(id) if (*id as usize) < count => (Box::new(RowPairs::new(count, *id)), format!("row:{id}")),
        Pairs::Row(id) => {
            let message = format!("row:{id}: the scene has {count} triangles, with ids from 0 on");
            return Err(Failure::Usage(message));
        }
        Pairs::File(path) => {
            let list = ListedPairs::open(path, count).map_err(Failure::Input)?;
            let name = format!("list {:032x}", list.hash());
            (Box::new(list), name)
        }
    })
}

/// A line with everything that the rows depend on.
fn about(loaded: &Loaded, options: &Options, pairs: &str, engine: &str) -> String {
    // `cuda` gives the same rows as the processor, bit for bit.
    let tracer = if ["cpu", "cuda"].contains(&engine) { String::new() } else { format!(", traced by {engine}") };
    let effort = match options.effort {
        Effort::Samples(samples) => format!("{samples} samples"),
        Effort::Error(error) => format!("error {error}"),
    };
    let marks: String = loaded.see_through.iter().map(|mark| if *mark { '1' } else { '0' }).collect();
    let scene = loaded.scene.fingerprint() ^ curitiba::pipeline::scene::fnv1a(marks.as_bytes());
    format!(
        "curitiba {} visibility: scene {scene:032x}, pairs {pairs}, {effort}, facing {}, {} points, seed {}, {}{tracer}; opaque triangles block",
        env!("CARGO_PKG_VERSION"),
        format!("{:?}", options.facing).to_lowercase(),
        format!("{:?}", options.sampler).to_lowercase(),
        options.seed,
        if options.form_factors { "form factors" } else { "visibility" },
    )
}

fn print(
    args: &VisibilityArgs,
    surfaces: &Surfaces,
    summary: &Summary,
    engine: &Engine,
    [built, took]: [f64; 2],
) -> Result<(), Failure> {
    let pairs = summary.pairs();
    let here = pairs - summary.resumed;
    let classes = Class::ALL.map(|class| (class.name(), summary.classes[class as usize]));
    if args.json {
        let classes: serde_json::Map<String, serde_json::Value> =
            classes.iter().map(|(name, count)| ((*name).to_owned(), (*count).into())).collect();
        let json = serde_json::json!({
            "backend": engine.name,
            "device": engine.device,
            "threads": rayon::current_num_threads(),
            "triangles": surfaces.len(),
            "duplicates": surfaces.duplicates(),
            "see_through": surfaces.see_through(),
            "pairs": pairs,
            "resumed": summary.resumed,
            "classes": classes,
            "samples": summary.samples,
            "build_seconds": built,
            "seconds": took,
            "peak_memory": peak_memory(),
            "output": args.output,
        });
        crate::say!("{}", serde_json::to_string_pretty(&json).map_err(Failure::work)?);
        return Ok(());
    }
    let threads = rayon::current_num_threads();
    let device = engine.device.as_ref().map_or(String::new(), |device| format!(" and {device}"));
    crate::say!("{} triangles, {pairs} pairs, on {} ({threads} threads{})", surfaces.len(), engine.name, device);
    for (name, count) in classes {
        crate::say!("  {name:8} {count:>12}  {:5.1} %", 100.0 * count as f64 / pairs.max(1) as f64);
    }
    if summary.resumed > 0 {
        crate::say!("{} pairs were done by the interrupted run", summary.resumed);
    }
    let exact = pairs - summary.classes[Class::Sampled as usize];
    crate::say!(
        "{exact} pairs are exact; {} segments for the others; build {built:.2} s, pairs {took:.2} s, {:.0} pairs/s",
        summary.samples,
        here as f64 / took.max(1e-9)
    );
    if let Some(peak) = peak_memory() {
        crate::say!("peak memory {}", mebibytes(peak));
    }
    crate::say!("wrote {}", args.output.display());
    Ok(())
}
