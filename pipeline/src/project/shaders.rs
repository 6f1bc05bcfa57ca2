//! Own shaders of projects: files, compilation, and the inputs of their uniforms and samplers.

use super::dom::Value;
use super::libraries::{
    Binding, BufferBinding, ImageBinding, Injected, LibraryMaterial, Shader, Texture, ValueOf, names,
};
use super::loader::Loader;
use super::passes::PassContext;
use super::report::{Found, Span, shown, suggest};
use super::{Bound, MaterialPattern, OwnShader, ShaderTexture, file};
use crate::diagnostic::Source;
use crate::glsl::{self, FRAME, Member, Program, SamplerKind, Scalar, Stage};
use crate::programs::{QUAD_PROGRAMS, RASTER_PROGRAMS};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// A use of a shader: the pass assigns it to materials.
pub(super) struct ShaderUse<'a> {
    pub to: &'a MaterialPattern,
    pub library: usize,
    pub material: &'a Rc<LibraryMaterial>,
    pub at: Span,
    /// What is bound in addition to the texture of the scene's material.
    pub injected: &'a Injected,
    /// Whether the materials are replaced as a whole, including their textures.
    pub replaces: bool,
    /// What runs it.
    pub by: UsedBy,
}

impl ShaderUse<'_> {
    /// The bound textures. If the scene's material stays, its own texture is not among them.
    pub fn textures(&self) -> &[Binding] {
        if self.replaces { &self.material.textures } else { &self.injected.textures }
    }

    /// The buffers that are bound.
    pub fn buffers(&self) -> &[BufferBinding] {
        if self.replaces { &self.material.buffers } else { &self.injected.buffers }
    }

    /// The images that are bound.
    pub fn images(&self) -> &[ImageBinding] {
        if self.replaces { &self.material.images } else { &self.injected.images }
    }
}

/// What runs a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UsedBy {
    /// A pass that draws scenes, as a camera sees them.
    Scenes,
    /// A quad pass, which has no camera; `Some` if a built-in shader takes the place of the project's own.
    Quad(Option<&'static BuiltIn>),
    /// A compute pass, which has no camera.
    Compute,
}

/// A built-in shader, in the same language as projects' own shaders.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct BuiltIn {
    /// Name, for messages.
    pub name: &'static str,
    /// GLSL source of the vertex shader.
    pub vertex: &'static str,
    /// GLSL source of the pixel shader.
    pub fragment: &'static str,
}

impl Loader {
    /// Whether a material's shader is an own shader of the project, and this build can compile it.
    pub fn is_own_shader(&self, library: usize, material: &LibraryMaterial) -> bool {
        let known = |stem: &str| {
            RASTER_PROGRAMS.iter().any(|info| info.stem == stem) || QUAD_PROGRAMS.iter().any(|info| info.stem == stem)
        };
        // No built-in program loads or stores images.
        let own = |stem: &str| !known(stem) || !material.images.is_empty();
        glsl::AVAILABLE && self.shader_of(library, material).is_some_and(|(_, stem)| own(&stem))
    }

    /// Compiles the own shader of a quad or compute pass, and records what the pass reads and stores through this shader. `at`
    /// is where the pass names the material.
    pub fn pass_shader(
        &mut self,
        context: &mut PassContext<'_>,
        (library, material, at): (usize, &Rc<LibraryMaterial>, Span),
        by: UsedBy,
    ) -> Option<Arc<OwnShader>> {
        let lights: Vec<usize> = self.pass_lights(context)?.into_iter().map(|(index, _)| index).collect();
        let (to, nothing) = (&MaterialPattern::All, Injected::NONE);
        let used = ShaderUse { to, library, material, at, replaces: true, injected: &nothing, by };
        let shader = self.own_shader(context, &used, &lights);
        Self::takes_down(context, shader.as_deref(), at);
        shader
    }

