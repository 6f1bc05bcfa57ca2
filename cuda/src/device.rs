//! The driver and the device: found at run time, with faults that say what is missing.

use cudarc::driver::sys::{self, CUresult};
use cudarc::driver::{CudaContext, CudaSlice, CudaStream, DevicePtr as _, DeviceRepr, DriverError};
use curitiba_pipeline::backend::BackendError;
use std::sync::Arc;

/// An address in device memory; 0 is none.
pub type Address = u64;

/// The least driver interface that takes our PTX: version 9.0, of CUDA 13.0.
const LEAST_DRIVER: i32 = 13_000;
/// The driver release that brought it.
const LEAST_RELEASE: u32 = 580;

/// A GPU with its one stream.
#[derive(Debug, Clone)]
pub struct Device {
    context: Arc<CudaContext>,
    stream: Arc<CudaStream>,
    backend: &'static str,
    description: String,
}

impl Device {
    /// The first GPU.
    ///
    /// # Errors
    /// If there is no driver, an old one, or no GPU; says which, and what to do.
    pub fn first(backend: &'static str) -> Result<Self, BackendError> {
        let version = driver_version(backend)?;
        if version < LEAST_DRIVER {
            let found = format!("{}.{}", version / 1000, version % 1000 / 10);
            let why = format!(
                "NVIDIA's driver is too old: it offers CUDA {found}, and the device programs need 13.0; install driver \
                 {LEAST_RELEASE} or newer"
            );
            return Err(BackendError::Device { backend, message: why });
        }
        let context = CudaContext::new(0).map_err(|error| fault(backend, "opening the GPU", &error))?;
        let stream = context.default_stream();
        let described =
            describe(&context, version).map_err(|error| fault(backend, "asking the GPU its name", &error))?;
        Ok(Self { context, stream, backend, description: described })
    }

    /// Name, compute capability, memory and driver.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The stream on which everything runs.
    #[must_use]
    pub fn stream(&self) -> &Arc<CudaStream> {
        &self.stream
    }

    /// The context.
    #[must_use]
    pub fn context(&self) -> &Arc<CudaContext> {
        &self.context
    }

    /// What a failed call means, for a message.
    #[must_use]
    pub fn fault(&self, doing: &str, error: &DriverError) -> BackendError {
        fault(self.backend, doing, error)
    }

    /// Copies values to the device; nothing for none.
    ///
    /// # Errors
    /// If the device's memory does not hold them.
    pub fn upload<T: DeviceRepr>(&self, what: &str, values: &[T]) -> Result<Buffer<T>, BackendError> {
        if values.is_empty() {
            return Ok(Buffer::default());
        }
        let slice = self.stream.clone_htod(values);
        Ok(Buffer(Some(slice.map_err(|error| self.fault(&copying(what, size_of_val(values)), &error))?)))
    }

    /// Copies values into a buffer, which is made larger if it must be.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn replace<T: DeviceRepr>(&self, what: &str, buffer: &mut Buffer<T>, values: &[T]) -> Result<(), BackendError> {
        match &mut buffer.0 {
            Some(slice) if slice.len() >= values.len() && !values.is_empty() => {
                let copied = self.stream.memcpy_htod(values, slice);
                copied.map_err(|error| self.fault(&copying(what, size_of_val(values)), &error))
            }
            _ => {
                buffer.0 = None;
                *buffer = self.upload(what, values)?;
                Ok(())
            }
        }
    }
}

fn copying(what: &str, bytes: usize) -> String {
    format!("copying {what} ({:.1} MiB) to the device", bytes as f64 / f64::from(1 << 20))
}

/// Device memory, or none.
#[derive(Debug)]
pub struct Buffer<T>(pub(crate) Option<CudaSlice<T>>);

impl<T> Default for Buffer<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: DeviceRepr> Buffer<T> {
    /// Where it is; 0 if there is none. Valid for work on the device's own stream as long as the buffer lives.
    #[must_use]
    pub fn address(&self, device: &Device) -> Address {
        self.0.as_ref().map_or(0, |slice| slice.device_ptr(&device.stream).0)
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.as_ref().map_or(0, |slice| slice.num_bytes() as u64)
    }
}

