//! Writes the material libraries of a project: render targets, and the materials that its passes use.

use super::xml::Xml;
use super::{WriteError, color, relative};
use crate::programs::{QUAD_PROGRAMS, RASTER_PROGRAMS};
use crate::project::{ChannelRef, Pass, PassKind, Project, QuadSource, TextureMap};
use crate::scene::texture::Magnification;
use std::path::{Path, PathBuf};

/// Name of the library if the project has no render target.
const WITHOUT_TARGETS: &str = "Materials";
/// Name of the material with the raster program.
pub(super) const DRAWS: &str = "deferred";

/// A library and the file that it is written to.
pub(super) struct Library {
    pub path: PathBuf,
    pub name: String,
    /// Whether the project's materials are written to this library.
    materials: bool,
}

/// The libraries of a project, in the order of its targets; the first one contains the materials.
pub(super) fn of(project: &Project, path: &Path) -> Vec<Library> {
    let mut names: Vec<String> = Vec::new();
    for target in &project.targets {
        if !names.contains(&target.library) {
            names.push(target.library.clone());
        }
    }
    if names.is_empty() {
        names.push(WITHOUT_TARGETS.to_owned());
    }
    let file = |index: usize| match index {
        0 => path.with_extension("mlib"),
        _ => path.with_extension(format!("{}.mlib", index + 1)),
    };
    let library = |(index, name)| Library { path: file(index), name, materials: index == 0 };
    names.into_iter().enumerate().map(library).collect()
}

/// Name of the material with the colours of map `map` of a pass; `number` is the pass's number in the project.
pub(super) fn colored((number, pass): (usize, &Pass), map: usize) -> String {
    format!("{number} {} colours {}", pass.name, map + 1)
}

/// Name of the texture of colour map `map` of a pass.
fn mapped((number, pass): (usize, &Pass), map: usize) -> String {
    format!("{number} {} texture {}", pass.name, map + 1)
}

/// Name of the material with which a quad pass combines two textures.
pub(super) fn joining((number, pass): (usize, &Pass)) -> String {
    format!("{number} {} combine", pass.name)
}

/// The texture name of a channel, as files write it.
pub(super) fn texture(project: &Project, channel: ChannelRef) -> String {
    let target = &project.targets[channel.target];
    format!("{}::{}", target.library, target.channels[channel.channel].name)
}

impl Library {
    /// The contents of the library's file; paths are relative to `folder`.
    pub fn document(&self, project: &Project, folder: &Path) -> Result<String, WriteError> {
        let mut xml = Xml::new("Render targets and materials of the project beside this file.");
        xml.begin("materialLib", &[("name", &self.name)]);
        xml.begin("renderTargets", &[]);
        for target in project.targets.iter().filter(|target| target.library == self.name) {
            xml.begin("renderTarget", &[("name", &target.name)]);
            let [width, height] = target.size.map(|side| side.to_string());
            xml.empty("size", &[("width", &width), ("height", &height)]);
            color(&mut xml, "CLEAR_VALUES", &target.clear_color.to_array());
            xml.begin("colors", &[]);
            for channel in target.channels.iter().filter(|channel| !channel.depth) {
                xml.empty("color", &[("name", &channel.name), ("internalFormat", channel.format.name())]);
            }
            xml.end();
            if let Some(depth) = target.depth() {
                let name = &target.channels[depth].name;
                xml.empty("depth", &[("name", name), ("internalFormat", "DEPTH_COMPONENT32F")]);
            }
            xml.end();
        }
        xml.end();
        if self.materials {
            materials(&mut xml, project, folder)?;
        }
        xml.finish()
    }
}

fn materials(xml: &mut Xml, project: &Project, folder: &Path) -> Result<(), WriteError> {
    let passes = || project.pipelines.iter().flat_map(|pipeline| &pipeline.passes).enumerate();
    xml.begin("textures", &[]);
    for pass in passes() {
        for (index, map) in pass.1.kind.colors().iter().enumerate() {
            if let TextureMap::File(path, _) = &map.texture {
                xml.empty("texture", &[("name", &mapped(pass, index)), ("filename", &relative(path, folder)?)]);
            }
        }
    }
    xml.end();
    xml.begin("shaders", &[]);
    let stems = RASTER_PROGRAMS.iter().map(|info| info.stem).chain(QUAD_PROGRAMS.iter().map(|info| info.stem));
    for stem in stems {
        xml.empty("shader", &[("name", stem), ("ps", &format!("{stem}.frag"))]);
    }
    xml.end();
    xml.begin("materials", &[]);
    xml.begin("material", &[("name", DRAWS)]);
    xml.empty("shader", &[("name", RASTER_PROGRAMS[0].stem)]);
    xml.end();
    for pass in passes() {
        for (index, map) in pass.1.kind.colors().iter().enumerate() {
            xml.begin("material", &[("name", &colored(pass, index))]);
            xml.begin("color", &[]);
            for (name, value) in [("diffuse", map.diffuse), ("emission", map.emission)] {
                if let Some(value) = value {
                    color(xml, name, &value.to_array());
                }
            }
            xml.end();
            if let TextureMap::File(_, magnification) = map.texture {
                xml.begin("textures", &[]);
                xml.begin("texture", &[("unit", "0"), ("name", &mapped(pass, index))]);
                if magnification == Magnification::Nearest {
                    xml.empty("MAG_FILTER", &[("value", "NEAREST")]);
                }
                xml.end();
                xml.end();
            }
            xml.end();
        }
        if let PassKind::Quad(quad) = &pass.1.kind
            && let QuadSource::Combine { color, factor } = quad.source
        {
            xml.begin("material", &[("name", &joining(pass))]);
            xml.empty("shader", &[("name", QUAD_PROGRAMS[0].stem)]);
            xml.begin("textures", &[]);
            for (unit, channel) in [("0", color), ("1", factor)] {
                xml.empty("texture", &[("unit", unit), ("name", &texture(project, channel))]);
            }
            xml.end();
            xml.end();
        }
    }
    xml.end();
    Ok(())
}
