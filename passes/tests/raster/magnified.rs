//! Magnified textures with nearest filtering, on both rasterisers. A texture of 4 x 4 texels covers a square of pixels, so that the texel
//! of every pixel is known.

use crate::common::{self, ALL};
#[cfg(feature = "wgpu")]
use crate::support::rasteriser;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{GBuffer, NO_TRIANGLE, Rasteriser, Shade};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::scene::texture::{Magnification, Texture, Wrap};
use glam::{Vec2, Vec3, Vec4};
use std::sync::Arc;

const SIDE: u32 = 64;
/// Texels per side of the texture.
const TEXELS: u32 = 4;
/// First column and row of the square, and then its side, in pixels: 4 pixels per texel.
const FIRST: f32 = 8.0;
const LENGTH: f32 = 48.0;
/// Copies of the texture along each side of the square: texture coordinates run from -1 to 2.
const COPIES: f32 = 3.0;

/// The colour of a texel; a quarter of the texels are clear.
fn color(x: u32, y: u32) -> [u8; 4] {
    let alpha = if (x * 3 + y).is_multiple_of(4) { 0 } else { 255 };
    [(60 * x + 17) as u8, (50 * y + 40) as u8, (255 - 40 * x - 20 * y) as u8, alpha]
}

fn square(texture: Texture) -> RenderScene {
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vec2::new(x, y));
    let places = corners.map(|corner| (Vec2::splat(FIRST) + LENGTH * corner).extend(-0.5));
    let mut scene = common::scene(places.to_vec(), vec![[0, 2, 1], [0, 3, 2]]);
    // Pixels count downwards, v upwards.
    let coordinates = |corner: Vec2| Vec2::new(corner.x, 1.0 - corner.y) * COPIES - Vec2::ONE;
    scene.geometry.texcoords = corners.map(coordinates).to_vec();
    scene.textures.push(texture);
    scene
}

fn four_by_four(wrap: [Wrap; 2], magnification: Magnification) -> Texture {
    let texels = (0..TEXELS * TEXELS).map(|index| color(index % TEXELS, index / TEXELS)).collect();
    Texture::new("pixels".to_owned(), TEXELS, TEXELS, texels).wrapped(wrap).magnified(magnification)
}

/// The texel that the wrap mode selects for an index, which may be outside the texture.
fn within(index: i32, wrap: Wrap) -> u32 {
    let count = TEXELS as i32;
    let index = match wrap {
        Wrap::Repeat => index.rem_euclid(count),
        Wrap::Clamp => index.clamp(0, count - 1),
        Wrap::Mirror => {
            let twice = index.rem_euclid(2 * count);
            twice.min(2 * count - 1 - twice)
        }
    };
    index as u32
}

/// Draws the scene with each rasteriser, lit so that a pixel has the colour of its texel.
fn drawn(scene: RenderScene, alpha_cutoff: Option<f32>) -> Vec<GBuffer> {
    let scene = Arc::new(scene);
    let emission = Vec3::splat(0.7).extend(1.0);
    let shades = [Shade { diffuse: Vec4::ZERO, emission, texture: Some(0), alpha_cutoff, ..Shade::default() }];
    let job = common::job(&scene, &shades, common::pixels(SIDE, SIDE), SIDE, SIDE, ALL);
    let mut target = GBuffer::new(SIDE, SIDE, ALL);
    CpuRasteriser::new().draw(&job, &mut target).expect("drawn");
    let mut all = vec![target];
    #[cfg(feature = "wgpu")]
    if let Some(mut rasteriser) = rasteriser() {
        for shades_pixels in [true, false] {
            rasteriser.set_shades_pixels(shades_pixels);
            rasteriser.upload(&scene).expect("uploads");
            let mut target = GBuffer::new(SIDE, SIDE, ALL);
            rasteriser.draw(&job, &mut target).expect("drawn");
            rasteriser.read_back(&job, ALL, &mut target).expect("read back");
            all.push(target);
        }
    }
    all
}

