use crate::effects::tests::world::{BACKGROUND, Shot, World, assert_close, grid};
use curitiba_pipeline::backend::{Glow, PixelCone, RayJob};
use curitiba_pipeline::programs::Fidelity::{Corrected, Thesis};
use curitiba_pipeline::programs::{RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::texture::{Magnification, Wrap};
use glam::{Vec2, Vec3, Vec4};

const PROGRAM: RayProgram = RayProgram::Reflection;

#[test]
fn a_mirror_shows_the_lit_colour_of_what_lies_in_front() {
    let mut world = World::lit_along(Vec3::new(0.2, -0.3, 1.0));
    let glass = world.glass();
    let red = world.paint(Vec3::new(0.9, 0.2, 0.1));
    // The mirror at z = 0 faces +z; the wall at z = 10, behind the eye, faces the mirror.
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
    world.quad(red, Vec3::new(0.0, 0.0, 10.0), Vec3::X * 50.0, Vec3::NEG_Y * 50.0);
    let eye = Vec3::new(0.5, 0.2, 4.0);
    let shot = Shot::of(&world, eye, grid(5, Vec3::ZERO, Vec3::X * 0.9, Vec3::Y * 0.9));
    // The wall's normal is -z; the light travels towards +z and so meets its front.
    let to_light = -world.sun.expect("a sun").direction;
    let expected = world.lit(red, to_light.dot(Vec3::NEG_Z));
    for fidelity in [Corrected, Thesis] {
        let (pixels, rays) = shot.run(PROGRAM, fidelity, RayParams::default());
        assert_eq!((rays.reflected, rays.total()), (25, 25));
        for (i, pixel) in pixels.iter().enumerate() {
            assert_close(*pixel, expected, 1e-6, format!("{fidelity:?} pixel {i}"));
            assert_eq!(pixel[3], 1.0);
        }
    }
}

#[test]
fn a_mirror_shows_the_texture_where_the_mirrored_ray_meets_it() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.glass();
    let picture = world.picture([[255, 0, 0, 255], [0, 0, 255, 255]], None);
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
    world.quad(picture, Vec3::new(0.0, 0.0, 6.0), Vec3::X * 5.0, Vec3::NEG_Y * 5.0);
    let eye = Vec3::new(0.1, 0.0, 3.0);
    let targets = [Vec3::new(-0.6, 0.1, 0.0), Vec3::new(0.2, -0.3, 0.0), Vec3::new(0.7, 0.5, 0.0)];
    let shot = Shot::of(&world, eye, targets);
    let (pixels, _) = shot.run(PROGRAM, Corrected, RayParams::default());
    for (target, pixel) in targets.iter().zip(pixels) {
        // The ray is mirrored at z = 0 and followed to z = 6.
        let direction = (*target - eye) * Vec3::new(1.0, 1.0, -1.0);
        let met = *target + direction * (6.0 / direction.z);
        let u = 0.5 + met.x / 10.0;
        let texel = world.scene.textures[0].sample(Vec2::new(u, 0.5), 0.0).truncate();
        // The wall faces away from the light: ambient light only.
        assert_close(pixel, 0.3 * texel, 2e-6, target);
    }
    assert!((world.scene.textures[0].sample(Vec2::new(0.4, 0.5), 0.0).x - 0.5).abs() > 0.05, "texels are blended");
}

#[test]
fn textures_are_filtered_only_where_glass_shows_them() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.glass();
    let picture = world.picture([[255, 0, 0, 255], [0, 0, 255, 255]], None);
    world.quad(picture, Vec3::ZERO, Vec3::X, Vec3::Y);
    let shot = Shot::of(&world, Vec3::Z, [Vec3::ZERO]);
    for (fidelity, is_glass, expected) in
        [(Corrected, true, TextureLod::Cones), (Corrected, false, TextureLod::Zero), (Thesis, true, TextureLod::Zero)]
    {
        let mut materials = vec![false; world.shades.len()];
        materials[glass as usize] = is_glass;
        let job = RayJob { glass: &materials, ..shot.job(PROGRAM, fidelity, RayParams::default()) };
        assert_eq!(job.texture_lod(), expected, "{fidelity:?}, glass: {is_glass}");
    }
}

