//! Real projects, where the environment has them: `CURITIBA_PROJECTS` names a folder with `OptixProjects/*.xml` and the
//! libraries that they name.

use curitiba_pipeline::project::load;
use std::path::PathBuf;

#[test]
fn the_seven_projects_of_2014_load_unchanged() {
    let Some(folder) = std::env::var_os("CURITIBA_PROJECTS").map(PathBuf::from) else {
        println!("skipped: CURITIBA_PROJECTS names no folder");
        return;
    };
    for name in ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        let path = folder.join(format!("OptixProjects/Scene{name}.xml"));
        let project = load(&path).unwrap_or_else(|problems| panic!("{name} does not load:\n{problems}"));
        let passes = project.pipelines[0].passes.len();
        assert_eq!(passes, if name == "NoEffects" { 1 } else { 3 }, "{name}");
    }
}
