//! G-buffers in device memory that a rasteriser and a ray backend share, so that nothing passes through the host.

use crate::gbuffer::Attachments;
use std::any::Any;
use std::sync::Arc;

/// What tells GPUs apart, whichever interface shows them: the UUID that its driver gives a device.
pub type DeviceUuid = [u8; 16];

/// Attachments that a rasteriser leaves where it draws them, for a ray backend that uses the same device through the same interface. What it
/// is, both know.
pub type InPlace = Arc<dyn Any + Send + Sync>;

/// A handle of the operating system to device memory or to a semaphore, which another interface of the same device opens.
#[cfg(unix)]
pub type SharedHandle = std::os::fd::OwnedFd;

/// Sharing is made for systems with file descriptors: elsewhere there is no handle, and nothing is shared.
#[cfg(not(unix))]
#[derive(Debug)]
pub enum SharedHandle {}

/// Device memory for one G-buffer. Every attachment is dense, its top row first: four 32-bit floats a pixel, of the triangle
/// id one 32-bit integer, as in [`GBuffer`](crate::gbuffer::GBuffer).
#[derive(Debug)]
pub struct SharedGBuffer {
    /// The device whose memory it is.
    pub device: DeviceUuid,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Which attachments there are.
    pub attachments: Attachments,
    /// The memory.
    pub memory: SharedHandle,
    /// Its size, at least where the last attachment ends.
    pub bytes: u64,
    /// A timeline semaphore. It reaches the value that a hand-over names when the attachments are complete.
    pub semaphore: SharedHandle,
}

/// Where attachments start in the memory, in bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Offsets {
    /// Shaded colour.
    pub color: Option<u64>,
    /// World position and light cosine.
    pub position: Option<u64>,
    /// Shading normal.
    pub normal: Option<u64>,
    /// Triangle id.
    pub triangle: Option<u64>,
    /// Where the last one ends.
    pub end: u64,
}

impl Offsets {
    /// Every attachment starts at a multiple of this: what graphics interfaces want at most of a bound buffer.
    pub const ALIGNMENT: u64 = 256;

    /// The layout of a G-buffer of that size.
    #[must_use]
    pub fn new(width: u32, height: u32, attachments: Attachments) -> Self {
        let pixels = u64::from(width) * u64::from(height);
        let mut end = 0_u64;
        let mut place = |wanted: bool, bytes: u64| {
            wanted.then(|| {
                let start = end;
                end = (start + pixels * bytes).next_multiple_of(Self::ALIGNMENT);
                start
            })
        };
        let color = place(attachments.color, 16);
        let position = place(attachments.position, 16);
        let normal = place(attachments.normal, 16);
        let triangle = place(attachments.triangle, 4);
        Self { color, position, normal, triangle, end }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attachments_follow_each_other_and_those_that_are_absent_take_nothing() {
        let all = Attachments { color: true, position: true, normal: true, triangle: true };
        let whole = Offsets::new(10, 7, all);
        assert_eq!((whole.color, whole.position), (Some(0), Some(1280)));
        assert_eq!((whole.normal, whole.triangle, whole.end), (Some(2560), Some(3840), 4352));
        let some = Offsets::new(16, 16, Attachments { color: false, normal: false, ..all });
        assert_eq!((some.color, some.position, some.normal, some.triangle), (None, Some(0), None, Some(4096)));
        assert_eq!(some.end, 5120);
    }
}
