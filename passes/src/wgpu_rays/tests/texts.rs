//! The sources of the programs, tested without a device.

use crate::effects::Lighting;
use crate::effects::dielectric::Variant;
use crate::raster::gpu::device::Parameters;
use crate::wgpu_rays::layout::Params;
use crate::wgpu_rays::programs::{Arithmetic, Kind, Rounding, Stage, is_written, segments, source, stages};
use crate::wgpu_rays::split::Split;
use curitiba_pipeline::programs::{Fidelity, RAY_PROGRAMS, RayProgram, TextureLod};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use std::collections::HashMap;
use wgpu::naga;

pub const ROUNDINGS: [Rounding; 4] = [Rounding::Fma, Rounding::Separate, Rounding::Driver, Rounding::Fused];

/// Parses and validates a source for a device without any extension.
fn validate(source: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|error| error.emit_to_string(source))?;
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty())
        .validate(&module)
        .map_err(|error| error.emit_to_string(source))?;
    Ok(module)
}

/// The sources of all kernels by their kind; a kernel that several numbers of samples have in common appears once.
fn every_text() -> HashMap<String, String> {
    let mut texts = HashMap::new();
    let mut add = |kind: Kind, stage: Stage, arithmetic: Arithmetic, lod: TextureLod, split: Split| {
        let text = || source(kind, stage, (arithmetic, lod), split).expect("written");
        texts.entry(format!("{kind:?} {stage:?} {arithmetic:?} {lod:?} {split:?}")).or_insert_with(text);
    };
    for info in RAY_PROGRAMS.iter().filter(|info| is_written(info.program)) {
        let panes = [Fidelity::Corrected, Fidelity::Thesis].map(Variant::Panes);
        let knows = Variant::OF_BODIES.contains(&info.program);
        let bodies = [Variant::Bodies, Variant::Ways].into_iter().filter(|_| knows);
        for variant in panes.into_iter().chain(bodies) {
            let eye = variant.knows_bodies().then_some(&Stage::Eye);
            let kind = Kind::plain(info.program, variant);
            let filtered = info.reads("filter").then_some(&Stage::Surfaces);
            let kernels =
                stages(kind, 100).iter().chain(stages(kind, 1)).chain([&Stage::Whole]).chain(eye).chain(filtered);
            let kernels = kernels.flat_map(|stage| ROUNDINGS.map(|rounding| (*stage, rounding)));
            let cones = info.reads("texturelod") && variant != Variant::Panes(Fidelity::Thesis);
            for ((stage, rounding), fused) in kernels.flat_map(|kernel| [(kernel, false), (kernel, true)]) {
                let arithmetic = Arithmetic { rounding, fused, subgroups: false };
                for lod in [TextureLod::Zero, TextureLod::Cones].into_iter().take(1 + usize::from(cones)) {
                    add(kind, stage, arithmetic, lod, Split::default());
                }
            }
        }
    }
    // With several lights, whose sources do not depend on the arithmetic.
    for program in [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Refraction, RayProgram::Final] {
        let panes = Variant::Panes(Fidelity::Corrected);
        let knows = Variant::OF_BODIES.contains(&program);
        for variant in [panes, Variant::Bodies, Variant::Ways].into_iter().filter(|variant| knows || *variant == panes)
        {
            let kind = Kind { lighting: Lighting::Lights, ..Kind::plain(program, variant) };
            for stage in stages(kind, 100).iter().chain(stages(kind, 1)).chain([&Stage::Whole]) {
                for lod in [TextureLod::Zero, TextureLod::Cones] {
                    add(kind, *stage, Arithmetic::default(), lod, Split::default());
                }
            }
        }
    }
    // With exact spheres.
    for info in RAY_PROGRAMS.iter().filter(|info| is_written(info.program)) {
        let knows = Variant::OF_BODIES.contains(&info.program);
        let panes = Variant::Panes(Fidelity::Corrected);
        for variant in [panes, Variant::Bodies, Variant::Ways].into_iter().filter(|variant| knows || *variant == panes)
        {
            for lighting in [Lighting::Sun, Lighting::Lights] {
                let kind = Kind { lighting, spheres: true, ..Kind::plain(info.program, variant) };
                let eye = variant.knows_bodies().then_some(&Stage::Eye);
                let filtered = info.reads("filter").then_some(&Stage::Surfaces);
                let kernels = stages(kind, 100).iter().chain(stages(kind, 1)).chain([&Stage::Whole]);
                for stage in kernels.chain(eye).chain(filtered) {
                    for lod in [TextureLod::Zero, TextureLod::Cones] {
                        add(kind, *stage, Arithmetic::default(), lod, Split::default());
                    }
                }
            }
        }
    }
    // Where glass focuses light.
    for (variant, spheres) in [Variant::Bodies, Variant::Ways].into_iter().flat_map(|it| [(it, true), (it, false)]) {
        for lighting in [Lighting::Sun, Lighting::Lights] {
            let kind = Kind { lighting, spheres, focuses: true, ..Kind::plain(RayProgram::Final, variant) };
            for stage in
                [100, 1, 0].into_iter().flat_map(|samples| stages(kind, samples)).chain([&Stage::Whole, &Stage::Eye])
            {
                for lod in [TextureLod::Zero, TextureLod::Cones] {
                    add(kind, *stage, Arithmetic::default(), lod, Split::default());
                }
            }
        }
    }
    // Where the ways of paths are a sample.
    for program in Variant::OF_BODIES {
        for (spheres, focuses) in [(false, false), (true, false), (false, true), (true, true)] {
            if focuses && program != RayProgram::Final {
                continue;
            }
            for lighting in [Lighting::Sun, Lighting::Lights] {
                let kind = Kind { lighting, spheres, focuses, sampled: true, ..Kind::plain(program, Variant::Ways) };
                for stage in [100, 1, 0].into_iter().flat_map(|samples| stages(kind, samples)) {
                    for lod in [TextureLod::Zero, TextureLod::Cones] {
                        add(kind, *stage, Arithmetic::default(), lod, Split::default());
                    }
                }
            }
        }
    }
    // With arrays in several bindings.
    let split = Split { bindings: [1, 2, 3, 4, 5], bytes: 1 << 27 };
    for program in [RayProgram::Ssao, RayProgram::Final] {
        let variant = Variant::Panes(Fidelity::Corrected);
        let kind = Kind::plain(program, variant);
        for stage in stages(kind, 100) {
            add(kind, *stage, Arithmetic::default(), TextureLod::Zero, split);
        }
    }
    texts
}

