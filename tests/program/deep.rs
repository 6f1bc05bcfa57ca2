//! Deep and degenerate inputs on small stacks: nested elements, chains of nodes, and triangles that no split separates.
//! Code that follows such inputs must do so without recursion, or stop at a limit.

use curitiba::passes::trace::{Bvh, Double, Quality};
use curitiba::pipeline::project;
use curitiba::pipeline::scene::{Batch, BuildOptions, Geometry, LoadOptions, RenderScene, load};
use glam::Vec3;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Stack size of each thread in bytes: an eighth of Rust's default.
const STACK: usize = 256 << 10;

/// Runs `work` on a pool of threads with small stacks.
fn on_small_stacks<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build().expect("threads");
    pool.install(work)
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    path
}

/// The geometry of a scene file, loaded and prepared.
fn triangles(path: PathBuf, threads: usize) -> Result<Geometry, String> {
    on_small_stacks(threads, || {
        let scene = load(&[path], &LoadOptions::default(), &|_| {}).map_err(|error| error.to_string())?;
        let built = RenderScene::build(scene, &BuildOptions::default()).map_err(|error| error.to_string())?;
        Ok(built.0.geometry)
    })
}

#[test]
fn elements_in_elements_stop_at_a_message() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = "<a>".repeat(300_000);
    let close = "</a>".repeat(300_000);
    for (name, text) in [
        ("open.xml", format!("<project name=\"p\">{open}")),
        ("closed.xml", format!("<project name=\"p\">{open}{close}</project>")),
    ] {
        let path = write(folder.path(), name, &text);
        let problems = on_small_stacks(1, || project::load(&path).map(|_| ())).expect_err("it is too deep");
        assert!(problems.to_string().contains("nested deeper than"), "{problems}");
    }
}

#[test]
fn a_chain_of_nodes_is_as_long_as_the_file_says() {
    const NODES: usize = 200_000;
    let folder = tempfile::tempdir().expect("a folder");
    let chain = |last: &str, extras: &str| {
        let mut nodes = String::new();
        for node in 0..NODES - 1 {
            let _ = write!(nodes, "{{\"children\":[{}]}},", node + 1);
        }
        // One triangle: three positions of three floats, in base64.
        let bytes = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
        format!(
            "{{\"asset\":{{\"version\":\"2.0\"{extras}}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{nodes}{last}],\
             \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],\
             \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[1,1,0]}}],\
             \"bufferViews\":[{{\"buffer\":0,\"byteLength\":36}}],\
             \"buffers\":[{{\"byteLength\":36,\"uri\":\"data:application/octet-stream;base64,{bytes}\"}}]}}"
        )
    };
    let whole = write(folder.path(), "chain.gltf", &chain("{\"mesh\":0}", ""));
    assert_eq!(triangles(whole, 2).expect("a scene").triangles.len(), 1);
    let ring = write(folder.path(), "ring.gltf", &chain("{\"children\":[0]}", ""));
    assert!(triangles(ring, 2).is_err(), "a ring of nodes has no end");
    let extras = format!(",\"extras\":{}0{}", "[".repeat(100_000), "]".repeat(100_000));
    let nested = write(folder.path(), "nested.gltf", &chain("{\"mesh\":0}", &extras));
    assert_eq!(triangles(nested, 2).expect("what nobody reads is skipped").triangles.len(), 1);
}

/// `count` triangles with the corners that `corners` returns.
fn geometry(count: u32, corners: impl Fn(u32) -> [Vec3; 3]) -> Geometry {
    Geometry {
        positions: (0..count).flat_map(&corners).collect(),
        triangles: (0..count).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect(),
        batches: vec![Batch { material: 0, first: 0, count }],
        ..Geometry::default()
    }
}

fn builds_on_small_stacks(geometry: &Geometry) {
    let built = |threads| on_small_stacks(threads, || Bvh::build(geometry, &[], Quality::default()).node_count());
    let alone = built(1);
    assert!(alone > 0);
    for threads in [16, 64] {
        assert_eq!(built(threads), alone, "{threads} threads");
    }
    assert!(on_small_stacks(2, || Double::build(geometry, &[]).node_count()) > 0);
}

#[test]
fn triangles_on_one_spot_make_a_tree() {
    builds_on_small_stacks(&geometry(300_000, |_| [Vec3::ZERO, Vec3::X, Vec3::Y]));
}

#[test]
fn triangles_whose_distances_double_make_a_tree() {
    // Sizes from 2⁻⁶⁰ to 2⁶⁰: each halving of space leaves all but a few triangles on one side.
    builds_on_small_stacks(&geometry(200_000, |index| {
        let x = 2.0_f32.powf(index as f32 * (120.0 / 200_000.0) - 60.0);
        [Vec3::new(x, 0.0, 0.0), Vec3::new(1.5 * x, 0.0, 0.0), Vec3::new(x, 0.5 * x, 0.0)]
    }));
}

#[test]
fn a_million_equal_centroids_make_a_tree() {
    builds_on_small_stacks(&geometry(1_000_000, |index| {
        let (size, turn) = (1.0 + index as f32 * 1e-3, index as f32 * 1e-3);
        [0.0_f32, 1.0, 2.0].map(|third| {
            let angle = turn + third * std::f32::consts::TAU / 3.0;
            Vec3::new(angle.cos() * size, angle.sin() * size, 0.0)
        })
    }));
}