#[test]
fn a_mirror_shows_the_colours_of_vertices_and_passes_where_their_alpha_cuts() {
    let mut world = World::lit_along(Vec3::new(0.0, 0.0, 1.0));
    let glass = world.glass();
    let (wall, beyond) = (world.paint(Vec3::new(0.9, 0.6, 0.3)), world.paint(Vec3::new(0.1, 0.2, 0.4)));
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
    world.quad(wall, Vec3::new(0.0, 0.0, 6.0), Vec3::X * 5.0, Vec3::NEG_Y * 5.0);
    world.quad(beyond, Vec3::new(0.0, 0.0, 9.0), Vec3::X * 50.0, Vec3::NEG_Y * 50.0);
    // Linear in position, so that the interpolations in both triangles of a quad agree.
    let tint = |at: Vec3| Vec4::new(0.5 + 0.1 * at.x, 0.5 - 0.1 * at.x, 0.5 + 0.1 * at.y, 0.5 + 0.1 * at.x);
    world.scene.geometry.colors = world.scene.geometry.positions.iter().map(|at| tint(*at)).collect();
    let shade = &mut world.shades[wall as usize];
    (shade.vertex_colors, shade.alpha_cutoff) = (true, Some(0.45));
    let eye = Vec3::new(0.1, 0.0, 3.0);
    let targets = [Vec3::new(-0.6, 0.1, 0.0), Vec3::new(0.2, -0.3, 0.0), Vec3::new(0.7, 0.5, 0.0)];
    let shot = Shot::of(&world, eye, targets);
    let (pixels, _) = shot.run(PROGRAM, Corrected, RayParams::default());
    let mut cut = 0;
    for (target, pixel) in targets.iter().zip(pixels) {
        let direction = (*target - eye) * Vec3::new(1.0, 1.0, -1.0);
        let met = *target + direction * (6.0 / direction.z);
        let color = tint(met);
        let hole = color.w < 0.45;
        cut += usize::from(hole);
        let expected = if hole { world.lit(beyond, 1.0) } else { world.lit(wall, 1.0) * color.truncate() };
        assert_close(pixel, expected, 4e-6, target);
    }
    assert_eq!(cut, 1, "one of three rays passes");
}

