//! Materials and textures of a glTF asset.

use super::super::context::{Context, MASK_CUTOFF, MaterialTable, add_texture, normal_scale, texture_file_or};
use super::super::dispersion::of_cauchy;
use super::super::error::SceneError;
use super::super::reflectance::Reflectance;
use super::super::render::alphas::{self, Alphas, BLENDED, CUT_WITHOUT_GLASS, alphas};
use super::super::render::texture::{NO_GLASS_MAP, NO_NORMAL_MAP};
use super::super::texture::{Magnification, Sampling, Wrap};
use super::super::{Material, TextureSource};
use super::accessor::Data;
use super::container::{Target, base64, shortened, uri_target};
use crate::color::encode;
use crate::diagnostic::Warnings;
use ::gltf::json::deserialize::from_str;
use ::gltf::json::{self, Value, material::AlphaMode, texture::MagFilter, texture::WrappingMode, validation::Checked};
use glam::{Mat2, Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::sync::Arc;

/// Transform from a primitive's texture coordinates to those of its material's texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coordinates {
    /// Number of the `TEXCOORD` set that the texture reads.
    pub(super) set: u32,
    linear: Mat2,
    offset: Vec2,
}

impl Coordinates {
    const PLAIN: Coordinates = Coordinates { set: 0, linear: Mat2::IDENTITY, offset: Vec2::ZERO };

    /// Applies `KHR_texture_transform` (scale, then rotation, then translation) and flips v upwards.
    pub(super) fn apply(&self, texcoord: Vec2) -> Vec2 {
        let texcoord = self.linear * texcoord + self.offset;
        Vec2::new(texcoord.x, 1.0 - texcoord.y)
    }
}

/// Effect of alpha on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Alpha {
    /// Alpha is ignored: the surface is opaque.
    Ignored,
    /// Alpha test with the material's cutoff.
    Cut,
    /// `BLEND` drawn as [`Alpha::Cut`] with this cutoff. The material gets the cutoff only if its texture or vertex colours have
    /// alpha; a factor alone cuts nothing.
    Blended(f32),
    /// `BLEND` by the alpha of each texel; the alpha of vertex colours is ignored.
    Soft,
}

/// The material of a primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Surface {
    /// Index of the material in the table.
    pub(super) material: u32,
    pub(super) coordinates: Coordinates,
    /// Whether the material has a normal map and [`crate::scene::Needs`] includes normal maps.
    pub(super) mapped: bool,
    alpha: Alpha,
}

impl Surface {
    /// Whether it is blended by the alpha of each texel.
    pub(super) fn is_soft(&self) -> bool {
        self.alpha == Alpha::Soft
    }
}

/// The materials of an asset.
#[derive(Debug, Default)]
pub(super) struct Materials {
    pub(super) table: MaterialTable,
    pub(super) textures: Vec<TextureSource>,
    /// By material of the asset: its index in the table, and further properties that its primitives need.
    by_index: Vec<Surface>,
    /// The material of primitives without one, once it is made.
    default: Option<u32>,
}

