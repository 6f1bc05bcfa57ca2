//! Tests of a driver: how it computes `fma`, tried when a backend is made; and whether it runs long loops to their end, tried when the
//! glass of a pass needs such loops.

use super::programs::{Arithmetic, Rounding};
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// Number of products that are tried.
const CASES: usize = 4096;
/// Number of steps of the loop that is tried.
const STEPS: u32 = 1 << 17;

const PRODUCTS: &str = "
@group(0) @binding(0) var<storage, read> given: array<vec2f>;
@group(0) @binding(1) var<storage, read_write> rest: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    let a = given[2u * id.x].x; let b = given[2u * id.x].y;
    // The rounded product comes from the host: nothing is left to simplify.
    rest[id.x] = fma(a, b, -given[2u * id.x + 1u].x);
}
";

// The inner loops have 64 steps, since drivers that limit loops may count all loops of a program together. Each step depends on the one
// before, so no compiler can compute the result in advance.
const LOOPS: &str = "
@group(0) @binding(0) var<storage, read> given: array<u32>;
@group(0) @binding(1) var<storage, read_write> taken: array<u32>;
@compute @workgroup_size(1) fn main() {
    var state = given[1];
    var steps = 0u;
    while steps < given[0] {
        for (var i = 0u; i < 64u; i += 1u) {
            state = state * 1664525u + 1013904223u;
            if state == 0u { break; }
            steps += 1u;
        }
    }
    taken[0] = steps; taken[1] = state;
}
";

/// Pairs of factors, each with its rounded product; and the exact error of each rounded product.
fn cases() -> (Vec<[f32; 2]>, Vec<f32>) {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 8_388_608.0 - 1.0
    };
    let (mut given, mut rests) = (Vec::with_capacity(2 * CASES), Vec::with_capacity(CASES));
    for _ in 0..CASES {
        let (a, b) = (random(), random());
        given.extend([[a, b], [a * b, 0.0]]);
        rests.push((f64::from(a) * f64::from(b) - f64::from(a * b)) as f32);
    }
    (given, rests)
}

/// Finds how the arithmetic of programs must be written for a device.
pub fn arithmetic(gpu: &Gpu) -> Result<Arithmetic, BackendError> {
    let (given, expected) = cases();
    let rests = answer(gpu, "trying how products are rounded", PRODUCTS, &given, (CASES / 64) as u32, CASES)?;
    let fused = bytemuck::cast_slice::<u32, f32>(&rests) == expected;
    // DirectX's `mad` leaves the choice to the compiler, for each instruction.
    let rounding = if gpu.adapter.interface == "dx12" { Rounding::Separate } else { Rounding::Fma };
    let subgroups = gpu.has(wgpu::Features::SUBGROUP) && gpu.subgroup == [32, 32];
    Ok(Arithmetic { rounding, fused: fused && rounding == Rounding::Fma, subgroups })
}

/// Whether the driver leaves a loop that has not ended. llvmpipe does so after 65,535 steps of all loops of a program (Mesa 22.3).
pub fn cuts_loops(gpu: &Gpu) -> Result<bool, BackendError> {
    // The program compares the state with 0, which the state does not reach within the first 2^17 steps.
    let taken = answer(gpu, "trying how long loops may be", LOOPS, &[STEPS, 1], 1, 2)?;
    Ok(taken[0] < STEPS)
}

/// Runs the program with the WGSL source `text` in `groups` workgroups. The program reads `given` from binding 0, and writes `words` words to
/// binding 1, which are returned.
fn answer<T: bytemuck::NoUninit>(
    gpu: &Gpu,
    doing: &'static str,
    text: &str,
    given: &[T],
    groups: u32,
    words: usize,
) -> Result<Vec<u32>, BackendError> {
    let pipeline = gpu.compute_program(doing, text.into(), "main")?;
    let (storage, bytes) = (wgpu::BufferUsages::STORAGE, (words * size_of::<u32>()) as u64);
    let given = gpu.upload_buffer(doing, storage, bytemuck::cast_slice(given))?;
    let written = gpu.buffer(doing, storage | wgpu::BufferUsages::COPY_SRC, bytes)?;
    let readable = gpu.buffer(doing, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST, bytes)?;
    let entry = |(binding, buffer)| wgpu::BindGroupEntry { binding, resource: wgpu::Buffer::as_entire_binding(buffer) };
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(doing),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[(0, &given), (1, &written)].map(entry),
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(doing) });
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(groups, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&written, 0, &readable, 0, bytes);
    let mut found = Vec::new();
    gpu.read_mapped(&readable, bytes, Some(encoder.finish()), doing, |bytes| {
        found = bytemuck::pod_collect_to_vec(bytes);
    })?;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_that_are_tried_have_a_rest_that_rounding_twice_loses() {
        let (given, rests) = cases();
        assert!(rests.iter().filter(|rest| **rest != 0.0).count() > CASES / 2);
        for (pair, rest) in given.chunks_exact(2).zip(&rests) {
            let [[a, b], [product, _]] = *pair else { unreachable!() };
            assert_eq!(a.mul_add(b, -product), *rest);
        }
    }
}