    /// Records what a pass reads and stores through an own shader; `shader` is `None` if it could not be read.
    pub fn takes_down(context: &mut PassContext<'_>, shader: Option<&OwnShader>, at: Span) {
        let Some(shader) = shader else { return context.facts.stores_unknown() };
        for channel in shader.sampled() {
            Self::reads(context, Some(channel), at);
        }
        context.facts.loads.extend(shader.buffers_read().map(|channel| (channel, at)));
        context.facts.stores(shader.buffers_stored());
    }

    /// Compiles an own shader and determines its inputs. `lights` are the indices of the pass's lights. `None` after an error.
    pub fn own_shader(
        &mut self,
        context: &PassContext<'_>,
        used: &ShaderUse<'_>,
        lights: &[usize],
    ) -> Option<Arc<OwnShader>> {
        let (program, files) = self.own_program(context, used)?;
        let pass = self.pass_key(&context.name);
        let mut values: Vec<(ValueOf, glsl::Value)> = Vec::new();
        let mut whole = true;
        for given in &used.material.values {
            // Values for uniforms that the shader does not have are not resolved.
            let of_block = |block: &glsl::Block| match (&block.name, &given.block) {
                (Some(name), Some(given)) => *name == given.text,
                (None, None) => true,
                _ => false,
            };
            let member = |block: &glsl::Block| block.members.iter().any(|member| member.name == given.uniform.text);
            let read = program.blocks.iter().any(|block| of_block(block) && member(block))
                || program.samplers.iter().any(|sampler| names(&given.uniform.text, &sampler.name))
                || program.images().any(|image| names(&given.uniform.text, &image.name));
            if let Some(fixed) = program.fixed.iter().find(|fixed| fixed.name == given.uniform.text) {
                let message = format!("the uniform `{}` is an array, to which nothing can be mapped", fixed.name);
                self.report.error(given.span, message);
                whole = false;
            }
            if !read {
                continue;
            }
            let value = match self.array_unit(given, used.material) {
                Some(value) => value,
                None => match self.texture_value(given, used) {
                    Some(value) => value,
                    None => self.uniform_value(given, &pass, lights),
                },
            };
            match value {
                Some(value) if used.by != UsedBy::Scenes => match self.without_camera(value, given, used) {
                    Some(value) => values.push((given.clone(), value)),
                    None => whole = false,
                },
                Some(value) => values.push((given.clone(), value)),
                None => whole = false,
            }
        }
        let state = used.material.state;
        let blends = used.by != UsedBy::Scenes && state.drawn.blend.is_some();
        if let Some(other) = state.other.or(blends.then_some("BLEND")) {
            let message = format!("the state of material `{}` has {other}, which is not done", used.material.name);
            self.report.warning(used.at, message, || Some("its result takes the place of what is there".to_owned()));
        }
        self.check_early(&program, files, used)?;
        let storage = self.storage(&program, files[1], &values, used)?;
        let textures = self.samplers(&program, files, &values, &storage, used)?;
        self.check_sampled(&program, files, &textures, &storage)?;
        let stores = program.storage.iter().zip(&storage).filter(|(buffer, _)| buffer.written);
        self.running.stored.extend(stores.filter_map(|(_, bound)| Some(bound.as_ref()?.target)));
        let own = OwnShader {
            name: format!("{}::{}", self.libraries.get(used.library).name, used.material.name),
            place: {
                let (line, column) = self.report.line_column(used.at);
                format!("{}:{line}:{column}", self.report.source(used.at.file).path.display())
            },
            values: self.uniforms(&program, files, &values, &storage)?,
            textures,
            storage,
            bound: used.replaces.then_some(used.material.textures.len() as u32),
            injected: used.injected.textures.iter().filter(|binding| binding.unit > 0).count() as u32,
            drawn: used.material.state.drawn,
            program,
        };
        whole.then(|| Arc::new(own))
    }

