use super::*;
use crate::pipeline::plan::{Plan, Settings};
use crate::pipeline::project;
use std::path::Path;

/// A simulated machine: each candidate adds a known time and a known error. Times are noisy; the same runs in the same order give the same
/// noise.
struct Simulated {
    /// For each slot and candidate: milliseconds, and error.
    adds: Vec<Vec<(f64, f64)>>,
    /// Largest deviation of a frame from its time, as a share.
    noise: f64,
    state: u64,
    runs: Vec<Variant>,
    broken: Option<Variant>,
}

impl Simulated {
    fn new(adds: &[&[(f64, f64)]], noise: f64, seed: u64) -> Self {
        let adds = adds.iter().map(|slot| slot.to_vec()).collect();
        Self { adds, noise, state: seed, runs: Vec::new(), broken: None }
    }

    fn counts(&self) -> Vec<usize> {
        self.adds.iter().map(Vec::len).collect()
    }

    fn truth(&self, variant: &[usize]) -> (f64, f64) {
        let parts = self.adds.iter().zip(variant).map(|(slot, candidate)| slot[*candidate]);
        let (ms, squares) = parts.fold((5.0, 0.0), |(ms, squares), (add, error)| (ms + add, squares + error * error));
        (ms, squares.sqrt())
    }

    /// Uniform in [-1, 1): the generator of Knuth's MMIX.
    fn random(&mut self) -> f64 {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

impl Machine for Simulated {
    fn run(&mut self, variant: &[usize]) -> Result<Run, String> {
        self.runs.push(variant.to_vec());
        if self.broken.as_deref() == Some(variant) {
            return Err("the device was lost".to_owned());
        }
        let (ms, error) = self.truth(variant);
        let frames_ms = (0..5).map(|_| ms * (1.0 + self.noise * self.random())).collect();
        Ok(Run { frames_ms, error })
    }
}

/// Milliseconds and error of each candidate: the declared 100 samples, 16 and 4 samples, and two maps.
const OCCLUSION: &[(f64, f64)] = &[(100.0, 0.01), (20.0, 0.025), (6.0, 0.05), (9.0, 0.08), (30.0, 0.07)];
const SHADOWS: &[(f64, f64)] = &[(14.0, 0.0), (8.0, 0.03), (20.0, 0.02)];

fn find(machine: &mut Simulated, goal: Goal) -> Found {
    let counts = machine.counts();
    search(&counts, goal, machine, &mut |_| {})
}

fn best(found: &Found) -> Option<&[usize]> {
    found.ranked.first().map(|index| found.trials[*index].variant.as_slice())
}

#[test]
fn the_least_error_within_a_time_is_found_and_the_least_time_within_an_error() {
    for (goal, expected) in [
        (Goal::Time(200.0), Some([0].as_slice())),
        (Goal::Time(30.0), Some(&[1])),
        (Goal::Time(12.0), Some(&[2])),
        (Goal::Time(10.0), None),
        (Goal::Error(0.03), Some(&[1])),
        (Goal::Error(0.06), Some(&[2])),
        (Goal::Error(0.001), None),
    ] {
        let found = find(&mut Simulated::new(&[OCCLUSION], 0.0, 1), goal);
        assert_eq!(best(&found), expected, "{goal:?}");
        assert_eq!(found.trials.len(), OCCLUSION.len());
    }
}

#[test]
fn passes_are_tuned_together() {
    for (goal, expected) in [
        (Goal::Time(45.0), [1, 0]),
        (Goal::Time(34.0), [1, 1]),
        (Goal::Time(20.0), [2, 1]),
        (Goal::Error(0.03), [1, 0]),
        (Goal::Error(0.045), [1, 1]),
    ] {
        let mut machine = Simulated::new(&[OCCLUSION, SHADOWS], 0.0, 1);
        let found = find(&mut machine, goal);
        assert_eq!(best(&found), Some(expected.as_slice()), "{goal:?}");
        // By brute force over all combinations.
        let all = (0..5).flat_map(|a| (0..3).map(move |b| [a, b]));
        let truth = all.map(|variant| (machine.truth(&variant), variant)).filter(|((ms, error), _)| match goal {
            Goal::Time(most) => *ms <= most,
            Goal::Error(most) => *error <= most,
        });
        let key = |((ms, error), _): &((f64, f64), [usize; 2])| match goal {
            Goal::Time(_) => (*error, *ms),
            Goal::Error(_) => (*ms, *error),
        };
        let (_, brute) = truth.min_by(|a, b| key(a).partial_cmp(&key(b)).expect("numbers")).expect("something fits");
        assert_eq!(brute, expected, "{goal:?}");
    }
}

#[test]
fn of_very_many_combinations_the_best_is_found() {
    // Six passes with the less time the more error, and a last one of whose candidates only the last is fast.
    let candidate = |slot: usize, index: usize| {
        let (slot, times) = (slot as f64, (index + 1) as f64);
        ((30.0 + slot) / times, 0.01 * (1.0 + 0.1 * slot) * times)
    };
    let mut adds: Vec<Vec<(f64, f64)>> =
        (0..6).map(|slot| (0..6).map(|index| candidate(slot, index)).collect()).collect();
    adds.push(vec![(100.0, 0.01), (90.0, 0.5), (80.0, 0.5), (70.0, 0.5), (60.0, 0.5), (5.0, 0.02)]);
    let slots: Vec<&[(f64, f64)]> = adds.iter().map(Vec::as_slice).collect();
    let mut machine = Simulated::new(&slots, 0.0, 1);
    let (goal, most) = (Goal::Time(97.3), 97.3);
    let found = find(&mut machine, goal);
    let (_, error) = machine.truth(best(&found).expect("something fits"));
    // By brute force over all combinations.
    let squares = (0..6_usize.pow(7)).filter_map(|mut number| {
        let (mut ms, mut square) = (5.0, 0.0);
        for slot in &adds {
            let (add, error) = slot[number % 6];
            number /= 6;
            ms += add;
            square += error * error;
        }
        (ms <= most).then_some(square)
    });
    let least = squares.min_by(f64::total_cmp).expect("something fits").sqrt();
    assert!((error / least - 1.0).abs() < 1e-9, "{error} {least}");
}

#[test]
fn noise_changes_the_choice_in_few_of_a_hundred_searches() {
    let same = (0..100)
        .filter(|seed| {
            let mut machine = Simulated::new(&[OCCLUSION, SHADOWS], 0.05, *seed);
            best(&find(&mut machine, Goal::Time(45.0))) == Some(&[1, 0])
        })
        .count();
    assert!(same >= 99, "{same}");
}

#[test]
fn the_chosen_and_the_two_next_best_are_measured_most() {
    let mut machine = Simulated::new(&[OCCLUSION], 0.02, 7);
    let found = find(&mut machine, Goal::Time(200.0));
    let frames = |index: usize| found.trials[index].frames_ms.len();
    assert!(found.ranked[..3].iter().all(|index| frames(*index) >= 15), "{found:?}");
    assert!(found.ranked[3..].iter().all(|index| frames(*index) == 5), "{found:?}");
}

#[test]
fn noise_changes_the_fastest_within_an_error_in_few_of_a_hundred_searches() {
    let same = (0..100)
        .filter(|seed| {
            let mut machine = Simulated::new(&[OCCLUSION, SHADOWS], 0.05, *seed);
            best(&find(&mut machine, Goal::Error(0.045))) == Some(&[1, 1])
        })
        .count();
    assert!(same >= 99, "{same}");
}

/// The wide interval of a variant overlaps that of the fastest one. The variant is not chosen for its error if its median is a quarter longer.
#[test]
fn an_uncertain_time_is_no_reason_to_choose_a_slower_variant() {
    let trial = |frames_ms: &[f64], error| Trial { variant: Vec::new(), frames_ms: frames_ms.to_vec(), error };
    let sure: Vec<f64> = (0..27).map(|frame| 8.4 + 0.01 * f64::from(frame)).collect();
    let fast = trial(&sure, 0.05);
    let unsure = trial(&[8.0, 8.1, 10.4, 10.6, 11.0, 11.2, 11.9], 0.03);
    assert!(unsure.interval().low < fast.interval().high, "its interval reaches the other");
    assert_eq!(ranked(&[unsure, fast.clone()], Goal::Error(0.06)), [1, 0]);
    // Control: of two with the same times, the one with less error.
    assert_eq!(ranked(&[fast.clone(), trial(&sure, 0.03)], Goal::Error(0.06)), [1, 0]);
}

/// Two candidates whose times cannot be told apart: the one with less error is chosen.
#[test]
fn of_candidates_alike_in_time_the_one_with_less_error_is_chosen() {
    for seed in 0..20 {
        let mut machine = Simulated::new(&[&[(50.0, 0.0), (10.0, 0.02), (10.01, 0.01)]], 0.05, seed);
        assert_eq!(best(&find(&mut machine, Goal::Error(0.03))), Some([2].as_slice()), "seed {seed}");
    }
}

#[test]
fn a_variant_that_fails_is_told_and_the_others_are_measured() {
    let mut machine = Simulated::new(&[OCCLUSION], 0.0, 1);
    machine.broken = Some(vec![1]);
    let found = find(&mut machine, Goal::Time(30.0));
    assert_eq!(found.missing, [(vec![1], "the device was lost".to_owned())]);
    assert_eq!(best(&found), Some([2].as_slice()));
}

fn slots_of(project: &str, set: &[&str]) -> Vec<Slot> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(project);
    let set = set.iter().map(|set| (*set).to_owned()).collect();
    let plan = Plan::new(project::load(&path).expect("it loads"), Settings { set, ..Settings::default() });
    candidates::slots(&plan.expect("it plans"))
}

#[test]
fn every_shipped_effect_has_candidates_by_rays_and_by_raster() {
    for (project, raster, rays) in [
        ("SceneSSAO.xml", 12, 10),
        ("SceneShadows.xml", 10, 1),
        ("SceneReflect.xml", 11, 1),
        ("SceneRefract.xml", 7, 2),
        ("SceneFinal.xml", 0, 20),
        ("raster/SceneGTAO.xml", 12, 10),
        ("raster/SceneShadowMap.xml", 10, 1),
        ("raster/ScenePlanarReflect.xml", 11, 1),
        ("raster/SceneScreenReflect.xml", 11, 1),
        ("raster/SceneScreenRefract.xml", 7, 2),
    ] {
        let slots = slots_of(project, &[]);
        assert_eq!(slots.len(), 1, "{project}");
        let by_raster =
            slots[0].candidates.iter().filter(|one| matches!(one.kind, project::PassKind::Effect(_))).count();
        let by_rays = slots[0].candidates.len() - by_raster;
        assert!(by_raster >= raster && by_rays >= rays.min(2) - usize::from(rays == 1), "{project}: {slots:#?}");
        let mut labels: Vec<_> = slots[0].candidates.iter().map(|one| one.label.as_str()).collect();
        labels.sort_unstable();
        assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
    }
    assert!(slots_of("SceneNoEffects.xml", &[]).is_empty() && slots_of("SceneDummy.xml", &[]).is_empty());
}

/// A pass by rays does not use channels that only raster effects in its place read.
#[test]
fn every_candidate_of_the_shipped_projects_can_be_planned() {
    for name in [
        "SceneSSAO.xml",
        "SceneShadows.xml",
        "SceneReflect.xml",
        "SceneRefract.xml",
        "SceneFinal.xml",
        "raster/SceneGTAO.xml",
        "raster/SceneShadowMap.xml",
        "raster/SceneCubeRefract.xml",
        "raster/ScenePlanarReflect.xml",
        "raster/SceneScreenReflect.xml",
        "raster/SceneScreenRefract.xml",
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name);
        let declared = project::load(&path).expect("it loads");
        let plan = Plan::new(declared.clone(), Settings::default()).expect("it plans");
        let folder = tempfile::tempdir().expect("a folder");
        for slot in candidates::slots(&plan) {
            for (index, candidate) in slot.candidates.iter().enumerate() {
                let mut changed = declared.clone();
                changed.pipelines[plan.pipeline].passes[slot.pass].kind = candidate.kind.clone();
                let written = folder.path().join(format!("{index}.xml"));
                changed.write(&written).unwrap_or_else(|error| panic!("{name}, {}: {error}", candidate.label));
                let read =
                    project::load(&written).unwrap_or_else(|found| panic!("{name}, {}: {found}", candidate.label));
                assert!(Plan::new(read, Settings::default()).is_ok(), "{name}, {}", candidate.label);
            }
        }
    }
}

#[test]
fn what_set_says_is_declared_and_kept_by_all_candidates() {
    let slots = slots_of("SceneSSAO.xml", &["pass2.samples=25", "pass2.radius=2"]);
    assert_eq!(slots[0].candidates[0].label, "ssao samples=25");
    for candidate in &slots[0].candidates {
        let radius = match &candidate.kind {
            project::PassKind::Ray(ray) => ray.params.radius,
            project::PassKind::Effect(effect) => effect.params.radius,
            _ => f32::NAN,
        };
        assert_eq!(radius, 2.0, "{}", candidate.label);
    }
    let strata = slots_of("SceneSSAO.xml", &["pass2.sampler=strata"]);
    let counts = strata[0].candidates.iter().filter_map(|one| one.label.strip_prefix("ssao samples=")?.parse().ok());
    assert!(counts.clone().count() > 5 && counts.into_iter().all(|count: u32| count.isqrt().pow(2) == count));
}
