//! The tables in the documents are generated from measurements. Between the lines
//!
//! ```text
//! <!-- figures: KIND FILE.json OPTION=VALUE … -->
//! <!-- end of figures -->
//! ```
//!
//! of a Markdown file stands the output of this program for `docs/measurements/FILE.json`, and nothing typed by hand.
//! `CURITIBA_WRITE_FIGURES=1 cargo test --test figures` writes it; without the variable, a difference is a failure.
//!
//! | kind | source of the file | table |
//! |---|---|---|
//! | `machine` | any command that writes an environment | a sentence: processor, threads, devices, commit, date, command |
//! | `cases` | `curitiba bench`, several files | a row for each case: the frame and the error in each file, and the 2014 report's frame |
//! | `pictures` | `curitiba bench` | a row for each row of the file: the error of the effect, and of the picture |
//! | `backends` | `examples/conformance`, several files | a row for each ray pass: device milliseconds of each backend; `names=` names the files |
//! | `agreement` | `examples/conformance`, several files | a row for each ray pass: how far each backend's picture differs from the processor's |
//! | `counts` | `curitiba bench`, several files | a row for each case with a ray pass: rays of each kind |
//! | `threads` | `curitiba bench --sweep-threads` | a row for each step: milliseconds on each number of threads, and the speed-up |
//! | `rays` | the bench beside Embree, several files | by scene: rays per second, ratios; `threads=16`: 16 threads, `single=yes`: single rays too |
//! | `listed` | any program that names its columns | the table that `table=` names |
//! | `passes`, `builds` | the bench beside Embree, several files | whole ray passes, and building, beside Embree's |
//! | `growth` | the bench beside Embree with `--growth` | a row for each kind of work: milliseconds by triangles and pixels, exponents, efficiency |

mod tables;

use curitiba::bench::threads::ThreadsFile;
use curitiba::report::plots::threads_plot;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const BEGIN: &str = "<!-- figures:";
const END: &str = "<!-- end of figures -->";

/// The contents of a marker.
struct Request {
    kind: String,
    /// Names of files in `docs/measurements/`, without `.json`.
    files: Vec<String>,
    options: BTreeMap<String, String>,
}

impl Request {
    /// Reads `KIND FILE.json … NAME=VALUE; …`: options follow the files; each option ends with a semicolon or at the end of the marker.
    fn read(text: &str) -> Result<Self, String> {
        let (kind, rest) = text.trim().split_once(' ').ok_or("a kind and a file are wanted")?;
        let mut rest = rest.trim_start();
        let mut files = Vec::new();
        while let Some((name, after)) = rest.split_once(".json").filter(|(name, _)| !name.contains(['=', ' '])) {
            files.push(name.to_owned());
            rest = after.trim_start();
        }
        if files.is_empty() {
            return Err(format!("`{rest}` names no .json file"));
        }
        let options = rest.split(';').map(str::trim).filter(|option| !option.is_empty());
        let pair = |option: &str| {
            option.split_once('=').map(|(name, value)| (name.trim().to_owned(), value.trim().to_owned()))
        };
        let options = options.map(|option| pair(option).ok_or_else(|| format!("`{option}` is not NAME=VALUE")));
        Ok(Self { kind: kind.to_owned(), files, options: options.collect::<Result<_, _>>()? })
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README and all documents.
fn documents() -> Vec<PathBuf> {
    let mut found = vec![root().join("README.md")];
    for folder in ["docs", "docs/lab"] {
        let entries = std::fs::read_dir(root().join(folder)).expect("the folder");
        let files = entries.map(|entry| entry.expect("an entry").path());
        found.extend(files.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    }
    found.sort();
    found
}

fn measurement(name: &str) -> Result<Value, String> {
    let path = root().join("docs/measurements").join(format!("{name}.json"));
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
}

/// The commit at which a file was measured; an error if it is unknown or the checkout had changes.
fn commit<'f>(name: &str, file: &'f Value) -> Result<&'f str, String> {
    let commit = file["environment"]["commit"].as_str().unwrap_or("unknown");
    if commit == "unknown" || commit.ends_with("-dirty") {
        return Err(format!("{name}.json was measured at commit `{commit}`: measure it again in a clean checkout"));
    }
    Ok(commit)
}

/// The document with every table generated anew. Adds the kind and the commit of each quoted file to `quoted`.
fn rewrite(text: &str, quoted: &mut BTreeSet<(String, String, String)>) -> Result<String, String> {
    let mut out = String::new();
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        out.push_str(line);
        out.push('\n');
        let Some(asked) = line.trim().strip_prefix(BEGIN) else { continue };
        let at = |message: String| format!("line {}: {message}", number + 1);
        let asked = asked.strip_suffix("-->").ok_or_else(|| at("the marker does not end with -->".to_owned()))?;
        let request = Request::read(asked).map_err(at)?;
        let files = request.files.iter().map(|name| measurement(name)).collect::<Result<Vec<_>, _>>().map_err(at)?;
        for (name, file) in request.files.iter().zip(&files) {
            let commit = commit(name, file).map_err(at)?;
            quoted.insert((request.kind.clone(), name.clone(), commit.to_owned()));
        }
        let table = tables::table(&request.kind, &files, &request.options).map_err(at)?;
        out.push_str(&table);
        lines.find(|(_, line)| line.trim() == END).ok_or_else(|| at(format!("no `{END}` follows")))?;
        out.push_str(END);
        out.push('\n');
    }
    Ok(out)
}