#[test]
fn every_text_is_valid_wgsl_that_needs_no_extension() {
    let texts = every_text();
    assert!(texts.len() >= 100, "{}", texts.len());
    texts.par_iter().for_each(|(kernel, text)| {
        if let Err(error) = validate(text) {
            panic!("{kernel}: {error}");
        }
        assert_eq!(text.contains("fn arriving"), kernel.contains("lighting: Lights"), "{kernel}");
    });
    assert!(validate("fn f() -> u32 { return 1.5; }").is_err(), "the check can fail");
}

#[test]
fn parameters_in_a_storage_buffer_are_copied_before_anything_else() {
    for program in [RayProgram::DeferredShadows, RayProgram::Ssao, RayProgram::Final] {
        let kind = Kind::plain(program, Variant::Panes(Fidelity::Corrected));
        for stage in stages(kind, 100).iter().chain(stages(kind, 1)).chain([&Stage::Whole]) {
            let text = source(kind, *stage, (Arithmetic::default(), TextureLod::Zero), Split::default());
            let text = text.expect("written");
            let stored = Parameters::Storage.declared(&text);
            validate(&stored).unwrap_or_else(|error| panic!("{program:?} {stage:?}: {error}"));
            let body = stored.split_once("fn main(").and_then(|(_, main)| main.split_once('{')).expect("an entry").1;
            assert!(body.starts_with(" params = stored_params;"), "{program:?} {stage:?}");
            assert!(!stored.contains("var<uniform>") && text.contains("var<uniform>"), "{program:?} {stage:?}");
            assert_eq!(Parameters::Uniform.declared(&text), text);
        }
    }
    let segments = segments(Arithmetic::default());
    let stored = Parameters::Storage.declared(&segments);
    validate(&stored).unwrap_or_else(|error| panic!("segments: {error}"));
    assert!(!stored.contains("var<uniform>") && segments.contains("var<uniform>"));
}

