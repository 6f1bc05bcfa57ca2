//! References with many samples, divided into blocks that several processes can render.
//!
//! A reference is the mean of two estimates. A block consists of a fixed number of samples of each estimate, and the two pictures of a block do not
//! depend on the process that renders it. The reference is the mean of its blocks, in `f64` and in their order, so it is the same, bit for bit,
//! however the blocks were distributed. Blocks are stored in the folder of the references until they are joined, so a killed run can be continued.

use super::cache::{Entry, Folder};
use super::{ReferenceError, mean_of_two};
use crate::pipeline::executor::RenderError;
use crate::pipeline::image::Image;
use crate::pipeline::memory::{self, Refused};
use crate::shard::Shard;
use std::time::{Duration, Instant};

/// The blocks of a reference.
pub(super) struct Blocks<'a> {
    /// Folder in which the blocks are stored.
    pub folder: &'a Folder,
    /// Everything that determines a block, except its index.
    pub base: String,
    /// Number of blocks; with a single block only the reference is stored.
    pub count: u32,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
}

/// Result of a process's work on a reference.
#[derive(Debug)]
pub(super) enum Done {
    /// The complete reference: picture, its estimated error, and the total time of rendering, summed over processes.
    Whole(Entry),
    /// The blocks of a shard.
    Part(Part),
}

/// State of the blocks of a reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Number of blocks.
    pub blocks: u32,
    /// Number of blocks of the shard.
    pub mine: u32,
    /// Number of blocks of the shard that were stored already.
    pub found: u32,
    /// Number of blocks of all shards that are stored now.
    pub kept: u32,
}

/// The two estimates of a block, or of the whole reference.
type Estimates = [Image; 2];

