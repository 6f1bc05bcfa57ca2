//! The storage buffers and images that own shaders bind, and the textures that begin a frame with random numbers.

use super::Renderer;
use crate::backend::GBuffer;
use crate::plan::PlannedPass;
use crate::project::{Bound, OwnShader, PassKind};

/// Puts back what [`Renderer::take_bound`] took.
pub(super) fn give(targets: &mut [GBuffer], bound: Bound, bytes: Vec<[f32; 4]>) {
    let buffer = &mut targets[bound.target];
    if bytes.len() == buffer.width as usize * buffer.height as usize {
        buffer.color = bytes;
    }
}

impl Renderer {
    /// The buffers and images that a shader binds, in the order of its bindings. At the start of a frame all contain zeros, except for
    /// images that another pass drew and those with random numbers.
    pub(super) fn take_buffers(&mut self, shader: &OwnShader, pass: usize) -> Vec<Vec<[f32; 4]>> {
        let take = |bound: &Option<Bound>| match bound {
            Some(bound) => self.take_bound(*bound, pass),
            // A binding without contents gets one texel, which no shader accesses.
            None => vec![[0.0; 4]],
        };
        shader.storage.iter().map(take).collect()
    }

    /// Puts back what [`Self::take_buffers`] took.
    pub(super) fn give_buffers(&mut self, shader: &OwnShader, buffers: Vec<Vec<[f32; 4]>>) {
        for (bound, bytes) in shader.storage.iter().zip(buffers) {
            if let Some(bound) = bound {
                give(&mut self.targets, *bound, bytes);
            }
        }
    }

    /// Takes the contents of a buffer or image that the pass at an index of the pipeline binds. They are set to 0 if the binding asks for
    /// it, or if the pass is the first of the frame that binds the buffer. A buffer that no pass reads or stores to has no memory: one
    /// texel, which no shader accesses, is returned instead.
    pub(super) fn take_bound(&mut self, bound: Bound, pass: usize) -> Vec<[f32; 4]> {
        let mut bytes = std::mem::take(&mut self.targets[bound.target].color);
        // Textures with random numbers are filled already.
        let begins = self.plan.project.targets[bound.target].contents.is_none();
        if bound.cleared || begins && self.is_first_to_bind(bound.target, pass) {
            bytes.fill([0.0; 4]);
        }
        if bytes.is_empty() { vec![[0.0; 4]] } else { bytes }
    }

    /// Fills the buffer of [`CameraStart::linear`](crate::project::CameraStart::linear) with a picture of the pass's target, bottom row first.
    pub(super) fn fill_linear(&mut self, buffer: usize, width: u32, pixels: &[[f32; 4]]) {
        let rows = pixels.chunks_exact(width.max(1) as usize).rev().flatten();
        self.targets[buffer].color.iter_mut().zip(rows).for_each(|(held, pixel)| *held = *pixel);
    }

    /// Rounds what the shaders of a pass stored to the formats of the images.
    pub(super) fn round_stored(&mut self, planned: &PlannedPass) {
        let stored: Vec<usize> = self.plan.pass(planned).kind.buffers_stored().map(|channel| channel.target).collect();
        stored.into_iter().for_each(|target| self.round_to_formats(Some(target)));
    }

    /// Whether the pass at an index of the pipeline is the first that binds a buffer or image, or draws into it.
    pub(super) fn is_first_to_bind(&self, target: usize, pass: usize) -> bool {
        let binds = |planned: &&PlannedPass| {
            let pass = self.plan.pass(planned);
            match &pass.kind {
                PassKind::Intersection(intersection) => intersection.binds(target),
                kind => {
                    let binds = kind.shaders().any(|shader| shader.binds(target));
                    binds || pass.target == Some(target) || kind.linear() == Some(target)
                }
            }
        };
        self.plan.passes.iter().find(binds).is_some_and(|first| first.pass == pass)
    }

    /// Fills the textures that begin a frame with random numbers.
    pub(super) fn fill_textures(&mut self) {
        for (target, declared) in self.targets.iter_mut().zip(&self.plan.project.targets) {
            if let (Some(contents), [channel, ..]) = (declared.contents, &declared.channels[..]) {
                contents.fill(channel.format, target.width, &mut target.color);
            }
        }
    }
}
