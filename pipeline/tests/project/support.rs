//! Small projects, each written to a folder of its own.

use curitiba_pipeline::diagnostic::{Problem, Problems, Severity};
use curitiba_pipeline::project::{Project, load};
use std::path::PathBuf;
use tempfile::TempDir;

/// A library with a G-buffer, a ray target, and the materials that draw and combine them.
pub const LIBRARY: &str = r#"<?xml version="1.0" ?>
<materiallib name="Lib">
	<rendertargets>
		<rendertarget name="gbuffer">
			<size width="64" height="32" />
			<colors>
				<color name="color" internalFormat="RGBA32F" />
				<color name="pos" internalFormat="RGBA32F" />
				<color name="norm" internalFormat="RGBA16F" />
			</colors><depth name="far" internalFormat="DEPTH_COMPONENT24" />
		</rendertarget>
		<rendertarget name="rays">
			<size width="64" height="32" />
			<colors>
				<color name="result" internalFormat="RGBA8" />
			</colors>
		</rendertarget>
		<rendertarget name="small">
			<size width="8" height="8" />
			<depth name="depth" internalFormat="DEPTH_COMPONENT24" />
			<colors>
				<color name="tiny" internalFormat="R8" />
			</colors>
		</rendertarget>
		<rendertarget name="shadowMap">
			<size width="8" height="8" />
			<depth name="onlyDepth" internalFormat="DEPTH_COMPONENT24" />
		</rendertarget>
	</rendertargets>
	<shaders>
		<shader name="deferred" ps="../shaders/deferredShading.frag" vs="../shaders/deferredShading.vert" />
		<shader name="combine" ps="..\shaders\combine.frag" vs="..\shaders\combine.vert" />
		<shader name="flat" ps="flat.frag" vs="flat.vert" />
	</shaders>
	<textures>
		<texture name="crate" filename="crate.jpg" mipmap=true />
		<cubeMap name="sky" filePosX="right.jpg" />
	</textures>
	<materials>
		<material name="deferred"><shader><name>deferred</name></shader></material>
		<material name="flat"><shader name="flat"><values><valueof uniform="a" /></values></shader></material>
		<material name="plain"><color><diffuse r="1" g="0" b="0" /><emission r="0" g="1" b="0" a="0.5" /></color></material>
		<material name="crated"><textures><texture unit="0" name="crate" /></textures></material>
		<material name="combine">
			<shader><name>combine</name></shader>
			<textures><texture unit="0" name="color" /><texture UNIT="1" name="Lib::result" /></textures>
		</material>
		<material name="half"><shader name="combine" /><textures><texture unit="0" name="color" /></textures></material>
		<material name="pictures">
			<shader name="combine" />
			<textures><texture unit="0" name="crate" /><texture unit="1" name="far" /></textures>
		</material>
		<material name="glass">
			<color><diffuse r="1.0" g="0.0" b="1.0" a="0.0" /><emission r="1.0" g="0.0" b="1.0" a="0.0" /></color>
		</material>
	</materials>
</materiallib>
"#;

/// Assets that the tests' projects share.
pub const ASSETS: &str = r#"<assets>
<scenes><scene name="Main"><file>box.obj</file></scene></scenes>
<viewports><viewport name="View"><geometry x="0" y="0" width="1" height="1" /></viewport></viewports>
<cameras><camera name="Eye"><position x="0" y="0" z="5" /><view x="0" y="0" z="-2" /></camera></cameras>
<lights>
<light name="Sun"><direction x="0" y="-3" z="0" /></light>
<light name="Lamp"><position x="0" y="3" z="0" /></light>
</lights>
<materialLibs><mlib filename="lib.mlib" /></materialLibs>
</assets>
"#;

/// The G-buffer pass.
pub const RASTER: &str = r#"<pass class="default" name="gbuffer"><scenes><scene>Main</scene></scenes><lights><light>Sun</light></lights>
<rendertarget name="gbuffer" fromLibrary="Lib" />
<injectionMaps><map toMaterial="*"><shader fromMaterial="deferred" fromLibrary="Lib" /></map></injectionMaps></pass>
"#;