#[test]
fn parameters_lie_where_the_host_writes_them() {
    let info = RAY_PROGRAMS.iter().find(|info| is_written(info.program)).expect("a program");
    let variant = Variant::Panes(Fidelity::Corrected);
    let kind = Kind::plain(info.program, variant);
    // Only programs for exact spheres declare the last parameters; in others, padding makes the structure as long.
    let lengths = [false, true].map(|spheres| {
        let kind = Kind { spheres, ..kind };
        let text = source(kind, Stage::Whole, (Arithmetic::default(), TextureLod::Zero), Split::default());
        let text = text.expect("it is written");
        let module = validate(&text).expect("valid");
        let params = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Params"));
        let naga::TypeInner::Struct { span, .. } = &params.expect("declared").1.inner else { panic!("no struct") };
        *span
    });
    assert_eq!(lengths[0], lengths[1]);
    let kind = Kind { spheres: true, ..kind };
    let text = source(kind, Stage::Whole, (Arithmetic::default(), TextureLod::Zero), Split::default());
    let text = text.expect("it is written");
    let module = validate(&text).expect("valid");
    let named = |ty: &naga::Type| ty.name.as_deref() == Some("Params");
    let (_, params) = module.types.iter().find(|(_, ty)| named(ty)).expect("declared");
    let naga::TypeInner::Struct { members, span } = &params.inner else { panic!("no struct") };
    let offset = |name: &str| {
        let member = members.iter().find(|member| member.name.as_deref() == Some(name));
        member.unwrap_or_else(|| panic!("{name}")).offset as usize
    };
    let mut seen = 0;
    macro_rules! same {
        ($($theirs:literal $ours:ident),*; $($name:ident)*) => {
            $(assert_eq!(offset($theirs), std::mem::offset_of!(Params, $ours), $theirs); seen += 1;)*
            $(assert_eq!(offset(stringify!($name)), std::mem::offset_of!(Params, $name), stringify!($name)); seen += 1;)*
        };
    }
    same!("origin_x" origin;
        eye zero to_light seed light_color samples scene_low strata scene_high depth width height first_tile end_tile tiles_across
        capacity root materials_at normals_at texcoords_at textures_at points_at open_share_at through_glass_at cut fresnel
        has_normals id_base radius index decoded_at colors_at beyond bodies_at tangents_at cone_width cone_spread lights_at whole
        sphere_root spheres_at first_sphere);
    assert_eq!((*span as usize, seen), (size_of::<Params>(), members.len() - 1));
}

#[test]
fn programs_that_read_level_0_have_no_word_of_cones() {
    for info in RAY_PROGRAMS.iter().filter(|info| is_written(info.program)) {
        for variant in [Variant::Panes(Fidelity::Corrected), Variant::Ways] {
            let knows = Variant::OF_BODIES.contains(&info.program);
            if variant == Variant::Ways && !knows {
                continue;
            }
            let kind = Kind::plain(info.program, variant);
            let text = |lod| {
                let text = source(kind, Stage::Whole, (Arithmetic::default(), lod), Split::default()).expect("written");
                // Without the parameters of cones, which all programs declare, and without comments.
                let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
                code.filter(|line| !line.contains("    cone_")).collect::<Vec<_>>().join("\n")
            };
            let [zero, cones] = [TextureLod::Zero, TextureLod::Cones].map(text);
            for word in ["Cone", "cone", "footprint", "FOOTPRINT", "curvature", "⟨", "⟩"] {
                assert!(!zero.contains(word), "{}: {word}", info.stem);
            }
            assert!(cones.contains("fn footprint_of") && !cones.contains(['⟨', '⟩']), "control");
        }
    }
}

#[test]
fn programs_of_one_light_have_no_word_of_several() {
    for info in RAY_PROGRAMS.iter().filter(|info| is_written(info.program)) {
        let variant = Variant::Panes(Fidelity::Corrected);
        let text = |lighting| {
            let kind = Kind { lighting, ..Kind::plain(info.program, variant) };
            let arithmetic = (Arithmetic::default(), TextureLod::Zero);
            source(kind, Stage::Whole, arithmetic, Split::default()).expect("written")
        };
        let [sun, lights] = [Lighting::Sun, Lighting::Lights].map(text);
        for word in ["struct Light", "fn arriving", "light_count", "light_direction", "shading."] {
            assert!(!sun.contains(word) && lights.contains(word), "{}: {word}", info.stem);
        }
    }
}

