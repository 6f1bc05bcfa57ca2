//! The driver and the device, found at run time; errors say what is missing.

use crate::fault::{code, fault, loses_the_device};
use cudarc::driver::sys::{self, CUresult};
use cudarc::driver::{CudaContext, CudaSlice, CudaStream, DevicePtr as _, DeviceRepr, DriverError, ValidAsZeroBits};
use curitiba_pipeline::backend::{BackendError, Gpu};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// An address in device memory; 0 means none.
pub type Address = u64;

/// The oldest driver interface that accepts our PTX, which has version 9.0: that of CUDA 13.0.
const LEAST_DRIVER: i32 = 13_000;
/// The first driver release with that interface.
const LEAST_RELEASE: u32 = 580;

/// The least compute capability that the device programs are compiled for.
const LEAST_CAPABILITY: (i32, i32) = (7, 5);

/// The environment variable that names the GPUs to use.
const GPUS_VARIABLE: &str = "CURITIBA_GPUS";

/// The numbers of the GPUs to use, counted from 0 as the driver does; `wanted` of them, or all for `None`. The variable `CURITIBA_GPUS` may list
/// the GPUs (`1,3`), in this order; a GPU that it names twice is used as if it were two. Without the variable, one wanted GPU is GPU 0, and the
/// driver is not called.
///
/// # Errors
/// If the variable is no list of numbers, there is no driver, the driver is too old, or there are fewer GPUs than wanted.
pub fn ordinals(backend: &'static str, wanted: Option<usize>) -> Result<Vec<usize>, BackendError> {
    let listed = match std::env::var(GPUS_VARIABLE) {
        Ok(text) => Some(listed(&text).map_err(|message| BackendError::Device { backend, message })?),
        Err(_) => None,
    };
    if wanted == Some(1) && listed.is_none() {
        return Ok(vec![0]);
    }
    sufficient_driver(backend)?;
    let count = CudaContext::device_count().map_err(|error| fault(backend, "counting the GPUs", &error))?;
    chosen(&listed.unwrap_or_else(|| (0..count.unsigned_abs() as usize).collect()), wanted)
        .map_err(|message| BackendError::Device { backend, message })
}

/// Parses a list of numbers such as `0,2`.
fn listed(text: &str) -> Result<Vec<usize>, String> {
    let numbers = text.split(',').map(|number| number.trim().parse::<usize>());
    numbers
        .collect::<Result<Vec<_>, _>>()
        .map_err(|_| format!("{GPUS_VARIABLE} is `{text}`; valid: numbers of GPUs with commas between, such as 0,1"))
}

/// The first `wanted` of the GPUs `there`; all of them for `None`.
fn chosen(there: &[usize], wanted: Option<usize>) -> Result<Vec<usize>, String> {
    let wanted = wanted.unwrap_or(there.len()).max(1);
    if wanted > there.len() {
        let are = if there.len() == 1 { "is 1" } else { &format!("are {}", there.len()) };
        return Err(format!("{wanted} GPUs were asked for, and there {are}: use fewer, or --gpus all"));
    }
    Ok(there[..wanted].to_vec())
}

/// A GPU with its one stream.
#[derive(Debug, Clone)]
pub struct Device {
    context: Arc<CudaContext>,
    stream: Arc<CudaStream>,
    backend: &'static str,
    gpu: Gpu,
    /// Prefix of messages where there are several GPUs; else empty.
    place: String,
    /// How the device was lost; unset while it works. Nothing runs on a lost device.
    lost: Arc<OnceLock<String>>,
}

impl Device {
    /// The first GPU.
    ///
    /// # Errors
    /// As [`Self::on`].
    pub fn first(backend: &'static str) -> Result<Self, BackendError> {
        Self::on(backend, 0, false)
    }

    /// The GPU of a number. With `several`, messages name the GPU.
    ///
    /// # Errors
    /// If there is no driver, the driver is too old, there is no such GPU, or the GPU is too old; the message says which, and what to do.
    pub fn on(backend: &'static str, ordinal: usize, several: bool) -> Result<Self, BackendError> {
        let version = sufficient_driver(backend)?;
        let place = if several { format!("GPU {ordinal}: ") } else { String::new() };
        let opening = |error| fault(backend, &format!("{place}opening the GPU"), &error);
        let context = CudaContext::new(ordinal).map_err(opening)?;
        let stream = own_stream(&context).map_err(opening)?;
        let asking = |error| fault(backend, &format!("{place}asking the GPU its name"), &error);
        let capability = context.compute_capability().map_err(asking)?;
        if capability < LEAST_CAPABILITY {
            let (major, minor) = capability;
            let message = format!(
                "{place}the GPU is too old: it has compute capability {major}.{minor}, and the device programs need 7.5 or newer; \
                 use --backend cpu"
            );
            return Err(BackendError::Device { backend, message });
        }
        let gpu = describe(&context, capability, version).map_err(asking)?;
        Ok(Self { context, stream, backend, gpu, place, lost: Arc::default() })
    }