    /// Reports a shader that stores and declares early fragment tests, with which hidden pixels would store nothing.
    /// Early tests are not supported: hidden pixels store too, as in OpenGL by default. `None` after an error.
    fn check_early(&mut self, program: &Program, files: [u32; 2], used: &ShaderUse<'_>) -> Option<()> {
        let stores = used.by == UsedBy::Scenes && program.storage.iter().any(|buffer| buffer.written);
        let Some(early) = program.early.filter(|_| stores) else { return Some(()) };
        let message =
            "this shader stores, and asks that hidden pixels store nothing, which is not supported".to_owned();
        let help = "without `early_fragment_tests` all pixels of all triangles store";
        self.report.error_help(Self::span_in(files[1], early), message, || help.to_owned());
        None
    }

    /// Reports samplers of images or buffers to which the shader itself stores.
    fn check_sampled(
        &mut self,
        program: &Program,
        files: [u32; 2],
        textures: &[ShaderTexture],
        storage: &[Option<Bound>],
    ) -> Option<()> {
        let stored = |texture: &ShaderTexture| match texture {
            ShaderTexture::Channel(channel) => storage.iter().flatten().any(|bound| bound.target == channel.target),
            ShaderTexture::Levels(levels) => {
                levels.iter().any(|level| storage.iter().flatten().any(|bound| bound.target == level.target))
            }
            _ => false,
        };
        let Some((sampler, _)) = program.samplers.iter().zip(textures).find(|(_, texture)| stored(texture)) else {
            return Some(());
        };
        let at = Self::span_in(files[usize::from(sampler.stage != Stage::Vertex)], sampler.at);
        let message = format!("`{}` samples what an image or a buffer of this shader stands for", sampler.name);
        self.report.error_help(at, message, || "valid: imageLoad of the image".to_owned());
        None
    }

    /// Converts a value for a pass without a camera: the material's colours become constants, and values that need a camera are an error.
    fn without_camera(&mut self, value: glsl::Value, given: &ValueOf, used: &ShaderUse<'_>) -> Option<glsl::Value> {
        use glsl::{ColorValue as C, Value as V};
        let (material, is_quad) = (used.material, matches!(used.by, UsedBy::Quad(_)));
        let number = |number: f32| [number, 0.0, 0.0, 0.0];
        match value {
            V::Color(color) => Some(V::Constant(match color {
                C::Diffuse => material.diffuse.to_array(),
                C::Ambient => material.ambient.to_array(),
                C::Specular => material.specular.to_array(),
                C::Emission => material.emission.to_array(),
                C::Shininess => number(material.shininess),
            })),
            // Where a quad is drawn, the engine's matrices are the identity.
            V::Matrix(_) | V::NormalMatrix if is_quad => Some(value),
            V::Matrix(_) | V::NormalMatrix | V::Camera(None, _) => {
                let pass = if is_quad { "a quad" } else { "a compute pass" };
                let message =
                    format!("the uniform `{}` is of the pass's camera, and {pass} has none", given.uniform.shown());
                let place = if is_quad { "; `position` is in clip space" } else { "" };
                let help = format!("valid: type=\"CAMERA\" with the camera's name as context{place}");
                self.report.error_help(given.span, message, || help);
                None
            }
            other => Some(other),
        }
    }

