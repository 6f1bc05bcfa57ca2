//! Markdown tables of measurements.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

type Options = BTreeMap<String, String>;

/// Generates the table of a kind.
pub fn table(kind: &str, files: &[Value], options: &Options) -> Result<String, String> {
    let one = || match files {
        [file] => Ok(file),
        _ => Err(format!("`{kind}` takes one file")),
    };
    match kind {
        "machine" => Ok(by_machine(one()?).iter().map(machine).collect()),
        "cases" => cases(&files.iter().flat_map(by_machine).collect::<Vec<_>>(), options),
        "backends" => backends(files, options),
        "agreement" => agreement(files, options),
        "counts" => counts(files, options),
        "pictures" => pictures(one()?, options),
        "threads" => threads(one()?, options),
        "rays" => rays(files, options),
        "passes" => passes(files),
        "builds" => builds(files),
        "growth" => growth(one()?),
        "listed" => listed(one()?, options),
        _ => {
            let valid =
                "machine, cases, pictures, backends, agreement, counts, threads, rays, passes, builds, growth, listed";
            Err(format!("there is no kind `{kind}`; valid: {valid}"))
        }
    }
}

/// A table whose columns are named by the measuring program.
fn listed(file: &Value, options: &Options) -> Result<String, String> {
    let name = options.get("table").ok_or("`listed` wants table=NAME")?;
    let table = &file["tables"][name.as_str()];
    let list = |value: &Value| value.as_array().cloned().filter(|list| !list.is_empty());
    let columns = list(&table["columns"]).ok_or_else(|| format!("there is no table `{name}`"))?;
    let shown = |value: &Value| match value {
        Value::String(text) => text.clone(),
        // Counts are printed as integers.
        number if number.is_u64() => number.to_string(),
        number => cell(number.as_f64()),
    };
    let line = |cells: &[Value]| format!("| {} |\n", cells.iter().map(shown).collect::<Vec<_>>().join(" | "));
    let mut out = line(&columns) + "|" + &"---|".repeat(columns.len()) + "\n";
    for row in list(&table["rows"]).unwrap_or_default() {
        let row = list(&row).filter(|row| row.len() == columns.len());
        out += &line(&row.ok_or_else(|| format!("a row of `{name}` has not as many cells as columns"))?);
    }
    Ok(out)
}

/// Splits a file that `curitiba merge` wrote into one file for each machine; any other file stays as it is.
fn by_machine(file: &Value) -> Vec<Value> {
    let machines = file["machines"].as_array().map_or(&[][..], Vec::as_slice);
    if machines.is_empty() {
        return vec![file.clone()];
    }
    let of = |(index, environment): (usize, &Value)| {
        let rows = file["rows"].as_array().into_iter().flatten();
        let own = rows.filter(|row| row["machine"].as_u64().unwrap_or(0) == index as u64);
        let mut one = file.clone();
        (one["rows"], one["environment"]) = (own.cloned().collect(), environment.clone());
        one
    };
    machines.iter().enumerate().map(of).collect()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or("?")
}

/// A number with three significant digits: 0.357, 12.9, 119.
pub fn short(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_owned(),
        size if size < 1e-3 => format!("{number:.0e}"),
        size if size < 1.0 => {
            let digits = 1 - size.log10().floor() as i32;
            format!("{number:.*}", digits.max(2) as usize)
        }
        size if size < 9.995 => format!("{number:.2}"),
        size if size < 99.95 => format!("{number:.1}"),
        _ => format!("{number:.0}"),
    }
}

/// The date of seconds since 1970, such as `2026-11-23`, by Howard Hinnant's algorithm for civil dates.
fn date(seconds: u64) -> String {
    let days = seconds / 86_400 + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{}-{month:02}-{of_month:02}", year + era * 400 + carry)
}