    /// Name, compute capability and memory of the GPU; driver and CUDA version.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Makes the device current for this thread.
    ///
    /// # Errors
    /// If the device was lost or cannot be used.
    pub fn bind(&self) -> Result<(), BackendError> {
        if self.lost.get().is_some() {
            return Err(self.lost_before("using the GPU"));
        }
        self.context.bind_to_thread().map_err(|error| self.fault("using the GPU", &error))
    }

    /// The stream on which all work of the device runs.
    #[must_use]
    pub fn stream(&self) -> &Arc<CudaStream> {
        &self.stream
    }

    /// The CUDA context of the device.
    #[must_use]
    pub fn context(&self) -> &Arc<CudaContext> {
        &self.context
    }

    /// Number of multiprocessors.
    ///
    /// # Errors
    /// If the driver does not report it.
    pub fn multiprocessors(&self) -> Result<u32, DriverError> {
        let attribute = sys::CUdevice_attribute::CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT;
        Ok(self.context.attribute(attribute)?.unsigned_abs())
    }

    /// The error for a failed call. Once the device is lost, the error of every later call says so.
    #[must_use]
    pub fn fault(&self, doing: &str, error: &DriverError) -> BackendError {
        if self.lost.get().is_some() {
            return self.lost_before(doing);
        }
        if loses_the_device(error) {
            // Another thread may have recorded the loss of the same device first.
            let _ = self.lost.set(format!("{doing}: {}", code(error)));
        }
        let mut doing = format!("{}{doing}", self.place);
        if error.0 == CUresult::CUDA_ERROR_OUT_OF_MEMORY
            && let Ok((free, total)) = self.context.mem_get_info()
        {
            doing += &format!(" with {} of {} free", mebibytes(free), mebibytes(total));
        }
        fault(self.backend, &doing, error)
    }

    fn lost_before(&self, doing: &str) -> BackendError {
        let (place, how) = (&self.place, self.lost.get().map_or("", String::as_str));
        let message = format!(
            "{place}{doing}: the GPU was lost before ({how}), and nothing runs on it until this program is started again"
        );
        BackendError::Device { backend: self.backend, message }
    }

    /// Copies values to the device. Without values the buffer is empty.
    ///
    /// # Errors
    /// If the values do not fit into the device's memory.
    pub fn upload<T: DeviceRepr>(&self, what: &str, values: &[T]) -> Result<Buffer<T>, BackendError> {
        if values.is_empty() {
            return Ok(Buffer::default());
        }
        let slice = self.stream.clone_htod(values);
        Ok(Buffer(Some(slice.map_err(|error| self.fault(&copying(what, size_of_val(values)), &error))?)))
    }

    /// Copies values into a buffer, which is enlarged if necessary.
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

    /// Copies several lists into a buffer, one behind the other, and returns the address of each. The buffer is enlarged if necessary.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn replace_all<T: DeviceRepr + ValidAsZeroBits>(
        &self,
        what: &str,
        buffer: &mut Buffer<T>,
        lists: &[&[T]],
    ) -> Result<Vec<Address>, BackendError> {
        let length: usize = lists.iter().map(|list| list.len()).sum();
        if length == 0 {
            *buffer = Buffer::default();
            return Ok(vec![0; lists.len()]);
        }
        self.reserve(what, buffer, length)?;
        let (first, mut addresses, mut place) = (buffer.address(self), Vec::with_capacity(lists.len()), 0);
        for list in lists {
            addresses.push(first + (place * size_of::<T>()) as Address);
            if let Some(slice) = buffer.0.as_mut().filter(|_| !list.is_empty()) {
                let copied = self.stream.memcpy_htod(*list, &mut slice.slice_mut(place..place + list.len()));
                copied.map_err(|error| self.fault(&copying(what, size_of_val(*list)), &error))?;
            }
            place += list.len();
        }
        Ok(addresses)
    }

    /// Makes a buffer hold at least `length` values. Its contents are lost if it must be enlarged.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn reserve<T: DeviceRepr + ValidAsZeroBits>(
        &self,
        what: &str,
        buffer: &mut Buffer<T>,
        length: usize,
    ) -> Result<(), BackendError> {
        if buffer.0.as_ref().is_none_or(|slice| slice.len() < length) {
            buffer.0 = None;
            let made = self.stream.alloc_zeros(length);
            let making = || format!("making room for {what} ({})", mebibytes(length * size_of::<T>()));
            buffer.0 = Some(made.map_err(|error| self.fault(&making(), &error))?);
        }
        Ok(())
    }

    /// Makes a buffer hold at least `length` values, and fills it with zeros.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn clear<T: DeviceRepr + ValidAsZeroBits>(
        &self,
        what: &str,
        buffer: &mut Buffer<T>,
        length: usize,
    ) -> Result<(), BackendError> {
        self.reserve(what, buffer, length)?;
        let Some(slice) = &mut buffer.0 else { return Ok(()) };
        self.stream.memset_zeros(slice).map_err(|error| self.fault(&format!("clearing {what}"), &error))
    }

    /// Copies the ranges `parts` of `values` to the same indices of a buffer, which is enlarged to hold all values if necessary; values
    /// outside the ranges have no meaning.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn replace_parts<T: DeviceRepr + ValidAsZeroBits>(
        &self,
        what: &str,
        buffer: &mut Buffer<T>,
        values: &[T],
        parts: &[Range<usize>],
    ) -> Result<(), BackendError> {
        if values.is_empty() || matches!(parts, [whole] if *whole == (0..values.len())) {
            return self.replace(what, buffer, values);
        }
        let failed = |error| self.fault(&copying(what, size_of_val(values)), &error);
        self.reserve(what, buffer, values.len())?;
        if let Some(slice) = &mut buffer.0 {
            for part in parts {
                self.stream.memcpy_htod(&values[part.clone()], &mut slice.slice_mut(part.clone())).map_err(failed)?;
            }
        }
        Ok(())
    }
}

