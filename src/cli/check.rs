//! `curitiba check`: every problem of a project, its libraries and its scenes.

use super::args::ProjectArgs;
use super::{Failure, ask_engines, failure, print_outside, print_warnings, set_threads};
use curitiba::OpenError;
use curitiba::pipeline::files::record_files_read;
use curitiba::pipeline::plan::Plan;
use curitiba::pipeline::scene::{self, BuildOptions, LoadOptions, RenderScene};

/// Reads everything that `render` would read, renders nothing, and prints what it finds.
pub fn run(args: &ProjectArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    record_files_read();
    let settings = args.settings();
    let project = settings.open(&args.path).map_err(OpenError::from)?;
    failure::print_problems(&project.problems);
    let mut plan = Plan::new(project, settings).map_err(|error| Failure::from(OpenError::from(error)))?;
    ask_engines(&mut plan, args.choice())?;
    print_warnings(&plan.warnings);
    let mut failures = Vec::new();
    let mut warnings = plan.project.problems.0.len() + plan.warnings.groups().len();
    let max_bytes = plan.settings.max_memory;
    for declared in &plan.project.scenes {
        for file in &declared.files {
            // Each by itself, so that one that is wrong does not hide the others.
            let options = LoadOptions { needs: plan.needs, max_bytes };
            let built = scene::load(std::slice::from_ref(&file.path), &options, &|_| {}).and_then(|mut loaded| {
                let mut found = std::mem::take(&mut loaded.warnings);
                let options = BuildOptions { needs: plan.needs, max_bytes, ..BuildOptions::default() };
                let (built, more) = RenderScene::build(loaded, &options)?;
                found.append(more);
                Ok((built, found))
            });
            match built {
                Ok((built, found)) => {
                    print_warnings(&found);
                    warnings += found.groups().len();
                    let (triangles, materials) = (built.geometry.triangles.len(), built.materials.len());
                    crate::say!("{}: {triangles} triangles, {materials} materials", file.path.display());
                }
                Err(error) => failures.push(format!("{}: {error}", file.place)),
            }
        }
    }
    if !failures.is_empty() {
        let count = failures.len();
        let files = if count == 1 { "scene file is" } else { "scene files are" };
        return Err(Failure::Input(format!("{}\n{count} {files} wrong", failures.join("\nerror: "))));
    }
    print_outside(&args.path, []);
    let passes = plan.passes.len();
    crate::say!("{}: ok, passes that run: {passes}, notes and warnings: {warnings}", args.path.display());
    Ok(())
}