impl Materials {
    pub(super) fn read(
        data: &Data<'_>,
        context: &mut Context<'_>,
        warnings: &mut Warnings,
    ) -> Result<Self, SceneError> {
        let mut materials = Self::default();
        let mut images = vec![None; data.root.images.len()];
        let mut spread = Spread::new();
        for (index, written) in data.root.materials.iter().enumerate() {
            let mut name = written.name.clone().unwrap_or_else(|| format!("material {index}"));
            if materials.table.get(&name).is_some() {
                let taken = name.clone();
                while materials.table.get(&name).is_some() {
                    name = format!("{name}#{index}");
                }
                warnings.add(context.file, "materials with the name of another one", "renamed", || {
                    format!("`{taken}` is now `{name}`")
                });
            }
            let alphas = blended_alphas((written, &name), data, (&mut images, &mut spread), context, warnings)?;
            let soft = alphas.filter(|alphas| alphas.are_soft());
            let mut material = surface(written, name, alphas, context, warnings);
            let mut coordinates = Coordinates::PLAIN;
            let base = written.pbr_metallic_roughness.base_color_texture.as_ref().filter(|_| context.needs.textures);
            if let Some(info) = base {
                coordinates = coordinates_of(info);
                let source = image(info, data, &mut images, (&material.name, NO_TEXTURE), context, warnings)?;
                if let Some(source) = source.clone().filter(|_| soft.is_some() && context.needs.glass_maps) {
                    let clear = source.clear(opacity(written));
                    material.transmission_texture = Some(add_texture(&mut materials.textures, clear));
                }
                material.texture = source.map(|source| add_texture(&mut materials.textures, source));
            }
            let shines = material.emission.truncate() != Vec3::ZERO;
            let emissive = written.emissive_texture.as_ref().filter(|_| context.needs.textures && shines);
            if let Some(info) = emissive {
                let own = coordinates_of(info);
                if base.is_some() && own != coordinates {
                    warnings.add(
                        context.file,
                        "emissive textures with coordinates of their own",
                        "those of the base colour serve",
                        || format!("`{}`", material.name),
                    );
                } else {
                    coordinates = own;
                }
                let source = image(info, data, &mut images, (&material.name, NO_TEXTURE), context, warnings)?;
                material.emission_texture = source.map(|source| add_texture(&mut materials.textures, source));
                if material.emission_texture.is_none() {
                    // Without its texture the factor alone would make the whole surface emit.
                    material.emission = Material::default().emission;
                }
            }
            if let Some(map) = written.normal_texture.as_ref().filter(|_| context.needs.normal_maps) {
                let info = normal_info(map).map_err(|why| {
                    let place =
                        format!("the normal texture of material `{}`: KHR_texture_transform: {why}", material.name);
                    SceneError::file(context.file, place)
                })?;
                let own = coordinates_of(&info);
                let emissive = written.emissive_texture.as_ref().filter(|_| shines);
                let others = written.pbr_metallic_roughness.base_color_texture.as_ref().or(emissive);
                if others.is_some_and(|others| coordinates_of(others) != own) {
                    let what = "normal textures with coordinates of their own";
                    warnings.add(context.file, what, NO_NORMAL_MAP, || format!("`{}`", material.name));
                } else {
                    coordinates = own;
                    let source = image(&info, data, &mut images, (&material.name, NO_NORMAL_MAP), context, warnings)?;
                    let source = source.map(TextureSource::data);
                    material.normal_texture = source.map(|source| add_texture(&mut materials.textures, source));
                    material.normal_scale = normal_scale(context, map.scale, &material.name, warnings);
                }
            }
            let pbr = &written.pbr_metallic_roughness;
            let wanted = context.needs.textures && context.needs.glass_maps && material.roughness > 0.0;
            if let Some(info) = pbr.metallic_roughness_texture.as_ref().filter(|_| wanted) {
                let own = coordinates_of(info);
                if material.textures().next().is_some() && own != coordinates {
                    let what = "roughness textures with coordinates of their own";
                    warnings.add(context.file, what, NO_GLASS_MAP, || format!("`{}`", material.name));
                } else {
                    coordinates = own;
                    let source = image(info, data, &mut images, (&material.name, NO_GLASS_MAP), context, warnings)?;
                    let source = source.map(TextureSource::data);
                    material.roughness_texture = source.map(|source| add_texture(&mut materials.textures, source));
                }
            }
            if let Some(info) = transmission_texture(written, context) {
                let own = coordinates_of(info);
                if material.textures().next().is_some() && own != coordinates {
                    let what = "transmission textures with coordinates of their own";
                    warnings.add(context.file, what, NO_GLASS_MAP, || format!("`{}`", material.name));
                } else {
                    coordinates = own;
                    let source = image(info, data, &mut images, (&material.name, NO_GLASS_MAP), context, warnings)?;
                    let source = source.map(TextureSource::data);
                    material.transmission_texture = source.map(|source| add_texture(&mut materials.textures, source));
                }
            }
            let mapped = material.normal_texture.is_some();
            let alpha = match written.alpha_mode {
                Checked::Valid(AlphaMode::Mask) => Alpha::Cut,
                Checked::Valid(AlphaMode::Blend) if material.transmission_texture.is_some() && soft.is_some() => {
                    Alpha::Soft
                }
                Checked::Valid(AlphaMode::Blend) => Alpha::Blended(MASK_CUTOFF * material.diffuse.w),
                _ => Alpha::Ignored,
            };
            let index = materials.table.materials.len() as u32;
            materials.by_index.push(Surface { material: index, coordinates, mapped, alpha });
            materials.table.declare(material);
        }
        Ok(materials)
    }

