//! Joins two stages: assigns locations to the variables between them, to attributes and to results, and adds a `main` that calls the file's.

use super::rewrite::{
    OURS, Origin, Stated, TRUTH, Variable, attribute, beside_name, compare_name, compare_projected_name, counters,
    image, loose_block, sampler_name, texture_name,
};
use super::{Attribute, FRAME, Fault, Held, MAX_OUTPUTS, Sampler, SamplerKind, Stage};
use std::fmt::Write;

/// Greatest number of variables, array elements and matrix columns that pass between the stages. Every device supports this many.
const MAX_VARYINGS: usize = 15;

/// A stage as the compiler reads it.
#[derive(Debug)]
pub(super) struct Text {
    pub source: String,
    /// Where the parts of `source` come from in the file. The part of `source` before the first origin is generated.
    pub origins: Vec<Origin>,
}

/// Two stages that match.
#[derive(Debug)]
pub(super) struct Linked {
    pub vertex: Text,
    pub fragment: Text,
    pub attributes: Vec<Attribute>,
    pub samplers: Vec<Sampler>,
    pub outputs: [bool; MAX_OUTPUTS],
    pub flat: bool,
}

/// The binding of the block that gathers a stage's uniforms outside blocks. `first` is the binding of the stage's first own block.
pub(super) fn loose_binding(stated: &Stated, first: usize) -> usize {
    first + stated.blocks.len()
}

/// The first binding of the next stage, after a stage whose bindings begin at `first`.
pub(super) fn next_binding(stated: &Stated, first: usize) -> usize {
    loose_binding(stated, first) + usize::from(!loose_block(stated, 0).is_empty())
}

