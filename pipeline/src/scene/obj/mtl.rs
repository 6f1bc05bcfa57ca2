//! Wavefront material libraries (Alias "MTL Material Format", 1995), and their conversion to materials.
//!
//! The reader of `tobj` is not used: it panics on the legal `Kd 0.5` and rejects whole files for `d -halo 0.5`.

use super::super::Material;
use super::super::TextureSource;
use super::super::context::{
    Context, MASK_CUTOFF, MaterialTable, add_texture, normal_scale, read_file, texture_file, texture_file_or,
};
use super::super::error::SceneError;
use super::super::render::alphas::{self, Alphas, BLENDED, CUT_WITHOUT_GLASS};
use super::super::render::texture::{NO_GLASS_MAP, NO_NORMAL_MAP, image_has_alpha, is_cut_out};
use super::super::texture::Wrap;
use super::lines::{Lines, number, split_word, text, words};
use crate::diagnostic::Warnings;
use glam::{Vec2, Vec3, Vec4};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// A map statement: the file name as written, and the transform of its coordinates.
#[derive(Debug, Clone, PartialEq)]
struct Map {
    file: String,
    scale: Vec2,
    offset: Vec2,
    /// `-clamp on`.
    clamped: bool,
    /// `-bm`.
    multiplier: f32,
}

impl Map {
    fn coordinates(&self) -> (Vec2, Vec2) {
        (self.scale, self.offset)
    }

    fn wrap(&self) -> [Wrap; 2] {
        [if self.clamped { Wrap::Clamp } else { Wrap::Repeat }; 2]
    }
}

/// Statements of one material, as written.
#[derive(Debug, Clone, Default)]
struct Declaration {
    name: String,
    kd: Option<Vec3>,
    ka: Option<Vec3>,
    ks: Option<Vec3>,
    ke: Option<Vec3>,
    tf: Option<Vec3>,
    ns: Option<f32>,
    ni: Option<f32>,
    pr: Option<f32>,
    d: Option<f32>,
    tr: Option<f32>,
    illum: Option<u32>,
    map_kd: Option<Map>,
    map_d: Option<Map>,
    norm: Option<Map>,
    map_pr: Option<Map>,
}

/// The materials of all libraries of a file.
#[derive(Debug, Default)]
pub(super) struct Library {
    pub(super) table: MaterialTable,
    pub(super) textures: Vec<TextureSource>,
    /// Scale and offset of texture coordinates by material; `None` if the library does not change them.
    pub(super) coordinates: Vec<Option<(Vec2, Vec2)>>,
    /// Textures already examined, and whether they have holes.
    cut_out: HashMap<PathBuf, bool>,
    /// Distributions of the alpha of textures, by texture name and opacity; `None` for a texture that cannot be read.
    spread: HashMap<(String, u16), Option<Alphas>>,
    /// Libraries already read. Reading one again declares nothing new, and a file may name the same library a million times.
    files: HashSet<PathBuf>,
    /// Arguments of `mtllib` statements already followed, since a file may repeat one a million times.
    arguments: HashSet<String>,
}

impl Library {
    /// Adds the materials of one file. Materials declared earlier are kept.
    ///
    /// # Errors
    /// If decoding a texture to look for holes needs more memory than is left.
    pub(super) fn read(
        &mut self,
        bytes: &[u8],
        context: &mut Context<'_>,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let mut parser = Parser { file: context.file, warnings, current: None, done: Vec::new() };
        let mut lines = Lines::new(bytes);
        while let Some((line, statement)) = lines.next() {
            parser.statement(line, &statement);
        }
        let Parser { current, mut done, .. } = parser;
        done.extend(current);
        for declaration in done {
            let name = declaration.name.clone();
            if self.table.get(&name).is_some() {
                warnings.add(context.file, "materials declared twice", "the first declaration serves", || {
                    format!("`{name}`")
                });
                continue;
            }
            let coordinates = [&declaration.map_kd, &declaration.norm, &declaration.map_pr];
            let coordinates = coordinates.into_iter().find_map(|map| Some(map.as_ref()?.coordinates()));
            let material = self.material(declaration, context, warnings)?;
            self.table.declare(material);
            self.coordinates.push(coordinates.filter(|(scale, offset)| *scale != Vec2::ONE || *offset != Vec2::ZERO));
        }
        Ok(())
    }