    /// The material of a primitive. An index out of range is an error.
    pub(super) fn of(
        &mut self,
        index: Option<json::Index<json::Material>>,
        file: &std::path::Path,
    ) -> Result<Surface, SceneError> {
        let Some(index) = index else {
            let material = *self.default.get_or_insert_with(|| {
                let mut name = "default".to_owned();
                while self.table.get(&name).is_some() {
                    name.push('#');
                }
                // The default material of glTF 2.0, section 3.9.6, is white.
                self.table.declare(Material { name, diffuse: Vec4::ONE, single_sided: true, ..Material::default() });
                self.table.materials.len() as u32 - 1
            });
            return Ok(Surface { material, coordinates: Coordinates::PLAIN, mapped: false, alpha: Alpha::Ignored });
        };
        self.by_index
            .get(index.value())
            .copied()
            .ok_or_else(|| SceneError::file(file, format!("material {} does not exist", index.value())))
    }
}

impl Materials {
    /// Converts linear vertex colours to display values. Their alpha is 1 on surfaces that ignore it. A surface with [`Alpha::Blended`] gets its
    /// cutoff if some alpha is below 1.
    pub(super) fn colored(&mut self, surface: Surface, colors: impl Iterator<Item = Vec4>) -> Vec<Vec4> {
        let mut clear = false;
        let colors = colors
            .map(|color| {
                let alpha = if matches!(surface.alpha, Alpha::Ignored | Alpha::Soft) { 1.0 } else { color.w };
                clear |= alpha < 1.0;
                color.truncate().map(encode).extend(alpha)
            })
            .collect();
        if let (Alpha::Blended(cutoff), true) = (surface.alpha, clear) {
            let material = &mut self.table.materials[surface.material as usize];
            material.alpha_cutoff = material.alpha_cutoff.or(Some(cutoff).filter(|cutoff| *cutoff > 0.0));
        }
        colors
    }
}

/// Whether a material is blended evenly: without a texture and with an alpha below 1.
fn is_even(written: &json::Material) -> bool {
    let pbr = &written.pbr_metallic_roughness;
    written.alpha_mode == Checked::Valid(AlphaMode::Blend)
        && pbr.base_color_texture.is_none()
        && pbr.base_color_factor.0[3] < 1.0
}

/// Whether a material is blended evenly and has no transmission. With transmission it is glass.
fn is_veil(written: &json::Material) -> bool {
    is_even(written) && written.extensions.as_ref().is_none_or(|extensions| extensions.transmission.is_none())
}

/// Distributions of alpha, by image of the asset and opacity; `None` for an image that cannot be read.
type Spread = HashMap<(Option<usize>, u16), Option<Alphas>>;

/// The opacity of a material as a factor of its texture's alpha, in 65,535ths.
fn opacity(written: &json::Material) -> u16 {
    alphas::opacity(written.pbr_metallic_roughness.base_color_factor.0[3])
}