    /// The compiled shader, and the indices of its two files in the report. `None` after an error.
    fn own_program(&mut self, context: &PassContext<'_>, used: &ShaderUse<'_>) -> Option<(Arc<Program>, [u32; 2])> {
        if let UsedBy::Quad(Some(built_in)) = used.by {
            return self.built_in_program(built_in);
        }
        let library = self.libraries.get(used.library);
        let shader = library.shaders[used.material.shader?].clone();
        let folder = library.path.clone();
        let (pass, name) = (shown(&context.name), shown(&shader.name));
        for (what, span) in &shader.others {
            let message = format!("pass `{pass}`: shader `{name}` has {what}, which is not supported");
            self.report.error_help(*span, message, || "valid: a vertex shader (vs) and a pixel shader (ps)".to_owned());
        }
        if !shader.others.is_empty() {
            return None;
        }
        if used.by == UsedBy::Compute {
            return self.compute_program(&pass, &shader, folder, used);
        }
        if let Some(compute) = &shader.compute {
            let message = format!("pass `{pass}`: shader `{name}` is a compute shader");
            self.report.error_help(compute.span, message, || "valid: in passes of class compute".to_owned());
            return None;
        }
        let (Some(vertex), Some(pixel)) = (&shader.vertex, &shader.pixel) else {
            let what = if shader.vertex.is_none() { "vertex shader (vs)" } else { "pixel shader (ps)" };
            self.report.error(used.at, format!("pass `{pass}`: shader `{name}` has no {what}"));
            return None;
        };
        let mut folder = file::Folder::of(&folder);
        let paths = [folder.resolve(&mut self.report, vertex)?, folder.resolve(&mut self.report, pixel)?];
        let depth = context.facts.depth_channel().map(|depth| depth.channel);
        let depth = depth.filter(|depth| *depth < glsl::MAX_OUTPUTS && used.by == UsedBy::Scenes);
        let key = (paths, depth);
        let paths = &key.0;
        let failed_before = matches!(self.compiled.get(&key), Some(None));
        if failed_before {
            // The problem was reported already.
            return None;
        }
        let mut files = [0; 2];
        for ((path, named), file) in paths.iter().zip([vertex, pixel]).zip(&mut files) {
            *file = self.text_file(path, named, glsl::MAX_FILE)?;
        }
        if let Some(Some(program)) = self.compiled.get(&key) {
            return Some((Arc::clone(program), files));
        }
        let texts = files.map(|file| self.report.source(file).text.clone());
        let compiled = glsl::Source { vertex: &texts[0], fragment: &texts[1], depth }.compile();
        let program = self.compiled_or_reported(compiled, files);
        self.compiled.insert(key, program.clone());
        program.map(|program| (program, files))
    }

    /// The compiled built-in shader, and the indices of its two sources in the report.
    fn built_in_program(&mut self, built_in: &BuiltIn) -> Option<(Arc<Program>, [u32; 2])> {
        let texts = [built_in.vertex, built_in.fragment];
        let files = texts.map(|text| {
            self.report.add_source(Source { path: PathBuf::from(built_in.name), text: text.to_owned().into() })
        });
        let compiled = glsl::Source { vertex: texts[0], fragment: texts[1], depth: None }.compile();
        self.compiled_or_reported(compiled, files).map(|program| (program, files))
    }

    /// The compiled compute shader, and the index of its file in the report, given twice.
    fn compute_program(
        &mut self,
        pass: &str,
        shader: &Shader,
        folder: PathBuf,
        used: &ShaderUse<'_>,
    ) -> Option<(Arc<Program>, [u32; 2])> {
        let Some(named) = &shader.compute else {
            let message = format!("pass `{pass}`: shader `{}` has no compute shader (cs)", shown(&shader.name));
            self.report.error(used.at, message);
            return None;
        };
        let path = file::Folder::of(&folder).resolve(&mut self.report, named)?;
        let key = ([path.clone(), PathBuf::new()], None);
        let known = self.compiled.get(&key).cloned();
        if matches!(known, Some(None)) {
            // The problem was reported already.
            return None;
        }
        let file = self.text_file(&path, named, glsl::MAX_FILE)?;
        if let Some(Some(program)) = known {
            return Some((program, [file; 2]));
        }
        let text = self.report.source(file).text.clone();
        let program = self.compiled_or_reported(glsl::ComputeSource { text: &text }.compile(), [file; 2]);
        self.compiled.insert(key, program.clone());
        program.map(|program| (program, [file; 2]))
    }

    /// The program, or `None` after its faults are reported.
    fn compiled_or_reported(
        &mut self,
        compiled: Result<Program, Vec<glsl::Fault>>,
        files: [u32; 2],
    ) -> Option<Arc<Program>> {
        match compiled {
            Ok(program) => Some(Arc::new(program)),
            Err(faults) => {
                for fault in faults {
                    let file = files[usize::from(fault.stage != Stage::Vertex)];
                    let at = Self::span_in(file, [fault.start, fault.end]);
                    match fault.help {
                        Some(help) => self.report.error_help(at, fault.message, || help),
                        None => self.report.error(at, fault.message),
                    }
                }
                None
            }
        }
    }

