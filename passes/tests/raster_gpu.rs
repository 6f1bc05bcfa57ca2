//! Promises of the wgpu rasteriser beyond its pictures.

mod common;
mod scenes;
#[path = "scenes/gpu.rs"]
mod support;

use common::ALL;
use curitiba_passes::raster::gpu::{AdapterChoice, AdapterKind, WgpuRasteriser, adapters};
use curitiba_pipeline::backend::{Attachments, GBuffer, NO_TRIANGLE, RasterJob, Rasteriser, Rect, View};
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Batch, Geometry, RenderScene};
use glam::{Vec2, Vec3, Vec4};
use scenes::{Setup, hills, marked, plain};
use std::sync::Arc;
use support::rasteriser;

fn all_attachment_sets() -> impl Iterator<Item = Attachments> {
    (0_u32..16).map(|bits| Attachments {
        color: bits & 1 != 0,
        position: bits & 2 != 0,
        normal: bits & 4 != 0,
        triangle: bits & 8 != 0,
    })
}

fn render(rasteriser: &mut WgpuRasteriser, job: &RasterJob<'_>, width: u32, height: u32) -> GBuffer {
    let mut target = marked(width, height, job.attachments);
    rasteriser.draw(job, &mut target).expect("draws");
    rasteriser.read_back(job, job.attachments, &mut target).expect("reads back");
    target
}

#[test]
fn attachments_not_asked_for_are_neither_created_nor_change_the_others() {
    if rasteriser().is_none() {
        return;
    }
    let setup = hills(20);
    let (width, height) = (75, 40);
    let mut full = None;
    // The full set comes first, because the others are compared with it.
    for attachments in all_attachment_sets().collect::<Vec<_>>().into_iter().rev() {
        let mut rasteriser = rasteriser().expect("there was one");
        rasteriser.upload(&setup.scene).expect("uploads");
        assert_eq!(rasteriser.memory().attachments, 0);
        let job = setup.job(width, height, attachments);
        let target = render(&mut rasteriser, &job, width, height);
        let Attachments { color, position, normal, triangle } = attachments;
        let pixel = 16 * (u64::from(color) + u64::from(position) + u64::from(normal)) + 4 * u64::from(triangle);
        let depth = if attachments == Attachments::default() { 0 } else { 4 };
        let expected = (pixel + depth) * u64::from(width * height);
        assert_eq!(rasteriser.memory().attachments, expected, "{attachments:?}");
        let full = full.get_or_insert_with(|| target.clone());
        let expected = GBuffer {
            color: if color { full.color.clone() } else { Vec::new() },
            position: if position { full.position.clone() } else { Vec::new() },
            normal: if normal { full.normal.clone() } else { Vec::new() },
            triangle: if triangle { full.triangle.clone() } else { Vec::new() },
            depth: Vec::new(),
            ..*full
        };
        assert!(target == expected, "{attachments:?} differs from the full set");
    }
}

#[test]
fn of_a_sky_its_colour_alone_is_written() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let shades = [common::grey(); 2];
    let mut drawn = |is_sky: bool, asked: Attachments| {
        let scene = Arc::new(common::before(is_sky));
        rasteriser.upload(&scene).expect("uploads");
        render(&mut rasteriser, &common::job(&scene, &shades, common::camera(1.25), 150, 120, asked), 150, 120)
    };
    let (with, without) = (drawn(true, ALL), drawn(false, ALL));
    common::hides_sky(&with, &without);
    // Where only ids are asked for, draws of different materials are one, but not with that of a sky.
    let ids = Attachments { triangle: true, ..Attachments::default() };
    assert!(drawn(true, ids).triangle == with.triangle);
}

