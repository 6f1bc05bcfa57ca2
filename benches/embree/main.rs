//! Our ray passes against Intel's Embree: the same rays on the same triangles in the same run.
//!
//! `cargo bench --features embree --bench embree -- --scene square:100000 --out FILE.json`
//!
//! Embree is loaded at run time: `libembree3.so.3` if the system has it, and the library named by the environment
//! variable `CURITIBA_EMBREE` (version 3 or 4). Without either the bench prints so and ends. Real scenes are read from
//! the folder in `CURITIBA_SCENES`. For `--scene PATH@SEED`, `--scene room:300000@SEED` (also `far`, `foliage`,
//! `needles`, `soup`) and `--scene square:100000@SEED` the seed chooses the view, so that no person has chosen it.
//!
//! Before timing, every contestant's answers are compared with ours, ray by ray. Then all contestants take turns, round
//! after round; the medians of processor time are compared. Embree is timed in all its modes (single rays, packets of 16,
//! and streams, each with and without the hint that rays are coherent), on trees of both qualities. Later rounds use only the
//! mode that is fastest in the first round. Robust trees are timed as well, because watertightness must be compared with
//! them. `--pairs` also compares the visibility of near pairs of triangles. `--growth` measures only our tracer, over triangles,
//! pixels and threads. `--count KIND --side curitiba|3|4` runs one kind of work once, for `instructions.sh`.

mod api;
mod contest;
mod count;
mod duel;
mod effects;
mod flush;
mod growth;
mod layout;
mod pairs;
mod rays;
mod rng;
mod scenes;
mod shapes;
mod tree;

use api::{Build, Embree};
use contest::{Contestant, Times, rounds};
use curitiba::environment::Environment;
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::trace::{Bvh, Quality};
use curitiba::pipeline::backend::RayBackend as _;
use curitiba::pipeline::files::write_atomically;
use curitiba::pipeline::scene::Geometry;
use duel::{RayRow, Tree, duel, pool};
use effects::Picture;
use pairs::PairRow;
use scenes::Subject;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Number of times that each tree is built.
const BUILDS: usize = 5;

/// The request on the command line.
struct Request {
    scenes: Vec<String>,
    out: Option<PathBuf>,
    rounds: usize,
    size: u32,
    threads: Vec<usize>,
    /// Leaves out trees of high quality, for large scenes.
    medium: bool,
    effects: bool,
    rays: bool,
    /// Whether the visibility of near pairs is measured as well.
    pairs: bool,
    /// Triangles of the largest square in the growth measurement, which replaces the comparison.
    growth: Option<u32>,
    /// The kind of work to run once instead of the comparison; `side` is `curitiba` or a version of Embree.
    count: Option<String>,
    side: String,
}

impl Request {
    fn read() -> Result<Self, String> {
        let all = processors();
        let mut request = Self {
            scenes: Vec::new(),
            out: None,
            rounds: 5,
            size: 1024,
            threads: vec![1, all],
            medium: false,
            effects: true,
            rays: true,
            pairs: false,
            growth: None,
            count: None,
            side: "curitiba".to_owned(),
        };
        request.threads.dedup();
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            let number = |text: String| text.parse().map_err(|_| format!("{text} is no number"));
            match argument.as_str() {
                "--bench" => {}
                "--scene" => request.scenes.push(value()?),
                "--out" => request.out = Some(value()?.into()),
                "--rounds" => request.rounds = number(value()?)?,
                "--size" => request.size = number(value()?)? as u32 / 16 * 16,
                "--threads" => request.threads = vec![number(value()?)?],
                "--medium" => request.medium = true,
                "--no-effects" => request.effects = false,
                "--no-rays" => request.rays = false,
                "--pairs" => request.pairs = true,
                "--growth" => request.growth = Some(number(value()?)? as u32),
                "--count" => request.count = Some(value()?),
                "--side" => request.side = value()?,
                _ => {
                    return Err(format!(
                        "{argument} is unknown; there are --scene, --out, --rounds, --size, --threads, --medium, --no-effects, --no-rays, --pairs, --growth, --count and --side"
                    ));
                }
            }
        }
        if request.scenes.is_empty() {
            request.scenes.push("square:100000".to_owned());
        }
        Ok(request)
    }
}