impl Blocks<'_> {
    /// Renders the blocks of a shard that are not stored yet; joins all blocks into the reference if the shard is `Shard::WHOLE`.
    pub fn work(
        &self,
        shard: Shard,
        warnings: &mut Vec<String>,
        render: &mut dyn FnMut(u32) -> Result<Estimates, ReferenceError>,
    ) -> Result<Done, ReferenceError> {
        if shard == Shard::WHOLE {
            return self.whole(warnings, render).map(Done::Whole);
        }
        let (mut mine, mut found) = (0, 0);
        for block in (0..self.count).filter(|block| shard.has(*block as usize)) {
            mine += 1;
            if self.load(block, warnings).is_some() {
                found += 1;
                continue;
            }
            let start = Instant::now();
            let estimates = render(block)?;
            self.store(block, &estimates, start.elapsed())?.map_err(ReferenceError::Keep)?;
        }
        let kept = (0..self.count).filter(|block| self.folder.has(&self.material(*block))).count() as u32;
        Ok(Done::Part(Part { blocks: self.count, mine, found, kept }))
    }

    fn whole(
        &self,
        warnings: &mut Vec<String>,
        render: &mut dyn FnMut(u32) -> Result<Estimates, ReferenceError>,
    ) -> Result<Entry, ReferenceError> {
        if self.count == 1 {
            let start = Instant::now();
            let [first, second] = render(0)?;
            let (picture, own_error) = mean_of_two(first, &second);
            return Ok(Entry { picture, own_error, took: start.elapsed() });
        }
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let refused = |refused: Refused| RenderError::from(refused);
        let mut sums = [vec![], vec![]];
        for sum in &mut sums {
            *sum = memory::filled([0.0_f64; 4], pixels).map_err(refused)?;
        }
        let mut took = Duration::ZERO;
        for block in 0..self.count {
            let (estimates, seconds) = match self.load(block, warnings) {
                Some(kept) => kept,
                None => {
                    let start = Instant::now();
                    let estimates = render(block)?;
                    let seconds = start.elapsed();
                    // If storing fails, another run has to render the block again; nothing else is lost.
                    self.store(block, &estimates, seconds)?.unwrap_or_else(|why| warnings.push(why));
                    (estimates, seconds)
                }
            };
            took += seconds;
            for (sum, Image { pixels, .. }) in sums.iter_mut().zip(&estimates) {
                for (sum, pixel) in sum.iter_mut().zip(pixels) {
                    *sum = std::array::from_fn(|i| sum[i] + f64::from(pixel[i]));
                }
            }
        }
        let [width, height] = self.size;
        let mut means = [Image { width, height, pixels: vec![] }, Image { width, height, pixels: vec![] }];
        for (mean, sum) in means.iter_mut().zip(sums) {
            mean.pixels = memory::with_capacity(pixels).map_err(refused)?;
            let count = f64::from(self.count);
            mean.pixels.extend(sum.iter().map(|sum| sum.map(|sum| (sum / count) as f32)));
        }
        let [first, second] = means;
        let (picture, own_error) = mean_of_two(first, &second);
        Ok(Entry { picture, own_error, took })
    }

    /// Removes the blocks of a reference, which are not needed once the reference is stored.
    pub fn forget(&self) {
        if self.count > 1 {
            (0..self.count).for_each(|block| self.folder.forget(&self.material(block)));
        }
    }

    fn material(&self, block: u32) -> String {
        format!("{}\nblock {block}", self.base)
    }

    /// A stored block, and the time of rendering it; `None` if it is not stored, or damaged, which adds a warning.
    fn load(&self, block: u32, warnings: &mut Vec<String>) -> Option<(Estimates, Duration)> {
        let [width, height] = self.size;
        match self.folder.load(&self.material(block), [width, 2 * height]) {
            Ok(kept) => kept.map(|Entry { picture: mut first, took, .. }| {
                let second = first.pixels.split_off(first.pixels.len() / 2);
                first.height = height;
                ([first, Image { width, height, pixels: second }], took)
            }),
            Err(why) => {
                warnings.push(format!("{why}; it is rendered again"));
                None
            }
        }
    }

    /// Stores a block as one picture, the second estimate below the first. The inner error says why it cannot be stored; the outer one is a
    /// lack of memory.
    fn store(
        &self,
        block: u32,
        [first, second]: &Estimates,
        took: Duration,
    ) -> Result<Result<(), String>, RenderError> {
        let mut pixels = memory::with_capacity(2 * first.pixels.len())?;
        pixels.extend_from_slice(&first.pixels);
        pixels.extend_from_slice(&second.pixels);
        let picture = Image { width: first.width, height: 2 * first.height, pixels };
        Ok(self.folder.store(&self.material(block), &Entry { picture, own_error: 0.0, took }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A test block. Sums of such values differ in their last bits if they are added in another order, or in `f32`.
    fn block(index: u32) -> Estimates {
        let value = |half: u32, i: u32| (0.1 + f32::from(index as u16) * 0.37 + (half * 7 + i) as f32).sin();
        [0, 1].map(|half| Image {
            width: 3,
            height: 2,
            pixels: (0..6).map(|i| [value(half, i), 1.0 / 3.0, 0.7, 1.0]).collect(),
        })
    }

    fn whole(done: Done) -> Entry {
        match done {
            Done::Whole(entry) => entry,
            Done::Part(part) => panic!("{part:?}"),
        }
    }

    #[test]
    fn however_blocks_are_shared_out_their_mean_is_the_same() {
        let render = &mut |index| Ok(block(index));
        let mut means = Vec::new();
        for shards in [1, 2, 3, 7, 20_u64] {
            let place = tempfile::tempdir().expect("a folder");
            let folder = Folder::new(place.path().to_owned());
            let blocks = Blocks { folder: &folder, base: "base".to_owned(), count: 16, size: [3, 2] };
            let mut warnings = Vec::new();
            if shards > 1 {
                for index in (0..shards).rev() {
                    let done = blocks.work(Shard { index, count: shards }, &mut warnings, render).expect("rendered");
                    let Done::Part(part) = done else { panic!("a shard joins nothing") };
                    assert_eq!((part.blocks, part.found), (16, 0));
                }
                let again = blocks.work(Shard { index: 0, count: shards }, &mut warnings, &mut |_| panic!("again"));
                let Ok(Done::Part(part)) = again else { panic!("{again:?}") };
                assert_eq!((part.found, part.kept), (part.mine, 16));
            }
            let mut rendered = 0;
            let mut count = |index| {
                rendered += 1;
                Ok(block(index))
            };
            let entry = whole(blocks.work(Shard::WHOLE, &mut warnings, &mut count).expect("joined"));
            assert_eq!(rendered, if shards > 1 { 0 } else { 16 });
            assert_eq!(warnings, Vec::<String>::new());
            means.push((entry.picture, entry.own_error.to_bits()));
            blocks.forget();
            assert_eq!(std::fs::read_dir(place.path()).expect("the folder").count(), 0, "joined blocks are removed");
        }
        assert!(means.iter().all(|mean| *mean == means[0]));
        // The mean of all values, computed in another way.
        let of = |half: usize| (0..16).map(|index| f64::from(block(index)[half].pixels[4][0])).sum::<f64>() / 16.0;
        let (expected, found) = (f64::midpoint(of(0), of(1)), f64::from(means[0].0.pixels[4][0]));
        assert!((expected - found).abs() < 1e-7, "{expected} {found}");
    }

    #[test]
    fn a_run_that_was_given_up_goes_on_and_a_damaged_block_is_rendered_again() {
        let place = tempfile::tempdir().expect("a folder");
        let folder = Folder::new(place.path().to_owned());
        let blocks = Blocks { folder: &folder, base: "base".to_owned(), count: 4, size: [3, 2] };
        let mut warnings = Vec::new();
        let given_up = &mut |index| if index < 2 { Ok(block(index)) } else { Err(RenderError::Cancelled.into()) };
        blocks.work(Shard::WHOLE, &mut warnings, given_up).expect_err("given up");
        let (exr, _) = folder.files(&blocks.material(1));
        std::fs::write(exr, b"torn").expect("written");
        let mut rendered = Vec::new();
        let mut render = |index| {
            rendered.push(index);
            Ok(block(index))
        };
        let entry = whole(blocks.work(Shard::WHOLE, &mut warnings, &mut render).expect("rendered"));
        assert_eq!(rendered, [1, 2, 3]);
        assert!(warnings[0].contains("rendered again"), "{warnings:?}");
        let elsewhere = tempfile::tempdir().expect("a folder");
        let folder = Folder::new(elsewhere.path().to_owned());
        let alone = Blocks { folder: &folder, ..blocks };
        let once = whole(alone.work(Shard::WHOLE, &mut Vec::new(), &mut |index| Ok(block(index))).expect("rendered"));
        assert_eq!(entry.picture, once.picture);
    }
}
