//! The meaning of an input's bytes: every byte string is a project, and most of them render.

use super::fuzz_targets::tga;
use curitiba_pipeline::plan::Settings;
use std::fmt::Write as _;

/// The shipped projects: one without a program, one for each ray program that starts from a G-buffer, one for each raster effect.
const PROJECTS: [&str; 15] = [
    include_str!("../../../xml_projects/SceneNoEffects.xml"),
    include_str!("../../../xml_projects/SceneDummy.xml"),
    include_str!("../../../xml_projects/SceneShadows.xml"),
    include_str!("../../../xml_projects/SceneReflect.xml"),
    include_str!("../../../xml_projects/SceneRefract.xml"),
    include_str!("../../../xml_projects/SceneSSAO.xml"),
    include_str!("../../../xml_projects/SceneFinal.xml"),
    include_str!("../../../xml_projects/raster/SceneShadowMap.xml"),
    include_str!("../../../xml_projects/raster/SceneCubeReflect.xml"),
    include_str!("../../../xml_projects/raster/SceneCubeRefract.xml"),
    include_str!("../../../xml_projects/raster/SceneDepthOcclusion.xml"),
    include_str!("../../../xml_projects/raster/SceneGTAO.xml"),
    include_str!("../../../xml_projects/raster/ScenePlanarReflect.xml"),
    include_str!("../../../xml_projects/raster/SceneScreenReflect.xml"),
    include_str!("../../../xml_projects/raster/SceneScreenRefract.xml"),
];
/// The first of [`PROJECTS`] whose `pass2` is a raster effect.
const FIRST_EFFECT: usize = 7;
/// The projects with ambient occlusion, and the index in [`EFFECT_SETTINGS`] of a radius at which the seeds have
/// occluders.
const OCCLUSIONS: std::ops::Range<u8> = 10..12;
const RADIUS: u8 = 10;

/// The material libraries of the projects.
const LIBRARIES: [(&str, &str); 2] = [
    ("optixTest.mlib", include_str!("../../../xml_projects/mlibs/optixTest.mlib")),
    ("DeferredRenderTargets.mlib", include_str!("../../../xml_projects/mlibs/DeferredRenderTargets.mlib")),
];

/// Numbers of ordinary scenes; each byte below `COMMON` selects one.
const ORDINARY: [&str; 16] =
    ["0", "1", "-1", "0.5", "-0.5", "2", "-2", "0.25", "3", "-3", "5", "-5", "0.1", "-0.1", "10", "0.7071068"];
const COMMON: u8 = 208;
/// Numbers at the limits of arithmetic.
const EXTREME: [&str; 24] = [
    "-0",
    "1e-45",
    "-1e-45",
    "1e-38",
    "1e-30",
    "1e-19",
    "1e-7",
    "-1e-7",
    "0.0001",
    "0.33333334",
    "0.99999994",
    "1.0000001",
    "100",
    "-100",
    "1e4",
    "1e6",
    "16777217",
    "-1e10",
    "1e18",
    "1.9e19",
    "-1e30",
    "3.4e38",
    "1e39",
    "nan",
];

/// Greatest side of a window, in pixels.
const MAX_SIDE: u32 = 24;
/// Greatest number of triangles in a scene.
const MAX_TRIANGLES: usize = 24;
/// Number of bytes before the triangles.
pub const HEADER: usize = 40;
/// Number of bytes of a triangle: its material, the attributes of its corners, and three corners.
pub const TRIANGLE: usize = 11;

/// Settings for the formats of render targets. Half floats and unsigned formats are left out where they cannot hold the
/// values that are written, because infinities and broken normals are expected there.
const FORMATS: [&str; 8] = [
    "",
    "color.format=RGBA8",
    "color.format=R8",
    "color.format=R32F",
    "pos.format=RGBA32F",
    "norm.format=RGBA16F",
    "offscreenrender.format=RGBA8",
    "offscreenrender.format=R8",
];
/// Settings for the parameters of `pass2`, if it traces rays.
const RAY_SETTINGS: [&str; 16] = [
    "samples=0",
    "samples=1",
    "samples=9",
    "samples=16",
    "radius=0.001",
    "radius=3",
    "radius=1e30",
    "intensity=0",
    "intensity=100",
    "index=0.1",
    "index=1.52",
    "index=10",
    "depth=0",
    "depth=16",
    "sampler=strata",
    "fresnel=schlick",
];
/// Settings for the parameters of `pass2`, if it is a raster effect.
const EFFECT_SETTINGS: [&str; 24] = [
    "cascades=1",
    "cascades=8",
    "pcf=0",
    "pcf=3",
    "bias=0",
    "bias=100",
    "probes=1",
    "probes=7",
    "index=0.1",
    "index=10",
    "radius=2",
    "radius=1e30",
    "intensity=0",
    "slices=1",
    "steps=1",
    "fresnel=schlick",
    "thickness=1e-30",
    "thickness=1e30",
    "missing=none",
    "missing=rays",
    "parallax=box",
    "bitmask=true",
    "filter=1",
    "filter=3",
];
/// Materials, selected by a byte of a triangle; the projects take `Vidro` for glass.
const MATERIALS: [&str; 4] = ["wall", "leaf", "Vidro", "lamp"];