/// The results file.
#[derive(Serialize)]
struct File {
    format: u32,
    command: String,
    started_unix_s: u64,
    environment: Environment,
    embree: Vec<String>,
    size: u32,
    rounds: usize,
    scenes: Vec<SceneRow>,
}

#[derive(Serialize)]
struct SceneRow {
    scene: String,
    triangles: usize,
    load_average: Option<f64>,
    builds: Vec<BuildRow>,
    rays: Vec<RayRow>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pairs: Vec<PairRow>,
    effects: Vec<EffectRow>,
}

#[derive(Serialize)]
struct BuildRow {
    name: String,
    /// Time on all processors.
    wall_s: Vec<f64>,
    median_s: f64,
    bytes_per_triangle: f64,
}

#[derive(Serialize)]
struct EffectRow {
    effect: &'static str,
    threads: usize,
    rays: u64,
    rays_certain: u64,
    rays_embree: u64,
    /// Pixels that differ in any bit, pixels that differ by more than 2 of 255, and the greatest difference.
    pixels_differing: usize,
    pixels_differing_visibly: usize,
    largest_difference: f32,
    robust_pixels_differing: usize,
    ours: Times,
    embree_name: String,
    embree: Times,
    embree_robust: Times,
    ratio: f64,
    ratio_robust: f64,
    ratio_wall: f64,
}

fn main() {
    if let Err(why) = run() {
        eprintln!("error: {why}");
        std::process::exit(1);
    }
}

fn run() -> Result<(), String> {
    let request = Request::read()?;
    let mut libraries = Vec::new();
    let named = std::env::var_os("CURITIBA_EMBREE").map(PathBuf::from);
    for path in [Some(PathBuf::from("libembree3.so.3")), named].into_iter().flatten() {
        match Embree::load(&path) {
            Ok(embree) => libraries.push(embree),
            Err(why) => println!("skipped: {why}"),
        }
    }
    let folder = std::env::var_os("CURITIBA_SCENES").map(PathBuf::from);
    if let Some(most) = request.growth {
        let threads = request.threads.iter().copied().max().unwrap_or(1);
        let growth = growth::measure(command(), request.size, most, threads, request.rounds)?;
        return request.out.as_ref().map_or(Ok(()), |out| save(out, &growth));
    }
    if let Some(kind) = &request.count {
        let wanted = libraries.iter().find(|embree| embree.version.starts_with(&request.side));
        if wanted.is_none() && request.side != "curitiba" {
            return Err(format!("no Embree {} is there", request.side));
        }
        return count::count(kind, &request.scenes[0], folder.as_deref(), request.size, wanted);
    }
    if libraries.is_empty() {
        println!("skipped: no Embree; install libembree-dev, or name the library in CURITIBA_EMBREE");
        return Ok(());
    }
    let mut file = File {
        format: 1,
        command: command(),
        started_unix_s: std::time::SystemTime::UNIX_EPOCH.elapsed().map_or(0, |time| time.as_secs()),
        environment: Environment::here(),
        embree: libraries.iter().map(|embree| embree.version.clone()).collect(),
        size: request.size,
        rounds: request.rounds,
        scenes: Vec::new(),
    };
    for name in &request.scenes {
        match scenes::open(name, folder.as_deref(), request.size) {
            Ok(subject) => file.scenes.push(measure(&subject, &libraries, &request)?),
            Err(why) => println!("skipped: {why}"),
        }
        if let Some(out) = &request.out {
            save(out, &file)?;
        }
    }
    Ok(())
}

fn save(out: &Path, file: &impl Serialize) -> Result<(), String> {
    let text = serde_json::to_string_pretty(file).map_err(|error| error.to_string())?;
    write_atomically(out, (text + "\n").as_bytes()).map_err(|error| error.to_string())
}

