//! Translates the rewritten source to WGSL, and finds the layout of uniform blocks.

use super::link::Text;
use super::rewrite::{LOOSE, Stated, TRUTH, counting_name};
use super::{Block, FRAME, Fault, Held, Member, Scalar, Shape, Stage, StorageBuffer};
use crate::guard;
use naga::front::glsl::{Frontend, Options};
use naga::valid::{Capabilities, GlobalUse, ValidationFlags, Validator};
use naga::{
    AddressSpace, Barrier, Expression, Handle, Module, Scalar as ScalarType, ScalarKind, ShaderStage, Span, Statement,
    Type, TypeInner, VectorSize,
};

/// A stage in the form that the device reads.
#[derive(Debug)]
pub(super) struct Translated {
    pub wgsl: String,
    /// Uniform blocks and their bindings.
    pub blocks: Vec<(u32, Block)>,
    /// Bindings of storage buffers, with whether they are read and whether they are written.
    pub storage: Vec<(usize, [bool; 2])>,
}

/// The WGSL of a stage, and its uniform blocks.
pub(super) fn translate(stage: Stage, text: &Text, stated: &Stated) -> Result<Translated, Vec<Fault>> {
    let of_crate = |message: String| vec![Fault { stage, start: 0, end: 0, message, help: None }];
    let options = Options::from(match stage {
        Stage::Vertex => ShaderStage::Vertex,
        Stage::Fragment => ShaderStage::Fragment,
        Stage::Compute => ShaderStage::Compute,
    });
    let parsed = guard::call("naga", || Frontend::default().parse(&options, &text.source)).map_err(of_crate)?;
    let mut module = parsed.map_err(|errors| {
        let fault = |error: &naga::front::glsl::Error| at(stage, text, error.meta, error.kind.to_string());
        errors.errors.iter().take(8).map(fault).collect::<Vec<_>>()
    })?;
    count_atomically(&mut module, stated);
    if stage == Stage::Compute {
        let functions = module.functions.iter_mut().map(|(_, function)| &mut function.body);
        functions.chain(module.entry_points.iter_mut().map(|entry| &mut entry.function.body)).for_each(wait_in_group);
    }
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let validate = || validator.validate(&module).map_err(Box::new);
    let info = guard::call("naga", validate).map_err(of_crate)?.map_err(|error| {
        // Spans are those of the function and of the faulty parts in it. The smallest is the most precise.
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
    let device = guard::call("naga", || naga::front::wgsl::parse_str(&wgsl)).map_err(of_crate)?;
    let device = device.map_err(|error| of_crate(format!("what is written as WGSL cannot be read: {error}")))?;
    let mut faults = laid_out_otherwise(stage, [&module, &device], &blocks);
    faults.extend(stored_otherwise(stage, [&module, &device], stated));
    if !faults.is_empty() {
        return Err(faults);
    }
    debug_assert_eq!(validator.validate(&device).map(|_| ()).map_err(|error| error.emit_to_string(&wgsl)), Ok(()));
    let storage = storage(&module, &info);
    Ok(Translated { wgsl, blocks, storage })
}

/// Faults for block members whose offsets in the WGSL that the device reads (`modules[1]`) differ from those of `std140` (`modules[0]`): WGSL
/// pads neither array elements nor structures to 16 bytes.
fn laid_out_otherwise(stage: Stage, modules: [&Module; 2], blocks: &[(u32, Block)]) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (binding, block) in blocks {
        let of = modules.map(|module| members(module, 0, *binding).unwrap_or_default());
        for (stated, device) in of[0].iter().zip(&of[1]) {
            let same = stated.offset == device.offset && same_layout(modules, [stated.ty, device.ty]);
            let member = block.members.iter().find(|member| Some(&member.name) == stated.name.as_ref());
            if let (false, Some(Member { name, at: [start, end], .. })) = (same, member) {
                let message = format!("the device cannot lie `{name}` out as `std140` does");
                let help = "elements of arrays in uniforms are vec3, vec4, their matrices, or structures of a multiple of 16 bytes";
                faults.push(Fault { stage, start: *start, end: *end, message, help: Some(help.to_owned()) });
                break;
            }
        }
    }
    faults
}

/// The members of the buffer at a group and binding.
fn members(module: &Module, group: u32, binding: u32) -> Option<Vec<naga::StructMember>> {
    let at = Some(naga::ResourceBinding { group, binding });
    let variable =
        module.global_variables.iter().map(|(_, variable)| variable).find(|variable| variable.binding == at)?;
    match &module.types[variable.ty].inner {
        TypeInner::Struct { members, .. } => Some(members.clone()),
        _ => None,
    }
}

/// Faults for storage buffers whose layout in the WGSL that the device reads differs from the declared one.
fn stored_otherwise(stage: Stage, modules: [&Module; 2], stated: &Stated) -> Vec<Fault> {
    let differs = |(binding, _): &(u32, &StorageBuffer)| {
        let [stated, device] = modules.map(|module| members(module, 2, *binding).unwrap_or_default());
        let same = |(stated, device): (&naga::StructMember, &naga::StructMember)| {
            stated.offset == device.offset && same_layout(modules, [stated.ty, device.ty])
        };
        !stated.iter().zip(&device).all(same)
    };
    let fault = |(_, buffer): (u32, &StorageBuffer)| {
        let message = format!("the device cannot lay the buffer `{}` out as the shader does", buffer.name);
        let help = "valid: layout(std430), and elements without gaps: vec4, or numbers";
        Fault { stage, start: buffer.at[0], end: buffer.at[1], message, help: Some(help.to_owned()) }
    };
    (0..).zip(&stated.storage).filter(differs).map(fault).collect()
}

/// Bindings of storage buffers, with whether they are read and written.
fn storage(module: &Module, info: &naga::valid::ModuleInfo) -> Vec<(usize, [bool; 2])> {
    let mut found = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let (AddressSpace::Storage { .. }, Some(at)) = (variable.space, variable.binding) else { continue };
        let used = info.get_entry_point(0)[handle];
        let atomic = used.contains(GlobalUse::ATOMIC);
        found.push((
            at.binding as usize,
            [atomic || used.contains(GlobalUse::READ), atomic || used.contains(GlobalUse::WRITE)],
        ));
    }
    found
}