/// The rest of an input; beyond its end all bytes are 0.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[usize::from(self.byte()) % choices.len()]
    }

    fn number(&mut self) -> &'static str {
        match self.byte() {
            byte if byte < COMMON => ORDINARY[usize::from(byte) % ORDINARY.len()],
            byte => EXTREME[usize::from(byte - COMMON) % EXTREME.len()],
        }
    }

    fn numbers<const N: usize>(&mut self) -> [&'static str; N] {
        std::array::from_fn(|_| self.number())
    }
}

/// A number without its sign.
fn positive(number: &'static str) -> &'static str {
    number.trim_start_matches('-')
}

/// The files and the settings of a run.
pub struct Run {
    project: String,
    scene: String,
    materials: String,
    settings: Settings,
}

impl Run {
    /// Decodes an input.
    pub fn of(input: &[u8]) -> Self {
        let mut bytes = Bytes(input);
        let index = usize::from(bytes.byte()) % PROJECTS.len();
        let size = [0; 2].map(|_: u32| 1 + u32::from(bytes.byte()) % MAX_SIDE);
        let seed = u32::from(bytes.byte());
        let scene_param = bytes.of(&["", "SWAP_YZ", "UNITIZE", "SWAP_YZ UNITIZE"]);
        let project = rewritten(PROJECTS[index], scene_param, &mut bytes);
        let set = assignments(index, &mut bytes);
        let materials = library(&mut bytes);
        bytes.0 = input.get(HEADER..).unwrap_or_default();
        let scene = triangles(&mut bytes);
        let settings = Settings { size: Some(size), seed, set, show: vec!["all".to_owned()], ..Settings::default() };
        Self { project, scene, materials, settings }
    }

    /// Names and contents of the run's files.
    pub fn files(&self) -> Vec<(&'static str, Vec<u8>)> {
        let texture = tga(&[[200, 10, 20, 255], [10, 200, 20, 0], [10, 20, 200, 90], [9, 9, 9, 255]]);
        let texts = [("project.xml", &self.project), ("scene.obj", &self.scene), ("scene.mtl", &self.materials)];
        let texts = texts.map(|(name, text)| (name, text.clone().into_bytes()));
        let libraries = LIBRARIES.map(|(name, text)| (name, text.as_bytes().to_vec()));
        texts.into_iter().chain(libraries).chain([("t.tga", texture)]).collect()
    }

    /// The settings of the run's plan.
    pub fn settings(&self) -> Settings {
        self.settings.clone()
    }
}

/// A project with the run's files, and with numbers from the input for its camera, its light and its viewport.
fn rewritten(project: &str, scene_param: &str, bytes: &mut Bytes<'_>) -> String {
    let vector = |element: &str, [x, y, z]: [&str; 3]| format!("<{element} x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
    let color = |element: &str, [r, g, b]: [&str; 3]| format!("<{element} r=\"{r}\" g=\"{g}\" b=\"{b}\"/>");
    // The first choice in each list is an ordinary number, so that short inputs render.
    let fov = bytes.of(&["60", "1", "30", "90", "170", "179.9"]);
    let near = bytes.of(&["0.3", "0.05", "1e-6", "1", "1e-30"]);
    let far = bytes.of(&["1000", "2", "30", "1e7", "1e30"]);
    let [x, y] = [0; 2].map(|_: u8| bytes.of(&["0", "0.25", "0.9", "3"]));
    let [width, height] = [0; 2].map(|_: u8| bytes.of(&["1", "0.25", "0.01", "3"]));
    let replaced = [
        ("<position", vector("position", bytes.numbers())),
        ("<view ", vector("view", bytes.numbers())),
        ("<up", vector("up", bytes.numbers())),
        ("<direction", vector("direction", bytes.numbers())),
        // Without signs, because a project with a negative light rightly renders negative colours.
        ("<color r", color("color", bytes.numbers().map(positive))),
        ("<bgcolor", color("bgcolor", bytes.numbers().map(positive))),
        ("<perspective", format!("<perspective fov=\"{fov}\" near=\"{near}\" far=\"{far}\"/>")),
        ("<geometry", format!("<geometry x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>")),
        ("<scene name=\"MainScene\">", format!("<scene name=\"MainScene\" param=\"{scene_param}\">")),
    ];
    let lines = project.lines().map(|line| {
        let found = replaced.iter().find(|(start, _)| line.trim_start().starts_with(start));
        found.map_or(line, |(_, by)| by)
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    text.replace("..\\", "").replace("mlibs\\", "").replace("3dsmodels\\largoCamoes.cbo", "scene.obj")
}

/// Assignments for `--set`: parameters of the second pass, and the format of a channel.
fn assignments(project: usize, bytes: &mut Bytes<'_>) -> Vec<String> {
    let parameters = if project < FIRST_EFFECT { &RAY_SETTINGS[..] } else { &EFFECT_SETTINGS[..] };
    let mut set = Vec::new();
    // A program does not read every parameter, and a refused assignment ends the run early. So most bytes set none.
    for _ in 0..3 {
        let byte = usize::from(bytes.byte());
        set.extend(parameters.get(byte).map(|assignment| format!("pass2.{assignment}")));
    }
    match project {
        // The report's 100 samples would dominate the running time.
        5 | 6 if !set.iter().any(|assignment| assignment.contains("samples")) => set.push("pass2.samples=4".to_owned()),
        7..=9 | 13..=14 => set.push("pass2.mapsize=16".to_owned()),
        _ => {}
    }
    set.extend([bytes.of(&FORMATS), bytes.of(&FORMATS)].map(str::to_owned));
    set.retain(|assignment| !assignment.is_empty());
    set
}

/// The materials: a plain one, one with holes, glass, and one that emits light.
fn library(bytes: &mut Bytes<'_>) -> String {
    let [kd, ke] = bytes.numbers().map(positive);
    let [ni, d, tf] = bytes.numbers();
    format!(
        "newmtl wall\nKd 0.8 {kd} 0.4\nnewmtl leaf\nKd 1 1 1\nmap_Kd t.tga\nmap_d t.tga\n\
         newmtl Vidro\nKd 1 1 1\nTf {tf} 1 1\nNi {ni}\nd {d}\nnewmtl lamp\nKd 0 0 0\nKe {ke} {ke} 0\n"
    )
}

/// A floor, and the input's triangles.
fn triangles(bytes: &mut Bytes<'_>) -> String {
    let mut text = "mtllib scene.mtl\nvt 0 0\nvt 1 0\nvt 0.3 9\nv -3 -1 -3\nv 3 -1 -3\nv 3 -1 3\nv -3 -1 3\nusemtl wall\nf 3 2 1\nf 4 3 1\n".to_owned();
    for _ in 0..(bytes.0.len() / TRIANGLE).min(MAX_TRIANGLES) {
        let (material, kind) = (bytes.of(&MATERIALS), bytes.byte());
        for _ in 0..3 {
            let [x, y, z] = bytes.numbers();
            writeln!(text, "v {x} {y} {z}").expect("a string takes all");
        }
        let face = match kind % 4 {
            0 => "f -3 -2 -1",
            1 => "f -3/1 -2/2 -1/3",
            // This triangle shares an edge with the previous one.
            2 => "f -4 -3 -1",
            _ => "vn 0 1 0\nvn 1 0 -1e-20\nf -3/1/-1 -2/2/-2 -1/3/-1",
        };
        writeln!(text, "usemtl {material}\n{face}").expect("a string takes all");
    }
    text
}

/// Small inputs that render, one for each project.
pub fn seeds() -> Vec<(String, Vec<u8>)> {
    (0..PROJECTS.len() as u8)
        .map(|project| {
            let mut bytes = vec![0; HEADER];
            // 12 x 9 pixels from (1, 2, 5), towards (0, -0.5, -2), with white light from above and no setting.
            bytes[..5].copy_from_slice(&[project, 11, 8, 3, 0]);
            bytes[12..30].copy_from_slice(&[1, 5, 10, 0, 4, 6, 0, 1, 0, 3, 6, 4, 1, 1, 1, 12, 0, 3]);
            bytes[30..33].fill(u8::MAX);
            if OCCLUSIONS.contains(&project) {
                bytes[30] = RADIUS;
            }
            // A wall at the back, a pane and a leaf in front of it, a lamp that shares a corner with the leaf, and a roof
            // that casts a shadow.
            bytes.extend([0, 0, 9, 2, 6, 8, 2, 6, 0, 10, 6]);
            bytes.extend([2, 3, 2, 2, 1, 1, 2, 1, 0, 5, 3]);
            bytes.extend([1, 1, 6, 2, 0, 0, 2, 0, 2, 1, 0]);
            bytes.extend([3, 2, 5, 0, 0, 5, 1, 1, 1, 2, 0]);
            bytes.extend([0, 0, 2, 3, 1, 1, 3, 1, 0, 3, 8]);
            (format!("project{project}"), bytes)
        })
        .collect()
}
