//! The processor's rasteriser against an independent rasteriser, and against closed forms.

use crate::common::{self, ALL, Random, camera, grey, job, pixels, soup, terrain};
use curitiba_passes::raster::cpu::{CpuRasteriser, InstructionSet};
use curitiba_pipeline::backend::{
    Attachments, GBuffer, Glow, NO_TRIANGLE, NormalMap, RasterJob, Rasteriser, Rect, Shade, Sun, View,
};
use curitiba_pipeline::scene::texture::{Texture, lod};
use curitiba_pipeline::scene::{Batch, RenderScene};
use glam::{DMat4, DVec2, DVec3, Vec2, Vec3, Vec4};

fn draw(job: &RasterJob<'_>) -> GBuffer {
    let mut target = GBuffer::new(job.viewport.width, job.viewport.height, job.attachments);
    CpuRasteriser::new().draw(job, &mut target).expect("drawn");
    target
}

/// Whether all bits are equal, including NaN and the sign of 0.
fn same(a: &GBuffer, b: &GBuffer) -> bool {
    let bits = |pixels: &[[f32; 4]]| pixels.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>();
    a.triangle == b.triangle
        && bits(&a.color) == bits(&b.color)
        && bits(&a.position) == bits(&b.position)
        && bits(&a.normal) == bits(&b.normal)
}

#[test]
fn random_soups_cover_the_pixels_that_exact_arithmetic_says() {
    // Kind of triangles, their number, least share of compared pixels, least number of covered pixels.
    for (kind, count, share, covered) in [
        (0, 300, 0.95, 5000),
        (1, 400, 0.95, 500),
        (2, 4000, 0.95, 250),
        (3, 40, 0.9, 5000),
        (4, 30, 0.9, 5000),
        (5, 60, 0.8, 2000),
        (6, 60, 0.8, 5000),
    ] {
        for seed in 0..3 {
            let (scene, shades) = (soup(kind, count, seed), [grey()]);
            let job = job(&scene, &shades, camera(1.25), 150, 120, ALL);
            let seen = common::reference::draw(&job);
            let difference = common::reference::compare(&seen, &draw(&job).triangle);
            assert_eq!(difference.wrong, 0, "kind {kind} seed {seed}: {difference:?}");
            assert!(difference.compared as f64 >= share * 150.0 * 120.0, "kind {kind}: {difference:?}");
            assert!(difference.covered >= covered, "kind {kind}: {difference:?}");
        }
    }
}

#[test]
fn of_a_sky_its_colour_alone_is_written() {
    let shades = [grey(); 2];
    let [with, without] = [true, false].map(common::before);
    let asked = [ALL, Attachments { triangle: true, ..Attachments::default() }];
    let drawn = |scene: &RenderScene, asked| draw(&job(scene, &shades, camera(1.25), 150, 120, asked));
    common::hides_sky(&drawn(&with, asked[0]), &drawn(&without, asked[0]));
    assert!(drawn(&with, asked[1]).triangle == drawn(&with, asked[0]).triangle, "ids alone");
}

#[test]
fn the_comparison_finds_a_picture_that_is_one_pixel_off() {
    let (scene, shades) = (soup(0, 300, 0), [grey()]);
    let job = job(&scene, &shades, camera(1.25), 150, 120, ALL);
    let seen = common::reference::draw(&job);
    let mut triangle = draw(&job).triangle;
    triangle.rotate_right(1);
    assert!(common::reference::compare(&seen, &triangle).wrong > 500);
}

#[test]
fn triangles_that_share_edges_cover_each_pixel_exactly_once() {
    // Corners at pixel centres, at pixel corners and in between; drawn one triangle at a time, in both windings. Together the triangles
    // cover every pixel. With the shift, their outer edges above and on the left pass through pixel centres, which they cover too.
    for jitter in [0.0, 1.0] {
        for shift in [0.0, 0.5] {
            let (cells, size) = (9u32, 72u32);
            let mut random = Random(7);
            let mut corners = Vec::new();
            for row in 0..=cells {
                for column in 0..=cells {
                    let inner = (1..cells).contains(&row) && (1..cells).contains(&column);
                    let move_by = if inner { random.vector() * 3.0 * jitter } else { Vec3::ZERO };
                    let at = Vec2::new(column as f32, row as f32) * 8.0 + Vec2::splat(shift) + move_by.truncate();
                    corners.push(at.extend(-0.5));
                }
            }
            let mut count = vec![0u32; (size * size) as usize];
            for row in 0..cells {
                for column in 0..cells {
                    let a = (row * (cells + 1) + column) as usize;
                    let (b, c, d) = (a + 1, a + cells as usize + 1, a + cells as usize + 2);
                    let halves =
                        if random.next().is_multiple_of(2) { [[a, b, c], [b, c, d]] } else { [[a, d, b], [a, d, c]] };
                    for half in halves {
                        let scene = common::triangles(&[half.map(|corner| corners[corner])]);
                        let asked = Attachments { triangle: true, ..Attachments::default() };
                        let target = draw(&job(&scene, &[grey()], pixels(size, size), size, size, asked));
                        target.triangle.iter().zip(&mut count).for_each(|(id, count)| *count += u32::from(*id == 0));
                    }
                }
            }
            for (pixel, count) in (0..).zip(count) {
                assert_eq!(count, 1, "jitter {jitter} shift {shift} at {}, {}", pixel % size, pixel / size);
            }
        }
    }
}

