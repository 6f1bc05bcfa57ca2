//! `curitiba list`: programs, parameters, engines and what they can run.

mod snippet;

use super::{Failure, width};
use anstyle::Style;
use curitiba::engines::ray_backend;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::abilities;
use curitiba::pipeline::backend::{Rasteriser as _, RayBackend};
use curitiba::pipeline::diagnostic::valid_names;
use curitiba::pipeline::plan::OWN_BACKEND;
use curitiba::pipeline::programs::{
    Fidelity, PARAMS, ParamInfo, QUAD_PROGRAMS, RASTER_PROGRAMS, RAY_PROGRAMS, RayProgramInfo,
};
use curitiba::pipeline::raster_effects::{EFFECT_PARAMS, EFFECT_PROGRAMS, EffectParams, EffectProgramInfo};
use curitiba::{BackendChoice, Choice};
use std::fmt::Display;

const HEADER: Style = Style::new().bold();

/// Prints everything, or a single program.
pub fn run(program: Option<&str>) -> Result<(), Failure> {
    let columns = width::of_terminal();
    let lines = match program {
        None => all(),
        Some(name) => {
            let ray = RAY_PROGRAMS.iter().find(|info| info.stem == name);
            let effect = EFFECT_PROGRAMS.iter().find(|info| info.name == name);
            match (ray, effect) {
                (Some(info), _) => one_ray(info, columns),
                (_, Some(info)) => one_effect(info, columns),
                (None, None) => return Err(unknown(name)),
            }
        }
    };
    lines.iter().for_each(|line| crate::say!("{line}"));
    Ok(())
}

fn unknown(name: &str) -> Failure {
    let names = RAY_PROGRAMS.iter().map(|info| info.stem).chain(EFFECT_PROGRAMS.iter().map(|info| info.name));
    let valid = valid_names(name, names);
    Failure::Usage(format!("there is no ray program or raster effect `{name}`\n       {valid}"))
}

/// A line with a name and a text; [`width::wrapped`] aligns its continuation lines with the text.
fn named(name: &str, text: impl Display) -> String {
    format!("  {name:16}  {text}")
}

fn heading(text: &str) -> String {
    format!("{HEADER}{text}{HEADER:#}")
}

fn all() -> Vec<String> {
    let mut lines = vec![heading("ray programs (class=\"optix\" or \"rt\")")];
    let mut section = |title: &str, rows: Vec<String>| {
        if !title.is_empty() {
            lines.extend([String::new(), heading(title)]);
        }
        lines.extend(rows);
    };
    section("", RAY_PROGRAMS.iter().map(|info| named(info.stem, info.about)).collect());
    section(
        "parameters of ray programs (attributes of the pass, or --set PASS.NAME=VALUE)",
        PARAMS.iter().flat_map(of_rays).collect(),
    );
    let effects = EFFECT_PROGRAMS.iter().flat_map(|info| {
        [named(info.name, info.about), named("", format_args!("by rays: {}", info.counterpart.info().stem))]
    });
    section("raster effects (class=\"effect\")", effects.collect());
    section("parameters of raster effects", EFFECT_PARAMS.iter().flat_map(of_effects).collect());
    section(
        "raster programs (class=\"default\", by the stem of the ps file)",
        RASTER_PROGRAMS.iter().map(|info| named(info.stem, info.about)).collect(),
    );
    let quads = QUAD_PROGRAMS.iter().map(|info| named(info.stem, info.about));
    let plain = named("(none)", "one texture, as named by <texture>");
    section("quad programs (class=\"quad\")", std::iter::once(plain).chain(quads).collect());
    section("rasterisers (--raster); each runs every raster effect", rasterisers(&abilities()));
    let backends =
        BackendChoice::ALL.into_iter().flat_map(|backend| match ray_backend(Choice::CPU.traced_by(backend)) {
            Ok(rays) => ray_support(rays.as_ref()),
            Err(error) => vec![named(backend.name(), format_args!("not here: {}", error.reason()))],
        });
    section("ray backends (--backend), program by program", backends.collect());
    lines
}

/// A parameter of ray programs, and which of them read it.
fn of_rays(param: &ParamInfo) -> [String; 2] {
    let readers: Vec<&RayProgramInfo> = RAY_PROGRAMS.iter().filter(|info| info.params.contains(&param.name)).collect();
    let reads = RAY_PROGRAMS.iter().filter(|info| info.reads(param.name));
    let mut defaults: Vec<String> = reads.map(|info| info.defaults().get(param.name)).collect();
    defaults.dedup();
    let readers: Vec<&str> = readers.iter().map(|info| info.stem).collect();
    [describe(param, &defaults.join(", from the camera ")), named("", format_args!("read by {}", readers.join(", ")))]
}

/// A parameter of raster effects, and which of them read it.
fn of_effects(param: &ParamInfo) -> [String; 2] {
    let readers: Vec<&EffectProgramInfo> =
        EFFECT_PROGRAMS.iter().filter(|info| info.params.contains(&param.name)).collect();
    let readers: Vec<&str> = readers.iter().map(|info| info.name).collect();
    let default = EffectParams::default().get(param.name);
    [describe(param, &default), named("", format_args!("read by {}", readers.join(", ")))]
}