fn machine(file: &Value) -> String {
    let environment = &file["environment"];
    let mut devices: Vec<&str> = environment["gpu"].as_array().into_iter().flatten().map(text).collect();
    // Some commands list a name and a description of each device.
    devices.extend(file["devices"].as_array().into_iter().flatten().map(|device| text(&device[1])));
    let mut out = format!("{}, {} threads", text(&environment["cpu"]), environment["threads"]);
    for device in devices {
        let _ = write!(out, "; {device}");
    }
    let began = file["started_unix_s"].as_u64().or(file["unix_s"].as_u64()).unwrap_or(0);
    let commit = text(&environment["commit"]);
    let _ = write!(out, "; commit {commit}, {}", date(began));
    if let Some(load) = environment["load_average"].as_f64() {
        let _ = write!(out, ", load {load} when it began");
    }
    if let Some(frames) = file["frames"].as_u64() {
        let rounds = file["rounds"].as_u64().map_or(String::new(), |rounds| format!(" of each of {rounds} rounds"));
        let _ = write!(out, "; medians of {frames} frames{rounds}");
    }
    if let Some(command) = file["command"].as_str() {
        let _ = write!(out, "; `{command}`");
    }
    out + ".\n"
}

/// The rows of a bench in the view that the options name. If the options name labels, only rows with these labels, in their
/// order.
fn rows<'f>(file: &'f Value, options: &Options) -> Result<Vec<&'f Value>, String> {
    let all: Vec<&Value> = file["rows"].as_array().into_iter().flatten().collect();
    let seen = |row: &&&Value| options.get("view").is_none_or(|view| text(&row["view"]) == view);
    let rows: Vec<&Value> = match options.get("labels") {
        None => all.iter().filter(seen).copied().collect(),
        Some(labels) => {
            let of = |label: &str| {
                let found = all.iter().filter(seen).filter(|row| text(&row["label"]) == label.trim()).copied();
                let found: Vec<_> = found.collect();
                if found.is_empty() { Err(format!("no row is called `{}`", label.trim())) } else { Ok(found) }
            };
            labels.split('/').map(of).collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    if rows.is_empty() { Err("no row is of that view".to_owned()) } else { Ok(rows) }
}

fn cell(number: Option<f64>) -> String {
    number.map_or(String::new(), short)
}

/// Two errors of each row: of the effect, and of the picture. The latter is printed as "at most" where it is less than
/// twice the reference's own error.
fn pictures(file: &Value, options: &Options) -> Result<String, String> {
    let mut out = String::from(
        "| case | view | error of the effect | error of the picture | FLIP | the reference's own error |\n|---|---|---:|---:|---:|---:|\n",
    );
    for row in rows(file, options)? {
        let against = |error: &str, name: &str| row[error]["against"]["comparison"][name].as_f64();
        let own = row["picture_error"]["against"]["own_error"].as_f64();
        let picture = against("picture_error", "rmse").ok_or("a row has no error of its picture")?;
        let at_most = if own.is_some_and(|own| picture < 2.0 * own) { "≤ " } else { "" };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {at_most}{picture:.4} | {:.4} | {:.4} |",
            text(&row["label"]),
            text(&row["view"]),
            cell(against("error", "rmse")),
            against("picture_error", "flip").unwrap_or_default(),
            own.unwrap_or_default(),
        );
    }
    Ok(out)
}