#[test]
fn positions_lie_on_the_triangle_and_on_the_ray_of_the_pixel() {
    for (kind, bound) in [(0, 2e-5), (3, 6e-4), (4, 6e-4), (5, 6e-5)] {
        let (scene, shades) = (soup(kind, 80, 1), [grey()]);
        let (width, height) = (250u32, 200u32);
        let job = job(&scene, &shades, camera(1.25), width, height, ALL);
        let target = draw(&job);
        let clip_from_world = DMat4::from_cols_array(&job.view.clip_from_world.to_cols_array().map(f64::from));
        let (mut covered, mut far, mut beside, mut above) = (0_u32, 0, 0.0, 0.0);
        for (index, id) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
            let [a, b, c] = scene.geometry.corners(*id).map(|corner| corner.as_dvec3());
            let [x, y, z, _] = target.position[index].map(f64::from);
            let position = DVec3::new(x, y, z);
            let size = [a, b, c].iter().fold(1.0, |most: f64, corner| most.max(corner.abs().max_element()));
            let distance = (position - a).dot((b - a).cross(c - a).normalize()).abs();
            assert!(
                distance <= 8.0 * size * f64::from(f32::EPSILON),
                "kind {kind}: {distance:e} off a plane of {size}"
            );
            let clip = clip_from_world * position.extend(1.0);
            let ndc = DVec2::new(clip.x, clip.y) / clip.w;
            let screen = DVec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * DVec2::new(width.into(), height.into());
            let centre = DVec2::new(index as f64 % f64::from(width), (index as u32 / width) as f64);
            let off = screen - (centre.with_x(centre.x.floor()) + 0.5);
            // The second term is the rounding error of positions, which is large for huge triangles.
            let rounding = 6e-5 + 4.0 * size * f64::from(f32::EPSILON) * f64::from(width) / clip.w;
            let most = off.abs().max_element();
            assert!(most <= rounding + 1.0 / 512.0, "kind {kind}: {off} pixels off, for rounding {rounding}");
            covered += 1;
            far += u32::from(most > rounding);
            beside += 0.5 * off.length_squared();
            // Distance from the plane in pixels, as the camera sees it: 0.55 is the tangent of half its field of view.
            above += (distance / clip.w * f64::from(height) / (2.0 * 0.55)).powi(2);
        }
        // Snapping moves each corner by at most 1/512 pixel along each axis. A pixel that only the snapped triangle covers shows the nearest
        // point of the exact one.
        let [beside, above] = [beside, above].map(|sum: f64| (sum / f64::from(covered)).sqrt());
        println!(
            "kind {kind}: {beside:.1e} pixels beside the centre, {above:.1e} off the plane, {far} of {covered} from snapping"
        );
        assert!(covered > 5000 && 100 * far < covered, "kind {kind}: {far} of {covered}");
        assert!(beside < bound, "kind {kind}: {beside} {above}");
    }
}

#[test]
fn what_only_snapped_triangles_cover_shows_their_nearest_place() {
    let shades = [grey()];
    // Needles, and triangles smaller than a pixel.
    for (kind, count, least) in [(1, 20_000, 300), (2, 40_000, 30)] {
        let scene = soup(kind, count, 1);
        let [exact, snapped] = [false, true].map(|snapped_depth| {
            let job = RasterJob { snapped_depth, ..job(&scene, &shades, camera(1.25), 250, 200, ALL) };
            common::beside_nearest(&job, &draw(&job))
        });
        let outside = exact.iter().filter(|pixel| pixel.is_outside).count();
        let wrong = [&exact, &snapped].map(|pixels| pixels.iter().filter(|pixel| pixel.off > pixel.rounding).count());
        println!("kind {kind}: {outside} of {} pixels outside, not at their place {wrong:?}", exact.len());
        assert!(outside > least && wrong[0] == 0 && 2 * wrong[1] > exact.len(), "kind {kind}: {outside} {wrong:?}");
    }
}

#[test]
fn light_normal_and_colour_follow_their_formulas() {
    let (scene, shades) = (soup(0, 300, 2), [grey()]);
    let job = job(&scene, &shades, camera(1.0), 128, 128, ALL);
    let sun = job.sun.expect("the job has light");
    let target = draw(&job);
    let mut lit = 0;
    for (index, id) in target.triangle.iter().enumerate() {
        let (color, position, normal) = (target.color[index], target.position[index], target.normal[index]);
        if *id == NO_TRIANGLE {
            assert_eq!((color, position, normal), (job.clear_color.to_array(), [0.0; 4], [0.0; 4]));
            continue;
        }
        let expected = scene.geometry.normals[scene.geometry.triangles[*id as usize][0] as usize];
        assert!((Vec4::from(normal) - expected.extend(0.0)).abs().max_element() < 1e-6);
        let cosine = (-sun.direction).dot(expected).max(0.0);
        assert!((position[3] - cosine).abs() < 1e-6);
        let diffuse = shades[0].diffuse;
        let expected = diffuse * sun.color.extend(1.0) * cosine + 0.3 * diffuse;
        assert!((Vec4::from(color) - expected).abs().max_element() < 1e-6);
        lit += usize::from(cosine > 0.0);
    }
    assert!(lit > 1000);
    let dark = draw(&RasterJob { sun: None, ..job });
    let ambient = (shades[0].diffuse * 0.3).to_array();
    for (index, id) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
        assert_eq!((dark.triangle[index], dark.position[index][3], dark.color[index]), (*id, 0.0, ambient));
        assert_eq!(dark.normal[index], target.normal[index]);
    }
}

