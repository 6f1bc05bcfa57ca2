//! Images that shaders load and store: textures that a library declares by their size, and channels of render targets. Materials bind them to
//! image units. Such a texture is held as a target of one channel.

use super::contents::{Contents, Distribution};
use super::dom::{Element, Value};
use super::libraries::{Binding, ImageBinding, Library, LibraryMaterial, Texture, ValueOf, names};
use super::loader::Loader;
use super::report::{Span, shown, suggest};
use super::shaders::ShaderUse;
use super::{Bound, Channel, ChannelRef, RenderTarget};
use crate::glsl::{self, StorageBuffer};
use crate::image::PixelFormat;
use crate::scene::texture::Magnification;
use glam::Vec4;

/// Greatest number of textures of an array.
const MAX_ARRAY: u32 = 64;

impl Loader {
    /// A texture without a file: `<texture name="…"><WIDTH value="…"/><HEIGHT value="…"/><INTERNAL_FORMAT value="…"/></texture>`,
    /// with zeros or, by `<CONTENT value="…"/>` and `<SEED value="…"/>`, random numbers. A texture that is not two-dimensional,
    /// or has neither a format nor contents, is [`Texture::Other`]; so is every texture in a build without own shaders.
    pub(super) fn image_texture(&mut self, library: &str, element: &Element, name: &str) -> Texture {
        let is_image =
            glsl::AVAILABLE && element.is(&["texture", "arrayOfTextures"]) && element.child_value("depth").is_none();
        let [Some(width), Some(height)] = ["width", "height"].map(|part| element.child_value(part)) else {
            return Texture::Other;
        };
        if !is_image {
            return Texture::Other;
        }
        let Some(contents) = self.contents(element) else { return Texture::Channel(None) };
        let format = match (element.child_value("internal_format"), contents) {
            (Some(format), _) => self.format_named(format),
            // Without a declared format the engine uses bytes.
            (None, Some(_)) => Some(PixelFormat::Rgba8Unorm),
            (None, None) => return Texture::Other,
        };
        let format = format.map(|format| contents.map_or(format, |_| Contents::format(format)));
        let sides = [self.side(width), self.side(height)];
        let ([Some(width), Some(height)], Some(format)) = (sides, format) else { return Texture::Channel(None) };
        let channel = Channel { name: name.to_owned(), format, depth: false };
        self.libraries.targets.push(RenderTarget {
            library: library.to_owned(),
            name: name.to_owned(),
            size: [width, height],
            clear_color: Vec4::ZERO,
            buffer: None,
            contents,
            channels: vec![channel],
        });
        let channel = ChannelRef { target: self.libraries.targets.len() - 1, channel: 0 };
        let levels = self.levels(element, element.child_value("mipmap"), [width, height]);
        if levels > 0 {
            self.libraries.levels.insert(channel, levels);
        }
        Texture::Channel(Some(channel))
    }

    /// The highest mip level: the one that `<LEVELS value="…"/>` declares, or that of a single texel where `mipmap` is true; 0
    /// without either.
    pub(super) fn levels(&mut self, element: &Element, mipmap: Option<&Value>, size: [u32; 2]) -> u32 {
        let all = size[0].max(size[1]).max(1).ilog2();
        if let Some(value) = element.child_value("levels") {
            let Some(levels) = self.number(value) else { return 0 };
            if levels.fract() == 0.0 && (0.0..256.0).contains(&levels) {
                return (levels as u32).min(all);
            }
            let message = format!("`{}` is no number of mip levels", value.shown());
            self.report
                .error_help(value.span, message, || "valid: 0 to 255, where 0 is the first level alone".to_owned());
        }
        if mipmap.is_some_and(Value::is_true) { all } else { 0 }
    }

    /// Index of the target that holds mip level `level`, at least 1, of a channel. The first call for a level adds the target.
    /// Each side of a level is half of that of the level before, rounded down, and at least 1.
    fn level_target(&mut self, channel: ChannelRef, level: u32) -> usize {
        if let Some(target) = self.libraries.level_targets.get(&(channel, level)) {
            return *target;
        }
        let of = &self.libraries.targets[channel.target];
        let declared = &of.channels[channel.channel];
        let name = format!("{}, level {level}", declared.name);
        let target = RenderTarget {
            library: of.library.clone(),
            name: name.clone(),
            size: of.size.map(|side| (side >> level).max(1)),
            clear_color: Vec4::ZERO,
            buffer: None,
            contents: None,
            channels: vec![Channel { name, format: declared.format, depth: false }],
        };
        self.libraries.targets.push(target);
        let index = self.libraries.targets.len() - 1;
        self.libraries.level_targets.insert((channel, level), index);
        index
    }