/// The command line, with folders removed from paths.
fn command() -> String {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
        .map(|argument| Path::new(&argument).file_name().map_or(argument.clone(), |name| name.to_string_lossy().into()))
        .collect();
    format!("cargo bench --features embree --bench embree -- {}", arguments.join(" "))
}

fn measure(subject: &Subject, libraries: &[Arc<Embree>], request: &Request) -> Result<SceneRow, String> {
    let geometry = &subject.scene.geometry;
    let triangles = geometry.triangles.len();
    println!("{}: {triangles} triangles", subject.name);
    let mut row = SceneRow {
        scene: subject.name.clone(),
        triangles,
        load_average: Environment::here().load_average,
        builds: Vec::new(),
        rays: Vec::new(),
        pairs: Vec::new(),
        effects: Vec::new(),
    };
    let (bvh, trees) = build(geometry, libraries, request, &mut row.builds)?;
    if request.rays {
        let sets = rays::generate(subject, &bvh, request.size);
        for set in &sets {
            for &threads in &request.threads {
                row.rays.push(duel(set, &bvh, &trees, threads, request.rounds));
            }
        }
    }
    if request.pairs {
        for &threads in &request.threads {
            row.pairs.push(pairs::measure(geometry, &trees, threads, request.rounds));
        }
    }
    drop((bvh, trees));
    if request.effects {
        for (name, job) in &subject.jobs {
            let filtered = job.filtered();
            let mut backend = CpuRays::new();
            backend.build(&subject.scene, &filtered).map_err(|error| error.to_string())?;
            let (trees, _) = theirs(geometry, &filtered, libraries, request)?;
            for &threads in &request.threads {
                row.effects.push(effect(name, job, subject, &mut backend, &trees, threads, request.rounds));
            }
        }
    }
    Ok(row)
}

/// Builds our tree and every tree of Embree in turns, and adds the times to `rows`. Returns the trees of the last round.
fn build(
    geometry: &Geometry,
    libraries: &[Arc<Embree>],
    request: &Request,
    rows: &mut Vec<BuildRow>,
) -> Result<(Bvh, Vec<Tree>), String> {
    let triangles = geometry.triangles.len() as f64;
    let workers = pool(processors());
    let mut seconds: Vec<Vec<f64>> = Vec::new();
    let mut last = None;
    for _ in 0..BUILDS {
        // The previous tree is freed before the next one is built, as in a program that loads another scene.
        drop(last.take());
        let start = Instant::now();
        let bvh = workers.install(|| Bvh::build(geometry, &[], Quality::Balanced));
        let own = start.elapsed().as_secs_f64();
        let (trees, others) = theirs(geometry, &[], libraries, request)?;
        seconds.push([vec![own], others].concat());
        last = Some((bvh, trees));
    }
    let (bvh, trees) = last.expect("there is a round");
    let others = trees.iter().map(|tree| (&*tree.name, tree.scene.bytes() as f64));
    let names = std::iter::once(("curitiba", bvh.bytes() as f64)).chain(others);
    for (place, (name, bytes)) in names.enumerate() {
        let wall_s: Vec<f64> = seconds.iter().map(|round| round[place]).collect();
        let (median_s, bytes_per_triangle) = (contest::median(&wall_s), bytes / triangles);
        println!("  build {name:28} {median_s:8.4} s on {}, {bytes_per_triangle:6.1} bytes a triangle", processors());
        rows.push(BuildRow { name: name.to_owned(), wall_s, median_s, bytes_per_triangle });
    }
    Ok((bvh, trees))
}