/// A floor that reaches to the horizon, with texture coordinates from its x and z.
fn textured_floor(alpha: impl Fn(u32, u32) -> u8) -> RenderScene {
    let corners = [(-40.0, 3.0), (40.0, 3.0), (40.0, -80.0), (-40.0, -80.0)].map(|(x, z)| Vec3::new(x, -1.0, z));
    let mut scene = common::scene(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    scene.geometry.texcoords = corners.iter().map(|p| Vec2::new(p.x, p.z) * 0.25).collect();
    let texels = (0..64 * 64u32).map(|i| {
        let (x, y) = (i % 64, i / 64);
        let wave = |t: u32| (127.5 + 127.0 * (t as f32 * std::f32::consts::TAU / 64.0).sin()) as u8;
        [wave(x), wave(y), wave(x + y), alpha(x, y)]
    });
    scene.textures.push(Texture::new("waves".to_owned(), 64, 64, texels.collect()));
    scene
}

#[test]
fn textures_are_sampled_at_the_pixel_with_the_level_of_its_footprint() {
    let scene = textured_floor(|_, _| 255);
    let shades = [Shade { texture: Some(0), ..grey() }];
    let (width, height) = (160u32, 128u32);
    let job = job(&scene, &shades, camera(1.25), width, height, ALL);
    let target = draw(&job);
    let world = DMat4::from_cols_array(&job.view.clip_from_world.to_cols_array().map(f64::from)).inverse();
    // Texture coordinates where the pixel's ray hits y = -1.
    let uv = |x: f64, y: f64| {
        let ndc = DVec2::new(x / f64::from(width) * 2.0 - 1.0, 1.0 - y / f64::from(height) * 2.0);
        let far = world.project_point3(ndc.extend(0.5));
        let t = -1.0 / far.y;
        (DVec2::new(far.x, far.z) * t * 0.25).as_vec2()
    };
    let mut covered = 0;
    for (index, id) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
        let (x, y) = (f64::from(index as u32 % width) + 0.5, f64::from(index as u32 / width) + 0.5);
        let step = 1e-3;
        let dx = (uv(x + step, y) - uv(x - step, y)) / (2.0 * step as f32);
        let dy = (uv(x, y + step) - uv(x, y - step)) / (2.0 * step as f32);
        let texel = scene.textures[0].sample(uv(x, y), lod(scene.textures[0].size(), dx, dy));
        let light = target.position[index][3];
        let shade = &shades[0];
        let sun = job.sun.expect("the job has light").color.extend(1.0);
        let expected = (shade.diffuse * sun * light + shade.emission + 0.3) * texel;
        let error = (Vec4::from(target.color[index]) - expected).abs().max_element();
        assert!(error < 0.02, "pixel {index} of triangle {id}: {:?}, not {expected}", target.color[index]);
        covered += 1;
    }
    assert!(covered > 6000, "{covered}");
}

#[test]
fn light_of_their_own_is_added_to_what_surfaces_reflect() {
    let mut scene = soup(0, 300, 4);
    let solid = |name: &str, size: u32, texel: [u8; 4]| {
        Texture::new(name.to_owned(), size, size, vec![texel; (size * size) as usize])
    };
    scene.textures = vec![solid("red", 16, [255, 0, 51, 255]), solid("lamp", 32, [51, 255, 102, 0])];
    scene.geometry.batches = (0..300).map(|first| Batch { material: first % 4, first, count: 1 }).collect();
    let color = Vec3::new(0.5, 2.0, 0.25);
    let glow = |texture| Some(Glow { color, texture });
    let of = |texture, glow| Shade { texture, glow, ..grey() };
    let shades = [of(Some(0), glow(Some(1))), of(None, glow(Some(1))), of(None, glow(None)), of(Some(0), None)];
    let job = job(&scene, &shades, camera(1.25), 150, 120, ALL);
    let sun = job.sun.expect("the job has light").color.extend(1.0);
    for set in InstructionSet::ALL {
        let Some(mut rasteriser) = CpuRasteriser::with_instruction_set(set) else { continue };
        let mut target = GBuffer::new(150, 120, ALL);
        rasteriser.draw(&job, &mut target).expect("drawn");
        let mut seen = [0; 4];
        for (index, id) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
            let material = (*id % 4) as usize;
            let lit = shades[material].diffuse * sun * target.position[index][3];
            let red = Vec4::new(1.0, 0.0, 0.2, 1.0);
            let lamp = color * Vec3::new(0.2, 1.0, 0.4);
            let expected = match material {
                0 => (lit + shades[0].emission + 0.3) * red + lamp.extend(0.0),
                1 => lit + shades[1].diffuse * 0.3 + lamp.extend(0.0),
                2 => lit + shades[2].diffuse * 0.3 + color.extend(0.0),
                _ => (lit + shades[3].emission + 0.3) * red,
            };
            let error = (Vec4::from(target.color[index]) - expected).abs().max_element();
            assert!(error < 2e-6, "{set:?}, pixel {index} of triangle {id}: {:?}, not {expected}", target.color[index]);
            seen[material] += 1;
        }
        assert!(seen.iter().all(|seen| *seen > 1000), "{seen:?}");
    }
}

