//! `curitiba list`: programs, parameters, engines and what they can run.

use super::Failure;
use anstyle::Style;
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::adapters;
use curitiba::pipeline::backend::{Rasteriser as _, RayBackend as _};
use curitiba::pipeline::diagnostic::valid_names;
use curitiba::pipeline::programs::{
    Fidelity, PARAMS, QUAD_PROGRAMS, RASTER_PROGRAMS, RAY_PROGRAMS, RayParams, RayProgramInfo,
};

const HEADER: Style = Style::new().bold();

/// Prints everything, or one ray program.
pub fn run(program: Option<&str>) -> Result<(), Failure> {
    match program {
        None => all(),
        Some(name) => {
            let Some(info) = RAY_PROGRAMS.iter().find(|info| info.stem == name) else {
                let valid = valid_names(name, RAY_PROGRAMS.iter().map(|info| info.stem));
                return Err(Failure::Usage(format!("there is no ray program `{name}`\n       {valid}")));
            };
            one(info);
        }
    }
    Ok(())
}

fn all() {
    let rays = CpuRays::new();
    crate::say!("{HEADER}ray programs (class=\"optix\" or \"rt\"){HEADER:#}");
    for info in RAY_PROGRAMS {
        crate::say!("  {:16} {}", info.stem, info.about);
    }
    crate::say!("\n{HEADER}parameters (attributes of the pass, or --set PASS.NAME=VALUE){HEADER:#}");
    let defaults = RayParams::default();
    for param in PARAMS {
        let readers: Vec<&str> =
            RAY_PROGRAMS.iter().filter(|info| info.params.contains(&param.name)).map(|info| info.stem).collect();
        crate::say!(
            "  {:16} {} [default: {}; valid: {}]",
            param.name,
            param.about,
            defaults.get(param.name),
            param.valid
        );
        crate::say!("  {:16} read by {}", "", readers.join(", "));
    }
    crate::say!("\n{HEADER}raster programs (class=\"default\", by the stem of the ps file){HEADER:#}");
    for info in RASTER_PROGRAMS {
        crate::say!("  {:16} {}", info.stem, info.about);
    }
    crate::say!("\n{HEADER}quad programs (class=\"quad\"){HEADER:#}");
    crate::say!("  {:16} one texture, as named by <texture>", "(none)");
    for info in QUAD_PROGRAMS {
        crate::say!("  {:16} {}", info.stem, info.about);
    }
    crate::say!("\n{HEADER}rasterisers (--raster){HEADER:#}");
    crate::say!("  {:16} {}", "cpu", CpuRasteriser::new().device());
    let found = adapters();
    for adapter in &found {
        crate::say!("  {:16} {adapter}", "wgpu");
    }
    if found.is_empty() {
        crate::say!("  {:16} no adapter: this machine has no Vulkan, Metal or DX12 driver", "wgpu");
    }
    crate::say!("\n{HEADER}ray backends (--backend), program by program{HEADER:#}");
    crate::say!("  {:16} {}", rays.name(), rays.device());
    for info in RAY_PROGRAMS {
        let verdict = |fidelity| match rays.supports(info.program, fidelity) {
            Ok(()) => "yes".to_owned(),
            Err(error) => error.to_string(),
        };
        crate::say!(
            "    {:14} corrected: {}, thesis: {}",
            info.stem,
            verdict(Fidelity::Corrected),
            verdict(Fidelity::Thesis)
        );
    }
}

fn one(info: &RayProgramInfo) {
    let list = |names: &[&str]| if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    crate::say!("{HEADER}{}{HEADER:#}: {}", info.stem, info.about);
    crate::say!("  buffers              {}", list(info.buffers));
    crate::say!("  vertex attributes    {}", list(info.vertex_attributes));
    crate::say!("  material attributes  {}", list(info.material_attributes));
    crate::say!("  global attributes    {}", list(info.globals));
    let defaults = RayParams::default();
    for param in PARAMS.iter().filter(|param| info.params.contains(&param.name)) {
        crate::say!(
            "  {:20} {} [default: {}; valid: {}]",
            param.name,
            param.about,
            defaults.get(param.name),
            param.valid
        );
    }
    crate::say!("\n{}", snippet(info));
}

