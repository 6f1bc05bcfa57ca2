//! Segments between triangles, asked many at a time: the seam between estimates of visibility and devices.

use bytemuck::{Pod, Zeroable};
use curitiba_pipeline::backend::BackendError;

/// A segment from one triangle of a pair to the other, as a ray that ends.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// Where it starts.
    pub from: [f32; 3],
    /// Where it ends, in lengths of `along`.
    pub end: f32,
    /// Its direction; no longer than a unit vector.
    pub along: [f32; 3],
    /// Its pair: an index into [`Segments::own`].
    pub pair: u32,
}

/// Segments of some pairs.
#[derive(Debug, Default)]
pub struct Segments {
    /// All of them, those of a pair beside each other.
    pub all: Vec<Segment>,
    /// By pair: the two triangles that do not block.
    pub own: Vec<[u32; 2]>,
}

/// What traces many segments at a time, in a scene that it was made for.
pub trait SegmentTracer: Send {
    /// As users call it: `cuda`, `optix`, `wgpu`.
    fn name(&self) -> &'static str;

    /// The device, in words.
    fn device(&self) -> String;

    /// Says which segments an opaque triangle blocks other than their own two, as
    /// [`Tracer::occluded`](super::Tracer::occluded) has it: one bit a segment in words of 32, the first lowest. What was in `bits` goes.
    ///
    /// # Errors
    /// If the device fails, or its memory does not hold them.
    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError>;
}