#[test]
fn colours_of_vertices_multiply_what_is_reflected_and_not_what_is_sent_out() {
    // One large triangle seen at an angle: the colours between its corners are perspective-correct.
    let corners = [Vec3::new(-9.0, -6.0, -12.0), Vec3::new(12.0, -5.0, -30.0), Vec3::new(0.0, 9.0, -16.0)];
    let mut scene = common::triangles(&[corners]);
    scene.textures = vec![Texture::new("red".to_owned(), 4, 4, vec![[255, 0, 51, 255]; 16])];
    let colors = [Vec4::new(1.0, 0.0, 0.5, 1.0), Vec4::new(0.0, 1.0, 0.5, 0.25), Vec4::new(0.2, 0.4, 0.0, 0.0)];
    scene.geometry.colors = colors.to_vec();
    let glow = Vec3::new(0.5, 0.0, 0.25);
    // The vertex colour at a point of the triangle's plane, in double precision.
    let tint_at = |position: [f32; 4]| {
        let at = Vec4::from(position).truncate().as_dvec3();
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        let area = normal.length_squared();
        let (u, v) = ((at - a).cross(c - a).dot(normal) / area, (b - a).cross(at - a).dot(normal) / area);
        let [ca, cb, cc] = colors.map(|color| color.as_dvec4());
        (ca * (1.0 - u - v) + cb * u + cc * v).as_vec4()
    };
    let mut whole: Option<GBuffer> = None;
    for (texture, cutoff) in [(None, None), (Some(0), None), (None, Some(0.5)), (Some(0), Some(0.5))] {
        let glow_shade = Some(Glow { color: glow, texture: None });
        let shades = [Shade { texture, vertex_colors: true, alpha_cutoff: cutoff, glow: glow_shade, ..grey() }];
        let job = job(&scene, &shades, camera(1.25), 150, 120, ALL);
        let sun = job.sun.expect("the job has light").color.extend(1.0);
        for set in InstructionSet::ALL {
            let Some(mut rasteriser) = CpuRasteriser::with_instruction_set(set) else { continue };
            let mut target = GBuffer::new(150, 120, ALL);
            rasteriser.draw(&job, &mut target).expect("drawn");
            let mut seen = 0;
            for (index, _) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
                let tint = tint_at(target.position[index]);
                assert!(cutoff.is_none_or(|cutoff| tint.w > cutoff - 1e-4), "{tint} is a hole");
                let lit = shades[0].diffuse * sun * target.position[index][3];
                let reflected = match texture {
                    Some(_) => (lit + shades[0].emission + 0.3) * Vec4::new(1.0, 0.0, 0.2, 1.0),
                    None => lit + shades[0].diffuse * 0.3,
                };
                let expected = reflected * tint + glow.extend(0.0);
                let error = (Vec4::from(target.color[index]) - expected).abs().max_element();
                assert!(error < 2e-5, "{set:?}, pixel {index}: {:?}, not {expected}", target.color[index]);
                seen += 1;
            }
            assert!(seen > 1500, "{seen} pixels");
            // Pixels that only the uncut triangle covers have an alpha below the cutoff.
            if let (Some(cutoff), Some(whole)) = (cutoff, &whole) {
                let holes = (0..target.triangle.len()).filter(|pixel| target.triangle[*pixel] == NO_TRIANGLE);
                let holes: Vec<usize> = holes.filter(|pixel| whole.triangle[*pixel] != NO_TRIANGLE).collect();
                assert!(holes.len() > 500, "{} pixels are cut out", holes.len());
                assert!(holes.iter().all(|pixel| tint_at(whole.position[*pixel]).w < cutoff + 1e-4));
            }
            whole = whole.or(Some(target));
        }
    }
    let mut bare = scene.clone();
    bare.geometry.colors.clear();
    let shades = [Shade { vertex_colors: true, ..grey() }];
    let error = CpuRasteriser::new()
        .draw(&job(&bare, &shades, camera(1.25), 150, 120, ALL), &mut GBuffer::new(150, 120, ALL))
        .expect_err("there are no colours");
    assert!(error.to_string().contains("vertex colours"), "{error}");
}

