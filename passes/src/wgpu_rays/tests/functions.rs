//! Functions of the programs, compared number by number with exact arithmetic and with the processor.

use super::rays;
use crate::effects::dielectric::Variant;
use crate::effects::{fresnel, schlick};
use crate::raster::gpu::AdapterKind;
use crate::raster::gpu::device::Gpu;
use crate::sampling::{hash, hemisphere, sine_noise};
use crate::trace::SurfacePoint;
use crate::wgpu_rays::layout::Params;
use crate::wgpu_rays::programs::{Arithmetic, Kind, Stage, source};
use crate::wgpu_rays::split::Split;
use curitiba_pipeline::programs::{Fidelity, RayProgram, TextureLod};
use curitiba_pipeline::scene::Geometry;
use glam::{Vec2, Vec3};

const COUNT: usize = 20_000;
/// Numbers of input, and words of output, of a case.
const GIVEN: usize = 12;
const WORDS: usize = 30;

/// The buffers that every entry reads and writes.
const CASES: &str = "
@group(3) @binding(0) var<storage, read> given: array<f32>;
@group(3) @binding(1) var<storage, read_write> found: array<u32>;
fn put(place: u32, x: f32) { found[place] = bitcast<u32>(x); }
fn put3(place: u32, v: vec3f) { put(place, v.x); put(place + 1u, v.y); put(place + 2u, v.z); }
";

const ENTRY: &str = "
@compute @workgroup_size(64) fn functions(@builtin(global_invocation_id) id: vec3u) {
    let k = 12u * id.x;
    if k >= arrayLength(&given) { return; }
    let a = given[k]; let b = given[k + 1u]; let c = given[k + 2u]; let d = given[k + 3u];
    let g = given[k + 6u]; let h = given[k + 7u];
    let o = 30u * id.x;
    let p = exact_product(a, b); let s = exact_sum(a, b);
    put(o, p.h); put(o + 1u, p.l); put(o + 2u, s.h); put(o + 3u, s.l);
    found[o + 4u] = u32(exact_sign(a, b, c, d) + 1);
    let angle = reduced(given[k + 4u]);
    put(o + 5u, sine_of(angle, 0)); put(o + 6u, sine_of(angle, 1));
    put(o + 7u, thesis_rand(given[k + 4u], given[k + 5u]));
    put3(o + 8u, cosine_direction(vec2f(g, h)));
    put3(o + 11u, thesis_cosine(vec2f(g, h)));
    found[o + 14u] = pcg4d(bitcast<vec4u>(vec4f(a, b, c, d))).w;
    let exact = fresnel(g, 1.0 + h); let about = schlick(g, 1.0 + h);
    put(o + 15u, exact.reflectance); put(o + 16u, exact.cos_refracted); put(o + 17u, about.reflectance);
    let point = snap(id.x, vec3f(given[k + 8u], given[k + 9u], given[k + 10u]));
    put3(o + 18u, point.position); put3(o + 21u, point.normal); put3(o + 24u, point.start);
    put3(o + 27u, spawn(point, vec3f(0.0, 1.0, 0.0)));
}
";

pub(super) struct Random(pub u64);

