//! Which device programs OptiX calls for which rays and materials: those that a project names, according to the table of programs.

use super::abi::{PROGRAM_GROUP_KIND_EXCEPTION, PROGRAM_GROUP_KIND_HITGROUP, PROGRAM_GROUP_KIND_MISS};
use super::abi::{PROGRAM_GROUP_KIND_RAYGEN, SBT_RECORD_HEADER};
use crate::layout::RAY_TYPES;
use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::programs::{Fidelity, RayProgramInfo};
use std::ffi::{CString, c_int};

/// Ray types by their names in projects, in the order of `RayType` in `trace_optix.cuh`.
const RAYS: [&str; RAY_TYPES as usize] = ["Phong", "Shadow"];
/// The any-hit program for radiance rays on materials with holes; no project names it.
const ALPHA_TEST: &str = "alpha_test";

/// Number of kinds of materials with separate hit programs: glass or not, with holes or not.
const MATERIALS: usize = 4;
/// Indices of the first group of each kind. Group 0 is the ray-generation program, followed by one group for exceptions, one miss group a
/// ray type, and one hit group for each ray type and kind of material.
const EXCEPTION: usize = 1;
const MISSES: usize = 2;
const HITS: usize = MISSES + RAYS.len();
/// Greatest number of groups.
pub const GROUPS: usize = HITS + RAYS.len() * MATERIALS;

/// Programs that OptiX calls together (a program group).
#[derive(Debug, PartialEq, Eq)]
pub struct Group {
    /// The kind: `PROGRAM_GROUP_KIND_…`.
    pub kind: c_int,
    /// The program; in a hit group the closest-hit program, if any.
    pub entry: Option<CString>,
    /// In a hit group, the any-hit program, if any.
    pub any_hit: Option<CString>,
}

fn entry(kind: &str, name: &str) -> CString {
    CString::new(format!("__{kind}__{name}")).expect("names have no zero byte")
}

/// The name of the program of a kind for a ray type; on glass, the program for glass if there is one. `None` if hits call no such program.
fn called(info: &RayProgramInfo, kind: &str, ray: &str, glass: bool) -> Option<&'static str> {
    let of = |required| {
        let mut procs = info.procs.iter();
        procs.find(|proc| (proc.kind, proc.ray, proc.required) == (kind, ray, required)).map(|proc| proc.proc)
    };
    if glass { of(false).or_else(|| of(true)) } else { of(true) }
}

/// The groups of a program; `None` for the groups of ray types that the program never traces.
pub fn groups(info: &RayProgramInfo) -> [Option<Group>; GROUPS] {
    let alone = |kind, entry| Some(Group { kind, entry: Some(entry), any_hit: None });
    let mut groups = [const { None }; GROUPS];
    groups[0] = alone(PROGRAM_GROUP_KIND_RAYGEN, entry("raygen", info.entry));
    groups[EXCEPTION] = alone(PROGRAM_GROUP_KIND_EXCEPTION, entry("exception", "exception"));
    for (ray, name) in RAYS.iter().enumerate() {
        let Some(miss) = info.procs.iter().find(|proc| (proc.kind, &proc.ray) == ("Miss", name)) else { continue };
        groups[MISSES + ray] = alone(PROGRAM_GROUP_KIND_MISS, entry("miss", miss.proc));
        for material in 0..MATERIALS {
            let (glass, cut) = (material & 1 != 0, material & 2 != 0);
            let closest = called(info, "Closest_Hit", name, glass);
            let any = called(info, "Any_Hit", name, glass).or(cut.then_some(ALPHA_TEST));
            groups[HITS + ray * MATERIALS + material] = Some(Group {
                kind: PROGRAM_GROUP_KIND_HITGROUP,
                entry: closest.map(|name| entry("closesthit", name)),
                any_hit: any.map(|name| entry("anyhit", name)),
            });
        }
    }
    groups
}

/// The groups that trace segments between triangles. The first hit group is for materials that block segments, the second for the others.
pub fn segment_groups() -> [Option<Group>; GROUPS] {
    let mut groups = [const { None }; GROUPS];
    let alone = |kind, entry| Some(Group { kind, entry: Some(entry), any_hit: None });
    groups[0] = alone(PROGRAM_GROUP_KIND_RAYGEN, entry("raygen", "segments"));
    groups[EXCEPTION] = alone(PROGRAM_GROUP_KIND_EXCEPTION, entry("exception", "exception"));
    groups[MISSES] = alone(PROGRAM_GROUP_KIND_MISS, entry("miss", "segments"));
    for (kind, name) in ["other", "see_through"].into_iter().enumerate() {
        let any_hit = Some(entry("anyhit", name));
        groups[HITS + kind] = Some(Group { kind: PROGRAM_GROUP_KIND_HITGROUP, entry: None, any_hit });
    }
    groups
}