/// Devices compute depth from corners that they snap, each in its own way: this bound is far above what a farther layer may show.
#[test]
fn of_two_layers_close_together_few_pixels_show_the_farther_one() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let mut seen = |gap: f32| {
        let (mut nearer, mut farther) = (0, 0);
        for (tilt, seed) in [0.3, 0.8, 1.1, 1.3].into_iter().flat_map(|tilt| (0..4).map(move |seed| (tilt, seed))) {
            let (scene, behind) = common::layers(seed, tilt, gap);
            let (scene, shades) = (Arc::new(scene), [common::grey()]);
            rasteriser.upload(&scene).expect("uploads");
            for near in [0.01, 0.1, 1.0, 10.0] {
                let view = View::new(common::perspective(1.0, 1.0, near, 100.0), Vec3::ZERO);
                let ids = Attachments { triangle: true, ..Attachments::default() };
                let drawn = render(&mut rasteriser, &common::job(&scene, &shades, view, 128, 128, ids), 128, 128);
                for id in drawn.triangle.into_iter().filter(|id| *id != NO_TRIANGLE) {
                    *if id < behind { &mut farther } else { &mut nearer } += 1;
                }
            }
        }
        (nearer, farther)
    };
    // 60 m away a float's last bit is 4 micrometres: layers nearer to each other than that mix.
    let ((nearer, farther), (_, mixed)) = (seen(8e-4), seen(2e-6));
    println!("{farther} of {} pixels; of layers 2 micrometres apart {mixed}", nearer + farther);
    assert!(nearer > 50_000 && farther * 20 < nearer && mixed > 1000, "{farther}, {nearer}, {mixed}");
}

#[test]
fn attachments_in_16_bit_floats_take_half_the_memory_and_are_the_32_bit_ones_rounded() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let (width, height) = (75, 40);
    let full = render(&mut rasteriser, &setup.job(width, height, ALL), width, height);
    let before = rasteriser.memory().attachments;
    for half in all_attachment_sets() {
        let job = RasterJob { half, ..setup.job(width, height, ALL) };
        let found = render(&mut rasteriser, &job, width, height);
        assert!(found.triangle == full.triangle, "ids are whole numbers, whatever {half:?} says");
        let channels = [
            (half.color, &found.color, &full.color),
            (half.position, &found.position, &full.position),
            (half.normal, &found.normal, &full.normal),
        ];
        for (half, found, full) in channels {
            if !half {
                assert!(found == full);
                continue;
            }
            assert!(found != full, "control: something was rounded");
            let mut kept = found.clone();
            PixelFormat::Rgba16Float.round(&mut kept);
            assert!(kept == *found, "what is read back are 16-bit floats");
            // Rounding may be to nearest or towards zero: within one unit of 11 bits.
            for (found, full) in found.as_flattened().iter().zip(full.as_flattened()) {
                let unit = (full.abs() / 1024.0).max(2f32.powi(-24));
                assert!((found - full).abs() <= unit, "{found} {full}");
            }
        }
    }
    let mut alone = support::rasteriser().expect("there was one");
    alone.upload(&setup.scene).expect("uploads");
    render(&mut alone, &RasterJob { half: ALL, ..setup.job(width, height, ALL) }, width, height);
    let pixels = u64::from(width * height);
    assert_eq!((before, alone.memory().attachments), (56 * pixels, (3 * 8 + 4 + 4) * pixels));
}

#[test]
fn attachments_stay_between_frames_and_follow_the_size() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let first = render(&mut rasteriser, &setup.job(64, 64, ALL), 64, 64);
    let memory = rasteriser.memory();
    assert_eq!(render(&mut rasteriser, &setup.job(64, 64, ALL), 64, 64), first);
    assert_eq!(rasteriser.memory(), memory);
    for size in 1..40 {
        render(&mut rasteriser, &setup.job(size, size, ALL), size, size);
    }
    let kept: u64 = (36..40).map(|size| 56 * size * size).sum();
    assert_eq!(rasteriser.memory().attachments, kept, "a bounded number of sets is kept");
    assert_eq!(render(&mut rasteriser, &setup.job(64, 64, ALL), 64, 64), first);
}

#[test]
fn only_what_the_scene_has_is_uploaded() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let (vertices, triangles) = (21 * 21, 2 * 20 * 20);
    assert_eq!(rasteriser.memory().geometry, 24 * vertices + 12 * triangles);
    let mut bare = (*setup.scene).clone();
    bare.geometry.normals.clear();
    let bare = Arc::new(bare);
    rasteriser.upload(&bare).expect("uploads");
    assert_eq!(rasteriser.memory().geometry, 12 * vertices + 12 * triangles);
    let attachments = Attachments { position: true, triangle: true, ..Attachments::default() };
    let job = RasterJob { scene: &bare, ..setup.job(64, 64, attachments) };
    let target = render(&mut rasteriser, &job, 64, 64);
    assert!(target.triangle.iter().any(|id| *id != NO_TRIANGLE));
    assert!(target.position.iter().all(|position| position[3] == 0.0), "no normals, no cosine");
    let job = RasterJob { attachments: ALL, ..job };
    let message = rasteriser.draw(&job, &mut marked(64, 64, ALL)).expect_err("no normals").to_string();
    assert!(message.contains("without normals"), "{message}");
}

