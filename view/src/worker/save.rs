//! Saving the picture with a record that reproduces it.

use curitiba::args::quoted;
use curitiba::environment::Environment;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::gbuffer::Rect;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::programs::Fidelity;
use curitiba::{Choice, Gpus, RasterChoice};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Everything that a picture depends on.
#[derive(Serialize)]
struct Record<'a> {
    /// A command that renders the same picture, if the project has the camera's pose.
    command: String,
    project: &'a Path,
    size: [u32; 2],
    camera: &'a str,
    /// The camera as an element of a project. If the camera was moved, the project needs this element to give the same picture.
    camera_xml: String,
    camera_was_moved: bool,
    parameters: &'a [String],
    off: &'a [String],
    seed: u32,
    /// Number of accumulated samples; `None` if the picture has the project's own samples.
    accumulated: Option<u64>,
    raster: &'static str,
    rays: &'static str,
    environment: Environment,
}

/// The part of the record that the session knows and the renderer does not.
pub(super) struct Taken {
    pub camera: String,
    pub moved: bool,
    pub accumulated: Option<u64>,
    /// Name of the device of `wgpu`, if one was chosen.
    pub adapter: Option<&'static str>,
    pub gpus: Gpus,
}

impl Taken {
    /// The device and the number of GPUs are those of `choice`. The device is named, since it may have another place on another machine.
    pub fn new(camera: String, moved: bool, accumulated: Option<u64>, choice: Choice) -> Self {
        // A single pass may run on `wgpu` although neither the rasteriser nor the ray backend does.
        let adapter = Choice { raster: RasterChoice::Wgpu, ..choice }.adapter_name();
        Self { camera, moved, accumulated, adapter, gpus: choice.gpus }
    }
}

/// Writes `NAME.png`, `NAME.exr` and `NAME.json`. Returns the written files.
pub(super) fn save(renderer: &mut Renderer, path: &Path, taken: &Taken) -> Result<Vec<PathBuf>, String> {
    let (png, exr, json) = (path.with_extension("png"), path.with_extension("exr"), path.with_extension("json"));
    for picture in [&png, &exr] {
        renderer.save(picture, &mut Silent).map_err(|error| error.to_string())?;
    }
    let settings = renderer.settings().clone();
    let engines = renderer.engines();
    let record = Record {
        command: command(
            &renderer.project().source,
            &settings,
            renderer.plan().window,
            taken,
            engines.raster.name(),
            engines.rays.name(),
        ),
        project: &renderer.project().source,
        size: renderer.plan().window,
        camera: &taken.camera,
        camera_xml: renderer.project().camera_xml(&taken.camera).unwrap_or_else(|why| why),
        camera_was_moved: taken.moved,
        parameters: &settings.set,
        off: &settings.off,
        seed: settings.seed,
        accumulated: taken.accumulated,
        raster: engines.raster.name(),
        rays: engines.rays.name(),
        environment: Environment::here().with_engines(engines),
    };
    let text = serde_json::to_string_pretty(&record).map_err(|error| error.to_string())?;
    curitiba::pipeline::files::write_atomically(&json, text.as_bytes())
        .map_err(|error| format!("{}: {error}", json.display()))?;
    Ok(vec![png, exr, json])
}

fn command(
    source: &Path,
    settings: &Settings,
    [width, height]: [u32; 2],
    taken: &Taken,
    raster: &str,
    rays: &str,
) -> String {
    let mut words = vec!["curitiba".to_owned(), "render".to_owned(), quoted(&source.display().to_string())];
    words.extend(settings.scene.more.iter().map(|path| quoted(&path.display().to_string())));
    let mut option = |name: &str, value: &str| words.extend([format!("--{name}"), quoted(value)]);
    for (name, value) in settings.scene.given() {
        option(name, &value);
    }
    option("size", &format!("{width}x{height}"));
    if let Some(Rect { x, y, width, height }) = settings.crop {
        option("crop", &format!("{x},{y},{width}x{height}"));
    }
    option("raster", raster);
    option("backend", rays);
    taken.adapter.iter().for_each(|name| option("adapter", name));
    if taken.gpus != Gpus::default() {
        option("gpus", &taken.gpus.to_string());
    }
    for (name, value) in [("camera", &settings.camera), ("pipeline", &settings.pipeline)] {
        value.iter().for_each(|value| option(name, value));
    }
    if settings.fidelity == Fidelity::Thesis {
        option("fidelity", "thesis");
    }
    settings.color.iter().for_each(|space| option("color", space.name()));
    if settings.exposure != 0.0 {
        option("exposure", &settings.exposure.to_string());
    }
    if settings.tone != curitiba::pipeline::color::Tone::None {
        option("tone", settings.tone.name());
    }
    if settings.seed != 0 {
        option("seed", &settings.seed.to_string());
    }
    if settings.aa.are_several() {
        option("aa", &settings.aa.to_string());
    }
    settings.set.iter().for_each(|set| option("set", set));
    settings.off.iter().for_each(|off| option("off", off));
    if let Some(samples) = taken.accumulated {
        option("accumulate", &samples.to_string());
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba::pipeline::project::SceneOptions;
    use glam::DVec3;

    #[test]
    fn the_command_names_what_differs_from_the_project() {
        let settings =
            Settings { set: vec!["pass2.samples=4".to_owned()], off: vec!["a b".to_owned()], ..Settings::default() };
        let taken = Taken::new("c".to_owned(), false, Some(256), Choice::CPU);
        let text = command(Path::new("it's.xml"), &settings, [8, 4], &taken, "cpu", "wgpu");
        assert_eq!(
            text,
            "curitiba render 'it'\\''s.xml' --size 8x4 --raster cpu --backend wgpu --set pass2.samples=4 --off 'a b' --accumulate 256"
        );
        let scene = SceneOptions {
            more: vec!["sun=b.obj".into()],
            look_from: Some(DVec3::new(-1.5, 2.0, 0.25)),
            fov: Some(30.0),
            ..SceneOptions::default()
        };
        let crop = Some(Rect { x: 1, y: 2, width: 3, height: 4 });
        let settings = Settings { scene, crop, ..Settings::default() };
        let taken = Taken::new("c".to_owned(), false, None, Choice::CPU);
        assert_eq!(
            command(Path::new("a.obj"), &settings, [8, 4], &taken, "cpu", "cpu"),
            "curitiba render a.obj sun=b.obj --look-from -1.5/2/0.25 --fov 30 --size 8x4 --crop 1,2,3x4 --raster cpu --backend cpu"
        );
    }

    #[test]
    fn the_command_names_the_devices_and_the_samples_of_pixels() {
        let choice = Choice { gpus: Gpus::Count(2), ..Choice::CPU };
        let taken = Taken { adapter: Some("NVIDIA H200"), ..Taken::new("c".to_owned(), false, None, choice) };
        let settings = Settings { aa: "16:0.02".parse().expect("samples"), ..Settings::default() };
        assert_eq!(
            command(Path::new("a.xml"), &settings, [8, 4], &taken, "wgpu", "cuda"),
            "curitiba render a.xml --size 8x4 --raster wgpu --backend cuda --adapter 'NVIDIA H200' --gpus 2 --aa 16:0.02"
        );
    }
}
