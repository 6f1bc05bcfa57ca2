//! Exact spheres, against lines of sight in `f64`; and one sphere against a mesh of 20,480 facets.

use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{
    Attachments, GBuffer, LoadStore, NO_TRIANGLE, PixelCone, RasterJob, Rasteriser, RayBackend, RayJob, Rect, Shade,
    Sun, View,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, GlassRule, Shape};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RasterProgram, RayParams, RayProgram};
use curitiba_pipeline::scene::{Batch, Material, RenderScene, Sphere};
use glam::camera::rh;
use glam::{DVec3, Mat4, Vec3, Vec4};
use std::sync::Arc;
use std::time::Instant;

const ALL: Attachments = Attachments { color: true, position: true, normal: true, triangle: true };
const NEAR: f32 = 0.5;
const FAR: f32 = 100.0;

/// A camera, by its parameters.
#[derive(Clone, Copy)]
pub struct Eye {
    pub at: Vec3,
    pub towards: Vec3,
    /// In perspective, the tangent of half the field of view is 1. Without, half the height is 4.
    pub perspective: bool,
    pub size: [u32; 2],
}

impl Eye {
    pub fn view(&self) -> View {
        let to_view: Mat4 = rh::view::look_to_mat4(self.at, self.towards, Vec3::Y);
        let aspect = self.size[0] as f32 / self.size[1] as f32;
        let project = if self.perspective {
            // Depth 1 at the near plane and 0 at the far one.
            let (a, b) = (NEAR / (FAR - NEAR), NEAR * FAR / (FAR - NEAR));
            Mat4::from_cols(Vec4::X / aspect, Vec4::Y, Vec4::new(0.0, 0.0, a, -1.0), Vec4::new(0.0, 0.0, b, 0.0))
        } else {
            let scale = 1.0 / (FAR - NEAR);
            Mat4::from_cols(
                Vec4::X / (4.0 * aspect),
                Vec4::Y / 4.0,
                Vec4::new(0.0, 0.0, scale, 0.0),
                Vec4::new(0.0, 0.0, FAR * scale, 1.0),
            )
        };
        View::new(project * to_view, self.at)
    }

    /// The line of sight through a pixel: origin, unit direction, and the distances to the near and the far plane.
    fn line(&self, x: u32, y: u32) -> (DVec3, DVec3, [f64; 2]) {
        let forward = self.towards.as_dvec3().normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let [width, height] = self.size.map(f64::from);
        let (across, above) = ((2.0 * f64::from(x) + 1.0 - width) / height, 1.0 - (2.0 * f64::from(y) + 1.0) / height);
        let (eye, [near, far]) = (self.at.as_dvec3(), [NEAR, FAR].map(f64::from));
        if self.perspective {
            let direction = (forward + right * across + up * above).normalize();
            let cos = direction.dot(forward);
            (eye, direction, [near / cos, far / cos])
        } else {
            (eye + right * across * 4.0 + up * above * 4.0, forward, [near, far])
        }
    }
}

/// Spheres of two materials in front of, in and behind a slanted wall.
pub fn scene() -> RenderScene {
    let mut scene = RenderScene { materials: vec![Material::default(); 3], ..RenderScene::default() };
    let geometry = &mut scene.geometry;
    geometry.positions = vec![
        Vec3::new(-9.0, -9.0, -6.0),
        Vec3::new(9.0, -9.0, -9.0),
        Vec3::new(9.0, 3.0, -9.0),
        Vec3::new(-9.0, 3.0, -6.0),
    ];
    let normal = (geometry.positions[1] - geometry.positions[0]).cross(Vec3::Y).normalize();
    geometry.normals = vec![-normal; 4];
    geometry.triangles = vec![[0, 1, 2], [0, 2, 3]];
    geometry.batches = vec![Batch { material: 0, first: 0, count: 2 }];
    let sphere = |x, y, z, radius, material| Sphere { center: Vec3::new(x, y, z), radius, material };
    geometry.spheres = vec![
        sphere(0.0, 0.0, -4.0, 1.0, 1),
        sphere(0.7, 0.4, -3.6, 0.6, 1),
        sphere(-2.5, 0.5, -7.0, 1.5, 1),
        sphere(3.0, 2.9, -20.0, 4.0, 1),
        sphere(1.5, -1.2, -2.5, 0.01, 2),
        sphere(-1.0, -1.0, -0.6, 0.3, 2),
        sphere(0.0, 1.6, -90.0, 15.0, 2),
        sphere(0.0, 0.0, 5.0, 2.0, 2),
        sphere(40.0, 0.0, -3.0, 1.0, 2),
    ];
    scene
}