/// A pass to paste into a project.
fn snippet(info: &RayProgramInfo) -> String {
    let file = format!("optix/{}.ptx", info.stem);
    let mut xml = String::new();
    let mut line = |depth: usize, text: &str| {
        xml.push_str(&"  ".repeat(depth));
        xml.push_str(text);
        xml.push('\n');
    };
    line(0, "<pass class=\"optix\" name=\"rays\">");
    line(1, "<scenes><scene>MainScene</scene></scenes>");
    line(1, "<camera>MainCamera</camera>");
    line(1, "<rendertarget name=\"test\" fromLibrary=\"Optix Ray Tracer Render Target\"/>");
    line(1, "<lights><light>Sun</light></lights>");
    line(
        1,
        &format!(
            "<optixEntryPoint><optixProgram type=\"RayGen\" file=\"{file}\" proc=\"{}\"/></optixEntryPoint>",
            info.entry
        ),
    );
    let procs = |required: bool| info.procs.iter().filter(move |proc| proc.required == required);
    if procs(true).next().is_some() {
        line(1, "<optixDefaultMaterial>");
        for proc in procs(true) {
            line(
                2,
                &format!(
                    "<optixProgram type=\"{}\" ray=\"{}\" file=\"{file}\" proc=\"{}\"/>",
                    proc.kind, proc.ray, proc.proc
                ),
            );
        }
        line(1, "</optixDefaultMaterial>");
    }
    if procs(false).any(|proc| proc.proc.ends_with("_glass")) {
        line(1, "<optixMaterialMap><optixMap to=\"curitiba_material_lib:Vidro\">");
        for proc in procs(false).filter(|proc| proc.proc.ends_with("_glass")) {
            line(
                2,
                &format!(
                    "<optixProgram type=\"{}\" ray=\"{}\" file=\"{file}\" proc=\"{}\"/>",
                    proc.kind, proc.ray, proc.proc
                ),
            );
        }
        line(1, "</optixMap></optixMaterialMap>");
    }
    if !info.vertex_attributes.is_empty() {
        line(1, "<optixVertexAttributes>");
        for name in info.vertex_attributes {
            line(2, &format!("<attribute name=\"{name}\"/>"));
        }
        line(1, "</optixVertexAttributes>");
    }
    if !info.material_attributes.is_empty() {
        line(1, "<optixMaterialAttributes>");
        line(2, "<valueof optixVar=\"diffuse\" type=\"CURRENT\" context=\"COLOR\" component=\"DIFFUSE\"/>");
        line(2, "<valueof optixVar=\"texCount\" type=\"CURRENT\" context=\"TEXTURE\" component=\"COUNT\"/>");
        line(1, "</optixMaterialAttributes>");
    }
    if !info.globals.is_empty() {
        line(1, "<optixGlobalAttributes>");
        for name in info.globals {
            let component = if *name == "lightDir" { "DIRECTION" } else { "DIFFUSE" };
            line(
                2,
                &format!(
                    "<valueof optixVar=\"{name}\" type=\"CURRENT\" context=\"LIGHT\" id=\"0\" component=\"{component}\"/>"
                ),
            );
        }
        line(1, "</optixGlobalAttributes>");
    }
    line(1, "<optixInput>");
    for name in info.buffers {
        let channel = match *name {
            "pos_buffer" => "pos",
            "norm_buffer" => "norm",
            _ => "color",
        };
        line(2, &format!("<buffer var=\"{name}\" texture=\"Deferred Render Targets::{channel}\"/>"));
    }
    line(1, "</optixInput>");
    line(0, "</pass>");
    xml
}
