//! `curitiba check`: every problem of a project, its libraries and its scenes.

use super::{Failure, ask_engines, failure, print_outside, print_warnings, set_threads, tell_fastest};
use curitiba::OpenError;
use curitiba::args::ProjectArgs;
use curitiba::pipeline::files::record_files_read;
use curitiba::pipeline::plan::Plan;
use curitiba::pipeline::project::{SceneDecl, SourceError, declared_scenes};
use curitiba::pipeline::scene::{self, BuildOptions, LoadOptions, Needs, RenderScene, SceneError};

/// Reads everything that `render` would read, without rendering, and prints all problems.
pub fn run(args: &ProjectArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    tell_fastest(args.choice());
    record_files_read();
    let settings = args.settings();
    let max_bytes = settings.max_memory;
    let project = settings.open(&args.path).map_err(|error| {
        if matches!(error, SourceError::Project(_)) {
            // The project is in error; problems of the scene files that it declares are reported too.
            let mut found = Found::default();
            declared_scenes(&args.path).iter().for_each(|declared| found.look_at(declared, Needs::ALL, max_bytes));
            if let Some(failures) = found.failures() {
                failure::print_error(&failures);
            }
        }
        Failure::from(OpenError::from(error))
    })?;
    failure::print_problems(&project.problems);
    let mut plan = Plan::new(project, settings).map_err(|error| Failure::from(OpenError::from(error)))?;
    ask_engines(&mut plan, args.choice())?;
    print_warnings(&plan.warnings);
    for planned in &plan.passes {
        if let Some(lights) = plan.lights_in_words(planned) {
            crate::say!("pass `{}` has {lights}", plan.pass(planned).name);
        }
    }
    if let Some(cost) = plan.cost_of_samples() {
        crate::say!("{} samples a pixel: {cost}", plan.settings.aa);
    }
    let warnings = plan.project.problems.0.len() + plan.warnings.groups().len();
    let mut found = Found { warnings, ..Found::default() };
    plan.project.scenes.iter().for_each(|declared| found.look_at(declared, plan.needs, max_bytes));
    if let Some(failures) = found.failures() {
        return Err(Failure::Input(failures));
    }
    print_outside(&args.path, []);
    let (passes, warnings) = (plan.passes.len(), found.warnings);
    crate::say!("{}: ok, passes that run: {passes}, notes and warnings: {warnings}", args.path.display());
    Ok(())
}

/// Problems of scene files.
#[derive(Default)]
struct Found {
    warnings: usize,
    failures: Vec<String>,
}

impl Found {
    /// Reads each file of a scene separately, so that a broken one does not hide the others.
    fn look_at(&mut self, declared: &SceneDecl, needs: Needs, max_bytes: u64) {
        let options = LoadOptions { needs, max_bytes };
        for file in &declared.files {
            let loaded = scene::load(std::slice::from_ref(&file.path), &options, &|_| {});
            self.build(&file.path.display().to_string(), &file.place, loaded, &options);
        }
        if !declared.shapes.is_empty() {
            let alone = SceneDecl { files: Vec::new(), ..declared.clone() };
            let name = format!("primitives of scene `{}`", declared.name);
            self.build(&name, &declared.name, alone.load(&options, &|_| {}), &options);
        }
    }

    fn build(&mut self, name: &str, place: &str, loaded: Result<scene::Scene, SceneError>, options: &LoadOptions) {
        let built = loaded.and_then(|mut loaded| {
            let mut found = std::mem::take(&mut loaded.warnings);
            let LoadOptions { needs, max_bytes } = *options;
            let (built, more) =
                RenderScene::build(loaded, &BuildOptions { needs, max_bytes, ..BuildOptions::default() })?;
            found.append(more);
            Ok((built, found))
        });
        match built {
            Ok((built, found)) => {
                print_warnings(&found);
                self.warnings += found.groups().len();
                let (triangles, materials) = (built.geometry.triangles.len(), built.materials.len());
                let spheres = match built.geometry.spheres.len() {
                    0 => String::new(),
                    count => format!("{count} exact spheres, "),
                };
                crate::say!("{name}: {triangles} triangles, {spheres}{materials} materials");
            }
            Err(error) => self.failures.push(format!("{place}: {error}")),
        }
    }

    /// Description of all problems; `None` if there are none.
    fn failures(&self) -> Option<String> {
        let count = self.failures.len();
        let files = if count == 1 { "scene file is" } else { "scene files are" };
        (count > 0).then(|| format!("{}\n{count} {files} wrong", self.failures.join("\nerror: ")))
    }
}
