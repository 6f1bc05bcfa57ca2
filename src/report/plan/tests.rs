//! Tests of what is planned, and what is left out.

use super::*;
use std::collections::HashSet;

#[test]
fn every_effect_is_measured_both_ways_and_shown() {
    for quick in [false, true] {
        let entries = entries(&Wanted::new(quick, None), false, &[BackendChoice::Cpu, BackendChoice::Optix]);
        for effect in Effect::ALL {
            for technique in [Technique::Rays, Technique::Raster] {
                let of = || entries.iter().filter(move |e| e.effect == effect.id() && e.technique == technique);
                assert!(of().any(|entry| entry.picture.is_some() && entry.in_table), "{effect:?} {technique:?}");
                let settings = of().filter(|entry| entry.setting.is_some()).count();
                assert!(settings > 1 || technique == Technique::Rays, "{effect:?}");
            }
        }
        let distinct: HashSet<String> =
            entries.iter().map(|e| format!("{} {} {:?} {} {:?}", e.file, e.panes, e.set, e.on_cpu, e.beside)).collect();
        assert_eq!(distinct.len(), entries.len(), "no row is measured twice");
        assert!(entries.is_sorted_by_key(|entry| entry.stage));
    }
}

#[test]
fn a_machine_with_a_gpu_measures_the_cpu_rasteriser_beside_it() {
    let wanted = Wanted::new(false, None);
    let (without, with) = (entries(&wanted, false, &[]), entries(&wanted, true, &[]));
    assert!(without.iter().all(|entry| !entry.on_cpu));
    let added: Vec<_> = with.iter().filter(|entry| entry.on_cpu).collect();
    assert_eq!(added.len(), with.len() - without.len());
    assert_eq!(added.len(), 9);
}

#[test]
fn some_rays_to_a_disc_have_a_filter() {
    let entries = entries(&Wanted::new(true, None), false, &[]);
    let soft = |e: &&Entry| e.technique == Technique::Rays && e.set.iter().any(|set| set == SUN);
    let (filtered, others): (Vec<_>, Vec<_>) = entries.iter().filter(soft).partition(|entry| entry.is_filtered());
    assert!(others.len() > 2 && filtered.len() == 2, "{} and {}", others.len(), filtered.len());
    assert!(filtered.iter().all(|entry| entry.set.iter().any(|set| set == "pass2.filter=1")));
}

#[test]
fn every_usual_row_by_rays_is_measured_on_the_other_ray_backends_too() {
    let wanted = Wanted::new(true, None);
    let alone = entries(&wanted, false, &[]);
    let usual = |entry: &&Entry| entry.technique == Technique::Rays && entry.in_table && !entry.is_filtered();
    let backends = [BackendChoice::Cpu, BackendChoice::Optix];
    let all = entries(&wanted, false, &backends);
    for backend in backends {
        let added: Vec<_> = all.iter().filter(|entry| entry.beside == Some(backend)).collect();
        assert_eq!(added.len(), alone.iter().filter(usual).count());
        assert!(added.iter().all(|entry| entry.label.ends_with(backend.name()) && entry.picture.is_none()));
    }
    let place = |found: &dyn Fn(&&Entry) -> bool| all.iter().position(|entry| found(&entry));
    let first = place(&|entry| entry.beside.is_some()).expect("one is there");
    assert!(all[..first].iter().filter(usual).count() == alone.iter().filter(usual).count(), "the report's come first");
}

#[test]
fn what_does_not_fit_is_refused_with_its_cost_and_what_is_left() {
    let plan = TimePlan { total_s: 100.0, spent_s: 50.0 };
    assert_eq!(plan.left_s(Stage::Triangles), 46.0);
    assert!(plan.admit(Stage::Triangles, 46.0).is_ok());
    let why = plan.admit(Stage::Triangles, 47.5).expect_err("too long");
    assert!(why.contains("47.5 s") && why.contains("46.0 s"), "{why}");
    let late = TimePlan { total_s: 100.0, spent_s: 99.0 };
    assert_eq!(late.left_s(Stage::Triangles), 0.0);
    assert!(late.admit(Stage::Effects, f64::NAN).is_err());
}

#[test]
fn slow_rows_get_few_frames_and_fast_ones_no_more_than_the_most() {
    assert_eq!(frames(10.0, 100.0, 15), 10);
    assert_eq!((frames(1e9, 100.0, 15), frames(1e-9, 100.0, 15), frames(f64::NAN, 100.0, 15)), (3, 15, 15));
    assert_eq!(frames(1e9, 100.0, 1), 1);
}

