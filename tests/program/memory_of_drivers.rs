//! `--max-memory` counts what a software driver of Vulkan holds. Without a driver the test prints `skipped`, or fails with
//! `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::capped::Expected::{Done, Refused};
use crate::capped::{Expected, MIB, program, shipped, try_cases, watch, write_inputs, write_pattern, write_textured};
use std::fs;

/// A software driver keeps textures and targets in the process, and these count towards the cap. The memory that the driver needs to compile
/// programs does not count; it is included in the memory of the empty frame.
#[test]
fn the_process_stays_under_its_cap_with_a_driver_that_computes_on_the_processor() {
    needs_proc!();
    let folder = tempfile::tempdir().expect("a folder");
    write_inputs(folder.path());
    write_pattern(&folder.path().join("one.png"), 1);
    write_textured(folder.path(), "of_one", "one.png");
    let lit = fs::read_to_string(shipped("SceneShadows.xml")).expect("the project");
    fs::write(folder.path().join("lit.xml"), lit.replace("3dsmodels\\largoCamoes.cbo", "of_one.obj")).expect("written");
    let engines = |rays: &str| format!("--raster wgpu --backend {rays}");
    for (empty_frame, rays, cases) in [
        (
            "of_one.xml",
            "cpu",
            vec![
                // 192 MiB of texels with their mip levels in host memory, and the same amount in the driver.
                ("of_large.xml --size 64x64", 512, Done),
                ("of_large.xml --size 64x64", 256, Refused),
                ("of_grey.xml --size 64x64", 256, Done),
                ("of_grey.xml --size 64x64", 128, Refused),
                ("of_jpeg.xml --size 64x64", 144, Done),
                // A target of 1536 x 1536 pixels takes 36 MiB.
                ("of_one.xml --size 1536x1536", 192, Done),
                ("of_one.xml --size 1536x1536", 64, Refused),
            ],
        ),
        ("lit.xml", "wgpu", vec![("lit.xml --size 1024x1024", 256, Done), ("lit.xml --size 1024x1024", 48, Refused)]),
    ] {
        let mut command = program(folder.path());
        command.args(format!("render {empty_frame} {} --size 1x1", engines(rays)).split(' '));
        let run = watch(command);
        if run.errors.contains("no Vulkan") {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{}", run.errors);
            println!("skipped: {}", run.errors);
            return;
        }
        assert!(run.status.success(), "{}", run.errors);
        println!("an empty frame on wgpu, rays by {rays}: {} MiB", run.peak / MIB);
        let cases: Vec<(String, u64, Expected)> = cases
            .into_iter()
            .map(|(project, cap, expected)| (format!("render {project} {}", engines(rays)), cap, expected))
            .collect();
        try_cases(folder.path(), &cases, run.peak);
    }
}
