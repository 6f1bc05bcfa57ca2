//! OBJ files and material libraries.

use crate::scene_support::{Folder, assert_references_are_valid, count, load_capped, load_one, mutations, triangles};
use curitiba_pipeline::scene::{
    BuildOptions, Layout, LoadOptions, Material, Needs, RenderScene, Scene, TextureSource, load, write_cbo,
};
use glam::{DVec3, Vec2, Vec3, Vec4};

fn obj(text: &str) -> Scene {
    let folder = Folder::new();
    load_one(&folder.write("a.obj", text)).unwrap()
}

/// Loads a material library with a triangle.
fn mtl(folder: &Folder, text: &str) -> Scene {
    folder.write("a.mtl", text);
    load_one(&folder.write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).unwrap()
}

fn named<'a>(scene: &'a Scene, name: &str) -> &'a Material {
    scene.materials.iter().find(|material| material.name == name).expect("the material")
}

/// All triangles of a scene as corner positions.
fn corners(scene: &Scene) -> Vec<[Vec3; 3]> {
    let of_mesh = |mesh: &curitiba_pipeline::scene::Mesh| {
        let triangles = mesh.groups.iter().flat_map(|group| &group.triangles);
        triangles.map(|triangle| triangle.map(|vertex| mesh.positions[vertex as usize])).collect::<Vec<_>>()
    };
    scene.objects.iter().flat_map(|object| of_mesh(&scene.meshes[object.mesh as usize])).collect()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn all_legal_spellings_of_a_face_give_the_same_triangles() {
    let expected = corners(&obj(&format!("{SQUARE}f 1 2 3\nf 1 3 4\n")));
    assert_eq!(expected.len(), 2);
    for face in [
        "f 1 2 3 4",
        "f\t1\t2 3  4",
        "f -4 -3 -2 -1",
        "f 1/1 2/1 3/1 4/1",
        "f 1//1 2//1 3//1 4//1",
        "f 1/-1/-1 2/1/1 3/1/1 4/1/1 # a comment",
        "f 1 2 \\\n3 4",
        "f 1 2 \\\r\n3 4\r",
        "fo 1 2 3 4",
    ] {
        let scene = obj(&format!("{SQUARE}vt 0.5\nvn 0 0 1\n{face}\n"));
        assert_eq!(corners(&scene), expected, "{face}");
        assert!(scene.warnings.is_empty(), "{face}: {:?}", scene.warnings.groups());
    }
    let tabs = obj("v\t0\t0\t0\r\nv 1 0 0 1.0\r\nv 1 1 0 0.5 0.5 0.5\r\nv 0 1 0\r\nf 1 2 3 4");
    assert_eq!(corners(&tabs), expected);
}

#[test]
fn texture_coordinates_and_normals_are_kept_as_written() {
    let scene = obj(&format!("{SQUARE}vt 0.25 0.75 9\nvt 2\nvn 0 0 -2\nf 1/1/1 2/2/1 3/1/1\n"));
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.texcoords, [Vec2::new(0.25, 0.75), Vec2::new(2.0, 0.0), Vec2::new(0.25, 0.75)]);
    assert_eq!(mesh.normals, [Vec3::new(0.0, 0.0, -2.0); 3]);
}

#[test]
fn faces_with_and_without_attributes_may_alternate() {
    let scene = obj(&format!("{SQUARE}vt 1 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1 3 4\nf 1//1 2//1 4//1\nf 2/1 3 4\n"));
    assert_references_are_valid(&scene);
    assert_eq!(triangles(&scene), 4);
    assert_eq!(scene.meshes.iter().filter(|mesh| mesh.normals.is_empty()).count(), 1);
}

#[test]
fn a_concave_quad_is_cut_at_its_inward_corner_and_harder_polygons_are_counted() {
    // An arrow head whose corner 4 is a reflex corner: a fan from corner 1 would have a triangle outside.
    let arrow = "v 0 0 0\nv 2 -2 0\nv 0 4 0\nv -2 -2 0\n";
    for face in ["f 1 2 3 4", "f 2 3 4 1", "f 4 1 2 3"] {
        let scene = obj(&format!("{arrow}{face}\n"));
        let areas: Vec<f32> = corners(&scene).iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).z).collect();
        assert_eq!(areas, [4.0, 4.0], "{face}: both triangles lie inside and face the same way");
        assert!(scene.warnings.is_empty());
    }
    let star = "v 0 3 0\nv 1 1 0\nv 3 0 0\nv 1 -1 0\nv 0 -3 0\nv -1 -1 0\nv -3 0 0\nv -1 1 0\nf 8 7 6 5 4 3 2 1\n";
    let scene = obj(star);
    assert_eq!(count(&scene.warnings, "polygons with several corners that point inwards"), 1);
    assert_eq!(triangles(&scene), 6);
}