/// The shader binding table for the groups of [`segment_groups`], with hit records for `materials` materials, at least one.
pub fn segment_records(headers: &Headers, see_through: &[bool], materials: usize) -> Vec<u8> {
    let mut table = headers[..HITS].as_flattened().to_vec();
    for material in 0..materials.max(1) {
        let kind = usize::from(see_through.get(material).copied().unwrap_or(false));
        table.extend_from_slice(&headers[HITS + kind]);
        // Rays of the second type are never traced.
        table.resize(table.len() + SBT_RECORD_HEADER, 0);
    }
    table
}

/// The header of each group's records; zeros for groups that do not exist, which are never called.
pub type Headers = [[u8; SBT_RECORD_HEADER]; GROUPS];

/// Index of the exception record in the shader binding table.
pub const EXCEPTION_RECORD: usize = EXCEPTION;
/// Index of the first miss record.
pub const MISS_RECORDS: usize = MISSES;
/// Index of the first hit record. Hit records are ordered by material, each with one record a ray type.
pub const HIT_RECORDS: usize = HITS;

/// The shader binding table of a pass, with hit records for at least `materials` materials.
pub fn records(headers: &Headers, job: &RayJob<'_>, materials: usize) -> Vec<u8> {
    let is = |flags: &[bool], material: usize| flags.get(material).copied().unwrap_or(false);
    let mut table = headers[..HITS].as_flattened().to_vec();
    for material in 0..materials.max(job.shades.len()).max(1) {
        let cut = job.fidelity == Fidelity::Corrected
            && job.shades.get(material).is_some_and(|shade| shade.alpha_cutoff.is_some());
        for (ray, glass) in [is(job.glass, material), is(job.shadow_glass, material)].into_iter().enumerate() {
            let kind = usize::from(glass) | usize::from(cut) << 1;
            table.extend_from_slice(&headers[HITS + ray * MATERIALS + kind]);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::programs::{Key, on_optix};
    use curitiba_passes::effects::Lighting;
    use curitiba_passes::effects::dielectric::Variant;
    use curitiba_pipeline::backend::{PixelCone, Shade};
    use curitiba_pipeline::programs::{RAY_PROGRAMS, RayParams, RayProgram};
    use curitiba_pipeline::scene::RenderScene;
    use glam::{Vec3, Vec4};

    fn names(group: &Group) -> Vec<&str> {
        let texts = [&group.entry, &group.any_hit].into_iter().flatten();
        texts.map(|text| text.to_str().expect("plain letters")).collect()
    }

    #[test]
    fn every_program_that_is_called_is_in_the_module() {
        for info in RAY_PROGRAMS {
            let panes = [Fidelity::Corrected, Fidelity::Thesis].map(Variant::Panes);
            let variants = panes.into_iter().chain([Variant::Bodies, Variant::Ways]);
            let lit =
                variants.flat_map(|variant| [Lighting::Sun, Lighting::Lights].map(|lighting| (variant, lighting)));
            let kinds = lit.flat_map(|(variant, lighting)| [false, true].map(|spheres| (variant, lighting, spheres)));
            for (variant, lighting, spheres) in kinds {
                let Some(ptx) = on_optix(Key { program: info.program, variant, lighting, spheres }) else { continue };
                for group in groups(info).iter().flatten() {
                    for name in names(group) {
                        assert!(ptx.contains(&format!(".entry {name}(")), "{}: {name}", info.stem);
                    }
                }
            }
        }
    }

    #[test]
    fn hits_call_what_projects_name_for_the_ray_and_the_material() {
        let all = groups(RayProgram::Final.info());
        let at = |index: usize| names(all[index].as_ref().expect("it is called"));
        assert_eq!(at(0), ["__raygen__buffer_camera"]);
        assert_eq!(at(EXCEPTION), ["__exception__exception"]);
        assert_eq!([at(MISSES), at(MISSES + 1)], [["__miss__miss"], ["__miss__miss_shadow"]]);
        assert_eq!(at(HITS), ["__closesthit__closest_hit"]);
        assert_eq!(at(HITS + 1), ["__closesthit__closest_hit_glass"]);
        assert_eq!(at(HITS + 2), ["__closesthit__closest_hit", "__anyhit__alpha_test"]);
        assert_eq!(at(HITS + 3), ["__closesthit__closest_hit_glass", "__anyhit__alpha_test"]);
        for cut in [0, 2] {
            assert_eq!(at(HITS + MATERIALS + cut), ["__anyhit__any_hit_shadow"]);
            assert_eq!(at(HITS + MATERIALS + cut + 1), ["__anyhit__any_hit_shadow_glass"]);
        }
        // If a program has one hit program only, glass uses it too. A ray type that is never traced has no groups.
        let shadows = groups(RayProgram::DeferredShadows.info());
        assert_eq!(shadows[HITS + MATERIALS + 1], shadows[HITS + MATERIALS]);
        assert!(shadows[MISSES].is_none() && shadows[HITS].is_none() && shadows[MISSES + 1].is_some());
        assert_eq!(groups(RayProgram::Dummy.info()).iter().flatten().count(), 2);
    }

    #[test]
    fn segments_ask_for_the_ids_on_opaque_materials_alone() {
        let groups = segment_groups();
        for group in groups.iter().flatten() {
            for name in names(group) {
                assert!(crate::programs::segments_on_optix().contains(&format!(".entry {name}(")), "{name}");
            }
        }
        assert_eq!(groups.iter().flatten().count(), 5);
        let headers: Headers = std::array::from_fn(|group| [group as u8 + 1; SBT_RECORD_HEADER]);
        let table = segment_records(&headers, &[false, true], 3);
        let first_bytes: Vec<u8> = table.chunks_exact(SBT_RECORD_HEADER).map(|record| record[0]).collect();
        assert_eq!(first_bytes, [1, 2, 3, 4, 5, 0, 6, 0, 5, 0]);
        assert_eq!(segment_records(&headers, &[], 0).len() / SBT_RECORD_HEADER, HITS + RAYS.len());
    }

    #[test]
    fn each_material_of_a_pass_has_a_record_for_each_type_of_ray() {
        let headers: Headers = std::array::from_fn(|group| [group as u8; SBT_RECORD_HEADER]);
        let shade = |alpha_cutoff| Shade {
            diffuse: Vec4::ONE,
            emission: Vec4::ZERO,
            texture: None,
            alpha_cutoff,
            ..Shade::default()
        };
        let scene = RenderScene::default();
        let mut job = RayJob {
            from_camera: None,
            origin: [0; 2],
            scene: &scene,
            program: RayProgram::Final,
            params: RayParams::default(),
            fidelity: Fidelity::Corrected,
            seed: 0,
            eye: Vec3::ZERO,
            cone: PixelCone::default(),
            lights: &[],
            sun: None,
            width: 1,
            height: 1,
            position: &[],
            normal: &[],
            color: &[],
            triangle: &[],
            shared: None,
            shades: &[shade(None), shade(Some(0.5)), shade(None)],
            glass: &[false, false, true],
            shadow_glass: &[false, true, false],
            beyond: Vec3::ZERO,
            dielectrics: &[],
        };
        let first_bytes = |job: &RayJob<'_>, materials| -> Vec<usize> {
            let table = records(&headers, job, materials);
            table.chunks_exact(SBT_RECORD_HEADER).map(|record| usize::from(record[0])).collect()
        };
        let hit = |ray: usize, kind: usize| HITS + ray * MATERIALS + kind;
        let expected = [0, 1, 2, 3, hit(0, 0), hit(1, 0), hit(0, 2), hit(1, 3), hit(0, 1), hit(1, 0)];
        assert_eq!(first_bytes(&job, 3), expected);
        assert_eq!(first_bytes(&job, 4)[10..], [hit(0, 0), hit(1, 0)], "the scene may have more");
        job.fidelity = Fidelity::Thesis;
        assert_eq!(first_bytes(&job, 0)[6..8], [hit(0, 0), hit(1, 1)], "nothing is cut out there");
        (job.shades, job.glass, job.shadow_glass) = (&[], &[], &[]);
        assert_eq!(first_bytes(&job, 0).len(), HITS + RAYS.len(), "never none");
    }
}
