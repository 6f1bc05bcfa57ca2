//! Copies pictures to the host through page-locked memory, which the device writes directly.

use crate::device::Device;
use cudarc::driver::result::memcpy_dtoh_async;
use cudarc::driver::{CudaSlice, DevicePtr as _, DriverError, PinnedHostSlice};
use curitiba_pipeline::backend::BackendError;
use rayon::prelude::*;

/// Number of `f32` values in each of the two pieces of page-locked memory: 4 MiB.
const PIECE: usize = 1 << 20;
/// Number of `f32` values that one task of the host copies from a piece to its destination.
const COPIED_AT_ONCE: usize = 1 << 16;

/// Two pieces of page-locked memory: the device fills one while the host empties the other.
#[derive(Debug, Default)]
pub(crate) struct Staging(Option<[PinnedHostSlice<f32>; 2]>);

/// A range of device memory to copy: the index of its first number, and the destination.
type Part<'a> = (usize, &'a mut [f32]);

/// The parts, cut and grouped so that each batch fits into a piece.
fn batches(parts: Vec<Part<'_>>) -> Vec<Vec<Part<'_>>> {
    let (mut batches, mut batch, mut room) = (Vec::new(), Vec::new(), PIECE);
    for (mut first, mut target) in parts {
        while !target.is_empty() {
            if room == 0 {
                batches.push(std::mem::take(&mut batch));
                room = PIECE;
            }
            let (now, later) = target.split_at_mut(room.min(target.len()));
            room -= now.len();
            let length = now.len();
            batch.push((first, now));
            (first, target) = (first + length, later);
        }
    }
    if !batch.is_empty() {
        batches.push(batch);
    }
    batches
}

impl Staging {
    /// Copies the parts of `source` to the host.
    pub fn read(&mut self, device: &Device, source: &CudaSlice<f32>, parts: Vec<Part<'_>>) -> Result<(), BackendError> {
        self.copy(device, source, parts).map_err(|error| device.fault("reading the picture", &error))
    }

    #[allow(unsafe_code, reason = "lets the device write into memory while the host goes on")]
    fn copy(&mut self, device: &Device, source: &CudaSlice<f32>, parts: Vec<Part<'_>>) -> Result<(), DriverError> {
        if self.0.is_none() {
            // SAFETY: the memory is not initialised, but only numbers that the device has written are read.
            let piece = || unsafe { device.context().alloc_pinned_with_flags::<f32>(PIECE, 0) };
            self.0 = Some([piece()?, piece()?]);
        }
        let Some([one, other]) = &mut self.0 else { return Ok(()) };
        let (mut filled, mut next) = (one.as_mut_slice()?, other.as_mut_slice()?);
        let stream = device.stream();
        let begin = |batch: &[Part<'_>], into: &mut [f32]| {
            let mut rest = into;
            for (first, target) in batch {
                let (now, later) = rest.split_at_mut(target.len());
                rest = later;
                let from = source.slice(*first..*first + now.len());
                // SAFETY: source and target have the same length. The target is page-locked and lives as long as `self`. It is not read before the
                // event that follows has happened, for which every return without an error waits. After a failure, the stream is assumed to run
                // nothing any more.
                unsafe { memcpy_dtoh_async(now, from.device_ptr(stream).0, stream.cu_stream()) }?;
            }
            stream.record_event(None)
        };
        let mut batches = batches(parts).into_iter().peekable();
        let mut done = match batches.peek() {
            Some(batch) => begin(batch, filled)?,
            None => return Ok(()),
        };
        while let Some(batch) = batches.next() {
            let following = match batches.peek() {
                Some(batch) => Some(begin(batch, next)?),
                None => None,
            };
            done.synchronize()?;
            let mut rest = &*filled;
            let mut pieces = Vec::new();
            for (_, target) in batch {
                let (numbers, later) = rest.split_at(target.len());
                rest = later;
                pieces.extend(target.chunks_mut(COPIED_AT_ONCE).zip(numbers.chunks(COPIED_AT_ONCE)));
            }
            pieces.into_par_iter().for_each(|(to, from)| to.copy_from_slice(from));
            let Some(following) = following else { break };
            done = following;
            std::mem::swap(&mut filled, &mut next);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_in_one_batch_and_no_batch_is_larger_than_a_piece() {
        let lengths = [3, PIECE - 1, 0, 2 * PIECE + 5, 7, 7];
        let mut memory: Vec<Vec<f32>> = lengths.iter().map(|length| vec![0.0; *length]).collect();
        let starts: Vec<usize> = (0..lengths.len()).map(|part| part * 10 * PIECE).collect();
        let parts = starts.iter().copied().zip(memory.iter_mut().map(Vec::as_mut_slice)).collect();
        let batches = batches(parts);
        assert_eq!(batches.len(), 4, "three whole pieces and a rest");
        for batch in batches {
            assert!(batch.iter().map(|(_, target)| target.len()).sum::<usize>() <= PIECE);
            for (first, target) in batch {
                for (index, number) in target.iter_mut().enumerate() {
                    *number += ((first + index) % (10 * PIECE) + 1) as f32;
                }
            }
        }
        for part in memory {
            assert!(part.iter().enumerate().all(|(index, number)| *number == (index + 1) as f32));
        }
    }
}
