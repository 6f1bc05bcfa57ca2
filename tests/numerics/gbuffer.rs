//! Stored positions of G-buffers: their error, and its effect on shadows and ambient occlusion.

use crate::trace_scenes::Random;
use curitiba_passes::cpu::trace;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_passes::trace::{Bvh, Double, Quality, Ray, Tracer};
use curitiba_pipeline::backend::{
    Attachments, GBuffer, LoadStore, NO_TRIANGLE, PixelCone, RasterJob, Rasteriser, RayJob, Rect, Shade, Sun, View,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::{Image, PixelFormat};
use curitiba_pipeline::programs::{Fidelity, RasterProgram, RayParams, RayProgram};
use curitiba_pipeline::scene::{BuildOptions, RenderScene};
use curitiba_pipeline::square;
use glam::camera::rh;
use glam::{DMat4, DVec3, Mat4, Vec3, Vec4};
use std::sync::Arc;

const SIDE: u32 = 128;
const NEAR: f32 = 0.3;
const FAR: f32 = 1000.0;

struct Setting {
    scene: Arc<RenderScene>,
    shades: Vec<Shade>,
    tree: Bvh,
    view: View,
    sun: Sun,
    buffer: GBuffer,
}

/// The generated square from the report's camera, moved by `offset`.
fn setting(offset: Vec3) -> Setting {
    let (mut scene, _) = RenderScene::build(square::generate(10_000).scene, &BuildOptions::default()).expect("sound");
    scene.geometry.positions.iter_mut().for_each(|position| *position += offset);
    for material in &mut scene.materials {
        material.alpha_cutoff = None;
    }
    let shades: Vec<Shade> =
        scene.materials.iter().map(|material| Shade { diffuse: material.diffuse, ..Shade::default() }).collect();
    let eye = Vec3::new(7.42, 18.61, -38.62) + offset;
    let toward = Vec3::new(0.31, -0.36, 0.87);
    let projection = rh::proj::directx::perspective(60_f32.to_radians(), 1.0, FAR, NEAR);
    let view = View::new(projection * rh::view::look_to_mat4(eye, toward.normalize(), Vec3::Y), eye);
    let sun = Sun { direction: Vec3::new(0.597, -0.390, 0.700).normalize(), color: Vec3::splat(0.9) };
    let attachments = Attachments { color: false, position: true, normal: true, triangle: true };
    let scene = Arc::new(scene);
    let mut buffer = GBuffer::new(SIDE, SIDE, attachments);
    let mut rasteriser = CpuRasteriser::new();
    rasteriser.upload(&scene).expect("enough memory");
    let viewport = Rect { x: 0, y: 0, width: SIDE, height: SIDE };
    let job = RasterJob {
        scene: &scene,
        program: RasterProgram::Deferred,
        view,
        lights: &[],
        sun: Some(sun),
        shades: &shades,
        culled: &[],
        viewport,
        clear_color: Vec4::ZERO,
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    };
    rasteriser.draw(&job, &mut buffer).expect("drawn");
    let tree = Bvh::build(&scene.geometry, &vec![false; scene.materials.len()], Quality::Balanced);
    Setting { scene, shades, tree, view, sun, buffer }
}

impl Setting {
    /// The red values that a program writes when it starts from these positions.
    fn run(&self, program: RayProgram, fidelity: Fidelity, position: &[[f32; 4]]) -> Vec<f32> {
        let none = vec![false; self.shades.len()];
        let job = RayJob {
            from_camera: None,
            origin: [0; 2],
            scene: &self.scene,
            program,
            params: RayParams { samples: 16, intensity: 1.0, ..RayParams::default() },
            fidelity,
            seed: 0,
            eye: self.view.eye,
            cone: PixelCone::default(),
            sun: Some(self.sun),
            lights: &[],
            width: SIDE,
            height: SIDE,
            position,
            normal: &self.buffer.normal,
            color: &[],
            triangle: if fidelity == Fidelity::Corrected { &self.buffer.triangle } else { &[] },
            shared: None,
            shades: &self.shades,
            glass: &none,
            shadow_glass: &none,
            beyond: Vec3::ZERO,
            dielectrics: &[],
        };
        let mut output = Image::filled(SIDE, SIDE, [f32::NAN; 4]);
        trace(&self.tree, &job, &mut output, &Progress::default()).expect("a complete job");
        output.pixels.iter().map(|pixel| pixel[0]).collect()
    }

    /// The positions of pixel centres, reconstructed from the depth that a buffer with this projection stores.
    fn rebuilt_from_depth(&self, projection: Mat4, store: fn(f64) -> f64) -> Vec<[f32; 4]> {
        let toward = Vec3::new(0.31, -0.36, 0.87).normalize();
        let clip = (projection * rh::view::look_to_mat4(self.view.eye, toward, Vec3::Y)).as_dmat4();
        let back: DMat4 = clip.inverse();
        let unproject = |(index, position): (usize, &[f32; 4])| {
            if self.buffer.triangle[index] == NO_TRIANGLE {
                return *position;
            }
            let at = clip * Vec4::from_array(*position).with_w(1.0).as_dvec4();
            let depth = store(at.z / at.w);
            let centre = |k: u32| (f64::from(k) + 0.5) / f64::from(SIDE) * 2.0 - 1.0;
            let (x, y) = (centre(index as u32 % SIDE), -centre(index as u32 / SIDE));
            // Unprojected in f32, as in a shader.
            let [column_x, column_y, column_z, column_w] = back.as_mat4().to_cols_array_2d().map(Vec4::from_array);
            let world = column_x * x as f32 + column_y * y as f32 + column_z * depth as f32 + column_w;
            (world / world.w).with_w(position[3]).to_array()
        };
        self.buffer.position.iter().enumerate().map(unproject).collect()
    }
}

/// Greatest angle between a unit vector and its value in a format, in degrees.
fn most_turned(format: PixelFormat, store: fn(f32) -> f32, read: fn(f32) -> f32) -> f64 {
    let mut random = Random::new(40);
    let normals: Vec<Vec3> = (0..200_000).map(|_| random.direction()).collect();
    let mut stored: Vec<[f32; 4]> =
        normals.iter().map(|n| n.to_array().map(store)).map(|[x, y, z]| [x, y, z, 0.0]).collect();
    format.round(&mut stored);
    let angle = |(normal, stored): (&Vec3, &[f32; 4])| {
        let kept = Vec3::from_slice(&stored[..3].iter().map(|v| read(*v)).collect::<Vec<_>>()).as_dvec3().normalize();
        kept.cross(normal.as_dvec3().normalize()).length().asin().to_degrees()
    };
    normals.iter().zip(&stored).map(angle).fold(0.0, f64::max)
}

#[test]
fn normals_in_16_bit_floats_are_off_by_a_fortieth_of_a_degree() {
    let half = most_turned(PixelFormat::Rgba16Float, |v| v, |v| v);
    let bytes = most_turned(PixelFormat::Rgba8Unorm, |v| 0.5 + 0.5 * v, |v| 2.0 * v - 1.0);
    println!("normals are turned by at most {half:.4} degrees in 16-bit floats, {bytes:.3} in bytes");
    assert!((0.015..0.025).contains(&half), "{half}");
    // Control: eight bits are coarser, by about the ratio of their steps.
    assert!((0.3..0.5).contains(&bytes), "{bytes}");
}

fn f16(position: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let mut rounded = position.to_vec();
    PixelFormat::Rgba16Float.round(&mut rounded);
    // The cosine is kept exact, because only positions are tested.
    rounded.iter_mut().zip(position).for_each(|(rounded, exact)| rounded[3] = exact[3]);
    rounded
}

/// The effect of a storage format: greatest distance from the exact position, number of false shadows by fidelity, and
/// error of the occlusion by fidelity.
#[derive(Debug)]
struct Effect {
    most: f64,
    shadows: [usize; 2],
    occlusion: [f64; 2],
}

fn effects(setting: &Setting) -> Vec<(&'static str, Effect)> {
    let exact = &setting.buffer.position;
    let reversed = rh::proj::directx::perspective(60_f32.to_radians(), 1.0, FAR, NEAR);
    let standard = rh::proj::directx::perspective(60_f32.to_radians(), 1.0, NEAR, FAR);
    let forms = [
        ("position f32", exact.clone()),
        ("position f16", f16(exact)),
        ("reversed depth f32", setting.rebuilt_from_depth(reversed, |depth| f64::from(depth as f32))),
        ("depth f32", setting.rebuilt_from_depth(standard, |depth| f64::from(depth as f32))),
        ("depth 24 bits", setting.rebuilt_from_depth(standard, |depth| (depth * 16_777_215.0).round() / 16_777_215.0)),
    ];
    // The reference: exact positions on their triangles.
    let truth =
        [RayProgram::DeferredShadows, RayProgram::Ssao].map(|program| setting.run(program, Fidelity::Corrected, exact));
    let covered: Vec<usize> = (0..exact.len()).filter(|index| setting.buffer.triangle[*index] != NO_TRIANGLE).collect();
    assert!(covered.len() > 10_000, "{}", covered.len());
    let mut found = Vec::new();
    for (name, position) in forms {
        let off = |index: &usize| {
            let [a, b] = [exact, &position].map(|p| Vec4::from_array(p[*index]).as_dvec4().truncate());
            (a - b).length()
        };
        let most = covered.iter().map(off).fold(0.0, f64::max);
        let mut effect = Effect { most, shadows: [0; 2], occlusion: [0.0; 2] };
        for (slot, fidelity) in [Fidelity::Corrected, Fidelity::Thesis].into_iter().enumerate() {
            let shadow = setting.run(RayProgram::DeferredShadows, fidelity, &position);
            effect.shadows[slot] = covered.iter().filter(|i| shadow[**i] != truth[0][**i]).count();
            // The fidelities have different noise, so each is compared with itself on exact positions.
            let own = if slot == 0 { truth[1].clone() } else { setting.run(RayProgram::Ssao, fidelity, exact) };
            let open = setting.run(RayProgram::Ssao, fidelity, &position);
            let square = covered.iter().map(|i| f64::from(open[*i] - own[*i]).powi(2)).sum::<f64>();
            effect.occlusion[slot] = (square / covered.len() as f64).sqrt();
        }
        println!(
            "{name}: {:.1e} off at most; shadows wrong at {} pixels (thesis {}), occlusion off by {:.4} (thesis {:.4}) of {}",
            effect.most,
            effect.shadows[0],
            effect.shadows[1],
            effect.occlusion[0],
            effect.occlusion[1],
            covered.len()
        );
        found.push((name, effect));
    }
    found
}

#[test]
fn far_from_the_origin_only_snapped_positions_keep_their_shadows() {
    let found = effects(&setting(Vec3::new(5000.0, 100.0, -3000.0)));
    let exact = &found[0].1;
    assert_eq!((exact.shadows[0], exact.occlusion[0]), (0, 0.0), "the truth itself");
    assert!(exact.shadows[1] > 500, "negative control, f32 positions as they are stored: {exact:?}");
    // Half a unit in the last place of a 16-bit float is 2 units of length here, so the stored position is far from the
    // pixel's point.
    assert!(found[1].1.most > 1.0, "{found:?}");
    // With the far plane projected to 1, depth loses the point as well. Reversed depth keeps it.
    assert!(found[2].1.shadows[0] <= 10 && found[3].1.shadows[0] > 50, "{found:?}");
}

#[test]
fn snapped_positions_make_every_stored_form_safe_and_stored_ones_do_not() {
    let found = effects(&setting(Vec3::ZERO));
    let of = |name: &str| &found.iter().find(|(form, _)| *form == name).expect("a form of the table").1;
    let (float, half) = (of("position f32"), of("position f16"));
    assert_eq!((float.shadows[0], float.occlusion[0]), (0, 0.0), "the truth itself");
    let depths = [of("reversed depth f32").most, of("depth f32").most, of("depth 24 bits").most];
    assert!(depths[0] * 5.0 < depths[1].min(depths[2]) && half.most > depths[1], "{depths:?} {}", half.most);
    // In corrected fidelity, a format moves shadow edges by its error and makes no false shadow.
    for (name, effect) in &found {
        assert!(effect.shadows[0] <= 60, "{name}: {effect:?}");
    }
    // In thesis fidelity, rays start at the stored positions.
    assert!(half.shadows[1] > 20 * half.shadows[0].max(20), "negative control: {half:?}");
    assert!(half.occlusion[1] > 5.0 * half.occlusion[0].max(0.005), "negative control: {half:?}");
}

/// Draws the square with and without `snapped_depth`, the former and the present rule for depth. Among the pixels that then show
/// different triangles, counts those that show, by each rule, a triangle farther by more than a millionth than the first hit in
/// `f64`. In the other pixels, surfaces are coplanar, or an outline passes nearby.
#[test]
fn the_rule_for_depth_changes_the_square_only_where_surfaces_lie_in_one_plane() {
    let Setting { scene, shades, view, sun, .. } = setting(Vec3::ZERO);
    let side = 640;
    let viewport = Rect { x: 0, y: 0, width: side, height: side };
    let attachments = Attachments { triangle: true, ..Attachments::default() };
    let mut rasteriser = CpuRasteriser::new();
    rasteriser.upload(&scene).expect("enough memory");
    let drawn = [true, false].map(|snapped_depth| {
        let mut buffer = GBuffer::new(side, side, attachments);
        let job = RasterJob {
            scene: &scene,
            program: RasterProgram::Deferred,
            view,
            lights: &[],
            sun: Some(sun),
            shades: &shades,
            culled: &[],
            viewport,
            clear_color: Vec4::ZERO,
            attachments,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth,
            load_store: LoadStore::default(),
        };
        rasteriser.draw(&job, &mut buffer).expect("drawn");
        buffer.triangle
    });
    let exact = Double::build(&scene.geometry, &vec![false; scene.materials.len()]);
    let world_from_clip = view.clip_from_world.as_dmat4().inverse();
    let (mut changed, mut wrong) = (0, [0, 0]);
    for (index, (before, now)) in drawn[0].iter().zip(&drawn[1]).enumerate().filter(|(_, (before, now))| before != now)
    {
        let (x, y) = (f64::from(index as u32 % side) + 0.5, f64::from(index as u32 / side) + 0.5);
        let ndc = DVec3::new(x / f64::from(side) * 2.0 - 1.0, 1.0 - y / f64::from(side) * 2.0, 0.5);
        let direction = (world_from_clip.project_point3(ndc) - view.eye.as_dvec3()).normalize().as_vec3();
        let ray = Ray { origin: view.eye, direction, t_min: 0.0, t_max: f32::INFINITY };
        let Some(hit) = exact.closest(&ray, |_| true) else { continue };
        let is_farther = |id: u32| {
            let [a, b, c] = scene.geometry.corners(id).map(|corner| corner.as_dvec3());
            let (normal, eye) = ((b - a).cross(c - a).normalize(), view.eye.as_dvec3());
            let t = (a - eye).dot(normal) / direction.as_dvec3().dot(normal);
            let at = eye + direction.as_dvec3() * t;
            let is_inside = [(a, b), (b, c), (c, a)].iter().all(|(f, to)| (*to - *f).cross(at - *f).dot(normal) > 0.0);
            is_inside && t > f64::from(hit.t) * (1.0 + 1e-6)
        };
        changed += 1;
        wrong[0] += u32::from(is_farther(*before));
        wrong[1] += u32::from(is_farther(*now));
    }
    println!(
        "{changed} of {} pixels change; farther than what is nearest before: {}, now: {}",
        side * side,
        wrong[0],
        wrong[1]
    );
    assert!(changed > 5 && changed < 1000, "{changed}");
    assert!(wrong[1] <= wrong[0] && wrong[1] * 50 < changed, "{wrong:?} of {changed}");
}
