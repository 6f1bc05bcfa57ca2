//! Tests of internals: small buffers, and devices that fail.

use super::*;
use curitiba_pipeline::backend::{NO_TRIANGLE, Shade, Sun, View};
use curitiba_pipeline::glsl::{Compute, Program};
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram};
use curitiba_pipeline::scene::{Batch, Geometry, Material, Sphere};
use glam::{Mat4, Vec3, Vec4};

pub(super) const SIZE: u32 = 97;

/// A rasteriser that shades as on a GPU, or `None` with a printed reason where this machine has no device.
pub(super) fn rasteriser() -> Option<WgpuRasteriser> {
    match WgpuRasteriser::new(AdapterChoice::Any) {
        Ok(mut rasteriser) => {
            rasteriser.set_shades_pixels(true);
            Some(rasteriser)
        }
        Err(error) => {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none_or(|value| value != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// The device of a rasteriser that shares its device with no one.
fn alone(rasteriser: &mut WgpuRasteriser) -> &mut Gpu {
    Arc::get_mut(&mut rasteriser.gpu).expect("nobody else has the device")
}

/// A grid of squares of two triangles each, over the whole viewport; its right half has a second material.
pub(super) fn squares(side: u32) -> Arc<RenderScene> {
    let at = |x: u32, y: u32| Vec3::new(x as f32, y as f32, 0.0) * (2.0 / side as f32) - Vec3::new(1.0, 1.0, -0.5);
    let positions: Vec<Vec3> = (0..=side).flat_map(|y| (0..=side).map(move |x| at(x, y))).collect();
    let square = |x: u32, y: u32| {
        let [a, b] = [y * (side + 1) + x, (y + 1) * (side + 1) + x];
        [[a, a + 1, b], [b, a + 1, b + 1]]
    };
    let half = |columns: std::ops::Range<u32>| {
        columns.flat_map(move |x| (0..side).flat_map(move |y| square(x, y))).collect::<Vec<_>>()
    };
    let (left, right) = (half(0..side / 2), half(side / 2..side));
    let batches = vec![
        Batch { material: 0, first: 0, count: left.len() as u32 },
        Batch { material: 1, first: left.len() as u32, count: right.len() as u32 },
    ];
    let normals = vec![Vec3::Z; positions.len()];
    let geometry = Geometry { positions, normals, triangles: [left, right].concat(), batches, ..Geometry::default() };
    Arc::new(RenderScene { geometry, ..RenderScene::default() })
}

pub(super) fn shades() -> [Shade; 2] {
    [Vec4::new(0.5, 0.25, 1.0, 1.0), Vec4::new(1.0, 0.75, 0.5, 1.0)]
        .map(|diffuse| Shade { diffuse, ..Shade::default() })
}

pub(super) const ALL: Attachments = Attachments { color: true, position: true, normal: true, triangle: true };

pub(super) fn job<'a>(scene: &'a RenderScene, shades: &'a [Shade]) -> RasterJob<'a> {
    RasterJob {
        scene,
        program: curitiba_pipeline::programs::RasterProgram::Deferred,
        view: View::new(Mat4::IDENTITY, Vec3::ZERO),
        lights: &[],
        sun: None,
        shades,
        culled: &[],
        viewport: Rect { x: 0, y: 0, width: SIZE, height: SIZE },
        clear_color: Vec4::ONE,
        attachments: ALL,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    }
}

/// A shader of a project: white, or with a compute stage.
pub(super) fn own_program(compute: Option<Compute>) -> Arc<Program> {
    let vertex = "@vertex fn main() -> @builtin(position) vec4<f32> { return vec4<f32>(0.0, 0.0, 0.0, 1.0); }";
    let fragment = "@fragment fn main() -> @location(0) vec4<f32> { return vec4<f32>(1.0); }";
    Arc::new(Program {
        vertex: vertex.to_owned(),
        fragment: fragment.to_owned(),
        compute,
        attributes: Vec::new(),
        blocks: Vec::new(),
        samplers: Vec::new(),
        outputs: [true, false, false],
        flat: false,
        storage: Vec::new(),
        early: None,
        fixed: Vec::new(),
    })
}

fn render(rasteriser: &mut WgpuRasteriser, scene: &Arc<RenderScene>) -> Result<GBuffer, BackendError> {
    let shades = shades();
    let job = job(scene, &shades);
    let mut target = GBuffer::new(SIZE, SIZE, ALL);
    rasteriser.upload(scene)?;
    rasteriser.draw(&job, &mut target)?;
    rasteriser.read_back(&job, job.attachments, &mut target)?;
    Ok(target)
}

#[test]
fn small_buffers_cut_uploads_and_read_backs_into_pieces_and_change_nothing() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let scene = squares(12);
    let whole = render(&mut rasteriser, &scene).expect("draws");
    assert!(whole.triangle.iter().all(|id| *id != NO_TRIANGLE), "the squares cover everything");
    let chunks = |rasteriser: &WgpuRasteriser| {
        let geometry = &rasteriser.scene.as_ref().expect("uploaded").geometry;
        (geometry.chunks.len(), geometry.vertices.len())
    };
    assert_eq!(chunks(&rasteriser), (1, 1));
    // 169 vertices of 12 bytes fit in a buffer, 288 triangles do not.
    alone(&mut rasteriser).max_buffer_bytes = 2100;
    assert_eq!(render(&mut rasteriser, &scene).expect("draws"), whole);
    assert_eq!(chunks(&rasteriser), (5, 1), "65 triangles, whose planes take 32 bytes each");
    // The vertices do not fit either, and one row of pixels (97 * 16 bytes, rounded up) is read back at a time.
    alone(&mut rasteriser).max_buffer_bytes = 500;
    rasteriser.staging = Staging::default();
    assert_eq!(render(&mut rasteriser, &scene).expect("draws"), whole);
    assert_eq!(chunks(&rasteriser), (23, 23), "13 triangles of 36 bytes each");
}

#[test]
fn fragments_find_the_corners_of_their_triangle_in_every_chunk() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let mut scene = squares(12);
    for position in &mut Arc::make_mut(&mut scene).geometry.positions {
        position.z += 0.21 * position.x + 0.13 * position.y;
    }
    let shades = shades();
    // Draws of both materials, and draws that are joined.
    for attachments in [ALL, Attachments { triangle: true, ..Attachments::default() }] {
        let mut depths = |max_buffer_bytes: u64, most_groups: u32, snapped_depth: bool| {
            let load_store = LoadStore { store_depth: true, ..LoadStore::default() };
            let job = RasterJob { snapped_depth, load_store, attachments, ..job(&scene, &shades) };
            let mut target = GBuffer::new(SIZE, SIZE, attachments);
            target.depth = vec![f32::NAN; target.triangle.len()];
            // Depths are read back whole.
            let largest = std::mem::replace(&mut alone(&mut rasteriser).max_buffer_bytes, max_buffer_bytes);
            rasteriser.upload(&scene).expect("uploads");
            alone(&mut rasteriser).max_buffer_bytes = largest;
            let limits = &mut alone(&mut rasteriser).limits;
            let most_groups = std::mem::replace(&mut limits.max_compute_workgroups_per_dimension, most_groups);
            rasteriser.draw(&job, &mut target).expect("draws");
            alone(&mut rasteriser).limits.max_compute_workgroups_per_dimension = most_groups;
            rasteriser.read_back(&job, attachments, &mut target).expect("reads back");
            (target.depth, rasteriser.scene.as_ref().expect("uploaded").geometry.chunks.len())
        };
        let [(planes, one), (device, _)] = [false, true].map(|snapped_depth| depths(1 << 30, 65_535, snapped_depth));
        let differ = planes.iter().zip(&device).filter(|(planes, device)| planes != device).count();
        assert!(one == 1 && differ > 1000, "the depth is not the device's: {differ}");
        for max_buffer_bytes in [2100, 500] {
            let (found, chunks) = depths(max_buffer_bytes, 65_535, false);
            assert!(chunks > 1 && found == planes, "buffers of {max_buffer_bytes} bytes");
        }
        assert!(depths(1 << 30, 3, false).0 == planes, "five groups of threads in two rows");
    }
}

#[test]
fn a_destroyed_device_gives_errors() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let scene = squares(4);
    render(&mut rasteriser, &scene).expect("draws");
    rasteriser.gpu.device.destroy();
    let shades = shades();
    let job = job(&scene, &shades);
    let mut target = GBuffer::new(SIZE, SIZE, ALL);
    for error in [
        rasteriser.read_back(&job, job.attachments, &mut target).expect_err("nothing to read"),
        rasteriser.draw(&job, &mut target).expect_err("no device"),
        rasteriser.draw(&job, &mut target).expect_err("still none"),
        rasteriser.upload(&scene).expect_err("no device"),
    ] {
        let message = error.to_string();
        assert!(message.contains("`--raster cpu`"), "{message}");
    }
}

#[test]
fn a_buffer_that_is_too_large_is_an_error_and_the_device_goes_on() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let gpu = &rasteriser.gpu;
    let size = gpu.limits.max_buffer_size + 4;
    let error = gpu.buffer("test buffer", wgpu::BufferUsages::VERTEX, size).expect_err("too large");
    assert!(error.to_string().contains("test buffer"), "{error}");
    render(&mut rasteriser, &squares(4)).expect("draws");
}

