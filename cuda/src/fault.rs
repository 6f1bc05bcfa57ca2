//! What a failed call of the driver means, and what to do about it.

use cudarc::driver::DriverError;
use cudarc::driver::sys::CUresult;
use curitiba_pipeline::backend::BackendError;

/// Whether a failure makes the device unusable for the rest of this process.
#[must_use]
pub fn loses_the_device(error: &DriverError) -> bool {
    matches!(
        error.0,
        CUresult::CUDA_ERROR_ILLEGAL_ADDRESS
            | CUresult::CUDA_ERROR_LAUNCH_TIMEOUT
            | CUresult::CUDA_ERROR_CONTEXT_IS_DESTROYED
            | CUresult::CUDA_ERROR_ASSERT
            | CUresult::CUDA_ERROR_HARDWARE_STACK_ERROR
            | CUresult::CUDA_ERROR_ILLEGAL_INSTRUCTION
            | CUresult::CUDA_ERROR_MISALIGNED_ADDRESS
            | CUresult::CUDA_ERROR_INVALID_ADDRESS_SPACE
            | CUresult::CUDA_ERROR_INVALID_PC
            | CUresult::CUDA_ERROR_LAUNCH_FAILED
            | CUresult::CUDA_ERROR_ECC_UNCORRECTABLE
            | CUresult::CUDA_ERROR_NVLINK_UNCORRECTABLE
            | CUresult::CUDA_ERROR_EXTERNAL_DEVICE
            | CUresult::CUDA_ERROR_MPS_CLIENT_TERMINATED
            | CUresult::CUDA_ERROR_UNKNOWN
    )
}

/// The error code with its number: `CUDA_ERROR_OUT_OF_MEMORY (2)`.
#[must_use]
pub fn code(error: &DriverError) -> String {
    format!("{:?} ({})", error.0, error.0 as u32)
}

/// The error for a failed call: what was being done, the code, what it means and what to do.
#[must_use]
pub fn fault(backend: &'static str, doing: &str, error: &DriverError) -> BackendError {
    BackendError::Device { backend, message: format!("{doing}: {}; {}", code(error), meaning(error)) }
}

/// What happened and what to do, for the codes that users may see.
fn meaning(error: &DriverError) -> &'static str {
    match error.0 {
        CUresult::CUDA_ERROR_OUT_OF_MEMORY => {
            "the GPU's memory is full: use a smaller scene or picture, or end other programs on the GPU"
        }
        CUresult::CUDA_ERROR_NO_DEVICE => "the driver finds no GPU: CUDA_VISIBLE_DEVICES may hide it",
        CUresult::CUDA_ERROR_INVALID_DEVICE => {
            "there is no GPU of this number: `nvidia-smi -L` lists them, counted from 0"
        }
        CUresult::CUDA_ERROR_DEVICE_UNAVAILABLE => {
            "another program holds the GPU for itself, or its compute mode forbids use: `nvidia-smi` shows both"
        }
        CUresult::CUDA_ERROR_OPERATING_SYSTEM => {
            "the system refuses the GPU: the device files /dev/nvidia* may be missing here or closed to this user"
        }
        CUresult::CUDA_ERROR_SYSTEM_NOT_READY => {
            "the GPU's services are not running: with NVSwitch, start nvidia-fabricmanager"
        }
        CUresult::CUDA_ERROR_SYSTEM_DRIVER_MISMATCH => {
            "the driver's library and its kernel module are of different releases: restart the machine after an update"
        }
        CUresult::CUDA_ERROR_STUB_LIBRARY => {
            "this libcuda is the toolkit's stub and no driver: take its folder out of LD_LIBRARY_PATH"
        }
        CUresult::CUDA_ERROR_UNSUPPORTED_PTX_VERSION | CUresult::CUDA_ERROR_COMPAT_NOT_SUPPORTED_ON_DEVICE => {
            "the driver is too old for the device programs: install release 580 or newer"
        }
        CUresult::CUDA_ERROR_INVALID_PTX | CUresult::CUDA_ERROR_NO_BINARY_FOR_GPU => {
            "the GPU is too old for the device programs: they need compute capability 7.5 or newer"
        }
        CUresult::CUDA_ERROR_JIT_COMPILER_NOT_FOUND => {
            "the driver's compiler is missing: install the complete driver (libnvidia-ptxjitcompiler)"
        }
        CUresult::CUDA_ERROR_LAUNCH_TIMEOUT => {
            "the system ended a kernel that ran too long, and with it all work of this program on the GPU: use fewer samples \
             or a smaller picture, or a GPU without a display"
        }
        CUresult::CUDA_ERROR_ECC_UNCORRECTABLE
        | CUresult::CUDA_ERROR_NVLINK_UNCORRECTABLE
        | CUresult::CUDA_ERROR_HARDWARE_STACK_ERROR => {
            "the GPU itself failed and is lost to this program: see the system's log, and restart the program or the machine"
        }
        _ if loses_the_device(error) => {
            "a kernel failed, and the GPU is lost to this program until it is started again: please report it, with the \
             project and the scene"
        }
        _ => "see the driver's documentation for this code",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_says_what_was_done_what_happened_and_what_to_do() {
        for (code, words) in [
            (CUresult::CUDA_ERROR_OUT_OF_MEMORY, ["memory is full", "smaller scene"]),
            (CUresult::CUDA_ERROR_NO_DEVICE, ["finds no GPU", "CUDA_VISIBLE_DEVICES"]),
            (CUresult::CUDA_ERROR_INVALID_DEVICE, ["no GPU of this number", "nvidia-smi"]),
            (CUresult::CUDA_ERROR_LAUNCH_TIMEOUT, ["ran too long", "fewer samples"]),
            (CUresult::CUDA_ERROR_UNSUPPORTED_PTX_VERSION, ["too old", "580"]),
            (CUresult::CUDA_ERROR_SYSTEM_DRIVER_MISMATCH, ["different releases", "restart"]),
            (CUresult::CUDA_ERROR_NO_BINARY_FOR_GPU, ["GPU is too old", "7.5"]),
            (CUresult::CUDA_ERROR_ECC_UNCORRECTABLE, ["GPU itself failed", "log"]),
            (CUresult::CUDA_ERROR_LAUNCH_FAILED, ["kernel failed", "started again"]),
            (CUresult::CUDA_ERROR_ILLEGAL_ADDRESS, ["kernel failed", "started again"]),
        ] {
            let text = fault("cuda", "running `ssao`", &DriverError(code)).to_string();
            let begin = format!("cuda: running `ssao`: {code:?} ({}); ", code as u32);
            assert!(text.starts_with(&begin) && words.iter().all(|word| text.contains(word)), "{text}");
        }
    }

    #[test]
    fn only_failures_of_the_device_itself_lose_it() {
        for code in
            [CUresult::CUDA_ERROR_OUT_OF_MEMORY, CUresult::CUDA_ERROR_NO_DEVICE, CUresult::CUDA_ERROR_INVALID_PTX]
        {
            assert!(!loses_the_device(&DriverError(code)), "{code:?}");
        }
        for code in [CUresult::CUDA_ERROR_LAUNCH_TIMEOUT, CUresult::CUDA_ERROR_ILLEGAL_ADDRESS] {
            assert!(loses_the_device(&DriverError(code)), "{code:?}");
        }
    }
}