/// The distribution of a material's alpha, if a texture blends the material and it has no transmission. `None` for other materials, and if
/// the texture cannot be read. `spread` caches the results.
fn blended_alphas(
    (written, name): (&json::Material, &str),
    data: &Data<'_>,
    (images, spread): (&mut [Option<Option<TextureSource>>], &mut Spread),
    context: &mut Context<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Alphas>, SceneError> {
    let transmits = written.extensions.as_ref().is_some_and(|extensions| extensions.transmission.is_some());
    if written.alpha_mode != Checked::Valid(AlphaMode::Blend) || transmits {
        return Ok(None);
    }
    let Some(info) = &written.pbr_metallic_roughness.base_color_texture else { return Ok(None) };
    let key = (data.root.textures.get(info.index.value()).map(source_of), opacity(written));
    if let Some(found) = spread.get(&key) {
        return Ok(*found);
    }
    let before = context.budget.clone();
    let source = if context.needs.textures {
        image(info, data, images, (name, NO_TEXTURE), context, warnings)?
    } else {
        // A load without textures does not warn about missing textures.
        let (mut unsaid, mut unkept) = (Warnings::default(), vec![None; images.len()]);
        image(info, data, &mut unkept, (name, NO_TEXTURE), context, &mut unsaid)?
    };
    let found = match &source {
        Some(source) => alphas(source, opacity(written), (context.file, context.budget))?,
        None => None,
    };
    if !context.needs.textures {
        // The image is not kept, so its memory is given back.
        *context.budget = before;
    }
    spread.insert(key, found);
    Ok(found)
}

/// Whether a material is blended evenly and is thin glass: it has transmission and no volume.
fn is_blended_pane(written: &json::Material) -> bool {
    let thin = |e: &json::extensions::material::Material| {
        e.transmission.is_some() && e.volume.as_ref().is_none_or(|volume| volume.thickness_factor.0 <= 0.0)
    };
    is_even(written) && written.extensions.as_ref().is_some_and(thin)
}

/// The transmission texture of glass, if the load needs it; `None` for an evenly blended pane. The texture may dim only the light that
/// passes through the glass, but the pane's transmission also contains the light that passes unchanged (1 - alpha).
fn transmission_texture<'a>(written: &'a json::Material, context: &Context<'_>) -> Option<&'a json::texture::Info> {
    let transmission = written.extensions.as_ref()?.transmission.as_ref()?;
    let wanted = context.needs.textures && context.needs.glass_maps;
    let read = wanted && transmission.transmission_factor.0 > 0.0 && !is_blended_pane(written);
    transmission.transmission_texture.as_ref().filter(|_| read)
}

/// The parameters of a material, without its texture.
fn surface(
    written: &json::Material,
    name: String,
    alphas: Option<Alphas>,
    context: &Context<'_>,
    warnings: &mut Warnings,
) -> Material {
    let mut warn = |what: &'static str, remedy: &'static str, detail: &str| {
        warnings.add(context.file, what, remedy, || format!("{detail}`{name}`"));
    };
    let factor = Vec4::from_array(written.pbr_metallic_roughness.base_color_factor.0);
    let extensions = written.extensions.as_ref();
    let single_sided = !written.double_sided;
    // Colours of a scene are display values, like texels and the colours in the report's files; glTF's factors are linear (2.0,
    // section 3.9.2).
    let mut material =
        Material { single_sided, diffuse: factor.truncate().map(encode).extend(1.0), ..Material::default() };
    match written.alpha_mode {
        Checked::Valid(AlphaMode::Opaque) => {}
        Checked::Valid(AlphaMode::Mask) => {
            let cutoff = written.alpha_cutoff.unwrap_or_default().0;
            // glTF compares factor times texture alpha with the cutoff; here the texture's alpha is compared alone, so the factor
            // is divided out.
            let scaled = if factor.w > 0.0 { cutoff / factor.w } else { f32::INFINITY };
            // The parser refuses numbers beyond the range of f32; should the ratio be NaN all the same, the cutoff stays as written.
            material.alpha_cutoff = Some(if scaled.is_nan() { cutoff } else { scaled });
        }
        Checked::Valid(AlphaMode::Blend) => {
            material.diffuse.w = factor.w;
            let textured = written.pbr_metallic_roughness.base_color_texture.is_some();
            // Texels of less than half opacity, without the factor, become holes; all others are opaque.
            material.alpha_cutoff = (textured && factor.w > 0.0).then_some(MASK_CUTOFF * factor.w);
            if is_veil(written) {
                // The share 1 - alpha of the light passes straight through, neither refracted nor tinted (glTF 2.0, section 3.9.4).
                material.transmission = (1.0 - factor.w).clamp(0.0, 1.0);
                material.veil = 1.0 - material.transmission;
            } else if let Some(soft) = alphas.filter(|alphas| alphas.are_soft()) {
                if !soft.blend(&mut material, context.needs) && context.needs.textures {
                    warn(BLENDED, CUT_WITHOUT_GLASS, "");
                }
            } else if alphas.is_some() {
                warn(
                    "materials that are blended, with hardly a texel that is half clear",
                    "what is half clear or more is cut out",
                    "",
                );
            } else if !is_blended_pane(written) {
                warn("materials that are blended", "what is half clear or more in their texture is cut out", "");
            }
        }
        Checked::Invalid => warn("materials with an unknown alpha mode", "opaque", ""),
    }
    let strength = extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0);
    material.emission = (Vec3::from_array(written.emissive_factor.0) * strength).map(encode).extend(1.0);
    material.emission_added = true;
    if let Some(transmission) = extensions.and_then(|e| e.transmission.as_ref()) {
        material.transmission = transmission.transmission_factor.0.clamp(0.0, 1.0);
        material.veil = 1.0 - material.transmission;
        material.filter_textured = true;
        material.filter = factor.truncate().clamp(Vec3::ZERO, Vec3::ONE);
        material.roughness = written.pbr_metallic_roughness.roughness_factor.0.clamp(0.0, 1.0);
        if is_blended_pane(written) {
            // Alpha is the share of the area that the surface covers; light passes the rest unchanged (glTF 2.0, section 3.9.4).
            let (gap, glass) = (1.0 - factor.w.clamp(0.0, 1.0), factor.w.clamp(0.0, 1.0) * material.transmission);
            material.transmission = gap + glass;
            material.veil = 1.0 - material.transmission;
            material.filter = (Vec3::splat(gap) + material.filter * glass) / material.transmission;
        }
        if transmission.transmission_texture.is_some() && transmission_texture(written, context).is_none() {
            warn("texture maps that no program reads", "ignored", "transmission of ");
        }
    }
    if let Some(ior) = extensions.and_then(|e| e.ior.as_ref()).map(|e| e.ior.0) {
        match ior {
            // An `ior` of 0 means in the extension that the surface reflects everything.
            0.0 => material.ior = f32::INFINITY,
            ior if ior >= 1.0 => material.ior = ior,
            _ => warn("materials with an index of refraction below 1", "1.5 serves", ""),
        }
    }
    if is_veil(written) || alphas.is_some_and(Alphas::are_soft) {
        material.ior = 1.0;
    }
    if let Some(volume) = extensions.and_then(|e| e.volume.as_ref()) {
        material.thickness = volume.thickness_factor.0.max(0.0);
        material.volume = material.thickness > 0.0;
        material.attenuation_color = Vec3::from_array(volume.attenuation_color.0);
        let distance = volume.attenuation_distance.0;
        material.attenuation_distance = if distance > 0.0 { distance } else { f32::INFINITY };
        if volume.thickness_texture.is_some() {
            warn("texture maps that no program reads", "ignored", "thickness of ");
        }
    }
    let extras = Extras::of(written);
    match extras.priority() {
        Ok(None) => {}
        Ok(Some(rank)) => material.priority = rank,
        Err(()) => warn("materials whose `extras.priority` is no whole number from 0 to 255", "0 serves", ""),
    }
    let reflection = "materials whose `extras.reflectionColor` is not three numbers from 0 to 1";
    let refraction = "materials whose `extras.refractionColor` is not three numbers from 0 to 1";
    for (key, kept, what) in [
        ("reflectionColor", &mut material.reflection, reflection),
        ("refractionColor", &mut material.filter, refraction),
    ] {
        match extras.color(key) {
            Ok(color) => *kept *= color.unwrap_or(Vec3::ONE),
            Err(()) => warn(what, "white serves", ""),
        }
    }
    match dispersion(extensions) {
        Ok(share) => material.dispersion = share,
        Err(()) => warn("materials whose dispersion is no number from 0 on", "0 serves", ""),
    }
    match extras.cauchy() {
        Ok(None) => {}
        Ok(Some([index, dispersion])) => (material.ior, material.dispersion) = (index, dispersion),
        Err(()) => {
            warn(
                "materials whose `extras.cauchy` is not [A, B], B in µm² and 0 or more, with an index above 1",
                "ignored",
                "",
            );
        }
    }
    // Missing parameters have the values of Schlick's approximation for the index of refraction.
    match extras.reflectance(&material) {
        Ok(curve) => material.reflectance = curve,
        Err(()) => {
            let what = "materials whose `extras.schlick` is not {minimum, maximum, exponent}, 0 <= minimum <= maximum <= 1, \
                        exponent from 0 to 1000";
            warn(what, "Fresnel's equations serve", "");
        }
    }
    if material.dispersion > 0.0 && material.transmission > 0.0 && !material.volume {
        warn("materials that disperse and have no volume", "drawn without dispersion", "");
    }
    let pbr = &written.pbr_metallic_roughness;
    let mapped = pbr.metallic_roughness_texture.is_some();
    // The roughness texture of glass is read if the load needs glass maps.
    let rough_glass = material.transmission > 0.0 && context.needs.glass_maps;
    for (present, what) in [
        (written.occlusion_texture.is_some(), "occlusion of "),
        (mapped && !rough_glass, "metalness and roughness of "),
        (mapped && rough_glass && pbr.metallic_factor.0 > 0.0, "metalness of "),
    ] {
        if present {
            warn("texture maps that no program reads", "ignored", what);
        }
    }
    material.name = name;
    material
}