/// Joins the stages. `depth` is the location at which the fragment shader also writes the depth of pixels; `None` if it does not.
pub(super) fn link(vertex: &Stated, fragment: &Stated, depth: Option<usize>) -> Result<Linked, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut samplers = vertex.samplers.clone();
    for sampler in &fragment.samplers {
        match samplers.iter().find(|other| other.name == sampler.name) {
            None => samplers.push(sampler.clone()),
            Some(other) if (other.kind == SamplerKind::Cube) != (sampler.kind == SamplerKind::Cube) => {
                let message = format!("`{}` is a sampler of another type in the vertex shader", sampler.name);
                let (stage, [start, end]) = (Stage::Fragment, sampler.at);
                faults.push(Fault {
                    stage,
                    start,
                    end,
                    message,
                    help: Some("valid: the same type in both".to_owned()),
                });
            }
            Some(_) => {}
        }
    }
    let attributes = attributes(vertex, &mut faults);
    let passed = passed(vertex, fragment, &mut faults);
    let results = results(fragment, depth, &mut faults);
    if !faults.is_empty() {
        return Err(faults);
    }
    let mut head = begin(vertex, &samplers, loose_binding(vertex, 0));
    let (mut before, mut after) = (truths(vertex), String::new());
    for attribute in &attributes {
        let (name, location) = (attribute.name(), attribute.location());
        let (kind, ending) = match attribute {
            Attribute::Position => ("vec3", "1.0"),
            Attribute::Normal | Attribute::Tangent => ("vec3", "0.0"),
            Attribute::TexCoord => ("vec2", "0.0, 1.0"),
        };
        let _ = writeln!(head, "layout(location = {location}) in {kind} {OURS}a_{name};");
        let declared = vertex.inputs.iter().filter(|input| input.used && input.key == name).map(|input| &input.kind);
        for declared in declared {
            let whole = format!("vec4({OURS}a_{name}, {ending})");
            let part = match declared.as_str() {
                "float" => ".x",
                "vec2" => ".xy",
                "vec3" => ".xyz",
                _ => "",
            };
            let _ = writeln!(before, "{name} = {whole}{part};");
        }
    }
    for (location, Passed { output, kind, part, flat, .. }) in passed.iter().enumerate() {
        let flat = if *flat { "flat " } else { "" };
        let _ = writeln!(head, "layout(location = {location}) {flat}out {kind} {OURS}v{location};");
        let _ = writeln!(after, "{OURS}v{location} = {}{part};", output.global);
    }
    // OpenGL's depth is -1 at the near plane and 1 at the far plane; ours is 1 and 0.
    after += "gl_Position.z = (gl_Position.w - gl_Position.z) * 0.5;\n";
    let vertex_text = around(vertex, head, &before, &after);

    let mut head = begin(fragment, &samplers, loose_binding(fragment, next_binding(vertex, 0)));
    let (mut before, mut after) = (truths(fragment), String::new());
    for (location, Passed { input, kind, part, flat, .. }) in passed.iter().enumerate() {
        let flat = if *flat { "flat " } else { "" };
        let _ = writeln!(head, "layout(location = {location}) {flat}in {kind} {OURS}v{location};");
        let _ = writeln!(before, "{}{part} = {OURS}v{location};", input.global);
    }
    if fragment.depth || depth.is_some() {
        // OpenGL's depth is 0 at the near plane and 1 at the far plane; ours is 1 and 0.
        let _ = writeln!(head, "float {OURS}FragDepth;");
        let _ = writeln!(before, "{OURS}FragDepth = 1.0 - gl_FragCoord.z;");
    }
    if fragment.depth {
        let _ = writeln!(after, "gl_FragDepth = 1.0 - {OURS}FragDepth;");
    }
    let mut outputs = [false; MAX_OUTPUTS];
    if let Some(location) = depth.filter(|location| *location < MAX_OUTPUTS) {
        outputs[location] = true;
        let _ = writeln!(head, "layout(location = {location}) out vec4 {OURS}o{location};");
        let _ = writeln!(after, "{OURS}o{location} = vec4(vec3(clamp({OURS}FragDepth, 0.0, 1.0)), 1.0);");
    }
    // The file does not declare this result itself, and writes it even if it is dropped.
    for output in fragment.outputs.iter().filter(|output| output.key == "gl_FragColor") {
        let _ = writeln!(head, "vec4 {};", output.global);
    }
    for (location, output) in &results {
        outputs[*location] = true;
        let _ = writeln!(head, "layout(location = {location}) out vec4 {OURS}o{location};");
        let whole = match output.kind.as_str() {
            "float" => format!("vec4({}, 0.0, 0.0, 1.0)", output.global),
            "vec2" => format!("vec4({}, 0.0, 1.0)", output.global),
            "vec3" => format!("vec4({}, 1.0)", output.global),
            _ => output.global.clone(),
        };
        let _ = writeln!(after, "{OURS}o{location} = {whole};");
    }
    if fragment.coordinates {
        let _ = writeln!(head, "vec4 {OURS}FragCoord;");
        let _ = writeln!(
            before,
            "{OURS}FragCoord = vec4(gl_FragCoord.x + {FRAME}.x, {FRAME}.y - gl_FragCoord.y, 1.0 - gl_FragCoord.z, gl_FragCoord.w);"
        );
    }
    if fragment.text.contains("curitiba_dFdy") {
        for kind in ["float", "vec2", "vec3", "vec4"] {
            // The shader counts rows upwards and the device downwards, so the derivative changes its sign.
            let _ = writeln!(head, "{kind} {OURS}dFdy({kind} p) {{ return -dFdy(p); }}");
        }
    }
    let fragment_text = around(fragment, head, &before, &after);
    let flat = passed.iter().any(|passed| passed.flat);
    Ok(Linked { vertex: vertex_text, fragment: fragment_text, attributes, samplers, outputs, flat })
}

/// The generated source before a stage's own source: its samplers, numbered by their places in `samplers` (those of the whole shader); the
/// block of its uniforms outside blocks; its buffers of counters and images; and generated functions. Storage blocks are in the stage's own
/// source.
fn begin(stated: &Stated, samplers: &[Sampler], binding: usize) -> String {
    let mut text = "#version 450\n".to_owned();
    for (index, sampler) in samplers.iter().enumerate() {
        if stated.samplers.iter().any(|own| own.name == sampler.name) {
            let (texture, own) = (texture_name(&sampler.name), sampler_name(&sampler.name));
            let kind = if sampler.kind == SamplerKind::Cube { "textureCube" } else { "texture2D" };
            let _ = writeln!(text, "layout(set = 1, binding = {}) uniform {kind} {texture};", 2 * index);
            let _ = writeln!(text, "layout(set = 1, binding = {}) uniform sampler {own};", 2 * index + 1);
        }
    }
    text += &loose_block(stated, binding);
    for (index, buffer) in stated.storage.iter().enumerate() {
        match buffer.held {
            Held::Block => {}
            Held::Counters => text += &counters(index),
            Held::Image => text += &image(index),
        }
    }
    for own in &stated.samplers {
        match own.kind {
            SamplerKind::Compared => text += &compare(own),
            SamplerKind::Color if stated.text.contains(&beside_name(&own.name)) => text += &beside(own),
            SamplerKind::Color | SamplerKind::Cube => {}
        }
    }
    text
}

