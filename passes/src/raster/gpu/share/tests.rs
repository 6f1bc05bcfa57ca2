//! Shared G-buffers are bit for bit those that are read back.

use super::super::tests::{ALL, SIZE, job, rasteriser, shades, squares};
use super::memory::Packer;
use crate::raster::gpu::WgpuRasteriser;
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::{Attachments, GBuffer, RasterJob, Rasteriser as _};
use curitiba_pipeline::shared::Offsets;

/// Reads the bytes of a buffer back.
fn read(gpu: &Gpu, buffer: &wgpu::Buffer) -> Vec<u8> {
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let staging = gpu.buffer("test", usage, buffer.size()).expect("room");
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None });
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    let mut bytes = Vec::new();
    gpu.read_mapped(&staging, buffer.size(), Some(encoder.finish()), "test", |mapped| bytes.extend_from_slice(mapped))
        .expect("readable");
    bytes
}

/// Draws a picture of squares, reads it back, and returns the G-buffer.
fn drawn(rasteriser: &mut WgpuRasteriser) -> GBuffer {
    drawn_as(rasteriser, Attachments::default())
}

/// As [`drawn`], with some attachments as 16-bit floats.
fn drawn_as(rasteriser: &mut WgpuRasteriser, half: Attachments) -> GBuffer {
    let (scene, shades) = (squares(12), shades());
    let job = RasterJob { half, ..job(&scene, &shades) };
    let mut target = GBuffer::new(SIZE, SIZE, ALL);
    rasteriser.upload(&scene).expect("uploaded");
    rasteriser.draw(&job, &mut target).expect("drawn");
    rasteriser.read_back(&job, ALL, &mut target).expect("read");
    target
}

fn assert_holds(bytes: &[u8], wanted: Attachments, shared: Attachments, expected: &GBuffer) {
    let offsets = Offsets::new(SIZE, SIZE, shared, false);
    let mut compared = 0;
    let mut compare = |wanted: bool, offset: Option<u64>, expected: &[u8]| {
        if wanted {
            let start = offset.expect("shared") as usize;
            assert!(bytes[start..start + expected.len()] == *expected, "the attachment at byte {start}");
            compared += 1;
        }
    };
    compare(wanted.color, offsets.color, bytemuck::cast_slice(&expected.color));
    compare(wanted.position, offsets.position, bytemuck::cast_slice(&expected.position));
    compare(wanted.normal, offsets.normal, bytemuck::cast_slice(&expected.normal));
    compare(wanted.triangle, offsets.triangle, bytemuck::cast_slice(&expected.triangle));
    assert!(compared > 0);
}

#[test]
fn attachments_are_written_dense_and_one_after_the_other() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let expected = drawn(&mut rasteriser);
    let shared = Attachments { normal: false, ..ALL };
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let buffer = rasteriser.gpu.buffer("test", usage, Offsets::new(SIZE, SIZE, shared, false).end).expect("room");
    let mut packer = Packer::new(buffer, [SIZE, SIZE], shared);
    let color = Attachments { color: true, ..Attachments::default() };
    let ids = Attachments { position: true, triangle: true, ..Attachments::default() };
    for wanted in [color, ids, shared] {
        let targets = rasteriser.targets.last().expect("drawn");
        let mut encoder = rasteriser.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        packer.encode(&rasteriser.gpu, None, targets, wanted, &mut encoder).expect("encoded");
        rasteriser.gpu.submit_and_wait(Some(encoder.finish()), "test").expect("done");
        assert_holds(&read(&rasteriser.gpu, &packer.buffer), wanted, shared, &expected);
    }
    let targets = rasteriser.targets.last().expect("drawn");
    let mut encoder = rasteriser.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let refused = packer.encode(&rasteriser.gpu, None, targets, ALL, &mut encoder);
    let error = refused.expect_err("normals are not shared").to_string();
    assert!(error.contains("handed over"), "{error}");
}

#[test]
fn attachments_in_16_bit_floats_are_handed_over_in_32() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let full = drawn(&mut rasteriser);
    let expected = drawn_as(&mut rasteriser, Attachments { color: true, position: true, ..Attachments::default() });
    assert!(full.position != expected.position, "control: something was rounded");
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let buffer = rasteriser.gpu.buffer("test", usage, Offsets::new(SIZE, SIZE, ALL, false).end).expect("room");
    let mut packer = Packer::new(buffer, [SIZE, SIZE], ALL);
    let targets = rasteriser.targets.last().expect("drawn");
    let mut encoder = rasteriser.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    packer.encode(&rasteriser.gpu, None, targets, ALL, &mut encoder).expect("encoded");
    rasteriser.gpu.submit_and_wait(Some(encoder.finish()), "test").expect("done");
    assert_holds(&read(&rasteriser.gpu, &packer.buffer), ALL, ALL, &expected);
}

#[test]
fn a_device_that_shares_memory_hands_over_what_it_drew() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let expected = drawn(&mut rasteriser);
    if rasteriser.shares().is_none() {
        println!("skipped: {} exports no memory and semaphores", rasteriser.device());
        return;
    }
    let shared = match rasteriser.share(SIZE, SIZE, ALL, true) {
        Ok(shared) => shared,
        // Software drivers have no memory that counts as the device's own.
        Err(error) if rasteriser.device().contains("software") => return println!("skipped: {error}"),
        Err(error) => panic!("{error}"),
    };
    assert_eq!((shared.width, shared.height), (SIZE, SIZE));
    assert!(shared.bytes >= Offsets::new(SIZE, SIZE, ALL, true).end);
    let (scene, shades) = (squares(12), shades());
    rasteriser.upload(&scene).expect("uploaded");
    let mut target = GBuffer::new(SIZE, SIZE, ALL);
    // The odd semaphore values belong to the pictures of ray passes.
    for value in [2, 4] {
        let job = RasterJob { shared: ALL, ..job(&scene, &shades) };
        let stats = rasteriser.draw(&job, &mut target).expect("drawn");
        assert_eq!(stats.shared.expect("handed over").value, value);
    }
    let bytes = read(&rasteriser.gpu, &rasteriser.sharing.as_ref().expect("shared").packer.buffer);
    assert_holds(&bytes, ALL, ALL, &expected);
}
