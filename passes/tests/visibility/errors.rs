//! How often an interval of standard errors contains the true visibility.

use super::*;
use curitiba_passes::visibility::{Class, REPLICATES};

/// A pair of triangles with some triangles between them.
fn pair(seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for _ in 0..10 {
        random.number();
    }
    let tilt = |random: &mut Random| v(0.0, 0.0, 0.3 * random.number() as f32);
    let [a, b] = facing();
    let mut scene = vec![a.map(|corner| corner + tilt(&mut random)), b.map(|corner| corner - tilt(&mut random))];
    let count = 1 + (random.number() * 8.0) as usize;
    for _ in 0..count {
        let at = v(0.3, 0.3, 0.5) + (random.point() - 0.5) * v(0.8, 0.8, 0.2);
        scene.push([0, 1, 2].map(|_| at + (random.point() - 0.5) * 0.9));
    }
    scene
}

#[test]
fn intervals_of_95_percent_hold_the_truth_in_930_to_970_of_1000_pairs() {
    let counts = [64, 256];
    let [mut tried, mut covered, mut one_set] = [[0; 2]; 3];
    let mut seed = 0;
    // Each pair is used for both numbers of samples, because most of the time goes into its true visibility.
    while tried != [1000; 2] {
        seed += 1;
        let scene = pair(seed);
        let Some(truth) = truth(&scene, 16_384).filter(|truth| (0.05..=0.95).contains(truth)) else { continue };
        for (index, samples) in counts.into_iter().enumerate() {
            if tried[index] == 1000 {
                continue;
            }
            let row = row(&scene, [0, 1], Options { form_factors: false, ..options(samples) });
            let Some(found) = row.visibility.filter(|_| row.class == Class::Sampled) else { continue };
            tried[index] += 1;
            let off = (found - truth).abs();
            covered[index] += u32::from(off <= Row::QUANTILE * row.error);
            // Negative control: the standard error of as many independent samples is too large.
            let naive = (found * (1.0 - found) / f64::from(row.valid)).sqrt();
            one_set[index] += u32::from(off <= 1.96 * naive);
        }
    }
    for ((samples, covered), one_set) in counts.into_iter().zip(covered).zip(one_set) {
        println!("{samples} samples: {covered} of 1000 intervals hold the truth; {one_set} of the naive ones");
        assert!((930..=970).contains(&covered), "{samples} samples: {covered}");
        assert!(samples < 256 || one_set > 970, "the control is told from it: {one_set}");
    }
    assert_eq!(REPLICATES, 8);
}

#[test]
fn where_all_samples_agree_the_error_is_the_rule_of_three() {
    let [a, b] = facing();
    let speck = [v(0.3, 0.3, 0.5), v(0.300_1, 0.3, 0.5), v(0.3, 0.300_1, 0.5)];
    let row = row(&[a, b, speck], [0, 1], options(64));
    assert_eq!((row.class, row.visibility, row.error), (Class::Sampled, Some(1.0), 3.0 / 64.0));
    let holed = [half_plane(20.0).to_vec(), Vec::new()].concat();
    let scene = [vec![a, b], holed[..1].to_vec(), vec![]].concat();
    let row = super::row(&scene, [0, 1], options(64));
    assert!(row.visibility.is_some_and(|seen| seen > 0.0), "{row:?}");
}