#[test]
fn attachments_beyond_the_device_are_refused_with_the_numbers() {
    let Some(mut rasteriser) = rasteriser() else { return };
    alone(&mut rasteriser).limits.max_color_attachment_bytes_per_sample = 32;
    let message = render(&mut rasteriser, &squares(4)).expect_err("52 > 32").to_string();
    assert!(message.contains("52 bytes") && message.contains("32 bytes"), "{message}");
    alone(&mut rasteriser).limits.max_color_attachment_bytes_per_sample = 52;
    alone(&mut rasteriser).limits.max_texture_dimension_2d = SIZE - 1;
    let message = render(&mut rasteriser, &squares(4)).expect_err("97 > 96").to_string();
    assert!(message.contains("97 x 97") && message.contains("96 x 96"), "{message}");
    alone(&mut rasteriser).limits.max_texture_dimension_2d = SIZE;
    render(&mut rasteriser, &squares(4)).expect("now it fits");
}

#[test]
fn draws_join_where_no_attachment_depends_on_the_material() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let (scene, shades) = (squares(4), shades());
    let mut target = GBuffer::new(SIZE, SIZE, ALL);
    rasteriser.upload(&scene).expect("uploads");
    for (color, draws) in [(true, 2), (false, 1)] {
        let job = RasterJob { attachments: Attachments { color, ..ALL }, ..job(&scene, &shades) };
        let stats = rasteriser.draw(&job, &mut target).expect("draws");
        assert_eq!((rasteriser.draws.len(), stats.triangles), (draws, 32));
    }
}

