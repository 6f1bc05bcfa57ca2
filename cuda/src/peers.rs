//! Copies a G-buffer that the rasteriser left in the memory of one GPU to other GPUs.
//!
//! CUDA driver API, "Peer Context Memory Access".
#![allow(unsafe_code, reason = "copies between the memories of two GPUs; each block says why that is sound")]

use crate::device::{Address, Buffer, Device};
use cudarc::driver::result::{memcpy_dtod_async, memcpy_peer_async};
use cudarc::driver::sys::{self, CUevent_flags, CUresult};
use cudarc::driver::{CudaContext, CudaEvent, DevicePtr as _, DeviceRepr, DriverError, ValidAsZeroBits};
use curitiba_pipeline::backend::BackendError;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Whether a GPU can read the memory of another directly. True if both are the same GPU.
pub(crate) fn reaches(device: &Device, other: &Device) -> bool {
    if device.context().ordinal() == other.context().ordinal() {
        return true;
    }
    let (own, its) = (device.context().cu_device(), other.context().cu_device());
    let mut reaches = 0;
    // SAFETY: writes one integer; both devices were opened.
    let asked = unsafe { sys::cuDeviceCanAccessPeer(&raw mut reaches, own, its) };
    asked == CUresult::CUDA_SUCCESS && reaches != 0
}

/// Lets a GPU read the memory of another; [`reaches`] must be true.
pub(crate) fn connect(device: &Device, other: &Device) -> Result<(), BackendError> {
    if device.context().ordinal() == other.context().ordinal() {
        return Ok(());
    }
    device.bind()?;
    let failed = |code| device.fault("opening the memory of another GPU", &DriverError(code));
    // SAFETY: the other context lives as long as `other`; the current context of this thread is that of `device`.
    match unsafe { sys::cuCtxEnablePeerAccess(other.context().cu_ctx(), 0) } {
        CUresult::CUDA_SUCCESS | CUresult::CUDA_ERROR_PEER_ACCESS_ALREADY_ENABLED => {}
        code => return Err(failed(code)),
    }
    if !other.context().has_async_alloc() {
        return Ok(());
    }
    // Stream-ordered allocations come from a pool, which peer access of contexts does not cover: without access to the pool, the driver would copy
    // through the host.
    let reader = sys::CUmemAccessDesc {
        location: sys::CUmemLocation {
            type_: sys::CUmemLocationType::CU_MEM_LOCATION_TYPE_DEVICE,
            id: device.context().cu_device(),
        },
        flags: sys::CUmemAccess_flags::CU_MEM_ACCESS_FLAGS_PROT_READWRITE,
    };
    let mut pool = std::ptr::null_mut();
    // SAFETY: writes one handle, of a pool that lives as long as the device.
    let found = unsafe { sys::cuDeviceGetDefaultMemPool(&raw mut pool, other.context().cu_device()) };
    if found != CUresult::CUDA_SUCCESS {
        return Err(failed(found));
    }
    // SAFETY: the pool was found; there is one description, which lives during the call.
    match unsafe { sys::cuMemPoolSetAccess(pool, &raw const reader, 1) } {
        CUresult::CUDA_SUCCESS => Ok(()),
        code => Err(failed(code)),
    }
}

/// Starts copying `length` values from an address to a buffer of the same GPU, which is enlarged if necessary. Returns the buffer's address.
/// For a `from` of 0, does nothing and returns 0.
///
/// # Safety
/// At `from` in the device's memory there must be `length` values, until the device's stream has completed the copy.
pub(crate) unsafe fn copy_here<T: DeviceRepr + ValidAsZeroBits>(
    device: &Device,
    what: &str,
    buffer: &mut Buffer<T>,
    from: Address,
    length: usize,
) -> Result<Address, BackendError> {
    if from == 0 {
        return Ok(0);
    }
    device.reserve(what, buffer, length)?;
    let to = buffer.address(device);
    if to != 0 {
        // SAFETY: by the contract of this function and `reserve`, both ranges are inside their memories; the buffer lives until the
        // stream was synchronised, which ends every pass that succeeds.
        let copied = unsafe { memcpy_dtod_async(to, from, length * size_of::<T>(), device.stream().cu_stream()) };
        copied.map_err(|error| device.fault(&format!("copying {what} for another GPU"), &error))?;
    }
    Ok(to)
}

/// A G-buffer in the memory of one GPU, to be copied by other GPUs. Once [`Self::ready`] has occurred, the G-buffer does not change as long as this
/// value lives.
#[derive(Debug)]
pub(crate) struct Lent {
    /// Context of the GPU that has the G-buffer.
    pub context: Arc<CudaContext>,
    /// Addresses of positions, normals, colours and triangle ids; 0 for those that are absent.
    pub attachments: [Address; 4],
    /// Event that occurs when the G-buffer is complete.
    pub ready: CudaEvent,
}

/// Copies in flight: the events before and after them.
#[derive(Debug)]
pub(crate) struct Copies(CudaEvent, CudaEvent);

impl Copies {
    /// Makes the device's stream wait until the G-buffer is complete, then calls `copy` to start the copies.
    pub fn start(
        device: &Device,
        lent: &Lent,
        copy: impl FnOnce() -> Result<(), BackendError>,
    ) -> Result<Self, BackendError> {
        let failed = |error| device.fault("waiting for another GPU", &error);
        let event = || device.stream().record_event(Some(CUevent_flags::CU_EVENT_DEFAULT)).map_err(failed);
        device.stream().wait(&lent.ready).map_err(failed)?;
        let start = event()?;
        copy()?;
        Ok(Self(start, event()?))
    }

    /// Waits for the end of the copies, and returns their duration.
    pub fn time(&self, device: &Device) -> Result<Duration, BackendError> {
        let time = self.0.elapsed_ms(&self.1);
        let milliseconds = time.map_err(|error| device.fault("copying from another GPU", &error))?;
        Ok(Duration::from_secs_f64(f64::from(milliseconds.max(0.0)) * 1e-3))
    }
}

/// Starts copying parts of `length` values from the memory of another GPU to the same places in a buffer, which is enlarged if necessary;
/// the rest of the buffer has no meaning.
///
/// # Safety
/// At `from` in the lender's memory there must be `length` values, until the device's stream has completed the copies.
pub(crate) unsafe fn copy_parts<T: DeviceRepr + ValidAsZeroBits>(
    device: &Device,
    what: &str,
    buffer: &mut Buffer<T>,
    (lender, from): (&CudaContext, Address),
    length: usize,
    parts: &[Range<usize>],
) -> Result<(), BackendError> {
    device.reserve(what, buffer, length)?;
    let Some(slice) = &mut buffer.0 else { return Ok(()) };
    let to = slice.device_ptr(device.stream()).0;
    let (own, its) = (device.context().cu_ctx(), lender.cu_ctx());
    for part in parts {
        assert!(part.start <= part.end && part.end <= length, "the part is inside the buffer");
        let (first, bytes) = ((part.start * size_of::<T>()) as u64, part.len() * size_of::<T>());
        // SAFETY: by the contract of this function and the assertion, both ranges are inside their memories; the buffer lives until
        // the stream was synchronised, which ends every pass that succeeds.
        let copied =
            unsafe { memcpy_peer_async(own, to + first, its, from + first, bytes, device.stream().cu_stream()) };
        copied.map_err(|error| device.fault(&format!("copying {what} from another GPU"), &error))?;
    }
    Ok(())
}