#[test]
fn a_mirror_shows_walls_lit_by_their_normal_maps() {
    let texel = [214, 86, 230, 255];
    let [x, y, z] = [0, 1, 2].map(|axis: usize| f32::from(texel[axis]) / 255.0 * 2.0 - 1.0);
    // The wall at z = 6 faces -z; u grows along x and v along -y.
    let flat = Vec3::NEG_Z;
    for (scale, mirrored) in [(1.0, 1.0), (0.5, 1.0), (1.0, -1.0)] {
        let tilted = (Vec3::X * x * scale * mirrored + Vec3::NEG_Y * y * scale + flat * z).normalize();
        // Three lights: one that both the wall and its bent normal face, one that only the wall faces, and one that only the bent normal faces.
        let lights = [flat + tilted, flat - 0.98 * tilted, tilted - 1.02 * flat * tilted.dot(flat)];
        let expected = lights.map(|to_light| {
            let to_light = to_light.normalize();
            if flat.dot(to_light) > 0.0 { tilted.dot(to_light).max(0.0) } else { 0.0 }
        });
        assert!(expected[0] > 0.5 && expected[1..] == [0.0, 0.0], "{expected:?}");
        for (to_light, cosine) in lights.into_iter().zip(expected) {
            let mut world = World::lit_along(-to_light);
            let glass = world.glass();
            let wall = world.paint(Vec3::new(0.9, 0.6, 0.3));
            world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
            world.quad(wall, Vec3::new(0.0, 0.0, 6.0), Vec3::X * 5.0, Vec3::NEG_Y * 5.0);
            if mirrored < 0.0 {
                world.scene.geometry.texcoords.iter_mut().for_each(|texcoord| texcoord.x = -texcoord.x);
            }
            world.bump(wall, [texel; 2], scale);
            // Vertex normals that point to the other side are flipped to face the viewer. The frame of the normal map is flipped with them, so the
            // normal is bent in the other direction.
            for turn in [false, true] {
                let mut cosine = cosine;
                if turn {
                    let geometry = &mut world.scene.geometry;
                    geometry.normals.iter_mut().for_each(|normal| *normal = -*normal);
                    let turned = (tilted - 2.0 * (tilted - flat * tilted.dot(flat))).normalize();
                    // The frame's third axis was flipped; flip the bitangent with it.
                    geometry.tangents.iter_mut().for_each(|tangent| tangent.w = -tangent.w);
                    let to_light = to_light.normalize();
                    cosine = if flat.dot(to_light) > 0.0 { turned.dot(to_light).max(0.0) } else { 0.0 };
                }
                let targets = [Vec3::new(-0.6, 0.1, 0.0), Vec3::new(0.2, -0.3, 0.0), Vec3::new(0.7, 0.5, 0.0)];
                let shot = Shot::of(&world, Vec3::new(0.1, 0.0, 3.0), targets);
                let (pixels, _) = shot.run(PROGRAM, Corrected, RayParams::default());
                for pixel in pixels {
                    assert_close(pixel, world.lit(wall, cosine), 4e-6, format!("{scale} {mirrored} {turn} {cosine}"));
                }
            }
        }
    }
}

#[test]
fn a_mirror_shows_light_that_surfaces_send_out_and_textures_that_are_clamped() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.glass();
    let picture = world.picture([[255, 0, 0, 255], [0, 0, 255, 255]], None);
    let texture = world.scene.textures.remove(0).wrapped([Wrap::Clamp; 2]);
    world.scene.textures.push(texture);
    let color = Vec3::new(0.25, 3.0, 0.5);
    world.shades[picture as usize].glow = Some(Glow { color, texture: Some(0) });
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
    world.quad(picture, Vec3::new(0.0, 0.0, 6.0), Vec3::X * 5.0, Vec3::NEG_Y * 5.0);
    // Texture coordinates from -1 to 2: the outer thirds of the wall show the edge texels.
    world.scene.geometry.texcoords.iter_mut().for_each(|texcoord| texcoord.x = texcoord.x * 3.0 - 1.0);
    let eye = Vec3::new(0.1, 0.0, 3.0);
    let targets = [Vec3::new(-0.9, 0.1, 0.0), Vec3::new(0.1, -0.3, 0.0), Vec3::new(0.9, 0.5, 0.0)];
    let shot = Shot::of(&world, eye, targets);
    let (pixels, _) = shot.run(PROGRAM, Corrected, RayParams::default());
    for (target, pixel) in targets.iter().zip(pixels) {
        let direction = (*target - eye) * Vec3::new(1.0, 1.0, -1.0);
        let met = *target + direction * (6.0 / direction.z);
        // The two texels have their centres at 0.25 and 0.75.
        let u = (0.5 + met.x / 10.0) * 3.0 - 1.0;
        let blue = ((u - 0.25) / 0.5).clamp(0.0, 1.0);
        let texel = Vec3::new(1.0 - blue, 0.0, blue);
        assert_close(pixel, (0.3 + color) * texel, 4e-6, target);
    }
}