#[test]
fn unusable_statements_are_counted_with_their_line_and_the_rest_is_loaded() {
    let text = format!(
        "{SQUARE}v nan 0 0\nv 1 2\nv 1e60 0 0\nvt inf 0\nvn 0 0 x\n\
         f 1 2 3\nf 1 2 5\nf 1 2 99\nf 1 2 0\nf 1 2 -99\nf 1 2\nf 1/1/1/4 2 3\nf a b c\nf 1 2 99999999999999999999\n\
         l 1 2\np 1\ncurv 0 1\nhello world\n\u{0}\u{1}\nf 1/7 2/7 3/7\nf 1 3 4\n"
    );
    let scene = obj(&text);
    assert_eq!(triangles(&scene), 2);
    for (what, expected) in [
        ("vertices that are not three finite numbers", 3),
        ("texture coordinates that are not finite numbers", 1),
        ("normals that are not three finite numbers", 1),
        ("faces with vertices that are not three finite numbers", 1),
        ("faces with indices out of range", 4),
        ("faces with fewer than three corners", 1),
        ("face corners that are not of the form v, v/vt, v//vn or v/vt/vn", 3),
        ("lines and points", 2),
        ("free-form curves and surfaces", 1),
        ("unknown statements", 2),
    ] {
        assert_eq!(count(&scene.warnings, what), expected, "{what}");
    }
    let group = scene.warnings.groups().iter().find(|group| group.what == "faces with indices out of range").unwrap();
    assert!(group.places[0].starts_with("line 12: "), "{}", group.places[0]);
    assert!(group.file.ends_with("a.obj"));
}

#[test]
fn groups_become_objects_and_materials_divide_them() {
    let folder = Folder::new();
    folder.write("my lib.mtl", "newmtl a\nKd 1 0 0\nnewmtl b b\nKd 0 1 0\n");
    let text = format!(
        "mtllib my lib.mtl\n{SQUARE}g one\nusemtl a\nf 1 2 3\nusemtl b b\nf 1 3 4\no two\nf 1 2 4\ng one\nusemtl a\nf 2 3 4\n"
    );
    let scene = load_one(&folder.write("a.obj", text)).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings.groups());
    assert_eq!(scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["one", "two"]);
    let one = &scene.meshes[0];
    assert_eq!(one.positions.len(), 4, "the materials share the corners");
    assert_eq!(one.groups.iter().map(|group| group.triangles.len()).collect::<Vec<_>>(), [2, 1]);
    assert_eq!(scene.materials[1].name, "b b");
}

#[test]
fn normals_are_smooth_across_materials_where_the_file_has_none() {
    // A valley: two rectangles that meet along the y axis, with an angle of 45 degrees between their normals.
    let text = "v 0 0 0\nv 0 1 0\nv 1 1 0\nv 1 0 0\nv -1 0 1\nv -1 1 1\nusemtl a\nf 1 4 3 2\nusemtl b\nf 1 2 6 5\n";
    let (built, _) = RenderScene::build(obj(text), &BuildOptions::default()).unwrap();
    let on_the_ridge = built.geometry.positions.iter().position(|p| *p == Vec3::ZERO).unwrap();
    let expected = (Vec3::Z + Vec3::new(1.0, 0.0, 1.0).normalize()).normalize();
    assert!(built.geometry.normals[on_the_ridge].distance(expected) < 1e-6);
}