#[test]
fn a_normal_map_tilts_normals_and_their_light_by_a_known_angle() {
    // A quad seen at an angle. u grows along its first edge and v along the second; mirrored, they are swapped.
    let (origin, right, up) = (Vec3::new(-6.0, -5.0, -14.0), Vec3::new(11.0, 1.0, -6.0), Vec3::new(-0.5, 11.0, 2.0));
    let up = up - right * (up.dot(right) / right.length_squared());
    let corners = [origin, origin + right, origin + right + up, origin + up];
    let mut scene = common::triangles(&[[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]);
    let normal = right.cross(up).normalize();
    scene.geometry.normals = vec![normal; 6];
    let texel = [214, 86, 230, 255];
    scene.textures = vec![Texture::new("bumps".to_owned(), 4, 4, vec![texel; 16])];
    let [x, y, z] = [0, 1, 2].map(|axis: usize| f64::from(texel[axis]) / 255.0 * 2.0 - 1.0);
    for (side, scale) in [(1.0, 1.0), (-1.0, 1.0), (1.0, 0.5), (-1.0, -2.0)] {
        scene.geometry.tangents = vec![right.normalize().extend(side); 6];
        let normal_map = Some(NormalMap { texture: 0, scale });
        let shades = [Shade { normal_map, ..grey() }];
        let (u, v) = (right.as_dvec3().normalize(), up.as_dvec3().normalize() * f64::from(side));
        let tilted = (u * x * f64::from(scale) + v * y * f64::from(scale) + normal.as_dvec3() * z).normalize();
        let faces =
            |to_light: Vec3| if normal.dot(to_light) > 0.0 { tilted.dot(to_light.as_dvec3()).max(0.0) } else { 0.0 };
        // Three lights: one that surface and bumps both face, one that only the surface faces, and one that only the
        // bumps face.
        let tilt = tilted.as_vec3();
        let lights = [normal + tilt, normal - 0.98 * tilt, tilt - 1.02 * normal * tilt.dot(normal)];
        for to_light in lights.map(|to_light| to_light.normalize()) {
            let sun = Some(Sun { direction: -to_light, color: Vec3::ONE });
            for attachments in [ALL, Attachments { normal: true, triangle: true, ..Attachments::default() }] {
                let job = RasterJob { sun, ..job(&scene, &shades, camera(1.25), 150, 120, attachments) };
                for set in InstructionSet::ALL {
                    let Some(mut rasteriser) = CpuRasteriser::with_instruction_set(set) else { continue };
                    let mut target = GBuffer::new(150, 120, attachments);
                    rasteriser.draw(&job, &mut target).expect("drawn");
                    let mut seen = 0;
                    for (index, _) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
                        let found = Vec4::from(target.normal[index]).truncate().as_dvec3();
                        assert!(found.distance(tilted) < 2e-6, "{set:?} {side} {scale}: {found}, not {tilted}");
                        if attachments == ALL {
                            let cosine = f64::from(target.position[index][3]);
                            assert!((cosine - faces(to_light)).abs() < 2e-6, "{cosine}, not {}", faces(to_light));
                        }
                        seen += 1;
                    }
                    assert!(seen > 3000, "{seen} pixels");
                }
            }
        }
        let lit: Vec<bool> = lights.iter().map(|to_light| faces(to_light.normalize()) > 0.0).collect();
        assert_eq!(lit, [true, false, false]);
    }
    // A map of scale 0 leaves the picture as without a map, up to rounding. A scene without tangents is refused.
    let flat = [Shade { normal_map: Some(NormalMap { texture: 0, scale: 0.0 }), ..grey() }];
    let draw = |shades: &[Shade]| {
        let mut target = GBuffer::new(150, 120, ALL);
        CpuRasteriser::new().draw(&job(&scene, shades, camera(1.25), 150, 120, ALL), &mut target).map(|_| target)
    };
    let [bent, plain] = [draw(&flat).expect("drawn"), draw(&[grey()]).expect("drawn")];
    let same = |a: &[[f32; 4]], b: &[[f32; 4]]| {
        a.iter().zip(b).all(|(a, b)| (Vec4::from(*a) - Vec4::from(*b)).length() < 1e-6)
    };
    assert!(same(&bent.normal, &plain.normal) && same(&bent.color, &plain.color) && bent.position.len() == 150 * 120);
    let mut bare = scene.clone();
    bare.geometry.tangents.clear();
    let error = CpuRasteriser::new()
        .draw(&job(&bare, &flat, camera(1.25), 150, 120, ALL), &mut GBuffer::new(150, 120, ALL))
        .expect_err("there are no tangents");
    assert!(error.to_string().contains("normal maps"), "{error}");
}