/// Makes barriers wait for the work group and its stores, as in GLSL. The front end's barriers also wait for the subgroup, which not every
/// device supports.
fn wait_in_group(block: &mut naga::Block) {
    for statement in block.iter_mut() {
        match statement {
            Statement::ControlBarrier(waits) => *waits = Barrier::WORK_GROUP | Barrier::STORAGE,
            Statement::Block(inner) => wait_in_group(inner),
            Statement::If { accept, reject, .. } => {
                wait_in_group(accept);
                wait_in_group(reject);
            }
            Statement::Switch { cases, .. } => cases.iter_mut().for_each(|case| wait_in_group(&mut case.body)),
            Statement::Loop { body, continuing, .. } => {
                wait_in_group(body);
                wait_in_group(continuing);
            }
            _ => {}
        }
    }
}

/// Makes the numbers in counter buffers atomic, and gives the counter functions their real bodies. The GLSL that the front end reads has no
/// atomic counters.
fn count_atomically(module: &mut Module, stated: &Stated) {
    let number = Type { name: None, inner: TypeInner::Scalar(ScalarType::U32) };
    for (index, _) in stated.storage.iter().enumerate().filter(|(_, buffer)| buffer.held == Held::Counters) {
        let at = Some(naga::ResourceBinding { group: 2, binding: index as u32 });
        let Some((variable, _)) = module.global_variables.iter().find(|(_, variable)| variable.binding == at) else {
            continue;
        };
        let inner = module.types[module.global_variables[variable].ty].clone();
        let TypeInner::Struct { mut members, span } = inner.inner else { continue };
        let mut insert = |inner: TypeInner| module.types.insert(Type { name: None, inner }, Span::UNDEFINED);
        let base = insert(TypeInner::Atomic(ScalarType::U32));
        let ty = insert(TypeInner::Array { base, size: naga::ArraySize::Dynamic, stride: 4 });
        members.iter_mut().for_each(|member| member.ty = ty);
        let held = Type { name: inner.name, inner: TypeInner::Struct { members, span } };
        module.global_variables[variable].ty = module.types.insert(held, Span::UNDEFINED);
        let number = module.types.insert(number.clone(), Span::UNDEFINED);
        let functions =
            [("up", Some(naga::AtomicFunction::Add)), ("down", Some(naga::AtomicFunction::Subtract)), ("count", None)];
        for (what, counts) in functions {
            let name = Some(counting_name(what, index));
            let Some((handle, _)) = module.functions.iter().find(|(_, function)| function.name == name) else {
                continue;
            };
            count_by(&mut module.functions[handle], (variable, number), counts);
        }
    }
}