/// The `extras` of a material: free JSON, of which a few names are read. Its getters return `None` for a missing name, and an error for a
/// value that is not valid.
struct Extras(Value);

impl Extras {
    fn of(written: &json::Material) -> Self {
        let read = written.extras.as_deref().and_then(|extras| from_str(extras.get()).ok());
        Self(read.unwrap_or(Value::Null))
    }

    /// Rank of the body where bodies overlap (`priority`).
    fn priority(&self) -> Result<Option<u8>, ()> {
        let Some(written) = self.0.get("priority") else { return Ok(None) };
        written.as_u64().and_then(|rank| u8::try_from(rank).ok()).map(Some).ok_or(())
    }

    /// Three shares of light, linear.
    fn color(&self, name: &str) -> Result<Option<Vec3>, ()> {
        let Some(written) = self.0.get(name) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = written.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        let Some([r, g, b]) = numbers.as_deref() else { return Err(()) };
        let color = [r, g, b].map(|share| *share as f32);
        color.iter().all(|share| (0.0..=1.0).contains(share)).then_some(Some(Vec3::from(color))).ok_or(())
    }

    /// The reflectance that replaces Fresnel's equations (`schlick`).
    fn reflectance(&self, material: &Material) -> Result<Option<Reflectance>, ()> {
        let Some(written) = self.0.get("schlick") else { return Ok(None) };
        let Some(numbers) = written.as_object() else { return Err(()) };
        let mut curve = Reflectance::of_index(material.ior);
        for (name, number) in numbers {
            let place = match name.as_str() {
                "minimum" => &mut curve.minimum,
                "maximum" => &mut curve.maximum,
                "exponent" => &mut curve.exponent,
                _ => return Err(()),
            };
            *place = number.as_f64().ok_or(())? as f32;
        }
        curve.is_valid().then_some(Some(curve)).ok_or(())
    }

