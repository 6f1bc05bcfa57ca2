//! Textures of projects with own shaders among the inputs of ray passes: images to which a pass stores, and textures of random numbers.
//! The tests need the feature `glsl`, and no driver: they only make plans.

use curitiba::pipeline::plan::{Plan, PlanError, Settings, Work};
use std::path::Path;
use tempfile::TempDir;

const LIBRARY: &str = "mlibs/DeferredRenderTargets.mlib";

/// Makes the G-buffer's colour red.
const TINT: &str = "#version 430
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 1) writeonly uniform image2D drawn;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID);
    imageStore(drawn, at, vec4(1.0, 0.0, 0.0, 1.0));
}
";

/// `SceneReflect.xml` and its libraries. The scenes are not there, because a plan reads none.
struct Project(TempDir);

impl Project {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("mlibs")).expect("a folder");
        let project = Self(folder);
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects");
        for name in ["SceneReflect.xml", "mlibs/optixTest.mlib", LIBRARY] {
            project.write(name, &std::fs::read_to_string(from.join(name)).expect("it is there"));
        }
        project
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.path().join(name), text).expect("written");
    }

    /// With the first occurrence of a text in a file replaced.
    fn edited(self, name: &str, from: &str, to: &str) -> Self {
        let text = std::fs::read_to_string(self.0.path().join(name)).expect("it is there");
        assert!(text.contains(from), "{from}");
        self.write(name, &text.replacen(from, to, 1));
        self
    }

    fn plan(&self, settings: Settings) -> Result<Plan, PlanError> {
        let project = settings.open(&self.0.path().join("SceneReflect.xml")).expect("the project opens");
        Plan::new(project, settings)
    }
}

#[test]
fn a_g_buffer_to_which_a_pass_stored_is_not_read_in_place() {
    let resident = |project: &Project| {
        let plan = project.plan(Settings::default()).expect("a plan");
        let of_rays = plan.passes.iter().find_map(|planned| match planned.work {
            Work::Rays { resident, .. } => Some(resident),
            _ => None,
        });
        of_rays.expect("a ray pass")
    };
    let project = Project::new();
    assert!(resident(&project).is_some());
    // After the first pass, which draws the G-buffer.
    let pass = r#"</pass><pass class="compute" name="tint">
<material name="tint" fromLibrary="Deferred Render Targets" dimX="128" dimY="128"/></pass>"#;
    let material = r#"<materials><material name="tint"><shader name="tint"/>
<imageTextures><imageTexture UNIT="1" texture="color"/></imageTextures></material>"#;
    let project = project
        .edited("SceneReflect.xml", "</pass>", pass)
        .edited(LIBRARY, "<shaders>", r#"<shaders><shader name="tint" cs="tint.comp"/>"#)
        .edited(LIBRARY, "<materials>", material);
    project.write("mlibs/tint.comp", TINT);
    assert_eq!(resident(&project), None);
}

#[test]
fn random_colours_of_another_size_than_the_target_are_refused_also_for_a_pass_that_is_switched_off() {
    let noise = r#"<textures><texture name="noise"><WIDTH value="1024"/><HEIGHT value="1024"/><CONTENT value="RANDOM_UNIFORM"/></texture></textures>
<shaders>"#;
    let project = Project::new()
        .edited("SceneReflect.xml", "Deferred Render Targets::color", "Deferred Render Targets::noise")
        .edited(LIBRARY, "<shaders>", noise);
    for off in [Vec::new(), vec!["pass2".to_owned()]] {
        project.plan(Settings { off: off.clone(), ..Settings::default() }).expect("the project's own size");
        let small = Settings { off, size: Some([64, 48]), ..Settings::default() };
        let error = project.plan(small).expect_err("another size");
        assert!(
            error.message.contains("reads `Deferred Render Targets::noise` of 1024 x 1024")
                && error.message.contains("a target of 64 x 48"),
            "{error}"
        );
        assert!(error.help.is_some_and(|help| help.contains("--size 1024x1024")));
    }
}
