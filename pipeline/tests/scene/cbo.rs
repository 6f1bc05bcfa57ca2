//! CBO and NBO files that are built byte by byte.

use crate::scene_support::{Folder, assert_references_are_valid, count, load_capped, load_one, mutations, triangles};
use curitiba_pipeline::scene::texture::{Magnification, Sampling, Wrap};
use curitiba_pipeline::scene::{Layout, LoadOptions, Material, Needs, TextureSource, load, write_cbo};
use glam::{Mat4, Vec2, Vec3, Vec4};

/// A builder of little-endian bytes.
#[derive(Default, Clone)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn u32(mut self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn floats(mut self, values: &[f32]) -> Self {
        values.iter().for_each(|value| self.0.extend(value.to_le_bytes()));
        self
    }

    fn string(mut self, text: &str) -> Self {
        self = self.u32(text.len() as u32);
        self.0.extend(text.bytes());
        self.0.push(0);
        self
    }

    fn raw(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    fn material(self, layout: Layout, name: &str, texture: &str) -> Self {
        let mut bytes = self
            .string(name)
            .floats(&[0.1, 0.2, 0.3, 1.0])
            .floats(&[0.4, 0.4, 0.4, 1.0])
            .floats(&[0.5, 0.6, 0.7, 0.8])
            .floats(&[0.0, 0.0, 9.0, 1.0])
            .floats(&[33.0])
            .string(texture);
        for _ in 1..8 {
            bytes = bytes.string("<no texture>");
        }
        if layout == Layout::Cbo2014 {
            bytes = bytes.string("").string("").string("").string("").u32(0).string("");
            bytes = bytes.u32(3).raw(&[1, 0, 1]).u32(1).u32(7).u32(0).u32(1).floats(&[2.0]);
            bytes = bytes.u32(1).floats(&[0.0; 4]).u32(1).raw(&[1; 4]);
        }
        bytes
    }

    fn transform(self, layout: Layout, transform: Mat4) -> Self {
        let bytes = if layout == Layout::Cbo2014 { self.string("SimpleTransform") } else { self };
        bytes.floats(&transform.to_cols_array())
    }

    /// A unit right triangle with normals along z; its texture coordinates are x and y.
    fn vertices(self) -> Self {
        self.u32(4)
            .string("position")
            .u32(3)
            .floats(&[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
            .string("normal")
            .u32(3)
            .floats(&[0.0, 0.0, 1.0, 0.0].repeat(3))
            .string("tangent")
            .u32(1)
            .floats(&[0.0; 4])
            .string("texCoord0")
            .u32(3)
            .floats(&[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
            .u32(0)
    }
}

/// Two objects that share a renderable, the second one moved; then an object without geometry.
fn object_list(layout: Layout) -> Bytes {
    let head = |bytes: Bytes, name: &str| {
        bytes.string("SimpleObject").string(name).string("BoundingBox").u32(2).floats(&[0.0; 6])
    };
    let mut bytes = Bytes::default().u32(1).material(layout, "Pedra", "<no texture>").string("OctreeUnified").u32(3);
    bytes = head(bytes, "first").transform(layout, Mat4::IDENTITY).string("shape").string("Mesh").vertices();
    bytes = bytes.u32(1).string("Pedra").u32(0).u32(3).u32(2).u32(1).u32(0);
    bytes = head(bytes, "second").transform(layout, Mat4::from_translation(Vec3::X)).string("shape");
    head(bytes, "empty").transform(layout, Mat4::IDENTITY).string("NULLOBJECT")
}

/// An octree of two levels with one object each; the inner object has no index list.
fn octree(layout: Layout) -> Bytes {
    let object = |bytes: Bytes, name: &str, indices: &[u32]| {
        let bytes = bytes.string("key").string(name).floats(&[0.0; 6]).transform(layout, Mat4::IDENTITY);
        let bytes = bytes.string(name).vertices().string("Vidro").u32(0).u32(indices.len() as u32);
        indices.iter().fold(bytes, |bytes, index| bytes.u32(*index))
    };
    let bytes = Bytes::default().u32(1).material(layout, "Vidro", "<no texture>").string("OctreeByMatScene");
    let bytes = bytes.floats(&[0.0; 6]).string("tree").floats(&[0.0; 12]).u32(1);
    let bytes = object(bytes, "outer", &[0, 1, 2, 2, 1, 0]).u32(1).u32(0).u32(0).floats(&[0.0; 12]).u32(1);
    object(bytes, "inner", &[]).u32(0).u32(1).u32(1)
}

#[test]
fn both_layouts_are_read_under_either_extension() {
    let folder = Folder::new();
    for layout in [Layout::Cbo2014, Layout::NboToday] {
        for name in ["a.cbo", "a.nbo"] {
            let scene = load_one(&folder.write(name, object_list(layout).0)).unwrap();
            assert_eq!(scene.meshes.len(), 1, "the second object shares the first one's geometry");
            assert_eq!(scene.objects.len(), 2, "an object without geometry is not placed");
            assert_eq!(scene.objects[1].transform, Mat4::from_translation(Vec3::X));
            assert_eq!(scene.objects[1].name, "second");
            let mesh = &scene.meshes[0];
            assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
            assert_eq!(mesh.normals, [Vec3::Z; 3]);
            assert_eq!(mesh.texcoords, [Vec2::ZERO, Vec2::X, Vec2::Y]);
            assert_eq!(mesh.groups[0].triangles, [[2, 1, 0]]);
            let material = &scene.materials[0];
            assert_eq!(material.name, "Pedra");
            assert_eq!(material.ambient, Vec4::new(0.1, 0.2, 0.3, 1.0));
            assert_eq!(material.specular, Vec4::new(0.4, 0.4, 0.4, 1.0));
            assert_eq!(material.diffuse, Vec4::new(0.5, 0.6, 0.7, 0.8));
            assert_eq!(material.emission, Vec4::new(0.0, 0.0, 9.0, 1.0));
            assert_eq!(material.shininess, 33.0);
            assert!(scene.warnings.is_empty());
        }
    }
}

#[test]
fn octrees_are_read_to_their_leaves_and_missing_index_lists_mean_vertices_in_order() {
    let folder = Folder::new();
    for layout in [Layout::Cbo2014, Layout::NboToday] {
        let scene = load_one(&folder.write("tree.cbo", octree(layout).0)).unwrap();
        assert_eq!(scene.objects.len(), 2);
        assert_eq!(scene.meshes[0].groups[0].triangles, [[0, 1, 2], [2, 1, 0]]);
        assert_eq!(scene.meshes[1].groups[0].triangles, [[0, 1, 2]]);
    }
}

#[test]
fn what_is_not_needed_is_not_stored() {
    let folder = Folder::new();
    let path = folder.write("a.cbo", object_list(Layout::Cbo2014).0);
    let needs = Needs::NOTHING;
    let scene = load(&[path], &LoadOptions { needs, ..LoadOptions::default() }, &|_| {}).unwrap();
    assert!(scene.meshes[0].normals.is_empty() && scene.meshes[0].texcoords.is_empty());
    assert_eq!(triangles(&scene), 2);
}

#[test]
fn a_texture_is_found_by_its_windows_path_and_a_missing_one_is_a_warning() {
    let folder = Folder::new();
    folder.png("Texturas/Agua.png", 2, 2, [9, 9, 9, 255]);
    let tail = Bytes::default().string("OctreeUnified").u32(0);
    let bytes = Bytes::default().u32(2).material(Layout::Cbo2014, "Agua", "..\\TEXTURAS\\agua.png");
    let bytes = bytes.material(Layout::Cbo2014, "Nada", "..\\nada.png").raw(&tail.0);
    let scene = load_one(&folder.write("cenas/a.cbo", bytes.0)).unwrap();
    assert_eq!(scene.materials[0].texture, Some(0));
    assert_eq!(scene.materials[0].alpha_cutoff, None, "the material's alpha test is off");
    assert_eq!(scene.materials[1].texture, None);
    assert_eq!(count(&scene.warnings, "missing textures"), 1);
    assert_eq!(count(&scene.warnings, "texture paths with other letter case"), 1);
    assert!(scene.warnings.groups().iter().any(|group| group.places[0].contains("nada.png")));
}

#[test]
fn damaged_files_are_errors_that_name_the_byte_and_what_was_expected() {
    let folder = Folder::new();
    let whole = object_list(Layout::Cbo2014).0;
    for length in 0..whole.len() {
        let error = load_one(&folder.write("cut.cbo", &whole[..length])).expect_err("a part is not a scene");
        assert!(error.to_string().contains("at byte"), "{error}");
    }
    let mut longer = whole.clone();
    longer.push(0);
    let error = load_one(&folder.write("long.cbo", longer)).unwrap_err();
    assert!(error.to_string().contains("1 bytes follow"), "{error}");

    // A count far beyond the file's size is refused before memory is allocated.
    let greedy = Bytes::default().u32(0).string("OctreeUnified").u32(1).string("SimpleObject").string("o");
    let greedy = greedy.string("BoundingBox").u32(u32::MAX);
    let error = load_one(&folder.write("greedy.nbo", greedy.0)).unwrap_err();
    assert!(error.to_string().contains("4294967295"), "{error}");
}

#[test]
fn an_octree_without_end_is_refused() {
    let mut bytes = Bytes::default().u32(0).string("OctreeByMatScene").floats(&[0.0; 6]).string("tree");
    for _ in 0..100_000 {
        bytes = bytes.floats(&[0.0; 12]).u32(0).u32(1).u32(0).u32(0);
    }
    let folder = Folder::new();
    let error = load_one(&folder.write("deep.nbo", bytes.0)).unwrap_err();
    assert!(error.to_string().contains("levels deep"), "{error}");
}

#[test]
fn the_memory_cap_is_an_error_that_names_its_option() {
    let folder = Folder::new();
    let path = folder.write("a.cbo", object_list(Layout::Cbo2014).0);
    let error = load(&[path], &LoadOptions { max_bytes: 100, ..LoadOptions::default() }, &|_| {}).unwrap_err();
    assert!(error.to_string().contains("--max-memory"), "{error}");
}

#[test]
fn odd_contents_are_counted_and_the_rest_is_loaded() {
    let bytes = Bytes::default().u32(2).material(Layout::NboToday, "a", "<no texture>");
    let bytes = bytes.material(Layout::NboToday, "a", "<no texture>").string("OctreeUnified").u32(1);
    let bytes = bytes.string("SimpleObject").string("o").string("BoundingBox").u32(0);
    let bytes = bytes.transform(Layout::NboToday, Mat4::IDENTITY).string("r").string("Mesh").u32(2);
    let bytes = bytes.string("position").u32(3).floats(&[0.0; 12]).string("normal").u32(1).floats(&[0.0; 4]).u32(0);
    let bytes = bytes.u32(1).string("unknown").u32(0).u32(4).u32(0).u32(1).u32(2).u32(0);
    let folder = Folder::new();
    let scene = load_one(&folder.write("odd.nbo", bytes.0)).unwrap();
    for what in [
        "materials declared twice",
        "attributes with another number of values than there are positions",
        "materials that are used but not declared",
        "index counts that are no multiple of 3",
    ] {
        assert_eq!(count(&scene.warnings, what), 1, "{what}");
    }
    assert_eq!(triangles(&scene), 1);
    assert!(scene.meshes[0].normals.is_empty());
}

#[test]
fn what_is_written_reads_back_the_same() {
    let folder = Folder::new();
    folder.png("textures/wall.png", 4, 4, [1, 2, 3, 255]);
    let bytes = Bytes::default().u32(2).material(Layout::Cbo2014, "Água", "textures\\wall.png");
    let name = Bytes::default().string("x").0;
    assert_eq!(name.len(), 6);
    let bytes = bytes.material(Layout::Cbo2014, "Pedra", "<no texture>");
    let rest = object_list(Layout::Cbo2014).0;
    let after_material = 4 + Bytes::default().material(Layout::Cbo2014, "Pedra", "<no texture>").0.len();
    let original = load_one(&folder.write("original.cbo", bytes.raw(&rest[after_material..]).0)).unwrap();
    assert_eq!(original.objects.len(), 2);

    for (layout, name) in [(Layout::Cbo2014, "out/copy.cbo"), (Layout::NboToday, "out/copy.nbo")] {
        let copy_path = folder.write(name, b"an older file");
        let warnings = write_cbo(&original, &copy_path, layout).unwrap();
        assert!(warnings.is_empty(), "{:?}", warnings.groups());
        let copy = load_one(&copy_path).unwrap();
        assert!(copy.warnings.is_empty(), "{:?}", copy.warnings.groups());
        assert_eq!(copy.materials, original.materials);
        let canonical =
            |scene: &curitiba_pipeline::scene::Scene| std::fs::canonicalize(scene.textures[0].name()).unwrap();
        assert_eq!(canonical(&copy), canonical(&original));
        assert_eq!(copy.meshes.len(), original.meshes.len());
        for (copy, original) in copy.meshes.iter().zip(&original.meshes) {
            assert_eq!(copy.name, original.name);
            assert_eq!(copy.positions, original.positions);
            assert_eq!(copy.normals, original.normals);
            assert_eq!(copy.texcoords, original.texcoords);
            assert_eq!(copy.groups.len(), original.groups.len());
            assert_eq!(copy.groups[0].triangles, original.groups[0].triangles);
        }
        for (copy, original) in copy.objects.iter().zip(&original.objects) {
            assert_eq!((&copy.name, copy.mesh, copy.transform), (&original.name, original.mesh, original.transform));
        }
        // Writing it again gives the same bytes.
        let bytes = std::fs::read(&copy_path).unwrap();
        write_cbo(&copy, &copy_path, layout).unwrap();
        assert_eq!(std::fs::read(&copy_path).unwrap(), bytes);
    }
}

#[test]
fn names_that_are_the_same_in_latin_1_stay_apart() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl \u{100}\nKd 1 0 0\nnewmtl \u{101}\nKd 0 1 0\n");
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\no \u{100}\nusemtl \u{100}\nf 1 2 3\n\
                o \u{101}\nusemtl \u{101}\nf 3 2 1\n";
    let scene = load_one(&folder.write("a.obj", text)).unwrap();
    let warnings = write_cbo(&scene, &folder.path("b.cbo"), Layout::Cbo2014).unwrap();
    assert!(count(&warnings, "names with letters outside Latin-1") >= 4);
    let copy = load_one(&folder.path("b.cbo")).unwrap();
    let colors: Vec<Vec4> = copy
        .objects
        .iter()
        .map(|object| copy.materials[copy.meshes[object.mesh as usize].groups[0].material as usize].diffuse)
        .collect();
    assert_eq!(colors, [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0)]);
    assert_eq!(copy.meshes[copy.objects[1].mesh as usize].groups[0].triangles.len(), 1);
}

#[test]
fn a_texture_path_of_a_megabyte_is_a_missing_texture() {
    let bytes = Bytes::default().u32(1).material(Layout::NboToday, "m", &"a/".repeat(1 << 19));
    let scene = load_one(&Folder::new().write("a.nbo", bytes.string("OctreeUnified").u32(0).0)).unwrap();
    assert_eq!(count(&scene.warnings, "missing textures"), 1);
    assert_eq!(scene.materials[0].texture, None);
}

#[test]
fn what_the_format_cannot_keep_is_counted() {
    let folder = Folder::new();
    let mut scene = load_one(&folder.write("a.cbo", object_list(Layout::Cbo2014).0)).unwrap();
    scene.materials[0].transmission = 1.0;
    scene.materials[0].thickness = 2.0;
    scene.materials[0].ior = 1.1;
    scene.objects[0].name = "日本".to_owned();
    let warnings = write_cbo(&scene, &folder.path("b.cbo"), Layout::Cbo2014).unwrap();
    assert_eq!(count(&warnings, "materials with transmission"), 1);
    assert_eq!(count(&warnings, "materials with absorption"), 1);
    assert_eq!(count(&warnings, "materials with an index, colours, dispersion or rank of glass"), 1);
    assert_eq!(warnings.groups().len(), 4, "{:?}", warnings.groups());
    assert_eq!(count(&warnings, "names with letters outside Latin-1"), 1);
    assert_eq!(load_one(&folder.path("b.cbo")).unwrap().objects[0].name, "??");
    // Without transmission, the refractive index and the roughness have no meaning, and the writer warns about neither.
    scene.materials[0] = Material { ior: 1.1, roughness: 0.5, ..Material::default() };
    scene.objects[0].name = "a".to_owned();
    assert!(write_cbo(&scene, &folder.path("b.cbo"), Layout::Cbo2014).unwrap().is_empty());
    let image = TextureSource::File(folder.png("image.png", 1, 1, [255; 4]));
    let sampling = Sampling { wrap: [Wrap::Clamp, Wrap::Repeat], magnification: Magnification::Nearest };
    scene.textures = vec![image.sampled(sampling)];
    scene.materials[0] = Material {
        texture: Some(0),
        transmission: 0.5,
        roughness: 0.5,
        emission: Vec4::ONE,
        emission_added: true,
        single_sided: true,
        ..Material::default()
    };
    for (file, layout) in [("b.cbo", Layout::Cbo2014), ("b.nbo", Layout::NboToday)] {
        let warnings = write_cbo(&scene, &folder.path(file), layout).unwrap();
        for lost in [
            "materials with transmission",
            "materials of rough glass",
            "materials that send out light of their own",
            "materials that are seen from one side",
            "textures that are clamped or mirrored",
            "textures that are magnified without blending",
        ] {
            assert_eq!(count(&warnings, lost), 1, "{file}: {lost}");
        }
        assert_eq!(warnings.groups().len(), 6, "{file}: {:?}", warnings.groups());
    }
}

#[test]
fn the_alpha_test_is_kept_by_the_2014_layout_and_counted_as_lost_by_todays() {
    let folder = Folder::new();
    let mut scene = load_one(&folder.write("a.cbo", object_list(Layout::Cbo2014).0)).unwrap();
    scene.textures = vec![TextureSource::File(folder.png("grade.png", 1, 1, [0; 4]))];
    scene.materials[0].texture = Some(0);
    scene.materials[0].alpha_cutoff = Some(0.25);
    let warnings = write_cbo(&scene, &folder.path("b.cbo"), Layout::Cbo2014).unwrap();
    assert!(warnings.is_empty(), "{:?}", warnings.groups());
    assert_eq!(load_one(&folder.path("b.cbo")).unwrap().materials[0].alpha_cutoff, Some(0.25));
    let warnings = write_cbo(&scene, &folder.path("b.nbo"), Layout::NboToday).unwrap();
    assert_eq!(count(&warnings, "materials with an alpha cutoff"), 1);
    // The texture makes the material a cut-out: it has texels of less than half opacity.
    assert_eq!(load_one(&folder.path("b.nbo")).unwrap().materials[0].alpha_cutoff, Some(0.5));
    folder.png("grade.png", 1, 1, [0, 0, 0, 128]);
    assert_eq!(load_one(&folder.path("b.nbo")).unwrap().materials[0].alpha_cutoff, None);
}

#[test]
fn texture_paths_of_another_machine_are_found_by_their_ends() {
    let folder = Folder::new();
    folder.png("Texturas/agua.png", 2, 2, [9, 9, 9, 255]);
    folder.png("pedra.png", 2, 2, [9, 9, 9, 255]);
    let mut bytes = Bytes::default().u32(3);
    for (name, texture) in
        [("Agua", "C:\\Modelos\\Texturas\\agua.png"), ("Pedra", "..\\..\\Maps\\pedra.png"), ("Nada", "D:\\nada.png")]
    {
        bytes = bytes.material(Layout::NboToday, name, texture);
    }
    let scene = load_one(&folder.write("a.nbo", bytes.string("OctreeUnified").u32(0).0)).unwrap();
    assert_eq!(scene.textures[0], TextureSource::File(folder.path("Texturas/agua.png")));
    assert_eq!(scene.textures[1], TextureSource::File(folder.path("pedra.png")));
    assert_eq!(count(&scene.warnings, "texture paths that lead nowhere"), 2);
    assert_eq!(count(&scene.warnings, "missing textures"), 1);
}

#[cfg(unix)]
#[test]
fn written_files_have_the_permissions_of_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let path = folder.write("a.cbo", object_list(Layout::Cbo2014).0);
    let scene = load_one(&path).unwrap();
    write_cbo(&scene, &folder.path("b.cbo"), Layout::Cbo2014).unwrap();
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&folder.path("b.cbo")), mode(&path));
}

