//! The device programs, as PTX that the driver compiles for its GPU; `programs/build.sh` writes them.

use curitiba_pipeline::programs::RayProgram;

macro_rules! texts {
    ($tracer:literal, $program:expr) => {
        match $program {
            RayProgram::Dummy => include_str!(concat!("../programs/ptx/", $tracer, "/dummy.ptx")),
            RayProgram::DeferredShadows => include_str!(concat!("../programs/ptx/", $tracer, "/deferredShadows.ptx")),
            RayProgram::Reflection => include_str!(concat!("../programs/ptx/", $tracer, "/reflection.ptx")),
            RayProgram::Refraction => include_str!(concat!("../programs/ptx/", $tracer, "/refraction.ptx")),
            RayProgram::Ssao => include_str!(concat!("../programs/ptx/", $tracer, "/ssao.ptx")),
            RayProgram::Final => include_str!(concat!("../programs/ptx/", $tracer, "/final.ptx")),
        }
    };
}

/// A program on our own traversal: kernels `curitiba_corrected` and `curitiba_thesis`.
#[must_use]
pub fn on_bvh(program: RayProgram) -> &'static str {
    texts!("bvh", program)
}

/// A program on OptiX: ray-generation programs `__raygen__corrected` and `__raygen__thesis`, and what they trace with.
#[must_use]
pub fn on_optix(program: RayProgram) -> &'static str {
    texts!("optix", program)
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::programs::RAY_PROGRAMS;
    use std::path::Path;

    /// The hash that `programs/build.sh` records: FNV-1a over the sources in the order of their names.
    fn hash_of_sources() -> String {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("programs");
        let entries = std::fs::read_dir(folder).expect("the folder is there");
        let mut paths: Vec<_> = entries.map(|entry| entry.expect("readable").path()).collect();
        paths.retain(|path| {
            path.extension().is_some_and(|extension| ["cu", "cuh", "sh"].iter().any(|known| extension == *known))
        });
        paths.sort();
        assert!(paths.len() > 10, "the sources were found");
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for path in paths {
            for byte in std::fs::read(path).expect("readable") {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
            }
        }
        format!("{hash:016x}")
    }

    #[test]
    fn the_compiled_programs_are_made_from_the_sources() {
        let first_line = format!("// curitiba sources {}", hash_of_sources());
        for info in RAY_PROGRAMS {
            for (tracer, text) in [("bvh", on_bvh(info.program)), ("optix", on_optix(info.program))] {
                assert_eq!(
                    text.lines().next(),
                    Some(first_line.as_str()),
                    "ptx/{tracer}/{}.ptx is older than its sources: run cuda/programs/build.sh",
                    info.stem
                );
            }
        }
    }

    #[test]
    fn every_program_has_both_fidelities_for_every_gpu_since_turing() {
        for info in RAY_PROGRAMS {
            for (prefix, text) in [("curitiba_", on_bvh(info.program)), ("__raygen__", on_optix(info.program))] {
                for fidelity in ["corrected", "thesis"] {
                    assert!(text.contains(&format!(".entry {prefix}{fidelity}(")), "{} {fidelity}", info.stem);
                }
                assert!(text.contains(".target sm_75") && text.contains(".version 9.0"), "{}", info.stem);
                assert!(!text.contains("ftz"), "{}: denormals are kept, as on the processor", info.stem);
            }
        }
    }
}
