//! The order of the occlusion points in device memory.

/// Consecutive Sobol points, bits reversed, in blocks; each block is the longest of 4^m points that the points left over allow.
///
/// In a block of the sequence of 4^m points that begins at a multiple of 4^m, each of 4^m squares of the unit square has one point ([`owen_sobol`]
/// says why). This holds after scrambling too, which permutes the first m digits of each coordinate among themselves. The place of a point in its
/// block is the index of its square: the first digits of both coordinates, interleaved, the first digits lowest. So a kernel finds the point that
/// the scrambling moves into a given square without a search (`sample_of_turn` in `programs/fan.cuh`).
///
/// Points that start elsewhere in the sequence may give blocks whose points are not consecutive, or do not begin at a multiple of 4^m: see
/// [`at_squares`]. Kernels take each point once, whatever its place; places decide only which rays are traced together.
///
/// [`owen_sobol`]: curitiba_passes::sampling::owen_sobol
fn in_blocks(mut points: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    // The reversed bits of the first coordinate are the index of the point.
    points.sort_unstable_by_key(|point| point[0]);
    let mut sorted = Vec::with_capacity(points.len());
    while let Some(digits) = points.len().checked_ilog(4) {
        let length = 4_usize.pow(digits);
        let is_whole = |block: &[[u32; 2]]| {
            let (first, last) = (block[0][0], block[length - 1][0]);
            first.is_multiple_of(length as u32) && (last - first) as usize == length - 1
        };
        let first = points.windows(length).position(is_whole).unwrap_or(0);
        sorted.extend(at_squares(points.drain(first..first + length), digits));
    }
    sorted
}

/// The 4^`digits` points of a block, each at the place of its square. Of several points in one square, the first gets the place of the square. The
/// other points get the places of empty squares, in the order of a Z-order curve, so that each is near its own square.
fn at_squares(block: impl ExactSizeIterator<Item = [u32; 2]>, digits: u32) -> Vec<[u32; 2]> {
    let mut places = vec![None; block.len()];
    let mut others = Vec::new();
    for point in block {
        let place = &mut places[square(point, digits) as usize];
        match place {
            None => *place = Some(point),
            Some(_) => others.push(point),
        }
    }
    let along_curve = |square: u64| square.reverse_bits();
    others.sort_unstable_by_key(|point| (along_curve(square(*point, digits)), point[0]));
    let mut free: Vec<usize> = (0..places.len()).filter(|place| places[*place].is_none()).collect();
    free.sort_unstable_by_key(|place| along_curve(*place as u64));
    for (place, point) in free.into_iter().zip(others) {
        places[place] = Some(point);
    }
    places.into_iter().flatten().collect()
}

/// The device table of these occlusion points: first both coordinates of each point, in blocks; then, for each point in the given order, its
/// place in these blocks. The points are consecutive in the Sobol sequence, but given in an order in which neighbours are adjacent, as in
/// [`HemisphereSampler::Sobol`].
///
/// [`HemisphereSampler::Sobol`]: curitiba_passes::sampling::HemisphereSampler::Sobol
#[must_use]
pub fn table(points: Vec<[u32; 2]>) -> Vec<u32> {
    let sorted = in_blocks(points.clone());
    let mut places: Vec<(u32, u32)> = sorted.iter().zip(0..).map(|(point, place)| (point[0], place)).collect();
    places.sort_unstable();
    let first = places.first().map_or(0, |(index, _)| *index);
    let mut table = sorted.into_flattened();
    table.extend(points.iter().map(|point| places[(point[0] - first) as usize].1));
    table
}