/// Writes the body of a counter function, whose argument is an index. The body applies `counts` to the number at that index of the buffer
/// `variable`, or only reads the number if `counts` is `None`.
fn count_by(
    function: &mut naga::Function,
    (variable, number): (Handle<naga::GlobalVariable>, Handle<Type>),
    counts: Option<naga::AtomicFunction>,
) {
    function.expressions.clear();
    function.named_expressions.clear();
    function.local_variables.clear();
    let mut body = naga::Block::new();
    let mut add = |expression| function.expressions.append(expression, Span::UNDEFINED);
    let emit = |body: &mut naga::Block, from, to| {
        body.push(Statement::Emit(naga::Range::new_from_bounds(from, to)), Span::UNDEFINED);
    };
    let argument = add(Expression::FunctionArgument(0));
    let one = add(Expression::Literal(naga::Literal::U32(1)));
    let buffer = add(Expression::GlobalVariable(variable));
    let numbers = add(Expression::AccessIndex { base: buffer, index: 0 });
    let pointer = add(Expression::Access { base: numbers, index: argument });
    emit(&mut body, numbers, pointer);
    let value = match counts {
        None => {
            let value = add(Expression::Load { pointer });
            emit(&mut body, value, value);
            value
        }
        Some(fun) => {
            let before = add(Expression::AtomicResult { ty: number, comparison: false });
            let counts = Statement::Atomic { pointer, fun, value: one, result: Some(before) };
            body.push(counts, Span::UNDEFINED);
            // In GLSL a decrement returns the value after the operation, and an increment the value before the operation.
            if matches!(fun, naga::AtomicFunction::Subtract) {
                let op = naga::BinaryOperator::Subtract;
                let after = add(Expression::Binary { op, left: before, right: one });
                emit(&mut body, after, after);
                after
            } else {
                before
            }
        }
    };
    body.push(Statement::Return { value: Some(value) }, Span::UNDEFINED);
    function.body = body;
}

/// Whether a type has the same member offsets and array strides in both modules.
fn same_layout(modules: [&Module; 2], [a, b]: [Handle<Type>; 2]) -> bool {
    match (&modules[0].types[a].inner, &modules[1].types[b].inner) {
        (TypeInner::Array { base: a, stride: here, .. }, TypeInner::Array { base: b, stride: there, .. }) => {
            here == there && same_layout(modules, [*a, *b])
        }
        (TypeInner::Struct { members: a, .. }, TypeInner::Struct { members: b, .. }) => {
            a.iter().zip(b).all(|(a, b)| a.offset == b.offset && same_layout(modules, [a.ty, b.ty]))
        }
        _ => true,
    }
}

/// A fault at the place in the file from which a part of the rewritten source comes.
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
    // Messages here are no sentences, so the full stop at the end of the compiler's message is removed.
    let message = message.replace("curitiba_main", "main");
    let message = message.trim_end_matches('.');
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
            let declared = match (&name, declared.strip_prefix(TRUTH)) {
                (None, Some(truth)) => truth.to_owned(),
                _ => declared,
            };
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