#[test]
fn textures_are_uploaded_when_a_material_or_a_shade_reads_them() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = scenes::grazing();
    rasteriser.upload(&setup.scene).expect("uploads");
    // The materials of generated scenes name no texture; the shades do.
    assert_eq!(rasteriser.memory().textures, 0);
    let position = Attachments { position: true, ..Attachments::default() };
    render(&mut rasteriser, &setup.job(32, 32, position), 32, 32);
    assert_eq!(rasteriser.memory().textures, 0, "positions need no texture");
    render(&mut rasteriser, &setup.job(32, 32, ALL), 32, 32);
    let texels =
        |texture: &Texture| -> u64 { texture.levels.iter().map(|level| u64::from(level.width * level.height)).sum() };
    assert_eq!(rasteriser.memory().textures, setup.scene.textures.iter().map(|t| 4 * texels(t)).sum::<u64>());
}

#[test]
fn only_the_viewport_is_cleared_and_drawn() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(20);
    rasteriser.upload(&setup.scene).expect("uploads");
    let (width, height) = (150, 90);
    let viewport = Rect { x: 37, y: 11, width: 70, height: 60 };
    let alone = render(&mut rasteriser, &setup.job(70, 60, ALL), 70, 60);
    let job = RasterJob { viewport, ..setup.job(70, 60, ALL) };
    let target = render(&mut rasteriser, &job, width, height);
    let untouched = marked(1, 1, ALL);
    for y in 0..height {
        for x in 0..width {
            let pixel = (y * width + x) as usize;
            let (column, row) = (x.wrapping_sub(viewport.x), y.wrapping_sub(viewport.y));
            let inside = column < viewport.width && row < viewport.height;
            let (from, index) =
                if inside { (&alone, (row * viewport.width + column) as usize) } else { (&untouched, 0) };
            assert_eq!(target.color[pixel], from.color[index], "{x}, {y}");
            assert_eq!(target.position[pixel], from.position[index], "{x}, {y}");
            assert_eq!(target.normal[pixel], from.normal[index], "{x}, {y}");
            assert_eq!(target.triangle[pixel], from.triangle[index], "{x}, {y}");
        }
    }
}

/// The same triangle twice over the whole viewport, with two materials.
fn coincident() -> Setup {
    let corners = [Vec3::new(-20.0, -20.0, -2.0), Vec3::new(20.0, -20.0, -2.0), Vec3::new(0.0, 40.0, -2.0)];
    let geometry = Geometry {
        positions: corners.to_vec(),
        normals: vec![Vec3::Z; 3],
        texcoords: vec![Vec2::ZERO; 3],
        triangles: vec![[0, 1, 2]; 2],
        batches: (0..2).map(|i| Batch { material: i, first: i, count: 1 }).collect(),
        ..Geometry::default()
    };
    let white = Texture::new("white".to_owned(), 1, 1, vec![[255; 4]]);
    Setup {
        name: "coincident",
        scene: Arc::new(RenderScene { geometry, textures: vec![white], ..RenderScene::default() }),
        shades: vec![plain([1.0, 0.0, 0.0]), plain([0.0, 1.0, 0.0])],
        eye: Vec3::ZERO,
        target: -Vec3::Z,
        near: 0.1,
        far: 10.0,
        sun: None,
    }
}

#[test]
fn of_equal_depths_the_lower_triangle_stays() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = coincident();
    rasteriser.upload(&setup.scene).expect("uploads");
    let target = render(&mut rasteriser, &setup.job(33, 20, ALL), 33, 20);
    assert!(target.triangle.iter().all(|id| *id == 0));
    // Without a sun, every component is 0.3 of the diffuse colour.
    assert!(target.color.iter().all(|color| *color == [0.3, 0.0, 0.0, 0.3]), "{:?}", target.color[0]);
    // When the first triangle is cut out, the second is visible.
    let mut shades = setup.shades.clone();
    (shades[0].texture, shades[0].alpha_cutoff) = (Some(0), Some(f32::INFINITY));
    let job = RasterJob { shades: &shades, ..setup.job(33, 20, ALL) };
    let target = render(&mut rasteriser, &job, 33, 20);
    assert!(target.triangle.iter().all(|id| *id == 1));
}

