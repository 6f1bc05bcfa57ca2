//! Inputs and statistics of raster passes.

use super::light::Light;
use super::shade::Shade;
use super::view::{Sun, View};
use crate::gbuffer::{Attachments, Rect};
use crate::programs::RasterProgram;
use crate::scene::RenderScene;
use glam::Vec4;
use std::time::Duration;

/// What a raster pass loads from its target, and whether it stores its depth for a later pass. By default everything is cleared and the
/// depth is not stored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct LoadStore {
    /// Starts from the attachments that the target holds in host memory, instead of clearing them. Pixels in which nothing is drawn keep
    /// the loaded values.
    pub load_color: bool,
    /// Starts from [`GBuffer::depth`](crate::gbuffer::GBuffer::depth) instead of the far plane. The depth that own shaders write to an attachment
    /// ([`OwnShaders::depth`](super::OwnShaders::depth)) is loaded with it.
    pub load_depth: bool,
    /// Writes [`GBuffer::depth`](crate::gbuffer::GBuffer::depth), which is allocated: directly in host memory, or in
    /// [`Rasteriser::read_back`](super::Rasteriser::read_back).
    pub store_depth: bool,
}

/// One raster pass.
#[derive(Debug, Clone, Copy)]
pub struct RasterJob<'a> {
    /// The scene to draw.
    pub scene: &'a RenderScene,
    /// The program that runs per fragment.
    pub program: RasterProgram,
    /// The camera.
    pub view: View,
    /// The light. Without a light the cosine that shading multiplies with is 0.
    pub sun: Option<Sun>,
    /// The lights that replace [`Self::sun`] if the pass has several lights or a light with a position; otherwise empty. With them the
    /// light cosine written is the greatest among the lights whose [`Arriving::factor`](super::Arriving::factor) is above 0.
    pub lights: &'a [Light],
    /// Colours of the materials, by material index.
    pub shades: &'a [Shade],
    /// Whether back faces (corners clockwise on the screen) are culled, by material index. Empty: nothing is culled.
    pub culled: &'a [bool],
    /// The part of the picture that [`Self::view`] covers. It is cleared and drawn as far as the target holds it. A target that
    /// cuts the viewport must do so at multiples of [`ALIGNMENT`](crate::gbuffer::ALIGNMENT) pixels from the viewport's corner.
    pub viewport: Rect,
    /// Clear value of the colour. The other attachments are cleared to 0 and the triangle id to
    /// [`NO_TRIANGLE`](crate::gbuffer::NO_TRIANGLE).
    pub clear_color: Vec4,
    /// The attachments to write.
    pub attachments: Attachments,
    /// Those of [`Self::attachments`] that are also written into the memory made by
    /// [`Rasteriser::share`](super::Rasteriser::share), which has the viewport's size.
    pub shared: Attachments,
    /// Those of [`Self::attachments`] that are declared as 16-bit floats. A rasteriser that keeps attachments on a device stores
    /// these as 16-bit floats, and effects read the rounded values; in host memory the executor rounds them. The device chooses the
    /// rounding mode.
    pub half: Attachments,
    /// Whether depth and attributes are interpolated between corners snapped to the subpixel grid (thesis fidelity), or between the exact
    /// corners. Devices use their own interpolation for snapped corners. For exact corners they use it only for values that their
    /// programs cannot compute from the corners of a triangle.
    pub snapped_depth: bool,
    /// What is loaded instead of being cleared, and whether the depth is stored.
    pub load_store: LoadStore,
}

/// The copy of attachments into shared memory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HandOver {
    /// Value of the shared memory's semaphore once the copy is complete.
    pub value: u64,
    /// Host time with synchronisation; not part of the draw's time.
    pub host: Duration,
    /// Time on the device's own clock, if it has one; not part of the draw's time.
    pub device: Option<Duration>,
}

/// Statistics of a draw.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DrawStats {
    /// Time on the device's own clock, if it has one.
    pub device_time: Option<Duration>,
    /// The copy into shared memory, if the job asked for one.
    pub shared: Option<HandOver>,
    /// Triangles submitted.
    pub triangles: u64,
}