#[test]
fn vertices_that_the_file_lists_twice_stay_apart_in_later_runs_too() {
    // After a face of another material: the valley with separate vertices for each side, so each side is flat.
    let text = "v 9 0 0\nv 9 1 0\nv 8 0 0\nusemtl a\nf 1 2 3\nusemtl b\n\
                v 0 0 0\nv 0 1 0\nv 1 1 0\nv 1 0 0\nf 4 7 6 5\nv 0 0 0\nv 0 1 0\nv -1 1 1\nv -1 0 1\nf 8 9 10 11\n";
    let (built, _) = RenderScene::build(obj(text), &BuildOptions::default()).unwrap();
    let geometry = &built.geometry;
    assert_eq!(geometry.positions.len(), 3 + 8);
    for (position, normal) in geometry.positions.iter().zip(&geometry.normals).filter(|(p, _)| p.x.abs() > 0.5) {
        let flat = if position.x < 0.0 { Vec3::new(1.0, 0.0, 1.0).normalize() } else { Vec3::Z };
        assert!(normal.distance(flat) < 1e-6 || position.x > 7.0, "{normal} at {position}");
    }
    for (position, normal) in geometry.positions.iter().zip(&geometry.normals).filter(|(p, _)| p.x == 0.0) {
        let flat = [Vec3::Z, Vec3::new(1.0, 0.0, 1.0).normalize()].map(|flat| normal.distance(flat) < 1e-6);
        assert!(flat.contains(&true), "{normal} at {position}");
    }
}

#[test]
fn files_without_triangles_are_counted() {
    let scene = obj("v 0 0 0\nv 1 0 0\nl 1 2\n");
    assert_eq!(count(&scene.warnings, "scenes without triangles"), 1);
    let group = scene.warnings.groups().iter().find(|group| group.what == "scenes without triangles").unwrap();
    assert!(group.file.ends_with("a.obj") && group.places[0].contains("a.obj"));
    assert_eq!(count(&obj(&format!("{SQUARE}f 1 2 3\n")).warnings, "scenes without triangles"), 0);
}

#[test]
fn what_is_not_needed_is_not_stored() {
    let folder = Folder::new();
    let path = folder.write("a.obj", format!("{SQUARE}vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\n"));
    let options = LoadOptions { needs: Needs::NOTHING, ..LoadOptions::default() };
    let scene = load(&[path], &options, &|_| {}).unwrap();
    assert!(scene.meshes[0].normals.is_empty() && scene.meshes[0].texcoords.is_empty());
    assert_eq!(triangles(&scene), 1);
}

#[test]
fn roughness_maps_of_glass_multiply_its_roughness() {
    let folder = Folder::new();
    folder.png("r.png", 1, 1, [128, 128, 128, 255]);
    let scene = mtl(
        &folder,
        "newmtl alone\nillum 7\nmap_Pr r.png\nnewmtl both\nillum 7\nPr 0.5\nmap_Pr r.png\nnewmtl paint\nPr 0.5\nmap_Pr r.png\n\
         newmtl lost\nillum 7\nPr 0.25\nmap_Pr none.png\nnewmtl turned\nillum 7\nPr 0.75\nmap_Kd r.png\nmap_Pr -s 2 2 2 r.png\n",
    );
    let rough = |name| (named(&scene, name).roughness, named(&scene, name).roughness_texture.is_some());
    assert_eq!((rough("alone"), rough("both")), ((1.0, true), (0.5, true)));
    assert_eq!([rough("paint"), rough("lost"), rough("turned")], [(0.5, false), (0.25, false), (0.75, false)]);
    assert!(scene.textures[named(&scene, "both").roughness_texture.unwrap() as usize].is_data(), "not decoded");
    for what in
        ["roughness maps that no program reads", "missing textures", "roughness textures with coordinates of their own"]
    {
        assert_eq!(count(&scene.warnings, what), 1, "{what}: {:?}", scene.warnings.groups());
    }
}

