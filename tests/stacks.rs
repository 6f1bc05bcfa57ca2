//! Every program on many threads with small stacks does not crash, and gives the same picture bit for bit.
//!
//! A worker of the thread pool that waits for a part of its work runs other work meanwhile on the same stack. So what
//! one job keeps on the stack is there many times, and the more threads share the work, the deeper the stack gets.

use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use std::path::Path;

/// Stack size of each thread in bytes: an eighth of Rust's default.
const STACK: usize = 256 << 10;

/// Pixels along a side: enough for the tiles to be divided many times over 64 threads.
const SIDE: u32 = 400;

/// Loads a project and renders two frames, all on the threads of one pool.
fn render(name: &str, fidelity: Fidelity, threads: usize) -> [Image; 2] {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build().expect("threads");
    pool.install(|| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/Scene{name}.xml"));
        let set = match name {
            "SSAO" | "Final" => vec!["pass2.samples=4".to_owned()],
            _ => Vec::new(),
        };
        let settings = Settings { size: Some([SIDE, SIDE]), fidelity, set, ..Settings::default() };
        let plan = Plan::new(project::load(&path).expect("the project loads"), settings).expect("the plan stands");
        let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
        let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("the scene loads");
        [(); 2].map(|()| renderer.frame(&mut Silent).expect("the frame renders"))
    })
}

fn bits(image: &Image) -> Vec<[u32; 4]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn is_the_same_on_any_number_of_threads(name: &str) {
    for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
        let [alone, again] = render(name, fidelity, 1);
        assert!(bits(&alone) == bits(&again), "{name} {fidelity:?}: the second frame differs");
        for threads in [3, 16, 64] {
            for frame in render(name, fidelity, threads) {
                assert!(bits(&alone) == bits(&frame), "{name} {fidelity:?}: {threads} threads give another picture");
            }
        }
    }
}

macro_rules! programs {
    ($($test:ident: $name:literal;)*) => {
        $(#[test]
        fn $test() {
            is_the_same_on_any_number_of_threads($name);
        })*
    };
}

programs! {
    no_effects_on_small_stacks: "NoEffects";
    dummy_on_small_stacks: "Dummy";
    shadows_on_small_stacks: "Shadows";
    reflection_on_small_stacks: "Reflect";
    refraction_on_small_stacks: "Refract";
    ambient_occlusion_on_small_stacks: "SSAO";
    all_effects_on_small_stacks: "Final";
}