/// Statements that set the Boolean uniforms from the numbers that represent them in the uniform block.
fn truths(stated: &Stated) -> String {
    let made = |uniform: &super::rewrite::Uniform| {
        let (kind, name) = (&uniform.kind, &uniform.name);
        let value = match kind.as_str() {
            "bool" => format!("{TRUTH}{name} != 0u"),
            _ => format!("notEqual({TRUTH}{name}, {}(0u))", kind.replace("bvec", "uvec")),
        };
        format!("{name} = {value};\n")
    };
    stated.uniforms.iter().filter(|uniform| uniform.is_truth()).map(made).collect()
}

/// A compute shader, which is joined to no other stage.
pub(super) fn link_compute(stated: &Stated) -> Text {
    let mut head = begin(stated, &stated.samplers, loose_binding(stated, 0));
    let [x, y, z] = stated.group;
    let _ = writeln!(head, "layout(local_size_x = {x}, local_size_y = {y}, local_size_z = {z}) in;");
    around(stated, head, &truths(stated), "")
}

fn around(stated: &Stated, head: String, before: &str, after: &str) -> Text {
    let shift = head.len();
    let source = format!("{head}{}\nvoid main() {{\n{before}curitiba_main();\n{after}}}\n", stated.text);
    let mut origins: Vec<Origin> =
        stated.origins.iter().map(|origin| Origin { at: origin.at + shift, ..*origin }).collect();
    if let Some(last) = stated.origins.last() {
        origins.push(Origin { at: shift + stated.text.len(), start: last.start, end: last.end });
    }
    Text { source, origins }
}

fn attributes(vertex: &Stated, faults: &mut Vec<Fault>) -> Vec<Attribute> {
    let mut found = Vec::new();
    for input in vertex.inputs.iter().filter(|input| input.used) {
        let floats = input.parts.is_none() && (input.kind == "float" || input.kind.starts_with("vec"));
        match attribute(&input.key).filter(|_| floats) {
            Some(attribute) if !found.contains(&attribute) => found.push(attribute),
            Some(_) => {}
            None => {
                let names: Vec<&str> = Attribute::ALL.iter().map(|attribute| attribute.name()).collect();
                let message = format!("there is no vertex attribute `{}` of type `{}`", input.token.text, input.kind);
                let help = format!("valid: {}, of type float to vec4", names.join(", "));
                faults.push(input.token.fault(Stage::Vertex, message, &help));
            }
        }
    }
    found.sort_by_key(|attribute| attribute.location());
    found
}

/// The functions that compare a depth with the depths in a sampler's texture, filtered as in OpenGL: each of the four texels around the
/// point counts as 1 if the compared depth is at most the texel's, otherwise 0, and the four are weighted bilinearly.
fn compare(sampler: &Sampler) -> String {
    let (name, projected) = (compare_name(&sampler.name), compare_projected_name(&sampler.name));
    let whole = format!("sampler2D({}, {})", texture_name(&sampler.name), sampler_name(&sampler.name));
    // Coordinates repeat. Infinite ones and NaN are clamped, since they would address no texel.
    let text = "float @t(vec2 at, float depth) {
vec2 size = vec2(textureSize(@s, 0));
vec2 texel = at - size * floor(at / size);
return depth <= texelFetch(@s, ivec2(clamp(texel, vec2(0.0), size - vec2(1.0))), 0).x ? 1.0 : 0.0; }
float @c(vec3 p) {
vec2 at = p.xy * vec2(textureSize(@s, 0)) - vec2(0.5);
vec2 first = floor(at);
vec2 part = at - first;
float depth = clamp(p.z, 0.0, 1.0);
float low = mix(@t(first, depth), @t(first + vec2(1.0, 0.0), depth), part.x);
float high = mix(@t(first + vec2(0.0, 1.0), depth), @t(first + vec2(1.0, 1.0), depth), part.x);
return mix(low, high, part.y); }
float @c(vec3 p, float unread) { return @c(p); }
vec4 @c_4(vec3 p) { return vec4(vec3(@c(p)), 1.0); }
float @p(vec4 p) { return @c(p.xyz / p.w); }
vec4 @p_4(vec4 p) { return vec4(vec3(@p(p)), 1.0); }
";
    text.replace("@t", &format!("{OURS}f{}", &name[OURS.len()..]))
        .replace("@s", &whole)
        .replace("@c", &name)
        .replace("@p", &projected)
}

/// The function that reads a texel at an offset.
fn beside(sampler: &Sampler) -> String {
    let whole = format!("sampler2D({}, {})", texture_name(&sampler.name), sampler_name(&sampler.name));
    format!(
        "vec4 {}(ivec2 at, int level, ivec2 beside) {{ return texelFetch({whole}, at + beside, level); }}\n",
        beside_name(&sampler.name)
    )
}

