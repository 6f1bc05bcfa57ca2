//! Ogre meshes as XML (`.mesh.xml`): shared or own vertices, and faces by material. Materials are names only; material scripts are
//! not read. Other contents of a file (skeletons, poses, levels of detail) are skipped.

use super::context::{Context, MaterialTable};
use super::error::{Place, SceneError};
use super::xml_text::with_text;
use super::{Group, Mesh, Object, Scene};
use crate::diagnostic::Warnings;
use crate::guard;
use glam::{Mat4, Vec2, Vec3};
use quick_xml::events::{BytesStart, Event};

/// Suffix of the file names.
pub(crate) const SUFFIX: &str = ".mesh.xml";

/// State of the reader.
#[derive(Default)]
struct Loader {
    scene: Scene,
    table: MaterialTable,
    warnings: Warnings,
    shared: Mesh,
    /// The mesh of the open submesh, and whether it uses the shared vertices; `None` outside submeshes.
    current: Option<(Mesh, bool)>,
    /// Triangles that use the shared vertices, by submesh.
    shared_groups: Vec<Group>,
    /// Whether the open vertex already has texture coordinates; only the first set is read.
    has_texcoord: bool,
    /// Most bytes that the elements read so far take.
    held: usize,
}

/// Memory is booked in steps of at least this many bytes.
const STEP: usize = 1 << 18;

pub(crate) fn read(bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    with_text(bytes, context, read_mesh)
}

/// [`read`] for decoded text; positions in errors count the bytes of this text.
fn read_mesh(text: &str, context: &mut Context<'_>) -> Result<Scene, SceneError> {
    // The reader does not count a byte order mark.
    let (whole, text) = (text.len(), text.trim_start_matches('\u{feff}'));
    let skipped = (whole - text.len()) as u64;
    let mut reader = quick_xml::Reader::from_str(text);
    reader.config_mut().check_end_names = false;
    let mut loader = Loader::default();
    let (mut is_mesh, mut booked) = (false, 0);
    loop {
        let at = skipped + reader.buffer_position();
        let fail = |what: String| SceneError::new(context.file, Place::Byte(at), what);
        let event = guard::call("quick-xml", || reader.read_event()).map_err(&fail)?;
        match event.map_err(|error| fail(error.to_string()))? {
            Event::Eof => break,
            Event::Start(element) | Event::Empty(element) => {
                is_mesh |= element.name().as_ref().eq_ignore_ascii_case("mesh");
                loader.start(&element).map_err(&fail)?;
            }
            Event::End(element) if element.name().as_ref().eq_ignore_ascii_case("submesh") => loader.end(),
            _ => {}
        }
        // 64 bytes an element: a vertex with its attributes, in lists that double as they grow. Submeshes add their own bytes in `start`.
        loader.held += 64;
        if loader.held > booked {
            let step = STEP.max(loader.held - booked);
            context.take("the vertices, faces and submeshes", 1, step)?;
            booked += step;
        }
    }
    if !is_mesh {
        return Err(SceneError::file(context.file, "this XML file is no mesh of Ogre").help("valid: <mesh>"));
    }
    Ok(loader.finish(context))
}

