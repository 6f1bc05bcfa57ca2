//! Segments between triangles, traced many at a time: the interface between estimates of visibility and devices.

use bytemuck::{Pod, Zeroable};
use curitiba_pipeline::backend::BackendError;

/// A segment from a point of one triangle to a point of another, as a ray with an end.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// Start point, in the coordinates of the scene that the tracer was made for.
    pub from: [f32; 3],
    /// Length of the segment in multiples of `along`.
    pub end: f32,
    /// Direction; its length is at most 1.
    pub along: [f32; 3],
    /// Index of the segment's pair of triangles in [`Segments::own`].
    pub pair: u32,
}

/// Segments between pairs of triangles.
#[derive(Debug, Default)]
pub struct Segments {
    /// All segments; the segments of a pair are consecutive.
    pub all: Vec<Segment>,
    /// For each pair, the ids of its two triangles, which do not block its segments.
    pub own: Vec<[u32; 2]>,
}

/// A device that traces many segments at a time, in the scene that it was made for.
pub trait SegmentTracer: Send {
    /// Name of the device's kind in the user interface: `cuda`, `optix`, `wgpu`.
    fn name(&self) -> &'static str;

    /// Name of the device, for people.
    fn device(&self) -> String;

    /// Finds the segments that are blocked by an opaque triangle other than the two of their pair. The results are those of
    /// [`Tracer::occluded`](super::Tracer::occluded), one bit a segment in words of 32, the first segment in the lowest bit. The earlier
    /// contents of `bits` are discarded.
    ///
    /// # Errors
    /// If the device fails, or its memory does not hold the segments.
    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError>;
}
