//! Hashes that identify the inputs of rows, and their pictures.

use super::model::Inputs;
use crate::pipeline::diagnostic::Problems;
use crate::pipeline::executor::Renderer;
use crate::pipeline::image::Image;
use crate::pipeline::project::Project;
use crate::pipeline::scene::fnv1a;
use rayon::prelude::*;

/// Number of pixels hashed by one task.
const CHUNK: usize = 1 << 14;

/// A hash as 32 hexadecimal digits, as in benchmark files.
#[must_use]
pub fn hex(hash: u128) -> String {
    format!("{hash:032x}")
}

/// A short identifier of a text, the same on every machine: the exclusive or of the two halves of the text's hash, as 16 hexadecimal digits.
#[must_use]
pub fn short_hash(text: &str) -> String {
    let hash = fnv1a(text.as_bytes());
    format!("{:016x}", (hash >> 64) as u64 ^ hash as u64)
}

/// A hash of a picture's colours, bit for bit, and of its size.
#[must_use]
pub fn picture_hash(picture: &Image) -> String {
    let hashes = picture.pixels.par_chunks(CHUNK).map(|pixels| {
        let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|value| value.to_bits().to_le_bytes()).collect();
        fnv1a(&bytes).to_be_bytes()
    });
    let mut hashes: Vec<[u8; 16]> = hashes.collect();
    hashes.push(fnv1a(format!("{} x {}", picture.width, picture.height).as_bytes()).to_be_bytes());
    hex(fnv1a(hashes.as_flattened()))
}

impl Inputs {
    /// The inputs of a renderer whose scenes are loaded.
    #[must_use]
    pub fn of(renderer: &Renderer) -> Self {
        let project = Project { problems: Problems::default(), ..renderer.plan().declared.clone() };
        let scenes: Vec<u8> = renderer.scenes().flat_map(|scene| scene.fingerprint().to_be_bytes()).collect();
        Self {
            // `Debug` prints enough digits to distinguish all numbers.
            project: hex(fnv1a(format!("{project:?}").as_bytes())),
            needs: format!("{:?}", renderer.plan().needs),
            scenes: hex(fnv1a(&scenes)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_differ_in_one_bit_have_other_hashes() {
        let picture = Image { width: 200, height: 100, pixels: vec![[0.25, 0.5, 0.75, 1.0]; 20_000] };
        let mut other = picture.clone();
        assert_eq!(picture_hash(&picture), picture_hash(&other));
        other.pixels[19_999][2] = f32::from_bits(0.75_f32.to_bits() + 1);
        assert_ne!(picture_hash(&picture), picture_hash(&other));
        let turned = Image { width: 100, height: 200, ..picture.clone() };
        assert_ne!(picture_hash(&picture), picture_hash(&turned));
    }

    #[test]
    fn short_hashes_are_stable() {
        assert_eq!(short_hash("a"), short_hash("a"));
        assert_ne!(short_hash("a"), short_hash("b"));
        assert_eq!(short_hash("").len(), 16);
    }
}