/// Index of the square that contains a point: the first `digits` digits of both coordinates, interleaved.
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

    fn points(first: u32, samples: u32) -> Vec<[u32; 2]> {
        match HemisphereSampler::from(Sampler::Sobol, first, samples).expect("far from the end of the sequence") {
            HemisphereSampler::Sobol(points) => points,
            HemisphereSampler::Strata { .. } => unreachable!("Sobol points were asked for"),
        }
    }

    /// Parts of the sequence: index of the first point, and number of points.
    const PARTS: [[u32; 2]; 8] =
        [[0, 1], [0, 7], [0, 100], [7, 25], [100, 100], [63, 2], [1_000_000, 333], [(1 << 24) - 64, 64]];

    #[test]
    fn the_numbers_after_the_points_lead_back_to_the_order_of_neighbours() {
        for [first, samples] in PARTS {
            let (given, table) = (points(first, samples), table(points(first, samples)));
            let (sorted, numbers) = table.split_at(2 * samples as usize);
            let found: Vec<_> =
                numbers.iter().map(|n| [sorted[2 * *n as usize], sorted[2 * *n as usize + 1]]).collect();
            assert_eq!(found, given, "{samples} from {first}");
        }
    }

    #[test]
    fn each_point_of_a_part_of_the_sequence_has_a_place() {
        for [first, samples] in PARTS {
            let (mut expected, mut found) = (points(first, samples), in_blocks(points(first, samples)));
            expected.sort_unstable();
            found.sort_unstable();
            assert_eq!(found, expected, "{samples} from {first}");
            assert!(found.iter().map(|point| point[0]).eq(first..first + samples), "{samples} from {first}");
        }
    }

    /// For each place of a table, the number of digits of its block, and the place within that block.
    fn places(samples: u32) -> Vec<(u32, u64)> {
        let mut places = Vec::new();
        while let Some(digits) = (samples - places.len() as u32).checked_ilog(4) {
            places.extend((0..1 << (2 * digits)).map(|place| (digits, place)));
        }
        places
    }

    #[test]
    fn each_block_has_one_point_in_each_square_at_the_squares_place() {
        // Parts of the sequence that begin at a multiple of their length and consist of whole blocks.
        let batches = [[0, 16], [48, 16], [16, 4], [128, 64], [1024, 256], [320, 80], [3 * 4096, 4096]];
        let all = [1, 3, 4, 25, 100, 256, 1000].map(|samples| [0, samples]).into_iter().chain(batches);
        for [first, samples] in all {
            let sorted = in_blocks(points(first, samples));
            for (point, (digits, place)) in sorted.into_iter().zip(places(samples)) {
                assert_eq!(square(point, digits), place, "{samples} from {first}");
            }
        }
    }

    /// Root mean square distance of points from the squares of their places, as a share of the distance for random places.
    fn distance(sorted: &[[u32; 2]]) -> f64 {
        let at = |bits: u32| f64::from(bits.reverse_bits()) / 2.0_f64.powi(32);
        let (mut sum, mut at_random) = (0.0, 0.0);
        for (point, (digits, place)) in sorted.iter().zip(places(sorted.len() as u32)) {
            for coordinate in [0, 1] {
                let bits =
                    (0..digits).fold(0, |bits, digit| bits | (place >> (2 * digit + coordinate as u32) & 1) << digit);
                let low = at(bits as u32);
                let side = 0.5_f64.powi(digits as i32);
                let off = at(point[coordinate]) - low;
                sum += (-off).max(off - side).max(0.0).powi(2);
                // The mean squared distance between two random numbers from 0 to 1 is 1/6.
                at_random += 1.0 / 6.0;
            }
        }
        (sum / at_random).sqrt()
    }

    /// Where blocks do not have one point in each square, most points are still near their places. This affects only the time.
    #[test]
    fn points_of_parts_between_blocks_are_near_their_places() {
        for [first, samples] in [[5, 16], [7, 25], [3, 64], [100, 100], [999, 1000]] {
            let own = distance(&in_blocks(points(first, samples)));
            // Control: the same points in the order of the sequence.
            let mut unsorted = points(first, samples);
            unsorted.sort_unstable();
            let other = distance(&unsorted);
            println!(
                "{samples} from {first}: {own:.3} of what places at random have, in the sequence's order {other:.3}"
            );
            assert!(own < 0.3 && other > 0.6, "{samples} from {first}: {own} and {other}");
        }
    }
}
