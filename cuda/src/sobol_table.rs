//! The order of the occlusion points in device memory.

/// The first Sobol points, bits reversed, in consecutive blocks of the sequence; each block is the longest of 4^m points that fits.
///
/// In a block of 4^m points, each of 4^m squares of the unit square has one point ([`owen_sobol`] says why). This holds after scrambling
/// too, which permutes the first m digits of each coordinate among themselves. The points of a block are sorted by these digits, those of
/// both coordinates interleaved, the first digits lowest. So a kernel finds the point that the scrambling moves into a given square without
/// searching (`sample_of_turn` in `programs/fan.cuh`).
///
/// [`owen_sobol`]: curitiba_passes::sampling::owen_sobol
fn in_blocks(mut points: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    // The reversed bits of the first coordinate are the index of the point.
    points.sort_unstable_by_key(|point| point[0]);
    let mut rest = points.as_mut_slice();
    while let Some(digits) = rest.len().checked_ilog(4) {
        let (block, after) = rest.split_at_mut(4_usize.pow(digits));
        block.sort_by_key(|point| square(*point, digits));
        rest = after;
    }
    points
}

/// The points of [`in_blocks`], then their indices there in the order in which the points were given, in which neighbours are adjacent.
pub fn table(points: Vec<[u32; 2]>) -> Vec<u32> {
    let sorted = in_blocks(points.clone());
    let mut places: Vec<(u32, u32)> = sorted.iter().zip(0..).map(|(point, place)| (point[0], place)).collect();
    places.sort_unstable();
    let mut table = sorted.into_flattened();
    // The first coordinate is the point's index in the sequence.
    table.extend(points.iter().map(|point| places[point[0] as usize].1));
    table
}

/// The first digits of both coordinates, interleaved.
fn square(point: [u32; 2], digits: u32) -> u64 {
    let bit = |digit: u32| {
        u64::from(point[0] >> digit & 1) << (2 * digit) | u64::from(point[1] >> digit & 1) << (2 * digit + 1)
    };
    (0..digits).map(bit).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_passes::sampling::HemisphereSampler;
    use curitiba_pipeline::programs::Sampler;

    fn points(samples: u32) -> Vec<[u32; 2]> {
        match HemisphereSampler::new(Sampler::Sobol, samples).expect("any number will do") {
            HemisphereSampler::Sobol(points) => points,
            HemisphereSampler::Strata { .. } => unreachable!("Sobol points were asked for"),
        }
    }

    #[test]
    fn the_numbers_after_the_points_lead_back_to_the_order_of_neighbours() {
        for samples in [1, 7, 100] {
            let (given, table) = (points(samples), table(points(samples)));
            let (sorted, numbers) = table.split_at(2 * samples as usize);
            let found: Vec<_> =
                numbers.iter().map(|n| [sorted[2 * *n as usize], sorted[2 * *n as usize + 1]]).collect();
            assert_eq!(found, given);
        }
    }

    #[test]
    fn each_block_has_one_point_in_each_square_at_the_squares_place() {
        for samples in [1, 3, 4, 25, 100, 256, 1000] {
            let sorted = in_blocks(points(samples));
            let (mut expected, mut found) = (points(samples), sorted.clone());
            expected.sort_unstable();
            found.sort_unstable();
            assert_eq!(found, expected, "the points are the same");
            let mut first = 0;
            while first < sorted.len() {
                let digits = (sorted.len() - first).ilog(4);
                for place in 0..4_usize.pow(digits) {
                    assert_eq!(square(sorted[first + place], digits), place as u64, "{samples} {first} {place}");
                }
                first += 4_usize.pow(digits);
            }
        }
    }
}
