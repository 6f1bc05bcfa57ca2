//! `curitiba check`: every problem of a project, its libraries and its scenes.

use super::args::ProjectArgs;
use super::{Failure, failure, print_warnings};
use curitiba::OpenError;
use curitiba::pipeline::plan::Plan;
use curitiba::pipeline::project;
use curitiba::pipeline::scene::{self, BuildOptions, LoadOptions, RenderScene};

/// Reads everything that `render` would read, renders nothing, and prints what it finds.
pub fn run(args: &ProjectArgs) -> Result<(), Failure> {
    let project = project::load(&args.path)?;
    failure::print_problems(&project.problems);
    let plan = Plan::new(project, args.settings()).map_err(|error| Failure::from(OpenError::from(error)))?;
    let mut failures = Vec::new();
    let mut warnings = plan.project.problems.0.len();
    let max_bytes = plan.settings.max_memory;
    for declared in &plan.project.scenes {
        let files: Vec<_> = declared.files.iter().map(|file| file.path.clone()).collect();
        let built =
            scene::load(&files, &LoadOptions { needs: plan.needs, max_bytes }, &|_| {}).and_then(|mut loaded| {
                let mut found = std::mem::take(&mut loaded.warnings);
                let options = BuildOptions {
                    needs: plan.needs,
                    model_space_normals: false,
                    swap_yz: declared.swap_yz,
                    unitize: declared.unitize,
                    max_bytes,
                };
                let (built, more) = RenderScene::build(loaded, &options)?;
                found.append(more);
                Ok((built, found))
            });
        match built {
            Ok((built, found)) => {
                print_warnings(&found);
                warnings += found.groups().len();
                let triangles = built.geometry.triangles.len();
                anstream::println!(
                    "scene `{}`: {triangles} triangles, {} materials",
                    declared.name,
                    built.materials.len()
                );
            }
            Err(error) => failures.push(format!("{}: {error}", declared.files.first().map_or("", |file| &file.place))),
        }
    }
    if !failures.is_empty() {
        return Err(Failure::Input(failures.join("\nerror: ")));
    }
    let passes = plan.passes.len();
    anstream::println!("{}: ok, {passes} passes run, {warnings} notes and warnings", args.path.display());
    Ok(())
}