#[test]
fn material_statements_are_read_in_every_legal_form() {
    let folder = Folder::new();
    let scene = mtl(
        &folder,
        "newmtl full\r\n\tKd 0.1 0.2 0.3 # paint\n Ka 0.5\nKs 1 1 1\nKe 17 12 4\nNs 250\nNi 1.33\nd 0.25\nillum 2\n\
         newmtl gray\nKd 0.5\nd -halo 0.75\nillum 2.0\nTr 0.9\n\
         newmtl glass\nKd 0 0 0\nillum 4\nd 0.6\nTf 0.4 0.3 0.2\n\
         newmtl clear\nillum 7\nNi 0.2\nnewmtl mirror\nillum 5\nTf 1 1 1\nnewmtl seen\nTr 0.75\nnewmtl exported\nTf 1 1 1\nTr 0\nillum 2\n\
         newmtl body\nillum 6\nNi 1.5\nTf 0.25 0.49 1\nPr 0.3\n",
    );
    let warnings: Vec<String> = scene.warnings.groups().iter().map(ToString::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("that mirror"), "{warnings:?}");
    let full = named(&scene, "full");
    assert_eq!(full.diffuse, Vec4::new(0.1, 0.2, 0.3, 0.25));
    assert_eq!(full.ambient, Vec4::new(0.5, 0.5, 0.5, 1.0));
    assert_eq!(full.emission, Vec4::new(17.0, 12.0, 4.0, 1.0));
    assert_eq!((full.shininess, full.ior, full.transmission), (250.0, 1.33, 0.75));
    let gray = named(&scene, "gray");
    assert_eq!(gray.diffuse, Vec4::new(0.5, 0.5, 0.5, 0.75));
    assert_eq!(named(&scene, "glass").transmission, 0.4);
    assert_eq!((named(&scene, "body").roughness, named(&scene, "clear").roughness), (0.3, 0.0));
    assert_eq!((named(&scene, "clear").transmission, named(&scene, "clear").ior), (1.0, 1.5));
    assert_eq!(named(&scene, "mirror").transmission, 0.0);
    assert_eq!(named(&scene, "seen").transmission, 0.75);
    assert_eq!(named(&scene, "exported").transmission, 0.0);
    // The material as glass: whether it has a volume, its filter per surface, and the share of light that it scatters back.
    let glass = |name| {
        let material = named(&scene, name);
        (material.volume, material.filter, material.veil)
    };
    assert_eq!(glass("glass"), (false, Vec3::new(0.4, 0.3, 0.2), 0.0));
    assert_eq!(glass("clear"), (true, Vec3::ONE, 0.0));
    assert_eq!(glass("seen"), (false, Vec3::ONE, 0.25));
    let (volume, filter, veil) = glass("body");
    assert!(volume && filter.distance(Vec3::new(0.5, 0.7, 1.0)) < 1e-6 && veil == 0.0, "{filter} {veil}");
}

#[test]
fn materials_that_tr_would_make_invisible_are_opaque_and_named() {
    let folder = Folder::new();
    let scene = mtl(
        &folder,
        "newmtl exported\nKd 1 1 1\nTr 1.0\nillum 1\nnewmtl hidden\nTr 1\nd 0\nnewmtl pane\nTr 1\nillum 7\nnewmtl nearly\nTr 0.99\n",
    );
    let transmission = |name| named(&scene, name).transmission;
    assert_eq!(["exported", "hidden", "pane"].map(transmission), [0.0, 1.0, 1.0]);
    assert!((transmission("nearly") - 0.99).abs() < 1e-6);
    assert_eq!(count(&scene.warnings, "materials that `Tr 1` would make invisible"), 1);
}

#[test]
fn unusable_material_statements_are_counted() {
    let folder = Folder::new();
    let scene = mtl(
        &folder,
        "Kd 1 1 1\nnewmtl a\nKd spectral a.rfl 1\nKa xyz 1 1 1\nKs 1 2\nNs x\nd\nKe nan 0 0\nfoo 1\nmap_bump b.png\n\
         map_d c.png\nmap_Kd nowhere.png\nmap_Kd -s 2 2 1\nnewmtl a\nKd 0 0 0\n\u{FFFD}\n",
    );
    for (what, expected) in [
        ("material statements before the first newmtl", 1),
        ("material statements with values that cannot be read", 7),
        ("unknown material statements", 2),
        ("texture maps that no program reads", 1),
        ("missing textures", 2),
        ("materials declared twice", 1),
    ] {
        assert_eq!(count(&scene.warnings, what), expected, "{what}: {:?}", scene.warnings.groups());
    }
    assert_eq!(named(&scene, "a").diffuse, Material::default().diffuse);
}

