//! Protection against panics in crates that read files: a panic becomes an error of the loader that called the crate.
//!
//! [`call`] wraps only the calls into such a crate, so that a panic of this program's own code still ends the program with a
//! message. During the call the panic hook is silent for this thread: the message appears once, in the error.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::Once;

/// Greatest number of characters of a panic's message that an error repeats: such messages may quote the file.
const SHOWN: usize = 160;

thread_local! {
    /// Whether this thread is inside a guarded call.
    static THEIRS: Cell<bool> = const { Cell::new(false) };
}

/// Runs `theirs`, which calls into the crate `name` on this thread; other threads are not guarded.
///
/// Values that `theirs` borrows must not be used after an error: the panic may have left them in an invalid state.
///
/// # Errors
/// If the crate panicked: the crate's name and the message.
pub(crate) fn call<T>(name: &'static str, theirs: impl FnOnce() -> T) -> Result<T, String> {
    silence_hook();
    let before = THEIRS.replace(true);
    let result = catch_unwind(AssertUnwindSafe(|| {
        #[cfg(test)]
        plant::panic_if_planted(name);
        theirs()
    }));
    THEIRS.set(before);
    result.map_err(|panic| format!("the crate `{name}` failed on this file, which is its defect: {}", message(&*panic)))
}

/// Replaces the panic hook by a wrapper around it, once.
fn silence_hook() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_hook(quiet(take_hook())));
}

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Sync + Send>;

/// A hook that calls `hook`, except for threads inside [`call`].
fn quiet(hook: Hook) -> Hook {
    Box::new(move |info| {
        if !THEIRS.get() {
            hook(info);
        }
    })
}

