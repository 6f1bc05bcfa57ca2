//! Textures and bindings of programs, and the sizes of dispatches.

use super::device::Gpu;

/// A texture with one mip level. Its memory is allocated if [`Gpu::check`] then finds no failure.
pub(crate) fn texture(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    size: [u32; 2],
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    texture_array(gpu, label, format, size, 1, usage)
}

/// An array of `layers` textures, as [`texture`].
pub(crate) fn texture_array(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    [width, height]: [u32; 2],
    layers: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// A whole buffer at a binding.
pub(crate) fn entry(binding: u32, buffer: &wgpu::Buffer) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
}

/// Dimensions of a dispatch of at least `groups` workgroups, each dimension at most `most`.
pub(crate) fn rectangle(groups: u32, most: u32) -> [u32; 2] {
    let across = groups.min(most);
    [across, groups.div_ceil(across.max(1))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_has_all_groups_and_no_row_too_many() {
        for (groups, most) in [(1, 65_535), (65_535, 65_535), (65_536, 65_535), (1 << 22, 65_535), (7, 3)] {
            let [across, down] = rectangle(groups, most);
            assert!(across <= most && down <= most && across * down >= groups && across * (down - 1) < groups);
        }
        assert_eq!(rectangle(0, 65_535), [0, 0]);
    }
}
