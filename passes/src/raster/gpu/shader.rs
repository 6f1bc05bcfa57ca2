//! The G-buffer shader's variants, and the uniforms that it reads.

use super::plane_depth::LinesOfSight;
use super::targets::Stored;
use curitiba_pipeline::backend::{Attachments, Light, Rect, Shade, Sun, View};
use glam::{Mat4, Vec4};
use std::mem::offset_of;

/// The WGSL source that all variants are cut from.
const TEXT: &str =
    concat!(include_str!("gbuffer.wgsl"), "\n", include_str!("lights.wgsl"), "\n", include_str!("camera_planes.wgsl"));

/// The features of a variant of the shader. A variant has no code, vertex attributes or bindings for features that are off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Variant {
    /// Writes the colour.
    pub color: bool,
    /// Writes the position.
    pub position: bool,
    /// Writes the normal.
    pub normal: bool,
    /// Writes the triangle id.
    pub triangle: bool,
    /// Reads vertex normals.
    pub vertex_normal: bool,
    /// Reads the texture and its coordinates.
    pub textured: bool,
    /// Discards fragments whose alpha is below the cutoff; implies `textured` or `vertex_color`.
    pub alpha_cut: bool,
    /// Reads the colours of the vertices.
    pub vertex_color: bool,
    /// Adds the light that the material emits; implies `color`.
    pub glow: bool,
    /// Multiplies the emitted light by a texture; implies `glow`.
    pub glow_textured: bool,
    /// Bends the normals by a normal map; implies `vertex_normal`.
    pub bent: bool,
    /// Leaves texture coordinates outside 0..1 to the wrapping of the samplers; otherwise all textures repeat.
    pub wrapped: bool,
    /// Discards fragments behind the mirror of a mirrored camera.
    pub mirrored: bool,
    /// Adds several lights or a positional light; with `vertex_normal` it also computes the position in the world.
    pub many: bool,
    /// Writes 0 to all attachments but the colour, for a sky.
    pub sky: bool,
    /// Writes the depth of the triangle's plane in place of the device's.
    pub plane_depth: bool,
    /// Culls back faces. The shader's source does not depend on this.
    pub culled: bool,
    /// Lets the device discard hidden fragments early, by a depth that is never behind the plane's; implies `plane_depth`.
    pub early: bool,
    /// Is a compute program that shades each pixel once.
    pub per_pixel: bool,
}

impl Variant {
    /// The variant for a draw. A scene with textured materials must have texture coordinates.
    pub fn new(attachments: Attachments, has_normals: bool, shade: &Shade) -> Self {
        let Attachments { color, position, normal, triangle } = attachments;
        let texture = shade.texture.is_some();
        let alpha_cut = shade.is_cut();
        let vertex_normal = has_normals && (color || position || normal);
        Self {
            color,
            position,
            normal,
            triangle,
            vertex_normal,
            textured: texture && (color || alpha_cut),
            alpha_cut,
            vertex_color: shade.vertex_colors && (color || alpha_cut),
            glow: color && shade.glow.is_some(),
            glow_textured: color && shade.glow.is_some_and(|glow| glow.texture.is_some()),
            bent: vertex_normal && shade.normal_map.is_some(),
            wrapped: false,
            mirrored: false,
            many: false,
            sky: false,
            plane_depth: false,
            culled: false,
            early: false,
            per_pixel: false,
        }
    }

    /// The variant that shades pixels from a visibility buffer, which another variant has drawn.
    pub fn per_pixel(self) -> Self {
        Self {
            textured: self.textured && self.color,
            vertex_color: self.vertex_color && self.color,
            alpha_cut: false,
            mirrored: false,
            plane_depth: false,
            early: false,
            culled: false,
            per_pixel: true,
            ..self
        }
    }

    /// Whether the variant computes the light of several lights or of a positional light.
    fn lights(self) -> bool {
        self.many && self.vertex_normal && (self.color || self.position)
    }

    /// Whether the variant reads texture coordinates.
    pub fn texcoord(self) -> bool {
        self.textured || self.glow_textured || self.bent
    }