    /// The mip levels of a channel to which earlier passes stored, from 1 on. The list ends before the first level to which no
    /// earlier pass stored or to which this shader stores.
    pub(super) fn levels_stored(&self, channel: ChannelRef, storage: &[Option<Bound>]) -> Vec<ChannelRef> {
        let held = |level: u32| {
            let target = *self.libraries.level_targets.get(&(channel, level))?;
            let own = storage.iter().flatten().any(|bound| bound.target == target);
            (!own && self.running.stored.contains(&target)).then_some(ChannelRef { target, channel: 0 })
        };
        (1..).map_while(held).collect()
    }

    /// The files of a cube map, +x, -x, +y, -y, +z, -z: `<cubeMap name="…" filePosX="…" fileNegX="…" … fileNegZ="…"/>`. A cube
    /// map that names fewer files is an error if a shader samples it.
    pub(super) fn cube_files(&mut self, element: &Element) -> Option<[Value; 6]> {
        const FACES: [&str; 6] = ["filePosX", "fileNegX", "filePosY", "fileNegY", "filePosZ", "fileNegZ"];
        match FACES.map(|face| self.required(element, face).cloned()) {
            [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] => Some([a, b, c, d, e, f]),
            _ => None,
        }
    }

    /// The random numbers of a texture; inner `None` for zeros, outer `None` after an error.
    fn contents(&mut self, element: &Element) -> Option<Option<Contents>> {
        let seed = match element.child_value("seed") {
            None => 0,
            Some(value) => match value.text.parse::<u64>() {
                Ok(seed) => seed,
                Err(_) => {
                    let message = format!("`{}` is no seed", value.shown());
                    self.report.error_help(value.span, message, || format!("valid: 0..={}", u64::MAX));
                    return None;
                }
            },
        };
        let Some(value) = element.child_value("content") else { return Some(None) };
        let named = Distribution::NAMED;
        let found = named.into_iter().find(|(name, _)| value.text.eq_ignore_ascii_case(name));
        if found.is_none() {
            let message = format!("a texture is filled with `{}`", value.shown());
            self.report.error_help(value.span, message, || suggest(&value.text, named.map(|(name, _)| name)));
        }
        found.map(|(_, distribution)| distribution.map(|distribution| Contents { distribution, seed }))
    }

    /// Reads `<arraysOfTextures>` of a library: `<arrayOfTextures name="…"><TEXTURE_COUNT value="…"/>…`. Each texture of an array
    /// is an image.
    pub(super) fn texture_arrays(&mut self, library: &mut Library, root: &Element) {
        let lists = root.children_named(&["arraysOfTextures"]).filter(|_| glsl::AVAILABLE);
        for array in lists.flat_map(|list| list.children_named(&["arrayOfTextures"])) {
            let Some(name) = self.required(array, "name") else { continue };
            let count = array.child_value("texture_count").and_then(|value| value.text.parse::<u32>().ok());
            let Some(count) = count.filter(|count| (1..=MAX_ARRAY).contains(count)) else {
                let message = format!("the number of textures of `{}` cannot be read", name.shown());
                let help = format!("valid: <TEXTURE_COUNT value=\"2\"/>, 1 to {MAX_ARRAY}");
                self.report.error_help(array.span, message, || help);
                continue;
            };
            for index in 0..count {
                let element = format!("{}_{index}", name.text);
                library.texture_names.declare(&mut self.report, &element, name.span);
                let texture = self.image_texture(&library.name, array, &element);
                library.textures.push(texture);
            }
            library.arrays.insert(name.text.clone(), count);
        }
    }

