//! Building render scenes.

use crate::scene_support::{Folder, count};
use curitiba_pipeline::color::{BRIGHTEST, ColorSpace};
use curitiba_pipeline::scene::{
    BuildOptions, Group, Material, Mesh, Needs, Object, RenderScene, Scene, TextureSource, statistics,
};
use glam::{DVec3, Mat4, Quat, Vec2, Vec3, Vec4};

fn material(name: &str) -> Material {
    Material { name: name.to_owned(), ..Material::default() }
}

fn object(mesh: u32, transform: Mat4) -> Object {
    Object { name: format!("object of {mesh}"), mesh, transform }
}

/// A unit right triangle in the xy plane.
fn triangle(material: u32) -> Mesh {
    Mesh {
        name: "triangle".to_owned(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        groups: vec![Group { material, triangles: vec![[0, 1, 2]] }],
        ..Mesh::default()
    }
}

/// The box [-1, 1]³ with eight shared vertices.
fn cube() -> Mesh {
    let positions =
        (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - Vec3::ONE).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    Mesh { name: "cube".to_owned(), positions, groups: vec![Group { material: 0, triangles }], ..Mesh::default() }
}

fn scene(meshes: Vec<Mesh>, objects: Vec<Object>, materials: usize) -> Scene {
    let materials = (0..materials).map(|i| material(&format!("m{i}"))).collect();
    Scene { meshes, objects, materials, ..Scene::default() }
}

fn assert_invariants(scene: &RenderScene, needs: Needs) {
    let geometry = &scene.geometry;
    let vertices = geometry.positions.len();
    assert!(geometry.positions.iter().all(|p| p.is_finite()));
    assert_eq!(geometry.normals.len(), if needs.normals { vertices } else { 0 });
    assert_eq!(geometry.texcoords.len(), if needs.textures { vertices } else { 0 });
    assert!(geometry.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    for id in 0..geometry.triangles.len() as u32 {
        let [a, b, c] = geometry.corners(id).map(|p| p.as_dvec3());
        assert!((b - a).cross(c - a).length() > 0.0, "triangle {id} has no area");
        assert!((geometry.material_of(id) as usize) < scene.materials.len());
    }
    let mut next = 0;
    for pair in geometry.batches.windows(2) {
        assert!(pair[0].material < pair[1].material, "batches ascend");
    }
    for batch in &geometry.batches {
        assert_eq!(batch.first, next);
        assert!(batch.count > 0);
        next += batch.count;
    }
    assert_eq!(next as usize, geometry.triangles.len());
}

fn build(scene: Scene, options: &BuildOptions) -> (RenderScene, curitiba_pipeline::diagnostic::Warnings) {
    let (built, warnings) = RenderScene::build(scene, options).unwrap();
    assert_invariants(&built, options.needs);
    (built, warnings)
}

#[test]
fn triangles_are_sorted_by_material_and_keep_their_order_within_one() {
    let mut two_groups = triangle(1);
    two_groups.positions.push(Vec3::Z);
    two_groups.groups.push(Group { material: 0, triangles: vec![[0, 1, 3], [0, 2, 3]] });
    let objects = vec![object(0, Mat4::IDENTITY), object(1, Mat4::from_translation(Vec3::splat(5.0)))];
    let (built, warnings) = build(scene(vec![two_groups, triangle(1)], objects, 2), &BuildOptions::default());
    assert!(warnings.is_empty());
    let geometry = &built.geometry;
    assert_eq!(
        geometry.batches.iter().map(|b| (b.material, b.first, b.count)).collect::<Vec<_>>(),
        [(0, 0, 2), (1, 2, 2)]
    );
    assert_eq!(geometry.corners(0), [Vec3::ZERO, Vec3::X, Vec3::Z]);
    assert_eq!(geometry.corners(1), [Vec3::ZERO, Vec3::Y, Vec3::Z]);
    assert_eq!(geometry.corners(2), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(geometry.corners(3)[0], Vec3::splat(5.0));
}

#[test]
fn a_mesh_placed_twice_gives_two_copies_of_its_triangles() {
    let objects = vec![object(0, Mat4::IDENTITY), object(0, Mat4::from_translation(Vec3::Z))];
    let scene = scene(vec![triangle(0)], objects, 1);
    let counted = statistics(&scene);
    assert_eq!((counted.meshes, counted.objects, counted.triangles, counted.vertices), (1, 2, 2, 6));
    assert_eq!(counted.bounds, Some([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]));
    let (built, _) = build(scene, &BuildOptions::default());
    assert_eq!(built.geometry.corners(0), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(built.geometry.corners(1), [Vec3::Z, Vec3::X + Vec3::Z, Vec3::Y + Vec3::Z]);
}

#[test]
fn unusable_triangles_are_counted_by_kind_with_their_object_and_the_rest_stays() {
    let mut mesh = triangle(0);
    mesh.positions.extend([Vec3::new(f32::NAN, 0.0, 0.0), Vec3::new(2.0, 0.0, 0.0), Vec3::Z]);
    mesh.groups[0].triangles = vec![[0, 1, 9], [0, 1, 3], [0, 1, 1], [0, 1, 4], [0, 1, 2], [u32::MAX, 0, 1]];
    let objects = vec![object(0, Mat4::IDENTITY)];
    let (built, warnings) = build(scene(vec![mesh], objects, 1), &BuildOptions::default());
    assert_eq!(count(&warnings, "triangles with vertex indices out of range"), 2);
    assert_eq!(count(&warnings, "triangles with corners that are not finite"), 1);
    assert_eq!(count(&warnings, "triangles without area"), 2);
    assert_eq!(warnings.groups()[0].places[0], "triangle 0 in group 0 of `object of 0`");
    assert_eq!(built.geometry.triangles, [[0, 1, 2]]);
    assert_eq!(built.geometry.positions.len(), 3, "vertices that nothing uses are dropped");
}

#[test]
fn a_transform_that_flattens_leaves_no_triangle() {
    let flat = Mat4::from_scale(Vec3::new(1.0, 0.0, 0.0));
    let (built, warnings) = build(scene(vec![cube()], vec![object(0, flat)], 1), &BuildOptions::default());
    assert_eq!(count(&warnings, "triangles without area"), 12);
    assert!(built.geometry.triangles.is_empty() && built.geometry.batches.is_empty());
}

#[test]
fn computed_normals_of_a_cube_are_those_of_its_faces() {
    let (built, _) = build(scene(vec![cube()], vec![object(0, Mat4::IDENTITY)], 1), &BuildOptions::default());
    let geometry = &built.geometry;
    assert_eq!(geometry.positions.len(), 24, "each corner is split in three");
    for (id, triangle) in geometry.triangles.iter().enumerate() {
        let [a, b, c] = geometry.corners(id as u32);
        let face = (b - a).cross(c - a).normalize();
        assert!(triangle.iter().all(|vertex| geometry.normals[*vertex as usize].distance(face) < 1e-6), "{id}");
    }
}

/// A fan of `sides` faces around the apex of a pyramid; faces are inclined by `slope` radians.
fn pyramid(sides: u32, slope: f32) -> Mesh {
    let rim = (0..sides).map(|i| {
        let (sin, cos) = (i as f32 * std::f32::consts::TAU / sides as f32).sin_cos();
        Vec3::new(cos, sin, -slope.tan())
    });
    let triangles = (0..sides).map(|i| [0, 1 + i, 1 + (i + 1) % sides]).collect();
    Mesh {
        positions: std::iter::once(Vec3::ZERO).chain(rim).collect(),
        groups: vec![Group { material: 0, triangles }],
        ..Mesh::default()
    }
}

#[test]
fn computed_normals_are_smooth_below_the_crease_angle_and_weighted_by_angle() {
    // In a fine fan the angle between adjacent faces is small, though opposite faces meet at far more than 60 degrees.
    let fan = |sides| {
        let scene = scene(vec![pyramid(sides, 1.0)], vec![object(0, Mat4::IDENTITY)], 1);
        build(scene, &BuildOptions::default()).0.geometry
    };
    let smooth = fan(40);
    assert_eq!(smooth.positions.len(), 41);
    assert!(smooth.normals[0].distance(Vec3::Z) < 1e-5, "{}", smooth.normals[0]);
    // With three sides adjacent faces meet at more than 60 degrees: each face has its own corners.
    assert_eq!(fan(3).positions.len(), 9);
}

#[test]
fn normals_follow_the_inverse_transpose_also_through_mirrors() {
    // A plane x + y = const, scaled twofold along x: its normal becomes parallel to (1, 2, 0).
    let mut mesh = triangle(0);
    mesh.positions = vec![Vec3::X, Vec3::Y, Vec3::X + Vec3::Z];
    mesh.normals = vec![Vec3::new(3.0, 3.0, 0.0); 3];
    for (scale, expected) in [
        (Vec3::new(2.0, 1.0, 1.0), Vec3::new(1.0, 2.0, 0.0)),
        (Vec3::new(-2.0, 1.0, 1.0), Vec3::new(-1.0, 2.0, 0.0)),
        (Vec3::splat(1e-25), Vec3::new(1.0, 1.0, 0.0)),
    ] {
        let transform = Mat4::from_scale(scale);
        // At the smallest scale the triangle has no area and is dropped; the test is that nothing panics.
        let (built, _) = build(scene(vec![mesh.clone()], vec![object(0, transform)], 1), &BuildOptions::default());
        for normal in &built.geometry.normals {
            assert!(normal.distance(expected.normalize()) < 1e-6, "{normal} for {scale}");
        }
    }
    let turned = Mat4::from_quat(Quat::from_rotation_z(1.0));
    let in_model_space = BuildOptions { model_space_normals: true, ..BuildOptions::default() };
    let (built, _) = build(scene(vec![mesh], vec![object(0, turned)], 1), &in_model_space);
    assert!(built.geometry.normals[0].distance(Vec3::new(1.0, 1.0, 0.0).normalize()) < 1e-6);
}

#[test]
fn normals_without_direction_are_replaced_and_counted() {
    let mut mesh = triangle(0);
    mesh.normals = vec![Vec3::ZERO, Vec3::NAN, Vec3::new(0.0, 0.0, -1e-30)];
    let (built, warnings) = build(scene(vec![mesh], vec![object(0, Mat4::IDENTITY)], 1), &BuildOptions::default());
    assert_eq!(count(&warnings, "meshes with normals that have no direction"), 1);
    assert_eq!(built.geometry.normals, [Vec3::Z, Vec3::Z, Vec3::NEG_Z]);
}

#[test]
fn swap_yz_turns_a_model_with_z_up_and_unitize_fits_it_into_the_unit_box() {
    let mut mesh = triangle(0);
    mesh.positions = vec![Vec3::ZERO, Vec3::new(0.0, 0.0, 8.0), Vec3::new(0.0, 2.0, 0.0)];
    mesh.normals = vec![Vec3::Y; 3];
    let scene = scene(vec![mesh], vec![object(0, Mat4::IDENTITY)], 1);
    let swapped = BuildOptions { swap_yz: true, ..BuildOptions::default() };
    let (built, _) = build(scene.clone(), &swapped);
    assert_eq!(built.geometry.positions, [Vec3::ZERO, Vec3::new(0.0, 8.0, 0.0), Vec3::new(0.0, 0.0, -2.0)]);
    assert_eq!(built.geometry.normals[0], Vec3::NEG_Z);
    let both = BuildOptions { unitize: true, ..swapped };
    let (built, _) = build(scene, &both);
    assert_eq!(
        built.geometry.positions,
        [Vec3::new(0.0, -1.0, 0.25), Vec3::new(0.0, 1.0, 0.25), Vec3::new(0.0, -1.0, -0.25)]
    );
}

#[test]
fn meshes_without_colours_are_white_beside_others_and_creases_keep_the_colours_of_their_corners() {
    let mut cube = cube();
    cube.colors = cube.positions.iter().map(|at| (0.5 * *at + 0.5).extend(1.0)).collect();
    let mut plain = triangle(1);
    plain.name = "plain".to_owned();
    let objects = vec![object(0, Mat4::IDENTITY), object(1, Mat4::from_translation(Vec3::X * 9.0))];
    let (built, _) = build(scene(vec![cube, plain], objects, 2), &BuildOptions::default());
    assert_eq!(built.geometry.positions.len(), 24 + 3, "the cube's corners are split");
    assert_eq!(built.geometry.colors.len(), 24 + 3);
    for (at, color) in built.geometry.positions.iter().zip(&built.geometry.colors) {
        let expected = if at.x > 2.0 { Vec3::ONE } else { 0.5 * *at + 0.5 };
        assert_eq!(*color, expected.extend(1.0), "at {at}");
    }
    assert_eq!(built.materials.iter().map(|m| m.vertex_colors).collect::<Vec<_>>(), [true, false]);
    // Scenes with and without vertex colours are joined.
    let (bare, _) = build(scene(vec![triangle(0)], vec![object(0, Mat4::IDENTITY)], 1), &BuildOptions::default());
    assert!(bare.geometry.colors.is_empty());
    let mut both = bare.clone();
    both.append(built.clone());
    both.append(bare);
    assert_eq!(both.geometry.colors.len(), both.geometry.positions.len());
    assert_eq!(both.geometry.colors[3..30], built.geometry.colors[..]);
    assert!(both.geometry.colors[..3].iter().chain(&both.geometry.colors[30..]).all(|color| *color == Vec4::ONE));
}

#[test]
fn what_passes_do_not_need_is_left_empty() {
    let mut mesh = triangle(0);
    mesh.texcoords = vec![Vec2::splat(f32::NAN); 3];
    let scene = scene(vec![mesh], vec![object(0, Mat4::IDENTITY)], 1);
    let nothing = BuildOptions { needs: Needs::NOTHING, ..BuildOptions::default() };
    let (built, warnings) = build(scene.clone(), &nothing);
    assert!(built.geometry.normals.is_empty() && warnings.is_empty());
    let (built, warnings) = build(scene, &BuildOptions::default());
    assert_eq!(built.geometry.texcoords, [Vec2::ZERO; 3]);
    assert_eq!(count(&warnings, "meshes with texture coordinates that are not finite"), 1);
}

#[test]
fn colours_above_what_arithmetic_bears_are_lowered_and_counted() {
    let mut bright =
        scene(vec![triangle(0), triangle(1)], vec![object(0, Mat4::IDENTITY), object(1, Mat4::IDENTITY)], 2);
    bright.materials[0].emission = Vec4::new(3.4e38, f32::INFINITY, -1e30, 1.0);
    bright.materials[1].diffuse = Vec4::new(1e9, 0.5, -1e9, 1.0);
    for color in [ColorSpace::Report, ColorSpace::Linear] {
        let (built, warnings) = build(bright.clone(), &BuildOptions { color, ..BuildOptions::default() });
        assert_eq!(count(&warnings, "materials with a colour above 1e9"), 1);
        let lowered = Vec4::new(BRIGHTEST, BRIGHTEST, -BRIGHTEST, 1.0);
        assert_eq!(built.materials[0].emission, color.of_display(lowered));
        let lit = built.materials[1].diffuse * BRIGHTEST;
        assert!(lit.is_finite(), "{color}: {lit}");
        assert_eq!(built.materials[1].diffuse, color.of_display(bright.materials[1].diffuse));
    }
}

#[test]
fn only_textures_in_use_are_decoded_and_undecodable_ones_are_named() {
    let folder = Folder::new();
    let mut scene =
        scene(vec![triangle(0), triangle(1)], vec![object(0, Mat4::IDENTITY), object(1, Mat4::IDENTITY)], 3);
    scene.textures = vec![
        TextureSource::File(folder.write("unused.png", b"not decoded, so not complained about")),
        TextureSource::File(folder.write("broken.png", b"\x89PNG\r\n\x1a\n and no more")),
        TextureSource::File(folder.png("good.png", 3, 2, [10, 20, 30, 40])),
    ];
    for (material, texture) in scene.materials.iter_mut().zip([1, 2, 0]) {
        material.texture = Some(texture);
        material.alpha_cutoff = Some(0.5);
    }
    let (built, warnings) = build(scene, &BuildOptions::default());
    assert_eq!(built.textures.len(), 1);
    assert_eq!(built.textures[0].levels[0].texels, [[10, 20, 30, 40]; 6]);
    let textures: Vec<_> = built.materials.iter().map(|m| (m.texture, m.alpha_cutoff)).collect();
    assert_eq!(textures, [(None, None), (Some(0), Some(0.5)), (None, None)]);
    assert_eq!(count(&warnings, "textures that cannot be decoded"), 1);
    assert!(warnings.groups()[0].places[0].contains("broken.png"));
}

#[test]
fn a_warning_says_for_each_broken_texture_what_serves_in_its_place() {
    let folder = Folder::new();
    // Without texture coordinates there would be no tangents, and so no normal map.
    let mesh = Mesh { texcoords: vec![Vec2::ZERO, Vec2::X, Vec2::Y], ..triangle(0) };
    let mut scene = scene(vec![mesh], vec![object(0, Mat4::IDENTITY)], 1);
    let broken = |name: &str| TextureSource::File(folder.write(name, b"no image"));
    scene.textures = vec![
        broken("color.png"),
        broken("normal.png").data(),
        broken("roughness.png").data(),
        broken("alpha.png").clear(u16::MAX),
        broken("glow.png"),
    ];
    let [color, normal, roughness, clear, glow] = [0, 1, 2, 3, 4].map(Some);
    let material = &mut scene.materials[0];
    (material.texture, material.normal_texture) = (color, normal);
    (material.roughness_texture, material.transmission_texture) = (roughness, clear);
    material.emission_texture = glow;
    let (_, warnings) = build(scene, &BuildOptions::default());
    for (name, serves) in [
        ("color.png", "the diffuse colour serves"),
        ("normal.png", "the normals of the vertices serve"),
        ("roughness.png", "the factor alone serves"),
        ("alpha.png", "their materials are opaque"),
        ("glow.png", "the surfaces do not emit"),
    ] {
        let mut of_it = warnings.groups().iter().filter(|group| group.places.iter().any(|place| place.contains(name)));
        let group = of_it.next().expect("a warning");
        assert_eq!((group.what, group.remedy), ("textures that cannot be decoded", serves), "{name}");
        assert!(of_it.next().is_none(), "{name}");
    }
}

#[test]
fn a_mask_of_another_size_becomes_the_alpha_of_the_colours() {
    let folder = Folder::new();
    let mut scene = scene(vec![triangle(0)], vec![object(0, Mat4::IDENTITY)], 1);
    let mask = image::GrayImage::from_fn(4, 1, |x, _| image::Luma([if x < 2 { 0 } else { 200 }]));
    let mask_path = folder.path("mask.png");
    mask.save(&mask_path).unwrap();
    scene.textures =
        vec![TextureSource::Masked { color: folder.png("color.png", 2, 1, [1, 2, 3, 255]), mask: mask_path }];
    scene.materials[0].texture = Some(0);
    let (built, _) = build(scene, &BuildOptions::default());
    assert_eq!(built.textures[0].levels[0].texels, [[1, 2, 3, 0], [1, 2, 3, 200]]);
}

#[test]
fn sixteen_bit_and_tiff_images_keep_their_alpha() {
    let folder = Folder::new();
    let deep =
        image::ImageBuffer::<image::Rgba<u16>, _>::from_pixel(1, 1, image::Rgba([65535_u16, 0, 257 * 7, 257 * 99]));
    let mut scene =
        scene(vec![triangle(0), triangle(1)], vec![object(0, Mat4::IDENTITY), object(1, Mat4::IDENTITY)], 2);
    for (index, name) in ["deep.png", "deep.tif"].iter().enumerate() {
        deep.save(folder.path(name)).unwrap();
        scene.textures.push(TextureSource::File(folder.path(name)));
        scene.materials[index].texture = Some(index as u32);
    }
    let (built, warnings) = build(scene, &BuildOptions::default());
    assert!(warnings.is_empty(), "{:?}", warnings.groups());
    for texture in &built.textures {
        assert_eq!(texture.levels[0].texels, [[255, 0, 7, 99]], "{}", texture.name);
    }
}

#[test]
fn the_memory_cap_counts_every_placed_copy() {
    let objects = (0..1000).map(|_| object(0, Mat4::IDENTITY)).collect();
    let scene = scene(vec![cube()], objects, 1);
    let options = BuildOptions { max_bytes: 100_000, ..BuildOptions::default() };
    let error = RenderScene::build(scene, &options).unwrap_err();
    assert!(error.to_string().contains("--max-memory"), "{error}");
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let build_with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let objects = (0..50).map(|i| object(i % 2, Mat4::from_rotation_y(i as f32))).collect();
        let scene = scene(vec![cube(), triangle(0)], objects, 1);
        pool.install(|| build(scene, &BuildOptions::default())).0.geometry
    };
    let (one, four) = (build_with(1), build_with(4));
    assert_eq!(one.positions, four.positions);
    assert_eq!(one.normals, four.normals);
    assert_eq!(one.triangles, four.triangles);
}

/// A scene far away must have the same shape as at the origin, whatever transform places it there.
#[test]
fn far_scenes_are_placed_before_they_are_rounded() {
    let moved = DVec3::new(1e6, -5e6, 3e5);
    let turn = Mat4::from_quat(Quat::from_rotation_y(0.7)) * Mat4::from_scale(Vec3::splat(1.5));
    for swap_yz in [false, true] {
        for unitize in [false, true] {
            let build = |place: Mat4, transform: Mat4, origin| {
                let options = BuildOptions { swap_yz, unitize, transform, origin, ..BuildOptions::default() };
                RenderScene::build(scene(vec![cube()], vec![object(0, place)], 1), &options).unwrap().0
            };
            let near = build(turn, Mat4::IDENTITY, None);
            let far = build(turn, Mat4::from_translation(moved.as_vec3()), None);
            let told = build(turn, Mat4::from_translation(moved.as_vec3()), Some(moved));
            assert_eq!((near.origin, told.origin), (DVec3::ZERO, moved));
            assert!((far.origin - moved).length() < 16.0 && far.origin != DVec3::ZERO, "{}", far.origin);
            for (scene, name) in [(&far, "far"), (&told, "told")] {
                let all = scene.geometry.positions.iter().zip(&near.geometry.positions);
                let worst = all
                    .map(|(found, near)| (found.as_dvec3() + scene.origin - moved).distance(near.as_dvec3()))
                    .fold(0.0, f64::max);
                assert!(worst < 2e-6, "{name} {swap_yz} {unitize}: {worst}");
                assert_eq!(scene.geometry.normals, near.geometry.normals, "{name} {swap_yz} {unitize}");
            }
        }
    }
}

#[test]
fn many_faces_around_a_vertex_that_creases_part_take_linear_time() {
    let mut mesh = triangle(0);
    mesh.groups[0].triangles = [[0, 1, 2], [0, 2, 1]].repeat(50_000);
    let (built, _) = build(scene(vec![mesh], vec![object(0, Mat4::IDENTITY)], 1), &BuildOptions::default());
    assert_eq!(built.geometry.positions.len(), 300_000);
}

#[test]
fn placed_groups_without_triangles_count_against_the_memory() {
    let mut mesh = triangle(0);
    mesh.groups.resize(1000, Group { material: 0, triangles: Vec::new() });
    let scene = scene(vec![mesh], vec![object(0, Mat4::IDENTITY); 1000], 1);
    let options = BuildOptions { max_bytes: 16 << 20, ..BuildOptions::default() };
    let error = RenderScene::build(scene, &options).unwrap_err().to_string();
    assert!(error.contains("placed groups"), "{error}");
}
