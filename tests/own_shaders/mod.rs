//! Shared code for the tests of projects' own shaders.
#![allow(dead_code, reason = "each test uses a part, and without the feature `glsl` little")]

use curitiba::pipeline::image::Image;
use curitiba::{Choice, RasterChoice};

/// Pixels along a side.
pub const SIDE: u32 = 64;

/// Whether a driver is available. Prints that it is missing otherwise.
pub fn has_driver() -> bool {
    let choice = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
    let Err(error) = curitiba::engines::rasteriser(choice) else { return true };
    assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
    println!("skipped: {error}");
    false
}

/// Asserts that every pixel, by column and row from the top, differs from the known colour by at most `most`.
#[track_caller]
pub fn assert_near(picture: &Image, known: impl Fn(u32, u32) -> [f32; 4], most: f32) {
    assert_eq!((picture.width, picture.height), (SIDE, SIDE));
    for (index, pixel) in (0..).zip(&picture.pixels) {
        let (x, y) = (index % SIDE, index / SIDE);
        let wanted = known(x, y);
        let off = pixel.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off <= most, "pixel {x}, {y}: {pixel:?}, and {wanted:?} is right");
    }
}