/// Numbers of milliseconds, with their lines, outside of generated tables and quoted text.
fn typed_milliseconds(text: &str) -> Vec<(usize, String)> {
    let (mut generated, mut quoted) = (false, false);
    let mut found = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        quoted ^= line.trim_start().starts_with("```");
        generated = generated && line.trim() != END || line.trim().starts_with(BEGIN);
        if generated || quoted {
            continue;
        }
        for (at, _) in line.match_indices(" ms") {
            let digits = line[..at].rsplit(|c: char| !(c.is_ascii_digit() || c == '.')).next().unwrap_or_default();
            let is_unit = !line[at + " ms".len()..].starts_with(char::is_alphanumeric);
            if is_unit && digits.starts_with(|c: char| c.is_ascii_digit()) {
                found.push((number, format!("{digits} ms")));
            }
        }
    }
    found
}

/// Times measured on a particular day belong in `docs/lab`, with their machine and commit; in other documents they are generated from a file.
#[test]
fn no_measured_time_is_typed() {
    // Constants of the program.
    let constants = [("viewer.md", &["50 ms", "150 ms", "250 ms"][..]), ("wgpu_rays.md", &["20 ms"])];
    for path in documents().iter().filter(|path| !path.starts_with(root().join("docs/lab"))) {
        let known = constants.iter().find(|(name, _)| path.ends_with(name)).map_or(&[][..], |(_, known)| known);
        let mut typed = typed_milliseconds(&std::fs::read_to_string(path).expect("UTF-8"));
        typed.retain(|(_, time)| !known.contains(&time.as_str()));
        assert!(typed.is_empty(), "{}: {typed:?}: quote a measurement, or note it in docs/lab", path.display());
    }
    let text = "takes 4.5 ms\n```\nframe 5 ms\n```\n<!-- figures: machine a.json -->\n6 ms\n<!-- end of figures -->\n7 ms, 8 msec";
    assert_eq!(typed_milliseconds(text), [(1, "4.5 ms".to_owned()), (8, "7 ms".to_owned())]);
}

