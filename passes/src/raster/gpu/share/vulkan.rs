//! Calls of the Vulkan interface beneath wgpu. They open a device that can export semaphores, and export memory and
//! semaphores as file descriptors. See the Vulkan 1.3 specification, chapters "Resource Creation" (external memory) and "Synchronization"
//! (external semaphores).
#![allow(unsafe_code, reason = "calls the driver; each block says why what it hands over is valid")]

use ash::{khr, vk};
use curitiba_pipeline::shared::DeviceUuid;
use std::os::fd::{FromRawFd as _, OwnedFd};
use wgpu::hal::api::Vulkan;

const MEMORY: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
const SEMAPHORE: vk::ExternalSemaphoreHandleTypeFlags = vk::ExternalSemaphoreHandleTypeFlags::OPAQUE_FD;

/// Opens the adapter so that its memory and semaphores can be exported. `None` if it is no Vulkan device, or cannot
/// export them.
pub fn open(
    adapter: &wgpu::Adapter,
    descriptor: &wgpu::DeviceDescriptor<'_>,
) -> Option<Result<(wgpu::Device, wgpu::Queue), String>> {
    let exports = wgpu::Features::VULKAN_EXTERNAL_MEMORY_FD;
    if !adapter.features().contains(exports) {
        return None;
    }
    // SAFETY: nothing is destroyed through the guard.
    let hal = unsafe { adapter.as_hal::<Vulkan>() }?;
    let extension = khr::external_semaphore_fd::NAME;
    if !hal.physical_device_capabilities().supports_extension(extension) {
        return None;
    }
    let descriptor =
        wgpu::DeviceDescriptor { required_features: descriptor.required_features | exports, ..descriptor.clone() };
    // SAFETY: features and limits are the adapter's own, and the one extension that is added is supported by it.
    let opened = unsafe {
        hal.open_with_callback(
            descriptor.required_features,
            &descriptor.required_limits,
            &descriptor.memory_hints,
            Some(Box::new(|arguments| arguments.extensions.push(extension))),
        )
    };
    drop(hal);
    Some(opened.map_err(|error| error.to_string()).and_then(|opened| {
        // SAFETY: the device was just opened on this adapter with these features.
        unsafe { adapter.create_device_from_hal(opened, &descriptor) }.map_err(|error| error.to_string())
    }))
}

/// The device's UUID, if it was opened by [`open`].
pub fn uuid(device: &wgpu::Device) -> Option<DeviceUuid> {
    // SAFETY: nothing is destroyed through the guard.
    let hal = unsafe { device.as_hal::<Vulkan>() }?;
    hal.enabled_device_extensions().contains(&khr::external_semaphore_fd::NAME).then(|| {
        let mut id = vk::PhysicalDeviceIDProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut id);
        // SAFETY: the physical device is of this instance, which is of Vulkan 1.1 or newer, as wgpu demands.
        unsafe {
            hal.shared_instance()
                .raw_instance()
                .get_physical_device_properties2(hal.raw_physical_device(), &mut properties);
        }
        id.device_uuid
    })
}

/// A buffer in memory of its own, the file descriptor of that memory, and the memory's size, which may exceed the
/// buffer's.
pub fn buffer(device: &wgpu::Device, bytes: u64) -> Result<(wgpu::Buffer, OwnedFd, u64), String> {
    let failed = |doing: &str, error: vk::Result| format!("{doing}: {error}");
    // SAFETY: nothing that wgpu owns is destroyed through the guard.
    let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or("the device is no Vulkan device")?;
    let (raw, instance) = (hal.raw_device(), hal.shared_instance().raw_instance());
    let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(MEMORY);
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_SRC;
    let info = vk::BufferCreateInfo::default().size(bytes).usage(usage).push_next(&mut external);
    // SAFETY: a valid description, and the size is not 0, which `Sharing::new` checks.
    let buffer = unsafe { raw.create_buffer(&info, None) }.map_err(|error| failed("creating the buffer", error))?;
    // SAFETY: the buffer is of this device; the physical device is of this instance.
    let (needs, memories) = unsafe {
        (
            raw.get_buffer_memory_requirements(buffer),
            instance.get_physical_device_memory_properties(hal.raw_physical_device()),
        )
    };
    let fits = |index: &u32| {
        let kind = memories.memory_types[*index as usize].property_flags;
        needs.memory_type_bits & (1 << index) != 0 && kind.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL)
    };
    let memory = (0..memories.memory_type_count).find(fits).ok_or("no device memory takes the buffer".to_owned());
    let bound = memory.and_then(|kind| {
        let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(MEMORY);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(kind)
            .push_next(&mut export);
        // SAFETY: a memory type of this device that the buffer takes.
        let memory = unsafe { raw.allocate_memory(&info, None) }.map_err(|error| failed("allocating memory", error))?;
        let get = vk::MemoryGetFdInfoKHR::default().memory(memory).handle_type(MEMORY);
        // SAFETY: memory and buffer are new and of one device, and the memory has the size that the buffer requires. wgpu enables the extension of
        // memory handles wherever it is supported, and `open` checked that it is.
        let handle = unsafe {
            raw.bind_buffer_memory(buffer, memory, 0)
                .and_then(|()| khr::external_memory_fd::Device::new(instance, raw).get_memory_fd(&get))
        };
        handle.map(|handle| (memory, handle)).map_err(|error| {
            // SAFETY: nothing else knows the memory yet.
            unsafe { raw.free_memory(memory, None) };
            failed("exporting the memory", error)
        })
    });
    let (memory, handle) = bound.inspect_err(|_| {
        // SAFETY: nothing else knows the buffer yet.
        unsafe { raw.destroy_buffer(buffer, None) }
    })?;
    // SAFETY: the descriptor is new and ours.
    let handle = unsafe { OwnedFd::from_raw_fd(handle) };
    let descriptor = wgpu::BufferDescriptor {
        label: Some("shared G-buffer"),
        size: bytes,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    };
    // SAFETY: wgpu takes over buffer and memory, which are bound to each other and unused, and destroys both.
    let buffer = unsafe {
        let hal_buffer = wgpu::hal::vulkan::Buffer::from_raw_managed(buffer, memory, 0, needs.size);
        drop(hal);
        device.create_buffer_from_hal::<Vulkan>(hal_buffer, &descriptor)
    };
    Ok((buffer, handle, needs.size))
}

