//! The device headers that contain arithmetic, compiled for the host and compared bit for bit with the Rust code that they follow; no GPU
//! is needed. Without a C++ compiler (`$CXX`, `c++`, `g++` or `clang++`) the tests are skipped.
//!
//! Each comparison has a negative control: with one constant of the header changed, it fails.

mod adaptive;
mod batches;
mod caustics;
mod glass;
mod lights;
mod spheres;
mod ways;

use curitiba_cuda::layout::{WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT};
use curitiba_passes::effects::{
    Cone, Footprint, RayCone, TextureArea, curvature, fresnel, horizon, is_turned, polarised, schlick, way_onto_round,
};
use curitiba_passes::sampling::hash::{dimensions, path_key, pixel_key, unit};
use curitiba_passes::sampling::hemisphere::{Basis, cosine};
use curitiba_passes::sampling::owen_sobol::scramble_reversed;
use curitiba_passes::trace::{Bvh, Hit, Quality, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::scene::texture::{Magnification, Texture, Wrap};
use curitiba_pipeline::scene::{Batch, Geometry, normal_map};
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};

/// The first C++ compiler that runs.
fn compiler() -> Option<String> {
    static FOUND: OnceLock<Option<String>> = OnceLock::new();
    let answers = |name: &String| {
        let version = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        version.is_ok_and(|status| status.success())
    };
    let named = std::env::var("CXX").ok().into_iter();
    FOUND.get_or_init(|| named.chain(["c++", "g++", "clang++"].map(str::to_owned)).find(answers)).clone()
}

/// The functions of the headers as a host program; `change` is applied to `params.cuh` before it is compiled. `None` without a compiler.
fn compiled(name: &str, change: Option<[&str; 2]>) -> Option<PathBuf> {
    compiled_with("functions.cpp", name, change.map(|change| ("params.cuh", change)))
}

/// Compiles a source of this folder with the headers into a host program. `change` (file, from and to) is applied to one of them before.
/// Without a change, each source is compiled once, whatever its name.
fn compiled_with(source: &str, name: &str, change: Option<(&str, [&str; 2])>) -> Option<PathBuf> {
    static UNCHANGED: Mutex<BTreeMap<String, PathBuf>> = Mutex::new(BTreeMap::new());
    let Some(compiler) = compiler() else {
        println!("skipped: there is no C++ compiler (c++, g++ or clang++)");
        return None;
    };
    if change.is_some() {
        return Some(compile(&compiler, source, name, change));
    }
    let mut unchanged = UNCHANGED.lock().unwrap_or_else(PoisonError::into_inner);
    let compiled = || compile(&compiler, source, source.trim_end_matches(".cpp"), None);
    Some(unchanged.entry(source.to_owned()).or_insert_with(compiled).clone())
}

fn compile(compiler: &str, source: &str, name: &str, change: Option<(&str, [&str; 2])>) -> PathBuf {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("device-on-host-{name}"));
    std::fs::create_dir_all(&folder).expect("the folder for temporary files can be written");
    for entry in std::fs::read_dir(crate_folder.join("programs")).expect("the programs are there") {
        let path = entry.expect("readable").path();
        if path.extension().is_some_and(|extension| extension == "cuh") {
            let mut text = std::fs::read_to_string(&path).expect("text");
            if let Some((header, [from, to])) = change
                && path.ends_with(header)
            {
                assert_eq!(text.matches(from).count(), 1, "`{from}` is in the header once");
                text = text.replace(from, to);
            }
            std::fs::write(folder.join(path.file_name().expect("a file")), text).expect("a copy can be written");
        }
    }
    let program = folder.join("functions");
    let output = Command::new(compiler)
        .args(["-std=c++17", "-O1", "-ffp-contract=off", "-I"])
        .arg(crate_folder.join("tests/host"))
        .arg("-I")
        .arg(&folder)
        .arg(crate_folder.join("tests/host").join(source))
        .arg("-o")
        .arg(&program)
        .output()
        .expect("the compiler runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program
}