impl Loader {
    fn start(&mut self, element: &BytesStart<'_>) -> Result<(), String> {
        let name = element.name().as_ref().to_ascii_lowercase();
        match &name[..] {
            "submesh" => {
                self.end();
                let shares = text(element, "usesharedvertices")?.is_none_or(|value| value.eq_ignore_ascii_case("true"));
                let material = text(element, "material")?.unwrap_or_default();
                // A submesh with vertices of its own becomes a mesh and an object, both with its name. Lists double as they grow.
                let own = if shares { 0 } else { size_of::<Mesh>() + size_of::<Object>() + 2 * 32 };
                self.held += 2 * (size_of::<Group>() + own);
                let index = match self.table.get(&material) {
                    Some(index) => index,
                    None => {
                        self.held += 2 * (size_of::<super::Material>() + material.len() + 32);
                        self.table.declare(super::Material { name: material, ..super::Material::default() });
                        self.table.materials.len() as u32 - 1
                    }
                };
                let mesh = Mesh { groups: vec![Group { material: index, triangles: Vec::new() }], ..Mesh::default() };
                self.current = Some((mesh, shares));
            }
            "vertex" => self.has_texcoord = false,
            "position" => {
                let at = vector(element)?;
                self.vertices().positions.push(at);
            }
            "normal" => {
                let normal = vector(element)?;
                self.vertices().normals.push(normal);
            }
            "texcoord" if !std::mem::replace(&mut self.has_texcoord, true) => {
                // v counts downwards in the file.
                let at = Vec2::new(number(element, "u")?, 1.0 - number(element, "v")?);
                self.vertices().texcoords.push(at);
            }
            "face" => {
                let face = [index(element, "v1")?, index(element, "v2")?, index(element, "v3")?];
                if let Some((Mesh { groups, .. }, _)) = &mut self.current
                    && let [group, ..] = &mut groups[..]
                {
                    group.triangles.push(face);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The mesh that vertices are read into: the open submesh, or the shared vertices.
    fn vertices(&mut self) -> &mut Mesh {
        self.current.as_mut().map_or(&mut self.shared, |(mesh, _)| mesh)
    }

    /// Ends a submesh.
    fn end(&mut self) {
        match self.current.take() {
            Some((mesh, true)) => self.shared_groups.extend(mesh.groups),
            Some((mesh, false)) => self.scene.meshes.push(mesh),
            None => {}
        }
    }

    fn finish(mut self, context: &Context<'_>) -> Scene {
        self.end();
        self.shared.groups = std::mem::take(&mut self.shared_groups);
        if !self.shared.groups.is_empty() {
            self.scene.meshes.push(self.shared);
        }
        for (number, mesh) in self.scene.meshes.iter_mut().enumerate() {
            mesh.name = format!("submesh {number}");
            let vertices = mesh.positions.len();
            let odd = |count: usize| count != 0 && count != vertices;
            if odd(mesh.normals.len()) || odd(mesh.texcoords.len()) {
                let what = "meshes with vertices that lack normals or texture coordinates";
                self.warnings.add(context.file, what, "drawn without both", || mesh.name.clone());
                (mesh.normals, mesh.texcoords) = (Vec::new(), Vec::new());
            }
            if !context.needs.normals {
                mesh.normals = Vec::new();
            }
            if !context.needs.textures {
                mesh.texcoords = Vec::new();
            }
            let (name, mesh) = (mesh.name.clone(), number as u32);
            self.scene.objects.push(Object { name, mesh, transform: Mat4::IDENTITY });
        }
        (self.scene.materials, self.scene.warnings) = (self.table.materials, self.warnings);
        self.scene
    }
}

/// The text of an attribute; `None` if it is missing.
fn text(element: &BytesStart<'_>, name: &str) -> Result<Option<String>, String> {
    let attribute = element.try_get_attribute(name).map_err(|error| error.to_string())?;
    Ok(attribute.map(|attribute| attribute.value.into_owned()))
}

fn parsed<T: std::str::FromStr>(element: &BytesStart<'_>, name: &str) -> Result<T, String> {
    let value = text(element, name)?;
    let parsed = value.as_deref().and_then(|value| value.trim().parse().ok());
    parsed.ok_or_else(|| {
        let tag = element.name().as_ref().to_owned();
        format!("`{name}` of <{tag}> is missing or no number")
    })
}

fn number(element: &BytesStart<'_>, name: &str) -> Result<f32, String> {
    parsed(element, name)
}

fn index(element: &BytesStart<'_>, name: &str) -> Result<u32, String> {
    parsed(element, name)
}

fn vector(element: &BytesStart<'_>) -> Result<Vec3, String> {
    Ok(Vec3::new(number(element, "x")?, number(element, "y")?, number(element, "z")?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, load};

    const MESH: &str = r#"<?xml version="1.0"?><mesh><sharedgeometry vertexcount="4"><vertexbuffer positions="true">
        <vertex><position x="0" y="0" z="0"/><normal x="0" y="0" z="1"/><texcoord u="0" v="1"/><texcoord u="9" v="9"/></vertex>
        <vertex><position x="1" y="0" z="0"/><normal x="0" y="0" z="1"/><texcoord u="1" v="1"/></vertex>
        <vertex><position x="0" y="1" z="0"/><normal x="0" y="0" z="1"/><texcoord u="0" v="0"/></vertex>
        <vertex><position x="1" y="1" z="0"/><normal x="0" y="0" z="1"/><texcoord u="1" v="0"/></vertex></vertexbuffer></sharedgeometry>
        <submeshes><submesh material="a/b" usesharedvertices="true"><faces count="1"><face v1="0" v2="1" v3="2"/></faces></submesh>
        <submesh material="c" usesharedvertices="true"><faces count="1"><face v1="2" v2="1" v3="3"/></faces></submesh>
        <submesh material="c" usesharedvertices="false"><faces count="1"><face v1="0" v2="1" v3="2"/></faces><geometry vertexcount="3">
        <vertexbuffer><vertex><position x="5" y="0" z="0"/></vertex><vertex><position x="6" y="0" z="0"/></vertex>
        <vertex><position x="5" y="1" z="0"/></vertex></vertexbuffer></geometry></submesh></submeshes></mesh>"#;

    fn load_text(text: &str, max_bytes: u64) -> Result<Scene, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("head.MESH.xml");
        std::fs::write(&path, text).expect("written");
        load(&[path], &LoadOptions { max_bytes, ..LoadOptions::default() }, &|_| {}).map_err(|error| error.to_string())
    }

    #[test]
    fn submeshes_share_vertices_or_have_their_own() {
        let scene = load_text(MESH, 1 << 24).expect("it loads");
        let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
        assert_eq!(names, ["a/b", "c"]);
        let [own, shared] = &scene.meshes[..] else { panic!("two meshes") };
        assert_eq!((own.positions.len(), own.groups[0].material, own.positions[0].x), (3, 1, 5.0));
        let groups: Vec<_> = shared.groups.iter().map(|group| (group.material, group.triangles[0])).collect();
        assert_eq!(groups, [(0, [0, 1, 2]), (1, [2, 1, 3])]);
        assert_eq!((shared.texcoords[0], shared.texcoords[3]), (Vec2::ZERO, Vec2::ONE));
        assert_eq!((shared.normals.len(), own.normals.len(), scene.objects.len()), (4, 0, 2));
    }

    #[test]
    fn wrong_files_are_errors_with_their_place() {
        let said = |text: &str, words: &str| {
            let error = load_text(text, 1 << 24).expect_err(words);
            assert!(error.contains("head.MESH.xml") && error.contains(words), "{error}");
        };
        said("<skeleton/>", "no mesh of Ogre");
        said(&MESH.replace("v2=\"1\"", "v2=\"-1\""), "`v2` of <face> is missing or no number");
        said(&MESH.replace("<position x=\"5\" y=\"0\"", "<position x=\"5\""), "`y` of <position>");
        said("\u{feff}<mesh><face/></mesh>", ":1:7: ");
        let many = format!("<mesh>{}</mesh>", "<vertex/>".repeat(20_000));
        let error = load_text(&many, 1 << 20).expect_err("beyond the limit");
        assert!(error.contains("--max-memory"), "{error}");
        // Submeshes take more than other elements, also empty ones.
        let many = |count: usize| format!("<mesh>{}</mesh>", "<submesh usesharedvertices=\"false\"/>".repeat(count));
        let error = load_text(&many(4000), 1 << 20).expect_err("beyond the limit");
        assert!(error.contains("submeshes need") && error.contains("--max-memory"), "{error}");
        assert_eq!(load_text(&many(400), 1 << 20).expect("it loads").objects.len(), 400);
        let lacking = MESH.replace("<normal x=\"0\" y=\"0\" z=\"1\"/><texcoord u=\"1\" v=\"1\"/>", "");
        let scene = load_text(&lacking, 1 << 24).expect("it is drawn without");
        assert!(scene.meshes[1].normals.is_empty() && scene.warnings.groups().len() == 1);
    }
}