/// A pass that runs `deferredShadows`.
pub const SHADOWS: &str = r#"<pass class="optix" name="shadows"><scenes><scene>Main</scene></scenes>
<rendertarget name="rays" fromLibrary="Lib" /><lights><light>Sun</light></lights>
<optixEntryPoint><optixProgram type="RayGen" file="optix/deferredShadows.ptx" proc="buffer_camera"/></optixEntryPoint>
<optixDefaultMaterial>
<optixProgram type="Any_Hit" ray="Shadow" file="optix/deferredShadows.ptx" proc="any_hit_shadow"/>
</optixDefaultMaterial>
<optixVertexAttributes><attribute name="position"/></optixVertexAttributes>
<optixGlobalAttributes>
<valueof optixVar="lightDir" type="CURRENT" context="LIGHT" id=0 component="DIRECTION" />
</optixGlobalAttributes>
<optixInput><buffer var="pos_buffer" texture="Lib::pos" /></optixInput></pass>
"#;

/// A pass that runs `ssao`, with the given attributes.
pub fn ssao(attributes: &str) -> String {
    format!(
        r#"<pass class="optix" name="ao" {attributes}><scenes><scene>Main</scene></scenes>
<rendertarget name="rays" fromLibrary="Lib" />
<optixEntryPoint><optixProgram type="RayGen" file="ssao.ptx" proc="buffer_camera"/></optixEntryPoint>
<optixDefaultMaterial>
<optixProgram type="Any_Hit" ray="Shadow" file="ssao.ptx" proc="any_hit_shadow"/>
<optixProgram type="Miss" ray="Shadow" file="ssao.ptx" proc="miss"/>
</optixDefaultMaterial>
<optixVertexAttributes><attribute name="position"/></optixVertexAttributes>
<optixInput><buffer var="pos_buffer" texture="Lib::pos" /><buffer var="norm_buffer" texture="Lib::norm" /></optixInput></pass>
"#
    )
}

/// A pass that runs `final` with glass.
pub const FINAL: &str = r#"<pass class="rt" name="final"><scenes><scene name="Main"/></scenes>
<renderTarget name="rays" fromLibrary="Lib" /><lights><light name="Sun"/></lights>
<rtRayTypes><rayType name="Phong"/><rayType name="Shadow"/></rtRayTypes>
<rtEntryPoint><rayGen file="any\folder\final.optixir" proc="buffer_camera"/></rtEntryPoint>
<rtDefaultMaterial>
<rayType name="Phong">
<rtProgram type="CLOSEST_HIT" file="final.ptx" proc="closest_hit"/>
<rtProgram type="MISS" file="final.ptx" proc="miss"/>
</rayType>
<rayType name="Shadow">
<rtProgram type="ANY_HIT" file="final.ptx" proc="any_hit_shadow"/>
<rtProgram type="MISS" file="final.ptx" proc="miss_shadow"/>
</rayType>
</rtDefaultMaterial>
<rtMaterialMap>
<rtMap to="curitiba_material_lib:Vidro">
<rayType name="Phong"><rtProgram type="CLOSEST_HIT" file="final.ptx" proc="closest_hit_glass"/></rayType>
<rayType name="Shadow"><rtProgram type="ANY_HIT" file="final.ptx" proc="any_hit_shadow_glass"/></rayType>
</rtMap>
<rtMap to="Window"><rtProgram type="Closest_Hit" ray="Phong" file="final.ptx" proc="closest_hit_glass"/></rtMap>
</rtMaterialMap>
<rtVertexAttributes><attribute name="position"/><attribute name="normal"/><attribute name="texCoord0"/></rtVertexAttributes>
<rtMaterialAttributes>
<valueof rtVar="diffuse" type="COLOR" context="CURRENT" component="DIFFUSE" />
<valueof rtVar="texCount" type="RENDERER" context="CURRENT" component="TEXTURE_COUNT" />
</rtMaterialAttributes>
<rtGlobalParams>
<param name="lightDir" type="LIGHT" context="CURRENT" id=0 component="DIRECTION" />
<param name="lightColor" type="LIGHT" context="Sun" component="COLOR" />
</rtGlobalParams>
<rtInput><buffer var="pos_buffer" texture="Lib::pos" /><buffer var="norm_buffer" texture="Lib::norm" />
<buffer var="color_buffer" texture="Lib::color" /></rtInput></pass>
"#;

