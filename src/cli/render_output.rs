//! Names of output files, and the header printed before rendering.

use super::Failure;
use curitiba::bench::case::fidelity_name;
use curitiba::environment::Environment;
use curitiba::pipeline::executor::Renderer;
use std::path::{Path, PathBuf};

/// Default output: the name of the project, scene file or folder, in the current folder.
pub(super) fn default_output(path: &Path) -> PathBuf {
    // A folder may be `.`, and the part after the last dot of its name is no extension.
    let whole = std::fs::canonicalize(path).ok().filter(|whole| whole.is_dir());
    let name = whole.as_deref().map_or(path.file_stem(), Path::file_name);
    let mut name = name.unwrap_or_else(|| "picture".as_ref()).to_owned();
    name.push(".png");
    PathBuf::from(name)
}

/// Fails if a file name has no extension of a supported picture format.
pub(super) fn check_extension(output: &Path) -> Result<(), Failure> {
    let extension = output.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    if !matches!(extension.as_str(), "png" | "exr") {
        return Err(Failure::Usage(format!("{}: a picture is written as .png or .exr", output.display())));
    }
    Ok(())
}

/// Prints what is rendered, and on which engines.
pub(super) fn print_header(renderer: &Renderer) {
    let plan = renderer.plan();
    let environment = Environment::here();
    let engines = renderer.engines();
    let [width, height] = plan.window;
    crate::say!(
        "{}: pipeline `{}`, {width} x {height}, {}, seed {}",
        plan.project.path.display(),
        plan.project.pipelines[plan.pipeline].name,
        fidelity_name(plan.settings.fidelity),
        plan.settings.seed
    );
    for decision in plan.decisions.iter().filter(|decision| decision.what.starts_with("parts of")) {
        crate::say!("{}: {}", decision.what, decision.why);
    }
    if let Some(cost) = plan.cost_of_samples() {
        crate::say!("{} samples a pixel: {cost}", plan.settings.aa);
    }
    crate::say!("raster {}: {}", engines.raster.name(), engines.raster.device());
    crate::say!("rays   {}: {}", engines.rays.name(), engines.rays.device());
    crate::say!("{}, {} threads, {} build", environment.cpu, environment.threads, environment.profile);
}
