//! Runs the fuzz target `render` on a few hundred mutations, and tests its promises: whole runs of small projects, on
//! any number of threads.

mod body;
#[path = "../../../pipeline/tests/fuzz_targets/mod.rs"]
#[allow(dead_code, reason = "the loaders' bodies are run by the pipeline's tests")]
mod fuzz_targets;
mod input;
#[path = "../../../pipeline/tests/fuzz_targets/mutate.rs"]
mod mutate;

use body::{Watcher, Written, pictures, render};
use curitiba_pipeline::executor::{Observer, Output, Range, Triangles};
use curitiba_pipeline::programs::Fidelity;
use fuzz_targets::Target;
use mutate::run;
use std::panic::{AssertUnwindSafe, catch_unwind};

const TARGET: Target = Target { name: "render", run: render };
/// Number of mutations, unless the environment variable `CURITIBA_FUZZ_ROUNDS` sets another.
const ROUNDS: usize = 300;

fn seeds() -> Vec<Vec<u8>> {
    input::seeds().into_iter().map(|(_, bytes)| bytes).collect()
}

#[test]
fn every_seed_renders_in_both_fidelities() {
    for (name, bytes) in input::seeds() {
        let written = pictures(&bytes);
        let windows = written.iter().filter(|output| output.name == "window").count();
        assert_eq!(windows, 2, "{name}");
        assert!(written.iter().all(|output| output.size == [12, 9]), "{name}");
        let distinct = |output: &Written| output.bits.iter().collect::<std::collections::HashSet<_>>().len();
        for output in &written {
            assert!(distinct(output) > 1, "{name}: nothing is seen in {}", output.name);
        }
    }
}

#[test]
fn mutated_seeds_render_as_promised_or_are_refused() {
    let rounds = std::env::var("CURITIBA_FUZZ_ROUNDS").map_or(ROUNDS, |rounds| rounds.parse().expect("a number"));
    match run(&TARGET, &seeds(), rounds) {
        Ok(tally) => assert!(tally.loaded > tally.refused && tally.refused > 0, "{tally:?}"),
        Err(finding) => panic!("{}\ninput: {}", finding.message, finding.input.escape_ascii()),
    }
}

/// Inputs that once broke a promise: normals along the light, whose cosine exceeded 1 by rounding.
#[test]
fn inputs_that_broke_a_promise_keep_it_now() {
    for input in [
        include_bytes!("regressions/cosine_1").as_slice(),
        include_bytes!("regressions/cosine_2"),
        include_bytes!("regressions/cosine_3"),
    ] {
        assert!(matches!(render(input), fuzz_targets::check::Outcome::Loaded));
    }
}

#[test]
fn runs_on_other_numbers_of_threads_write_the_same() {
    let pools = [1, 3, 8].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads"));
    for (name, bytes) in input::seeds() {
        let [one, three, eight] = pools.each_ref().map(|pool| pool.install(|| pictures(&bytes)));
        assert!(one == three && one == eight, "{name}");
    }
}

/// Control of the checks: outputs that each break one promise are found.
#[test]
fn outputs_that_break_a_promise_are_found_out() {
    let sound = [[0.5, 0.5, 0.5, 1.0]; 4];
    let noticed_in = |fidelity: Fidelity, range: Range, width: u32, pixels: &[[f32; 4]]| {
        let output = Output { pass: "pass1", channel: "a::b".to_owned(), range, width, height: 2, pixels };
        catch_unwind(AssertUnwindSafe(|| Watcher::new(fidelity).wrote(&output))).is_err()
    };
    let noticed = |range, width, pixels: &[[f32; 4]]| noticed_in(Fidelity::Corrected, range, width, pixels);
    assert!(!noticed(Range::Share, 2, &sound));
    assert!(noticed(Range::Share, 3, &sound), "a picture of another size is not noticed");
    for wrong in [f32::NAN, f32::INFINITY, -0.25] {
        let mut pixels = sound;
        pixels[3][1] = wrong;
        assert!(noticed(Range::Color, 2, &pixels), "{wrong} is not noticed");
        let noticed = noticed_in(Fidelity::Thesis, Range::Color, 2, &pixels);
        assert_eq!(noticed, !wrong.is_finite(), "{wrong} in thesis fidelity");
    }
    let ids = Triangles { pass: "pass1", count: 2, width: 2, ids: &[0, 1, 2, 0] };
    assert!(catch_unwind(|| Watcher::new(Fidelity::Corrected).wrote_triangles(&ids)).is_err());
}
