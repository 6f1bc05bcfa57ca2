//! Pictures on their way to the host: through memory that the device writes directly.

use crate::device::Device;
use cudarc::driver::{CudaSlice, DriverError, PinnedHostSlice};
use curitiba_pipeline::backend::BackendError;
use rayon::prelude::*;

/// Numbers in each of the two pieces: 4 MiB.
const PIECE: usize = 1 << 20;
/// Numbers that one task copies.
const COPIED_AT_ONCE: usize = 1 << 16;

/// Two pieces of page-locked memory: one is filled by the device while the other is emptied.
#[derive(Debug, Default)]
pub(crate) struct Staging(Option<[PinnedHostSlice<f32>; 2]>);

impl Staging {
    /// Copies the numbers from `first` on of `source` to `target`.
    pub fn read(
        &mut self,
        device: &Device,
        source: &CudaSlice<f32>,
        first: usize,
        target: &mut [f32],
    ) -> Result<(), BackendError> {
        self.copy(device, source, first, target).map_err(|error| device.fault("reading the picture", &error))
    }

    #[allow(unsafe_code, reason = "allocates memory without setting it")]
    fn copy(
        &mut self,
        device: &Device,
        source: &CudaSlice<f32>,
        first: usize,
        target: &mut [f32],
    ) -> Result<(), DriverError> {
        if self.0.is_none() {
            // SAFETY: what is read of it was written by the device before.
            let piece = || unsafe { device.context().alloc_pinned_with_flags::<f32>(PIECE, 0) };
            self.0 = Some([piece()?, piece()?]);
        }
        let Some([filled, next]) = &mut self.0 else { return Ok(()) };
        let (mut filled, mut next) = (filled, next);
        let begin = |piece: usize, length: usize, into: &mut PinnedHostSlice<f32>| {
            let from = first + piece * PIECE;
            device.stream().memcpy_dtoh(&source.slice(from..from + length), into)
        };
        let mut pieces = target.chunks_mut(PIECE).enumerate().peekable();
        if let Some((piece, part)) = pieces.peek() {
            begin(*piece, part.len(), filled)?;
        }
        while let Some((_, part)) = pieces.next() {
            if let Some((piece, part)) = pieces.peek() {
                begin(*piece, part.len(), next)?;
            }
            // Waits for its own copy only.
            let numbers = &filled.as_slice()?[..part.len()];
            part.par_chunks_mut(COPIED_AT_ONCE)
                .zip(numbers.par_chunks(COPIED_AT_ONCE))
                .for_each(|(to, from)| to.copy_from_slice(from));
            std::mem::swap(&mut filled, &mut next);
        }
        Ok(())
    }
}