#[test]
fn numbers_of_materials_that_are_not_finite_are_replaced_and_counted() {
    let folder = Folder::new();
    let mut bytes = object_list(Layout::NboToday).0;
    // Offset of the ambient colour's red: after the count and the name "Pedra".
    let red = 4 + 4 + 5 + 1;
    bytes[red..red + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let scene = load_one(&folder.write("a.nbo", bytes)).unwrap();
    assert_eq!(scene.materials[0].ambient, Material::default().ambient);
    assert_eq!(scene.materials[0].diffuse, Vec4::new(0.5, 0.6, 0.7, 0.8));
    assert_eq!(count(&scene.warnings, "materials with numbers that are not finite"), 1);
}

#[test]
fn objects_whose_transforms_are_not_finite_are_left_out_and_counted() {
    let folder = Folder::new();
    let whole = object_list(Layout::Cbo2014).0;
    let before = load_one(&folder.write("a.cbo", whole.clone())).unwrap();
    let place = before.objects[0].transform.to_cols_array();
    let bytes_of = |columns: [f32; 16]| columns.map(f32::to_le_bytes).concat();
    let at = whole.windows(64).position(|window| window == bytes_of(place)).expect("the first object's transform");
    for (index, value) in [(0, f32::INFINITY), (13, f32::NEG_INFINITY), (15, f32::NAN)] {
        let mut columns = place;
        columns[index] = value;
        let mut bytes = whole.clone();
        bytes[at..at + 64].copy_from_slice(&bytes_of(columns));
        let scene = load_one(&folder.write("b.cbo", bytes)).unwrap();
        assert_eq!(scene.objects.len() + 1, before.objects.len(), "{value} at {index}");
        assert_eq!(scene.files[0].objects as usize, scene.objects.len());
        assert_eq!(count(&scene.warnings, "objects whose transforms hold numbers that are not finite"), 1);
    }
}

#[test]
fn changed_and_cut_files_never_panic_and_never_break_a_reference() {
    let folder = Folder::new();
    let (mut loaded, mut refused) = (0, 0);
    for (name, bytes) in [
        ("list.cbo", object_list(Layout::Cbo2014).0),
        ("list.nbo", object_list(Layout::NboToday).0),
        ("tree.cbo", octree(Layout::Cbo2014).0),
        ("tree.nbo", octree(Layout::NboToday).0),
    ] {
        for bytes in mutations(&bytes, 500) {
            match load_capped(&folder.write(name, bytes)) {
                Ok(scene) => {
                    assert_references_are_valid(&scene);
                    loaded += 1;
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(loaded > 500 && refused > 500, "the changes reach both: {loaded} loaded, {refused} refused");
}