    /// Binds the arrays of textures and of images of a material. Returns the first unit of each array, of textures and then of images.
    pub(super) fn bound_arrays(
        &mut self,
        library: &Library,
        material: &Element,
        (textures, images): (&mut Option<Vec<Binding>>, &mut Option<Vec<ImageBinding>>),
    ) -> Option<[Vec<u32>; 2]> {
        const KINDS: [(&str, &str, &str); 2] = [
            ("arraysOfTextures", "arrayOfTextures", "name"),
            ("arraysOfImageTexture", "arrayOfImageTexture", "textureArray"),
        ];
        let mut found = Some([Vec::new(), Vec::new()]);
        for (kind, (list, child, attribute)) in KINDS.into_iter().enumerate() {
            let lists = material.children.iter().filter(|found| glsl::AVAILABLE && found.is(&[list]));
            for array in lists.flat_map(|list| &list.children).filter(|found| found.is(&[child])) {
                let (Some(name), Some(first)) = (self.required(array, attribute), self.first_unit(array)) else {
                    found = None;
                    continue;
                };
                let Some(count) = library.arrays.get(&name.text) else {
                    let message = format!("there is no array of textures `{}`", name.shown());
                    self.report.error_help(name.span, message, || {
                        suggest(&name.text, library.arrays.keys().map(String::as_str))
                    });
                    found = None;
                    continue;
                };
                for index in 0..*count {
                    let (unit, text) = (first + index, format!("{}_{index}", name.text));
                    let name = Value { text, joined: None, span: name.span };
                    if kind == 0 {
                        let binding =
                            Binding { unit, library: None, name, compare: None, magnification: Magnification::Linear };
                        textures.iter_mut().for_each(|textures| textures.push(binding.clone()));
                    } else {
                        let binding = ImageBinding { unit, name, cleared: false, level: None };
                        images.iter_mut().for_each(|images| images.push(binding.clone()));
                    }
                }
                found.iter_mut().for_each(|found| found[kind].push(first));
            }
        }
        found
    }

    fn first_unit(&mut self, array: &Element) -> Option<u32> {
        let name = ["firstUnit", "first_unit"].into_iter().find(|name| array.attribute(name).is_some());
        self.unit_of(array, name.unwrap_or("firstUnit"))
    }

    /// The first unit of the array that `<valueof uniform="name[0]" type="ARRAY_OF_TEXTURES_BINDING" component="SAMPLER_ARRAY" id="0"/>`
    /// names; the type may also be `ARRAY_OF_IMAGE_TEXTURES`. Outer `None` for values of other kinds, inner `None` after an error.
    pub(super) fn array_unit(&mut self, given: &ValueOf, material: &LibraryMaterial) -> Option<Option<glsl::Value>> {
        const KINDS: [&str; 2] = ["ARRAY_OF_TEXTURES_BINDING", "ARRAY_OF_IMAGE_TEXTURES"];
        let of = given.kind.as_ref()?;
        let kind = KINDS.iter().position(|kind| of.text.eq_ignore_ascii_case(kind))?;
        let id = given.id.as_ref().map_or(Some(0), |id| id.text.parse::<usize>().ok());
        let unit = id.and_then(|id| material.arrays[kind].get(id));
        if unit.is_none() {
            let (uniform, count) = (given.uniform.shown(), material.arrays[kind].len());
            let message = format!("the uniform `{uniform}` is of an array that the material does not bind");
            let help = format!("`{}` binds {count} such arrays: their ids count from 0", material.name);
            self.report.error_help(given.span, message, || help);
        }
        Some(unit.map(|unit| glsl::Value::Unit(*unit)))
    }