#[test]
fn a_mirror_shows_the_nearest_texels_of_a_magnified_texture_that_asks_for_them() {
    for (texture_lod, magnification) in [
        (TextureLod::Zero, Magnification::Nearest),
        (TextureLod::Cones, Magnification::Nearest),
        (TextureLod::Cones, Magnification::Linear),
    ] {
        let mut world = World::lit_along(Vec3::NEG_Z);
        let glass = world.glass();
        let colors = [Vec3::new(1.0, 0.0, 0.2), Vec3::new(0.0, 0.4, 1.0)];
        let picture =
            world.picture(colors.map(|color| (255.0 * color).extend(255.0).to_array().map(|c| c as u8)), None);
        let texture = world.scene.textures.remove(0).magnified(magnification);
        world.scene.textures.push(texture);
        world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
        world.quad(picture, Vec3::new(0.0, 0.0, 6.0), Vec3::X * 5.0, Vec3::NEG_Y * 5.0);
        world.scene.geometry.texcoords.iter_mut().for_each(|texcoord| *texcoord *= 3.0);
        let eye = Vec3::new(0.1, 0.0, 3.0);
        let targets: Vec<Vec3> = (0..60).map(|at| Vec3::new(at as f32 / 31.0 - 0.97, 0.013, 0.0)).collect();
        let mut shot = Shot::of(&world, eye, targets.clone());
        shot.cone = PixelCone { width: 0.0, spread: 0.01 };
        let (pixels, _) = shot.run(PROGRAM, Corrected, RayParams { texture_lod, ..RayParams::default() });
        let is_texel = |(target, pixel): (&Vec3, &[f32; 4])| {
            let met = *target + (*target - eye) * Vec3::new(1.0, 1.0, -1.0) * (6.0 / (eye.z - target.z));
            let texel = (2.0 * 3.0 * (0.5 + met.x / 10.0)).floor() as usize % 2;
            Vec3::from_slice(pixel).distance(0.3 * colors[texel]) < 1e-6
        };
        let texels = targets.iter().zip(&pixels).filter(|seen| is_texel(*seen)).count();
        match magnification {
            Magnification::Nearest => assert_eq!(texels, 60, "{texture_lod:?}"),
            Magnification::Linear => assert!(texels < 10, "control: {texels} pixels show one texel"),
        }
    }
}

#[test]
fn pixels_that_show_no_glass_keep_their_colour_and_trace_nothing() {
    let mut world = World::lit_along(Vec3::NEG_Y);
    let paint = world.paint(Vec3::splat(0.7));
    world.quad(paint, Vec3::ZERO, Vec3::Z, Vec3::X);
    let mut shot = Shot::of(&world, Vec3::Y, [Vec3::ZERO, Vec3::Y * 2.0]);
    shot.color[0] = [0.4, 0.3, 0.2, 0.6];
    for fidelity in [Corrected, Thesis] {
        let (pixels, rays) = shot.run(PROGRAM, fidelity, RayParams::default());
        assert_eq!((pixels, rays.total()), (vec![[0.4, 0.3, 0.2, 0.6], BACKGROUND], 0));
    }
}

/// Two facing mirrors, one unit apart, up to x = 10, and a wall at x = 10.
fn corridor() -> (World, u32) {
    let mut world = World::lit_along(Vec3::X);
    let glass = world.glass();
    let paint = world.paint(Vec3::new(0.2, 0.5, 0.8));
    world.quad(glass, Vec3::ZERO, Vec3::X * 10.0, Vec3::Y * 10.0);
    world.quad(glass, Vec3::Z, Vec3::NEG_X * 10.0, Vec3::Y * 10.0);
    world.quad(paint, Vec3::new(10.0, 0.0, 0.5), Vec3::Y * 10.0, Vec3::NEG_Z);
    (world, paint)
}