/// The first hit of a line of sight: distance, id, point and normal. The flag tells whether an outline, an edge, the near or far plane or a
/// second surface is so close that rounding may decide.
fn first_hit(scene: &RenderScene, eye: &Eye, x: u32, y: u32) -> (Option<(f64, u32, DVec3, DVec3)>, bool) {
    let (origin, direction, [near, far]) = eye.line(x, y);
    let mut hits: Vec<(f64, u32, DVec3, DVec3)> = Vec::new();
    let mut doubtful = false;
    let geometry = &scene.geometry;
    let [a, b, _, d] = [0, 1, 2, 3].map(|vertex: usize| geometry.positions[vertex].as_dvec3());
    let normal = (b - a).cross(d - a).normalize();
    let t = (a - origin).dot(normal) / direction.dot(normal);
    let at = origin + direction * t;
    let (u, v) = ((at - a).dot(b - a) / (b - a).length_squared(), (at - a).dot(d - a) / (d - a).length_squared());
    if t > 0.0 && (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v) {
        hits.push((t, u32::from(u < v), at, normal));
    }
    doubtful |= [u, v].iter().any(|share| share.abs() < 2e-3 || (share - 1.0).abs() < 2e-3) || (u - v).abs() < 2e-3;
    for (sphere, id) in geometry.spheres.iter().zip(2..) {
        let (from, radius) = (origin - sphere.center.as_dvec3(), f64::from(sphere.radius));
        let b = -from.dot(direction);
        let nearest = (from + b * direction).length();
        doubtful |= (nearest - radius).abs() < 2e-4 * radius.max(0.01 * b.abs());
        if nearest < radius {
            let half = (radius * radius - nearest * nearest).sqrt();
            for t in [b - half, b + half] {
                let at = origin + direction * t;
                hits.push((t, id, at, (at - sphere.center.as_dvec3()) / radius));
            }
        }
    }
    doubtful |= hits.iter().any(|(t, ..)| (t - near).abs() < 1e-5 || (t - far).abs() < 1e-2);
    hits.retain(|(t, ..)| *t > near && *t < far);
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    doubtful |= hits.len() > 1 && hits[1].0 - hits[0].0 < 1e-4 * hits[0].0;
    (hits.first().copied(), doubtful)
}

pub fn shades() -> Vec<Shade> {
    [Vec4::ONE, Vec4::new(0.8, 0.3, 0.2, 1.0), Vec4::new(0.1, 0.6, 0.9, 0.5)]
        .map(|diffuse| Shade { diffuse, ..Shade::default() })
        .to_vec()
}

#[test]
fn every_pixel_shows_what_its_line_of_sight_meets() {
    meets_lines_of_sight(&mut CpuRasteriser::new(), 1.0);
}

