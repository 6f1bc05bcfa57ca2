//! `curitiba list`: programs, parameters, engines and what they can run.

mod snippet;

use super::Failure;
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

const HEADER: Style = Style::new().bold();

/// Prints everything, or a single program.
pub fn run(program: Option<&str>) -> Result<(), Failure> {
    let Some(name) = program else {
        all();
        return Ok(());
    };
    let ray = RAY_PROGRAMS.iter().find(|info| info.stem == name);
    let effect = EFFECT_PROGRAMS.iter().find(|info| info.name == name);
    match (ray, effect) {
        (Some(info), _) => one_ray(info),
        (_, Some(info)) => one_effect(info),
        (None, None) => {
            let names = RAY_PROGRAMS.iter().map(|info| info.stem).chain(EFFECT_PROGRAMS.iter().map(|info| info.name));
            let valid = valid_names(name, names);
            return Err(Failure::Usage(format!("there is no ray program or raster effect `{name}`\n       {valid}")));
        }
    }
    Ok(())
}

fn all() {
    crate::say!("{HEADER}ray programs (class=\"optix\" or \"rt\"){HEADER:#}");
    for info in RAY_PROGRAMS {
        crate::say!("  {:16}  {}", info.stem, info.about);
    }
    crate::say!("\n{HEADER}parameters of ray programs (attributes of the pass, or --set PASS.NAME=VALUE){HEADER:#}");
    for param in PARAMS {
        let mut defaults: Vec<String> = RAY_PROGRAMS
            .iter()
            .filter(|info| info.reads(param.name))
            .map(|info| info.defaults().get(param.name))
            .collect();
        defaults.dedup();
        describe(param, &defaults.join(", from the camera "));
        let reads = |info: &&RayProgramInfo| info.params.contains(&param.name);
        let readers: Vec<&str> = RAY_PROGRAMS.iter().filter(reads).map(|info| info.stem).collect();
        crate::say!("  {:16}  read by {}", "", readers.join(", "));
    }
    crate::say!("\n{HEADER}raster effects (class=\"effect\"){HEADER:#}");
    for info in EFFECT_PROGRAMS {
        crate::say!("  {:16}  {}", info.name, info.about);
        crate::say!("  {:16}  by rays: {}", "", info.counterpart.info().stem);
    }
    crate::say!("\n{HEADER}parameters of raster effects{HEADER:#}");
    for param in EFFECT_PARAMS {
        let readers: Vec<&EffectProgramInfo> =
            EFFECT_PROGRAMS.iter().filter(|info| info.params.contains(&param.name)).collect();
        let mut defaults: Vec<String> =
            readers.iter().map(|info| EffectParams::of(info.program).get(param.name)).collect();
        defaults.dedup();
        describe(param, &defaults.join(", cube maps "));
        let readers: Vec<&str> = readers.iter().map(|info| info.name).collect();
        crate::say!("  {:16}  read by {}", "", readers.join(", "));
    }
    crate::say!("\n{HEADER}raster programs (class=\"default\", by the stem of the ps file){HEADER:#}");
    for info in RASTER_PROGRAMS {
        crate::say!("  {:16}  {}", info.stem, info.about);
    }
    crate::say!("\n{HEADER}quad programs (class=\"quad\"){HEADER:#}");
    crate::say!("  {:16}  one texture, as named by <texture>", "(none)");
    for info in QUAD_PROGRAMS {
        crate::say!("  {:16}  {}", info.stem, info.about);
    }
    crate::say!("\n{HEADER}rasterisers (--raster); each runs every raster effect{HEADER:#}");
    crate::say!("  {:16}  {}", "cpu", CpuRasteriser::new().device());
    let found = abilities();
    for (place, (adapter, abilities)) in found.iter().enumerate() {
        crate::say!("  {:16}  {adapter}", "wgpu");
        crate::say!("  {:16}  --adapter {place}: {abilities}", "");
    }
    if found.is_empty() {
        crate::say!("  {:16}  no adapter: this machine has no Vulkan, Metal or DX12 driver", "wgpu");
    }
    crate::say!("\n{HEADER}ray backends (--backend), program by program{HEADER:#}");
    for backend in BackendChoice::ALL {
        match ray_backend(Choice::CPU.traced_by(backend)) {
            Ok(rays) => ray_support(rays.as_ref()),
            Err(error) => crate::say!("  {:16}  not here: {}", backend.name(), error.reason()),
        }
    }
}

fn ray_support(rays: &dyn RayBackend) {
    crate::say!("  {:16}  {}", rays.name(), rays.device());
    for info in RAY_PROGRAMS {
        let verdict = |fidelity| match rays.supports(info.program, fidelity) {
            Ok(()) => "yes".to_owned(),
            Err(error) => error.to_string(),
        };
        crate::say!(
            "    {:14}  corrected: {}, thesis: {}",
            info.stem,
            verdict(Fidelity::Corrected),
            verdict(Fidelity::Thesis)
        );
    }
    let more = [
        ("sun above 0", rays.traces_sun_discs()),
        ("filter above 0", rays.filters_shares()),
        ("error above 0", rays.samples_adaptively()),
        ("texturelod", rays.traces_cones()),
    ];
    for (asked, does) in more {
        crate::say!("    {asked:14}  {}", if does { "yes" } else { "no: use --backend cpu" });
    }
}

fn one_ray(info: &RayProgramInfo) {
    let list = |names: &[&str]| if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    crate::say!("{HEADER}{}{HEADER:#}: {}", info.stem, info.about);
    crate::say!("  buffers              {}", list(info.buffers));
    crate::say!("  vertex attributes    {}", list(info.vertex_attributes));
    crate::say!("  material attributes  {}", list(info.material_attributes));
    crate::say!("  global attributes    {}", list(info.globals));
    for param in PARAMS.iter().filter(|param| info.params.contains(&param.name)) {
        describe(param, &info.defaults().get(param.name));
    }
    own_backend();
    crate::say!("\n{}", snippet::ray(info));
}

fn one_effect(info: &EffectProgramInfo) {
    crate::say!("{HEADER}{}{HEADER:#}: {}", info.name, info.about);
    crate::say!("  {:16}  {}", "by rays", info.counterpart.info().stem);
    crate::say!("  {:16}  {}", "buffers", info.buffers.join(", "));
    let defaults = EffectParams::of(info.program);
    for param in EFFECT_PARAMS.iter().filter(|param| info.params.contains(&param.name)) {
        describe(param, &defaults.get(param.name));
    }
    if info.program.marches() {
        own_backend();
    }
    crate::say!("\n{}", snippet::effect(info));
}

/// Describes the parameter that only the command line sets, since machines differ.
fn own_backend() {
    crate::say!("\n{HEADER}by --set PASS.NAME=VALUE alone{HEADER:#}");
    describe(&OWN_BACKEND, "auto");
}

fn describe(param: &ParamInfo, default: &str) {
    crate::say!("  {:16}  {} [default: {default}; valid: {}]", param.name, param.about, param.valid);
}