    /// Whether a texture has holes: texels whose alpha is below [`MASK_CUTOFF`]. The result is cached, since materials may share a texture.
    fn is_cut_out(
        &mut self,
        texture: &Path,
        context: &mut Context<'_>,
        warnings: &mut Warnings,
    ) -> Result<bool, SceneError> {
        if let Some(known) = self.cut_out.get(texture) {
            return Ok(*known);
        }
        let found = is_cut_out(texture, MASK_CUTOFF, context.budget)?;
        if found.is_none() {
            let what = "textures that cannot be searched for holes";
            warnings.add(context.file, what, "taken for whole", || texture.display().to_string());
        }
        let found = found.unwrap_or(false);
        self.cut_out.insert(texture.to_owned(), found);
        Ok(found)
    }

    fn material(
        &mut self,
        written: Declaration,
        context: &mut Context<'_>,
        warnings: &mut Warnings,
    ) -> Result<Material, SceneError> {
        let defaults = Material::default();
        let color = |written: Option<Vec3>, default: Vec4| written.map_or(default, |color| color.extend(1.0));
        let is_glass = is_glass(&written);
        // Some exporters, MeshLab among them, write the opacity as `Tr`. An invisible material is not intended, so `Tr 1` means opaque;
        // but glass may be wholly clear.
        let is_opacity = written.d.is_none() && !is_glass && written.tr.is_some_and(|tr| tr >= 1.0);
        if is_opacity {
            let what = "materials that `Tr 1` would make invisible";
            warnings.add(context.file, what, "taken for opaque; `d 0` hides them", || format!("`{}`", written.name));
        }
        let clear = written.tr.filter(|_| !is_opacity).map(|tr| 1.0 - tr);
        let dissolve = written.d.or(clear).unwrap_or(1.0).clamp(0.0, 1.0);
        let mut material = Material {
            diffuse: color(written.kd, defaults.diffuse).truncate().extend(dissolve),
            ambient: color(written.ka, defaults.ambient),
            specular: color(written.ks, defaults.specular),
            emission: color(written.ke, defaults.emission),
            emission_added: true,
            shininess: written.ns.unwrap_or(defaults.shininess).max(0.0),
            transmission: transmission(&written, dissolve),
            volume: matches!(written.illum, Some(6 | 7)),
            filter: filter(&written),
            veil: if is_glass { 0.0 } else { dissolve },
            ior: written.ni.filter(|ni| *ni >= 1.0).unwrap_or(defaults.ior),
            roughness: written.pr.unwrap_or(defaults.roughness).clamp(0.0, 1.0),
            name: written.name.clone(),
            ..defaults
        };
        if let Some(map) = written.norm.as_ref().filter(|_| context.needs.normal_maps) {
            self.normal_map(map, written.map_kd.as_ref(), &mut material, context, warnings);
        }
        self.roughness_map(&written, &mut material, context, warnings);
        // A load without textures does not warn about them.
        let mut unsaid = Warnings::default();
        let warnings = if context.needs.textures { warnings } else { &mut unsaid };
        if let Some(map) = &written.map_kd {
            if let Some((source, alpha)) = color_texture(map, &written, context, warnings) {
                let opacity = alphas::opacity(dissolve);
                let blends = !is_glass && (alpha == Alpha::Mask || alpha == Alpha::OfColor && dissolve < 1.0);
                let soft = if blends { self.alphas(&source, opacity, context)? } else { None };
                let soft = soft.filter(|alphas| alphas.are_soft());
                if soft.is_some() {
                    material.ior = 1.0;
                }
                let by_texel = soft.is_some_and(|soft| soft.blend(&mut material, context.needs));
                if !context.needs.textures {
                    return Ok(material);
                }
                let source = source.wrapped(map.wrap());
                if by_texel {
                    let clear = source.clone().clear(opacity);
                    material.transmission_texture = Some(add_texture(&mut self.textures, clear));
                } else {
                    if soft.is_some() {
                        warnings.add(context.file, BLENDED, CUT_WITHOUT_GLASS, || format!("`{}`", material.name));
                    }
                    let is_cut = match (alpha, source.texels().0) {
                        (Alpha::Mask, _) => true,
                        // Glass is not cut out: its transparency is its transmission.
                        (Alpha::OfColor, TextureSource::File(color)) if !is_glass => {
                            self.is_cut_out(color, context, warnings)?
                        }
                        _ => false,
                    };
                    material.alpha_cutoff = is_cut.then_some(MASK_CUTOFF);
                }
                material.texture = Some(add_texture(&mut self.textures, source));
            }
        } else if let Some(mask) = &written.map_d {
            warnings.add(context.file, "masks of materials without a colour texture", "ignored", || {
                format!("`{}` of `{}`", mask.file, material.name)
            });
        }
        Ok(material)
    }
}