#[test]
fn triangles_side_by_side_have_their_own_textures_or_none() {
    let mut scene = soup(0, 300, 4);
    let solid = |name: &str, size: u32, texel: [u8; 4]| {
        Texture::new(name.to_owned(), size, size, vec![texel; (size * size) as usize])
    };
    scene.textures = vec![solid("red", 16, [255, 0, 51, 255]), solid("green", 128, [51, 255, 0, 255])];
    scene.geometry.batches = (0..300).map(|first| Batch { material: first % 3, first, count: 1 }).collect();
    let shades = [Some(0), Some(1), None].map(|texture| Shade { texture, ..grey() });
    let job = job(&scene, &shades, camera(1.25), 150, 120, ALL);
    let sun = job.sun.expect("the job has light").color.extend(1.0);
    for set in InstructionSet::ALL {
        let Some(mut rasteriser) = CpuRasteriser::with_instruction_set(set) else { continue };
        let mut target = GBuffer::new(150, 120, ALL);
        rasteriser.draw(&job, &mut target).expect("drawn");
        let mut seen = [0; 3];
        for (index, id) in target.triangle.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
            let material = (*id % 3) as usize;
            let lit = shades[material].diffuse * sun * target.position[index][3];
            let expected = match material {
                0 => (lit + shades[0].emission + 0.3) * Vec4::new(1.0, 0.0, 0.2, 1.0),
                1 => (lit + shades[1].emission + 0.3) * Vec4::new(0.2, 1.0, 0.0, 1.0),
                _ => lit + shades[2].diffuse * 0.3,
            };
            let error = (Vec4::from(target.color[index]) - expected).abs().max_element();
            assert!(error < 1e-6, "{set:?}, pixel {index} of triangle {id}: {:?}, not {expected}", target.color[index]);
            seen[material] += 1;
        }
        assert!(seen.iter().all(|seen| *seen > 1000), "{seen:?}");
    }
}