/// Asserts that a rasteriser draws the hits of lines of sight with known origins and directions. Errors may be `times` as large as those
/// of the processor's rasteriser.
pub fn meets_lines_of_sight(rasteriser: &mut dyn Rasteriser, times: f64) {
    let (scene, shades) = (Arc::new(scene()), shades());
    rasteriser.upload(&scene).expect("uploads");
    let mut draw = |job: &RasterJob<'_>, target: &mut GBuffer| {
        rasteriser.draw(job, target).expect("a whole job");
        rasteriser.read_back(job, ALL, target).expect("reads back");
    };
    let towards = Vec3::new(0.1, -0.05, -1.0).normalize();
    for (at, perspective, size) in [
        (Vec3::ZERO, true, [200, 150]),
        (Vec3::new(0.1, 0.2, -3.9), true, [131, 97]),
        (Vec3::new(0.3, 0.1, 1.0), false, [160, 160]),
        // The eye is inside a sphere whose near side is in front of the near plane.
        (Vec3::new(0.0, 0.0, 4.0), true, [64, 64]),
    ] {
        let eye = Eye { at, towards, perspective, size };
        let sun = Sun { direction: Vec3::new(0.3, -0.8, -0.4).normalize(), color: Vec3::new(0.9, 0.8, 0.7) };
        let [width, height] = size;
        let viewport = Rect { x: 0, y: 0, width, height };
        let clear_color = Vec4::new(0.1, 0.2, 0.3, 0.0);
        let job = RasterJob {
            scene: &scene,
            program: RasterProgram::Deferred,
            view: eye.view(),
            lights: &[],
            sun: Some(sun),
            shades: &shades,
            culled: &[],
            viewport,
            clear_color,
            attachments: ALL,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        };
        let mut target = GBuffer::try_new(width, height, ALL).expect("memory");
        draw(&job, &mut target);
        let (mut compared, mut spheres, mut seen) = (0, 0, [0; 12]);
        for (index, id) in target.triangle.iter().enumerate() {
            let (x, y) = (index as u32 % width, index as u32 / width);
            let (hit, doubtful) = first_hit(&scene, &eye, x, y);
            if doubtful {
                continue;
            }
            compared += 1;
            let Some((t, expected, point, normal)) = hit else {
                assert_eq!((*id, target.color[index]), (NO_TRIANGLE, clear_color.to_array()), "{at} {x} {y}");
                continue;
            };
            assert_eq!(*id, expected, "{at} {x} {y} at {t}");
            seen[expected as usize] += 1;
            if expected < 2 {
                continue;
            }
            spheres += 1;
            let sphere = scene.geometry.sphere(expected).expect("one");
            let found = Vec4::from_array(target.position[index]);
            // The view matrix is a product of `f32` matrices. At the outline of a sphere, the hit moves along the sphere
            // by the square root of the product's error.
            let off = found.truncate().as_dvec3().distance(point);
            let rim = normal.dot((point - at.as_dvec3()).normalize()).abs().max(0.02);
            assert!(off < times * 3e-6 * (1.0 + t) / rim, "{at} {x} {y} {expected}: {off} at {t}, {rim}");
            let radius = found.truncate().as_dvec3().distance(sphere.center.as_dvec3());
            assert!((radius - f64::from(sphere.radius)).abs() < times * 2e-7 * (1.0 + t), "it lies on the sphere");
            let outward = Vec4::from_array(target.normal[index]).truncate();
            let exact = ((found.truncate() - sphere.center) / sphere.radius).normalize();
            assert!(
                outward.distance(exact) < (times * 1e-6 * (1.0 + t)) as f32 / sphere.radius && outward.is_normalized()
            );
            let light = outward.dot(-sun.direction).max(0.0);
            assert!(f64::from((found.w - light).abs()) < times * 1e-6);
            let diffuse = shades[sphere.material as usize].diffuse;
            let color = diffuse * 0.3 + diffuse * sun.color.extend(1.0) * light;
            assert!(Vec4::from_array(target.color[index]).distance(color) < times as f32 * 1e-5);
        }
        let all = (width * height) as usize;
        assert!(compared * 100 > all * 90 && spheres * 20 > all, "{at}: {compared} of {all}, {spheres} {seen:?}");
        // Culling removes the inner side of a sphere, as it removes back faces.
        if at.z > 3.0 {
            assert!(seen[9] * 2 > all, "inside the eighth sphere: {seen:?}");
            let outside = RasterJob { culled: &[false, false, true], ..job };
            draw(&outside, &mut target);
            assert!(target.triangle.iter().all(|id| *id != 9));
        }
    }
}

