//! Attachments that ray passes on the same device read where they were drawn.

use super::device::Gpu;
use super::targets::Targets;
use std::sync::{Arc, Mutex, PoisonError};

/// What the rasteriser and the ray backend both hold: the device, and what was drawn last for rays.
#[derive(Debug)]
pub(crate) struct Lending {
    pub gpu: Arc<Gpu>,
    last: Mutex<Lent>,
}

/// The attachments of one pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lent {
    /// Counts the passes, from 1.
    pub value: u64,
    /// Pixels a row, and rows.
    pub size: (u32, u32),
    /// Colour, position, normal and triangle id, the last plus 1.
    pub channels: [Option<wgpu::TextureView>; 4],
}

impl Lending {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        Self { gpu, last: Mutex::default() }
    }

    /// What was drawn last.
    pub fn last(&self) -> Lent {
        self.last.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Lends what was just drawn, and gives its number.
    pub(in crate::raster::gpu) fn lend(&self, targets: &Targets) -> u64 {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let value = last.value + 1;
        *last =
            Lent { value, size: targets.size(), channels: targets.views().map(Option::<&wgpu::TextureView>::cloned) };
        value
    }
}
