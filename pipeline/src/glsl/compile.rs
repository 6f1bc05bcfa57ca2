//! Runs the compilation steps of a shader in order.

use super::link::{link, link_compute, next_binding};
use super::rewrite::read;
use super::tokens::tokens;
use super::translate::Translated;
use super::translate::translate;
use super::{Compute, ComputeSource, Fault, MAX_OUTPUTS, Program, Source, Stage, StorageBuffer};

/// Stack size of the compiling thread, bytes. The compiler recurses as deeply as a file nests, which is bounded.
const STACK: usize = 256 << 20;

impl Source<'_> {
    /// Compiles the two stages.
    ///
    /// # Errors
    /// The faults, with their places in the files.
    pub fn compile(&self) -> Result<Program, Vec<Fault>> {
        on_a_thread(Stage::Vertex, || compile(*self))
    }
}

impl ComputeSource<'_> {
    /// Compiles the shader.
    ///
    /// # Errors
    /// The faults, with their places in the file.
    pub fn compile(&self) -> Result<Program, Vec<Fault>> {
        on_a_thread(Stage::Compute, || compile_compute(self.text))
    }
}

fn on_a_thread(
    stage: Stage,
    compile: impl FnOnce() -> Result<Program, Vec<Fault>> + Send,
) -> Result<Program, Vec<Fault>> {
    let failed = |message: String| vec![Fault { stage, start: 0, end: 0, message, help: None }];
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("glsl".to_owned()).stack_size(STACK);
        let running = thread.spawn_scoped(scope, compile);
        let running = running.map_err(|error| failed(format!("no thread could be started to compile: {error}")))?;
        // A panic that no guard caught is a defect of this program; it is passed on.
        running.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn compile_compute(text: &str) -> Result<Program, Vec<Fault>> {
    let tokens = tokens(Stage::Compute, text).map_err(|fault| vec![fault])?;
    let stated = read(Stage::Compute, &tokens, 0)?;
    let group = stated.group;
    let done = translate(Stage::Compute, &link_compute(&stated), &stated)?;
    let storage = used(&stated.storage, &done);
    let mut blocks = done.blocks;
    blocks.sort_by_key(|(binding, _)| *binding);
    Ok(Program {
        vertex: String::new(),
        fragment: String::new(),
        compute: Some(Compute { text: done.wgsl, group }),
        attributes: Vec::new(),
        blocks: blocks.into_iter().map(|(_, block)| block).collect(),
        samplers: stated.samplers,
        outputs: [false; MAX_OUTPUTS],
        flat: false,
        storage,
        early: None,
        fixed: stated.fixed,
    })
}

/// The buffers of a stage, each marked with whether the stage reads it and stores to it.
fn used(storage: &[StorageBuffer], done: &Translated) -> Vec<StorageBuffer> {
    let used = |(index, buffer): (usize, &StorageBuffer)| {
        let [read, written] = done.storage.iter().find(|(at, _)| *at == index).map_or([false; 2], |(_, of)| *of);
        StorageBuffer { read, written, ..buffer.clone() }
    };
    storage.iter().enumerate().map(used).collect()
}

fn compile(source: Source<'_>) -> Result<Program, Vec<Fault>> {
    let one = |fault: Fault| vec![fault];
    let vertex = tokens(Stage::Vertex, source.vertex).map_err(one);
    let fragment = tokens(Stage::Fragment, source.fragment).map_err(one);
    let vertex = vertex.and_then(|tokens| read(Stage::Vertex, &tokens, 0));
    let first = vertex.as_ref().map_or(0, |vertex| next_binding(vertex, 0));
    let fragment = fragment.and_then(|tokens| read(Stage::Fragment, &tokens, first));
    let (vertex, fragment) = both(vertex, fragment)?;
    let linked = link(&vertex, &fragment, source.depth)?;
    let (vertex_done, fragment_done) = both(
        translate(Stage::Vertex, &linked.vertex, &vertex),
        translate(Stage::Fragment, &linked.fragment, &fragment),
    )?;
    let storage = used(&fragment.storage, &fragment_done);
    let mut blocks = [vertex_done.blocks, fragment_done.blocks].concat();
    blocks.sort_by_key(|(binding, _)| *binding);
    debug_assert!((0..).zip(&blocks).all(|(index, (binding, _))| index == *binding), "bindings have no gaps");
    Ok(Program {
        vertex: vertex_done.wgsl,
        fragment: fragment_done.wgsl,
        compute: None,
        attributes: linked.attributes,
        blocks: blocks.into_iter().map(|(_, block)| block).collect(),
        samplers: linked.samplers,
        outputs: linked.outputs,
        flat: linked.flat,
        storage,
        early: fragment.early,
        fixed: [vertex.fixed, fragment.fixed].concat(),
    })
}

/// Both values, or the faults of both.
fn both<A, B>(first: Result<A, Vec<Fault>>, second: Result<B, Vec<Fault>>) -> Result<(A, B), Vec<Fault>> {
    match (first, second) {
        (Ok(first), Ok(second)) => Ok((first, second)),
        (Err(first), Err(second)) => Err([first, second].concat()),
        (Err(faults), _) | (_, Err(faults)) => Err(faults),
    }
}