/// The index of each pixel of the square, and its place in texels from the square's upper left corner.
fn places() -> impl Iterator<Item = (usize, [i32; 2])> {
    let (first, last) = (FIRST as u32, (FIRST + LENGTH) as u32);
    let pixels = (first..last).flat_map(move |y| (first..last).map(move |x| [x, y]));
    pixels.map(move |[x, y]| {
        let texel = |pixel: u32| ((pixel - first) / 4) as i32;
        ((y * SIDE + x) as usize, [texel(x), texel(y)])
    })
}

/// The colour of the texel at a place. The square starts one copy to the left of texture coordinate 0 and one copy above 1.
fn texel_at([x, y]: [i32; 2], wrap: [Wrap; 2]) -> [u8; 4] {
    let count = TEXELS as i32;
    // `up` counts texels upwards from v = 0, and rows of the texture count from its top.
    let [column, up] = [x - count, 2 * count - 1 - y];
    color(within(column, wrap[0]), TEXELS - 1 - within(up, wrap[1]))
}

const WRAPS: [[Wrap; 2]; 3] = [[Wrap::Repeat; 2], [Wrap::Clamp, Wrap::Mirror], [Wrap::Mirror, Wrap::Clamp]];

#[test]
fn every_pixel_shows_one_texel() {
    for wrap in WRAPS {
        let off = |target: &GBuffer, (pixel, place): (usize, [i32; 2])| {
            let expected = texel_at(place, wrap).map(|code| f32::from(code) / 255.0);
            let found = target.color[pixel];
            (0..3).any(|channel| (found[channel] - expected[channel]).abs() > 2e-6)
        };
        for (index, target) in drawn(square(four_by_four(wrap, Magnification::Nearest)), None).iter().enumerate() {
            let wrong = places().filter(|place| off(target, *place)).count();
            assert_eq!(wrong, 0, "{wrap:?}, rasteriser {index}: of {} pixels", places().count());
        }
        for (index, target) in drawn(square(four_by_four(wrap, Magnification::Linear)), None).iter().enumerate() {
            let blended = places().filter(|place| off(target, *place)).count();
            assert!(blended > 1000, "control: {wrap:?}, rasteriser {index}: {blended} pixels are blended");
        }
    }
}

#[test]
fn holes_have_the_borders_of_texels() {
    for wrap in WRAPS {
        let wrong = |target: &GBuffer| {
            let is_hole = |pixel: usize| target.triangle[pixel] == NO_TRIANGLE;
            places().filter(|(pixel, place)| is_hole(*pixel) != (texel_at(*place, wrap)[3] == 0)).count()
        };
        for target in drawn(square(four_by_four(wrap, Magnification::Nearest)), Some(0.5)) {
            assert_eq!(wrong(&target), 0, "{wrap:?}");
        }
        for target in drawn(square(four_by_four(wrap, Magnification::Linear)), Some(0.5)) {
            assert!(wrong(&target) > 0, "control: {wrap:?}: blended holes are the same");
        }
    }
}

#[test]
fn minified_textures_are_blended_whatever_they_ask_for() {
    let texels: Vec<[u8; 4]> =
        (0..128 * 128_u32).map(|i| [i, i * 7, i * i, 255].map(|code| (code % 251) as u8)).collect();
    let of = |magnification| {
        let texture = Texture::new("fine".to_owned(), 128, 128, texels.clone()).magnified(magnification);
        drawn(square(texture), None)
    };
    let both = of(Magnification::Nearest).into_iter().zip(of(Magnification::Linear));
    for (index, (nearest, linear)) in both.enumerate() {
        let pairs = nearest.color.as_flattened().iter().zip(linear.color.as_flattened());
        let off = pairs.map(|(nearest, linear)| (nearest - linear).abs()).fold(0.0_f32, f32::max);
        // Devices may round the weights of texels to 1/256 (Vulkan 1.3, section 16.9.1), differently for each sampler. Without blending, the
        // colour would be off by about a half.
        assert!(if index == 0 { off == 0.0 } else { off < 0.01 }, "rasteriser {index}: {off}");
    }
}