    /// Whether the shader reads anything of the material; if not, draws of different materials can be joined.
    pub fn reads_material(self) -> bool {
        self.color || self.alpha_cut || self.bent
    }

    /// Whether a fragment writes anything but its depth.
    pub fn writes(self) -> bool {
        self.color || self.position || self.normal || self.triangle
    }

    /// Whether fragments have anything to compute.
    pub fn has_fragment_stage(self) -> bool {
        self.writes() || self.alpha_cut || self.mirrored || self.plane_depth
    }

    fn defines(self, name: &str) -> Option<bool> {
        Some(match name {
            "WRITES" => self.writes(),
            "COLOR" => self.color,
            "POSITION" => self.position,
            "NORMAL" => self.normal,
            "TRIANGLE" => self.triangle,
            "VERTEX_NORMAL" => self.vertex_normal,
            "TEXTURED" => self.textured,
            "ALPHA_CUT" => self.alpha_cut,
            "VERTEX_COLOR" => self.vertex_color,
            "TEXCOORD" => self.texcoord(),
            "BENT" => self.bent,
            "WORLD" => self.position || self.bent || self.lights(),
            "LIGHTS" => self.lights(),
            "GLOW" => self.glow,
            "WRAPPED" => self.wrapped,
            "MIRRORED" => self.mirrored,
            "SKY" => self.sky,
            "PLANE_DEPTH" => self.plane_depth,
            "PRIMITIVE" => (self.triangle || self.plane_depth) && !self.per_pixel,
            "LEAVES" => self.writes() || self.plane_depth,
            "GLOW_TEXTURED" => self.glow_textured,
            "PER_PIXEL" => self.per_pixel,
            "EARLY" => self.early,
            _ => return None,
        })
    }

    /// The variant's WGSL. A [per-pixel](Self::per_pixel) variant has placeholders for the formats of its attachments.
    ///
    /// # Panics
    /// If a directive of the source is malformed, or its name unknown. A test generates the source of every variant.
    pub fn source(self) -> String {
        cut("gbuffer.wgsl", TEXT, |name| self.defines(name))
    }

    /// The WGSL of a [per-pixel](Self::per_pixel) variant, for attachments of these formats.
    pub fn shading_source(self, stored: Stored) -> String {
        let mut source = self.source();
        for (name, format) in ["COLOR_FORMAT", "POSITION_FORMAT", "NORMAL_FORMAT"].into_iter().zip(stored.formats()) {
            let is_half = format == Some(wgpu::TextureFormat::Rgba16Float);
            source = source.replace(name, if is_half { "rgba16float" } else { "rgba32float" });
        }
        source
    }
}

/// Cuts a variant from a shader's source, `text`. Lines after `//#if NAME` are kept if `defines` returns true for the name, and
/// lines after an optional `//#else` if it returns false, up to `//#endif`. Each directive is a line of its own.
///
/// # Panics
/// If the directives are malformed, or `defines` does not know a name.
pub(super) fn cut(file: &str, text: &str, defines: impl Fn(&str) -> Option<bool>) -> String {
    let mut source = String::with_capacity(text.len());
    // One entry for each open `//#if`: whether its lines are kept.
    let mut open: Vec<bool> = Vec::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("//#if ") {
            open.push(defines(name).unwrap_or_else(|| panic!("{file}: unknown name {name}")));
        } else if line == "//#else" {
            let last = open.last_mut().unwrap_or_else(|| panic!("{file}: #else without #if"));
            *last = !*last;
        } else if line == "//#endif" {
            assert!(open.pop().is_some(), "{file}: #endif without #if");
        } else {
            assert!(!line.starts_with("//#"), "{file}: unknown directive {line}");
            if open.iter().all(|kept| *kept) {
                source.push_str(line);
            }
            // A cut line stays as an empty line, so that line numbers in compiler messages are those of the file.
        }
        source.push('\n');
    }
    assert!(open.is_empty(), "{file}: #if without #endif");
    source
}

/// `Frame` of the shader.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct FrameUniform {
    clip_from_eye: Mat4,
    eye: Vec4,
    to_light: Vec4,
    light_color: Vec4,
    clip_plane: Vec4,
    lines: LinesOfSight,
    part: [u32; 4],
    background: Vec4,
}

