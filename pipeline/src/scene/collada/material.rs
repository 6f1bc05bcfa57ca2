//! Materials from effects of the common profile.

use super::xml::{Document, Element, plain};
use crate::diagnostic::Warnings;
use crate::scene::context::{Context, MASK_CUTOFF, MaterialTable, add_texture, texture_file_or_suffix};
use crate::scene::texture::{Magnification, Sampling};
use crate::scene::{Material, TextureSource};
use glam::{Vec3, Vec4};
use std::collections::HashMap;

/// Weights of the luminance of a colour (COLLADA 1.4.1, "Determining transparency").
const LUMINANCE: Vec3 = Vec3::new(0.212_671, 0.715_160, 0.072_169);
/// Opacity of an invisible material. It is above 0 because the weights of the luminance are rounded.
const INVISIBLE: f32 = 1e-6;

/// The materials that drawn primitives use.
#[derive(Debug, Default)]
pub(super) struct Materials {
    pub(super) table: MaterialTable,
    pub(super) textures: Vec<TextureSource>,
    /// Index by the material's id in the file; the key is `None` for primitives that name no material.
    by_id: HashMap<Option<String>, u32>,
}

impl Materials {
    /// The index of the material that a URL names. The material is read at its first use; a light grey material replaces a missing one.
    pub(super) fn of(
        &mut self,
        url: Option<&str>,
        document: &Document<'_>,
        context: &Context<'_>,
        warnings: &mut Warnings,
    ) -> u32 {
        let id = url.map(|url| url.strip_prefix('#').unwrap_or(url).to_owned());
        if let Some(known) = self.by_id.get(&id) {
            return *known;
        }
        let written = id.as_deref().and_then(|id| document.find(id)).map(|index| document.get(index));
        let written = written.filter(|written| written.name() == "material");
        let named = written.and_then(|written| written.attribute("name")).or(id.as_deref()).unwrap_or("default");
        let mut name = plain(named).into_owned();
        // Names may repeat in the file; ids may not.
        while self.table.get(&name).is_some() {
            name = format!("{name}#{}", id.as_deref().unwrap_or("default"));
        }
        let mut material = Material { name, ..Material::default() };
        let effect = written
            .and_then(|written| document.descend(written, &["instance_effect"]))
            .and_then(|instance| document.find(instance.attribute("url")?))
            .and_then(|effect| document.descend(document.get(effect), &["profile_COMMON"]));
        match effect {
            Some(profile) => self.surface(&mut material, profile, document, context, warnings),
            None if id.is_some() => {
                let what = "materials that are used but not described";
                warnings.add(context.file, what, "a light grey one serves", || format!("`{}`", material.name));
            }
            None => {}
        }
        let index = self.table.materials.len() as u32;
        self.table.declare(material);
        self.by_id.insert(id, index);
        index
    }