/// A stream of our own: copies between two GPUs on their default streams would wait for all work of both GPUs.
#[allow(unsafe_code, reason = "switches the ordering of several streams off")]
fn own_stream(context: &Arc<CudaContext>) -> Result<Arc<CudaStream>, DriverError> {
    // SAFETY: everything of this context runs on the one stream that is made here, in the order in which it is called.
    unsafe { context.disable_event_tracking() };
    context.new_stream()
}

fn copying(what: &str, bytes: usize) -> String {
    format!("copying {what} ({}) to the device", mebibytes(bytes))
}

fn mebibytes(bytes: usize) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// A buffer in device memory; `None` if it is empty.
#[derive(Debug)]
pub struct Buffer<T>(pub(crate) Option<CudaSlice<T>>);

impl<T> Default for Buffer<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        if let Some(slice) = self.0.take() {
            // The memory is released on the stream of its own device, so that device must be current for this thread. The first call may
            // report an earlier failure instead, hence the second; if that fails too, the memory is released with the device.
            let _ = slice.context().bind_to_thread().or_else(|_| slice.context().bind_to_thread());
        }
    }
}

impl<T: DeviceRepr> Buffer<T> {
    /// Address of the buffer; 0 if it is empty. Valid for work on the device's own stream as long as the buffer lives.
    #[must_use]
    pub fn address(&self, device: &Device) -> Address {
        self.0.as_ref().map_or(0, |slice| slice.device_ptr(&device.stream).0)
    }

    /// Size in bytes; 0 if the buffer is empty.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.as_ref().map_or(0, |slice| slice.num_bytes() as u64)
    }
}

#[allow(unsafe_code, reason = "asks whether the driver's library is there, and for its version")]
fn driver_version(backend: &'static str) -> Result<i32, BackendError> {
    // SAFETY: loads the driver's library, whose initialisers are NVIDIA's, and unloads it.
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

/// The version of the driver, if it is new enough for our programs; else an error.
fn sufficient_driver(backend: &'static str) -> Result<i32, BackendError> {
    let version = driver_version(backend)?;
    if version < LEAST_DRIVER {
        let found = format!("{}.{}", version / 1000, version % 1000 / 10);
        let message = format!(
            "NVIDIA's driver is too old: it offers CUDA {found}, and the device programs need 13.0; install driver \
             {LEAST_RELEASE} or newer, or use --backend cpu"
        );
        return Err(BackendError::Device { backend, message });
    }
    Ok(version)
}

fn describe(context: &CudaContext, (major, minor): (i32, i32), driver: i32) -> Result<Gpu, DriverError> {
    let memory = context.total_mem()? as f64 / f64::from(1 << 30);
    let release = kernel_driver_release().map_or(String::new(), |release| format!("driver {release}, "));
    Ok(Gpu {
        name: format!("{}, compute capability {major}.{minor}, {memory:.0} GiB", context.name()?),
        driver: format!("{release}CUDA {}.{}", driver / 1000, driver % 1000 / 10),
    })
}

/// The release number of NVIDIA's kernel driver, if the system reports it.
fn kernel_driver_release() -> Option<String> {
    let text = std::fs::read_to_string("/sys/module/nvidia/version").ok().or_else(|| {
        let text = std::fs::read_to_string("/proc/driver/nvidia/version").ok()?;
        let version = |word: &&str| word.contains('.') && word.chars().all(|c| c.is_ascii_digit() || c == '.');
        text.split_whitespace().find(version).map(str::to_owned)
    })?;
    Some(text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gpus_are_the_first_of_those_that_are_there_or_listed() {
        assert_eq!(listed("0, 2,2"), Ok(vec![0, 2, 2]));
        assert!(listed("0;1").expect_err("no list").contains("such as 0,1"));
        assert_eq!(chosen(&[0, 1, 2], None), Ok(vec![0, 1, 2]));
        assert_eq!(chosen(&[3, 1], Some(1)), Ok(vec![3]));
        let why = chosen(&[0], Some(2)).expect_err("too many");
        assert!(why.contains("2 GPUs were asked for, and there is 1"), "{why}");
        assert!(chosen(&[], None).is_err());
    }

    #[test]
    fn a_machine_without_a_driver_is_told_which_library_is_missing() {
        match Device::first("cuda") {
            Ok(device) => println!("skipped: this machine has a GPU: {}", device.gpu().name),
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("driver") && text.starts_with("cuda: "), "{text}");
            }
        }
    }
}