impl Random {
    /// A random number in 0..1.
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    /// A random number whose size varies by `powers` powers of two up and down.
    fn wide(&mut self, powers: f32) -> f32 {
        (self.unit() * 2.0 - 1.0) * ((self.unit() * 2.0 - 1.0) * powers).round().exp2()
    }

    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

/// Cases, and a triangle for each of them.
fn cases() -> (Vec<[f32; GIVEN]>, Geometry) {
    let mut random = Random(3);
    let mut geometry = Geometry::default();
    let mut cases = Vec::with_capacity(COUNT);
    for index in 0..COUNT {
        let (a, b) = (random.wide(10.0), random.wide(10.0));
        // Choose `c` and `d` such that `a b` and `c d` are equal, or nearly.
        let c = if index % 3 == 0 { a } else { a * (1.0 + f32::EPSILON * 8.0) };
        let d = if index % 3 == 1 { random.wide(10.0) } else { a * b / c };
        let (angle, other) = (random.wide(14.0), random.wide(14.0));
        let scale = random.wide(8.0).abs() + 1e-3;
        let center = random.vector() * 50.0;
        let corners = [0; 3].map(|_| center + random.vector() * scale);
        // Some points lie on borders and at corners.
        let (u, v) = [(0.0, 0.0), (0.0, 0.3), (random.unit() * 0.5, random.unit() * 0.5)][index % 3];
        let at = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
        let (g, h) = (random.unit(), random.unit());
        cases.push([a, b, c, d, angle, other, g, h, at.x, at.y, at.z, 0.0]);
        geometry.positions.extend(corners);
        let first = 3 * index as u32;
        geometry.triangles.push([first, first + 1, first + 2]);
    }
    (cases, geometry)
}

/// The device's output for each case.
fn run(gpu: &Gpu, arithmetic: Arithmetic, cases: &[[f32; GIVEN]], geometry: &Geometry) -> Vec<[u32; WORDS]> {
    let variant = Variant::Panes(Fidelity::Corrected);
    let kind = Kind::plain(RayProgram::Final, variant);
    let text = source(kind, Stage::Whole, (arithmetic, TextureLod::Zero), Split::default()).expect("written") + ENTRY;
    let scene: [(u32, &[u8]); 2] =
        [(2, bytemuck::cast_slice(&geometry.positions)), (3, bytemuck::cast_slice(&geometry.triangles))];
    answers(gpu, text, (&scene, &[]), cases)
}

/// Runs the entry `functions` of the source `text`, to which [`CASES`] is appended, and returns its output for each case. `scene` holds the
/// bindings and contents of the buffers of group 1 that the entry reads; `tables` is the contents of group 2, empty if the entry does not read it.
pub(super) fn answers<const G: usize, const W: usize>(
    gpu: &Gpu,
    text: String,
    (scene, tables): (&[(u32, &[u8])], &[u32]),
    cases: &[[f32; G]],
) -> Vec<[u32; W]> {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("functions"),
        source: wgpu::ShaderSource::Wgsl((text + CASES).into()),
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("functions"),
        layout: None,
        module: &module,
        entry_point: Some("functions"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    gpu.check("compiling").expect("valid");
    let storage = wgpu::BufferUsages::STORAGE;
    let upload = |bytes: &[u8]| gpu.upload_buffer("test", storage, bytes).expect("room");
    let params = bytemuck::bytes_of(&Params::default()).to_vec();
    let params = gpu.upload_buffer("test", wgpu::BufferUsages::UNIFORM, &params).expect("room");
    let scene: Vec<_> = scene.iter().map(|(binding, bytes)| (*binding, upload(bytes))).collect();
    let given = upload(bytemuck::cast_slice(cases));
    let bytes = (cases.len() * W * 4) as u64;
    let found = gpu.buffer("test", storage | wgpu::BufferUsages::COPY_SRC, bytes).expect("room");
    let readable = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let readable = gpu.buffer("test", readable, bytes).expect("room");
    let group = |index: u32, buffers: &[(u32, &wgpu::Buffer)]| {
        let entries: Vec<_> = buffers
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding: *binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = pipeline.get_bind_group_layout(index);
        let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
        gpu.device.create_bind_group(&descriptor)
    };
    let tables = (!tables.is_empty()).then(|| upload(bytemuck::cast_slice(tables)));
    let groups = [
        (0, group(0, &[(0, &params)])),
        (1, group(1, &scene.iter().map(|(binding, buffer)| (*binding, buffer)).collect::<Vec<_>>())),
        (3, group(3, &[(0, &given), (1, &found)])),
    ];
    let groups = groups.into_iter().chain(tables.as_ref().map(|tables| (2, group(2, &[(0, tables)]))));
    let groups: Vec<_> = groups.collect();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        for (index, group) in &groups {
            pass.set_bind_group(*index, group, &[]);
        }
        pass.dispatch_workgroups((cases.len() as u32).div_ceil(64), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&found, 0, &readable, 0, bytes);
    let mut words = vec![[0; W]; cases.len()];
    gpu.read_mapped(&readable, bytes, Some(encoder.finish()), "test", |bytes| {
        bytemuck::cast_slice_mut(&mut words).copy_from_slice(bytes);
    })
    .expect("read");
    words
}

#[test]
fn functions_give_what_exact_arithmetic_and_the_processor_give() {
    let Some(rays) = rays() else { return };
    let (cases, geometry) = cases();
    let found = run(&rays.gpu, rays.arithmetic, &cases, &geometry);
    // Other drivers' roots and quotients may be off by a few units in the last place.
    let exact = rays.gpu.adapter.kind == AdapterKind::Software;
    let (mut naive_wrong, mut zero, mut sines, mut noise, mut starts) = (0, 0, 0, 0, 0);
    for (index, (case, words)) in cases.iter().zip(&found).enumerate() {
        let [a, b, c, d, angle, other, g, h, x, y, z, _] = *case;
        let number = |place: usize| f32::from_bits(words[place]);
        let vector = |place: usize| Vec3::new(number(place), number(place + 1), number(place + 2));
        let wide = f64::from;
        assert_eq!(wide(number(0)) + wide(number(1)), wide(a) * wide(b), "{a} times {b}");
        assert_eq!(wide(number(2)) + wide(number(3)), wide(a) + wide(b), "{a} plus {b}");
        let difference = wide(a) * wide(b) - wide(c) * wide(d);
        let sign = if difference == 0.0 { 0 } else { difference.signum() as i32 };
        assert_eq!(words[4] as i32 - 1, sign, "{a} {b} - {c} {d}");
        let naive = a * b - c * d;
        naive_wrong += usize::from(sign != if naive == 0.0 { 0 } else { naive.signum() as i32 });
        zero += usize::from(sign == 0);
        let (sine, cosine) = (wide(angle).sin(), wide(angle).cos());
        assert!((wide(number(5)) - sine).abs() < 7e-8 && (wide(number(6)) - cosine).abs() < 7e-8, "{angle}");
        sines += usize::from(number(5) != sine as f32 || number(6) != cosine as f32);
        noise += usize::from((number(7) - sine_noise::rand(Vec2::new(angle, other))).abs() > 1e-6);
        // Near the rim, the third component is the root of a small difference.
        let near = |found: Vec3, expected: Vec3| {
            let (off, square) = ((found - expected).abs(), (found.z * found.z - expected.z * expected.z).abs());
            off.x.max(off.y) <= if exact { 1.2e-7 } else { 2e-6 } && square <= 4e-6
        };
        assert!(near(vector(8), hemisphere::cosine(Vec2::new(g, h))), "{g} {h}");
        assert!(near(vector(11), sine_noise::polar_cosine(Vec2::new(g, h))), "{g} {h}");
        let bits = [a, b, c, d].map(f32::to_bits);
        assert_eq!(words[14], hash::pcg4d(bits)[3]);
        let (expected, about) = (fresnel(g, 1.0 + h), schlick(g, 1.0 + h));
        assert!((number(15) - expected.reflectance).abs() < 1e-5, "{g} {h}");
        assert!((number(16) - expected.cos_refracted).abs() < 1e-5, "{g} {h}");
        assert!((number(17) - about.reflectance).abs() < 1e-5, "{g} {h}");
        let point = SurfacePoint::snap(&geometry, index as u32, Vec3::new(x, y, z));
        let spawned = point.spawn(Vec3::Y);
        let same = [(18, point.position), (21, point.normal), (24, point.start), (27, spawned)];
        starts += usize::from(same.iter().any(|(place, expected)| vector(*place) != *expected));
        // Offsets are 32 units of rounding errors of the coordinates, which are below 70 here.
        assert!(
            same.iter().all(|(place, expected)| (vector(*place) - *expected).abs().max_element() < 1e-5),
            "{case:?}"
        );
    }
    println!("of {COUNT}: {sines} sines, {noise} noises and {starts} starts of rays differ; {naive_wrong} signs would");
    assert!(naive_wrong > COUNT / 20 && zero > COUNT / 20, "the cases are easy: {naive_wrong}, {zero}");
    assert!(sines * 500 < COUNT && noise * 200 < COUNT, "{sines} {noise}");
    assert!(!exact || starts * 1000 < COUNT, "{starts}");
}