/// A quad pass that shows the ray target.
pub const SHOW: &str = r#"<pass class="quad" name="show"><texture name="result" fromLibrary="Lib" /></pass>
"#;

/// A project of the shared assets and these passes. The first pass is on line 13.
pub fn project(passes: &str) -> String {
    format!(
        "<project name=\"p\">\n{ASSETS}<pipelines><pipeline name=\"main\" defaultCamera=\"Eye\">\n{passes}</pipeline></pipelines></project>\n"
    )
}

/// A folder with a project and its libraries.
pub struct Files {
    folder: TempDir,
}

impl Files {
    /// The shared library and the given project.
    pub fn new(project: impl AsRef<[u8]>) -> Self {
        let files = Self { folder: tempfile::tempdir().expect("a folder for temporary files") };
        files.write("project.xml", project);
        files.write("lib.mlib", LIBRARY);
        files
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("the folder can be made");
        std::fs::write(path, bytes).expect("the file can be written");
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn load(&self) -> Result<Project, Problems> {
        load(&self.path("project.xml"))
    }
}

/// Loads a project that must be valid.
#[track_caller]
pub fn good(text: &str) -> Project {
    match Files::new(text).load() {
        Ok(project) => {
            assert!(!project.problems.has_errors(), "{}", project.problems);
            project
        }
        Err(problems) => panic!("it does not load:\n{problems}"),
    }
}

/// Loads a project that must be refused.
#[track_caller]
pub fn bad(bytes: impl AsRef<[u8]>) -> Problems {
    let problems = Files::new(bytes).load().expect_err("it must not load");
    assert!(problems.has_errors());
    problems
}

/// Formats a problem as `file.xml:line:column: message`, without the folder.
pub fn line(problem: &Problem) -> String {
    let Some((source, range)) = &problem.place else { return problem.message.clone() };
    let (line, column) = source.line_column(range.start);
    let name = source.path.file_name().expect("a name").to_string_lossy();
    format!("{name}:{line}:{column}: {}", problem.message)
}

/// The errors, formatted by [`line`].
pub fn errors(problems: &Problems) -> Vec<String> {
    problems.0.iter().filter(|problem| problem.severity == Severity::Error).map(line).collect()
}

/// `line:column` of the first occurrence of `needle` in a text.
#[track_caller]
pub fn place(text: &str, needle: &str) -> String {
    let before = &text[..text.find(needle).unwrap_or_else(|| panic!("`{needle}` is not in the text"))];
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    format!("{}:{column}", before.matches('\n').count() + 1)
}

/// Asserts that a project has exactly this error, at the place that `@` marks in `marked`.
#[track_caller]
pub fn one_error(marked: &str, message: &str, help: &str) {
    let at = place(marked, "@");
    let problems = bad(marked.replacen('@', "", 1));
    assert_eq!(errors(&problems), [format!("project.xml:{at}: {message}")], "\n{problems}");
    let problem = problems.0.iter().find(|problem| problem.severity == Severity::Error).expect("an error");
    let said = problem.help.as_deref().unwrap_or_default();
    assert!(said.contains(help), "the help lacks `{help}`: {said}");
}

/// Replaces the first occurrence of a text, which must occur.
#[track_caller]
pub fn with(text: &str, old: &str, new: &str) -> String {
    assert!(text.contains(old), "`{old}` is not in the text");
    text.replacen(old, new, 1)
}