#[test]
fn an_empty_scene_clears() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = Setup { scene: Arc::new(RenderScene::default()), shades: Vec::new(), ..hills(2) };
    rasteriser.upload(&setup.scene).expect("uploads");
    let job = setup.job(20, 10, ALL);
    let mut expected = GBuffer::new(20, 10, ALL);
    expected.color.fill(job.clear_color.to_array());
    assert_eq!(render(&mut rasteriser, &job, 20, 10), expected);
}

#[test]
fn jobs_that_do_not_fit_their_scene_or_target_are_errors() {
    let Some(mut rasteriser) = rasteriser() else { return };
    let setup = hills(4);
    let job = setup.job(64, 64, ALL);
    let mut target = GBuffer::new(64, 64, ALL);
    let message = rasteriser.draw(&job, &mut target).expect_err("nothing uploaded").to_string();
    assert!(message.contains("not uploaded"), "{message}");
    rasteriser.upload(&setup.scene).expect("uploads");
    let message = rasteriser.read_back(&job, job.attachments, &mut target).expect_err("nothing drawn").to_string();
    assert!(message.contains("drawn last"), "{message}");
    let outside = Rect { x: 1, y: 0, width: 64, height: 64 };
    let message = rasteriser.draw(&RasterJob { viewport: outside, ..job }, &mut target).expect_err("outside");
    assert!(message.to_string().contains("not inside 64 x 64"), "{message}");
    let overflow = Rect { x: u32::MAX, y: 0, width: 2, height: 2 };
    rasteriser.draw(&RasterJob { viewport: overflow, ..job }, &mut target).expect_err("outside");
    let mut small = GBuffer::new(64, 64, Attachments { normal: false, ..ALL });
    let message = rasteriser.draw(&job, &mut small).expect_err("no normals").to_string();
    assert!(message.contains("`normal`"), "{message}");
    let message = rasteriser.draw(&RasterJob { shades: &setup.shades[..2], ..job }, &mut target).expect_err("shades");
    assert!(message.to_string().contains("material 2"), "{message}");
    let texture = [Vec4::ONE; 4].map(|_| curitiba_pipeline::backend::Shade { texture: Some(7), ..setup.shades[0] });
    let message = rasteriser.draw(&RasterJob { shades: &texture, ..job }, &mut target).expect_err("no texture 7");
    assert!(message.to_string().contains("no texture 7"), "{message}");
    rasteriser.draw(&job, &mut target).expect("still works");
}

#[test]
fn adapters_are_listed_hardware_first_and_software_is_no_real_gpu() {
    let list = adapters();
    assert!(list.is_sorted_by_key(|adapter| adapter.kind));
    let hardware = list.iter().any(|adapter| adapter.kind != AdapterKind::Software);
    match WgpuRasteriser::new(AdapterChoice::RealGpu) {
        Ok(rasteriser) => {
            assert!(hardware);
            assert_ne!(rasteriser.adapter().kind, AdapterKind::Software);
        }
        Err(error) => {
            assert!(!hardware, "{error}");
            assert!(error.to_string().contains("`--raster cpu`"), "{error}");
        }
    }
}

#[test]
#[ignore = "runs in a child process of the next test, whose environment has no Vulkan driver"]
fn without_a_driver() {
    assert!(adapters().is_empty());
    let message = |choice| WgpuRasteriser::new(choice).expect_err("no driver").to_string();
    let (any, real) = (message(AdapterChoice::Any), message(AdapterChoice::RealGpu));
    assert!(any.contains("install the graphics driver") && any.contains("`--raster cpu`"), "{any}");
    assert!(real.contains("`--raster cpu`"), "{real}");
    println!("refused as it should");
}

#[cfg(target_os = "linux")]
#[test]
fn a_machine_without_a_driver_gets_an_error_that_says_what_to_do() {
    let output = std::process::Command::new(std::env::current_exe().expect("a path"))
        .args(["--exact", "without_a_driver", "--nocapture", "--include-ignored"])
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .output()
        .expect("runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("refused as it should"), "{text}");
}
