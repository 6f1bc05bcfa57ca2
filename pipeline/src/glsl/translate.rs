//! From the rewritten text to WGSL, and what the compiler knows of uniform blocks.

use super::link::Text;
use super::rewrite::{LOOSE, Stated};
use super::{Block, FRAME, Fault, Member, Scalar, Shape, Stage};
use crate::guard;
use naga::front::glsl::{Frontend, Options};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module, ScalarKind, ShaderStage, Span, TypeInner, VectorSize};

/// A stage as the device takes it.
#[derive(Debug)]
pub(super) struct Translated {
    pub wgsl: String,
    /// Uniform blocks and their bindings.
    pub blocks: Vec<(u32, Block)>,
}

/// The WGSL of a stage, and its uniform blocks.
pub(super) fn translate(stage: Stage, text: &Text, stated: &Stated) -> Result<Translated, Vec<Fault>> {
    let of_crate = |message: String| vec![Fault { stage, start: 0, end: 0, message, help: None }];
    let options = Options::from(match stage {
        Stage::Vertex => ShaderStage::Vertex,
        Stage::Fragment => ShaderStage::Fragment,
    });
    let parsed = guard::call("naga", || Frontend::default().parse(&options, &text.source)).map_err(of_crate)?;
    let module = parsed.map_err(|errors| {
        let fault = |error: &naga::front::glsl::Error| at(stage, text, error.meta, error.kind.to_string());
        errors.errors.iter().take(8).map(fault).collect::<Vec<_>>()
    })?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let validate = || validator.validate(&module).map_err(Box::new);
    let info = guard::call("naga", validate).map_err(of_crate)?.map_err(|error| {
        // The function first, then what is wrong in it, of which the smallest says most.
        let ranges: Vec<_> = error.spans().filter_map(|(span, _)| Some((*span, span.to_range()?))).collect();
        let whole =
            ranges.iter().map(|(_, range)| range.clone()).max_by_key(ExactSizeIterator::len).unwrap_or_default();
        let inside = |range: &std::ops::Range<usize>| whole.start <= range.start && range.end <= whole.end;
        let smallest = ranges.iter().filter(|(_, range)| inside(range)).min_by_key(|(_, range)| range.len());
        let span = smallest.map_or(Span::UNDEFINED, |(span, _)| *span);
        let mut message = error.as_inner().to_string();
        let mut source = std::error::Error::source(error.as_inner());
        while let Some(cause) = source {
            message = format!("{message}: {cause}");
            source = cause.source();
        }
        vec![at(stage, text, span, message)]
    })?;
    let blocks = blocks(stage, &module, stated);
    let flags = naga::back::wgsl::WriterFlags::empty();
    let written = guard::call("naga", || naga::back::wgsl::write_string(&module, &info, flags)).map_err(of_crate)?;
    let wgsl = written.map_err(|error| of_crate(format!("this cannot be written as WGSL: {error}")))?;
    Ok(Translated { wgsl, blocks })
}

/// A fault at the place in the file that a part of the rewritten text comes from.
fn at(stage: Stage, text: &Text, span: Span, message: String) -> Fault {
    let (start, end) = match span.to_range() {
        Some(range) => {
            let origin = |byte: usize| {
                let index = text.origins.partition_point(|origin| origin.at <= byte);
                index.checked_sub(1).map(|index| text.origins[index])
            };
            let first = origin(range.start);
            let last = origin(range.end.saturating_sub(1).max(range.start));
            (first.map_or(0, |origin| origin.start), last.map_or(0, |origin| origin.end))
        }
        None => (0, 0),
    };
    let message = message.replace("curitiba_main", "main");
    Fault {
        stage,
        start,
        end: end.max(start),
        message: format!("the compiler does not take this: {message}"),
        help: None,
    }
}

fn blocks(stage: Stage, module: &Module, stated: &Stated) -> Vec<(u32, Block)> {
    let mut found = Vec::new();
    for (_, variable) in module.global_variables.iter() {
        let (AddressSpace::Uniform, Some(binding)) = (variable.space, variable.binding) else { continue };
        let ty = &module.types[variable.ty];
        let TypeInner::Struct { members, span } = &ty.inner else { continue };
        let name = ty.name.clone().filter(|name| name != LOOSE);
        let members = members.iter().filter_map(|member| {
            let declared = member.name.clone()?;
            let loose = stated.uniforms.iter().find(|uniform| name.is_none() && uniform.name == declared);
            let in_block =
                name.as_ref().and_then(|name| stated.members.get(&(name.clone(), declared.clone())).copied());
            let at = loose.map(|uniform| [uniform.token.start, uniform.token.end]).or(in_block);
            let at = at.or((declared == FRAME).then_some([0, 0]))?;
            let shape = shape(&module.types[member.ty].inner);
            let default = loose.and_then(|uniform| uniform.default);
            Some(Member { name: declared, offset: member.offset, shape, default, at })
        });
        found.push((binding.binding, Block { name: name.clone(), stage, size: *span, members: members.collect() }));
    }
    found
}

fn shape(inner: &TypeInner) -> Option<Shape> {
    let scalar = |kind: ScalarKind| match kind {
        ScalarKind::Float => Some(Scalar::Float),
        ScalarKind::Sint => Some(Scalar::Int),
        ScalarKind::Uint => Some(Scalar::Uint),
        _ => None,
    };
    let count = |size: VectorSize| u32::from(size as u8);
    match *inner {
        TypeInner::Scalar(of) => Some(Shape { scalar: scalar(of.kind)?, columns: 1, rows: 1 }),
        TypeInner::Vector { size, scalar: of } => {
            Some(Shape { scalar: scalar(of.kind)?, columns: 1, rows: count(size) })
        }
        TypeInner::Matrix { columns, rows, scalar: of } => {
            Some(Shape { scalar: scalar(of.kind)?, columns: count(columns), rows: count(rows) })
        }
        _ => None,
    }
}