#[allow(unsafe_code, reason = "asks whether the driver's library is there, and for its version")]
fn driver_version(backend: &'static str) -> Result<i32, BackendError> {
    // SAFETY: loads the driver's library, whose initialisers are NVIDIA's, and lets it go again.
    if !unsafe { sys::is_culib_present() } {
        let library = if cfg!(windows) { "nvcuda.dll" } else { "libcuda.so.1" };
        let why = format!(
            "there is no NVIDIA driver here: {library} was not found; install driver {LEAST_RELEASE} or newer, or use \
             --backend cpu"
        );
        return Err(BackendError::Device { backend, message: why });
    }
    let mut version = 0;
    // SAFETY: the library is there, and the function writes one integer; it needs no initialisation and exists since CUDA 2.
    let result = unsafe { sys::cuDriverGetVersion(&raw mut version) };
    match result {
        CUresult::CUDA_SUCCESS => Ok(version),
        other => Err(fault(backend, "asking the driver its version", &DriverError(other))),
    }
}

fn describe(context: &CudaContext, driver: i32) -> Result<String, DriverError> {
    let (major, minor) = context.compute_capability()?;
    let memory = context.total_mem()? as f64 / f64::from(1 << 30);
    let release = kernel_driver_release().map_or(String::new(), |release| format!("driver {release}, "));
    Ok(format!(
        "{}, compute capability {major}.{minor}, {memory:.0} GiB; {release}CUDA {}.{}",
        context.name()?,
        driver / 1000,
        driver % 1000 / 10
    ))
}

/// The release number of NVIDIA's kernel driver, where the system tells it.
fn kernel_driver_release() -> Option<String> {
    let text = std::fs::read_to_string("/sys/module/nvidia/version").ok().or_else(|| {
        let text = std::fs::read_to_string("/proc/driver/nvidia/version").ok()?;
        let version = |word: &&str| word.contains('.') && word.chars().all(|c| c.is_ascii_digit() || c == '.');
        text.split_whitespace().find(version).map(str::to_owned)
    })?;
    Some(text.trim().to_owned())
}

/// What a driver's error means here.
pub(crate) fn fault(backend: &'static str, doing: &str, error: &DriverError) -> BackendError {
    let code = error.0;
    let remedy = match code {
        CUresult::CUDA_ERROR_OUT_OF_MEMORY => {
            "the device's memory is full: use a smaller scene or picture, or end other programs on the GPU"
        }
        CUresult::CUDA_ERROR_NO_DEVICE => "the driver finds no GPU: CUDA_VISIBLE_DEVICES may hide it",
        CUresult::CUDA_ERROR_UNSUPPORTED_PTX_VERSION => {
            "the driver is too old for the device programs: install 580 or newer"
        }
        CUresult::CUDA_ERROR_INVALID_PTX | CUresult::CUDA_ERROR_NO_BINARY_FOR_GPU => {
            "the GPU is too old for the device programs: they need compute capability 7.5 or newer"
        }
        CUresult::CUDA_ERROR_LAUNCH_TIMEOUT => {
            "the display driver ended a kernel that ran too long: use fewer samples or a smaller picture, or a GPU without a display"
        }
        CUresult::CUDA_ERROR_ECC_UNCORRECTABLE | CUresult::CUDA_ERROR_HARDWARE_STACK_ERROR => {
            "the GPU failed: see the system's log"
        }
        CUresult::CUDA_ERROR_ILLEGAL_ADDRESS | CUresult::CUDA_ERROR_LAUNCH_FAILED => {
            "a kernel failed, and this device cannot be used again before the program is restarted: please report it"
        }
        _ => "see the driver's documentation for this code",
    };
    let name = format!("{code:?}");
    BackendError::Device { backend, message: format!("{doing}: {name} ({}); {remedy}", code as u32) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_name_what_was_done_and_what_helps() {
        let full = fault("cuda", "copying the tree", &DriverError(CUresult::CUDA_ERROR_OUT_OF_MEMORY)).to_string();
        assert!(full.contains("copying the tree") && full.contains("smaller scene"), "{full}");
        let slow = fault("cuda", "pass", &DriverError(CUresult::CUDA_ERROR_LAUNCH_TIMEOUT)).to_string();
        assert!(slow.contains("fewer samples"), "{slow}");
    }

    #[test]
    fn a_machine_without_a_driver_is_told_which_library_is_missing() {
        match Device::first("cuda") {
            Ok(device) => println!("skipped: this machine has a GPU: {}", device.description()),
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("driver") && text.starts_with("cuda: "), "{text}");
            }
        }
    }
}