#[test]
fn map_options_names_with_blanks_and_backslashes_are_understood() {
    let folder = Folder::new();
    folder.png("maps/old wall.png", 1, 1, [1, 1, 1, 255]);
    folder.png("mask.png", 1, 1, [1, 1, 1, 255]);
    let text = "newmtl a\nmap_Kd -blendu on -mm 0 1 -s 2 3 -o 0.5 -bm 1.0 maps\\Old Wall.png\nmap_d -imfchan m mask.png\n\
                newmtl b\nmap_Kd maps/old wall.png\nmap_d maps/old wall.png\n";
    folder.write("a.mtl", text);
    let faces = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1 1\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 3/1 2/1 1/1\n";
    let scene = load_one(&folder.write("a.obj", faces)).unwrap();
    let wall = folder.path("maps/old wall.png");
    assert!(matches!(
        &scene.textures[named(&scene, "a").texture.unwrap() as usize],
        TextureSource::Masked { color, mask } if *color == wall && *mask == folder.path("mask.png")
    ));
    let plain = named(&scene, "b");
    assert_eq!(scene.textures[plain.texture.unwrap() as usize], TextureSource::File(wall));
    assert_eq!(plain.alpha_cutoff, Some(0.5));
    let mesh = &scene.meshes[0];
    let texcoord = |group: usize| mesh.texcoords[mesh.groups[group].triangles[0][0] as usize];
    assert_eq!(texcoord(0), Vec2::new(2.5, 3.0), "scaled and moved");
    assert_eq!(texcoord(1), Vec2::ONE);
    assert_eq!(count(&scene.warnings, "texture paths with other letter case"), 1);
}

