//! Paths through glass that is rough, disperses colours or has a reflectance of its own, and paths that are cut off. The functions of
//! `ways.cuh` are compared bit for bit; the programs that follow such paths are compiled for the host as those in `glass.rs`.

use super::glass::{
    Asked, Divided, PIXELS, ROUNDING, Scene, WHOLE, differences, each_pixel, each_pixel_of, several, solid,
    under_a_sky, under_water,
};
use super::lights::{asked, lamps};
use super::spheres::with_spheres;
use super::{Random, compiled_with, run, words};
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::effects::dielectric::{Microfacet, Variant};
use curitiba_passes::effects::interface_of;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba_pipeline::executor::{Engines, Progress, Renderer, Silent};
use curitiba_pipeline::glass::{CutoffColor, Dielectric, GlassShadow, MOST_BOUNCES, PathLimits, Reflectance, Roulette};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::{Fidelity, Fresnel, RayParams, RayProgram, TextureLod};
use curitiba_pipeline::project;
use curitiba_pipeline::scene::RenderScene;
use glam::{Vec2, Vec3};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

fn functions(name: &str, header: &str, change: Option<[&str; 2]>) -> Option<PathBuf> {
    compiled_with("ways.cpp", name, change.map(|change| (header, change)))
}

/// Microfacets: how many differ, how many normals are tilted from the surface's normal by more than a tenth, and how many were compared.
fn facets_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(31);
    let (mut input, mut expected, mut tilted) = (Vec::new(), Vec::new(), 0);
    for index in 0..20_000 {
        let alpha: f32 = [1e-4, 0.01, 0.09, 0.4, 1.0][index % 5];
        let normal = if index % 50 == 0 { Vec3::AXES[index % 3] } else { random.direction() };
        let mut view = random.direction();
        // Along the normal, at any angle, and grazing.
        match index % 4 {
            0 => view = -normal,
            1 => view = (view - normal * view.dot(normal) - normal * 1e-4).normalize(),
            _ if view.dot(normal) > 0.0 => view = -view,
            _ => {}
        }
        let point = Vec2::new(random.unit(), random.unit());
        let onward = random.direction();
        input.push(alpha.to_bits());
        input.extend(words([normal, view]).chain([point.x, point.y].map(f32::to_bits)).chain(words([onward])));
        let facet = Microfacet::seen(alpha, normal, view, point);
        tilted += usize::from(facet.normal.dot(normal) < 0.9);
        expected.push((facet.normal, facet.passes(onward)));
    }
    let found = run(program, "facets", &input);
    let same = |(found, (normal, passes)): &(&[u32; 4], (Vec3, f32))| {
        let [x, y, z, share] = found.map(f32::from_bits);
        // Zeros of either sign are equal.
        Vec3::new(x, y, z) == *normal && share == *passes
    };
    let found = found.as_chunks::<4>().0;
    let differ = found.iter().zip(expected).filter(|pair| !same(pair)).count();
    [differ, tilted, found.len()]
}

