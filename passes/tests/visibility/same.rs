//! Changes of the input that must not change a bit of the result.

use super::*;
use curitiba_passes::visibility::{Class, Sampler};

/// A room with some triangles in it.
fn scene() -> Vec<Triangle> {
    let mut random = Random(5);
    let mut scene = boxed(v(0.0, 0.0, 0.0), v(3.0, 2.0, 4.0), true);
    for _ in 0..12 {
        let at = random.point() * v(2.0, 1.0, 3.0) + v(0.5, 0.5, 0.5);
        scene.push([0, 1, 2].map(|_| at + random.point() * 0.6));
    }
    scene
}

#[test]
fn both_orders_of_a_pair_give_the_same_bits() {
    let scene = scene();
    let pairs = all_pairs(scene.len());
    let swapped: Vec<[u32; 2]> = pairs.iter().map(|[a, b]| [*b, *a]).collect();
    for facing in BOTH {
        for sampler in [Sampler::Sobol, Sampler::Hammersley] {
            let options = Options { facing, sampler, ..options(64) };
            let mut sampled = 0;
            for (there, back) in rows(&scene, &pairs, options).iter().zip(rows(&scene, &swapped, options)) {
                assert_eq!(there.visibility.map(f64::to_bits), back.visibility.map(f64::to_bits));
                assert_eq!((there.error, there.samples, there.valid), (back.error, back.samples, back.valid));
                assert_eq!(there.form_factors, back.form_factors.map(|[f, g]| [g, f]));
                sampled += usize::from(there.class == Class::Sampled);
            }
            assert!(sampled > 50, "{sampled}");
        }
    }
}

#[test]
fn areas_times_form_factors_are_the_same_both_ways() {
    let scene = scene();
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    for row in rows(&scene, &all_pairs(scene.len()), options(64)) {
        let [f, g] = row.form_factors.expect("asked for");
        let [there, back] = [f * surfaces.area(row.pair[0]), g * surfaces.area(row.pair[1])];
        assert!((there - back).abs() <= 1e-14 * there.abs(), "{row:?}");
    }
}

#[test]
fn the_order_of_the_triangles_changes_nothing_but_their_ids() {
    let scene = scene();
    let count = scene.len() as u32;
    let moved = |id: u32| (id * 7 + 3) % count;
    let mut other = scene.clone();
    for id in 0..count {
        other[moved(id) as usize] = scene[id as usize];
    }
    let pairs = all_pairs(scene.len());
    let moved_pairs: Vec<[u32; 2]> = pairs.iter().map(|pair| pair.map(moved)).collect();
    let (here, there) = (rows(&scene, &pairs, options(128)), rows(&other, &moved_pairs, options(128)));
    for (here, there) in here.iter().zip(there) {
        assert_eq!(Row { pair: there.pair, ..*here }, there);
    }
}

#[test]
fn threads_change_nothing_and_seeds_do() {
    let scene = scene();
    let pairs = all_pairs(scene.len());
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    let bvh = Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::Balanced);
    let on = |threads: usize, seed: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let estimator = Estimator::new(&surfaces, &bvh, Options { seed, ..options(64) }).expect("valid");
        let mut rows = Vec::new();
        pool.install(|| estimator.rows(&pairs, &mut rows));
        rows
    };
    let one = on(1, 0);
    assert_eq!(one, on(3, 0));
    let other = on(2, 1);
    assert_ne!(one, other);
    assert!(one.iter().all(|row| row.visibility.is_none_or(|v| (0.0..=1.0).contains(&v))));
    assert!(one.iter().zip(&other).all(|(a, b)| a.class == b.class));
}

#[test]
fn options_out_of_range_are_refused_with_what_would_be_valid() {
    let message = |effort: Effort| Options { effort, ..Options::default() }.check().expect_err("out of range");
    assert!(message(Effort::Samples(65)).contains("a multiple of 8 from 8 to 65536"));
    assert!(message(Effort::Samples(0)).contains("valid") && message(Effort::Samples(1 << 20)).contains("valid"));
    assert!(message(Effort::Error(f64::NAN)).contains("0.0001 to 1"));
    assert!(Options::default().check().is_ok());
}

#[test]
fn a_wanted_error_is_reached_by_more_samples() {
    let scene = [facing(), half_plane(0.25)].concat();
    for sampler in [Sampler::Sobol, Sampler::Hammersley] {
        let mut last = 0;
        for error in [0.1, 0.01, 0.002] {
            let options = Options { effort: Effort::Error(error), form_factors: false, sampler, ..Options::default() };
            let row = row(&scene, [0, 1], options);
            assert!(row.error <= error && row.samples >= last, "{row:?}");
            assert!((row.visibility.expect("seen") - 0.656_25).abs() < 4.0 * row.error.max(1e-4), "{row:?}");
            last = row.samples;
        }
        assert!(last > 64);
    }
}
