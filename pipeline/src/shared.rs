//! G-buffers in device memory, shared between a rasteriser and a ray backend without a copy through the host.

use crate::gbuffer::Attachments;
use std::any::Any;
use std::sync::Arc;

/// Identifies a GPU across interfaces: the UUID that its driver reports.
pub type DeviceUuid = [u8; 16];

/// A handle to attachments in a rasteriser's memory, for a ray backend that uses the same device through the same interface. The
/// rasteriser and the ray backend know the handle's concrete type.
pub type InPlace = Arc<dyn Any + Send + Sync>;

/// A handle of the operating system to device memory or a semaphore, which another interface of the same device can open.
#[cfg(unix)]
pub type SharedHandle = std::os::fd::OwnedFd;

/// Sharing requires file descriptors: on other systems there are no handles, and nothing is shared.
#[cfg(not(unix))]
#[derive(Debug)]
pub enum SharedHandle {}

/// Device memory of one G-buffer. Every attachment is densely packed, top row first: four 32-bit floats a pixel, or one 32-bit
/// integer for triangle ids, as in [`GBuffer`](crate::gbuffer::GBuffer).
#[derive(Debug)]
pub struct SharedGBuffer {
    /// The device that owns the memory.
    pub device: DeviceUuid,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The attachments that it contains.
    pub attachments: Attachments,
    /// Whether there is room for the picture of a ray pass, four floats a pixel.
    pub picture: bool,
    /// The memory.
    pub memory: SharedHandle,
    /// Size of the memory in bytes, at least [`Offsets::end`].
    pub bytes: u64,
    /// A timeline semaphore. It reaches the value of a hand-over when the attachments are complete, and [`after_picture`] of that value
    /// when a ray backend has written the picture.
    pub semaphore: SharedHandle,
}

/// Value of the semaphore once a ray pass has written its picture of this hand-over's G-buffer. Hand-overs are numbered so that this
/// value lies between two of them.
#[must_use]
pub fn after_picture(hand_over: u64) -> u64 {
    hand_over + 1
}

/// Offsets of the attachments in the memory, in bytes; `None` for those that it does not contain.
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
    /// The picture of a ray pass.
    pub picture: Option<u64>,
    /// End of the last attachment or picture.
    pub end: u64,
}

impl Offsets {
    /// Alignment of every attachment: the strictest that graphics interfaces require for bound buffers.
    pub const ALIGNMENT: u64 = 256;

    /// The layout of a G-buffer of that size, with or without room for a picture.
    #[must_use]
    pub fn new(width: u32, height: u32, attachments: Attachments, picture: bool) -> Self {
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
        let picture = place(picture, 16);
        Self { color, position, normal, triangle, picture, end }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attachments_follow_each_other_and_those_that_are_absent_take_nothing() {
        let all = Attachments { color: true, position: true, normal: true, triangle: true };
        let whole = Offsets::new(10, 7, all, false);
        assert_eq!((whole.color, whole.position), (Some(0), Some(1280)));
        assert_eq!((whole.normal, whole.triangle, whole.end), (Some(2560), Some(3840), 4352));
        let with_picture = Offsets::new(10, 7, all, true);
        assert_eq!((with_picture.triangle, with_picture.picture), (Some(3840), Some(4352)));
        assert_eq!((whole.picture, with_picture.end), (None, 5632));
        let some = Offsets::new(16, 16, Attachments { color: false, normal: false, ..all }, false);
        assert_eq!((some.color, some.position, some.normal, some.triangle), (None, Some(0), None, Some(4096)));
        assert_eq!(some.end, 5120);
    }
}