/// Runs a function of the compiled headers on a table of words, and returns its output.
fn run(program: &Path, function: &str, input: &[u32]) -> Vec<u32> {
    let mut child = Command::new(program)
        .arg(function)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program that was just compiled runs");
    let bytes: Vec<u8> = input.iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut stdin = child.stdin.take().expect("a pipe");
    let writer = std::thread::spawn(move || stdin.write_all(&bytes));
    let output = child.wait_with_output().expect("it ends");
    writer.join().expect("no panic").expect("it reads all");
    assert!(output.status.success(), "{function} failed");
    output.stdout.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

struct Random(u64);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 32) as u32
    }

    fn unit(&mut self) -> f32 {
        unit(self.bits())
    }

    fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    fn direction(&mut self) -> Vec3 {
        self.cube().normalize_or(Vec3::X)
    }
}

/// Triangles with their own vertices, of several sizes, some of them slivers, around a centre.
fn soup(random: &mut Random, count: u32, center: Vec3) -> Geometry {
    let mut geometry = Geometry::default();
    for index in 0..count {
        let (middle, size) = (center + random.cube(), [1.0, 0.1, 0.01][index as usize % 3]);
        let mut corners = [0; 3].map(|_| middle + random.cube() * size);
        if index % 5 == 0 {
            corners[2] = corners[0].lerp(corners[1], 0.3) + random.cube() * size * 1e-5;
        }
        geometry.positions.extend(corners);
        geometry.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
    }
    geometry.batches.push(Batch { material: 0, first: 0, count });
    geometry
}

fn words(vectors: impl IntoIterator<Item = Vec3>) -> impl Iterator<Item = u32> {
    vectors.into_iter().flat_map(|vector| vector.to_array()).map(f32::to_bits)
}

/// A light as the device has it.
fn light_words(light: &curitiba_cuda::layout::Light) -> impl Iterator<Item = u32> + use<> {
    let curitiba_cuda::layout::Light { place, flags, direction, range, color, exponent, attenuation, inner, outer } =
        *light;
    let bits = |numbers: &[f32]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<u32>>();
    let words = [
        bits(&place),
        vec![flags],
        bits(&direction),
        bits(&[range]),
        bits(&color),
        bits(&[exponent]),
        bits(&attenuation),
        bits(&[inner, outer]),
    ];
    words.into_iter().flatten()
}

fn header(geometry: &Geometry) -> Vec<u32> {
    [geometry.triangles.len() as u32].into_iter().chain(words(geometry.positions.iter().copied())).collect()
}

/// A point of a triangle: at a corner (`kind` 0), on an edge (1) or inside.
fn target(random: &mut Random, geometry: &Geometry, triangle: u32, kind: usize) -> Vec3 {
    let [a, b, c] = geometry.corners(triangle);
    let (u, v) = (random.unit(), random.unit());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    match kind {
        0 => a,
        1 => a.lerp(b, u),
        _ => a + (b - a) * u + (c - a) * v,
    }
}

const CENTERS: [Vec3; 3] = [Vec3::ZERO, Vec3::new(30.0, -20.0, 10.0), Vec3::new(1.0e4, 3.0e3, 0.0)];

/// For rays to points, edges and corners of triangles: how many answers of the headers differ from the tree's, and how many rays hit.
fn intersections_that_differ(program: &Path) -> [usize; 2] {
    let mut random = Random(1);
    let (mut differ, mut hits) = (0, 0);
    for center in CENTERS {
        let geometry = soup(&mut random, 60, center);
        let tree = Bvh::build(&geometry, &[], Quality::default());
        let mut input = header(&geometry);
        let mut expected = Vec::new();
        for index in 0..6000 {
            let goal = target(&mut random, &geometry, index % 60, index as usize % 4);
            let origin = if index % 7 == 0 { goal } else { center + random.cube() * 2.0 };
            let direction = (goal - origin).normalize_or(random.direction());
            let distance = (goal - origin).length();
            let (t_min, t_max) =
                [(0.0, f32::INFINITY), (0.0, distance), (distance, 9.0), (0.01, 0.5)][index as usize % 11 % 4];
            input.extend(words([origin, direction]).chain([t_min, t_max].map(f32::to_bits)));
            expected.push(tree.closest(&Ray { origin, direction, t_min, t_max }, |_: &Hit| true));
        }
        for (found, expected) in run(program, "intersections", &input).as_chunks().0.iter().zip(expected) {
            let expected: [u32; 4] = expected
                .map_or([u32::MAX, 0, 0, 0], |hit| [hit.triangle, hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits()]);
            hits += usize::from(expected[0] != u32::MAX);
            differ += usize::from(*found != expected);
        }
    }
    [differ, hits]
}