    /// The values of uniforms, by block and member.
    fn uniforms(
        &mut self,
        program: &Program,
        files: [u32; 2],
        values: &[(ValueOf, glsl::Value)],
        storage: &[Option<Bound>],
    ) -> Option<Vec<Vec<Option<glsl::Value>>>> {
        let mut whole = true;
        let mut blocks = Vec::new();
        for block in &program.blocks {
            let mut members = Vec::new();
            for member in &block.members {
                let given = values.iter().rev().find(|(given, _)| {
                    given.uniform.text == member.name && given.block.as_ref().map(|b| &b.text) == block.name.as_ref()
                });
                let value = match given {
                    Some((given, value)) => match fits(*value, member) {
                        Ok(()) => Some(*value),
                        Err(why) => {
                            self.report.error(given.span, format!("the uniform `{}` {why}", member.name));
                            whole = false;
                            None
                        }
                    },
                    None if glsl::is_image_size(&member.name).is_some() => self.image_extent(storage, &member.name),
                    None => {
                        if member.default.is_none() && member.name != FRAME {
                            self.tell_unmapped(files, block.stage, &member.name, member.at, "is 0");
                        }
                        None
                    }
                };
                members.push(value);
            }
            blocks.push(members);
        }
        whole.then_some(blocks)
    }

    fn tell_unmapped(&mut self, files: [u32; 2], stage: Stage, name: &str, at: [usize; 2], then: &str) {
        let at = Self::span_in(files[usize::from(stage != Stage::Vertex)], at);
        let message = format!("nothing is mapped to the uniform `{name}`: it {then}, as in OpenGL");
        self.report
            .warning(at, message, || Some(format!("<valueof uniform=\"{name}\" …/> in the material's <shader>")));
    }

    /// The textures of samplers.
    fn samplers(
        &mut self,
        program: &Program,
        files: [u32; 2],
        values: &[(ValueOf, glsl::Value)],
        storage: &[Option<Bound>],
        used: &ShaderUse<'_>,
    ) -> Option<Vec<ShaderTexture>> {
        let mut textures = Some(Vec::new());
        for sampler in &program.samplers {
            let unit = match Self::unit_given(values, &sampler.name) {
                Some(Ok(unit)) => unit,
                Some(Err(given)) => {
                    let message = format!("the sampler `{}` is given no texture unit", sampler.name);
                    self.report.error_help(given.span, message, || {
                        "valid: type=\"TEXTURE_BINDING\" context=\"CURRENT\" component=\"UNIT\" id=\"0\"".to_owned()
                    });
                    textures = None;
                    continue;
                }
                None => {
                    self.tell_unmapped(files, sampler.stage, &sampler.name, sampler.at, "reads texture unit 0");
                    0
                }
            };
            let texture = self.bound(used, unit, sampler.kind);
            let texture = texture.and_then(|texture| self.with_levels(texture, storage, used));
            textures = textures.zip(texture).map(|(mut textures, texture)| {
                textures.push(texture);
                textures
            });
        }
        textures
    }