#[test]
fn back_faces_of_culled_materials_are_left_out_and_nothing_else() {
    // Random triangles, centred in a cube around the eye. Those that lie partly behind the eye are clipped.
    let mut numbers = 1_u32;
    let mut next = || {
        numbers = numbers.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (numbers >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let corners: Vec<[Vec3; 3]> = (0..300)
        .map(|_| {
            let center = Vec3::new(next() * 60.0, next() * 60.0, next() * 60.0);
            [0; 3].map(|_| center + Vec3::new(next(), next(), next()) * 40.0)
        })
        .collect();
    let mut scene = common::triangles(&corners);
    scene.geometry.batches =
        vec![Batch { material: 0, first: 0, count: 150 }, Batch { material: 1, first: 150, count: 150 }];
    let shades = [grey(), grey()];
    let all = job(&scene, &shades, camera(1.25), 160, 128, ALL);
    let eye = all.view.eye;
    let backs = |target: &GBuffer, material: u32| {
        let seen = target.triangle.iter().filter(|id| **id != NO_TRIANGLE && (**id >= 150) == (material == 1));
        seen.filter(|id| {
            let [a, b, c] = scene.geometry.corners(**id);
            (b - a).cross(c - a).dot(eye - a) < 0.0
        })
        .count()
    };
    let both = draw(&all);
    assert!(backs(&both, 0) > 1000 && backs(&both, 1) > 1000, "control: {} {}", backs(&both, 0), backs(&both, 1));
    let culled = draw(&RasterJob { culled: &[false, true], ..all });
    assert!(backs(&culled, 0) > 1000 && backs(&culled, 1) == 0);
    // The remaining triangles look as if the culled ones did not exist.
    let mut fronts = scene.clone();
    for id in 150..300 {
        let [a, b, c] = scene.geometry.corners(id);
        if (b - a).cross(c - a).dot(eye - a) < 0.0 {
            let first = fronts.geometry.triangles[id as usize][0];
            fronts.geometry.triangles[id as usize] = [first; 3];
        }
    }
    let expected = draw(&RasterJob { scene: &fronts, ..all });
    let differing = expected.triangle.iter().zip(&culled.triangle).filter(|(a, b)| a != b).count();
    // The orientation of a triangle seen edge-on may flip when its corners are rounded.
    assert!(differing < 20, "{differing}");
}

#[test]
fn where_alpha_is_cut_what_is_behind_is_seen() {
    let mut scene = textured_floor(|x, _| if x < 32 { 255 } else { 0 });
    // A wall of another material behind the floor, drawn after it.
    let base = scene.geometry.positions.len() as u32;
    scene
        .geometry
        .positions
        .extend([(-400.0, -200.0), (400.0, -200.0), (0.0, 400.0)].map(|(x, y)| Vec3::new(x, y, -70.0)));
    scene.geometry.normals.extend([Vec3::Z; 3]);
    scene.geometry.texcoords.extend([Vec2::ZERO; 3]);
    scene.geometry.triangles.push([base, base + 1, base + 2]);
    scene.geometry.batches.push(Batch { material: 1, first: 2, count: 1 });
    let floor = Shade { texture: Some(0), alpha_cutoff: Some(0.5), ..grey() };
    let shades = [floor, grey()];
    let job = job(&scene, &shades, camera(1.25), 160, 128, ALL);
    let cut = draw(&job);
    let whole_shades = [Shade { alpha_cutoff: None, ..floor }, grey()];
    let whole = draw(&RasterJob { shades: &whole_shades, ..job });
    let mut counts = [0, 0];
    for (index, id) in whole.triangle.iter().enumerate().filter(|(_, id)| **id < 2) {
        let alpha = whole.color[index][3] / (1.0 * whole.position[index][3] + 1.0 + 0.3);
        if (alpha - 0.5).abs() > 0.02 {
            assert_eq!(cut.triangle[index], if alpha > 0.5 { *id } else { 2 }, "alpha {alpha}");
            counts[usize::from(alpha > 0.5)] += 1;
        }
    }
    assert!(counts.iter().all(|count| *count > 1000), "{counts:?}");
    // The alpha of the diffuse colour has no effect: a cut-out drawn with another material keeps its shape.
    let mapped = Shade { diffuse: Vec4::new(1.0, 0.0, 1.0, 0.0), ..floor };
    assert_eq!(draw(&RasterJob { shades: &[mapped, grey()], ..job }).triangle, cut.triangle);
    // Without a texture nothing is cut out, and with an infinite cutoff everything is.
    let bare = Shade { texture: None, ..mapped };
    assert_eq!(draw(&RasterJob { shades: &[bare, grey()], ..job }).triangle, whole.triangle);
    let gone = Shade { alpha_cutoff: Some(f32::INFINITY), ..floor };
    let none = draw(&RasterJob { shades: &[gone, grey()], ..job });
    assert!(none.triangle.iter().all(|id| *id == 2 || *id == NO_TRIANGLE));
}

#[test]
fn a_viewport_is_drawn_as_a_picture_of_its_own_and_nothing_outside_is_touched() {
    let (scene, shades) = (soup(0, 300, 3), [grey()]);
    let whole = draw(&job(&scene, &shades, camera(1.25), 100, 80, ALL));
    let viewport = Rect { x: 37, y: 21, width: 100, height: 80 };
    let job = RasterJob { viewport, ..job(&scene, &shades, camera(1.25), 100, 80, ALL) };
    let mut target = GBuffer::new(150, 130, ALL);
    let mark = [7.0, 8.0, 9.0, 10.0];
    target.color.fill(mark);
    target.position.fill(mark);
    target.normal.fill(mark);
    target.triangle.fill(123_456);
    CpuRasteriser::new().draw(&job, &mut target).expect("drawn");
    let mut different = 0;
    for y in 0..130u32 {
        for x in 0..150u32 {
            let index = (y * 150 + x) as usize;
            if (37..137).contains(&x) && (21..101).contains(&y) {
                // In a viewport with an offset, screen coordinates have other rounding errors in 32-bit floats, so
                // single corners may snap differently.
                different += usize::from(target.triangle[index] != whole.triangle[((y - 21) * 100 + x - 37) as usize]);
            } else {
                let all = [target.color[index], target.position[index], target.normal[index]];
                assert_eq!((all, target.triangle[index]), ([mark; 3], 123_456), "outside, at {x}, {y}");
            }
        }
    }
    assert!(different < 8, "{different} pixels differ");
    let seen = common::reference::draw(&job);
    let rows = (21..101).flat_map(|y| (37..137).map(move |x| y * 150 + x));
    let ids: Vec<u32> = rows.map(|index| target.triangle[index]).collect();
    assert_eq!(common::reference::compare(&seen, &ids).wrong, 0);
}

#[test]
fn attachments_that_are_not_asked_for_stay_empty_and_do_not_change_the_others() {
    let (scene, shades) = (soup(0, 300, 4), [grey()]);
    let all = draw(&job(&scene, &shades, camera(1.0), 100, 100, ALL));
    for asked in 0..16u32 {
        let bit = |index: u32| asked >> index & 1 == 1;
        let attachments = Attachments { color: bit(0), position: bit(1), normal: bit(2), triangle: bit(3) };
        let some = draw(&job(&scene, &shades, camera(1.0), 100, 100, attachments));
        assert!(if bit(0) { some.color == all.color } else { some.color.is_empty() }, "{attachments:?}");
        assert!(if bit(1) { some.position == all.position } else { some.position.is_empty() }, "{attachments:?}");
        assert!(if bit(2) { some.normal == all.normal } else { some.normal.is_empty() }, "{attachments:?}");
        assert!(if bit(3) { some.triangle == all.triangle } else { some.triangle.is_empty() }, "{attachments:?}");
    }
}

#[test]
fn threads_and_instruction_sets_give_the_same_bits() {
    let mut sets = 0;
    for (scene, view) in [terrain(60), (soup(0, 400, 5), camera(1.0)), (soup(4, 60, 5), camera(1.0))] {
        let shades = [grey()];
        let job = job(&scene, &shades, view, 333, 222, ALL);
        let expected = draw(&job);
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            for set in InstructionSet::ALL {
                let Some(mut rasteriser) = CpuRasteriser::with_instruction_set(set) else {
                    println!("skipped: this processor has no {}", set.name());
                    continue;
                };
                let mut target = GBuffer::new(333, 222, ALL);
                pool.install(|| rasteriser.draw(&job, &mut target)).expect("drawn");
                assert!(same(&expected, &target), "{threads} threads, {}", set.name());
                // The state that a draw leaves does not affect the next.
                pool.install(|| rasteriser.draw(&job, &mut target)).expect("drawn");
                assert!(same(&expected, &target), "{threads} threads, {}, again", set.name());
                sets += 1;
            }
        }
        let mut other = expected.clone();
        other.normal[333 * 111 + 166][0] += f32::EPSILON;
        assert!(!same(&expected, &other), "the comparison sees one bit");
    }
    assert!(sets >= 9);
}

#[test]
fn of_equal_depths_the_first_triangle_stays() {
    let corner = [Vec3::new(2.0, 3.0, -0.5), Vec3::new(90.0, 10.0, -0.25), Vec3::new(30.0, 80.0, -0.75)];
    let scene = common::triangles(&[corner, corner, corner]);
    let ids = draw(&job(&scene, &[grey()], pixels(100, 100), 100, 100, ALL)).triangle;
    assert!(ids.iter().all(|id| *id == 0 || *id == NO_TRIANGLE));
    assert!(ids.iter().filter(|id| **id == 0).count() > 1000);
}

#[test]
fn corners_that_are_no_numbers_draw_nothing_and_jobs_that_do_not_fit_are_refused() {
    let good = soup(0, 20, 6);
    let mut scene = good.clone();
    for (vertex, value) in [(0, f32::NAN), (4, f32::INFINITY), (8, -f32::INFINITY), (9, f32::MAX), (13, -f32::MAX)] {
        scene.geometry.positions[vertex].x = value;
    }
    let shades = [grey()];
    let job = job(&scene, &shades, camera(1.0), 64, 64, ALL);
    let target = draw(&job);
    assert!(target.triangle.iter().all(|id| *id == NO_TRIANGLE || *id > 2));
    let mut rasteriser = CpuRasteriser::new();
    let outside = RasterJob { viewport: Rect { x: 1, y: 0, width: 64, height: 64 }, ..job };
    assert!(rasteriser.draw(&outside, &mut target.clone()).is_err());
    assert!(rasteriser.draw(&job, &mut GBuffer::new(64, 64, Attachments::default())).is_err());
    assert!(rasteriser.draw(&RasterJob { shades: &[], ..job }, &mut target.clone()).is_err());
    let textured = [Shade { texture: Some(3), ..grey() }];
    assert!(rasteriser.draw(&RasterJob { shades: &textured, ..job }, &mut target.clone()).is_err());
    let empty = RasterJob { viewport: Rect { x: 64, y: 64, width: 0, height: 0 }, ..job };
    assert!(rasteriser.draw(&empty, &mut target.clone()).is_ok());
}

/// The depth of a triangle is that of its own plane, not of a plane through the snapped corners. So a layer 0.8 mm
/// behind another, seen from 60 m, is visible nowhere, whatever the near plane.
#[test]
fn of_two_layers_close_together_the_nearer_one_is_seen() {
    let (mut covered, mut snapped) = (0, 0);
    for tilt in [0.3, 0.8, 1.1, 1.3] {
        for seed in 0..4 {
            let ((scene, behind), shades) = (common::layers(seed, tilt, 8e-4), [grey()]);
            for near in [0.01, 0.1, 1.0, 10.0] {
                let view = View::new(common::perspective(1.0, 1.0, near, 100.0), Vec3::ZERO);
                let job = job(&scene, &shades, view, 128, 128, ALL);
                let seen = |job: &RasterJob<'_>, layer: bool| {
                    let shows = |id: &&u32| **id != NO_TRIANGLE && (**id < behind) == layer;
                    draw(job).triangle.iter().filter(shows).count()
                };
                assert_eq!(seen(&job, true), 0, "tilt {tilt}, seed {seed}, near {near}");
                covered += seen(&job, false);
                snapped += seen(&RasterJob { snapped_depth: true, ..job }, true);
            }
        }
    }
    println!("none of {covered} pixels; by planes through snapped corners {snapped}");
    assert!(covered > 50_000 && snapped > 50, "{covered}, control: {snapped}");
}