    /// Cauchy's A and B (µm²) of an index A + B / λ², as the index at the line d and the dispersion.
    fn cauchy(&self) -> Result<Option<[f32; 2]>, ()> {
        let Some(written) = self.0.get("cauchy") else { return Ok(None) };
        let numbers: Option<Vec<f64>> = written.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        let Some([a, b]) = numbers.as_deref() else { return Err(()) };
        let [index, spread] = of_cauchy([*a, *b]);
        let found = [index, 20.0 * spread / (index - 1.0)].map(|value| value as f32);
        let valid = *b >= 0.0 && found[0] > 1.0 && found.iter().all(|value| value.is_finite());
        valid.then_some(Some(found)).ok_or(())
    }
}

/// `KHR_materials_dispersion`: 20 divided by the Abbe number; 0 without dispersion.
fn dispersion(extensions: Option<&json::extensions::material::Material>) -> Result<f32, ()> {
    let extension = extensions.and_then(|extensions| extensions.others.get("KHR_materials_dispersion"));
    let Some(written) = extension.and_then(|extension| extension.get("dispersion")) else { return Ok(0.0) };
    let share = written.as_f64().map(|share| share as f32);
    share.filter(|share| share.is_finite() && *share >= 0.0).ok_or(())
}

/// Remedy in warnings about a missing colour texture.
const NO_TEXTURE: &str = "the diffuse colour serves";

/// A normal texture in the form of other textures; the crate `gltf` leaves its extensions unparsed.
fn normal_info(map: &json::material::NormalTexture) -> Result<json::texture::Info, String> {
    const TRANSFORM: &str = "KHR_texture_transform";
    let transform = map.extensions.as_ref().and_then(|extensions| extensions.others.get(TRANSFORM));
    let texture_transform =
        transform.cloned().map(serde_json::from_value).transpose().map_err(|error| error.to_string())?;
    Ok(json::texture::Info {
        index: map.index,
        tex_coord: map.tex_coord,
        extensions: Some(json::extensions::texture::Info { texture_transform, ..Default::default() }),
        extras: Default::default(),
    })
}

fn coordinates_of(info: &json::texture::Info) -> Coordinates {
    let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
    let Some(transform) = transform else { return Coordinates { set: info.tex_coord, ..Coordinates::PLAIN } };
    let (sin, cos) = transform.rotation.0.sin_cos();
    let [scale_u, scale_v] = transform.scale.0;
    Coordinates {
        set: transform.tex_coord.unwrap_or(info.tex_coord),
        linear: Mat2::from_cols(Vec2::new(cos, -sin) * scale_u, Vec2::new(sin, cos) * scale_v),
        offset: Vec2::from_array(transform.offset.0),
    }
}

