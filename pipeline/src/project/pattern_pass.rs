//! Ray passes that trace no rays: the ray-generation program alone writes their picture, as in the first tutorials of the
//! engine's descendant. A built-in shader draws that picture in a quad. Device code is not run: the inputs that a pass hands
//! over decide which shader is used, and a warning says so.

use super::QuadPass;
use super::dom::{Element, Value};
use super::libraries::{Binding, Injected, LibraryMaterial, ValueOf};
use super::loader::Loader;
use super::passes::PassContext;
use super::report::{Span, shown};
use super::shaders::{BuiltIn, ShaderUse, UsedBy};
use super::{MaterialPattern, QuadSource, handed};
use crate::glsl;
use crate::scene::texture::Magnification;
use std::rc::Rc;

/// The corners of the quad, with texture coordinates from the lower left corner of the target.
const CORNERS: &str = "#version 330
in vec4 position;
in vec2 texCoord0;
out vec2 place;
void main() {
    place = texCoord0;
    gl_Position = position;
}
";

/// Green is a cosine over the columns, from 0 to 1, with a period of 10 pi pixels. Blue is 1 minus green.
const STRIPES: BuiltIn = BuiltIn {
    name: "stripes",
    vertex: CORNERS,
    fragment: "#version 330
out vec4 color;
void main() {
    float green = 0.5 + 0.5 * cos(0.2 * floor(gl_FragCoord.x));
    color = vec4(0.0, green, 1.0 - green, 1.0);
}
",
};

/// A texture over the whole target.
const TEXTURE: BuiltIn = BuiltIn {
    name: "texture",
    vertex: CORNERS,
    fragment: "#version 330
in vec2 place;
uniform sampler2D image;
out vec4 color;
void main() {
    color = vec4(texture(image, place).rgb, 1.0);
}
",
};

/// The only texture, as `Library::name`, that a pass hands to its program; inner `None` if it hands over nothing. Vertices, and
/// renderer values in addition to a texture, are ignored. Outer `None` for any other inputs, from which a program could compute
/// anything.
fn handed_texture(pass: &Element) -> Option<Option<&Value>> {
    let (mut textures, mut others) = (Vec::new(), 0);
    for item in pass.children_named(handed::GLOBAL).flat_map(|list| &list.children) {
        match item.attribute("type").map_or("", |kind| &kind.text) {
            kind if kind.eq_ignore_ascii_case("TEXTURE") => textures.push(item.attribute("context")?),
            kind if kind.eq_ignore_ascii_case("RENDERER") => others += 1,
            _ => return None,
        }
    }
    match textures[..] {
        [] if others == 0 => Some(None),
        [texture] => Some(Some(texture)),
        _ => None,
    }
}

impl Loader {
    /// Whether a ray pass traces no rays: neither the pass nor its pipeline names a camera, and the pass has no attribute `program`.
    pub(super) fn is_pattern(context: &PassContext<'_>) -> bool {
        let element = context.element;
        let names_camera =
            element.children_named(&["camera"]).next().is_some() || element.attribute("program").is_some();
        !names_camera && context.default_camera == Some(None)
    }

    /// Reads a pass of which [`Self::is_pattern`] is true. `generator` is the file of its ray-generation program.
    pub(super) fn pattern_pass(&mut self, context: &mut PassContext<'_>, generator: &Value) -> Option<QuadPass> {
        let pass = shown(&context.name);
        let refused = format!(
            "pass `{pass}` has no camera: `{}` makes its picture by itself, and device code is not run",
            generator.shown()
        );
        let Some(texture) = handed_texture(context.element) else {
            self.report.error_help(generator.span, refused, || {
                "valid: a <camera>, where rays that start there mean the same; program=\"…\" says which; or a pass that is handed nothing \
                 (stripes), or one texture (which is shown)"
                    .to_owned()
            });
            return None;
        };
        if !glsl::AVAILABLE {
            let help =
                "stripes and textures take its place in builds with the feature `glsl`: cargo build --features glsl";
            self.report.error_help(generator.span, refused, || help.to_owned());
            return None;
        }
        let (built_in, what) = match texture {
            None => (&STRIPES, "stripes, since it is handed nothing".to_owned()),
            Some(name) => (&TEXTURE, format!("the texture `{}`, which it is handed", name.shown())),
        };
        let message = format!("pass `{pass}` has no camera, and traces no rays: it shows {what}");
        let help = "device code is not run; program=\"…\" and a <camera> say what else it means".to_owned();
        self.report.warning(generator.span, message, || Some(help));
        let at = texture.map_or(generator.span, |name| name.span);
        let mut material = LibraryMaterial::plain(built_in.name);
        if let Some(name) = texture {
            let (name, magnification) = (name.clone(), Magnification::Linear);
            material.textures.push(Binding { unit: 0, library: None, name, compare: None, magnification });
            material.values.push(unit_of("image", at));
        }
        let (material, to, injected) = (Rc::new(material), MaterialPattern::All, Injected::NONE);
        let by = UsedBy::Quad(Some(built_in));
        let used = ShaderUse { to: &to, library: 0, material: &material, at, injected: &injected, replaces: true, by };
        let shader = self.own_shader(context, &used, &[]);
        Self::takes_down(context, shader.as_deref(), at);
        Some(QuadPass { source: QuadSource::Own, shader: Some(shader?), writes_color: true })
    }
}

/// The value that gives texture unit 0 to a sampler.
fn unit_of(sampler: &str, span: Span) -> ValueOf {
    let value = |text: &str| Value { text: text.to_owned(), joined: None, span };
    let of = |text: &str| Some(value(text));
    ValueOf {
        uniform: value(sampler),
        block: None,
        kind: of("TEXTURE_BINDING"),
        context: of("CURRENT"),
        component: of("UNIT"),
        id: None,
        span,
    }
}