#[test]
fn the_documents_hold_what_was_measured() {
    let write = std::env::var_os("CURITIBA_WRITE_FIGURES").is_some();
    let mut quoted = BTreeSet::new();
    for path in documents() {
        let text = std::fs::read_to_string(&path).expect("UTF-8");
        let made = rewrite(&text, &mut quoted).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        if write && made != text {
            std::fs::write(&path, &made).expect("written");
        } else if let Some((line, (now, made))) = text.lines().zip(made.lines()).enumerate().find(|(_, (a, b))| a != b)
        {
            panic!(
                "{}:{}: the table is not that of its measurement\n{now}\n{made}\n\
                 CURITIBA_WRITE_FIGURES=1 cargo test --test figures writes it",
                path.display(),
                line + 1
            );
        }
        assert!(write || made == text, "{}: a table has more or fewer rows than its measurement", path.display());
    }
    // Figures of one kind come from one commit. Those against Embree name their commit in each row.
    let mut commits: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (kind, _, commit) in quoted
        .iter()
        .filter(|(kind, ..)| !["machine", "rays", "passes", "builds", "growth", "listed"].contains(&kind.as_str()))
    {
        commits.entry(kind.clone()).or_default().insert(commit.clone());
    }
    for (kind, commits) in commits {
        assert!(commits.len() == 1, "`{kind}` is quoted of several commits: {commits:?}");
    }
}

/// The curves that documents show: image, measurement, and which of its cases.
const CURVES: [(&str, &str, usize); 7] = [
    ("threads-SSAO", "cores_threads", 0),
    ("threads-Final-Vidro", "cores_threads", 3),
    ("threads-Shadows", "cores_threads", 4),
    ("threads-Reflect-Vidro", "cores_threads", 7),
    ("threads-Refract-Vidro", "cores_threads", 9),
    ("threads-load-triangles", "cores_load", 0),
    ("threads-load-textures", "cores_load", 1),
];

#[test]
fn the_curves_of_time_against_threads_are_those_of_what_was_measured() {
    let write = std::env::var_os("CURITIBA_WRITE_FIGURES").is_some();
    for (image, measured, case) in CURVES {
        let file: ThreadsFile = serde_json::from_value(measurement(measured).expect("a file")).expect("of threads");
        let made = threads_plot(&file.cases[case]).expect("a plot").file;
        let path = root().join(format!("docs/images/{image}.svg"));
        if write {
            std::fs::write(&path, &made).expect("written");
        }
        let there = std::fs::read_to_string(&path).expect("the image");
        assert!(
            there == made,
            "{image}.svg is not drawn from {measured}.json: CURITIBA_WRITE_FIGURES=1 cargo test --test figures"
        );
    }
}

#[test]
fn a_wrong_marker_or_figure_is_found() {
    let rewrite = |text: &str| rewrite(text, &mut BTreeSet::new());
    let machine = "<!-- figures: machine epyc_table2.json -->";
    let made = rewrite(&format!("a\n{machine}\nold\n{END}\nb\n")).expect("it is made");
    assert!(made.starts_with(&format!("a\n{machine}\n")) && made.ends_with(&format!("{END}\nb\n")), "{made}");
    assert!(made.contains("AMD EPYC") && made.contains("1250df0") && !made.contains("old"), "{made}");
    assert_eq!(rewrite(&made).as_ref(), Ok(&made), "made again it is the same");
    let wrong = [
        ("<!-- figures: machine -->\n", "a kind and a file are wanted"),
        ("<!-- figures: machine none.json -->\n", "none.json"),
        ("<!-- figures: tables epyc_table2.json -->\n", "there is no kind `tables`"),
        ("<!-- figures: cases epyc_table2.json names=a; view=Nowhere -->\n", "no row"),
        ("<!-- figures: machine epyc_table2.json\n", "does not end with -->"),
    ];
    for (text, message) in wrong {
        let error = rewrite(&format!("{text}{END}\n")).expect_err(text);
        assert!(error.starts_with("line 1: ") && error.contains(message), "{error}");
    }
    for changed in [serde_json::json!({}), serde_json::json!({"environment": {"commit": "611cfbd-dirty"}})] {
        assert!(commit("a", &changed).is_err_and(|error| error.contains("measure it again in a clean checkout")));
    }
    let open = rewrite(&format!("{machine}\n")).expect_err("it is open");
    assert!(open.contains("follows"), "{open}");
}