impl FrameUniform {
    /// `size` is the picture's width and height in pixels. `part` is the part of the picture that is shaded, and `background`
    /// the colour of pixels in the part that show nothing.
    pub fn new(view: &View, size: [u32; 2], sun: Option<Sun>, (part, background): (Rect, Vec4)) -> Self {
        let (to_light, light_color) =
            sun.map_or((Vec4::ZERO, Vec4::ZERO), |sun| ((-sun.direction).extend(0.0), sun.color.extend(1.0)));
        let (clip_from_eye, eye) = view.projection();
        let clip_plane = view.clip_plane.unwrap_or(Vec4::W);
        let lines = LinesOfSight::new(view, size);
        let part = [part.x, part.y, part.width, part.height];
        Self {
            clip_from_eye,
            eye: eye.extend(view.footprint),
            to_light,
            light_color,
            clip_plane,
            lines,
            part,
            background,
        }
    }
}

/// Greatest number of lights of the shader.
const MOST_LIGHTS: usize = 256;

/// Bytes of `Lights` of the shader.
pub(super) const LIGHTS_BYTES: usize = size_of::<[u32; 4]>() + MOST_LIGHTS * size_of::<LightUniform>();

/// `Light` of the shader.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct LightUniform {
    place: Vec4,
    direction: Vec4,
    color: Vec4,
    attenuation: Vec4,
    cone: Vec4,
}

impl LightUniform {
    fn new(light: &Light) -> Self {
        let [constant, linear, quadratic] = light.attenuation;
        let exponent = light.cone.map_or(0.0, |cone| cone.exponent);
        Self {
            place: light.place.map_or(Vec4::ZERO, |place| place.extend(1.0)),
            direction: light.direction.extend(1.0 / light.range),
            color: light.color.extend(exponent),
            attenuation: Vec4::new(constant, linear, quadratic, f32::from(u8::from(light.cone.is_some()))),
            cone: light.cone.map_or(Vec4::ZERO, |cone| Vec4::new(cone.inner, cone.outer, 0.0, 0.0)),
        }
    }
}

/// Bytes of `Lights` of the shader, without the unused lights at the end. `None` if there are more than `MOST_LIGHTS` lights.
pub(super) fn lights_uniform(lights: &[Light]) -> Option<Vec<u8>> {
    if lights.len() > MOST_LIGHTS {
        return None;
    }
    let mut bytes = bytemuck::bytes_of(&[lights.len() as u32, 0, 0, 0]).to_vec();
    lights.iter().for_each(|light| bytes.extend_from_slice(bytemuck::bytes_of(&LightUniform::new(light))));
    Some(bytes)
}

/// `Draw` of the shader.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct DrawUniform {
    diffuse: Vec4,
    emission: Vec4,
    glow: Vec4,
    first_triangle: u32,
    alpha_cutoff: f32,
    normal_scale: f32,
    first_of_chunk: u32,
    count: u32,
    clears: u32,
    corner: [u32; 2],
}

impl DrawUniform {
    /// `first_triangle` is an id; the shader gets it plus 1. `first_of_chunk` counts from the chunk's first triangle.
    pub fn new(shade: &Shade, first_triangle: u32, first_of_chunk: u32, count: u32) -> Self {
        Self {
            diffuse: shade.diffuse,
            emission: shade.emission,
            glow: shade.glow.map_or(Vec4::ZERO, |glow| glow.color.extend(0.0)),
            first_triangle: first_triangle.wrapping_add(1),
            // Shaders need not support infinities, so an infinite cutoff becomes the greatest finite number.
            alpha_cutoff: shade.alpha_cutoff.unwrap_or(0.0).min(f32::MAX),
            normal_scale: shade.normal_map.map_or(0.0, |map| map.scale),
            first_of_chunk,
            count,
            clears: 0,
            corner: [0; 2],
        }
    }

    /// Sets the corner of the pixels that a shading program shades, relative to the part's corner, in the first uniform in
    /// `bytes`.
    pub fn set_corner(bytes: &mut [u8], corner: [u32; 2]) {
        bytes[offset_of!(Self, corner)..][..8].copy_from_slice(bytemuck::bytes_of(&corner));
    }