#[test]
fn bounces_beyond_the_depth_are_black() {
    let (world, paint) = corridor();
    let eye = Vec3::new(0.0, 0.0, 0.5);
    for (slope, bounces) in [(0.3, 2), (0.6, 5), (0.7, 6), (0.9, 8)] {
        // Unfolded, the ray climbs 10 * slope from half the height, and crosses that many mirrors; the first one is the
        // pixel itself.
        assert_eq!((10.0f32 * slope + 0.5) as u32 - 1, bounces);
        let shot = Shot::of(&world, eye, [eye + Vec3::new(1.0, 0.0, slope)]);
        assert_eq!(shot.color[0], [1.0, 0.0, 1.0, 0.0], "a mirror is seen");
        for depth in 0..=12 {
            let params = RayParams { depth, ..RayParams::default() };
            for fidelity in [Corrected, Thesis] {
                let (pixels, rays) = shot.run(PROGRAM, fidelity, params);
                let seen = bounces <= depth;
                let expected = if seen { world.lit(paint, 1.0) } else { Vec3::ZERO };
                // The wall faces the light; the bounces do not dim it.
                assert_close(pixels[0], expected, 1e-6, format!("{fidelity:?} {bounces} bounces, depth {depth}"));
                assert_eq!(rays.reflected, u64::from(bounces.min(depth)) + 1);
            }
        }
    }
}

#[test]
fn rays_that_leave_the_scene_are_black() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.glass();
    world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
    let shot = Shot::of(&world, Vec3::Z, [Vec3::new(0.1, 0.2, 0.0)]);
    for fidelity in [Corrected, Thesis] {
        assert_eq!(shot.run(PROGRAM, fidelity, RayParams::default()).0, [[0.0, 0.0, 0.0, 1.0]]);
    }
}

#[test]
fn glass_is_known_by_its_mask_in_thesis_and_by_its_material_in_corrected() {
    let (world, _) = corridor();
    let eye = Vec3::new(0.0, 0.0, 0.5);
    let mut shot = Shot::of(&world, eye, [eye + Vec3::new(1.0, 0.0, 0.3), Vec3::new(10.0, 0.0, 0.5)]);
    // The first pixel is the wall with the mask's colour, the second the mirror without it.
    shot.color = vec![[0.2, 0.3, 0.4, 1.0], [1.0, 0.0, 1.0, 0.0]];
    let (corrected, _) = shot.run(PROGRAM, Corrected, RayParams::default());
    let (thesis, _) = shot.run(PROGRAM, Thesis, RayParams::default());
    assert_eq!(thesis[0], shot.color[0]);
    assert_eq!(corrected[1], shot.color[1]);
    assert_ne!(corrected[0], shot.color[0]);
    assert_eq!(thesis[1], [0.0, 0.0, 0.0, 1.0], "the wall mirrors a ray out of the corridor");
}

#[test]
fn the_winding_of_what_is_seen_decides_its_side_in_thesis_only() {
    let color = |flipped: bool, fidelity| {
        let mut world = World::lit_along(Vec3::Z);
        let glass = world.glass();
        let paint = world.paint(Vec3::splat(0.5));
        world.quad(glass, Vec3::ZERO, Vec3::X, Vec3::Y);
        world.quad(paint, Vec3::new(0.0, 0.0, 6.0), Vec3::X * 5.0, Vec3::NEG_Y * 5.0);
        if flipped {
            // Swaps two corners of each triangle of the wall, and leaves its normals.
            world.scene.geometry.triangles[2..].iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let lit = world.lit(paint, 1.0);
        let shot = Shot::of(&world, Vec3::Z * 3.0, [Vec3::new(0.1, 0.2, 0.0)]);
        (shot.run(PROGRAM, fidelity, RayParams::default()).0[0], lit)
    };
    for flipped in [false, true] {
        let (found, lit) = color(flipped, Corrected);
        assert_close(found, lit, 1e-6, "corrected");
    }
    let (found, lit) = color(false, Thesis);
    assert_close(found, lit, 1e-6, "thesis");
    let (found, _) = color(true, Thesis);
    assert_close(found, Vec3::splat(0.15), 1e-6, "thesis: ambient light only");
}