/// The first line of a panic's message, shortened, without characters that a terminal would interpret.
fn message(payload: &(dyn std::any::Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or_default();
    let line = text.lines().next().unwrap_or_default();
    let mut shown: String = line.chars().take(SHOWN).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if line.chars().nth(SHOWN).is_some() {
        shown.push('…');
    }
    if shown.is_empty() { "a panic without a message".to_owned() } else { shown }
}

/// Panics planted by tests in calls of other crates.
#[cfg(test)]
pub(crate) mod plant {
    use std::cell::Cell;

    thread_local! {
        static PLANTED: Cell<Option<&'static str>> = const { Cell::new(None) };
    }

    /// Runs `body` while every guarded call into the crate `name` panics. `body` runs in a pool of one thread, so that this holds
    /// for parallel work too.
    pub(crate) fn in_crate<T: Send>(name: &'static str, body: impl FnOnce() -> T + Send) -> T {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        pool.install(|| {
            PLANTED.set(Some(name));
            body()
        })
    }

    pub(super) fn panic_if_planted(name: &str) {
        if PLANTED.get() == Some(name) {
            panic!("planted: {}", "é".repeat(2 * super::SHOWN));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Image, Layer, read_image, write_exr, write_png};
    use crate::scene::{
        BuildOptions, Group, LoadOptions, Material, Mesh, Object, RenderScene, Scene, TextureSource, load, write_cbo,
    };
    use std::path::{Path, PathBuf};

    fn file(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    }

    /// Checks that an error names file and crate and repeats only the start of the message.
    fn names(error: &str, file: &str, krate: &str) {
        assert!(error.contains(file) && error.contains(&format!("`{krate}`")), "{error}");
        assert!(error.contains("planted: éé") && error.chars().count() < 3 * SHOWN, "{error}");
    }

    #[test]
    fn a_panic_of_a_crate_is_an_error_of_every_loader() {
        let folder = tempfile::tempdir().expect("a folder");
        let scene = |name: &str, text: &str, krate: &'static str| {
            let path = file(folder.path(), name, text.as_bytes());
            let read = || load(std::slice::from_ref(&path), &LoadOptions::default(), &|_| {});
            read().expect("it loads without the panic");
            let error = plant::in_crate(krate, read).expect_err("refused").to_string();
            names(&error, name, krate);
            read().expect("it loads again");
        };
        #[cfg(feature = "gltf")]
        scene("a.gltf", r#"{"asset":{"version":"2.0"}}"#, "gltf");

        let project = file(folder.path(), "a.xml", include_bytes!("../tests/fuzz_targets/everything.xml"));
        file(folder.path(), "everything.mlib", include_bytes!("../tests/fuzz_targets/everything.mlib"));
        crate::project::load(&project).expect("it loads without the panic");
        let problems = plant::in_crate("quick-xml", || crate::project::load(&project)).expect_err("refused");
        names(&problems.to_string(), "a.xml:1:1", "quick-xml");

        let grey = Image::filled(3, 2, [0.5; 4]);
        let (png, exr) = (folder.path().join("a.png"), folder.path().join("a.exr"));
        write_png(&png, &grey).expect("written");
        write_exr(&exr, Layer { name: "window", channels: ["R", "G", "B", "A"], image: &grey }).expect("written");
        for (path, name, krate) in [(&png, "a.png", "image"), (&exr, "a.exr", "exr")] {
            read_image(path).expect("it is read without the panic");
            names(&plant::in_crate(krate, || read_image(path)).expect_err("refused").to_string(), name, krate);
        }
    }

    #[test]
    fn a_panic_in_a_texture_s_decoder_costs_that_texture() {
        let folder = tempfile::tempdir().expect("a folder");
        let png = folder.path().join("t.png");
        write_png(&png, &Image::filled(3, 2, [0.5; 4])).expect("written");
        let mesh = Mesh {
            positions: vec![glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y],
            texcoords: vec![glam::Vec2::ZERO; 3],
            groups: vec![Group { material: 0, triangles: vec![[0, 1, 2]] }],
            ..Mesh::default()
        };
        let scene = Scene {
            meshes: vec![mesh],
            objects: vec![Object { name: "a".to_owned(), mesh: 0, transform: glam::Mat4::IDENTITY }],
            materials: vec![Material { texture: Some(0), ..Material::default() }],
            textures: vec![TextureSource::Masked { color: png.clone(), mask: png }],
            ..Scene::default()
        };
        let build = || RenderScene::build(scene.clone(), &BuildOptions::default()).expect("it is built");
        assert_eq!(build().0.textures.len(), 1);
        let (built, warnings) = plant::in_crate("image", build);
        assert!(built.textures.is_empty() && built.geometry.triangles.len() == 1);
        names(&warnings.groups().iter().map(ToString::to_string).collect::<String>(), "t.png", "image");
        let written = folder.path().join("a.cbo");
        let error = plant::in_crate("image", || write_cbo(&scene, &written, crate::scene::Layout::Cbo2014));
        names(&error.expect_err("refused").to_string(), "t.png", "image");

        let mut bumpy = scene.clone();
        bumpy.materials[0].normal_texture = Some(0);
        bumpy.meshes[0].texcoords = vec![glam::Vec2::ZERO, glam::Vec2::X, glam::Vec2::Y];
        let build = || RenderScene::build(bumpy.clone(), &BuildOptions::default());
        assert_eq!(build().expect("it is built").0.geometry.tangents.len(), 3);
        let error = plant::in_crate("bevy_mikktspace", build).expect_err("refused").to_string();
        names(&error, "scene", "bevy_mikktspace");
    }

    #[test]
    fn the_hook_is_silent_for_the_crate_and_for_nothing_else() {
        thread_local! {
            static CALLS: Cell<Option<usize>> = const { Cell::new(None) };
        }
        // The hook is global to the process: panics of other tests are passed on to the previous hook.
        let before = take_hook();
        set_hook(quiet(Box::new(move |info| match CALLS.get() {
            Some(calls) => CALLS.set(Some(calls + 1)),
            None => before(info),
        })));
        let calls_in = |body: &dyn Fn()| {
            CALLS.set(Some(0));
            let result = catch_unwind(AssertUnwindSafe(body));
            (result, CALLS.take())
        };
        let (result, calls) = calls_in(&|| {
            let error = call("x", || panic!("theirs")).map(|never: std::convert::Infallible| match never {});
            assert!(error.expect_err("it panics").contains("theirs"));
        });
        assert!(result.is_ok() && calls == Some(0), "{calls:?}");
        let (result, calls) = calls_in(&|| panic!("ours"));
        assert!(result.is_err() && calls == Some(1), "{calls:?}");
        assert!(!THEIRS.get(), "the state is as before");
    }

    #[test]
    fn what_a_panic_says_is_shown_in_one_short_line() {
        let text = |payload: &(dyn std::any::Any + Send)| message(payload);
        assert_eq!(text(&"a\u{1b}[31mb\nc"), "a\u{fffd}[31mb");
        assert_eq!(text(&String::new()), "a panic without a message");
        assert_eq!(text(&7_u8), "a panic without a message");
        assert_eq!(text(&"é".repeat(SHOWN + 1)).chars().count(), SHOWN + 1);
    }
}