/// Rays find holes in mip level 0 of a texture. These are holes for the camera too, however small they appear.
#[test]
fn holes_are_where_rays_find_them() {
    let scene = textured_floor(|x, y| if (x / 4 + y / 4).is_multiple_of(2) { 255 } else { 0 });
    let shades = [Shade { texture: Some(0), alpha_cutoff: Some(0.5), ..grey() }];
    let (width, height) = (160u32, 128u32);
    let job = job(&scene, &shades, camera(1.25), width, height, ALL);
    let target = draw(&job);
    let world = DMat4::from_cols_array(&job.view.clip_from_world.to_cols_array().map(f64::from)).inverse();
    let (mut looked_at, mut differ, mut by_level) = (0, 0, 0);
    for (index, id) in target.triangle.iter().enumerate() {
        let (x, y) = (f64::from(index as u32 % width) + 0.5, f64::from(index as u32 / width) + 0.5);
        let ndc = DVec2::new(x / f64::from(width) * 2.0 - 1.0, 1.0 - y / f64::from(height) * 2.0);
        let far = world.project_point3(ndc.extend(0.5));
        let at = far * (-1.0 / far.y);
        // Pixels at this distance are several texels long.
        if far.y >= 0.0 || !(-9.0..-4.0).contains(&at.z) {
            continue;
        }
        let uv = (DVec2::new(at.x, at.z) * 0.25).as_vec2();
        let solid = scene.textures[0].sample(uv, 0.0).w >= 0.5;
        looked_at += 1;
        differ += usize::from(solid != (*id != NO_TRIANGLE));
        by_level += usize::from(solid != (scene.textures[0].sample(uv, 3.0).w >= 0.5));
    }
    println!("{differ} of {looked_at} pixels differ; by a mip level {by_level}");
    assert!(looked_at > 1000 && differ * 50 < looked_at, "{differ} of {looked_at}");
    assert!(by_level * 4 > looked_at, "control: {by_level} of {looked_at}");
}