    /// Marks the first uniform in `bytes` as that of the draw that also writes pixels without a triangle.
    pub fn set_clears(bytes: &mut [u8]) {
        bytes[offset_of!(Self, clears)..][..4].copy_from_slice(bytemuck::bytes_of(&1_u32));
    }

    /// Sets the number of triangles in the first uniform in `bytes`.
    pub fn set_count(bytes: &mut [u8], count: u32) {
        bytes[offset_of!(Self, count)..][..4].copy_from_slice(bytemuck::bytes_of(&count));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::size_of;
    use wgpu::naga;

    /// Every combination that [`Variant::new`] can give, with and without `wrapped` and `mirrored`, and some that it cannot give.
    fn variants() -> impl Iterator<Item = Variant> {
        (0_u32..8192)
            .map(|bits| {
                let bit = |index: u32| bits >> index & 1 == 1;
                Variant {
                    color: bit(0),
                    position: bit(1),
                    normal: bit(2),
                    triangle: bit(3),
                    vertex_normal: bit(4),
                    textured: bit(5),
                    alpha_cut: bit(6),
                    glow: bit(7),
                    glow_textured: bit(8),
                    wrapped: bit(9),
                    vertex_color: bit(10),
                    bent: bit(11),
                    mirrored: bit(12),
                    many: false,
                    sky: false,
                    plane_depth: false,
                    culled: false,
                    early: false,
                    per_pixel: false,
                }
            })
            .filter(|v| (v.textured || v.vertex_color || !v.alpha_cut) && (v.color || v.alpha_cut || !v.vertex_color))
            .filter(|v| (v.color || !v.glow) && (v.glow || !v.glow_textured))
            .filter(|v| v.texcoord() || !v.wrapped)
            // Mirrored cameras draw colours only.
            .filter(|v| v.color || !v.mirrored)
            .filter(|v| !v.bent || (v.vertex_normal && (v.color || v.position || v.normal)))
            // Variants that write only depth have nothing to shade.
            .filter(|v| v.writes() || (!v.vertex_normal && v.alpha_cut == (v.textured || v.vertex_color)))
    }

    fn validate(source: &str, capabilities: naga::valid::Capabilities) -> Result<naga::Module, String> {
        let module = naga::front::wgsl::parse_str(source).map_err(|error| error.emit_to_string(source))?;
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
            .validate(&module)
            .map_err(|error| error.emit_to_string(source))?;
        Ok(module)
    }

    #[test]
    fn every_variant_parses_and_validates_and_needs_the_primitive_index_only_for_triangles() {
        let mut count = 0;
        for variant in variants() {
            let capabilities = if variant.triangle {
                naga::valid::Capabilities::PRIMITIVE_INDEX
            } else {
                naga::valid::Capabilities::empty()
            };
            let source = variant.source();
            let module = validate(&source, capabilities).unwrap_or_else(|error| panic!("{variant:?}\n{error}"));
            let names: Vec<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
            assert_eq!(names, ["vertex_main", "fragment_main"], "{variant:?}");
            assert_eq!(source.contains("textureSampleLevel"), variant.texcoord(), "{variant:?}");
            assert_eq!(source.contains("discard;"), variant.alpha_cut || variant.mirrored, "{variant:?}");
            count += 1;
        }
        // There are 8 sets of attachments with a colour and 7 others, each with and without normals. Variants with a texture count twice:
        // `wrapped` or not. With a colour, `alpha_cut` and `vertex_color` have 3 combinations without a texture, and 4 with one. Without a
        // colour, vertex colours only cut: 2 and 3 combinations. With a colour, each is without glow, with plain glow or with textured glow.
        // Variants of depth alone are whole, cut by a texture, by vertices or by both. Bent variants have vertex normals, and a normal map as
        // texture: 8 sets with a colour and 6 others.
        // Every variant with a colour counts twice: with and without a mirrored camera.
        let (colored, others) = (2 * 8 * 2, 7 * 2);
        let (plain, glowing) = (3 + 4 * 2, (3 + 4) * 2);
        let bent = 2 * 8 * 3 * (3 + 4) * 2 + 6 * (2 + 3) * 2;
        assert_eq!(count, colored * (2 * plain + glowing) + others * (2 + 3 * 2) + 1 + 2 + 1 + 2 + bent);
    }

    #[test]
    fn variants_of_several_lights_parse_and_validate() {
        let mut count = 0;
        for variant in variants().filter(|v| !v.wrapped && !v.mirrored && !v.alpha_cut && !v.triangle) {
            let variant = Variant { many: true, ..variant };
            let source = variant.source();
            validate(&source, naga::valid::Capabilities::empty())
                .unwrap_or_else(|error| panic!("{variant:?}\n{error}"));
            assert_eq!(source.contains("sum_of_lights(in.world"), variant.lights(), "{variant:?}");
            count += u32::from(variant.lights());
        }
        assert!(count > 20, "{count}");
    }

    #[test]
    fn every_variant_may_write_the_depth_of_planes_and_then_needs_the_primitive_index() {
        let mut without_attachments = 0;
        for variant in variants() {
            let variant = Variant { plane_depth: true, ..variant };
            let source = variant.source();
            let module = validate(&source, naga::valid::Capabilities::PRIMITIVE_INDEX)
                .unwrap_or_else(|error| panic!("{variant:?}\n{error}"));
            let writes_depth = |ty: &naga::Type| match &ty.inner {
                naga::TypeInner::Struct { members, .. } => members
                    .iter()
                    .any(|member| matches!(member.binding, Some(naga::Binding::BuiltIn(naga::BuiltIn::FragDepth)))),
                _ => false,
            };
            assert!(module.types.iter().any(|(_, ty)| writes_depth(ty)), "{variant:?}");
            assert!(variant.has_fragment_stage() && source.contains("plane_depth(primitive, in.clip)"), "{variant:?}");
            assert!(!Variant { plane_depth: false, ..variant }.source().contains("frag_depth"), "{variant:?}");
            let early = Variant { early: true, ..variant }.source();
            let capabilities = naga::valid::Capabilities::PRIMITIVE_INDEX | naga::valid::Capabilities::EARLY_DEPTH_TEST;
            validate(&early, capabilities).unwrap_or_else(|error| panic!("{variant:?}\n{error}"));
            assert!(
                early.contains("@early_depth_test(less_equal)") && !source.contains("early_depth_test"),
                "{variant:?}"
            );
            without_attachments += u32::from(!variant.writes());
        }
        assert_eq!(without_attachments, 6, "whole, and cut in five ways");
    }

    #[test]
    fn every_variant_may_shade_pixels_and_then_neither_cuts_nor_compares_neighbours() {
        let mut kinds = std::collections::HashSet::new();
        let variants = variants().filter(|v| v.color || v.position || v.normal);
        for variant in variants.flat_map(|variant| [false, true].map(|many| Variant { many, ..variant })) {
            let shading = Variant { plane_depth: true, early: true, culled: true, ..variant }.per_pixel();
            let half = Attachments { position: true, ..Attachments::default() };
            let Variant { color, position, normal, triangle, .. } = shading;
            let stored = Stored::new(Attachments { color, position, normal, triangle }, half);
            let source = shading.shading_source(stored);
            let module = validate(&source, naga::valid::Capabilities::empty())
                .unwrap_or_else(|error| panic!("{variant:?}\n{error}"));
            let names: Vec<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
            assert_eq!(names, ["pixel_main"], "{variant:?}");
            for word in ["discard;", "dpdx", "frag_depth", "_FORMAT"] {
                assert!(!source.contains(word), "{word} {variant:?}");
            }
            assert_eq!(source.contains("texture_storage_2d<rgba16float"), position, "{variant:?}");
            let written = source.matches("textureStore(").count();
            assert_eq!(
                written,
                [color, position, normal, triangle].map(usize::from).iter().sum::<usize>(),
                "{variant:?}"
            );
            assert_eq!(shading.reads_material(), color || shading.bent, "{variant:?}");
            kinds.insert(shading);
        }
        assert!(kinds.len() > 100, "{}", kinds.len());
    }

    #[test]
    fn planes_are_computed_and_read_as_the_same_record_for_the_same_camera() {
        let drawn = Variant { plane_depth: true, ..variants().find(|v| v.color).expect("one") };
        let drawn = validate(&drawn.source(), naga::valid::Capabilities::all()).expect("valid");
        let planes = validate(crate::raster::gpu::planes::TEXT, naga::valid::Capabilities::empty()).expect("valid");
        for name in ["Plane", "Frame"] {
            assert_eq!(layout(&drawn, name), layout(&planes, name));
        }
        assert_eq!(layout(&planes, "Plane").1, crate::raster::gpu::geometry::PLANE_BYTES as usize);
    }

    #[test]
    fn of_a_sky_nothing_is_written_but_the_colour() {
        let mut count = 0;
        for variant in variants().filter(|v| !v.wrapped && !v.mirrored && v.writes()) {
            let [plain, sky] = [false, true].map(|sky| Variant { sky, ..variant }.source());
            validate(&sky, naga::valid::Capabilities::all()).unwrap_or_else(|error| panic!("{variant:?}\n{error}"));
            for (written, surface, nothing) in [
                (variant.position, "out.position = vec4<f32>(in.world, cosine);", "out.position = vec4<f32>(0.0);"),
                (variant.normal, "out.normal = vec4<f32>(normal, 0.0);", "out.normal = vec4<f32>(0.0);"),
                (variant.triangle, "out.triangle = draw.first_triangle + primitive;", "out.triangle = 0u;"),
            ] {
                assert_eq!([plain.contains(surface), sky.contains(nothing)], [written; 2], "{variant:?}");
                assert!(!plain.contains(nothing) && !sky.contains(surface), "{variant:?}");
            }
            count += 1;
        }
        assert!(count > 100, "{count}");
    }

    #[test]
    fn lights_lie_as_the_shader_reads_them() {
        let variant = variants().find(|v| v.color && v.vertex_normal).expect("one");
        let source = Variant { many: true, ..variant }.source();
        let module = validate(&source, naga::valid::Capabilities::all()).expect("valid");
        let (light, size) = layout(&module, "Light");
        let found: Vec<(&str, usize)> = light.iter().map(|(name, offset)| (name.as_str(), *offset)).collect();
        let expected = [
            ("place", offset_of!(LightUniform, place)),
            ("direction", offset_of!(LightUniform, direction)),
            ("color", offset_of!(LightUniform, color)),
            ("attenuation", offset_of!(LightUniform, attenuation)),
            ("cone", offset_of!(LightUniform, cone)),
        ];
        assert_eq!((&found[..], size), (&expected[..], size_of::<LightUniform>()));
        assert_eq!(layout(&module, "Lights").1, LIGHTS_BYTES);
        let light = Light {
            place: None,
            direction: glam::Vec3::Y,
            color: glam::Vec3::ONE,
            attenuation: [1.0, 0.0, 0.0],
            range: f32::INFINITY,
            cone: None,
        };
        let bytes = lights_uniform(&[light; 2]).expect("there is room");
        assert_eq!((bytes.len(), bytes[0]), (size_of::<[u32; 4]>() + 2 * size_of::<LightUniform>(), 2));
        assert!(
            lights_uniform(&vec![light; MOST_LIGHTS]).is_some()
                && lights_uniform(&vec![light; MOST_LIGHTS + 1]).is_none()
        );
    }

    #[test]
    fn depth_alone_has_a_fragment_stage_only_where_something_is_cut() {
        let shade = Shade { diffuse: Vec4::ONE, emission: Vec4::ZERO, texture: Some(0), ..Shade::default() };
        let whole = Variant::new(Attachments::default(), true, &shade);
        assert!(!whole.has_fragment_stage() && !whole.textured && !whole.vertex_normal && !whole.reads_material());
        let cut = Variant::new(Attachments::default(), true, &Shade { alpha_cutoff: Some(0.5), ..shade });
        assert!(cut.has_fragment_stage() && cut.alpha_cut && !cut.writes() && cut.reads_material());
    }

    #[test]
    fn an_invalid_shader_is_found_out() {
        let variant = variants().find(|variant| variant.triangle).expect("one");
        let source = variant.source();
        assert!(validate(&source, naga::valid::Capabilities::empty()).is_err(), "the capability is needed");
        let broken = source.replace("out.triangle = draw.first_triangle", "out.triangle = draw.alpha_cutoff");
        assert_ne!(broken, source);
        assert!(validate(&broken, naga::valid::Capabilities::PRIMITIVE_INDEX).is_err(), "f32 + u32");
    }

    /// Offsets of the members of a struct of the shader, and its size.
    fn layout(module: &naga::Module, name: &str) -> (Vec<(String, usize)>, usize) {
        let (_, ty) =
            module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect("the shader has the struct");
        let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
        let offsets = members.iter().map(|m| (m.name.clone().expect("named"), m.offset as usize)).collect();
        (offsets, *span as usize)
    }

    #[test]
    fn uniforms_lie_as_the_shader_reads_them() {
        let variant = variants().find(|v| v.color && v.alpha_cut).expect("one");
        let module = validate(&variant.source(), naga::valid::Capabilities::all()).expect("valid");
        let named = |list: &[(&str, usize)]| list.iter().map(|(n, o)| ((*n).to_owned(), *o)).collect::<Vec<_>>();
        let of_line = |offset: usize| offset_of!(FrameUniform, lines) + offset;
        let frame = named(&[
            ("clip_from_eye", offset_of!(FrameUniform, clip_from_eye)),
            ("eye", offset_of!(FrameUniform, eye)),
            ("to_light", offset_of!(FrameUniform, to_light)),
            ("light_color", offset_of!(FrameUniform, light_color)),
            ("clip_plane", offset_of!(FrameUniform, clip_plane)),
            ("origin", of_line(offset_of!(LinesOfSight, origin))),
            ("corner", of_line(offset_of!(LinesOfSight, corner))),
            ("right", of_line(offset_of!(LinesOfSight, right))),
            ("down", of_line(offset_of!(LinesOfSight, down))),
            ("towards", of_line(offset_of!(LinesOfSight, towards))),
            ("part", offset_of!(FrameUniform, part)),
            ("background", offset_of!(FrameUniform, background)),
        ]);
        assert_eq!(layout(&module, "Frame"), (frame, size_of::<FrameUniform>()));
        let draw = named(&[
            ("diffuse", offset_of!(DrawUniform, diffuse)),
            ("emission", offset_of!(DrawUniform, emission)),
            ("glow", offset_of!(DrawUniform, glow)),
            ("first_triangle", offset_of!(DrawUniform, first_triangle)),
            ("alpha_cutoff", offset_of!(DrawUniform, alpha_cutoff)),
            ("normal_scale", offset_of!(DrawUniform, normal_scale)),
            ("first_of_chunk", offset_of!(DrawUniform, first_of_chunk)),
            ("count", offset_of!(DrawUniform, count)),
            ("clears", offset_of!(DrawUniform, clears)),
            ("corner", offset_of!(DrawUniform, corner)),
        ]);
        assert_eq!(layout(&module, "Draw"), (draw, size_of::<DrawUniform>()));
    }

    #[test]
    fn a_variant_reads_only_what_its_attachments_need() {
        let shade = Shade { diffuse: Vec4::ONE, emission: Vec4::ZERO, texture: Some(0), ..Shade::default() };
        let only_triangle = Attachments { triangle: true, ..Attachments::default() };
        let variant = Variant::new(only_triangle, true, &shade);
        assert!(!variant.vertex_normal && !variant.textured && !variant.reads_material());
        let cut = Variant::new(only_triangle, true, &Shade { alpha_cutoff: Some(0.5), ..shade });
        assert!(cut.textured && cut.alpha_cut && cut.reads_material(), "holes are in every attachment");
        let only_color = Attachments { color: true, ..Attachments::default() };
        let color = Variant::new(only_color, true, &shade);
        assert!(color.vertex_normal && color.textured && !color.alpha_cut);
        let plain = Variant::new(only_color, false, &Shade { texture: None, alpha_cutoff: Some(0.5), ..shade });
        assert!(!plain.vertex_normal && !plain.textured && !plain.alpha_cut);
    }
}
