//! The pictures that `compare` reads: the body of the fuzz target `picture`.

use super::Folder;
use super::check::Outcome;
use curitiba_pipeline::image::MAX_SIDE;
use curitiba_pipeline::image::{Image, Layer, Picture, read_image, write_exr, write_png};
use std::path::Path;

/// Largest picture that is tried. Readers accept 16384 x 16384 pixels, far more than the fuzzer allows a run.
const MAX_PIXELS: u64 = 1 << 16;

/// Reads an input as PNG and as EXR.
pub fn picture(input: &[u8]) -> Outcome {
    if claimed_pixels(input) > MAX_PIXELS {
        return Outcome::Refused;
    }
    let folder = Folder::new();
    let read = ["picture.png", "picture.exr"].map(|name| {
        let path = folder.write(name, input);
        match read_image(&path) {
            Ok(picture) => {
                check(&picture);
                let again = read_image(&path).expect("what is read once is read again");
                assert!(same(&picture, &again), "a second reading differs");
                round_trip(&picture.image, picture.steps, folder.path());
                true
            }
            Err(error) => {
                assert!(error.path == path && !error.message.is_empty(), "{error}");
                false
            }
        }
    });
    assert!(read != [true, true], "no file is both");
    if read == [false, false] { Outcome::Refused } else { Outcome::Loaded }
}

/// Greatest number of pixels that the header of a PNG, or any data window of an EXR, claims.
fn claimed_pixels(input: &[u8]) -> u64 {
    const WINDOW: &[u8] = b"dataWindow\0box2i\0\x10\0\0\0";
    let words = |bytes: &[u8]| -> Vec<[u8; 4]> { bytes.as_chunks::<4>().0.to_vec() };
    if let Some(size) = input.get(16..24).filter(|_| input.starts_with(b"\x89PNG")) {
        return words(size).into_iter().map(|side| u64::from(u32::from_be_bytes(side))).product();
    }
    let windows = input.windows(WINDOW.len() + 16).filter(|bytes| bytes.starts_with(WINDOW));
    let area = |bytes: &[u8]| {
        let edges: Vec<i64> = words(&bytes[WINDOW.len()..]).into_iter().map(|e| i32::from_le_bytes(e).into()).collect();
        let side = |axis: usize| (edges[2 + axis] - edges[axis] + 1).max(0) as u64;
        side(0).saturating_mul(side(1))
    };
    windows.map(area).max().unwrap_or(0)
}

/// Asserts the guarantees of [`Picture`].
pub fn check(picture: &Picture) {
    let sound = |image: &Image| {
        assert!([image.width, image.height].iter().all(|side| (1..=MAX_SIDE).contains(side)));
        assert_eq!(image.pixels.len() as u64, u64::from(image.width) * u64::from(image.height));
    };
    sound(&picture.image);
    assert!(picture.channels.iter().all(|name| !name.is_empty()), "{:?}", picture.channels);
    if let Some(variance) = &picture.variance {
        sound(&variance.of_mean);
        assert_eq!([variance.of_mean.width, variance.of_mean.height], [picture.image.width, picture.image.height]);
        assert!(variance.samples.is_none_or(|samples| samples >= 2), "{:?}", variance.samples);
    }
    if let Some(steps) = picture.steps {
        assert!(steps == 255 || steps == 65_535, "{steps} steps");
        for value in picture.image.pixels.iter().flatten() {
            let step = (value * steps as f32).round();
            assert!((0.0..=1.0).contains(value) && step / steps as f32 == *value, "{value} is no step of {steps}");
        }
    }
}

/// Asserts that a picture that was read can be written, and is read back unchanged.
fn round_trip(image: &Image, steps: Option<u32>, folder: &Path) {
    let (png, exr) = (folder.join("written.png"), folder.join("written.exr"));
    write_exr(&exr, Layer { name: "window", channels: ["R", "G", "B", "A"], image }).expect("it can be written");
    let read = read_image(&exr).expect("a written EXR is read");
    assert!(same_pixels(image, &read.image), "an EXR holds other values");
    write_png(&png, image).expect("it can be written");
    let read = read_image(&png).expect("a written PNG is read").image;
    let colors = |image: &Image| -> Vec<[u32; 3]> {
        image.pixels.iter().map(|[r, g, b, _]| [r, g, b].map(|value| value.to_bits())).collect()
    };
    assert!(steps != Some(255) || colors(image) == colors(&read), "a PNG holds other colours");
}

fn same(one: &Picture, other: &Picture) -> bool {
    let variance = match (&one.variance, &other.variance) {
        (Some(one), Some(other)) => one.samples == other.samples && same_pixels(&one.of_mean, &other.of_mean),
        (one, other) => one.is_none() && other.is_none(),
    };
    variance && one.channels == other.channels && one.steps == other.steps && same_pixels(&one.image, &other.image)
}

/// Compares bit by bit, since pictures may hold NaN.
fn same_pixels(one: &Image, other: &Image) -> bool {
    let bits = |image: &Image| -> Vec<[u32; 4]> { image.pixels.iter().map(|p| p.map(f32::to_bits)).collect() };
    [one.width, one.height] == [other.width, other.height] && bits(one) == bits(other)
}