/// The rasterisers. `found` holds the adapters, each with a description of what it supports.
fn rasterisers(found: &[(impl Display, String)]) -> Vec<String> {
    let mut lines = vec![named("cpu", CpuRasteriser::new().device())];
    for (place, (adapter, abilities)) in found.iter().enumerate() {
        lines.push(named("wgpu", adapter));
        lines.push(named("", format_args!("--adapter {place}: {abilities}")));
    }
    if found.is_empty() {
        lines.push(named("wgpu", "no adapter: this machine has no Vulkan, Metal or DX12 driver"));
    }
    lines
}

fn ray_support(rays: &dyn RayBackend) -> Vec<String> {
    let mut lines = vec![named(rays.name(), rays.device())];
    for info in RAY_PROGRAMS {
        let verdict = |fidelity| match rays.supports(info.program, fidelity) {
            Ok(()) => "yes".to_owned(),
            Err(error) => error.to_string(),
        };
        lines.push(format!(
            "    {:14}  corrected: {}, thesis: {}",
            info.stem,
            verdict(Fidelity::Corrected),
            verdict(Fidelity::Thesis)
        ));
    }
    let more = [
        ("sun above 0", rays.traces_sun_discs()),
        ("filter above 0", rays.filters_shares()),
        ("error above 0", rays.samples_adaptively()),
        ("texturelod", rays.traces_cones()),
        ("a sky in glass", rays.sees_skies()),
        ("--accumulate", rays.continues_sequences()),
    ];
    let verdict = |does| if does { "yes" } else { "no: use --backend cpu" };
    lines.extend(more.map(|(asked, does)| format!("    {asked:14}  {}", verdict(does))));
    lines
}

/// Name and description of a program, for a terminal with this number of columns.
fn title(name: &str, about: &str, columns: Option<usize>) -> Vec<String> {
    let mut lines = width::folded(&format!("{name}: {about}"), columns);
    // The name is one word, which folding does not split, so the first line contains it.
    lines[0] = lines[0].replacen(name, &heading(name), 1);
    lines
}

fn one_ray(info: &RayProgramInfo, columns: Option<usize>) -> Vec<String> {
    let list = |names: &[&str]| if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    let mut lines = title(info.stem, info.about, columns);
    for (what, names) in [
        ("buffers", info.buffers),
        ("vertex attributes", info.vertex_attributes),
        ("material attributes", info.material_attributes),
        ("global attributes", info.globals),
    ] {
        lines.push(format!("  {what:19}  {}", list(names)));
    }
    let params = PARAMS.iter().filter(|param| info.params.contains(&param.name));
    lines.extend(params.map(|param| describe(param, &info.defaults().get(param.name))));
    lines.extend(own_backend());
    lines.extend([String::new(), snippet::ray(info)]);
    lines
}

fn one_effect(info: &EffectProgramInfo, columns: Option<usize>) -> Vec<String> {
    let mut lines = title(info.name, info.about, columns);
    lines.push(named("by rays", info.counterpart.info().stem));
    lines.push(named("buffers", info.buffers.join(", ")));
    let defaults = EffectParams::default();
    let params = EFFECT_PARAMS.iter().filter(|param| info.params.contains(&param.name));
    lines.extend(params.map(|param| describe(param, &defaults.get(param.name))));
    if info.program.may_leave_to_rays() {
        lines.extend(own_backend());
    }
    lines.extend([String::new(), snippet::effect(info)]);
    lines
}

/// Describes the parameter of a pass's own ray backend. Only the command line can set it, since machines differ.
fn own_backend() -> [String; 3] {
    [String::new(), heading("by --set PASS.NAME=VALUE alone"), describe(&OWN_BACKEND, "auto")]
}

fn describe(param: &ParamInfo, default: &str) -> String {
    named(param.name, format_args!("{} [default: {default}; valid: {}]", param.about, param.valid))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line as a terminal of 80 columns shows it, without its styles.
    fn shown(line: &str) -> Vec<String> {
        let plain = format!("{}", anstream::adapter::strip_str(line));
        let shown = width::wrapped(line, 80);
        if line == plain { shown } else { vec![plain] }
    }

    fn widest(lines: &[String]) -> (usize, &str) {
        lines.iter().map(|line| (line.chars().count(), line.as_str())).max().unwrap_or_default()
    }

    #[test]
    fn every_line_fits_80_columns() {
        let mut lines = all();
        let adapter = "a graphics card with a long name (discrete GPU, vulkan, a driver of a long name 123.45.67)";
        let lacks =
            "pictures of 16384 x 16384 pixels; rays: scenes of 128 MiB a part; lacks timestamps: no device times";
        lines.extend(rasterisers(&[(adapter, lacks.to_owned())]));
        for info in RAY_PROGRAMS {
            // Text to paste into a project is not wrapped.
            lines.extend(one_ray(info, Some(80)).into_iter().filter(|line| !line.starts_with("<pass")));
        }
        for info in EFFECT_PROGRAMS {
            lines.extend(one_effect(info, Some(80)).into_iter().filter(|line| !line.starts_with("<pass")));
        }
        assert!(widest(&lines).0 > 200, "control: lines are longer before they are wrapped");
        let shown: Vec<String> = lines.iter().flat_map(|line| shown(line)).collect();
        let (width, line) = widest(&shown);
        assert!(width <= 80, "{width} columns: {line}");
        let readers = shown.iter().position(|line| line.starts_with("                    read by")).expect("a reader");
        assert!(shown[readers - 1].starts_with("                    "), "{}", shown[readers - 1]);
    }
}