/// Source of the alpha of a colour texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Alpha {
    /// The image of `map_d`.
    Mask,
    /// The image of `map_Kd` itself.
    OfColor,
    /// No alpha: the image of `map_d` has none, and the alpha of the image of `map_Kd` is ignored.
    Ignored,
}

/// The colour texture of a material, and where its alpha comes from; `None` if the colour image is missing. If the image of `map_d` is
/// missing, the colour image's own alpha is used.
fn color_texture(
    map: &Map,
    written: &Declaration,
    context: &Context<'_>,
    warnings: &mut Warnings,
) -> Option<(TextureSource, Alpha)> {
    let color = texture_file(context, &map.file, warnings, &written.name);
    let mask = written.map_d.as_ref().and_then(|mask| match mask.file == map.file {
        true => color.clone(),
        false => texture_file(context, &mask.file, warnings, &written.name),
    });
    let color = color?;
    Some(match mask {
        Some(mask) if mask != color => (TextureSource::Masked { color, mask }, Alpha::Mask),
        Some(mask) if image_has_alpha(&mask) => (TextureSource::File(color), Alpha::Mask),
        Some(mask) => {
            warnings.add(context.file, "masks without an alpha channel", "ignored", || {
                format!("{} of `{}`", mask.display(), written.name)
            });
            (TextureSource::File(color), Alpha::Ignored)
        }
        None => (TextureSource::File(color), Alpha::OfColor),
    })
}

impl Library {
    /// The distribution of a texture's alpha, times an opacity in 65,535ths; `None` if the texture cannot be read. The result is cached.
    fn alphas(
        &mut self,
        source: &TextureSource,
        opacity: u16,
        context: &mut Context<'_>,
    ) -> Result<Option<Alphas>, SceneError> {
        let key = (source.name(), opacity);
        if let Some(found) = self.spread.get(&key) {
            return Ok(*found);
        }
        let found = alphas::alphas(source, opacity, (context.file, context.budget))?;
        self.spread.insert(key, found);
        Ok(found)
    }

    /// The normal map of a material (`norm` of "PBR Extension to the MTL Format"). It uses the coordinates of the colour texture.
    fn normal_map(
        &mut self,
        map: &Map,
        color: Option<&Map>,
        material: &mut Material,
        context: &Context<'_>,
        warnings: &mut Warnings,
    ) {
        if color.is_some_and(|color| color.coordinates() != map.coordinates()) {
            let what = "normal textures with coordinates of their own";
            warnings.add(context.file, what, NO_NORMAL_MAP, || format!("`{}`", material.name));
            return;
        }
        if let Some(path) = texture_file_or(context, &map.file, warnings, (&material.name, NO_NORMAL_MAP)) {
            let source = TextureSource::File(path).wrapped(map.wrap()).data();
            material.normal_texture = Some(add_texture(&mut self.textures, source));
            material.normal_scale = normal_scale(context, map.multiplier, &material.name, warnings);
        }
    }
}

impl Library {
    /// The roughness map of glass, at the coordinates of the other textures. It multiplies `Pr`, or 1 if `Pr` is missing.
    fn roughness_map(
        &mut self,
        written: &Declaration,
        material: &mut Material,
        context: &Context<'_>,
        warnings: &mut Warnings,
    ) {
        let Some(map) = &written.map_pr else { return };
        let needs = context.needs;
        if !(needs.textures && needs.glass_maps && material.transmission > 0.0) {
            let what = "roughness maps that no program reads";
            warnings.add(context.file, what, "ignored", || format!("`{}`", material.name));
            return;
        }
        let others = [&written.map_kd, &written.norm].into_iter().flatten();
        if others.into_iter().any(|other| other.coordinates() != map.coordinates()) {
            let what = "roughness textures with coordinates of their own";
            warnings.add(context.file, what, NO_GLASS_MAP, || format!("`{}`", material.name));
            return;
        }
        if let Some(path) = texture_file_or(context, &map.file, warnings, (&material.name, NO_GLASS_MAP)) {
            let source = TextureSource::File(path).wrapped(map.wrap()).data();
            material.roughness_texture = Some(add_texture(&mut self.textures, source));
            material.roughness = written.pr.unwrap_or(1.0).clamp(0.0, 1.0);
        }
    }
}