#[test]
fn programs_of_scenes_without_spheres_have_no_word_of_them() {
    let code = |text: &str| {
        let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
        code.collect::<Vec<_>>().join("\n").to_lowercase().replace("hemisphere", "")
    };
    let (mut with, mut without) = (0, 0);
    for (kernel, text) in &every_text() {
        assert!(!text.contains(['⟪', '⟫']), "{kernel}");
        let says = code(text).contains("sphere");
        assert_eq!(says, kernel.contains("spheres: true"), "{kernel}");
        *if says { &mut with } else { &mut without } += 1;
    }
    assert!(with >= 50 && without >= 100, "{with} {without}");
    assert!(!code(&segments(Arithmetic::default())).contains("sphere"));
}

#[test]
fn programs_that_follow_all_ways_have_no_word_of_samples() {
    let words = ["first_way", "way_count", "events", "in_order", "SAMPLE_", "MET_", "HASH_SPECTRUM", "⟬", "⟭"];
    let code = |text: &str| text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<String>();
    let (mut with, mut without) = (0, 0);
    for (kernel, text) in &every_text() {
        let code = code(text);
        let says = words.iter().any(|word| code.contains(word));
        let follows = [" Whole ", " List ", " Sum "].iter().any(|stage| kernel.contains(stage));
        assert_eq!(says, follows && kernel.contains("sampled: true"), "{kernel}");
        assert!(!code.contains(['⟬', '⟭']), "{kernel}");
        *if says { &mut with } else { &mut without } += 1;
    }
    assert!(with >= 30 && without >= 200, "{with} {without}");
    // Kernels that follow no paths are the same with samples and without.
    let (program, variant, lighting) = (RayProgram::Final, Variant::Ways, Lighting::Sun);
    let [all, sampled] = [false, true].map(|sampled| {
        let kind = Kind { lighting, sampled, ..Kind::plain(program, variant) };
        let text = |stage| source(kind, stage, (Arithmetic::default(), TextureLod::Zero), Split::default());
        [Stage::Eye, Stage::Light, Stage::Settle, Stage::Trace, Stage::List, Stage::Sum].map(text)
    });
    assert!(all[..4] == sampled[..4] && all[4] != sampled[4] && all[5] != sampled[5]);
}

#[test]
fn programs_where_no_glass_focuses_light_have_no_word_of_it() {
    let of_spheres = ["lens", "left_out", "struct Turned"];
    let words = [&["focus", "is_target", "light_of_photons", "segment", "⦃", "⦄"], &of_spheres[..]].concat();
    let code = |text: &str| text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<String>();
    let (mut with, mut without) = (0, 0);
    for (kernel, text) in &every_text() {
        let code = code(text);
        let says = words.iter().any(|word| code.contains(word));
        let knows = [" Whole ", " List ", " Focus ", " Sum "].iter().any(|stage| kernel.contains(stage));
        assert_eq!(says, knows && kernel.contains("focuses: true"), "{kernel}");
        let says_of_spheres = of_spheres.iter().any(|word| code.contains(word));
        assert_eq!(says_of_spheres, says && kernel.contains("spheres: true"), "{kernel}");
        *if says { &mut with } else { &mut without } += 1;
    }
    assert!(with >= 30 && without >= 200, "{with} {without}");
    // Kernels that compute no light are the same as in any scene.
    let variant = Variant::Bodies;
    let of = |focuses, spheres| {
        let kind = Kind { spheres, focuses, ..Kind::plain(RayProgram::Final, variant) };
        let text = |stage| source(kind, stage, (Arithmetic::default(), TextureLod::Zero), Split::default());
        [Stage::Eye, Stage::Settle, Stage::Trace, Stage::Sum].map(text)
    };
    for spheres in [true, false] {
        let (mine, others) = (of(true, spheres), of(false, spheres));
        assert!(mine[..3] == others[..3] && mine[3] != others[3]);
    }
}
