//! Pictures on their way to the host: through memory that the device writes directly.

use crate::device::Device;
use cudarc::driver::result::memcpy_dtoh_async;
use cudarc::driver::{CudaSlice, DevicePtr as _, DriverError, PinnedHostSlice};
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

    #[allow(unsafe_code, reason = "lets the device write into memory while the host goes on")]
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
        let Some([one, other]) = &mut self.0 else { return Ok(()) };
        let (mut filled, mut next) = (one.as_mut_slice()?, other.as_mut_slice()?);
        let stream = device.stream();
        let begin = |piece: usize, into: &mut [f32]| {
            let from = first + piece * PIECE;
            let part = source.slice(from..from + into.len());
            // SAFETY: source and target are as long; the target is page-locked, lives as long as `self`, and nobody looks
            // at it before the event that follows has happened, for which every way out of this function waits: a failure
            // leaves a stream on which nothing runs any more.
            unsafe { memcpy_dtoh_async(into, part.device_ptr(stream).0, stream.cu_stream()) }?;
            stream.record_event(None)
        };
        let mut pieces = target.chunks_mut(PIECE).enumerate().peekable();
        let mut done = match pieces.peek() {
            Some((piece, part)) => begin(*piece, &mut filled[..part.len()])?,
            None => return Ok(()),
        };
        while let Some((_, part)) = pieces.next() {
            let following = match pieces.peek() {
                Some((piece, part)) => Some(begin(*piece, &mut next[..part.len()])?),
                None => None,
            };
            done.synchronize()?;
            let numbers = &filled[..part.len()];
            part.par_chunks_mut(COPIED_AT_ONCE)
                .zip(numbers.par_chunks(COPIED_AT_ONCE))
                .for_each(|(to, from)| to.copy_from_slice(from));
            let Some(following) = following else { break };
            done = following;
            std::mem::swap(&mut filled, &mut next);
        }
        Ok(())
    }
}