/// A timeline semaphore that another interface can wait on and signal.
#[derive(Debug)]
pub struct Semaphore {
    device: wgpu::Device,
    raw: vk::Semaphore,
}

impl Semaphore {
    /// A semaphore with value 0, and its file descriptor.
    pub fn new(device: &wgpu::Device) -> Result<(Self, OwnedFd), String> {
        // SAFETY: nothing that wgpu owns is destroyed through the guard.
        let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or("the device is no Vulkan device")?;
        let raw = hal.raw_device();
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let mut export = vk::ExportSemaphoreCreateInfo::default().handle_types(SEMAPHORE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind).push_next(&mut export);
        let failed = |error: vk::Result| format!("making a shared semaphore: {error}");
        // SAFETY: a valid description; a device without timeline semaphores returns an error.
        let made = unsafe { raw.create_semaphore(&info, None) };
        let semaphore = Self { device: device.clone(), raw: made.map_err(failed)? };
        let functions = khr::external_semaphore_fd::Device::new(hal.shared_instance().raw_instance(), raw);
        let get = vk::SemaphoreGetFdInfoKHR::default().semaphore(semaphore.raw).handle_type(SEMAPHORE);
        // SAFETY: the extension was enabled by `open`, and the semaphore was made to be exported.
        let handle = unsafe { functions.get_semaphore_fd(&get) }.map_err(failed);
        drop(hal);
        // SAFETY: the descriptor is new and ours.
        Ok((semaphore, unsafe { OwnedFd::from_raw_fd(handle?) }))
    }

    /// Makes the next submission set the semaphore to `value`, which must be greater than all earlier values. False if
    /// the queue is no Vulkan queue.
    pub fn signal_after_next(&self, queue: &wgpu::Queue, value: u64) -> bool {
        // SAFETY: nothing is destroyed through the guard; `drop` destroys the semaphore only when the device is idle.
        let Some(hal) = (unsafe { queue.as_hal::<Vulkan>() }) else { return false };
        hal.add_signal_semaphore(self.raw, Some(value));
        true
    }

    /// Makes the next submission wait until the semaphore has at least `value`. False if the queue is no Vulkan queue.
    pub fn wait_before_next(&self, queue: &wgpu::Queue, value: u64) -> bool {
        // SAFETY: nothing is destroyed through the guard; `drop` destroys the semaphore only when the device is idle.
        let Some(hal) = (unsafe { queue.as_hal::<Vulkan>() }) else { return false };
        hal.add_wait_semaphore(self.raw, Some(value), vk::PipelineStageFlags::ALL_COMMANDS);
        true
    }
}

impl Drop for Semaphore {
    fn drop(&mut self) {
        // The result does not matter: a lost device signals nothing any more.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
        // SAFETY: nothing that wgpu owns is destroyed through the guard.
        if let Some(hal) = unsafe { self.device.as_hal::<Vulkan>() } {
            // SAFETY: all submissions that signal the semaphore or wait for it are done, and it is ours.
            unsafe { hal.raw_device().destroy_semaphore(self.raw, None) };
        }
    }
}