/// One location between the stages: a variable, an element of an array, or a column of a matrix.
struct Passed<'a> {
    output: &'a Variable,
    input: &'a Variable,
    kind: String,
    /// Index of the element or column, such as `[1]`; empty for a variable that is neither array nor matrix.
    part: String,
    flat: bool,
}

/// The variables that the fragment stage reads from the vertex stage, one entry a location.
fn passed<'a>(vertex: &'a Stated, fragment: &'a Stated, faults: &mut Vec<Fault>) -> Vec<Passed<'a>> {
    let mut found = Vec::new();
    for input in fragment.inputs.iter().filter(|input| input.used) {
        let same = |output: &&Variable| match (output.location, input.location) {
            (Some(output), Some(input)) => output == input,
            _ => output.key == input.key,
        };
        let name = &input.token.text;
        let Some(output) = vertex.outputs.iter().find(same) else {
            let mut names: Vec<&str> = vertex.outputs.iter().map(|output| output.key.as_str()).collect();
            names.sort_unstable();
            let block = input.key.strip_suffix(&format!(".{name}"));
            let of = block.map_or(String::new(), |block| format!(" in a block `{block}`"));
            let message = format!("`{name}` is read, and the vertex shader writes none of that name{of}");
            let help = format!("it writes: {}", if names.is_empty() { "none".to_owned() } else { names.join(", ") });
            faults.push(input.token.fault(Stage::Fragment, message, &help));
            continue;
        };
        if (&output.kind, output.parts) != (&input.kind, input.parts) {
            let (here, there) = (declared(input), declared(output));
            let message = format!("`{name}` is a {here} here and a {there} in the vertex shader");
            faults.push(input.token.fault(Stage::Fragment, message, "valid: the same type in both"));
            continue;
        }
        let before = found.len();
        let kind = input.kind.strip_prefix("mat").map_or(input.kind.clone(), |side| format!("vec{}", &side[..1]));
        for part in 0..input.parts.unwrap_or(1) {
            let part = input.parts.map_or(String::new(), |_| format!("[{part}]"));
            found.push(Passed { output, input, kind: kind.clone(), part, flat: input.flat || output.flat });
        }
        if before <= MAX_VARYINGS && found.len() > MAX_VARYINGS {
            let message = format!("more than {MAX_VARYINGS} variables pass from the vertex shader");
            faults.push(input.token.fault(Stage::Fragment, message, "elements of arrays and columns count"));
        }
    }
    found
}

/// A variable's type, as in `vec4[2]`.
fn declared(variable: &Variable) -> String {
    let array = variable.parts.filter(|_| !variable.kind.starts_with("mat"));
    format!("{}{}", variable.kind, array.map_or(String::new(), |length| format!("[{length}]")))
}

/// The fragment shader's results with their locations. Results at the depth's location or beyond are dropped, as in OpenGL where a target
/// has no such channel.
fn results<'a>(fragment: &'a Stated, depth: Option<usize>, faults: &mut Vec<Fault>) -> Vec<(usize, &'a Variable)> {
    let mut found: Vec<(usize, &Variable)> = Vec::new();
    let taken: Vec<u32> = fragment.outputs.iter().filter_map(|output| output.location).collect();
    for output in &fragment.outputs {
        let free = || {
            (0..).find(|location| !taken.contains(location) && !found.iter().any(|(l, _)| l == &(*location as usize)))
        };
        let location = output.location.or_else(free).unwrap_or(0) as usize;
        if depth.is_some_and(|depth| location >= depth) {
            continue;
        }
        let fault = if location >= MAX_OUTPUTS {
            Some((
                format!(
                    "`{}` goes to location {location}, and three channels of a target are drawn",
                    output.token.text
                ),
                "valid: locations 0 to 2",
            ))
        } else if found.iter().any(|(other, _)| *other == location) {
            Some((format!("a second result goes to location {location}"), ""))
        } else if output.parts.is_some() {
            Some((format!("the result `{}` is an array or a matrix", output.token.text), "valid: vec4"))
        } else if !(output.kind == "float" || output.kind.starts_with("vec")) {
            Some((
                format!("`{}` is a result of whole numbers, which no target holds", output.token.text),
                "valid: vec4",
            ))
        } else {
            None
        };
        match fault {
            Some((message, help)) => faults.push(output.token.fault(Stage::Fragment, message, help)),
            None => found.push((location, output)),
        }
    }
    found
}
