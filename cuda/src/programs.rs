//! The device programs as PTX, which the driver compiles for its GPU; `programs/build.sh` writes them.

use curitiba_passes::effects::Lighting;
use curitiba_passes::effects::dielectric::{Variant, shoots_photons};
use curitiba_pipeline::backend::{BackendError, RayJob};
use curitiba_pipeline::programs::{Fidelity, RayProgram};

macro_rules! text {
    ($folder:literal, $stem:literal) => {
        include_str!(concat!("../programs/ptx/", $folder, $stem, ".ptx"))
    };
}
macro_rules! table {
    ($($program:ident $stem:literal),* $(,)?) => {
        /// PTX of the ray programs that exist as device programs, `[tracer][fidelity]`: on our own traversal and on OptiX; corrected and
        /// thesis.
        const TABLE: &[(RayProgram, [[&str; 2]; 2])] = &[$((RayProgram::$program, [
            [text!("bvh/corrected/", $stem), text!("bvh/thesis/", $stem)],
            [text!("optix/corrected/", $stem), text!("optix/thesis/", $stem)],
        ])),*];
    };
}
macro_rules! lights {
    ($($program:ident $stem:literal),* $(,)?) => {
        /// PTX of the programs for several lights, lights with a position and disc lights: on our own traversal and on OptiX. They exist in
        /// corrected fidelity only, with glass as defined by each material.
        const LIGHTS: &[(RayProgram, [&str; 2])] = &[$((RayProgram::$program, [
            text!("bvh/lights/", $stem), text!("optix/lights/", $stem),
        ])),*];
    };
}
macro_rules! bodies {
    ($($program:ident $stem:literal),* $(,)?) => {
        /// PTX of the programs for corrected fidelity with glass as defined by each material: for our own traversal and for OptiX.
        const BODIES: &[(RayProgram, [&str; 2])] = &[$((RayProgram::$program, [
            text!("bvh/bodies/", $stem), text!("optix/bodies/", $stem),
        ])),*];
    };
}
macro_rules! spheres {
    ($($program:ident $stem:literal),* $(,)?) => {
        /// PTX of the programs for scenes with exact spheres and for passes that shoot photons: on our own traversal and on OptiX.
        /// They exist in corrected fidelity only, with glass as defined by each material.
        const SPHERES: &[(RayProgram, [&str; 2])] = &[$((RayProgram::$program, [
            text!("bvh/spheres/", $stem), text!("optix/spheres/", $stem),
        ])),*];
    };
}
macro_rules! spheres_in_lights {
    ($($program:ident $stem:literal),* $(,)?) => {
        /// PTX of the programs for exact spheres together with several lights, lights with a position and disc lights.
        const SPHERES_IN_LIGHTS: &[(RayProgram, [&str; 2])] = &[$((RayProgram::$program, [
            text!("bvh/spheres_lights/", $stem), text!("optix/spheres_lights/", $stem),
        ])),*];
    };
}
macro_rules! ways {
    ($($program:ident $stem:literal),* $(,)?) => {
        /// PTX of the programs for glass that is rough, has dispersion or has its own reflectance, and for paths in glass that are cut
        /// off: `[lighting][tracer]`. Lighting is one directional light without a disc, or any other lights. Tracers are our own traversal and
        /// OptiX, both with exact spheres.
        const WAYS: &[(RayProgram, [[&str; 2]; 2])] = &[$((RayProgram::$program, [
            [text!("bvh/ways/", $stem), text!("optix/ways/", $stem)],
            [text!("bvh/ways_lights/", $stem), text!("optix/ways_lights/", $stem)],
        ])),*];
    };
}
spheres! {
    DeferredShadows "deferredShadows",
    Reflection "reflection",
    Refraction "refraction",
    Ssao "ssao",
    Final "final",
}
spheres_in_lights! {
    DeferredShadows "deferredShadows",
    Reflection "reflection",
    Refraction "refraction",
    Final "final",
}
ways! {
    Refraction "refraction",
    Final "final",
}
bodies! {
    Refraction "refraction",
    Final "final",
}
lights! {
    DeferredShadows "deferredShadows",
    Reflection "reflection",
    Refraction "refraction",
    Final "final",
}
table! {
    Dummy "dummy",
    DeferredShadows "deferredShadows",
    Reflection "reflection",
    Refraction "refraction",
    Ssao "ssao",
    Final "final",
}