    fn surface(
        &mut self,
        material: &mut Material,
        profile: &Element<'_>,
        document: &Document<'_>,
        context: &Context<'_>,
        warnings: &mut Warnings,
    ) {
        const SHADINGS: [&str; 4] = ["phong", "blinn", "lambert", "constant"];
        let technique = document.descend(profile, &["technique"]);
        let shading = technique.and_then(|technique| {
            document.all_children(technique).map(|(_, child)| child).find(|child| SHADINGS.contains(&child.name()))
        });
        let Some(shading) = shading else {
            let what = "materials of another shading than phong, blinn, lambert and constant";
            warnings.add(context.file, what, "a light grey one serves", || format!("`{}`", material.name));
            return;
        };
        let color = |name: &str| color(document.descend(shading, &[name, "color"])?);
        let number = |name: &str| {
            let written = document.descend(shading, &[name, "float"])?;
            written.text().parse::<f32>().ok().filter(|number| number.is_finite())
        };
        let texture = |name: &str| document.descend(shading, &[name, "texture"])?.attribute("texture");
        material.diffuse = color("diffuse").unwrap_or(material.diffuse).truncate().extend(1.0);
        material.ambient = color("ambient").unwrap_or(material.ambient);
        material.specular = color("specular").unwrap_or(material.specular);
        material.emission = color("emission").unwrap_or(material.emission);
        material.emission_added = true;
        material.shininess = number("shininess").unwrap_or(material.shininess).max(0.0);
        material.ior = number("index_of_refraction").filter(|index| *index >= 1.0).unwrap_or(material.ior);
        if let Some(name) = texture("diffuse").filter(|_| context.needs.textures) {
            let sampler = sampler(name, profile, document);
            let image = image(name, sampler, profile, document);
            let path = image.as_deref().unwrap_or(name);
            let found = texture_file_or_suffix(context, path, warnings, &material.name);
            let magnified = sampler.and_then(|sampler| document.descend(sampler, &["magfilter"]));
            let magnification = match magnified.map(|filter| filter.text().trim()) {
                Some("NEAREST") => Magnification::Nearest,
                _ => Magnification::Linear,
            };
            let sampling = Sampling { magnification, ..Sampling::default() };
            let add = |path| add_texture(&mut self.textures, TextureSource::File(path).sampled(sampling));
            material.texture = found.map(add);
            // The texture alone gives the colour.
            material.diffuse = Vec4::ONE;
        }
        if texture("transparent").is_some() {
            material.alpha_cutoff = material.texture.map(|_| MASK_CUTOFF);
        } else if let Some(transparent) = document.descend(shading, &["transparent"]) {
            let factor = number("transparency").unwrap_or(1.0);
            let clear = color("transparent").unwrap_or(Vec4::ONE);
            let opacity = match transparent.attribute("opaque").unwrap_or("A_ONE") {
                "RGB_ZERO" => 1.0 - factor * clear.truncate().dot(LUMINANCE),
                "A_ZERO" => 1.0 - factor * clear.w,
                "RGB_ONE" => factor * clear.truncate().dot(LUMINANCE),
                _ => factor * clear.w,
            };
            let mut opacity = if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 };
            if opacity < INVISIBLE {
                // Some exporters confuse transparency and opacity, and an invisible material is not intended.
                let what = "materials that their transparency would make invisible";
                warnings.add(context.file, what, "taken for opaque", || format!("`{}`", material.name));
                opacity = 1.0;
            }
            material.diffuse.w = opacity;
            // As in MTL, the rest of the light is scattered back.
            (material.transmission, material.veil) = (1.0 - opacity, opacity);
        }
    }
}

fn color(written: &Element<'_>) -> Option<Vec4> {
    let mut words = written.text().split_ascii_whitespace().map(|word| word.parse::<f32>().ok());
    let [r, g, b] = std::array::from_fn(|_| words.next().flatten());
    let color = Vec4::new(r?, g?, b?, words.next().flatten().unwrap_or(1.0));
    color.is_finite().then_some(color)
}

/// A parameter of a profile.
fn parameter<'a>(sid: &str, profile: &'a Element<'a>, document: &'a Document<'a>) -> Option<&'a Element<'a>> {
    document.children(profile, "newparam").find(|parameter| parameter.attribute("sid") == Some(sid))
}

/// The sampler that a texture names; `None` if it names none, as some programs name an image instead.
fn sampler<'a>(texture: &str, profile: &'a Element<'a>, document: &'a Document<'a>) -> Option<&'a Element<'a>> {
    document.descend(parameter(texture, profile, document)?, &["sampler2D"])
}

/// The path of the image that a texture names. The reference goes through a sampler and, in 1.4, a surface, which are parameters of
/// the profile.
fn image<'a>(
    texture: &'a str,
    sampler: Option<&'a Element<'a>>,
    profile: &'a Element<'a>,
    document: &'a Document<'a>,
) -> Option<String> {
    let id = sampler.map_or(Some(texture), |sampler| {
        if let Some(instance) = document.descend(sampler, &["instance_image"]) {
            return instance.attribute("url");
        }
        let surface = parameter(document.descend(sampler, &["source"])?.text(), profile, document)?;
        // The result borrows from the document, not from this closure.
        document.descend(surface, &["surface", "init_from"]).map(|init| init.text())
    });
    let image = document.get(document.find(id?)?);
    let init = document.descend(image, &["init_from"])?;
    let written = document.descend(init, &["ref"]).unwrap_or(init).text();
    let path = plain(written);
    let path = path.strip_prefix("file://").unwrap_or(&path);
    Some(percent_decoded(path))
}

/// A URI's path with its percent escapes decoded. Malformed escapes stay; the whole path stays if it does not decode to UTF-8.
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let digits = tail.get(..2).filter(|digits| *first == b'%' && digits.iter().all(u8::is_ascii_hexdigit));
        let code = digits.and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8(bytes).unwrap_or_else(|_| uri.to_owned())
}