/// The frame time and the error of each case in several files, beside the 2014 report's frame time where there is one.
/// The option `names` names the files, separated by `/`.
fn cases(files: &[Value], options: &Options) -> Result<String, String> {
    let names: Vec<&str> = options.get("names").ok_or("`names` is missing")?.split('/').map(str::trim).collect();
    if names.len() != files.len() {
        return Err(format!("{} names for {} files", names.len(), files.len()));
    }
    let tables = files.iter().map(|file| rows(file, options)).collect::<Result<Vec<_>, _>>()?;
    let report = tables[0].iter().any(|row| row["thesis"]["frame_ms"].is_number());
    let times = names.iter().map(|name| format!(" {name}, ms | error |")).collect::<String>();
    let mut out = format!("| effects | view |{}{times}\n|---|---|", if report { " report, ms |" } else { "" });
    let _ = writeln!(out, "{}", "---|".repeat(2 * names.len() + usize::from(report)));
    for row in &tables[0] {
        let _ = write!(out, "| {} | {} |", text(&row["label"]), text(&row["view"]));
        if report {
            let _ = write!(out, " {} |", cell(row["thesis"]["frame_ms"].as_f64()));
        }
        for table in &tables {
            let same = |other: &&&Value| other["label"] == row["label"] && other["view"] == row["view"];
            let found = table.iter().find(same);
            let number = |value: Option<&Value>| cell(value.and_then(Value::as_f64));
            let time = number(found.map(|row| &row["frame"]["median"]));
            let error = number(found.map(|row| &row["error"]["against"]["comparison"]["rmse"]));
            let _ = write!(out, " {time} | {error} |");
        }
        out.push('\n');
    }
    Ok(out)
}

/// An integer with commas between thousands, as the documents print counts.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let comma = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    let cell = |(at, digit)| [comma(at).then_some(','), Some(digit)];
    digits.chars().enumerate().flat_map(cell).flatten().collect()
}

/// Rays of each kind, for each row that a bench measured with a ray pass. With the option `view`, only the rows of one
/// camera are printed, without its column. The fidelity's column is omitted where all rows have the same.
fn counts(files: &[Value], options: &Options) -> Result<String, String> {
    const KINDS: [&str; 5] = ["shadow", "occlusion", "certain", "reflected", "refracted"];
    let tables = files.iter().map(|file| rows(file, options)).collect::<Result<Vec<_>, _>>()?;
    // Rows of the same project and view are adjacent, one from each file.
    let most = tables.iter().map(Vec::len).max().unwrap_or(0);
    let rows: Vec<&Value> =
        (0..most).flat_map(|row| tables.iter().filter_map(move |table| table.get(row))).copied().collect();
    let views = !options.contains_key("view");
    let fidelities = rows.iter().any(|row| row["fidelity"] != rows[0]["fidelity"]);
    let columns = [Some("project"), views.then_some("view"), fidelities.then_some("fidelity")];
    let columns: Vec<&str> = columns.into_iter().flatten().collect();
    let mut out = format!("| {} | {} |\n|", columns.join(" | "), KINDS.join(" | "));
    let _ = writeln!(out, "{}{}", "---|".repeat(columns.len()), "---:|".repeat(KINDS.len()));
    for row in rows {
        let steps: Vec<&Value> =
            row["steps"].as_array().into_iter().flatten().filter(|step| step["rays"].is_object()).collect();
        if steps.is_empty() {
            continue;
        }
        let path = text(&row["project"]);
        let stem = path.rsplit('/').next().and_then(|name| name.strip_suffix(".xml")).unwrap_or(path);
        let stem = stem.strip_prefix("Scene").unwrap_or(stem);
        let names = columns.iter().map(|column| if *column == "project" { stem } else { text(&row[*column]) });
        let sum = |kind: &str| steps.iter().map(|step| step["rays"][kind].as_u64()).sum::<Option<u64>>();
        let counted = KINDS.map(|kind| sum(kind).map(grouped).ok_or_else(|| format!("{path}: no count of `{kind}`")));
        let counted = counted.into_iter().collect::<Result<Vec<_>, _>>()?;
        let _ = writeln!(out, "| {} | {} |", names.collect::<Vec<_>>().join(" | "), counted.join(" | "));
    }
    Ok(out)
}

/// The key of a ray pass in `examples/conformance`: program, camera and number of the scene's triangles.
type Case<'f> = (&'f str, &'f str, u64);

/// A record of `examples/conformance`, with the name of its column.
type Column<'f> = (String, &'f Value);