/// What decides which programs a job runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key {
    /// The ray program.
    pub program: RayProgram,
    /// The fidelity, and the glass that the program supports.
    pub variant: Variant,
    /// The lights that the program supports.
    pub lighting: Lighting,
    /// Whether the program is one for exact spheres and for the light that glass focuses: true if the scene has spheres or the job
    /// shoots photons. False for programs that serve all scenes.
    pub spheres: bool,
}

impl Key {
    /// The key of a job's programs. Programs that serve scenes with and without spheres have one key.
    #[must_use]
    pub fn of(job: &RayJob<'_>) -> Self {
        let (program, variant, lighting) = (job.program, Variant::of(job), Lighting::of(job));
        let serves_all = program == RayProgram::Dummy || variant == Variant::Ways;
        let spheres = !serves_all && (!job.scene.geometry.spheres.is_empty() || shoots_photons(job));
        Self { program, variant, lighting, spheres }
    }
}

fn text(Key { program, variant, lighting, spheres }: Key, tracer: usize) -> Option<&'static str> {
    let of = |table: &[(RayProgram, [&'static str; 2])]| {
        table.iter().find(|(own, _)| *own == program).map(|(_, texts)| texts[tracer])
    };
    // `dummy` traces no ray, and the programs of `WAYS` support spheres.
    let spheres = spheres && program != RayProgram::Dummy;
    match (variant, lighting) {
        (Variant::Ways, _) => {
            let (_, texts) = WAYS.iter().find(|(own, _)| *own == program)?;
            Some(texts[usize::from(lighting == Lighting::Lights)][tracer])
        }
        (Variant::Panes(Fidelity::Thesis), _) if spheres => None,
        (_, Lighting::Sun) if spheres => of(SPHERES),
        (_, Lighting::Lights) if spheres => of(SPHERES_IN_LIGHTS),
        (Variant::Panes(Fidelity::Thesis), Lighting::Lights) => None,
        (_, Lighting::Lights) => of(LIGHTS),
        (Variant::Panes(fidelity), Lighting::Sun) => {
            let (_, texts) = TABLE.iter().find(|(own, _)| *own == program)?;
            Some(texts[tracer][usize::from(fidelity == Fidelity::Thesis)])
        }
        (Variant::Bodies, Lighting::Sun) => of(BODIES),
    }
}

/// A program on our own traversal: a module whose kernel has the name of the ray-generation program. `None` if the program exists only in
/// Rust, or not in this variant with this lighting. In thesis fidelity only `dummy` exists for scenes with exact spheres.
#[must_use]
pub fn on_bvh(key: Key) -> Option<&'static str> {
    text(key, 0)
}

/// A program on OptiX: all entries that a project may name, such as `__raygen__buffer_camera` or `__closesthit__closest_hit`. Both
/// fidelities have the same names. `None` as in [`on_bvh`].
#[must_use]
pub fn on_optix(key: Key) -> Option<&'static str> {
    text(key, 1)
}

/// The kernel that traces segments between triangles on our own traversal: `segments`.
#[must_use]
pub fn segments_on_bvh() -> &'static str {
    text!("bvh/", "segments")
}

/// The programs that trace segments between triangles on OptiX.
#[must_use]
pub fn segments_on_optix() -> &'static str {
    text!("optix/", "segments")
}