#[test]
fn microfacets_of_the_device_have_the_bits_of_the_processor() {
    let Some(program) = functions("ways", "ways.cuh", None) else { return };
    let [differ, tilted, all] = facets_that_differ(&program);
    assert!(differ == 0 && all == 20_000 && tilted > 3000, "{differ} of {all} differ, {tilted} are tilted");
    for (name, change) in [
        ("ways-height", ["float height = 1.0f + stretched.z;", "float height = 1.0f + viewer.z;"]),
        ("ways-smith", ["(sqrtf(1.0f + slope) + 1.0f)", "(sqrtf(1.0f + slope) + 1.001f)"]),
    ] {
        let changed = functions(name, "ways.cuh", Some(change)).expect("there is a compiler");
        assert!(facets_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// Indices at a wavelength and interfaces of materials. Returns how many differ (powers: by more than their rounding), how many use a reflectance
/// curve of their own, and how many were compared.
fn indices_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(32);
    let (mut input, mut expected, mut own) = (Vec::new(), Vec::new(), 0);
    for index in 0..20_000 {
        let curve = Reflectance {
            minimum: 0.5 * random.unit(),
            maximum: 0.5 + 0.5 * random.unit(),
            exponent: [0.0, 1.0, 5.0, 2.5, 1000.0][index % 5],
        };
        let reflectance = (index % 3 > 0).then_some(curve);
        let glass = Dielectric { spread: 0.1 * random.unit(), reflectance, ..solid(1.0 + random.unit()) };
        let wavelength = 380.0 + 400.0 * random.unit();
        let (cos, ratio) = ([random.unit(), 0.0, 1.0][index % 7 % 3], 0.5 + 1.5 * random.unit());
        let weights = [Fresnel::Exact, Fresnel::Schlick, Fresnel::S, Fresnel::P][index % 4];
        let exponent = if reflectance.is_some() { curve.exponent } else { -1.0 };
        let numbers = [glass.index, glass.spread, wavelength, curve.minimum, curve.maximum, exponent, cos, ratio];
        input.extend(numbers.map(f32::to_bits).into_iter().chain([weights as u32]));
        let face = interface_of(&glass, weights, cos, ratio);
        let is_own = reflectance.is_some() && face.cos_refracted > 0.0;
        own += usize::from(is_own);
        expected.push(([glass.index_at(wavelength), face.reflectance, face.cos_refracted], if is_own { 4 } else { 0 }));
    }
    let found = run(program, "indices", &input);
    let found = found.as_chunks::<3>().0;
    let differ = found.iter().zip(expected).filter(|(found, (numbers, powers))| {
        let apart = found[1].abs_diff(numbers[1].to_bits());
        found[0] != numbers[0].to_bits() || found[2] != numbers[2].to_bits() || apart > *powers
    });
    [differ.count(), own, found.len()]
}

#[test]
fn indices_and_reflectances_of_the_device_are_those_of_the_processor() {
    let Some(program) = functions("ways", "ways.cuh", None) else { return };
    let [differ, own, all] = indices_that_differ(&program);
    assert!(differ == 0 && all == 20_000 && own > 5000, "{differ} of {all} differ, {own} have a curve of their own");
    for (name, header, change) in [
        ("ways-line", "params.cuh", ["CAUCHY_AT_D = 1.5168e0f", "CAUCHY_AT_D = 1.5169e0f"]),
        (
            "ways-side",
            "bodies.cuh",
            ["ratio < 1.0f ? interface.cos_refracted", "ratio > 1.0f ? interface.cos_refracted"],
        ),
        ("ways-total", "bodies.cuh", ["face.exponent < 0.0f || is_total", "face.exponent < 0.0f"]),
    ] {
        let changed = functions(name, header, Some(change)).expect("there is a compiler");
        assert!(indices_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// Dispersion in the balls, the veiled box and the box that overlaps it.
pub(crate) fn dispersing(scene: Scene) -> Scene {
    scene.of_glass(|material, what| what.spread = [0.0, 0.02, 0.01, 0.04][material % 4])
}

/// Rough bodies and walls; the roughness of some has a texture.
pub(crate) fn frosted(scene: Scene) -> Scene {
    scene.of_glass(|material, what| {
        what.alpha = [0.09, 0.0, 0.02, 0.3][material % 4];
        what.roughness_texture = (material % 4 == 0).then_some(0);
    })
}

/// Reflectances and reflection colours that belong to each material.
pub(crate) fn owned(scene: Scene) -> Scene {
    let curve = Reflectance { minimum: 0.1, maximum: 0.8, exponent: 3.0 };
    scene.of_glass(|material, what| {
        what.reflectance = (material % 3 != 0).then_some(curve);
        what.reflection = (material % 2 == 0).then_some(Vec3::new(0.9, 0.6, 0.3));
    })
}

/// Spheres among [`several`].
fn spheres() -> Scene {
    with_spheres(several())
}

const SOURCES: [(RayProgram, &str); 3] = [
    (RayProgram::Refraction, "ways_refraction.cpp"),
    (RayProgram::Final, "ways_final.cpp"),
    (RayProgram::Final, "ways_spheres_final.cpp"),
];

const EACH_COLOR: Divided = Divided { wavelengths: 5, ..WHOLE };
const EACH_FACET: Divided = Divided { paths: 5, ..WHOLE };
pub(crate) const BOTH: Divided = Divided { paths: 2, wavelengths: 3, ..WHOLE };

fn cut(limits: PathLimits) -> Divided {
    Divided { limits, ..WHOLE }
}

/// Limits that cut off no path: programs that follow ways are called, and follow all of them.
pub(crate) fn uncut() -> Divided {
    cut(PathLimits { reflections: MOST_BOUNCES - 1, ..PathLimits::DEFAULT })
}

/// Compares pictures and counts of rays of the programs with the processor's.
fn compare(source: &str, scene: &Scene, asked: Asked<'_>, what: &str) -> Option<()> {
    let compiled = compiled_with(source, "ways", None)?;
    let (largest, counts, shown) = differences(&compiled, scene, asked);
    assert!(largest < ROUNDING && counts == 0, "{source}, {what}: {largest}, {counts} counts differ");
    assert!(shown > PIXELS / 5, "{source}, {what}: {shown} pixels show glass");
    Some(())
}

/// The largest difference between a program's pictures for two questions.
fn apart(source: &str, asked: [(&Scene, Asked<'_>); 2]) -> Option<f32> {
    let compiled = compiled_with(source, "ways", None)?;
    let [first, second] = asked.map(|(scene, asked)| {
        let mut shown = Vec::new();
        each_pixel(&compiled, scene, asked, |_, _, [found, _]| shown.push(found));
        shown
    });
    Some(first.iter().zip(&second).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max))
}

#[test]
fn smooth_glass_that_is_followed_as_ways_looks_as_on_the_processor() {
    for (program, source) in SOURCES {
        for scene in [several(), under_water(), under_a_sky()] {
            for (depth, lod) in [(5, TextureLod::Zero), (0, TextureLod::Cones)] {
                let asked = Asked { divided: uncut(), depth, lod, ..asked(program, GlassShadow::Straight, &[]) };
                let Some(()) = compare(source, &scene, asked, &format!("depth {depth}")) else { return };
            }
        }
    }
}

#[test]
fn paths_that_are_cut_off_are_those_of_the_processor() {
    let all = PathLimits::DEFAULT;
    let background = CutoffColor::Background;
    for (program, source) in SOURCES {
        for (scene, kinds) in [(several(), 6), (frosted(several()), 1), (dispersing(several()), 1), (under_water(), 2)]
        {
            let limits = [
                PathLimits { cutoff: 0.05, ..all },
                PathLimits { cutoff: 0.2, cutoff_color: background, ..all },
                PathLimits { cutoff: 0.3, roulette: Roulette::On, ..all },
                PathLimits { reflections: 0, ..all },
                PathLimits { reflections: 1, refractions: 2, cutoff_color: background, ..all },
                PathLimits { cutoff: 0.02, roulette: Roulette::On, cutoff_color: background, reflections: 2, ..all },
            ];
            for limits in &limits[..kinds] {
                let divided = Divided { paths: 3, wavelengths: 3, limits: *limits, seed: 7 };
                let asked = Asked { divided, depth: 5, ..asked(program, GlassShadow::Report, &[]) };
                let Some(()) = compare(source, &scene, asked, &format!("{limits:?}")) else { return };
            }
        }
    }
    // Each of them is seen.
    let plain = Asked { divided: uncut(), depth: 5, ..asked(RayProgram::Refraction, GlassShadow::Report, &[]) };
    for limits in [
        PathLimits { cutoff: 0.05, ..all },
        PathLimits { cutoff: 0.05, roulette: Roulette::On, ..all },
        PathLimits { refractions: 2, ..all },
    ] {
        let limited = Asked { divided: cut(limits), ..plain };
        let Some(seen) = apart(SOURCES[0].1, [(&several(), plain), (&several(), limited)]) else { return };
        assert!(seen > 0.02, "{limits:?} changes nothing: {seen}");
    }
}

#[test]
fn colours_are_bent_apart_as_on_the_processor() {
    for (program, source) in SOURCES {
        for scene in [several(), under_water(), under_a_sky()].map(dispersing) {
            for (depth, lod, shadow) in [
                (3, TextureLod::Zero, GlassShadow::Straight),
                (0, TextureLod::Cones, GlassShadow::Report),
                (1, TextureLod::Cones, GlassShadow::Straight),
            ] {
                let asked = Asked { divided: EACH_COLOR, depth, lod, ..asked(program, shadow, &[]) };
                let Some(()) = compare(source, &scene, asked, &format!("depth {depth}")) else { return };
            }
        }
    }
    let scene = dispersing(several());
    let [whole, apart_by_color] = [uncut(), Divided { wavelengths: 5, ..uncut() }]
        .map(|divided| Asked { divided, ..asked(RayProgram::Refraction, GlassShadow::Report, &[]) });
    let Some(seen) = apart(SOURCES[0].1, [(&scene, whole), (&scene, apart_by_color)]) else { return };
    assert!(seen > 0.05, "no colour is bent apart: {seen}");
}

#[test]
fn rough_glass_looks_as_on_the_processor() {
    for (program, source) in SOURCES {
        for scene in [several(), under_water(), under_a_sky()].map(frosted) {
            for (depth, lod, divided) in [
                (2, TextureLod::Zero, EACH_FACET),
                (0, TextureLod::Cones, EACH_FACET),
                (1, TextureLod::Cones, Divided { seed: 5, ..EACH_FACET }),
            ] {
                let asked = Asked { divided, depth, lod, ..asked(program, GlassShadow::Straight, &[]) };
                let Some(()) = compare(source, &scene, asked, &format!("depth {depth}")) else { return };
            }
        }
    }
    let [smooth, rough] = [(several(), uncut()), (frosted(several()), EACH_FACET)];
    let of = |divided| Asked { divided, ..asked(RayProgram::Refraction, GlassShadow::Report, &[]) };
    let Some(seen) = apart(SOURCES[0].1, [(&smooth.0, of(smooth.1)), (&rough.0, of(rough.1))]) else { return };
    assert!(seen > 0.05, "no glass is rough: {seen}");
}

#[test]
fn glass_that_is_rough_and_bends_colours_apart_looks_as_on_the_processor() {
    for (program, source) in SOURCES {
        for scene in [several(), under_water()] {
            let scene = owned(frosted(dispersing(scene)));
            let asked = Asked { divided: BOTH, depth: 2, samples: 4, ..asked(program, GlassShadow::Straight, &[]) };
            let Some(()) = compare(source, &scene, asked, "both") else { return };
        }
    }
}

#[test]
fn reflectances_of_materials_own_look_as_on_the_processor() {
    for (program, source) in SOURCES {
        for scene in [several(), under_water(), under_a_sky()].map(owned) {
            for (fresnel, shadow) in [
                (Fresnel::Exact, GlassShadow::Straight),
                (Fresnel::Schlick, GlassShadow::Report),
                (Fresnel::P, GlassShadow::Straight),
            ] {
                let asked = Asked { fresnel, depth: 4, ..asked(program, shadow, &[]) };
                let Some(()) = compare(source, &scene, asked, "own") else { return };
            }
        }
    }
    let plain = Asked { divided: uncut(), ..asked(RayProgram::Refraction, GlassShadow::Report, &[]) };
    let own = Asked { divided: WHOLE, ..plain };
    let Some(seen) = apart(SOURCES[0].1, [(&several(), plain), (&owned(several()), own)]) else { return };
    assert!(seen > 0.05, "they change nothing: {seen}");
}

#[test]
fn spheres_and_several_lights_are_seen_by_all_ways_as_on_the_processor() {
    let lights = lamps();
    let scene = owned(frosted(dispersing(spheres())));
    for (source, lights) in [("ways_spheres_final.cpp", &[][..]), ("ways_spheres_lights_final.cpp", &lights[..])] {
        let lit = asked(RayProgram::Final, GlassShadow::Straight, lights);
        for asked in [
            Asked { divided: BOTH, lod: TextureLod::Cones, depth: 2, ..lit },
            Asked {
                divided: Divided { limits: PathLimits { cutoff: 0.02, ..PathLimits::DEFAULT }, ..BOTH },
                depth: 4,
                ..lit
            },
        ] {
            let Some(()) = compare(source, &scene, asked, "spheres") else { return };
        }
    }
}

#[test]
fn a_wrong_word_of_paths_that_are_divided_or_cut_off_is_noticed() {
    let of = |divided| Asked {
        divided,
        depth: 3,
        lod: TextureLod::Cones,
        ..asked(RayProgram::Refraction, GlassShadow::Report, &[])
    };
    let cut_off = PathLimits { cutoff: 0.2, cutoff_color: CutoffColor::Background, ..PathLimits::DEFAULT };
    let by_chance = PathLimits { cutoff: 0.3, roulette: Roulette::On, ..PathLimits::DEFAULT };
    let bounces = PathLimits { reflections: 1, ..PathLimits::DEFAULT };
    let (plain, colors, rough) = (several(), dispersing(several()), frosted(several()));
    let own = owned(several());
    for (scene, divided, change) in [
        // Absorption does not reduce a path's importance, or dividing a path does not.
        (&plain, cut(cut_off), ["now.path.importance = now.path.importance * greatest(left);", ""]),
        (
            &rough,
            Divided { paths: 3, limits: cut_off, ..WHOLE },
            ["now.path.importance = now.path.importance / (float)last.ways;", ""],
        ),
        // Cut paths are black.
        (&plain, cut(cut_off), ["missed = missed + whole * vector_of(params.beyond);\n            return", "return"]),
        // Roulette gains no weight, or takes its random numbers from another dimension.
        (&plain, cut(by_chance), ["< chance ? 1.0f / chance : 0.0f", "< chance ? 1.0f : 0.0f"]),
        (&plain, cut(by_chance), ["dimensions(key, HASH_ROULETTE).x", "dimensions(key, HASH_ROULETTE).y"]),
        // One reflection fewer.
        (&plain, cut(bounces), ["path.reflections > ways.reflections", "path.reflections >= ways.reflections"]),
        // Colours keep the index of line d; negative weights are positive; reflected light loses its colour.
        (&colors, EACH_COLOR, ["if (stratum == NO_WAY) return index;", "return index;"]),
        (
            &colors,
            EACH_COLOR,
            ["return xyz(stratum_of(params, stratum));", "return absolute(xyz(stratum_of(params, stratum)));"],
        ),
        (
            &own,
            WHOLE,
            ["on.reflectance * on.kept_back * vector_of(face.mirrors)", "splat(on.reflectance * on.kept_back)"],
        ),
        // Facets use another counter, ignore the texture, or stop no light; walls let light go straight on.
        (&rough, EACH_FACET, ["dimensions(now.path.key, HASH_FACETS)", "dimensions(now.path.key, HASH_DISC)"]),
        (&rough, EACH_FACET, ["float alpha = face.alpha * roughness * roughness;", "float alpha = face.alpha;"]),
        (&rough, EACH_FACET, ["on.kept_on = enters ? passes_facets(facet, refracted) : 0.0f;", ""]),
        (&rough, EACH_FACET, ["behind = reflect(mirrored, facet.surface);", ""]),
    ] {
        let compiled = compiled_with("ways_refraction.cpp", "ways-changed", Some(("ways.cuh", change)));
        let Some(compiled) = compiled else { return };
        let (largest, ..) = differences(&compiled, scene, of(divided));
        assert!(largest > 1e-3, "{change:?} is not noticed: {largest}");
    }
    // Shadows use Fresnel's share instead of the material's own reflectance.
    let change = ["face.exponent < 0.0f || is_total", "true"];
    let Some(compiled) = compiled_with("ways_final.cpp", "ways-shadow", Some(("bodies.cuh", change))) else { return };
    let asked = Asked { depth: 0, ..asked(RayProgram::Final, GlassShadow::Straight, &[]) };
    assert!(differences(&compiled, &own, asked).0 > 1e-3, "{change:?} is not noticed");
}

/// The processor's backend, which computes each pass by a device program as well.
struct OnHost {
    inner: CpuRays,
    program: PathBuf,
    /// The largest difference of a colour, the number of ray kinds whose counts differ, and the number of reflected and refracted rays.
    found: Rc<RefCell<Vec<(f32, usize, u64)>>>,
}

impl RayBackend for OnHost {
    fn name(&self) -> &'static str {
        "host"
    }

    fn device(&self) -> String {
        self.inner.device()
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.inner.supports(program, fidelity)
    }

    fn supports_glass(&self, _: RayProgram, _: &RayParams, _: &[Dielectric]) -> Result<(), BackendError> {
        Ok(())
    }

    fn traces_cones(&self) -> bool {
        true
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.inner.build(scene, filtered)
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.inner.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let stats = self.inner.run(job, output, progress)?;
        assert_eq!(Variant::of(job), Variant::Ways, "another program runs this");
        let mut largest = 0.0_f32;
        let counts = each_pixel_of(&self.program, job, (output, stats.rays), |_, [found, expected]| {
            let difference = (found - expected).abs().max_element();
            largest = if difference.is_nan() { f32::INFINITY } else { largest.max(difference) };
        });
        self.found.borrow_mut().push((largest, counts, stats.rays.reflected + stats.rays.refracted));
        Ok(stats)
    }
}

/// Projects of glass as they stand, small and without occlusion: prisms that disperse colours, frosted balls, and balls whose paths are cut off.
#[test]
fn pictures_of_projects_of_glass_are_the_processors() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects/glass");
    if !folder.is_dir() {
        println!("skipped: the projects are not here");
        return;
    }
    let Some(program) = compiled_with("ways_final.cpp", "ways", None) else { return };
    for (name, least, set) in [
        ("Prism", 40_000, &["pass2.wavelengths=16"][..]),
        ("Prism", 10_000, &["pass2.wavelengths=8", "pass2.cutoff=0.01"]),
        ("Frosted", 10_000, &["pass2.paths=8", "pass2.depth=2"]),
        ("balls", 300, &["pass2.cutoff=0.02"]),
        ("balls", 300, &["pass2.cutoff=0.05", "pass2.cutoffcolor=background", "pass2.reflections=3"]),
        ("balls", 300, &["pass2.cutoff=0.05", "pass2.roulette=on"]),
    ] {
        let found = Rc::new(RefCell::new(Vec::new()));
        let rays = OnHost { inner: CpuRays::new(), program: program.clone(), found: Rc::clone(&found) };
        let set = set.iter().chain(&["pass2.samples=0"]).map(|one| (*one).to_owned()).collect();
        let settings = Settings { size: Some([32, 32]), set, ..Settings::default() };
        let project = project::load(&folder.join(format!("{name}.xml"))).expect("the project loads");
        let plan = Plan::new(project, settings).expect("the plan stands");
        let what = format!("{name}, {:?}", plan.project.name);
        let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(rays));
        Renderer::new(plan, engines, &mut Silent).expect("ready").frame(&mut Silent).expect("rendered");
        let found = found.borrow();
        let [(largest, counts, rays)] = found[..] else { panic!("{what}: {} passes ran", found.len()) };
        println!("{what}: {largest:e} off, {rays} rays in glass");
        assert!(largest < ROUNDING && counts == 0, "{what}: {largest}, {counts} counts differ");
        assert!(rays > least, "{what}: {rays} rays");
    }
}