    /// The number of channels of a bound image file, for a uniform with
    /// `<valueof type="TEXTURE" context="CURRENT" component="COMPONENT_COUNT" id="0"/>`. Outer `None` for values of other kinds, inner `None`
    /// after an error.
    fn texture_value(&mut self, given: &ValueOf, used: &ShaderUse<'_>) -> Option<Option<glsl::Value>> {
        let kind = given.kind.as_ref().filter(|kind| kind.text.eq_ignore_ascii_case("TEXTURE"))?;
        let counts = given.component.as_ref().is_some_and(|part| part.text.eq_ignore_ascii_case("COMPONENT_COUNT"));
        let unit = given.id.as_ref().map_or(Some(0), |id| id.text.parse().ok());
        let Some(unit) = unit.filter(|_| counts) else {
            let message = format!("the uniform `{}` is a value of a texture that is not known", given.uniform.shown());
            let help = "valid: component=\"COMPONENT_COUNT\" id=\"0\", with the unit as id";
            self.report.error_help(given.span, message, || help.to_owned());
            return Some(None);
        };
        let bound = self.bound(used, unit, SamplerKind::Color);
        let Some(ShaderTexture::File(path)) = bound else {
            if bound.is_some() {
                let message =
                    format!("the uniform `{}` counts the channels of what is no image file", given.uniform.shown());
                self.report
                    .error_help(kind.span, message, || "valid: a unit to which an image file is bound".to_owned());
            }
            return Some(None);
        };
        Some(match channels(&path) {
            Ok(count) => Some(glsl::Value::Constant([f32::from(count), 0.0, 0.0, 0.0])),
            Err(why) => {
                self.report.error(given.span, format!("cannot read {}: {why}", path.display()));
                None
            }
        })
    }

    /// A texture with the mip levels to which earlier passes stored.
    fn with_levels(
        &mut self,
        texture: ShaderTexture,
        storage: &[Option<Bound>],
        used: &ShaderUse<'_>,
    ) -> Option<ShaderTexture> {
        let ShaderTexture::Channel(channel) = texture else { return Some(texture) };
        let stored = self.levels_stored(channel, storage);
        if stored.is_empty() {
            return Some(texture);
        }
        if used.by == UsedBy::Scenes {
            let name = shown(&self.libraries.channel_name(channel));
            let message =
                format!("`{name}` has mip levels that passes stored, which passes that draw scenes do not sample");
            self.report.error_help(used.at, message, || "valid: in quads and compute passes".to_owned());
            return None;
        }
        Some(ShaderTexture::Levels([&[channel][..], &stored].concat()))
    }

    /// The texture that is bound to a texture unit. `None` after an error.
    fn bound(&mut self, used: &ShaderUse<'_>, unit: u32, kind: SamplerKind) -> Option<ShaderTexture> {
        let Some(binding) = used.textures().iter().rev().find(|binding| binding.unit == unit) else {
            if !used.replaces && unit == 0 {
                return Some(ShaderTexture::Material);
            }
            let message = format!("material `{}` binds no texture to unit {unit}: it is black", used.material.name);
            self.report.warning(used.at, message, || Some(format!("<texture unit=\"{unit}\" name=\"…\"/>")));
            return Some(ShaderTexture::Nothing);
        };
        let name = &binding.name;
        if let Some(func) = binding.compare.as_ref().filter(|func| !func.text.eq_ignore_ascii_case("LEQUAL"))
            && kind == SamplerKind::Compared
        {
            let message = format!("COMPARE_FUNC `{}` of `{}` is not supported", func.shown(), name.shown());
            self.report.error_help(func.span, message, || "valid: LEQUAL".to_owned());
            return None;
        }
        let (library, own_name) = match name.text.split_once("::") {
            Some((library, own)) => {
                let from = Value { text: library.trim().to_owned(), joined: None, span: name.span };
                (self.find_library(&from)?, own.trim())
            }
            None => (binding.library.unwrap_or(used.library), name.text.as_str()),
        };
        let library = self.libraries.get(library);
        let index = match library.texture_names.find(own_name) {
            Found::Exact(index) | Found::OtherCase(index) => index,
            Found::Missing => {
                let help = suggest(own_name, library.texture_names.iter());
                self.report.error_help(name.span, format!("there is no texture `{}`", name.shown()), || help);
                return None;
            }
        };
        let (path, texture) = (library.path.clone(), library.textures[index].clone());
        let cube = matches!(texture, Texture::Cube(_));
        if cube != (kind == SamplerKind::Cube) && !matches!(texture, Texture::Channel(None)) {
            let (message, help) = match cube {
                true => ("is a cube map, which a samplerCube samples", "valid: uniform samplerCube"),
                false => ("is no cube map, as a samplerCube samples", "valid: <cubeMap name=\"…\" filePosX=\"…\" …/>"),
            };
            self.report.error_help(name.span, format!("`{}` {message}", name.shown()), || help.to_owned());
            return None;
        }
        match texture {
            Texture::File(value) => self.texture_file(&path, &value).map(ShaderTexture::File),
            Texture::Cube(element) => {
                match self.cube_files(&element)?.each_ref().map(|value| self.texture_file(&path, value)) {
                    [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] => {
                        Some(ShaderTexture::Cube([a, b, c, d, e, f]))
                    }
                    _ => None,
                }
            }
            Texture::Channel(channel) => channel.map(ShaderTexture::Channel),
            Texture::Depth => {
                let message = format!("`{}` is a depth that is not kept", name.shown());
                let help = || "valid: a <depth> of a target of two colours or less".to_owned();
                self.report.error_help(name.span, message, help);
                None
            }
            Texture::Other => {
                let message = format!(
                    "the texture `{}` has no file, and no size and format of an image of two dimensions",
                    name.shown()
                );
                self.report.error_help(name.span, message, || "valid: <texture name=\"…\" filename=\"…\"/>".to_owned());
                None
            }
        }
    }
}

