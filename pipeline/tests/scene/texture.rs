//! Image formats, and the reference definition of texture filtering.

use crate::scene_support::Folder;
use curitiba_pipeline::scene::texture::{Level, Texture, lod};
use curitiba_pipeline::scene::{BuildOptions, Group, Material, Mesh, Object, RenderScene, Scene, TextureSource};
use glam::{Mat4, Vec2, Vec3, Vec4};

/// Two by two texels: red and green above, blue and white below.
fn four() -> Texture {
    let texels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
    Texture::new("four".to_owned(), 2, 2, texels)
}

#[test]
fn texel_centres_read_their_texel_and_v_counts_upwards() {
    let level = &four().levels[0];
    for (u, v, expected) in [
        (0.25, 0.75, Vec4::new(1.0, 0.0, 0.0, 1.0)),
        (0.75, 0.75, Vec4::new(0.0, 1.0, 0.0, 1.0)),
        (0.25, 0.25, Vec4::new(0.0, 0.0, 1.0, 1.0)),
        (0.75, 0.25, Vec4::ONE),
        // Repeated, in both directions.
        (-0.75, 3.75, Vec4::new(1.0, 0.0, 0.0, 1.0)),
    ] {
        assert_eq!(level.sample(Vec2::new(u, v)), expected, "{u} {v}");
    }
}

#[test]
fn between_texels_colours_are_mixed_also_across_the_border() {
    let level = &four().levels[0];
    let mean = Vec4::new(0.5, 0.5, 0.5, 1.0);
    assert!(level.sample(Vec2::splat(0.5)).distance(mean) < 1e-6);
    assert!(level.sample(Vec2::ZERO).distance(mean) < 1e-6);
    let red_and_green = Vec4::new(0.5, 0.5, 0.0, 1.0);
    assert!(level.sample(Vec2::new(1.0, 0.75)).distance(red_and_green) < 1e-6);
    assert_eq!(level.sample(Vec2::new(f32::NAN, 0.0)), Vec4::new(1.0, 0.0, 0.0, 1.0));
}

#[test]
fn mip_levels_halve_down_to_one_texel_and_are_blended() {
    let texture = four();
    assert_eq!(texture.levels[1], Level { width: 1, height: 1, texels: vec![[128, 128, 128, 255]] });
    let odd = Texture::new("odd".to_owned(), 5, 3, vec![[9; 4]; 15]);
    let sizes: Vec<_> = odd.levels.iter().map(|level| (level.width, level.height)).collect();
    assert_eq!(sizes, [(5, 3), (2, 1), (1, 1)]);
    assert!(odd.levels.iter().all(|level| level.texels.iter().all(|texel| *texel == [9; 4])));

    let at = Vec2::new(0.25, 0.75);
    let (fine, coarse) = (texture.sample(at, 0.0), texture.sample(at, 7.0));
    assert_eq!(texture.sample(at, -3.0), fine);
    assert!(texture.sample(at, 0.25).distance(fine.lerp(coarse, 0.25)) < 1e-6);
}

#[test]
fn the_level_of_detail_is_the_logarithm_of_the_longer_footprint() {
    let texture = Texture::new("long".to_owned(), 64, 16, vec![[0; 4]; 1024]);
    let step = |x: f32, y: f32| Vec2::new(x, y);
    // The footprint is four texels along u and one along v.
    assert_eq!(lod(texture.size(), step(4.0 / 64.0, 0.0), step(0.0, 1.0 / 16.0)), 2.0);
    assert_eq!(lod(texture.size(), step(0.0, 0.5), step(0.0, 0.0)), 3.0);
    assert_eq!(lod(texture.size(), step(0.001, 0.0), step(0.0, 0.001)), 0.0);
    assert_eq!(lod(texture.size(), step(f32::NAN, 0.0), step(0.0, 0.0)), 0.0);
}

/// Green wires, two of every eight texels wide, between holes whose stored colour is red.
fn wires() -> Vec<[u8; 4]> {
    (0..64 * 64).map(|i| if i % 8 < 2 { [0, 200, 0, 255] } else { [255, 0, 0, 0] }).collect()
}

#[test]
fn cut_outs_show_nothing_of_their_holes_in_any_level() {
    let texture = Texture::cut_out("wires".to_owned(), 64, 64, wires());
    let plain = Texture::new("wires".to_owned(), 64, 64, wires());
    assert_eq!(texture.levels[0], plain.levels[0]);
    for level in &texture.levels {
        let solid = level.texels.iter().filter(|texel| texel[3] > 0);
        assert!(solid.into_iter().all(|texel| texel[..3] == [0, 200, 0]));
    }
    assert!(plain.levels[3].texels.iter().all(|texel| texel[..3] != [0, 200, 0]));
}

#[test]
fn a_texture_of_a_cut_out_and_an_opaque_material_is_built_as_a_cut_out() {
    let folder = Folder::new();
    let path = folder.path("wires.png");
    image::RgbaImage::from_raw(64, 64, wires().concat()).unwrap().save(&path).unwrap();
    let build = |cutoffs: &[Option<f32>]| {
        let mut scene = Scene { textures: vec![TextureSource::File(path.clone())], ..Scene::default() };
        for (index, alpha_cutoff) in cutoffs.iter().enumerate() {
            let (name, index) = (format!("m{index}"), index as u32);
            scene.materials.push(Material {
                name,
                texture: Some(0),
                alpha_cutoff: *alpha_cutoff,
                ..Material::default()
            });
            scene.meshes.push(Mesh {
                positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
                groups: vec![Group { material: index, triangles: vec![[0, 1, 2]] }],
                ..Mesh::default()
            });
            scene.objects.push(Object { name: String::new(), mesh: index, transform: Mat4::IDENTITY });
        }
        RenderScene::build(scene, &BuildOptions::default()).unwrap().0.textures.remove(0).levels
    };
    let cut_out = Texture::cut_out(String::new(), 64, 64, wires()).levels;
    let plain = Texture::new(String::new(), 64, 64, wires()).levels;
    assert_ne!(cut_out, plain);
    assert_eq!(build(&[None, Some(0.5)]), cut_out);
    assert_eq!(build(&[None, None]), plain, "without a cutoff the levels are plain means");
}