/// The records of one fidelity, each with the name of its backend. The option `names`, separated by `/`, appends the name of the file.
fn records<'f>(files: &'f [Value], options: &Options) -> Result<Vec<Column<'f>>, String> {
    let fidelity = options.get("fidelity").map_or("corrected", String::as_str);
    let names: Vec<&str> =
        options.get("names").map_or_else(Vec::new, |names| names.split('/').map(str::trim).collect());
    if !names.is_empty() && names.len() != files.len() {
        return Err(format!("{} names for {} files", names.len(), files.len()));
    }
    let mut found = Vec::new();
    for (index, file) in files.iter().enumerate() {
        for record in file["records"].as_array().into_iter().flatten() {
            if text(&record["fidelity"]) == fidelity {
                let backend = text(&record["backend"]);
                let column = names.get(index).map_or_else(|| backend.to_owned(), |name| format!("{backend}, {name}"));
                found.push((column, record));
            }
        }
    }
    if found.is_empty() { Err("no row is of that fidelity".to_owned()) } else { Ok(found) }
}

fn case(record: &Value) -> Case<'_> {
    let triangles = record["triangles"].as_u64().unwrap_or(0);
    (text(&record["program"]), record["camera"].as_str().unwrap_or("its own"), triangles)
}

/// A row for each ray pass and a column for each backend. The column of triangles is left out where all scenes have the same number.
fn by_backend(found: &[Column<'_>], shown: impl Fn(&Value) -> String) -> String {
    let (mut columns, mut cases): (Vec<&str>, Vec<Case<'_>>) = (Vec::new(), Vec::new());
    for (column, record) in found {
        if !columns.contains(&column.as_str()) {
            columns.push(column);
        }
        if !cases.contains(&case(record)) {
            cases.push(case(record));
        }
    }
    let several = cases.iter().any(|other| other.2 != cases[0].2);
    let (head, line) = if several { ("triangles | ", "---:|") } else { ("", "") };
    let mut out = format!("| {head}program | view | {} |\n", columns.join(" | "));
    let _ = writeln!(out, "|{line}---|---|{}", "---|".repeat(columns.len()));
    for wanted in cases {
        let of = |column: &&str| {
            let same = |(name, record): &&Column<'_>| name == column && case(record) == wanted;
            found.iter().find(same).map_or_else(String::new, |(_, record)| shown(record))
        };
        let cells: Vec<String> = columns.iter().map(of).collect();
        let triangles = if several { format!("{} | ", grouped(wanted.2)) } else { String::new() };
        let _ = writeln!(out, "| {triangles}{} | {} | {} |", wanted.0, wanted.1, cells.join(" | "));
    }
    out
}

/// Device milliseconds of each ray pass on each backend. Results that disagree with the processor are marked.
fn backends(files: &[Value], options: &Options) -> Result<String, String> {
    let found = records(files, options)?;
    Ok(by_backend(&found, |record| {
        let wrong = if record["within_limits"] == false { " (beyond the limits)" } else { "" };
        cell(record["device_ms_median"].as_f64()) + wrong
    }))
}

/// How far the pictures of each ray pass differ from the processor's. The cell says that all bits are equal, or gives the greatest difference
/// if no pixel is off by more than 0.01, or else the number of such pixels.
fn agreement(files: &[Value], options: &Options) -> Result<String, String> {
    let found = records(files, options)?;
    if found.iter().any(|(_, record)| !record["comparison"].is_object()) {
        return Err("a row was not compared with the processor".to_owned());
    }
    Ok(by_backend(&found, |record| {
        let of = |name: &str| record["comparison"][name].as_u64().unwrap_or(0);
        let wrong = if record["within_limits"] == false { " (beyond the limits)" } else { "" };
        let told = match (of("pixels") - of("identical"), of("above_1e_2")) {
            (0, _) => "every bit".to_owned(),
            (_, 0) => format!("{} at most", cell(record["comparison"]["max_difference"].as_f64())),
            (_, 1) => "1 pixel".to_owned(),
            (_, pixels) => format!("{} pixels", grouped(pixels)),
        };
        told + wrong
    }))
}

fn threads(file: &Value, options: &Options) -> Result<String, String> {
    let wanted: Option<Vec<&str>> = options.get("steps").map(|steps| steps.split('/').collect());
    let mut out = String::new();
    let names: Vec<&str> = options.get("labels").map_or_else(Vec::new, |names| names.split('/').collect());
    for (index, case) in file["cases"].as_array().into_iter().flatten().enumerate() {
        for step in case["steps"].as_array().into_iter().flatten() {
            let kind = text(&step["kind"]);
            if wanted.as_ref().is_some_and(|wanted| !wanted.contains(&kind)) {
                continue;
            }
            let points: Vec<&Value> = step["points"].as_array().into_iter().flatten().collect();
            let (Some(first), Some(last)) = (points.first(), points.last()) else { continue };
            if out.is_empty() {
                let counts: Vec<String> = points.iter().map(|point| point["threads"].to_string()).collect();
                let _ = writeln!(out, "| case | view | step | {} | speed-up | processor time |", counts.join(" | "));
                let _ = writeln!(out, "|---|---|---|{}---|---|", "---|".repeat(counts.len()));
            }
            let wall = |point: &Value| point["wall"]["median"].as_f64();
            let cells: Vec<String> = points.iter().map(|point| cell(wall(point))).collect();
            let ratio = |clock: &str| Some(first[clock]["median"].as_f64()? / last[clock]["median"].as_f64()?);
            let (speed_up, growth) = (cell(ratio("wall")), cell(ratio("processor").map(f64::recip)));
            let label = names.get(index).copied().unwrap_or_else(|| text(&case["label"]));
            let view = text(&case["view"]);
            let _ = writeln!(out, "| {label} | {view} | {kind} | {} | {speed_up} | × {growth} |", cells.join(" | "));
        }
    }
    if out.is_empty() { Err("no row is of those steps".to_owned()) } else { Ok(out) }
}

/// A row for each scene: million rays per processor second, on one thread unless `threads` is set, and in brackets the ratios
/// to Embree's fastest mode and to its fastest watertight mode.
fn rays(files: &[Value], options: &Options) -> Result<String, String> {
    let mut out = String::new();
    let threads = options.get("threads").map_or(Ok(1), |threads| threads.parse::<u64>());
    let threads = threads.map_err(|error| format!("threads: {error}"))?;
    let with_single = options.contains_key("single");
    for file in files {
        for scene in file["scenes"].as_array().into_iter().flatten() {
            let rows = scene["rays"].as_array().into_iter().flatten();
            let rows: Vec<&Value> = rows.filter(|row| row["threads"].as_u64() == Some(threads)).collect();
            if out.is_empty() {
                let kinds: Vec<&str> = rows.iter().map(|row| text(&row["rays"])).collect();
                let _ = writeln!(out, "| scene | triangles | {} | commit |", kinds.join(" | "));
                let _ = writeln!(out, "|---|---|{}---|", "---|".repeat(kinds.len()));
            }
            let rate = |row: &&Value| {
                let number = |value: &Value| cell(value.as_f64());
                let ours = number(&row["ours"]["million_rays_per_cpu_second"]);
                let ratios = format!("{}, {}", number(&row["ratio"]), number(&row["ratio_robust"]));
                let single = if with_single { format!(", {}", number(&row["ratio_single"])) } else { String::new() };
                format!("{ours} ({ratios}{single})")
            };
            let cells: Vec<String> = rows.iter().map(rate).collect();
            let (name, commit) = (text(&scene["scene"]), text(&file["environment"]["commit"]));
            let _ = writeln!(out, "| {name} | {} | {} | {commit} |", scene["triangles"], cells.join(" | "));
        }
    }
    if out.is_empty() { Err("no scene was measured".to_owned()) } else { Ok(out) }
}

/// A row for each effect and number of threads: the ratio of our whole ray pass to the same program on Embree, by
/// processor time and by wall time.
fn passes(files: &[Value]) -> Result<String, String> {
    let mut out = "| scene | effect | threads | processor time | beside the watertight mode | by the clock | pixels that differ visibly |\n\
                   |---|---|---|---|---|---|---|\n"
        .to_owned();
    for scene in scenes(files) {
        for effect in scene["effects"].as_array().into_iter().flatten() {
            let ratio = |name: &str| cell(effect[name].as_f64());
            let (name, effect_name, threads) = (text(&scene["scene"]), text(&effect["effect"]), &effect["threads"]);
            let ratios = ["ratio", "ratio_robust", "ratio_wall"].map(ratio).join(" | ");
            let _ = writeln!(
                out,
                "| {name} | {effect_name} | {threads} | {ratios} | {} |",
                effect["pixels_differing_visibly"]
            );
        }
    }
    Ok(out)
}

/// A row for each scene: milliseconds of a build on all threads.
fn builds(files: &[Value]) -> Result<String, String> {
    let mut out = String::new();
    for scene in scenes(files) {
        let builds: Vec<&Value> = scene["builds"].as_array().into_iter().flatten().collect();
        if out.is_empty() {
            let names: Vec<&str> = builds.iter().map(|build| text(&build["name"])).collect();
            let _ = writeln!(out, "| ms | {} |\n|---|{}", names.join(" | "), "---|".repeat(names.len()));
        }
        let shown = |build: &&Value| cell(build["median_s"].as_f64().map(|seconds| seconds * 1e3));
        let cells: Vec<String> = builds.iter().map(shown).collect();
        let _ = writeln!(out, "| {} | {} |", text(&scene["scene"]), cells.join(" | "));
    }
    if out.is_empty() { Err("no scene was built".to_owned()) } else { Ok(out) }
}

/// A row for each kind of work: milliseconds against triangles and against pixels, each with the exponent of its power law, and
/// the efficiency of each number of threads relative to one thread.
fn growth(file: &Value) -> Result<String, String> {
    let points = |name: &str| file[name].as_array().cloned().unwrap_or_default();
    let (triangles, pixels) = (points("triangles"), points("pixels"));
    let slopes = |name: &str| points(name).iter().map(|slope| cell(slope["slope"].as_f64())).collect::<Vec<_>>();
    let (by_triangles, by_pixels) = (slopes("triangle_slopes"), slopes("pixel_slopes"));
    let works = triangles.first().and_then(|point| point["samples"].as_array()).ok_or("no growth was measured")?;

    let mut names = vec![String::new()];
    names.extend(
        triangles.iter().map(|point| format!("{} triangles", grouped(point["triangles"].as_u64().unwrap_or(0)))),
    );
    names.push("exponent".to_owned());
    names.extend(pixels.iter().map(|point| format!("{} pixels a side", point["size"])));
    names.push("exponent".to_owned());
    let efficiencies = points("efficiencies");
    let threads: BTreeSet<u64> = efficiencies.iter().filter_map(|one| one["threads"].as_u64()).collect();
    names.extend(
        threads.iter().map(|threads| format!("efficiency of {threads} threads, by the clock and by the processor")),
    );
    let mut out = format!("| {} |\n|{}\n", names.join(" | "), "---|".repeat(names.len()));

    for (index, work) in works.iter().enumerate() {
        let ms = |point: &Value| cell(median(&point["samples"][index]["times"]["cpu_s"]).map(|seconds| seconds * 1e3));
        let slope = |slopes: &[String]| slopes.get(index).cloned().unwrap_or_default();
        let mut cells = vec![text(&work["work"]).to_owned()];
        cells.extend(triangles.iter().map(ms));
        cells.push(slope(&by_triangles));
        cells.extend(pixels.iter().map(ms));
        cells.push(slope(&by_pixels));
        for count in &threads {
            let of = |one: &&Value| one["work"] == work["work"] && one["threads"] == *count;
            let one = efficiencies.iter().find(of).ok_or_else(|| format!("no efficiency of {count} threads"))?;
            let [clock, processor] = ["efficiency", "efficiency_cpu"].map(|name| cell(one[name].as_f64()));
            cells.push(format!("{clock}, {processor}"));
        }
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    Ok(out)
}

/// The median of a list of numbers; the upper one of the two middle numbers.
fn median(list: &Value) -> Option<f64> {
    let mut numbers: Vec<f64> = list.as_array()?.iter().filter_map(Value::as_f64).collect();
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

fn scenes(files: &[Value]) -> impl Iterator<Item = &Value> {
    files.iter().filter_map(|file| file["scenes"].as_array()).flatten()
}

#[test]
fn machines_of_a_merged_file_are_columns() {
    let row = |machine: u64, ms: f64| serde_json::json!({"label": "AO", "view": "Fonte", "machine": machine, "frame": {"median": ms}});
    let machines = serde_json::json!([{"cpu": "A", "threads": 2}, {"cpu": "B", "threads": 4}]);
    let file = serde_json::json!({"machines": machines, "rows": [row(0, 1.0), row(1, 2.0)]});
    let options = Options::from([("names".to_owned(), "one/two".to_owned())]);
    let made = table("cases", std::slice::from_ref(&file), &options).expect("a table");
    assert!(made.contains("| AO | Fonte | 1.00 |  | 2.00 |  |"), "{made}");
    let told = table("machine", &[file], &options).expect("sentences");
    let starts: Vec<&str> = told.lines().filter_map(|line| line.split(',').next()).collect();
    assert_eq!(starts, ["A", "B"]);
}

#[test]
fn rays_are_summed_over_passes_and_files_follow_each_other_by_row() {
    let rays = |shadow: u64| serde_json::json!({"shadow": shadow, "occlusion": 0, "certain": 2, "reflected": 0, "refracted": 0});
    let file = |fidelity: &str, shadow: u64| {
        let steps = serde_json::json!([{"rays": null}, {"rays": rays(shadow)}, {"rays": rays(1)}]);
        let row = serde_json::json!({"project": "a/SceneX.xml", "view": "Fonte", "fidelity": fidelity, "steps": steps});
        serde_json::json!({"rows": [row, {"project": "a/SceneNone.xml", "view": "Fonte", "fidelity": fidelity, "steps": []}]})
    };
    let files = [file("corrected", 999_999), file("thesis", 0)];
    let made = table("counts", &files, &Options::new()).expect("a table");
    let lines: Vec<&str> = made.lines().skip(2).collect();
    let rest = "0 | 4 | 0 | 0 |";
    assert_eq!(
        lines,
        [format!("| X | Fonte | corrected | 1,000,000 | {rest}"), format!("| X | Fonte | thesis | 1 | {rest}")]
    );
    let view = Options::from([("view".to_owned(), "Fonte".to_owned())]);
    let made = table("counts", &files[..1], &view).expect("a table");
    assert!(made.starts_with("| project | shadow |") && made.contains("| X | 1,000,000 |"), "{made}");
}

#[test]
fn ray_passes_are_rows_and_backends_columns() {
    let record = |backend: &str, triangles: u64, ms: f64, identical: u64, off: u64| {
        let comparison =
            serde_json::json!({"pixels": 9, "identical": identical, "above_1e_2": off, "max_difference": 3e-8});
        serde_json::json!({"backend": backend, "program": "ssao", "fidelity": "corrected", "triangles": triangles,
            "camera": "Vidro", "device_ms_median": ms, "within_limits": true, "comparison": comparison})
    };
    let file = |records: &[Value]| serde_json::json!({"records": records});
    let one = file(&[record("cuda", 5, 2.0, 9, 0), record("optix", 5, 4.0, 8, 0), record("cuda", 7000, 3.0, 1, 1234)]);
    let made = table("backends", std::slice::from_ref(&one), &Options::new()).expect("a table");
    let rows = "| 5 | ssao | Vidro | 2.00 | 4.00 |\n| 7,000 | ssao | Vidro | 3.00 |  |\n";
    assert_eq!(made, format!("| triangles | program | view | cuda | optix |\n|---:|---|---|---|---|\n{rows}"));
    let made = table("agreement", std::slice::from_ref(&one), &Options::new()).expect("a table");
    assert!(made.contains("| every bit | 3e-8 at most |") && made.contains("| 1,234 pixels |  |"), "{made}");
    let names = Options::from([("names".to_owned(), "one GPU/two".to_owned())]);
    let files = [0.5, 0.25].map(|ms| file(&[record("cuda", 5, ms, 9, 0)]));
    let made = table("backends", &files, &names).expect("a table");
    assert!(
        made.starts_with("| program | view | cuda, one GPU | cuda, two |") && made.contains("| 0.50 | 0.25 |"),
        "{made}"
    );
    let thesis = Options::from([("fidelity".to_owned(), "thesis".to_owned())]);
    assert!(
        table("backends", std::slice::from_ref(&one), &thesis).is_err() && table("backends", &[one], &names).is_err()
    );
}

#[test]
fn growth_has_a_row_for_each_work() {
    let point = |triangles: u64, size: u64, seconds: f64| serde_json::json!({"triangles": triangles, "size": size, "samples": [{"work": "build", "times": {"cpu_s": [9.0, seconds, 1e-4]}}]});
    let mut file = serde_json::json!({
        "triangles": [point(10, 64, 0.001), point(20_000, 64, 0.002)], "triangle_slopes": [{"work": "build", "slope": 1.05}],
        "pixels": [point(10, 64, 0.004)], "pixel_slopes": [{"work": "build", "slope": 0.25}],
        "efficiencies": [{"work": "build", "threads": 2, "efficiency": 0.8, "efficiency_cpu": 1.0}],
    });
    let made = table("growth", std::slice::from_ref(&file), &Options::new()).expect("a table");
    assert!(
        made.starts_with("|  | 10 triangles | 20,000 triangles | exponent | 64 pixels a side | exponent |"),
        "{made}"
    );
    assert!(made.ends_with("| build | 1.00 | 2.00 | 1.05 | 4.00 | 0.25 | 0.80, 1.00 |\n"), "{made}");
    file["efficiencies"][0]["work"] = "trace".into();
    assert!(table("growth", std::slice::from_ref(&file), &Options::new()).is_err());
    assert!(table("growth", &[serde_json::json!({})], &Options::new()).is_err());
}

#[test]
fn listed_tables_are_shown_as_they_are_named() {
    let file = serde_json::json!({"tables": {"a": {"columns": ["x", "y"], "rows": [["one", 2.7e-9], [70_000, null]]}}});
    let options = |name: &str| Options::from([("table".to_owned(), name.to_owned())]);
    let made = table("listed", std::slice::from_ref(&file), &options("a"));
    assert_eq!(made.as_deref(), Ok("| x | y |\n|---|---|\n| one | 3e-9 |\n| 70000 |  |\n"));
    assert!(table("listed", &[file], &options("b")).is_err());
}

#[test]
fn numbers_have_three_digits_and_days_their_date() {
    let shown = [0.0, 3e-8, 0.0039, 0.25641, 0.9996, 1.0694, 9.9951, 13.755, 99.96, 119.2609, 2722.3].map(short);
    assert_eq!(shown, ["0", "3e-8", "0.0039", "0.26", "1.00", "1.07", "10.0", "13.8", "100", "119", "2722"]);
    assert_eq!(date(0), "1970-01-01");
    assert_eq!(date(951_782_400), "2000-02-29");
    assert_eq!(date(1_795_370_393), "2026-11-22");
}
