//! The parallel reader must produce the same scene as the sequential one, bit for bit, wherever the file is cut.

use super::super::context::Context;
use super::super::error::Budget;
use super::super::{Needs, Scene, SceneError};
use super::lines::{Lines, pieces};
use super::{MAX_RUN, read_in_pieces, serial};
use crate::diagnostic::WarningGroup;
use glam::Vec4;
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn with_context<T>(file: &Path, needs: Needs, limit: u64, read: impl FnOnce(&mut Context<'_>) -> T) -> T {
    let mut budget = Budget::new(limit);
    read(&mut Context { file, needs, budget: &mut budget })
}

/// A text of all contents of a scene, with numbers as bits.
fn contents(scene: &Scene) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    for mesh in &scene.meshes {
        let _ = writeln!(text, "mesh {:?}", mesh.name);
        let lists = [bytemuck::cast_slice(&mesh.positions), bytemuck::cast_slice(&mesh.normals)];
        let _ = writeln!(text, "{:?} {:?}", lists.map(bits), bits(bytemuck::cast_slice(&mesh.texcoords)));
        let _ = writeln!(text, "{:?}\n{:?}", bits(bytemuck::cast_slice(&mesh.colors)), mesh.groups);
    }
    let _ = writeln!(text, "{:?}\n{:?}\n{:?}", scene.objects, scene.materials, scene.textures);
    for warnings in scene.warnings.groups().iter().map(WarningGroup::to_string) {
        let _ = writeln!(text, "{warnings}");
    }
    text
}

/// Runs both readers on one file and compares their scenes.
fn check(file: &Path, bytes: &[u8], needs: Needs, piece: usize, max_run: usize) -> Result<String, String> {
    let whole = with_context(file, needs, u64::MAX, |context| serial::read(bytes, max_run, context));
    let cut = with_context(file, needs, u64::MAX, |context| read_in_pieces(bytes, piece, max_run, context));
    let (whole, cut) = (whole.map(|scene| contents(&scene)), cut.map(|scene| contents(&scene)));
    match (whole, cut) {
        (Ok(whole), Ok(cut)) if whole == cut => Ok(whole),
        (whole, cut) => Err(format!("pieces of {piece}, runs of {max_run}:\n{whole:?}\n{cut:?}")),
    }
}

fn needs(textures: bool, normals: bool) -> Needs {
    Needs { textures, normals, colors: textures, normal_maps: textures, glass_maps: textures, tangents: false }
}

/// Statements as exporters write them, and broken ones.
fn statement() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        8 => (-4_i32..5).prop_map(|value| value.to_string()),
        4 => (-2.0_f32..2.0).prop_map(|value| format!("{value:.2}")),
        1 => prop::sample::select(vec!["nan", "inf", "1e99", "-0", "x", "1e-45", "+.5"]).prop_map(str::to_owned),
    ];
    let numbers = |least: usize, most: usize| {
        prop::collection::vec(number.clone(), least..=most).prop_map(|words| words.join(" "))
    };
    let index = prop_oneof![6 => 1_i32..9, 3 => -6_i32..0, 1 => prop::sample::select(vec![0, 99, -99])];
    let corner =
        (index.clone(), prop::option::of(index.clone()), prop::option::of(index)).prop_map(|parts| match parts {
            (v, None, None) => format!("{v}"),
            (v, Some(t), None) => format!("{v}/{t}"),
            (v, None, Some(n)) => format!("{v}//{n}"),
            (v, Some(t), Some(n)) => format!("{v}/{t}/{n}"),
        });
    let plain = (1_i32..9).prop_map(|v| v.to_string());
    let name = prop::sample::select(vec!["", "a", "b c", "Água", "d"]);
    prop_oneof![
        8 => numbers(3, 3).prop_map(|words| format!("v {words}")),
        1 => numbers(0, 7).prop_map(|words| format!("v {words}")),
        2 => numbers(0, 4).prop_map(|words| format!("vt {words}")),
        2 => numbers(2, 4).prop_map(|words| format!("vn {words}")),
        8 => prop::collection::vec(plain, 3..7).prop_map(|corners| format!("f {}", corners.join(" "))),
        4 => prop::collection::vec(corner, 2..6).prop_map(|corners| format!("f {}", corners.join("  "))),
        1 => (prop::sample::select(vec!["o", "g"]), name.clone()).prop_map(|(word, name)| format!("{word} {name}")),
        1 => name.prop_map(|name| format!("usemtl {name}")),
        1 => prop::sample::select(vec!["f 1/2/3/4 2 3", "f 1 2", "f a b c", "s 1", "l 1 2", "curv 0 1", "what?", "# v 1 2 3",
            "mtllib none.mtl", "", "f 1 2 3 # f 2 3 4", "fo 1 2 3", "f 1 2 3 \\", "v 1 \\", "\u{feff}v 1 2 3", "# \\"])
            .prop_map(str::to_owned),
    ]
}