/// The share of light that enters. The illumination models 4, 6, 7 and 9 are glass: the share is the transmission filter `Tf`,
/// or else `1 - d`, or else 1. Other models are glass as far as `d` is below 1; their `Tf` is ignored, since exporters write
/// `Tf 1 1 1` with every opaque material.
fn transmission(written: &Declaration, dissolve: f32) -> f32 {
    let share = match written.illum {
        _ if is_glass(written) => match written.tf {
            Some(filter) => filter.max_element(),
            None if dissolve < 1.0 => 1.0 - dissolve,
            None => 1.0,
        },
        _ => 1.0 - dissolve,
    };
    share.clamp(0.0, 1.0)
}

/// Whether the illumination model is a glass model.
fn is_glass(written: &Declaration) -> bool {
    matches!(written.illum, Some(4 | 6 | 7 | 9))
}

/// Share of light by colour that passes the surface at each crossing. Models 6 and 7 refract, so their surface bounds a body that
/// light crosses twice: each crossing keeps the square root of `Tf`.
fn filter(written: &Declaration) -> Vec3 {
    let filter = written.tf.filter(|_| is_glass(written)).unwrap_or(Vec3::ONE).clamp(Vec3::ZERO, Vec3::ONE);
    if matches!(written.illum, Some(6 | 7)) { filter.map(f32::sqrt) } else { filter }
}

struct Parser<'a> {
    file: &'a Path,
    warnings: &'a mut Warnings,
    current: Option<Declaration>,
    done: Vec<Declaration>,
}

impl Parser<'_> {
    /// Counts a warning about a statement. Only a keyword of the format is quoted, never the rest of the line: a `mtllib` statement
    /// may name a file of another kind in order to have its contents shown.
    fn warn(&mut self, line: u64, what: &'static str, keyword: Option<&[u8]>) {
        self.warnings.add(self.file, what, "ignored", || match keyword {
            Some(keyword) => format!("line {line}: `{}`", text(keyword)),
            None => format!("line {line}"),
        });
    }

    fn statement(&mut self, line: u64, statement: &[u8]) {
        let (keyword, rest) = split_word(statement);
        let keyword = keyword.to_ascii_lowercase();
        if keyword.is_empty() {
            return;
        }
        if keyword == b"newmtl" {
            let declaration = Declaration { name: text(rest), ..Declaration::default() };
            self.done.extend(self.current.replace(declaration));
            return;
        }
        let Some(current) = &mut self.current else {
            self.warn(line, "material statements before the first newmtl", None);
            return;
        };
        let understood = match &keyword[..] {
            b"kd" => set(&mut current.kd, color(rest)),
            b"ka" => set(&mut current.ka, color(rest)),
            b"ks" => set(&mut current.ks, color(rest)),
            b"ke" => set(&mut current.ke, color(rest)),
            b"tf" => set(&mut current.tf, color(rest)),
            b"ns" => set(&mut current.ns, scalar(rest)),
            b"ni" => set(&mut current.ni, scalar(rest)),
            b"pr" => set(&mut current.pr, scalar(rest)),
            b"tr" => set(&mut current.tr, scalar(rest)),
            // `d -halo 0.5` depends on the viewing angle; its factor is used as a constant.
            b"d" => {
                let (first, factor) = split_word(rest);
                set(&mut current.d, scalar(if first == b"-halo" { factor } else { rest }))
            }
            b"illum" => {
                let model = scalar(rest).map(|model| model as u32);
                if matches!(model, Some(3 | 5 | 8)) {
                    let what = "materials that mirror (`illum` 3, 5, 8)";
                    self.warnings.add(self.file, what, "drawn without reflections", || format!("line {line}"));
                }
                set(&mut current.illum, model)
            }
            b"map_kd" => set(&mut current.map_kd, map(rest)),
            b"map_d" => set(&mut current.map_d, map(rest)),
            b"map_pr" => set(&mut current.map_pr, map(rest)),
            b"norm" | b"map_kn" => set(&mut current.norm, map(rest)),
            b"map_ka" | b"map_ks" | b"map_ke" | b"map_ns" | b"map_bump" | b"bump" | b"map_tr" | b"disp" | b"decal"
            | b"refl" | b"map_refl" | b"map_pm" | b"map_ps" | b"map_aat" | b"map_rma" | b"map_orm" | b"map_disp"
            | b"map_ni" => {
                self.warn(line, "texture maps that no program reads", Some(&keyword));
                true
            }
            b"sharpness" | b"pm" | b"ps" | b"pc" | b"pcr" | b"aniso" | b"anisor" | b"km" => true,
            _ => {
                self.warn(line, "unknown material statements", None);
                true
            }
        };
        if !understood {
            self.warn(line, "material statements with values that cannot be read", Some(&keyword));
        }
    }
}