/// The error for a ray program without a device program.
#[must_use]
pub fn not_written(backend: &'static str, program: RayProgram) -> BackendError {
    let why = "it is written for the processor alone; `--backend cpu` runs it".to_owned();
    BackendError::Unsupported { backend, what: program.info().stem.to_owned(), why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::programs::{PROCS, RAY_PROGRAMS};
    use std::path::{Path, PathBuf};

    const PANES: [Variant; 2] = [Variant::Panes(Fidelity::Corrected), Variant::Panes(Fidelity::Thesis)];
    const VARIANTS: [(Variant, Lighting); 7] = [
        (PANES[0], Lighting::Sun),
        (PANES[1], Lighting::Sun),
        (Variant::Bodies, Lighting::Sun),
        (Variant::Ways, Lighting::Sun),
        (PANES[0], Lighting::Lights),
        (Variant::Bodies, Lighting::Lights),
        (Variant::Ways, Lighting::Lights),
    ];
    type Written = fn(Key) -> Option<&'static str>;
    const TRACERS: [(&str, Written); 2] = [("bvh", on_bvh), ("optix", on_optix)];

    /// The key of a program for scenes without exact spheres.
    fn key(program: RayProgram, (variant, lighting): (Variant, Lighting)) -> Key {
        Key { program, variant, lighting, spheres: false }
    }

    #[test]
    fn those_that_know_bodies_are_those_that_are_asked_for_them() {
        assert_eq!(BODIES.iter().map(|(program, _)| *program).collect::<Vec<_>>(), Variant::OF_BODIES);
        assert_eq!(WAYS.iter().map(|(program, _)| *program).collect::<Vec<_>>(), Variant::OF_BODIES);
    }

    #[test]
    fn those_that_know_lights_are_those_that_read_one() {
        let is_written = |program| on_bvh(key(program, (PANES[0], Lighting::Sun))).is_some();
        for info in RAY_PROGRAMS.iter().filter(|info| is_written(info.program)) {
            let known = on_bvh(key(info.program, (PANES[0], Lighting::Lights))).is_some();
            assert_eq!(known, info.globals.contains(&"lightDir"), "{}", info.stem);
        }
    }

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
            for (kind, spheres) in VARIANTS.into_iter().flat_map(|kind| [false, true].map(|spheres| (kind, spheres))) {
                let key = Key { spheres, ..key(info.program, kind) };
                for (tracer, written) in TRACERS {
                    let Some(text) = written(key) else { continue };
                    let found = text.lines().next();
                    assert_eq!(found, Some(first_line.as_str()), "{tracer}, {key:?}: run cuda/programs/build.sh");
                }
            }
        }
        for text in [segments_on_bvh(), segments_on_optix()] {
            assert_eq!(text.lines().next(), Some(first_line.as_str()), "segments.ptx: run cuda/programs/build.sh");
        }
    }

    #[test]
    fn scenes_with_spheres_have_the_entries_of_scenes_without_and_others_know_no_sphere() {
        let all = RAY_PROGRAMS.iter().flat_map(|info| VARIANTS.map(|kind| (info, kind)));
        for ((info, kind), (tracer, written)) in all.flat_map(|each| TRACERS.map(|tracer| (each, tracer))) {
            let key = key(info.program, kind);
            let without = written(key);
            let of_triangles = key.variant == PANES[1] && info.program != RayProgram::Dummy;
            let Some(text) = written(Key { spheres: true, ..key }) else {
                assert!(without.is_none() || of_triangles, "{tracer}, {key:?}");
                continue;
            };
            // With spheres there are only programs with glass as defined by each material.
            let of = |variant| written(Key { variant, ..key });
            let of_glass = of(Variant::Bodies).or(of(PANES[0])).expect("written");
            let entries = |text: &str| {
                let named = |line: &str| line.contains(".entry ").then(|| line.to_owned());
                text.lines().filter_map(named).collect::<Vec<_>>()
            };
            assert_eq!(entries(text), entries(of_glass), "{tracer}, {key:?}");
            if info.program != RayProgram::Dummy {
                assert!(text.contains("by_sphere") || text.contains("closest_sphere"), "{tracer}, {key:?}");
                assert!(!text.contains(".ftz.f32") && text.contains(".target sm_75"), "{tracer}, {key:?}");
            }
            // The programs of `WAYS` support spheres, and so serve scenes with and without them.
            let is_for_all = key.variant == Variant::Ways && without == Some(text);
            let knows = without.is_some_and(|text| text.contains("_sphere"));
            assert!(is_for_all || !knows, "{tracer}, {key:?}: knows spheres");
        }
    }

    #[test]
    fn segments_have_their_programs_for_every_gpu_since_turing() {
        assert!(segments_on_bvh().contains(".entry segments("));
        for entry in ["__raygen__segments", "__anyhit__other", "__anyhit__see_through", "__miss__segments"] {
            assert!(segments_on_optix().contains(&format!(".entry {entry}(")), "{entry}");
        }
        for text in [segments_on_bvh(), segments_on_optix()] {
            assert!(text.contains(".target sm_75") && text.contains(".version 9.0") && !text.contains("ftz"));
        }
    }

    /// The beginning of the PTX entry of a program that a project names; `None` for intersection and bounding-box programs, which the tracer itself
    /// provides.
    fn entry(kind: &str, proc: &str) -> Option<String> {
        let kind = kind.to_ascii_lowercase().replace('_', "");
        (kind != "geometryintersection" && kind != "boundingbox").then(|| format!(".entry __{kind}__{proc}("))
    }

    #[test]
    fn every_module_has_all_programs_for_every_gpu_since_turing() {
        for info in RAY_PROGRAMS {
            if info.starts_at_camera() {
                let has = |kind| TRACERS.into_iter().any(|(_, written)| written(key(info.program, kind)).is_some());
                assert!(!VARIANTS.into_iter().any(has), "{}: the processor's alone", info.stem);
                continue;
            }
            for kind in VARIANTS {
                let key = key(info.program, kind);
                let (Some(kernel), Some(module)) = (on_bvh(key), on_optix(key)) else { continue };
                assert!(kernel.contains(&format!(".entry {}(", info.entry)), "{}", info.stem);
                for (kind, proc) in PROCS.iter().flat_map(|(kind, procs)| procs.iter().map(move |proc| (kind, proc))) {
                    assert!(
                        entry(kind, proc).is_none_or(|entry| module.contains(&entry)),
                        "{}: {kind} {proc}",
                        info.stem
                    );
                }
                assert!(!module.contains(".entry __raygen__pinhole_camera("));
                for text in [kernel, module] {
                    assert!(text.contains(".target sm_75") && text.contains(".version 9.0"), "{}", info.stem);
                    // Only `.ftz.f32` is refused: the library's 64-bit powers begin with an estimate that flushes denormals (`.ftz.f64`).
                    assert!(!text.contains(".ftz.f32"), "{}: denormals are kept, as on the processor", info.stem);
                }
            }
            let [corrected, thesis] = PANES.map(|variant| on_optix(key(info.program, (variant, Lighting::Sun))));
            // A program that is written for the processor alone has neither.
            if corrected.is_some() || thesis.is_some() {
                assert_eq!(corrected == thesis, info.program == RayProgram::Dummy, "{}", info.stem);
            }
        }
    }

    /// Type, file and name of each program that a project file names.
    fn named(project: &str) -> Vec<[String; 3]> {
        let elements = project.split("<optixProgram").skip(1).map(|rest| rest.split('>').next().unwrap_or_default());
        let value = |element: &str, name: &str| {
            let (_, after) = element.split_once(&format!("{name}=\""))?;
            Some(after.split('"').next()?.to_owned())
        };
        elements
            .map(|element| ["type", "file", "proc"].map(|name| value(element, name).expect("all three are there")))
            .collect()
    }

    #[test]
    fn modules_have_what_the_projects_here_and_those_of_2014_name() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects");
        let of_2014 = std::env::var_os("CURITIBA_PROJECTS").map(|folder| PathBuf::from(folder).join("OptixProjects"));
        if of_2014.is_none() {
            println!("those of 2014 skipped: CURITIBA_PROJECTS names no folder");
        }
        // The packaged crate does not include the projects.
        let here = here.is_dir().then_some(here);
        if here.is_none() {
            println!("those of the repository skipped: they are not here");
        }
        for folder in [here, of_2014].into_iter().flatten() {
            let mut found = 0;
            for file in std::fs::read_dir(&folder).expect("the folder is there") {
                let path = file.expect("readable").path();
                if path.extension().is_none_or(|extension| extension != "xml") {
                    continue;
                }
                let bytes = std::fs::read(&path).expect("readable");
                for [kind, file, proc] in named(&String::from_utf8_lossy(&bytes)) {
                    let info = RAY_PROGRAMS.iter().find(|info| file == format!("optix/{}.ptx", info.stem));
                    let info = info.unwrap_or_else(|| panic!("{}: {file}", path.display()));
                    let Some(entry) = entry(&kind, &proc) else { continue };
                    for variant in PANES {
                        let module = on_optix(key(info.program, (variant, Lighting::Sun)))
                            .expect("projects name programs that OptiX has");
                        assert!(module.contains(&entry), "{}: {file} {kind} {proc}", path.display());
                    }
                    found += 1;
                }
            }
            assert!(found > 25, "{}: {found} programs", folder.display());
        }
    }
}