impl Loader {
    /// The image file that a library at `library` names; a file that is not there is an error.
    fn texture_file(&mut self, library: &Path, value: &Value) -> Option<PathBuf> {
        let file = file::Folder::of(library).resolve(&mut self.report, value)?;
        if file.exists() {
            return Some(file);
        }
        let message = format!("cannot read {}: there is no such file", file.display());
        self.report.error_help(value.span, message, || crate::paths::nearest_help(&file));
        None
    }

    /// The image file that a material of `library` binds. The error is the path of a missing file and the place that names it. `None`
    /// if the material binds something else, or after an error in the path.
    pub fn image_file_of(&mut self, library: usize, binding: &Binding) -> Option<Result<PathBuf, (PathBuf, Span)>> {
        let (library, name) = match binding.name.text.split_once("::") {
            Some((other, name)) => {
                (self.libraries.list.iter().position(|library| library.name == other.trim())?, name.trim())
            }
            None => (binding.library.unwrap_or(library), binding.name.text.as_str()),
        };
        let library = self.libraries.get(library);
        let (Found::Exact(index) | Found::OtherCase(index)) = library.texture_names.find(name) else { return None };
        let Texture::File(value) = library.textures[index].clone() else { return None };
        let folder = library.path.clone();
        let file = file::Folder::of(&folder).resolve(&mut self.report, &value)?;
        Some(if file.exists() { Ok(file) } else { Err((file, value.span)) })
    }
}

#[cfg(feature = "glsl")]
use crate::scene::image_channels as channels;

#[cfg(not(feature = "glsl"))]
fn channels(_: &Path) -> Result<u8, String> {
    Err(glsl::MISSING.to_owned())
}

/// Checks that a value has the type of a member; the error says why not.
fn fits(value: glsl::Value, member: &Member) -> Result<(), String> {
    use glsl::{CameraValue as C, Value as V};
    let Some(shape) = member.shape else {
        return Err("is an array or a structure, to which nothing can be mapped".to_owned());
    };
    let matrix = match value {
        V::Matrix(_)
        | V::Camera(_, C::ViewMatrix | C::ProjectionMatrix | C::ProjectionViewMatrix | C::TextureMatrix) => Some(4),
        V::NormalMatrix => Some(3),
        V::Unit(_) => None,
        _ => None,
    };
    match matrix {
        Some(side) if (shape.columns, shape.rows, shape.scalar) == (side, side, Scalar::Float) => Ok(()),
        Some(side) => Err(format!("is given a matrix of {side} x {side}, and is none: declare it as mat{side}")),
        None if shape.columns == 1 => Ok(()),
        None => Err("is a matrix, and is given numbers or a vector".to_owned()),
    }
}
