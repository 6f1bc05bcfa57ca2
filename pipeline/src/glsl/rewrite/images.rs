//! Images that a shader loads and stores, as buffers of texels; and the size of the work groups of compute shaders.

use super::super::tokens::Token;
use super::super::{Fault, Held, StorageBuffer, image_size};
use super::declarations::{Declarator, Qualifiers};
use super::{OURS, Reader, Uniform};

/// Image functions, with the names of the generated functions, to which the buffer's index is appended.
const FUNCTIONS: [(&str, &str); 3] = [("imageLoad", "load"), ("imageStore", "store"), ("imageSize", "extent")];

/// Greatest number of invocations of a work group, in all and in each direction. Every device supports these.
const MAX_GROUP: [u32; 4] = [256, 256, 256, 64];

fn function(what: &str, buffer: usize) -> String {
    format!("{OURS}{what}{buffer}")
}

/// Declares the texel buffer with this index, and its functions. Rows count upwards for the shader. Loads outside the image return 0, and
/// stores there do nothing.
pub(in super::super) fn image(buffer: usize) -> String {
    let [load, store, extent] = FUNCTIONS.map(|(_, what)| function(what, buffer));
    let (texels, inside, place) = (function("i", buffer), function("inside", buffer), function("place", buffer));
    let size = image_size(buffer);
    format!(
        "layout(std430, set = 2, binding = {buffer}) buffer {OURS}I{buffer} {{ vec4 {texels}[]; }};
ivec2 {extent}() {{ return {size}; }}
bool {inside}(ivec2 at) {{ return at.x >= 0 && at.y >= 0 && at.x < {size}.x && at.y < {size}.y; }}
int {place}(ivec2 at) {{ return ({size}.y - 1 - at.y) * {size}.x + at.x; }}
vec4 {load}(ivec2 at) {{ if ({inside}(at)) {{ return {texels}[{place}(at)]; }} return vec4(0.0); }}
void {store}(ivec2 at, vec4 value) {{ if ({inside}(at)) {{ {texels}[{place}(at)] = value; }} }}
"
    )
}

impl Reader<'_> {
    /// `layout(binding = 1, rgba8) uniform image2D name;`.
    pub(super) fn image(&mut self, qualifiers: &Qualifiers, declarator: &Declarator) -> Result<(), Fault> {
        let token = &declarator.token;
        if self.uses(&token.text) < 2 {
            return Ok(());
        }
        self.in_pixels(token)?;
        for name in self.elements(token, &declarator.array)? {
            let buffer = self.done.storage.len();
            self.images.insert(name.clone(), buffer);
            self.done.storage.push(StorageBuffer {
                name,
                point: qualifiers.binding.unwrap_or(0),
                held: Held::Image,
                readonly: false,
                read: false,
                written: false,
                at: [token.start, token.end],
            });
            let (name, kind) = (image_size(buffer), "ivec2".to_owned());
            let size = Uniform { name, kind, array: String::new(), default: None, token: token.clone() };
            self.done.uniforms.push(size);
        }
        Ok(())
    }

    /// Rewrites a call that loads, stores or measures an image, up to its second argument. Returns `false` for any other call.
    pub(super) fn of_image(&mut self, token: &Token) -> Result<bool, Fault> {
        if token.text.starts_with("imageAtomic") {
            return Err(self.fault(token, format!("`{}` is not supported", token.text), "count in an atomic_uint"));
        }
        let Some((_, what)) = FUNCTIONS.iter().find(|(name, _)| token.is_word(name)) else { return Ok(false) };
        self.expect("(")?;
        let Some(first) = self.peek(0) else { return Ok(false) };
        let known = self.element().and_then(|(name, length)| Some((self.images.get(&name).copied()?, length)));
        let Some((buffer, length)) = known else {
            let help = "valid: a `uniform image2D` of this file, by its name, in arrays with a number";
            return Err(self.fault(first, format!("`{}` is not an image that is declared above", first.text), help));
        };
        self.at += length;
        if *what != "extent" {
            self.expect(",")?;
        }
        self.put(&format!("{} (", function(what, buffer)), token);
        Ok(true)
    }

    /// Reads `local_size_x = 8` of a layout.
    pub(super) fn group_side(&mut self, axis: usize, token: &Token) -> Result<(), Fault> {
        self.expect("=")?;
        let value = self.next()?;
        let most = MAX_GROUP[axis + 1];
        let Some(side) = value.text.parse::<u32>().ok().filter(|side| (1..=most).contains(side)) else {
            let message = format!("`{}` is no {}", value.text, token.text);
            return Err(self.fault(value, message, &format!("valid: a number from 1 to {most}")));
        };
        self.done.group[axis] = side;
        self.sized = true;
        Ok(())
    }

    /// Reports a work group without a size, or with too many invocations.
    pub(super) fn check_group(&mut self) {
        let [x, y, z] = self.done.group;
        let (count, most) = (x * y * z, MAX_GROUP[0]);
        let (message, help) = match self.sized {
            false => (
                "the size of work groups is not declared".to_owned(),
                "layout(local_size_x = 8, local_size_y = 8) in;".to_owned(),
            ),
            true if count > most => {
                let message = format!("a work group has {x} x {y} x {z} invocations");
                (message, format!("valid: {most} at most, which every device has"))
            }
            true => return,
        };
        if let Some(first) = self.tokens.first() {
            self.faults.push(self.fault(first, message, &help));
        }
    }
}