#[test]
fn holes_of_a_colour_texture_cut_out_unless_the_material_is_glass_or_has_a_mask_of_its_own() {
    let folder = Folder::new();
    folder.png("leaf.png", 2, 2, [9, 99, 9, 0]);
    folder.png("haze.png", 2, 2, [9, 99, 9, 200]);
    folder.png("mask.png", 2, 2, [255, 255, 255, 255]);
    let text = "newmtl leaf\nmap_Kd leaf.png\nnewmtl twin\nmap_Kd leaf.png\nnewmtl haze\nmap_Kd haze.png\n\
                newmtl glass\nillum 4\nmap_Kd leaf.png\nnewmtl masked\nmap_Kd leaf.png\nmap_d mask.png\n";
    folder.write("a.mtl", text);
    let uses =
        ["leaf", "twin", "haze", "glass", "masked"].map(|name| format!("usemtl {name}\nf 1/1/1/ 2/1/1/ 3/1/1/\n"));
    let faces = format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1 1\nvn 0 0 1\n{}", uses.concat());
    let scene = load_one(&folder.write("a.obj", faces)).unwrap();
    assert_eq!(triangles(&scene), 5, "a slash at the end of a corner means nothing");
    let cutoffs = ["leaf", "twin", "haze", "glass", "masked"].map(|name| named(&scene, name).alpha_cutoff);
    assert_eq!(cutoffs, [Some(0.5), Some(0.5), None, None, Some(0.5)]);
    assert!(matches!(
        &scene.textures[named(&scene, "masked").texture.unwrap() as usize],
        TextureSource::Masked { mask, .. } if *mask == folder.path("mask.png")
    ));
    let broken = load_one(&folder.write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1//// 2//// 3////\nf 1/1/1/1 2 3\n"));
    assert_eq!(triangles(&broken.unwrap()), 0, "but neither two nor a fourth field");
}

/// A material that `map_d` or `d` declares as blended follows glTF's rule for `BLEND`. If its texture is half clear over areas, each texel
/// transmits light by its alpha; any other texture is cut out.
#[test]
fn masks_that_are_half_clear_over_areas_are_seen_through_and_others_are_cut() {
    let folder = Folder::new();
    folder.png("wall.png", 2, 2, [9, 99, 9, 255]);
    folder.png("smoke.png", 2, 2, [102, 102, 102, 255]);
    folder.png("haze.png", 2, 2, [9, 99, 9, 102]);
    folder.png("solid.png", 2, 2, [255, 255, 255, 255]);
    let names = ["smoke", "haze", "thin", "cut", "even", "alpha", "glass"];
    let text = "newmtl smoke\nmap_Kd wall.png\nmap_d smoke.png\nnewmtl haze\nmap_Kd haze.png\nmap_d haze.png\n\
                newmtl thin\nd 0.5\nmap_Kd wall.png\nmap_d smoke.png\nnewmtl cut\nmap_Kd wall.png\nmap_d solid.png\n\
                newmtl even\nd 0.5\nmap_Kd haze.png\nnewmtl alpha\nmap_Kd haze.png\n\
                newmtl glass\nillum 4\nmap_Kd wall.png\nmap_d smoke.png\n";
    folder.write("a.mtl", text);
    let uses: String = names.iter().map(|name| format!("usemtl {name}\nf 1/1 2/1 3/1\n")).collect();
    let path = folder.write("a.obj", format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1 1\n{uses}"));
    let read = |needs: Needs| {
        load(std::slice::from_ref(&path), &LoadOptions { needs, ..LoadOptions::default() }, &|_| {}).expect("it loads")
    };
    let scene = read(Needs::ALL);
    // The opacity factor of the transmission texture, if there is one.
    let clear = |name: &str| {
        named(&scene, name).transmission_texture.map(|texture| match scene.textures[texture as usize].clone() {
            TextureSource::Data { source } => match *source {
                TextureSource::Clear { opacity, .. } => opacity,
                other => panic!("{other:?}"),
            },
            other => panic!("{other:?}"),
        })
    };
    let half = 32_768;
    let found = names.map(|name| (clear(name), named(&scene, name).alpha_cutoff.map(|cutoff| cutoff > 0.1)));
    let seen_through = |opacity| (Some(opacity), Some(false));
    let (cut, whole) = ((None, Some(true)), (None, None));
    // `alpha` has no `d`, so its texture's alpha of 0.4 makes a hole. Glass is cut out only if it has a mask.
    assert_eq!(
        found,
        [seen_through(65_535), seen_through(65_535), seen_through(half), cut, seen_through(half), cut, cut]
    );
    assert_ne!(whole, cut);
    for name in ["smoke", "haze", "thin", "even"] {
        let material = named(&scene, name);
        assert_eq!(
            (material.transmission, material.veil, material.ior, material.volume),
            (1.0, 0.0, 1.0, false),
            "{name}"
        );
    }
    assert_eq!(count(&scene.warnings, "materials that are blended texel by texel"), 0);

    // If no pass asks for the glass materials, they are cut out and transmit light by their mean alpha. A load without textures finds the
    // same mean.
    let unasked = read(Needs { glass_maps: false, ..Needs::ALL });
    assert_eq!(count(&unasked.warnings, "materials that are blended texel by texel"), 4);
    for scene in [unasked, read(Needs::NOTHING)] {
        for (name, mean) in [("smoke", 0.4), ("haze", 0.4), ("thin", 0.2), ("even", 0.2)] {
            let material = named(&scene, name);
            assert!((material.transmission - (1.0 - mean)).abs() < 0.003, "{name}: {}", material.transmission);
            assert_eq!(material.transmission_texture, None, "{name}");
        }
        assert_eq!(named(&scene, "cut").transmission, 0.0);
    }
}

#[test]
fn a_missing_library_and_undeclared_materials_are_warnings() {
    let scene = obj(
        "mtllib no.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl stone\nf 1 2 3\nusemtl wood\nf 1 2 3\nusemtl stone\nf 1 2 3",
    );
    assert_eq!(count(&scene.warnings, "missing material libraries"), 1);
    assert_eq!(count(&scene.warnings, "materials that are used but not declared"), 2);
    assert_eq!(triangles(&scene), 3);
}

#[test]
fn a_library_that_is_named_again_and_again_is_read_once() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl wall\nKd 1 0 0\n");
    let named = "mtllib a.mtl\nmtllib a.mtl a.mtl\nmtllib ./a.mtl\nmtllib none.mtl\n".repeat(20_000);
    let scene = load_one(&folder.write("a.obj", named + "usemtl wall\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).unwrap();
    assert_eq!(scene.materials[0].diffuse, Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert_eq!(count(&scene.warnings, "missing material libraries"), 1);
    // `a.mtl` and `./a.mtl` are two paths of the same file.
    assert!(count(&scene.warnings, "materials declared twice") <= 1);
}

#[test]
fn several_files_share_equal_materials_and_the_first_of_different_ones_wins() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl same\nKd 1 0 0\nnewmtl other\nKd 0 1 0\n");
    folder.write("b.mtl", "newmtl same\nKd 1 0 0\nnewmtl other\nKd 0 0 1\nnewmtl third\nKd 0 0 0\n");
    let faces = |library: &str| format!("mtllib {library}\n{SQUARE}usemtl same\nf 1 2 3\nusemtl other\nf 1 3 4\n");
    let files = [folder.write("a.obj", faces("a.mtl")), folder.write("b.obj", faces("b.mtl"))];
    let seen = std::cell::RefCell::new(Vec::new());
    let scene = load(&files, &LoadOptions::default(), &|progress| seen.borrow_mut().push(progress.bytes_done)).unwrap();
    assert_eq!(seen.borrow().len(), 2);
    assert_references_are_valid(&scene);
    assert_eq!(scene.materials.len(), 3);
    assert_eq!(named(&scene, "other").diffuse, Vec4::new(0.0, 1.0, 0.0, 1.0));
    let what = "materials that an earlier file declares otherwise";
    assert_eq!(count(&scene.warnings, what), 1);
    assert_eq!(scene.files.len(), 2);
    assert_eq!(curitiba_pipeline::scene::statistics(&scene).files[1].triangles, 2);
}

#[test]
fn files_of_no_known_format_and_missing_files_are_errors_that_say_what_is_valid() {
    let folder = Folder::new();
    let error = load_one(&folder.write("a.stl", "solid")).unwrap_err().to_string();
    assert!(error.contains(".cbo, .nbo, .obj, .gltf, .glb, .3ds, .dae, .mesh.xml"), "{error}");
    let error = load_one(&folder.path("none.obj")).unwrap_err().to_string();
    assert!(error.contains("none.obj") && error.contains("no such file"), "{error}");
    folder.write("Modelo.OBJ", format!("{SQUARE}f 1 2 3"));
    let scene = load_one(&folder.path("modelo.obj")).unwrap();
    assert_eq!(count(&scene.warnings, "paths with other letter case"), 1);
}

#[test]
fn the_memory_cap_stops_a_long_file() {
    let mut text = SQUARE.to_owned();
    text.push_str(&"f 1 2 3\n".repeat(100_000));
    let folder = Folder::new();
    let path = folder.write("long.obj", text);
    let error = load(&[path], &LoadOptions { max_bytes: 2 << 20, ..LoadOptions::default() }, &|_| {}).unwrap_err();
    assert!(error.to_string().contains("--max-memory"), "{error}");
}

#[test]
fn changed_and_cut_files_never_panic_and_never_stop_the_load() {
    let folder = Folder::new();
    let obj = "mtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0\nv\t1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1 \\\n 4/1/1\n\
               g rest\nusemtl b\nf -4//-1 -3//-1 -2//-1\nl 1 2\nf 1 2 3 4\n";
    let mtl = "newmtl a\nKd 0.5 0.5 0.5\nd -halo 0.5\nTf 1 1 1\nillum 4\nmap_Kd -s 1 2 3 -bm 1 w.png\nmap_d w.png\nnewmtl b\nKe 1\nNs 10\n";
    folder.write("a.mtl", mtl);
    for bytes in mutations(obj.as_bytes(), 1000) {
        assert_references_are_valid(&load_capped(&folder.write("m.obj", bytes)).unwrap());
    }
    let path = folder.write("a.obj", obj);
    for bytes in mutations(mtl.as_bytes(), 1000) {
        folder.write("a.mtl", bytes);
        assert_references_are_valid(&load_capped(&path).unwrap());
    }
}

/// A building in map coordinates; rounding to `f32` would move it by 0.12 units.
const FAR: [[f64; 3]; 4] = [
    [554_321.123, 12.25, 5_812_345.678],
    [554_327.456, 12.5, 5_812_345.012],
    [554_329.789, 19.125, 5_812_349.345],
    [554_320.015_625, 12.75, 5_812_351.501],
];

#[test]
fn files_far_from_their_origin_keep_their_digits() {
    let folder = Folder::new();
    let lines: String = FAR.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let file = folder.write("far.obj", format!("{lines}f 1 2 3 4\n"));
    let scene = load_one(&file).unwrap();
    assert_ne!(scene.origin, DVec3::ZERO);
    let exact = |corner: usize| DVec3::from(FAR[corner]);
    let worst = |built: &RenderScene| {
        let positions = built.geometry.positions.iter().enumerate();
        positions.map(|(i, p)| (p.as_dvec3() + built.origin).distance(exact(i))).fold(0.0, f64::max)
    };
    let build = |scene: &Scene, origin| {
        let options = BuildOptions { origin, ..BuildOptions::default() };
        RenderScene::build(scene.clone(), &options).unwrap().0
    };
    // In map coordinates, adjacent `f32` values are half a unit apart; relative to the nearby origin, half a millionth.
    let (world, near) = (build(&scene, Some(DVec3::ZERO)), build(&scene, None));
    assert_eq!((world.origin, near.origin), (DVec3::ZERO, scene.origin));
    assert!((0.05..0.5).contains(&worst(&world)), "{}", worst(&world));
    assert!(worst(&near) < 2e-6, "{}", worst(&near));
    // Positions in world coordinates are rounded only once.
    for (i, position) in world.geometry.positions.iter().enumerate() {
        assert!(position.as_dvec3().distance(exact(i)) <= exact(i).as_vec3().as_dvec3().distance(exact(i)) + 1e-5);
    }
    // A given origin is used, and converted files keep their origin.
    let elsewhere = build(&scene, Some(scene.origin + 32.0));
    assert!(elsewhere.origin != near.origin && worst(&elsewhere) < 8e-6);
    let copy = folder.path("far.nbo");
    write_cbo(&scene, &copy, Layout::NboToday).unwrap();
    assert!(worst(&build(&load_one(&copy).unwrap(), None)) < 2e-6);
    // The first of several files determines the common origin.
    let near_it = folder.write("near.obj", "v 554300 0 5812300\nv 554301 0 5812300\nv 554300 1 5812300\nf 1 2 3\n");
    let both = load(&[file, near_it], &LoadOptions::default(), &|_| {}).unwrap();
    assert_eq!(both.origin, scene.origin);
    let second = both.to_world(&both.objects[1]).transform_point3(both.meshes[1].positions[1].as_dvec3());
    assert_eq!(second, DVec3::new(554_301.0, 0.0, 5_812_300.0));
}

#[test]
fn files_near_their_origin_have_the_numbers_that_they_had() {
    let scene = obj("v 100.1 0 0\nv 101.2 30 0\nv 100.3 0 9.9\nf 1 2 3\n");
    assert_eq!(scene.origin, DVec3::ZERO);
    assert_eq!(scene.meshes[0].positions[1], Vec3::new(101.2, 30.0, 0.0));
    let (built, _) = RenderScene::build(scene, &BuildOptions { origin: None, ..BuildOptions::default() }).unwrap();
    assert_eq!((built.origin, built.geometry.positions[1]), (DVec3::ZERO, Vec3::new(101.2, 30.0, 0.0)));
}

/// A file name in bytes that are not UTF-8 finds a library whose name is the same text in UTF-8, or has the same bytes. This also holds
/// for textures.
#[test]
fn libraries_and_textures_are_found_by_names_in_latin_1() {
    let triangle = b"\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wall\nf 1 2 3\n";
    let library = b"newmtl wall\nKd 0.5 0.25 0.125\nmap_Kd \xC1gua.png\n";
    let names: &[&std::ffi::OsStr] = &[
        "Água".as_ref(),
        #[cfg(unix)]
        std::os::unix::ffi::OsStrExt::from_bytes(b"\xC1gua"),
    ];
    for name in names {
        let folder = Folder::new();
        let named = |end: &str| {
            let mut name = name.to_os_string();
            name.push(end);
            folder.path("").join(name)
        };
        std::fs::write(named(".mtl"), library).unwrap();
        std::fs::rename(folder.png("t.png", 1, 1, [1, 2, 3, 255]), named(".png")).unwrap();
        let scene = load_one(&folder.write("a.obj", [b"mtllib \xC1gua.mtl", &triangle[..]].concat())).unwrap();
        assert_eq!(scene.materials[0].diffuse.truncate(), Vec3::new(0.5, 0.25, 0.125), "{name:?}");
        assert_eq!(scene.textures, [TextureSource::File(named(".png"))]);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings.groups());
        let scene = load_one(&folder.write("a.obj", [b"mtllib \xC2gua.mtl", &triangle[..]].concat())).unwrap();
        assert_eq!(count(&scene.warnings, "missing material libraries"), 1, "another letter");
    }
}
