//! `curitiba plan`: what would be done, and why.

use super::args::ProjectArgs;
use super::{Failure, failure, print_warnings};
use anstyle::{AnsiColor, Style};
use curitiba::OpenError;
use curitiba::pipeline::plan::{Decision, Plan, Work, mebibytes};
use curitiba::pipeline::project::{self, PassKind};
use curitiba::pipeline::scene::{self, LoadOptions, Needs};

const BUILT: Style = AnsiColor::Green.on_default();
const LEFT_OUT: Style = AnsiColor::Yellow.on_default();

/// Prints the plan of a project; its scenes are read for their materials.
pub fn run(args: &ProjectArgs) -> Result<(), Failure> {
    let project = project::load(&args.path)?;
    failure::print_problems(&project.problems);
    let plan = Plan::new(project, args.settings()).map_err(|error| Failure::from(OpenError::from(error)))?;
    print_warnings(&plan.warnings);
    let [width, height] = plan.window;
    crate::say!(
        "{}: pipeline `{}`, window {width} x {height}, targets {}",
        plan.project.path.display(),
        plan.project.pipelines[plan.pipeline].name,
        mebibytes(plan.target_bytes())
    );
    crate::say!("\npasses");
    for planned in &plan.passes {
        crate::say!("  {}", describe(&plan, planned));
    }
    crate::say!("\ndecisions");
    let structures = structures(&plan);
    for decision in &plan.decisions {
        print_decision(decision);
    }
    for decision in structures? {
        print_decision(&decision);
    }
    Ok(())
}

fn describe(plan: &Plan, planned: &curitiba::pipeline::plan::PlannedPass) -> String {
    let pass = plan.pass(planned);
    let target = match pass.target {
        Some(target) => format!("`{}::{}`", plan.project.targets[target].library, plan.project.targets[target].name),
        None => "the window".to_owned(),
    };
    let [width, height] = plan.target_size(pass.target);
    let what = match (&planned.work, &pass.kind) {
        (Work::Raster { .. }, _) => "draws triangles".to_owned(),
        (Work::Rays { params, .. }, PassKind::Ray(ray)) => {
            let info = ray.program.info();
            let values: Vec<String> = info.params.iter().map(|name| format!("{name}={}", params.get(name))).collect();
            format!("runs `{}` {}", info.stem, values.join(" "))
        }
        (Work::Effect { params, .. }, PassKind::Effect(effect)) => {
            let info = effect.program.info();
            let values: Vec<String> = info.params.iter().map(|name| format!("{name}={}", params.get(name))).collect();
            format!("computes `{}` by raster {}", info.name, values.join(" "))
        }
        _ => "fills a rectangle".to_owned(),
    };
    format!("{}: {} into {target}, {width} x {height}", pass.name, what.trim_end())
}

/// Whether each ray pass needs an acceleration structure, which the scene's materials decide.
fn structures(plan: &Plan) -> Result<Vec<Decision>, Failure> {
    let mut decisions = Vec::new();
    for planned in &plan.passes {
        let Work::Rays { scene_set, .. } = planned.work else { continue };
        let declared = plan.scene_sets[scene_set].iter().flat_map(|index| &plan.project.scenes[*index].files);
        let files: Vec<_> = declared.map(|file| file.path.clone()).collect();
        let options =
            LoadOptions { needs: Needs { normals: false, textures: false }, max_bytes: plan.settings.max_memory };
        let loaded = scene::load(&files, &options, &|_| {})?;
        print_warnings(&loaded.warnings);
        let (built, why) = plan.needs_structure(planned, &loaded.materials);
        let what = format!("acceleration structure for pass `{}`", plan.pass(planned).name);
        decisions.push(Decision { what, built, why });
    }
    Ok(decisions)
}

fn print_decision(decision: &Decision) {
    let (style, mark) = if decision.built { (BUILT, "yes") } else { (LEFT_OUT, "no ") };
    crate::say!("  {style}{mark}{style:#} {}: {}", decision.what, decision.why);
}