/// Runs an effect on the picture that [`render`] drew: all of it is lit, and the right half is glass.
fn effect(
    rasteriser: &mut WgpuRasteriser,
    scene: &RenderScene,
    program: EffectProgram,
    drawn: &GBuffer,
) -> Result<Image, BackendError> {
    let shades = shades();
    let lit: Vec<[f32; 4]> = drawn.position.iter().map(|[x, y, z, _]| [*x, *y, *z, 1.0]).collect();
    let job = EffectJob {
        scene,
        program,
        params: EffectParams { map_size: 128, ..EffectParams::default() },
        seed: 0,
        view: View::new(Mat4::IDENTITY, Vec3::new(0.0, 0.0, 2.0)),
        sun: Some(Sun { direction: Vec3::NEG_Z, color: Vec3::ONE }),
        width: SIZE,
        height: SIZE,
        resident: false,
        position: &lit,
        normal: &drawn.normal,
        color: &drawn.color,
        triangle: &drawn.triangle,
        shades: &shades,
        glass: &[false, true],
    };
    let mut output = Image::filled(SIZE, SIZE, [f32::NAN; 4]);
    rasteriser.effect(&job, &mut output, &Progress::default())?;
    Ok(output)
}

#[test]
fn maps_beyond_the_device_are_refused_with_the_numbers() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let scene = squares(4);
    let drawn = render(&mut rasteriser, &scene).expect("draws");
    alone(&mut rasteriser).limits.max_texture_dimension_2d = 127;
    for (program, what) in [(EffectProgram::ShadowMap, "shadow map"), (EffectProgram::CubeReflection, "cube map")] {
        let message = effect(&mut rasteriser, &scene, program, &drawn).expect_err("128 > 127").to_string();
        assert!(message.contains(what) && message.contains("128 x 128") && message.contains("127"), "{message}");
        assert!(message.contains("`mapsize`"), "{message}");
    }
    alone(&mut rasteriser).limits.max_texture_dimension_2d = SIZE - 1;
    let message = effect(&mut rasteriser, &scene, EffectProgram::ShadowMap, &drawn).expect_err("97 > 96").to_string();
    assert!(message.contains("97 x 97") && message.contains("96 x 96"), "{message}");
    alone(&mut rasteriser).limits.max_texture_dimension_2d = 128;
    alone(&mut rasteriser).limits.max_texture_array_layers = 5;
    let message =
        effect(&mut rasteriser, &scene, EffectProgram::CubeRefraction, &drawn).expect_err("6 > 5").to_string();
    assert!(message.contains("1 cube maps") && message.contains("`probes`"), "{message}");
    alone(&mut rasteriser).limits.max_texture_array_layers = 6;
    for info in curitiba_pipeline::raster_effects::EFFECT_PROGRAMS {
        let output = effect(&mut rasteriser, &scene, info.program, &drawn).expect("now it fits");
        assert_eq!(output.count_non_finite(), 0, "{}", info.name);
    }
}