#[test]
fn threads_are_doubled_up_to_all() {
    assert_eq!(thread_counts(1), [1]);
    assert_eq!(thread_counts(2), [1, 2]);
    assert_eq!(thread_counts(6), [1, 2, 4, 6]);
    assert_eq!(thread_counts(16), [1, 2, 4, 8, 16]);
}

#[test]
fn each_light_asks_for_rays_of_its_own_and_soft_shadows_are_left_to_the_long_report() {
    let [long, quick] = [false, true].map(|quick| light_lines(&Wanted::new(quick, None)));
    let techniques = |lines: &[Entry]| lines.iter().map(|line| line.technique).collect::<Vec<_>>();
    assert_eq!(techniques(&quick), [Technique::None, Technique::Rays]);
    assert_eq!(techniques(&long), [Technique::None, Technique::Rays, Technique::Rays]);
    assert!(long[2].set.contains(&SUN.to_owned()));
    for line in &long {
        let eight = lit_by(line, 8);
        let times = if line.technique == Technique::Rays { 8.0 } else { 1.0 };
        assert_eq!((eight.weight, eight.stage), (times * line.weight, Stage::Lights));
    }
    assert!(Stage::Pixels.until() < Stage::Lights.until() && Stage::Lights.until() < Stage::Threads.until());
    assert_eq!([1, 2].map(|count| scaling_name(Against::Lights, count)), ["1 light", "2 lights"]);
}

#[test]
fn window_sizes_grow_by_four_around_the_reports() {
    let sizes = pixel_sizes(&Wanted::new(false, Some([512, 256])));
    assert_eq!(sizes, [[128, 64], [256, 128], [512, 256], [1024, 512], [2048, 1024]]);
    assert_eq!(pixel_sizes(&Wanted::new(true, Some([20, 20]))), [[20, 20], [40, 40]]);
}

#[test]
fn the_full_report_measures_every_effect_in_both_views() {
    let of = |quick, effect: &str, panes| {
        let entries = entries(&Wanted::new(quick, None), false, &[BackendChoice::Optix]);
        let found = entries.iter().filter(|entry| entry.in_table && entry.beside.is_none());
        found.filter(|entry| entry.effect == effect && entry.panes == panes).count()
    };
    for effect in ["shadows", "soft-shadows", "ao", "all", "all-but-ao"] {
        assert_eq!(of(false, effect, true), of(false, effect, false), "{effect}");
        assert_eq!((of(true, effect, true), of(true, effect, false) > 0), (0, true), "{effect}, quick");
    }
    for effect in ["reflection", "refraction"] {
        assert_eq!(of(true, effect, true), of(true, effect, false), "{effect}");
    }
}

#[test]
fn some_rows_take_several_samples_a_pixel_beside_one_that_takes_one() {
    for quick in [false, true] {
        let wanted = Wanted::new(quick, None);
        let (usual, rows) = (entries(&wanted, false, &[]), pixel_samples(&wanted));
        let key = |e: &Entry| (e.file, e.panes, e.set.clone(), e.on_cpu, e.beside);
        for (single, several) in &rows {
            assert!(usual.iter().any(|entry| entry.in_table && key(entry) == key(single)), "{}", single.label);
            assert_eq!((single.aa, key(several)), (PixelSamples::ONE, key(single)));
            assert!(several.aa.are_several() && several.setting.is_none() && several.picture.is_none());
            assert_eq!(several.weight, single.weight * f64::from(several.aa.count()));
            assert!(several.aa.tolerance().is_none() || several.technique == Technique::Rays, "{}", several.label);
        }
        let counts: Vec<u32> = rows.iter().map(|(_, several)| several.aa.count()).collect();
        assert!(counts.is_sorted() && counts.contains(&4) && counts.contains(&16));
        assert!(rows.iter().any(|(_, several)| several.aa.tolerance().is_some()));
        let effects: HashSet<&str> = rows.iter().map(|(single, _)| single.effect).collect();
        assert_eq!(
            Effect::ALL.iter().filter(|effect| effects.contains(effect.id())).count(),
            if quick { 1 } else { 5 }
        );
    }
    assert!(
        Stage::Paired.until() < Stage::PixelSamples.until() && Stage::PixelSamples < Stage::Rounds,
        "after the verdicts"
    );
}