/// Builds every tree of Embree, and returns the seconds of each.
fn theirs(
    geometry: &Geometry,
    transparent: &[bool],
    libraries: &[Arc<Embree>],
    request: &Request,
) -> Result<(Vec<Tree>, Vec<f64>), String> {
    let (mut trees, mut seconds) = (Vec::new(), Vec::new());
    for embree in libraries {
        for (high, robust) in [(false, false), (true, false), (false, true)] {
            if high && request.medium {
                continue;
            }
            let quality = if high { "high" } else { "medium" };
            let name = format!("embree {} {quality}{}", embree.version, if robust { " robust" } else { "" });
            let input = tree::input(geometry, transparent);
            let start = Instant::now();
            let scene = tree::commit(embree, input, Build { high, robust, threads: processors() })?;
            seconds.push(start.elapsed().as_secs_f64());
            trees.push(Tree { name, scene, robust, streams: embree.streams() });
        }
    }
    Ok((trees, seconds))
}

/// Number of threads for builds, independent of the tracing threads. If a tree is built on one thread while another
/// exists, Embree 4 leaves a thread that never sleeps.
fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Measures one ray pass.
fn effect(
    name: &'static str,
    job: &scenes::OwnedJob,
    subject: &Subject,
    backend: &mut CpuRays,
    trees: &[Tree],
    threads: usize,
    count: usize,
) -> EffectRow {
    let workers = pool(threads);
    let scene = &*subject.scene;
    let mut mine = Picture::new(job, scene);
    let mut pictures: Vec<Picture> = trees.iter().map(|_| Picture::new(job, scene)).collect();
    let mut first: Vec<Contestant<'_>> = trees
        .iter()
        .zip(&mut pictures)
        .map(|(tree, picture)| {
            Contestant::new(tree.name.clone(), move || {
                effects::theirs(&tree.scene, job, scene, picture);
                picture.rays.total()
            })
        })
        .collect();
    // A single round selects the fastest tree, because the passes are long.
    rounds(&mut first, 0, &workers);
    let costs: Vec<f64> = first.iter().map(|contestant| contestant.times.cost()).collect();
    drop(first);
    let fastest = |robust: bool| {
        let candidates = (0..trees.len()).filter(|&index| trees[index].robust == robust);
        candidates.min_by(|&a, &b| costs[a].total_cmp(&costs[b])).expect("there is a tree of each kind")
    };
    let (best, robust) = (fastest(false), fastest(true));
    let (mut other, mut careful) = (Picture::new(job, scene), Picture::new(job, scene));
    let mut final_round = vec![
        Contestant::new("curitiba", || {
            effects::ours(backend, job, scene, &mut mine);
            mine.rays.total()
        }),
        Contestant::new(trees[best].name.clone(), || {
            effects::theirs(&trees[best].scene, job, scene, &mut other);
            other.rays.total()
        }),
        Contestant::new(trees[robust].name.clone(), || {
            effects::theirs(&trees[robust].scene, job, scene, &mut careful);
            careful.rays.total()
        }),
    ];
    rounds(&mut final_round, count, &workers);
    let times: Vec<Times> = final_round.iter().map(|contestant| contestant.times.clone()).collect();
    drop(final_round);
    let (pixels_differing, pixels_differing_visibly, largest_difference) = mine.differs(&other);
    let row = EffectRow {
        effect: name,
        threads,
        rays: mine.rays.total(),
        rays_certain: mine.rays.certain,
        rays_embree: other.rays.total(),
        pixels_differing,
        pixels_differing_visibly,
        largest_difference,
        robust_pixels_differing: mine.differs(&careful).0,
        ratio: times[1].cost() / times[0].cost(),
        ratio_robust: times[2].cost() / times[0].cost(),
        ratio_wall: times[1].wall() / times[0].wall(),
        ours: times[0].clone(),
        embree_name: trees[best].name.clone(),
        embree: times[1].clone(),
        embree_robust: times[2].clone(),
    };
    println!(
        "  {name:16} {threads} threads  ours {:7.1} ms  embree {:7.1} ms ({})  ratio {:5.2}  robust {:5.2}  pixels that differ {} ({} robust)",
        row.ours.wall() * 1e3,
        row.embree.wall() * 1e3,
        row.embree_name,
        row.ratio,
        row.ratio_robust,
        row.pixels_differing,
        row.robust_pixels_differing,
    );
    row
}