#[test]
fn the_triangle_test_of_the_device_has_the_bits_of_the_tree() {
    let Some(program) = compiled("triangle", None) else { return };
    let [differ, hits] = intersections_that_differ(&program);
    assert!(differ == 0 && hits > 5000, "{differ} rays differ, {hits} hit something");
    for (name, change) in [
        ("padding", ["SLAB_ERROR = 4.7683716e-7f", "SLAB_ERROR = 4.7683716e-3f"]),
        ("planes", ["FAR_PLANES = 1.0000005e0f", "FAR_PLANES = 0.9e0f"]),
    ] {
        let changed = compiled(name, Some(change)).expect("there is a compiler");
        assert!(intersections_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// How many points on triangles and ray origins differ, and how many were compared.
fn points_that_differ(program: &Path) -> [usize; 2] {
    let mut random = Random(2);
    let (mut differ, mut all) = (0, 0);
    for center in CENTERS {
        let geometry = soup(&mut random, 60, center);
        let (mut input, mut expected) = (header(&geometry), Vec::new());
        for index in 0..3000 {
            let triangle = index % 60;
            let off = random.cube() * [0.0, 1e-6, 1e-3, 1.0][index as usize % 13 % 4];
            let position = target(&mut random, &geometry, triangle, index as usize % 4) + off;
            let direction = random.direction();
            input.extend([triangle].into_iter().chain(words([position, direction])));
            let point = SurfacePoint::snap(&geometry, triangle, position);
            let start = words([point.spawn(direction)]);
            let words: Vec<u32> =
                words([point.position, point.normal]).chain([point.error.to_bits()]).chain(start).collect();
            expected.push(words);
        }
        for (found, expected) in run(program, "points", &input).as_chunks::<10>().0.iter().zip(expected) {
            // Zeros of either sign are equal.
            let same = found.iter().zip(expected).all(|(a, b)| f32::from_bits(*a) == f32::from_bits(b));
            differ += usize::from(!same);
            all += 1;
        }
    }
    [differ, all]
}

#[test]
fn points_and_offsets_of_the_device_have_the_bits_of_the_processor() {
    let Some(program) = compiled("points", None) else { return };
    let [differ, all] = points_that_differ(&program);
    assert!(differ == 0 && all == 9000, "{differ} of {all} points differ");
    for (name, change) in [
        ("units", ["OFFSET_UNITS = 3.2e1f", "OFFSET_UNITS = 3.3e1f"]),
        ("reach", ["OFFSET_REACH = 5e-1f", "OFFSET_REACH = 6e-1f"]),
        ("margin", ["OFFSET_MARGIN = 3.2e1f", "OFFSET_MARGIN = 9.6e1f"]),
    ] {
        let changed = compiled(name, Some(change)).expect("there is a compiler");
        assert!(points_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// Vectors from triangles to round surfaces, and the sides that light reaches. Returns how many differ, how many vectors are 0, how many sides
/// face the light although the round surface does not, and how many were compared.
fn ways_that_differ(program: &Path) -> [usize; 4] {
    let mut random = Random(5);
    let (mut differ, mut none, mut turned, mut all) = (0, 0, 0, 0);
    for center in CENTERS {
        let mut geometry = soup(&mut random, 60, center);
        for triangle in 0..60 {
            let [a, b, c] = geometry.corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
            // Vertex normals: flat, bent a little or much, with either sign.
            let bend = [0.0, 0.1, 0.3, 0.8][triangle as usize % 4];
            let side = if triangle % 3 == 0 { -1.0 } else { 1.0 };
            geometry.normals.extend([0; 3].map(|_| (normal + random.cube() * bend).normalize_or(normal) * side));
        }
        let mut input = header(&geometry);
        input.extend(words(geometry.normals.iter().copied()));
        let mut expected = Vec::new();
        for index in 0..6000 {
            let triangle = index % 60;
            let position = target(&mut random, &geometry, triangle, index as usize % 4);
            let point = SurfacePoint::snap(&geometry, triangle, position);
            // The light is nearly in the plane of the triangle, where bent normals may face it although the triangle does not.
            let across = point.normal.cross(random.direction()).normalize_or(Vec3::X);
            let to_light = (across + point.normal * 0.1 * random.cube().x).normalize_or(Vec3::X);
            let facing = point.normal * if point.normal.dot(to_light) > 0.0 { -1.0 } else { 1.0 };
            input.extend([triangle].into_iter().chain(words([position, to_light])));
            let way = way_onto_round(&geometry, triangle, &point, (facing, to_light));
            let side = horizon(&geometry, triangle, &point, -facing);
            let is_turned = is_turned(&geometry, triangle, &point, (-facing, to_light));
            turned += usize::from(is_turned);
            expected.push((way, side, u32::from(is_turned)));
        }
        for (found, expected) in run(program, "lifts", &input).as_chunks::<7>().0.iter().zip(expected) {
            let vector = |at: usize| Vec3::from_array(std::array::from_fn(|i| f32::from_bits(found[at + i])));
            differ += usize::from((vector(0), vector(3), found[6]) != expected);
            none += usize::from(expected.0 == Vec3::ZERO);
            all += 1;
        }
    }
    [differ, none, turned, all]
}

#[test]
fn points_are_lifted_by_the_device_as_by_the_processor() {
    let Some(program) = compiled("lifts", None) else { return };
    let [differ, none, turned, all] = ways_that_differ(&program);
    assert!(
        differ == 0 && all == 18_000 && (3000..17_000).contains(&none) && (500..9000).contains(&turned),
        "{differ} of {all} ways differ, {none} are none, of {turned} sides only the round surface is turned away"
    );
    let change = ["ROUND = 8.5e-1f", "ROUND = 9.5e-1f"];
    let changed = compiled("round", Some(change)).expect("there is a compiler");
    assert!(ways_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
}

/// Bent normals: how many differ, how many were compared, and how many were clamped to the triangle's own side.
fn bumps_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(7);
    let (mut input, mut expected, mut kept) = (Vec::new(), Vec::new(), 0);
    for index in 0..20_000 {
        let texel = random.cube() * 0.5 + 0.5;
        let flat = random.direction();
        // Interpolated normals are not of unit length, nor are tangents; some tangents are 0.
        let normal = (flat + random.cube() * 0.6) * [0.9, -0.7, 1.0][index % 3];
        let along = if index % 50 == 0 { Vec3::ZERO } else { random.cube() };
        let (scale, side) = ([1.0, 0.5, -4.0, 1e6][index % 4], [1.0, -1.0, 0.3][index % 3]);
        input.extend(words([texel, normal, along, flat]).chain([scale, side].map(f32::to_bits)));
        let bent = normal_map::bent(texel, scale, normal, along.extend(side), flat);
        let (cosine, other) = (bent.dot(flat), normal.dot(flat));
        kept += usize::from(cosine.abs() < 2.0 * normal_map::LEAST_COSINE && cosine * other > 0.0);
        expected.push(bent);
    }
    let found = run(program, "bumps", &input);
    let differ = found.as_chunks::<3>().0.iter().zip(&expected);
    let differ = differ.filter(|(found, expected)| **found != expected.to_array().map(f32::to_bits)).count();
    [differ, expected.len(), kept]
}

#[test]
fn normals_are_bent_by_the_device_as_by_the_processor() {
    let Some(program) = compiled("bumps", None) else { return };
    let [differ, all, kept] = bumps_that_differ(&program);
    assert!(differ == 0 && kept > 1000, "{differ} of {all} normals differ, {kept} are kept on their side");
    for (name, change) in [
        ("least-cosine", ["LEAST_COSINE = 1e-2f", "LEAST_COSINE = 2e-2f"]),
        ("least-height", ["LEAST_HEIGHT = 3.921569e-3f", "LEAST_HEIGHT = 4.1e-3f"]),
    ] {
        let changed = compiled(name, Some(change)).expect("there is a compiler");
        assert!(bumps_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// How many samples differ, and how many were compared.
fn samples_that_differ(program: &Path) -> [usize; 2] {
    let mut random = Random(3);
    let (mut input, mut expected) = (Vec::new(), Vec::new());
    for _ in 0..5000 {
        let [x, y, seed] = [random.bits(), random.bits(), random.bits()];
        let (normal, cos, index) = (random.direction(), random.unit(), 0.5 + random.unit());
        input.extend([x, y, seed].into_iter().chain(words([normal])).chain([cos, index].map(f32::to_bits)));
        let key = pixel_key(x, y, seed);
        let bits = dimensions(key, x);
        let direction = cosine(Vec2::from(bits.map(unit)));
        let world = Basis::around(normal).to_world(direction);
        let (exact, rough) = (fresnel(cos, index), schlick(cos, index));
        let [s, p] = polarised(cos, index).map(|interface| interface.reflectance);
        let weights = [exact.reflectance, exact.cos_refracted, rough.reflectance, rough.cos_refracted, s, p];
        let integers = [key, path_key(key, y), bits[0], bits[1], scramble_reversed(x, seed)];
        let sample: Vec<u32> =
            integers.into_iter().chain(words([direction, world])).chain(weights.map(f32::to_bits)).collect();
        expected.push(sample);
    }
    let found = run(program, "samples", &input);
    let found = found.as_chunks::<17>().0;
    let differ =
        found.iter().zip(&expected).filter(|(found, expected)| found.as_slice() != expected.as_slice()).count();
    [differ, found.len()]
}

#[test]
fn samples_and_weights_of_the_device_have_the_bits_of_the_processor() {
    let Some(program) = compiled("samples", None) else { return };
    let [differ, all] = samples_that_differ(&program);
    assert!(differ == 0 && all == 5000, "{differ} of {all} samples differ");
    let change = ["HASH_DIMENSIONS = 2u", "HASH_DIMENSIONS = 3u"];
    let changed = compiled("dimensions", Some(change)).expect("there is a compiler");
    assert!(samples_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
}

/// Verdicts of cone tests: wrong ones, certain ones, all.
fn verdicts(program: &Path) -> [usize; 3] {
    let mut random = Random(4);
    let (mut wrong, mut certain, mut all) = (0, 0, 0);
    for center in CENTERS {
        let geometry = soup(&mut random, 60, center);
        let tree = Bvh::build(&geometry, &[], Quality::default());
        let radius = 0.7;
        let mut input = header(&geometry);
        input.push(f32::to_bits(radius));
        let mut rays = Vec::new();
        for index in 0..9000 {
            let triangle = index % 60;
            // Rays to corners and edges, whose ends are near the limits, where bounds matter.
            let goal = target(&mut random, &geometry, triangle, index as usize % 3);
            let distance = [0.3, radius, 0.69999, 1e-3][index as usize % 4];
            let direction = random.direction();
            let origin = goal - direction * distance;
            let facing = (direction + random.cube() * 0.5).normalize_or(direction);
            if facing.dot(direction) <= 0.0 {
                continue;
            }
            input.extend([triangle].into_iter().chain(words([origin, facing, direction])));
            rays.push(Ray { origin, direction, t_min: 0.0, t_max: radius });
        }
        for (found, ray) in run(program, "cones", &input).into_iter().zip(rays) {
            let (hit, miss, stopped) = (found & 1 != 0, found & 2 != 0, found & 4 != 0);
            wrong += usize::from(hit && !stopped || miss && stopped);
            wrong += usize::from(hit && !tree.occluded(&ray, |_: &Hit| true));
            certain += usize::from(hit || miss);
            all += 1;
        }
    }
    [wrong, certain, all]
}

#[test]
fn what_cone_tests_of_the_device_say_is_what_the_watertight_test_says() {
    let Some(program) = compiled("cones", None) else { return };
    let [wrong, certain, all] = verdicts(&program);
    assert!(wrong == 0 && certain * 5 > all && certain < all, "{wrong} of {certain} verdicts are wrong, of {all} rays");
    let change = ["EDGE_ERROR = 8.583069e-6f", "EDGE_ERROR = 8.583069e-10f"];
    let changed = compiled("edges", Some(change)).expect("there is a compiler");
    assert!(verdicts(&changed)[0] > 0, "{change:?} is not noticed");
    let change = ["DISTANCE_MARGIN = 2e-6f", "DISTANCE_MARGIN = -2e-4f"];
    let changed = compiled("margins", Some(change)).expect("there is a compiler");
    assert!(verdicts(&changed)[0] > 0, "{change:?} is not noticed");
}

/// Cones of rays: how many differ, how many mip levels lie between the first and the last, and how many were compared.
fn ray_cones_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(9);
    let (mut differ, mut between, mut all) = (0, 0, 0);
    let textures = [(256, 256), (37, 5), (1, 64)]
        .map(|(width, height)| Texture::new("size".to_owned(), width, height, vec![[0; 4]; (width * height) as usize]));
    for center in CENTERS {
        let mut geometry = soup(&mut random, 60, center);
        for triangle in 0..60 {
            let [a, b, c] = geometry.corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
            let bend = [0.0, 0.1, 0.8][triangle as usize % 3];
            let side = if triangle % 2 == 0 { -1.0 } else { 1.0 };
            geometry.normals.extend([0; 3].map(|_| (normal + random.cube() * bend) * side));
            geometry.texcoords.extend([0; 3].map(|_| random.cube().truncate() * 3.0));
        }
        let mut input = header(&geometry);
        input.extend(words(geometry.normals.iter().copied()));
        input.extend(geometry.texcoords.iter().flat_map(|texcoord| texcoord.to_array()).map(f32::to_bits));
        let mut expected = Vec::new();
        for index in 0..4000 {
            let (triangle, texture) = (index % 60, &textures[index as usize % 3]);
            let (direction, facing) = (random.direction(), random.direction());
            let cone = RayCone { width: 0.1 * random.cube().x, spread: random.cube().y };
            let [distance, cosine, cos_refracted] = [0; 3].map(|_| 0.01 + random.unit());
            let refractive = 0.5 + random.unit();
            input.extend([triangle].into_iter().chain(words([direction, facing])));
            let numbers = [cone.width, cone.spread, distance, cosine, cos_refracted, refractive];
            input.extend(
                numbers.map(f32::to_bits).into_iter().chain([texture.levels[0].width, texture.levels[0].height]),
            );
            let normals = geometry.triangles[triangle as usize].map(|vertex| geometry.normals[vertex as usize]);
            let side = (normals[0] + normals[1] + normals[2]).dot(facing);
            let curved = curvature(geometry.corners(triangle), normals) * if side < 0.0 { -1.0 } else { 1.0 };
            let footprint = cone.footprint(&geometry, triangle, direction);
            let level = footprint.level(texture);
            between += usize::from(level > 0.0 && level < (texture.levels.len() - 1) as f32);
            let cones = [
                cone.along(distance),
                cone.mirrored(|| curved, cosine),
                cone.refracted(|| curved, [cosine, cos_refracted], refractive),
            ];
            let last = level.min((texture.levels.len() - 1) as f32);
            let numbers = cones.iter().flat_map(|cone| [cone.width, cone.spread]).chain([curved, footprint.0, last]);
            expected.push(numbers.collect::<Vec<f32>>());
        }
        for (found, expected) in run(program, "ray_cones", &input).as_chunks::<9>().0.iter().zip(expected) {
            // Zeros of either sign are equal.
            let same = found.iter().zip(expected).all(|(a, b)| f32::from_bits(*a) == b);
            differ += usize::from(!same);
            all += 1;
        }
    }
    [differ, between, all]
}

/// Texture lookups: how many differ, how many lookups with `Magnification::Nearest` read a single texel, and how many were compared.
fn lookups_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(17);
    let (mut differ, mut single, mut all) = (0, 0, 0);
    let texels: Vec<[u8; 4]> = (0..13 * 6).map(|_| [0; 4].map(|_| (256.0 * random.unit()) as u8)).collect();
    let wraps = [(Wrap::Repeat, WRAP_REPEAT), (Wrap::Mirror, WRAP_MIRROR), (Wrap::Clamp, WRAP_CLAMP)];
    let both = wraps.iter().flat_map(|u| wraps.iter().map(move |v| [*u, *v]));
    let each = both.flat_map(|wraps| [Magnification::Linear, Magnification::Nearest].map(|asked| (wraps, asked)));
    for ([(u, wrap_u), (v, wrap_v)], magnification) in each {
        let texture = Texture::new("random".to_owned(), 13, 6, texels.clone());
        let texture = texture.wrapped([u, v]).magnified(magnification);
        let stored: Vec<u32> =
            texture.levels.iter().flat_map(|level| &level.texels).map(|texel| u32::from_le_bytes(*texel)).collect();
        let nearest = magnification == Magnification::Nearest;
        let mut input = vec![13, 6, wrap_u, wrap_v, u32::from(nearest), stored.len() as u32];
        input.extend(&stored);
        let mut expected = Vec::new();
        for index in 0..1000 {
            let uv = 3.0 * random.cube().truncate();
            // The area is 0 or small, which gives level 0, or larger, which gives a level in between.
            let area = [0.0, 0.01 * random.unit() / 78.0, 60.0 * random.unit() / 78.0][index % 3];
            input.extend([uv.x, uv.y, area].map(f32::to_bits));
            let color = texture.sample(uv, TextureArea(area).level(&texture));
            let is_texel = |texel: &[u8; 4]| color.to_array() == texel.map(|code| f32::from(code) / 255.0);
            single += usize::from(nearest && texels.iter().any(is_texel));
            expected.push(color.to_array());
        }
        for (found, expected) in run(program, "lookups", &input).as_chunks::<4>().0.iter().zip(expected) {
            differ += usize::from(*found != expected.map(f32::to_bits));
            all += 1;
        }
    }
    [differ, single, all]
}

#[test]
fn texture_lookups_of_the_device_have_the_bits_of_the_processor() {
    let Some(program) = compiled("lookups", None) else { return };
    let [differ, single, all] = lookups_that_differ(&program);
    assert!(differ == 0 && all == 18_000, "{differ} of {all} differ");
    // Two of three lookups are magnified, and some of the others are hardly minified.
    assert!((6000..6800).contains(&single), "{single} of 9000 read one texel");
    for (name, change) in [
        ("lookups-nearest", ["x = floorf(x + 0.5f)", "x = floorf(x)"]),
        ("lookups-minified", ["if (lod > 0.0f) info.nearest = 0u;", ""]),
        ("lookups-wrap", ["return twice > 1.0f ? 2.0f - twice : twice;", "return twice;"]),
    ] {
        let changed = compiled_with("functions.cpp", name, Some(("scene.cuh", change))).expect("there is a compiler");
        assert!(lookups_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

#[test]
fn cones_of_rays_of_the_device_have_the_bits_of_the_processor() {
    let Some(program) = compiled("ray-cones", None) else { return };
    let [differ, between, all] = ray_cones_that_differ(&program);
    assert!(differ == 0 && all == 12_000 && between > 3000, "{differ} of {all} differ, {between} levels lie between");
    for (name, header, change) in [
        ("ray-cones-turn", "ray_cone.cuh", ["cone.spread + 2.0f * turn_of", "cone.spread + turn_of"]),
        ("ray-cones-snell", "ray_cone.cuh", ["(rate - 1.0f) * turn_of", "rate * turn_of"]),
        ("ray-cones-log", "scene.cuh", ["square + 1.0 / 3.0", "square + 1.0 / 4.0"]),
    ] {
        let changed = compiled_with("functions.cpp", name, Some((header, change))).expect("there is a compiler");
        assert!(ray_cones_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}
