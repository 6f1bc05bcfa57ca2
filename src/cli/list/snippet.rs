//! XML of passes, to paste into a project.

use curitiba::pipeline::programs::RayProgramInfo;
use curitiba::pipeline::raster_effects::EffectProgramInfo;

/// A pass with a ray program.
pub fn ray(info: &RayProgramInfo) -> String {
    if info.starts_at_camera() {
        return camera(info);
    }
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
        let channel = channel(name);
        line(2, &format!("<buffer var=\"{name}\" texture=\"Deferred Render Targets::{channel}\"/>"));
    }
    line(1, "</optixInput>");
    line(0, "</pass>");
    xml
}

/// A pass whose rays start at the camera.
fn camera(info: &RayProgramInfo) -> String {
    let mut lines = vec![
        format!("<pass class=\"rt\" name=\"rays\" program=\"{}\">", info.stem),
        "  <scenes><scene>MainScene</scene></scenes>".to_owned(),
        "  <camera>MainCamera</camera>".to_owned(),
        "  <rendertarget name=\"test\" fromLibrary=\"Optix Ray Tracer Render Target\"/>".to_owned(),
        "  <lights><light>Sun</light></lights>".to_owned(),
    ];
    if info.reads("depth") {
        lines.push("  <glass><material name=\"Vidro\"/></glass>".to_owned());
        lines.push("  <metal><material name=\"mirror*\"/></metal>".to_owned());
    }
    lines.push("</pass>\n".to_owned());
    lines.join("\n")
}

/// A pass with a raster effect.
pub fn effect(info: &EffectProgramInfo) -> String {
    let mut lines = vec![
        "<pass class=\"effect\" name=\"raster\">".to_owned(),
        "  <scenes><scene>MainScene</scene></scenes>".to_owned(),
        "  <camera>MainCamera</camera>".to_owned(),
        "  <rendertarget name=\"test\" fromLibrary=\"Optix Ray Tracer Render Target\"/>".to_owned(),
    ];
    if info.lit {
        lines.push("  <lights><light>Sun</light></lights>".to_owned());
    }
    lines.push(format!("  <program name=\"{}\"/>", info.name));
    if info.glass {
        lines.push("  <glass><material name=\"Vidro\"/></glass>".to_owned());
    }
    lines.push("  <input>".to_owned());
    for name in info.buffers {
        let texture = channel(name);
        lines.push(format!("    <buffer var=\"{name}\" texture=\"Deferred Render Targets::{texture}\"/>"));
    }
    lines.push("  </input>".to_owned());
    lines.push("</pass>\n".to_owned());
    lines.join("\n")
}

/// The texture of the shipped library that is bound to a buffer.
fn channel(buffer: &str) -> &'static str {
    match buffer {
        "pos_buffer" => "pos",
        "norm_buffer" => "norm",
        _ => "color",
    }
}