#[test]
fn an_effect_on_a_destroyed_device_gives_errors() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let scene = squares(4);
    let drawn = render(&mut rasteriser, &scene).expect("draws");
    effect(&mut rasteriser, &scene, EffectProgram::ShadowMap, &drawn).expect("computes");
    rasteriser.gpu.device.destroy();
    for info in curitiba_pipeline::raster_effects::EFFECT_PROGRAMS {
        let message = effect(&mut rasteriser, &scene, info.program, &drawn).expect_err("no device").to_string();
        assert!(message.contains("`--raster cpu`"), "{message}");
    }
}

/// A scene of squares with these exact spheres, and with the materials `plain` and `own`.
fn with_spheres(spheres: Vec<Sphere>) -> Arc<RenderScene> {
    let mut scene = squares(4);
    let changed = Arc::make_mut(&mut scene);
    changed.geometry.spheres = spheres;
    let named = |name: &str| Material { name: name.to_owned(), ..Material::default() };
    changed.materials = vec![named("plain"), named("own")];
    scene
}

#[test]
fn nothing_of_spheres_exists_before_a_scene_that_has_some() {
    let Some(mut rasteriser) = rasteriser() else { return };
    render(&mut rasteriser, &with_spheres(Vec::new())).expect("draws");
    let without = rasteriser.memory();
    assert!(rasteriser.spheres.is_none());
    let sphere = Sphere { center: Vec3::new(0.0, 0.0, 0.75), radius: 0.2, material: 0 };
    let drawn = render(&mut rasteriser, &with_spheres(vec![sphere; 3])).expect("draws");
    let shown = drawn.triangle.iter().filter(|id| **id == 32).count();
    assert!(shown > 100 && rasteriser.spheres.is_some(), "{shown}");
    assert_eq!(rasteriser.memory().geometry - without.geometry, 3 * 208);
    // A sphere that no pixel shows has no record. Small buffers, which hold one record each, do not change the picture.
    alone(&mut rasteriser).max_buffer_bytes = 250;
    assert_eq!(render(&mut rasteriser, &with_spheres(vec![sphere; 3])).expect("draws"), drawn);
    let behind = Sphere { center: Vec3::new(9.0, 0.0, 0.0), ..sphere };
    render(&mut rasteriser, &with_spheres(vec![behind])).expect("draws");
    assert_eq!(rasteriser.spheres.as_ref().map(Spheres::bytes), Some(0));
}

#[test]
fn spheres_that_cannot_be_drawn_are_refused_by_name() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let sphere = Sphere { center: Vec3::new(0.0, 0.0, 0.75), radius: 0.2, material: 1 };
    let scene = with_spheres(vec![sphere]);
    let shades = shades();
    let job = job(&scene, &shades);
    let refused = |rasteriser: &WgpuRasteriser, job: &RasterJob<'_>, owned: &[bool]| {
        let uniforms = rasteriser.draws.shared_uniforms();
        Spheres::default().prepare(&rasteriser.gpu, uniforms, job, None, owned).expect_err("refused").to_string()
    };
    let message = refused(&rasteriser, &job, &[false, true]);
    assert!(
        message.contains("`own`") && message.contains("own shader") && message.contains("exact=\"true\""),
        "{message}"
    );
    let uniforms = rasteriser.draws.shared_uniforms();
    Spheres::default().prepare(&rasteriser.gpu, uniforms, &job, None, &[true, false]).expect("another material");
    assert!(rasteriser.draws_spheres());
    alone(&mut rasteriser).limits.max_storage_buffers_per_shader_stage = 0;
    assert!(!rasteriser.draws_spheres());
    let message = refused(&rasteriser, &job, &[]);
    assert!(message.contains("storage buffers") && message.contains("--raster cpu"), "{message}");
}
