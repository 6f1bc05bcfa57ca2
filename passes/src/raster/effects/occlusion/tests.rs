//! The vector functions against `f64`, and the instruction sets against each other.

use super::lanes::{angle, half_turn, power};
use super::{Method, Occlusion, SPAN, Span};
use crate::sampling::hash::{pcg4d, unit};
use crate::trace::{Detected, InstructionSet};
use curitiba_pipeline::backend::{EffectJob, View};
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::f64::consts::PI;

#[test]
fn functions_are_as_near_as_they_say() {
    let (mut turns, mut angles, mut doubles, mut powers) = (0f64, 0f64, 0f64, 0f64);
    for step in 0..=100_000u32 {
        let share = step as f32 / 100_000.0;
        let (exact, turned) = ((PI * f64::from(share)).sin_cos(), half_turn(share));
        turns = turns.max((f64::from(turned[0]) - exact.0).abs()).max((f64::from(turned[1]) - exact.1).abs());
        // The sides are rounded to `f32` first, so that the test measures only the error of the computation.
        let (across, along) = ((3.7 * exact.0.max(0.0)) as f32, (3.7 * exact.1) as f32);
        let (found, exact) = (angle(across, along), f64::from(across).atan2(along.into()));
        angles = angles.max((f64::from(found.angle) - exact).abs());
        let [cos, sin] = found.double.map(f64::from);
        doubles = doubles.max((cos - (2.0 * exact).cos()).abs()).max((sin - (2.0 * exact).sin()).abs());
        for exponent in [0.0, 1e-3, 0.3, 1.0, 1.6, 2.0, 17.0, 100.0] {
            for x in [share, 1.0 - share * share * share, share * share * share] {
                let exact = f64::from(x).powf(exponent.into());
                powers = powers.max((f64::from(power(x, exponent)) - exact).abs());
            }
        }
    }
    println!("half turn {turns:.1e}, angle {angles:.1e}, double angle {doubles:.1e}, power {powers:.1e}");
    assert!(turns < 3e-7 && angles < 4e-7 && doubles < 4e-7 && powers < 3e-7);
    for exponent in [0.0, 1e-3, 1.6, 100.0] {
        assert_eq!(power(1.0, exponent), 1.0);
        assert_eq!(power(0.0, exponent), if exponent == 0.0 { 1.0 } else { 0.0 });
        assert_eq!(power(0.37, 0.0), 1.0);
    }
}

/// A field of bumps, one of whose pixels is NaN, below an empty sky.
fn bumps(width: u32, height: u32, view: &View) -> [Vec<[f32; 4]>; 2] {
    let from_clip = view.clip_from_world.inverse();
    let mut buffers = [Vec::new(), Vec::new()];
    for y in 0..height {
        for x in 0..width {
            let [u, v] = [(x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32];
            let through = from_clip.project_point3(Vec3::new(2.0 * u - 1.0, 1.0 - 2.0 * v, 0.5));
            let direction = (through - view.eye).normalize();
            let [a, b, c, _] = pcg4d([x / 5, y / 3, 7, 7]).map(unit);
            let t = (0.3 * a - view.eye.y) / direction.y;
            let shown = t > 0.0 && t < 60.0;
            let position = (view.eye + direction * t).extend(0.0).to_array();
            let normal = (Vec3::Y + 0.5 * Vec3::new(b - 0.5, 0.0, c - 0.5)).extend(0.0).to_array();
            buffers[0].push(if shown { position } else { [0.0; 4] });
            buffers[1].push(if shown { normal } else { [0.0; 4] });
        }
    }
    let middle = (height * 3 / 4 * width + width / 2) as usize;
    buffers[0][middle] = [f32::NAN; 4];
    buffers
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let (width, height) = (75, 50);
    let eye = Vec3::new(1.0, 1.5, 4.0);
    let look = glam::camera::rh::view::look_at_mat4(eye, Vec3::new(0.0, 0.9, 0.0), Vec3::Y);
    let view = View::new(glam::camera::rh::proj::directx::perspective(1.0, 1.5, 100.0, 0.1) * look, eye);
    let [position, normal] = bumps(width, height, &view);
    let scene = RenderScene::default();
    for (program, method) in [
        (EffectProgram::HorizonOcclusion, Method::Horizons),
        (EffectProgram::HorizonOcclusion, Method::Bitmask),
        (EffectProgram::DepthOcclusion, Method::Depths),
    ] {
        let job = EffectJob {
            scene: &scene,
            program,
            params: EffectParams { slices: 3, steps: 5, ..EffectParams::default() },
            seed: 3,
            view,
            sun: None,
            width,
            height,
            resident: true,
            position: &position,
            normal: &normal,
            color: &[],
            triangle: &[],
            shades: &[],
            glass: &[],
        };
        let occlusion = Occlusion::new(&job);
        let picture = |simd: Detected| -> Vec<u32> {
            let rows = (0..height).flat_map(|y| (0..width).step_by(SPAN).map(move |x| [x, y]));
            let occlusion = &occlusion;
            let spans = rows.map(|[x, y]| (x, simd.run(Span { occlusion, method, x, y })));
            spans.flat_map(|(x, span)| span.into_iter().take((width - x).min(16) as usize).map(f32::to_bits)).collect()
        };
        let plain = picture(Detected::new(InstructionSet::Portable).expect("every processor has it"));
        let open = plain.iter().map(|bits| f32::from_bits(*bits)).sum::<f32>() / plain.len() as f32;
        assert!(plain.len() == position.len() && open > 0.5 && open < 0.97, "{open}");
        for set in [InstructionSet::Avx2, InstructionSet::Avx512] {
            let Some(simd) = Detected::new(set) else { continue };
            let differing = picture(simd).iter().zip(&plain).filter(|(a, b)| a != b).count();
            assert_eq!(differing, 0, "{method:?}, {set:?}");
        }
    }
}