/// Decodes image files by building a scene with one triangle for each.
fn decode(files: &[std::path::PathBuf]) -> Vec<Texture> {
    let mut scene = Scene::default();
    for (index, file) in files.iter().enumerate() {
        let index = index as u32;
        scene.textures.push(TextureSource::File(file.clone()));
        let name = file.display().to_string();
        scene.materials.push(Material { name, texture: Some(index), ..Material::default() });
        scene.meshes.push(Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            groups: vec![Group { material: index, triangles: vec![[0, 1, 2]] }],
            ..Mesh::default()
        });
        scene.objects.push(Object { name: String::new(), mesh: index, transform: Mat4::IDENTITY });
    }
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert!(warnings.is_empty(), "{:?}", warnings.groups());
    built.textures
}

#[test]
fn every_format_keeps_its_colours_its_alpha_and_its_rows() {
    let folder = Folder::new();
    let image = image::RgbaImage::from_fn(3, 2, |x, y| image::Rgba([x as u8 * 100, y as u8 * 200, 7, 50 + x as u8]));
    let names = ["a.png", "a.tga", "a.TIF", "a.bmp"];
    let files = names.map(|name| folder.path(name));
    for file in &files {
        image.save(file).unwrap();
    }
    let expected: Vec<[u8; 4]> = image.pixels().map(|pixel| pixel.0).collect();
    for texture in decode(&files) {
        assert_eq!(texture.levels[0].texels, expected, "{}", texture.name);
    }
}

#[test]
fn lossy_and_block_compressed_images_are_read() {
    let folder = Folder::new();
    let jpeg = folder.path("a.jpg");
    image::RgbImage::from_pixel(8, 8, image::Rgb([200, 200, 200])).save(&jpeg).unwrap();
    // A BC1 block whose texels all have the first end colour: pure red in 5:6:5 bits.
    let mut dds = b"DDS ".to_vec();
    let mut words = [0_u32; 31];
    words[..5].copy_from_slice(&[124, 0x8_1007, 4, 4, 8]);
    words[18..21].copy_from_slice(&[32, 4, u32::from_le_bytes(*b"DXT1")]);
    words[26] = 0x1000;
    words.iter().for_each(|word| dds.extend(word.to_le_bytes()));
    dds.extend([0x00, 0xF8, 0, 0, 0, 0, 0, 0]);
    let decoded = decode(&[jpeg, folder.write("a.dds", dds)]);
    assert!(decoded[0].levels[0].texels.iter().all(|texel| texel[0].abs_diff(200) <= 2 && texel[3] == 255));
    assert_eq!(decoded[1].levels[0].texels, [[255, 0, 0, 255]; 16]);
}

/// Bilinear filtering by definition, with repetition of whole texels.
fn by_definition(level: &Level, uv: Vec2) -> Vec4 {
    let (width, height) = (level.width as f32, level.height as f32);
    let (x, y) = ((uv.x - uv.x.floor()) * width - 0.5, (1.0 - (uv.y - uv.y.floor())) * height - 0.5);
    let texel = |right: f32, down: f32| {
        let column = (x.floor() + right).rem_euclid(width) as usize;
        let row = (y.floor() + down).rem_euclid(height) as usize;
        Vec4::from_array(level.texels[row * level.width as usize + column].map(f32::from)) / 255.0
    };
    let (fx, fy) = (x - x.floor(), y - y.floor());
    texel(0.0, 0.0).lerp(texel(1.0, 0.0), fx).lerp(texel(0.0, 1.0).lerp(texel(1.0, 1.0), fx), fy)
}

#[test]
fn the_filter_is_its_definition_to_the_bit() {
    let mut state = 3_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    for (width, height) in [(1, 1), (2, 1), (3, 5), (64, 16), (100, 7)] {
        let texels = (0..width * height).map(|_| random().to_le_bytes()).collect();
        let level = Level { width, height, texels };
        let special =
            [0.0, -0.0, 1.0, -1.0, 1e-9, -1e-9, 0.5, 8_388_607.5, -8_388_607.5, 8_388_608.0, -3e9, 1e30, -1e30];
        let mut coordinates = Vec::from(special);
        for _ in 0..300 {
            let unit = random() as f32 / 16_777_216.0;
            coordinates.extend([unit, unit * 20.0 - 10.0, (unit - 0.5) * 1e6, 1.0 - unit * 1e-6, unit * 1e-6 - 3.0]);
            coordinates.push((random() % 40) as f32 / width as f32 - 3.0);
        }
        for (index, &u) in coordinates.iter().enumerate() {
            let uv = Vec2::new(u, coordinates[(index * 7 + 5) % coordinates.len()]);
            let (found, expected) = (level.sample(uv), by_definition(&level, uv));
            let bits = |color: Vec4| color.to_array().map(f32::to_bits);
            assert_eq!(bits(found), bits(expected), "{width} x {height} at {uv}");
        }
    }
}
