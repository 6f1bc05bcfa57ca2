//! G-buffers that the rasteriser shares: the memory and the semaphore of each G-buffer, opened in CUDA.
//!
//! CUDA driver API, "External Resource Interoperability". Only for systems with file descriptors; on others nothing is shared.

use crate::device::{Address, Device};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::shared::{DeviceUuid, SharedGBuffer};

/// Whether the device has that UUID; false on systems on which nothing is shared.
pub(crate) fn is_on(device: &Device, uuid: DeviceUuid) -> bool {
    cfg!(unix) && device.context().uuid().is_ok_and(|own| own.bytes.map(|byte| byte as u8) == uuid)
}

#[cfg(unix)]
pub(crate) use opened::Joined;

#[cfg(unix)]
mod opened {
    #![allow(
        unsafe_code,
        reason = "opens memory and a semaphore of another interface; each block says why that is sound"
    )]

    use super::{Address, BackendError, Device, SharedGBuffer};
    use cudarc::driver::{DevicePtr as _, MappedBuffer, sys};
    use curitiba_pipeline::shared::Offsets;
    use std::fs::File;
    use std::mem::MaybeUninit;
    use std::os::fd::{AsRawFd as _, IntoRawFd as _};

    /// A G-buffer that the rasteriser fills.
    #[derive(Debug)]
    pub(crate) struct Joined {
        memory: MappedBuffer,
        semaphore: Semaphore,
        size: [u32; 2],
        offsets: Offsets,
    }

    #[derive(Debug)]
    struct Semaphore {
        raw: sys::CUexternalSemaphore,
        device: Device,
    }

    // SAFETY: the handles belong to the context, not to a thread, and are used by one thread at a time.
    unsafe impl Send for Joined {}

    impl Joined {
        pub fn open(device: &Device, shared: SharedGBuffer) -> Result<Self, BackendError> {
            let doing = "opening the rasteriser's G-buffer";
            let failed = |error| device.fault(doing, &error);
            let offsets = Offsets::new(shared.width, shared.height, shared.attachments, shared.picture);
            device.bind()?;
            // SAFETY: the handle is of device memory of `bytes` bytes, as `SharedGBuffer` documents.
            let memory = unsafe { device.context().import_external_memory(File::from(shared.memory), shared.bytes) };
            let memory = memory.and_then(cudarc::driver::ExternalMemory::map_all).map_err(failed)?;
            let description = sys::CUDA_EXTERNAL_SEMAPHORE_HANDLE_DESC {
                type_: sys::CUexternalSemaphoreHandleType::CU_EXTERNAL_SEMAPHORE_HANDLE_TYPE_TIMELINE_SEMAPHORE_FD,
                handle: sys::CUDA_EXTERNAL_SEMAPHORE_HANDLE_DESC_st__bindgen_ty_1 { fd: shared.semaphore.as_raw_fd() },
                flags: 0,
                reserved: [0; 16],
            };
            let mut raw = MaybeUninit::uninit();
            // SAFETY: the handle is of a timeline semaphore, and the description lives during the call.
            let opened = unsafe { sys::cuImportExternalSemaphore(raw.as_mut_ptr(), &raw const description).result() };
            opened.map_err(failed)?;
            // The driver owns the file descriptor now.
            let _ = shared.semaphore.into_raw_fd();
            // SAFETY: the call succeeded, which wrote the handle.
            let semaphore = Semaphore { raw: unsafe { raw.assume_init() }, device: device.clone() };
            Ok(Self { memory, semaphore, size: [shared.width, shared.height], offsets })
        }

        /// Whether the G-buffer has that size.
        pub fn has_size(&self, width: u32, height: u32) -> bool {
            self.size == [width, height]
        }

        /// Addresses of positions, normals, colours and triangle ids; 0 for those that are not shared.
        pub fn attachments(&self, device: &Device) -> [Address; 4] {
            let (memory, at) = (self.memory.device_ptr(device.stream()).0, self.offsets);
            [at.position, at.normal, at.color, at.triangle].map(|offset| offset.map_or(0, |offset| memory + offset))
        }

        /// Address of the room for the picture of a pass; `None` if the shared memory has no such room.
        pub fn picture(&self, device: &Device) -> Option<Address> {
            self.offsets.picture.map(|offset| self.memory.device_ptr(device.stream()).0 + offset)
        }

        /// Makes the stream set the semaphore to `value` once all earlier work of the stream is done. `value` must be greater than all earlier
        /// values.
        pub fn signal(&self, device: &Device, value: u64) -> Result<(), BackendError> {
            // SAFETY: plain numbers and unions of plain numbers, for which zeros are valid.
            let mut parameters: sys::CUDA_EXTERNAL_SEMAPHORE_SIGNAL_PARAMS = unsafe { std::mem::zeroed() };
            parameters.params.fence.value = value;
            let stream = device.stream().cu_stream();
            // SAFETY: one semaphore and one parameter, both alive during the call; the stream is of this device.
            let signals = unsafe {
                sys::cuSignalExternalSemaphoresAsync(&raw const self.semaphore.raw, &raw const parameters, 1, stream)
                    .result()
            };
            signals.map_err(|error| device.fault("handing the picture to the rasteriser", &error))
        }

        /// Makes the stream wait until the semaphore has reached `value`.
        pub fn wait(&self, device: &Device, value: u64) -> Result<(), BackendError> {
            // SAFETY: plain numbers and unions of plain numbers, for which zeros are valid.
            let mut parameters: sys::CUDA_EXTERNAL_SEMAPHORE_WAIT_PARAMS = unsafe { std::mem::zeroed() };
            parameters.params.fence.value = value;
            let stream = device.stream().cu_stream();
            // SAFETY: one semaphore and one parameter, both alive during the call; the stream is of this device.
            let waits = unsafe {
                sys::cuWaitExternalSemaphoresAsync(&raw const self.semaphore.raw, &raw const parameters, 1, stream)
                    .result()
            };
            waits.map_err(|error| device.fault("waiting for the rasteriser", &error))
        }
    }

    impl Drop for Semaphore {
        fn drop(&mut self) {
            // If the device was lost, there is nothing left to release.
            if self.device.bind().is_ok() {
                // SAFETY: the semaphore is ours, and no wait of our stream is pending: a pass that succeeds ends with a synchronised stream.
                let _ = unsafe { sys::cuDestroyExternalSemaphore(self.raw).result() };
            }
        }
    }
}

/// On systems without file descriptors nothing is shared, so this type has no values.
#[cfg(not(unix))]
#[derive(Debug)]
pub(crate) enum Joined {}

#[cfg(not(unix))]
impl Joined {
    pub fn open(_: &Device, shared: SharedGBuffer) -> Result<Self, BackendError> {
        match shared.memory {}
    }

    pub fn has_size(&self, _: u32, _: u32) -> bool {
        match *self {}
    }

    pub fn attachments(&self, _: &Device) -> [Address; 4] {
        match *self {}
    }

    pub fn picture(&self, _: &Device) -> Option<Address> {
        match *self {}
    }

    pub fn signal(&self, _: &Device, _: u64) -> Result<(), BackendError> {
        match *self {}
    }

    pub fn wait(&self, _: &Device, _: u64) -> Result<(), BackendError> {
        match *self {}
    }
}