    /// The unit that values give to a sampler or an image. For an array the value gives the unit of its first element; the others
    /// follow. `None` if there is no value. The error is a value that is not a unit.
    pub(super) fn unit_given<'v>(values: &'v [(ValueOf, glsl::Value)], name: &str) -> Option<Result<u32, &'v ValueOf>> {
        let (given, value) = values.iter().rev().find(|(given, _)| names(&given.uniform.text, name))?;
        let index = |name: &str| name.strip_suffix(']').and_then(|name| name.split_once('[')?.1.parse::<u32>().ok());
        let beyond = index(name).unwrap_or(0).saturating_sub(index(&given.uniform.text).unwrap_or(0));
        Some(match value {
            glsl::Value::Unit(unit) => Ok(unit.saturating_add(beyond)),
            _ => Err(given),
        })
    }

    /// The images that `<imageTextures>` of a material binds: `<imageTexture UNIT="0" texture="…"><LEVEL value="0"/></imageTexture>`.
    pub(super) fn bound_images(&mut self, material: &Element) -> Option<Vec<ImageBinding>> {
        let mut found = Some(Vec::new());
        let lists = material.children_named(&["imageTextures"]).filter(|_| glsl::AVAILABLE);
        for image in lists.flat_map(|list| list.children_named(&["imageTexture"])) {
            let (unit, name) = (self.unit_of(image, "unit"), self.required(image, "texture"));
            let cleared = match image.child_value("clear") {
                Some(value) => self.boolean(value),
                None => Some(false),
            };
            let level = image.child_value("level").filter(|level| level.text != "0").cloned();
            let binding = unit.zip(name).zip(cleared);
            found = found.zip(binding).map(|(mut found, ((unit, name), cleared))| {
                found.push(ImageBinding { unit, name: name.clone(), cleared, level });
                found
            });
        }
        found
    }

    /// What is bound to the unit of a shader's image. Inner `None` if nothing is bound, with a warning; outer `None` after an error.
    pub(super) fn image_of(
        &mut self,
        image: &StorageBuffer,
        at: Span,
        values: &[(ValueOf, glsl::Value)],
        used: &ShaderUse<'_>,
    ) -> Option<Option<Bound>> {
        let unit = match Self::unit_given(values, &image.name) {
            Some(Ok(unit)) => unit,
            Some(Err(given)) => {
                let message = format!("the image `{}` is given no image unit", image.name);
                let help = "valid: type=\"IMAGE_TEXTURE\" context=\"CURRENT\" component=\"UNIT\" id=\"0\"";
                self.report.error_help(given.span, message, || help.to_owned());
                return None;
            }
            None => image.point,
        };
        let Some(binding) = used.images().iter().rev().find(|binding| binding.unit == unit) else {
            let material = &used.material.name;
            let message = format!(
                "material `{material}` binds nothing to image unit {unit} of `{}`: what is stored there is lost, as in OpenGL",
                image.name
            );
            let help = format!("<imageTexture unit=\"{unit}\" texture=\"…\"/> in its <imageTextures>");
            self.report.warning(at, message, || Some(help));
            return Some(None);
        };
        let channel = self.find_texture(&binding.name, Some(used.library))?;
        if channel.channel > 0 {
            let name = shown(&self.libraries.channel_name(channel));
            let message =
                format!("the image `{}` is `{name}`, which is not the first channel of its target", image.name);
            let help = || "valid: a texture of its own, or the first channel of a render target".to_owned();
            self.report.error_help(binding.name.span, message, help);
            return None;
        }
        let key = (format!("{}::{}", self.libraries.get(used.library).name, used.material.name), unit);
        let given = binding.level.as_ref().map_or(Some(0), |level| level.text.parse().ok());
        let level = self.attributes.levels.get(&key).copied().or(given);
        let most = self.libraries.levels.get(&channel).copied().unwrap_or_default();
        let target = match level {
            Some(0) => channel.target,
            Some(level) if level <= most => self.level_target(channel, level),
            _ => {
                let shown_level = level
                    .map_or_else(|| binding.level.as_ref().map_or_else(String::new, Value::shown), |l| l.to_string());
                let name = shown(&self.libraries.channel_name(channel));
                let message = format!("material `{}` binds level {shown_level} of `{name}`", used.material.name);
                let at = binding.level.as_ref().map_or(binding.name.span, |level| level.span);
                let help = match most {
                    0 => "valid: 0, since it has one level; <LEVELS value=\"…\"/> in its declaration gives it more"
                        .to_owned(),
                    most => format!("valid: 0 to {most}"),
                };
                self.report.error_help(at, message, || help);
                return None;
            }
        };
        Some(Some(Bound { target, cleared: binding.cleared }))
    }

    /// The value of a uniform that holds the size of an image; `None` for other uniforms.
    pub(super) fn image_extent(&self, storage: &[Option<Bound>], uniform: &str) -> Option<glsl::Value> {
        let bound = storage.get(glsl::is_image_size(uniform)?)?;
        let [width, height] = bound.map_or([0; 2], |bound| self.libraries.targets[bound.target].size);
        Some(glsl::Value::Constant([width as f32, height as f32, 0.0, 0.0]))
    }
}