fn set<T>(target: &mut Option<T>, value: Option<T>) -> bool {
    let understood = value.is_some();
    if understood {
        *target = value;
    }
    understood
}

fn finite(word: &[u8]) -> Option<f32> {
    number(word).filter(|value| value.is_finite())
}

fn scalar(rest: &[u8]) -> Option<f32> {
    finite(words(rest).next()?)
}

/// Parses one or three numbers; `spectral` files and `xyz` colours are not read.
fn color(rest: &[u8]) -> Option<Vec3> {
    let mut words = words(rest);
    let red = finite(words.next()?)?;
    match (words.next(), words.next()) {
        (None, _) => Some(Vec3::splat(red)),
        (Some(green), Some(blue)) => Some(Vec3::new(red, finite(green)?, finite(blue)?)),
        (Some(_), None) => None,
    }
}

/// Parses options and a file name, which may contain blanks. `-s` and `-o` change the coordinates, `-clamp` the wrap mode, `-bm`
/// the multiplier; other options have no effect.
fn map(rest: &[u8]) -> Option<Map> {
    let mut map = Map { file: String::new(), scale: Vec2::ONE, offset: Vec2::ZERO, clamped: false, multiplier: 1.0 };
    let mut rest = rest;
    while rest.starts_with(b"-") {
        let (option, after) = split_word(rest);
        rest = after;
        match option {
            b"-o" | b"-s" | b"-t" => {
                let mut values = [None; 3];
                for value in &mut values {
                    let (word, after) = split_word(rest);
                    *value = finite(word);
                    if value.is_none() {
                        break;
                    }
                    rest = after;
                }
                let target = match option {
                    b"-o" => &mut map.offset,
                    b"-s" => &mut map.scale,
                    _ => continue,
                };
                target.x = values[0].unwrap_or(target.x);
                target.y = values[1].unwrap_or(target.y);
            }
            b"-mm" => rest = split_word(split_word(rest).1).1,
            b"-clamp" => {
                let (word, after) = split_word(rest);
                map.clamped = word == b"on";
                rest = after;
            }
            b"-bm" => {
                let (word, after) = split_word(rest);
                map.multiplier = finite(word).unwrap_or(map.multiplier);
                rest = after;
            }
            b"-blendu" | b"-blendv" | b"-cc" | b"-boost" | b"-texres" | b"-imfchan" | b"-type" => {
                rest = split_word(rest).1;
            }
            // A file name may start with a hyphen.
            _ => {
                map.file = text(&[option, b" ", rest].concat()).trim().to_owned();
                return Some(map);
            }
        }
    }
    map.file = text(rest);
    (!map.file.is_empty()).then_some(map)
}

/// Finds and reads the libraries that a `mtllib` statement names: a single file name with blanks, or several names.
pub(super) fn read_libraries(
    argument: &str,
    line: u64,
    library: &mut Library,
    context: &mut Context<'_>,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    if !library.arguments.insert(argument.to_owned()) {
        return Ok(());
    }
    let find =
        |name: &str| crate::paths::resolve_path(context.folder(), name).filter(|resolved| resolved.path.is_file());
    let mut found = Vec::new();
    if let Some(whole) = find(argument) {
        found.push((argument, Some(whole)));
    } else {
        found.extend(argument.split_whitespace().map(|name| (name, find(name))));
        if found.iter().all(|(_, file)| file.is_none()) {
            found = vec![(argument, None)];
        }
    }
    for (name, file) in found {
        let Some(resolved) = file else {
            warnings.add(context.file, "missing material libraries", "their materials are light grey", || {
                format!("line {line}: `{name}`")
            });
            continue;
        };
        if resolved.case_differs {
            warnings.add(context.file, "paths with other letter case", "the file was found all the same", || {
                format!("line {line}: `{name}` is {}", resolved.path.display())
            });
        }
        if !library.files.insert(resolved.path.clone()) {
            continue;
        }
        let failed = |error: std::io::Error| SceneError::file(&resolved.path, error.to_string());
        let size = std::fs::metadata(&resolved.path).map_err(failed)?.len();
        let bytes = read_file(&resolved.path, size, context.budget)?;
        let mut within = Context { file: &resolved.path, needs: context.needs, budget: &mut *context.budget };
        library.read(&bytes, &mut within, warnings)?;
        within.budget.give_back(size);
    }
    Ok(())
}