/// Extensions that name an image in another format. Such an image is preferred to the texture's own.
const IMAGE_EXTENSIONS: [&str; 2] = ["EXT_texture_webp", "MSFT_texture_dds"];
/// An extension whose image format is not read.
const BASIS: &str = "KHR_texture_basisu";

/// The index of a texture's image; it may be out of range.
fn source_of(texture: &json::Texture) -> usize {
    let named = texture.extensions.as_ref().and_then(|extensions| {
        let source = |name: &str| extensions.others.get(name)?.get("source")?.as_u64();
        IMAGE_EXTENSIONS.iter().find_map(|name| source(name)).and_then(|index| usize::try_from(index).ok())
    });
    named.unwrap_or_else(|| texture.source.value())
}

/// The wrap mode of a sampler (glTF 2.0, section 3.8.4.5).
fn wrap_of(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// How a sampler reads textures. Minified textures are always filtered trilinearly, whatever `minFilter` says.
fn sampling_of(sampler: &json::texture::Sampler) -> Sampling {
    let magnification = match sampler.mag_filter {
        Some(Checked::Valid(MagFilter::Nearest)) => Magnification::Nearest,
        _ => Magnification::Linear,
    };
    Sampling { wrap: [wrap_of(sampler.wrap_s), wrap_of(sampler.wrap_t)], magnification }
}

/// The image of a texture. `images` caches the results of earlier look-ups; a missing image is a warning.
fn image(
    info: &json::texture::Info,
    data: &Data<'_>,
    images: &mut [Option<Option<TextureSource>>],
    (material, remedy): (&str, &'static str),
    context: &mut Context<'_>,
    warnings: &mut Warnings,
) -> Result<Option<TextureSource>, SceneError> {
    let file = context.file;
    let missing = |warnings: &mut Warnings, why: String| {
        warnings.add(file, "missing textures", remedy, || format!("{why}, of material `{material}`"));
    };
    let Some(texture) = data.root.textures.get(info.index.value()) else {
        return Err(SceneError::file(file, format!("texture {} does not exist", info.index.value())));
    };
    let sampler = texture.sampler.and_then(|sampler| data.root.samplers.get(sampler.value()));
    let sampling = sampler.map_or(Sampling::default(), sampling_of);
    let index = source_of(texture);
    let Some(written) = data.root.images.get(index) else {
        let basis = texture.extensions.as_ref().is_some_and(|others| others.others.contains_key(BASIS));
        let kind = if basis { format!("only a {BASIS} image, which is not read") } else { "no image".to_owned() };
        missing(warnings, format!("texture {} has {kind}", info.index.value()));
        return Ok(None);
    };
    if let Some(known) = &images[index] {
        return Ok(known.clone().map(|source| source.sampled(sampling)));
    }
    let name = || format!("{}#image{index}", file.display());
    let source = match (&written.uri, written.buffer_view) {
        (Some(uri), _) => match uri_target(uri) {
            Ok(Target::Path(path)) => {
                texture_file_or(context, &path, warnings, (material, remedy)).map(TextureSource::File)
            }
            Ok(Target::Data(text)) => {
                // The decoded bytes are copied once, to where they are shared.
                context.take("an embedded image", text.len(), 2)?;
                let bytes = base64(text).map(Arc::<[u8]>::from);
                context.budget.give_back(text.len() as u64);
                if bytes.is_none() {
                    missing(warnings, format!("image {index} is not valid base64"));
                }
                bytes.map(|bytes| TextureSource::Embedded { name: name(), bytes })
            }
            Err(why) => {
                missing(warnings, format!("image {index} {why}: `{}`", shortened(uri)));
                None
            }
        },
        (None, Some(view)) => {
            let bytes = data.view(view).map_err(|what| SceneError::file(file, format!("image {index}: {what}")))?;
            context.take("an embedded image", bytes.len(), 1)?;
            Some(TextureSource::Embedded { name: name(), bytes: bytes.into() })
        }
        (None, None) => {
            missing(warnings, format!("image {index} has no data"));
            None
        }
    };
    images[index] = Some(source.clone());
    Ok(source.map(|source| source.sampled(sampling)))
}