/// The facets of a sphere of radius 1, 20 times 4^levels, with the sphere's normals.
fn facets(levels: u32) -> RenderScene {
    let golden = (1.0 + 5_f32.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        corners.extend([Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)]);
    }
    let edge = 2.1;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let near = |one: usize, other: usize| corners[one].distance(corners[other]) < edge;
                if near(a, b) && near(b, c) && near(a, c) {
                    let [a, b, c] = [corners[a], corners[b], corners[c]].map(Vec3::normalize);
                    let outwards = (b - a).cross(c - a).dot(a) > 0.0;
                    faces.push(if outwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..levels {
        let split = |[a, b, c]: &[Vec3; 3]| {
            let [ab, bc, ca] = [*a + *b, *b + *c, *c + *a].map(Vec3::normalize);
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
        };
        faces = faces.iter().flat_map(split).collect();
    }
    let mut scene = RenderScene { materials: vec![Material::default()], ..RenderScene::default() };
    let count = faces.len() as u32;
    scene.geometry.positions = faces.into_flattened();
    scene.geometry.normals.clone_from(&scene.geometry.positions);
    scene.geometry.triangles = (0..count).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    scene.geometry.batches = vec![Batch { material: 0, first: 0, count }];
    scene
}

/// Absorbing glass of index 1.5 in front of a white environment, against the sum over all inner reflections.
#[test]
fn a_sphere_is_nearer_to_the_closed_form_than_a_mesh_of_twenty_thousand_facets() {
    let mut ball = RenderScene { materials: vec![Material::default()], ..RenderScene::default() };
    ball.geometry.spheres = vec![Sphere { center: Vec3::ZERO, radius: 1.0, material: 0 }];
    let mesh = facets(5);
    assert_eq!(mesh.geometry.triangles.len(), 20_480);
    let eye = Eye { at: Vec3::new(0.0, 0.0, 3.0), towards: Vec3::NEG_Z, perspective: true, size: [160, 160] };
    let dielectric = Dielectric {
        shape: Shape::Solid,
        index: 1.5,
        extinction: Vec3::splat(0.5),
        filter: Vec3::ONE,
        ..Dielectric::default()
    };
    let errors = [("sphere", ball), ("mesh", mesh)].map(|(name, scene)| {
        let (scene, shades) = (Arc::new(scene), [Shade::default()]);
        let viewport = Rect { x: 0, y: 0, width: 160, height: 160 };
        let job = RasterJob {
            scene: &scene,
            program: RasterProgram::Deferred,
            view: eye.view(),
            lights: &[],
            sun: None,
            shades: &shades,
            culled: &[],
            viewport,
            clear_color: Vec4::ONE,
            attachments: ALL,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        };
        let mut target = GBuffer::try_new(160, 160, ALL).expect("memory");
        CpuRasteriser::new().draw(&job, &mut target).expect("a whole job");
        let params = RayParams { glass: GlassRule::Auto, depth: 8, ..RayParams::default() };
        let job = RayJob {
            from_camera: None,
            scene: &scene,
            program: RayProgram::Refraction,
            params,
            fidelity: Fidelity::Corrected,
            seed: 0,
            eye: eye.at,
            cone: PixelCone::default(),
            lights: &[],
            sun: Some(Sun { direction: Vec3::NEG_Y, color: Vec3::ONE }),
            origin: [0; 2],
            width: 160,
            height: 160,
            position: &target.position,
            normal: &target.normal,
            color: &target.color,
            triangle: &target.triangle,
            shared: None,
            beyond: Vec3::ONE,
            dielectrics: &[dielectric],
            shades: &shades,
            glass: &[true],
            shadow_glass: &[true],
        };
        let mut rays = CpuRays::new();
        rays.build(&scene, &[false]).expect("a structure");
        let mut output = Image::filled(160, 160, [0.0; 4]);
        let start = Instant::now();
        rays.run(&job, &mut output, &Progress::default()).expect("a whole job");
        let took = start.elapsed();
        let (mut sum, mut count, mut worst) = (0.0, 0, 0.0_f64);
        for (index, pixel) in output.pixels.iter().enumerate() {
            let (origin, direction, _) = eye.line(index as u32 % 160, index as u32 / 160);
            let b = origin.cross(direction).length();
            if b > 0.99 {
                continue;
            }
            let (cos, inner) = ((1.0 - b * b).sqrt(), (1.0 - b * b / 2.25).sqrt());
            let (s, p) = ((cos - 1.5 * inner) / (cos + 1.5 * inner), (1.5 * cos - inner) / (1.5 * cos + inner));
            let (r, a) = (0.5 * (s * s + p * p), (-inner).exp());
            let error = f64::from(pixel[0]) - (r + (1.0 - r).powi(2) * a / (1.0 - r * a));
            (sum, count, worst) = (sum + error * error, count + 1, worst.max(error.abs()));
        }
        let rmse = (sum / f64::from(count)).sqrt();
        println!("{name}: RMSE {rmse:.2e}, worst {worst:.2e} of {count} pixels; {took:?}");
        assert!(count > 2000);
        (rmse, worst)
    });
    let [(sphere, worst), (mesh, _)] = errors;
    assert!(sphere < 2e-6 && worst < 5e-5, "{sphere} {worst}");
    assert!(mesh > 50.0 * sphere, "control: facets are seen: {mesh}");
}