fn text() -> impl Strategy<Value = String> {
    // Enough vertices that most faces are in range.
    let vertices =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 0\nv .5 2 1\nvt 0 0\nvt 1 1\nvt 1 0\nvn 0 0 1\nvn 0 1 0\n";
    let end = prop::sample::select(vec!["\n", "\r\n", " \t\n", "\n\n", " \\\n", "\\\r\n "]);
    let line = (statement(), prop_oneof![12 => Just("\n"), 3 => end]);
    let head = prop::bool::weighted(0.9);
    (head, prop::collection::vec(line, 0..60), any::<bool>()).prop_map(move |(head, lines, cut)| {
        let mut text = if head { vertices.to_owned() } else { "\u{feff}".to_owned() };
        lines.iter().for_each(|(line, end)| {
            text.push_str(line);
            text.push_str(end);
        });
        if cut { text.trim_end().to_owned() } else { text }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_files_in_random_pieces_are_read_as_before(
        text in text(), piece in 1_usize..200, max_run in 1_usize..12, textures: bool, normals: bool,
    ) {
        check(Path::new("random.obj"), text.as_bytes(), needs(textures, normals), piece, max_run)
            .map_err(TestCaseError::fail)?;
    }

    #[test]
    fn pieces_hold_the_same_lines_as_the_whole(text in text(), piece in 1_usize..80) {
        let all = |lines: Lines<'_>| {
            let mut lines = lines;
            std::iter::from_fn(move || lines.next().map(|(number, line)| (number, line.into_owned()))).collect::<Vec<_>>()
        };
        let whole = all(Lines::new(text.as_bytes()));
        let cut: Vec<_> = pieces(text.as_bytes(), piece).into_iter().flat_map(all).collect();
        prop_assert_eq!(whole, cut);
    }
}

#[test]
fn colours_behind_positions_are_read_and_keep_vertices_apart() {
    // Vertex 4 has the position of vertex 1 and another colour; the third line has no colour.
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 .5 0\nv 0 1 0\nv 0 0 0 0 0 1\nusemtl a\nf 1 2 3\nusemtl b\nf 4 3 2\nv 0 0 0 1\nv 0 0 0 1 2 3 4\n";
    for piece in 1..text.len() + 1 {
        check(Path::new("a.obj"), text.as_bytes(), Needs::ALL, piece, MAX_RUN).unwrap();
    }
    let read = |needs| {
        with_context(Path::new("a.obj"), needs, u64::MAX, |context| {
            super::read(text.as_bytes(), context).expect("it loads")
        })
    };
    let color = |r: f32, g: f32, b: f32| Vec4::new(r, g, b, 1.0);
    let expected = [color(1.0, 0.0, 0.0), color(0.0, 0.5, 0.0), Vec4::ONE, color(0.0, 0.0, 1.0)];
    assert_eq!(read(Needs::ALL).meshes[0].colors, expected);
    assert!(read(Needs { colors: false, ..Needs::ALL }).meshes[0].colors.is_empty());
    assert_eq!(read(Needs::NOTHING).meshes[0].positions.len(), 3, "without colours the corners are one");
}

#[test]
fn vertices_with_equal_contents_are_shared_between_runs_and_not_within_one() {
    // The file lists the first vertex twice: run 0 keeps both, run 1 uses the first of them.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nusemtl a\nf 1 2 3\nf 4 3 2\nusemtl b\nv 0 0 0\nv 5 5 5\nf 5 3 6\nf 4 6 2\n";
    for piece in 1..text.len() + 1 {
        check(Path::new("a.obj"), text.as_bytes(), Needs::ALL, piece, MAX_RUN).unwrap();
    }
    let scene = with_context(Path::new("a.obj"), Needs::ALL, u64::MAX, |context| {
        read_in_pieces(text.as_bytes(), 9, MAX_RUN, context).unwrap()
    });
    let [mesh] = &scene.meshes[..] else { panic!("{} meshes", scene.meshes.len()) };
    assert_eq!(mesh.positions.len(), 5);
    assert_eq!(
        mesh.groups.iter().map(|group| group.triangles.clone()).collect::<Vec<_>>(),
        [vec![[0, 1, 2], [3, 2, 1]], vec![[0, 2, 4], [0, 4, 1]]]
    );
}

#[test]
fn a_generated_file_of_long_runs_is_read_as_before() {
    use std::fmt::Write as _;
    // Quads and triangles in turn, with positions out of order, in three materials, over many pieces.
    let mut text = String::from("o ground\n");
    let side = 60;
    for step in 0..side * side {
        let step = step * 7 % (side * side);
        let _ = writeln!(text, "v {} {} {}\nvt {} 0.5", step % side, (step * step) % 11, step / side, step % 3);
    }
    for row in 0..side - 1 {
        let _ = writeln!(text, "usemtl m{}", row / 7 % 3);
        for column in 0..side - 1 {
            let [a, b] = [row * side + column + 1, (row + 1) * side + column + 1];
            if (row + column) % 2 == 0 {
                let _ = writeln!(text, "f {a}/{a} {b}/{b} {}/{} {}/{}\r", b + 1, b + 1, a + 1, a + 1);
            } else {
                let _ = writeln!(text, "f {a} {b} {}", a + 1);
            }
        }
    }
    for (piece, max_run) in [(usize::MAX, MAX_RUN), (4000, MAX_RUN), (333, 100), (70_000, 999), (1, 7)] {
        check(Path::new("ground.obj"), text.as_bytes(), Needs::ALL, piece, max_run).unwrap();
    }
}

#[test]
fn the_memory_cap_holds_in_every_stage_and_says_what_to_do() {
    use std::fmt::Write as _;
    let mut text = String::new();
    for step in 0..20_000 {
        let _ = write!(text, "v {step} 0 0\nv {step} 1 0\nv {step} 0 1\nusemtl m{}\nf -3 -2 -1\n", step % 2);
    }
    let read = |limit: u64| {
        let read = |context: &mut Context<'_>| read_in_pieces(text.as_bytes(), 50_000, 4000, context);
        with_context(Path::new("a.obj"), Needs::ALL, limit, read)
    };
    let needed = 60_000 * 24 + 20_000 * (60 + 512);
    let refused: Vec<SceneError> =
        [1000, 800_000, 2_000_000, needed - 1, needed + 1000].map(|limit| read(limit).unwrap_err()).into();
    for error in &refused {
        assert!(error.to_string().contains("--max-memory"), "{error}");
    }
    assert!(refused[4].what.contains("joining"), "{}", refused[4]);
    assert!(read(2 * needed).is_ok());
}

/// The OBJ files in the folder `shared/scenes` next to the repository, if it exists, and in the folder that `CURITIBA_SCENES` names.
fn files_at_hand() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    let mut folders = vec![root];
    folders.extend(std::env::var_os("CURITIBA_SCENES").map(PathBuf::from));
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj")) {
                files.push(path);
            }
        }
    }
    files
}

#[test]
fn real_files_are_read_as_before() {
    let files = files_at_hand();
    if files.is_empty() {
        println!("skipped: there are no OBJ files in ../shared/scenes or in CURITIBA_SCENES");
    }
    for file in files {
        let bytes = std::fs::read(&file).unwrap();
        for (piece, max_run, needs) in
            [(100_000, MAX_RUN, Needs::ALL), (7777, 5000, needs(false, true)), (1 << 22, MAX_RUN, needs(false, false))]
        {
            if let Err(difference) = check(&file, &bytes, needs, piece, max_run) {
                panic!("{}: {}", file.display(), &difference[..difference.len().min(400)]);
            }
        }
    }
}
