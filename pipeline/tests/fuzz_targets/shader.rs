//! Own shaders of projects: the body of the fuzz target `shader`.

use super::fuzz_targets::SEPARATOR;
use super::fuzz_targets::check::Outcome;
use curitiba_pipeline::glsl::{Block, FRAME, MAX_OUTPUTS, Program, Source, Stage, is_image_size};

/// Compiles a vertex shader and, after a [`SEPARATOR`], a fragment shader. In builds with debug assertions the compiler itself
/// asserts that its output is valid WGSL for the device's library.
pub fn shader(input: &[u8]) -> Outcome {
    // Files that are not UTF-8 are refused before they are compiled.
    let Ok(text) = std::str::from_utf8(input) else { return Outcome::Refused };
    let (vertex, fragment) = text.split_once(char::from(SEPARATOR)).unwrap_or((text, ""));
    // A leading digit in the vertex shader is the output location of the depth, for a target that keeps its depth.
    let digit = vertex.bytes().next().filter(u8::is_ascii_digit).map(|digit| usize::from(digit - b'0'));
    let depth = digit.filter(|depth| *depth < MAX_OUTPUTS);
    let vertex = if depth.is_some() { &vertex[1..] } else { vertex };
    let source = Source { vertex, fragment, depth };
    let file = |stage: Stage| if stage == Stage::Vertex { vertex } else { fragment };
    match source.compile() {
        Ok(program) => {
            check(&program, file);
            assert!(depth.is_none_or(|depth| program.outputs[depth]), "the depth is written");
            assert_eq!(source.compile().as_ref(), Ok(&program), "a second run differs");
            Outcome::Loaded
        }
        Err(faults) => {
            assert!((1..=64).contains(&faults.len()), "{} faults", faults.len());
            for fault in &faults {
                assert!(!fault.message.is_empty() && !fault.message.ends_with('.'), "{fault:?}");
                assert!(file(fault.stage).get(fault.start..fault.end).is_some(), "no place in the file: {fault:?}");
            }
            Outcome::Refused
        }
    }
}

/// Asserts the guarantees of a compiled shader.
fn check<'a>(program: &Program, file: impl Fn(Stage) -> &'a str) {
    for (text, stage) in [(&program.vertex, "@vertex"), (&program.fragment, "@fragment")] {
        assert_eq!(text.matches(stage).count(), 1, "one entry point");
    }
    for block in &program.blocks {
        check_block(block, file(block.stage));
    }
    for (index, sampler) in program.samplers.iter().enumerate() {
        let [start, end] = sampler.at;
        // Each element of an array is a sampler of its own, such as `name[1]`.
        let declared = sampler.name.split('[').next();
        assert_eq!(file(sampler.stage).get(start..end), declared, "where it is declared");
        assert!(program.samplers[..index].iter().all(|other| other.name != sampler.name), "one of each name");
    }
    let attributes = &program.attributes;
    assert!(attributes.iter().enumerate().all(|(index, one)| !attributes[..index].contains(one)), "{attributes:?}");
    assert_eq!(program.outputs.len(), MAX_OUTPUTS);
}

/// Asserts that members follow each other within their block, and that their names are found in the file.
fn check_block(block: &Block, file: &str) {
    let mut free = 0;
    for member in &block.members {
        let [start, end] = member.at;
        let declared = file.get(start..end);
        assert!(
            member.name == FRAME || is_image_size(&member.name).is_some() || declared == Some(member.name.as_str()),
            "{member:?} is declared as {declared:?}"
        );
        assert!(member.offset >= free, "{member:?} lies over what is before it");
        // An array or a structure takes at least one component.
        let bytes = member.shape.map_or(4, |shape| 16 * (shape.columns - 1) + 4 * shape.rows);
        free = member.offset + bytes;
        assert!(free <= block.size, "{member:?} ends behind its block of {} bytes", block.size);
        assert!(member.default.is_none() || member.shape.is_some(), "{member:?}");
    }
}
