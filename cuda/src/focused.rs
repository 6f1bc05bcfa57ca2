//! The light that glass focuses in a pass, in the device's layout.

use crate::layout::{self, Lens, PhotonCloud, Turned};
use curitiba_passes::effects::dielectric::{Ball, Cloud, Focused, light_axis, light_blur};
use curitiba_pipeline::backend::RayJob;
use glam::Vec3;

/// The tables of the light that glass focuses, except for the photons, which are copied as they are.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FocusedTables {
    /// The spheres.
    pub list: Vec<Lens>,
    /// For each index of refraction, the rays between which the processor's solution looks for extrema.
    pub nodes: Vec<Turned>,
    /// The points of the quadratures, two numbers each: place and weight.
    pub points: Vec<f64>,
    /// For each exact sphere of the scene, 1 if it focuses light, else 0.
    pub by_sphere: Vec<u32>,
    /// The parameters, without the addresses of these tables and of the photons.
    pub described: layout::Focused,
}

impl FocusedTables {
    /// The tables of a job in which glass focuses this light; `None` without any. There may be photons and no spheres that focus light.
    #[must_use]
    pub fn of(job: &RayJob<'_>, focused: &Focused) -> Option<Self> {
        if focused.is_empty() {
            return None;
        }
        let lenses = &focused.lenses;
        let first = lenses.balls().first();
        let of_ball = first.map_or(0, |ball| ball.nodes().len());
        let list: Vec<Lens> = lenses
            .iter()
            .map(|(lens, ball)| Lens {
                // Centre and radius were widened from `f32`, so narrowing is exact.
                center: lens.center.as_vec3().to_array(),
                radius: lens.radius as f32,
                index: ball.index() as f32,
                id: lens.id,
                material: lens.material,
                node: (of_ball * lenses.ball_of(lens)) as u32,
            })
            .collect();
        let axis = light_axis(job.sun.map_or(Vec3::ZERO, |sun| -sun.direction));
        let described = layout::Focused {
            axis: axis.to_array(),
            across: axis.any_orthonormal_vector().to_array(),
            blur: light_blur(job.params.sun),
            count: list.len() as u32,
            cloud_count: focused.photons.clouds().len() as u32,
            ..layout::Focused::default()
        };
        let focuses = |sphere: usize| u32::from(lenses.by_sphere().get(sphere) == Some(&true));
        Some(Self {
            list,
            nodes: lenses.balls().iter().flat_map(nodes).collect(),
            points: first.into_iter().flat_map(Ball::quadratures).flat_map(|point| point.to_array()).collect(),
            by_sphere: (0..job.scene.geometry.spheres.len()).map(focuses).collect(),
            described,
        })
    }
}

/// The photons of a target, without the addresses of its tables.
#[must_use]
pub fn cloud(cloud: &Cloud) -> PhotonCloud {
    let [low, high] = cloud.bounds().map(|corner| corner.to_array());
    PhotonCloud {
        low,
        high,
        entries: cloud.starts().len() as u32 - 1,
        radius: cloud.radius(),
        cells: cloud.cells_a_unit(),
        weight: cloud.greatest_weight(),
        ..PhotonCloud::default()
    }
}

/// Rays through a sphere with the index of refraction of `ball`, at equally spaced angles of incidence.
#[must_use]
pub fn nodes(ball: &Ball) -> Vec<Turned> {
    let node = |ray: &curitiba_passes::effects::dielectric::Turned| Turned {
        sin: ray.sin,
        cos: ray.cos,
        inner: ray.inner,
        direction: ray.direction.to_array(),
        rate: ray.rate(),
    };
    ball.nodes().iter().map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_passes::effects::constants::{CELLS, POINTS, POINTS_AT_AXIS};
    use curitiba_passes::effects::dielectric::{Lenses, Photon, PhotonMap};
    use curitiba_pipeline::backend::{PhotonCounts, PixelCone, Sun};
    use curitiba_pipeline::glass::{Dielectric, Shape};
    use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
    use curitiba_pipeline::scene::{Geometry, RenderScene, Sphere};

    #[test]
    fn each_lens_has_the_rays_of_its_own_index_and_other_spheres_are_none() {
        let glass = |index: f32| Dielectric { shape: Shape::Solid, index, ..Dielectric::default() };
        let dielectrics = [glass(1.5), Dielectric::default(), glass(2.4), glass(1.0)];
        let sphere = |place: f32, material: u32| Sphere { center: Vec3::X * place, radius: 0.3, material };
        let spheres = vec![sphere(0.1, 0), sphere(1.0, 1), sphere(2.0, 2), sphere(3.0, 3), sphere(4.0, 0)];
        let geometry = Geometry { triangles: vec![[0, 1, 2]; 7], spheres, ..Geometry::default() };
        let lenses = Lenses::of(&geometry, &dielectrics, |_| false).expect("few spheres");
        let scene = RenderScene { geometry, ..RenderScene::default() };
        let job = RayJob {
            from_camera: None,
            origin: [0; 2],
            scene: &scene,
            program: RayProgram::Final,
            params: RayParams { sun: 2.0, ..RayParams::default() },
            fidelity: Fidelity::Corrected,
            seed: 0,
            eye: Vec3::Z,
            cone: PixelCone::default(),
            lights: &[],
            sun: Some(Sun { direction: Vec3::NEG_Y, color: Vec3::ONE }),
            width: 0,
            height: 0,
            position: &[],
            normal: &[],
            color: &[],
            triangle: &[],
            shared: None,
            shades: &[],
            glass: &[],
            shadow_glass: &[],
            beyond: Vec3::ZERO,
            dielectrics: &dielectrics,
        };
        let focused = Focused { lenses, photons: PhotonMap::default() };
        let tables = FocusedTables::of(&job, &focused).expect("three focus light");
        assert_eq!(tables.by_sphere, [1, 0, 1, 0, 1]);
        let found: Vec<_> =
            tables.list.iter().map(|lens| (lens.id, lens.material, lens.index, lens.center[0])).collect();
        assert_eq!(found, [(7, 0, 1.5, 0.1), (9, 2, 2.4, 2.0), (11, 0, 1.5, 4.0)]);
        assert_eq!(tables.list.iter().map(|lens| lens.node).collect::<Vec<_>>(), [0, CELLS as u32 + 1, 0]);
        assert_eq!((tables.nodes.len(), tables.points.len()), (2 * (CELLS + 1), 2 * (POINTS + POINTS_AT_AXIS)));
        for lens in &tables.list {
            // At a right angle of incidence, the sine inside is the inverse of the index.
            let grazing = tables.nodes[lens.node as usize + CELLS];
            let inner_sin = (1.0 - grazing.inner * grazing.inner).sqrt();
            assert!((inner_sin * f64::from(lens.index) - 1.0).abs() < 1e-12, "{lens:?}");
        }
        let described = tables.described;
        assert_eq!((described.count, described.axis), (3, [0.0, -1.0, 0.0]));
        assert!((described.blur - 1_f64.to_radians().tan()).abs() < 1e-15);
        assert!(FocusedTables::of(&job, &Focused::default()).is_none());
        // Photons without spheres that focus light.
        let photon = Photon::new(Vec3::ONE, (Vec3::NEG_Y, Vec3::Y), Vec3::ONE, 7);
        let clouds = vec![Cloud::new(vec![photon; 3], 0.25).expect("little memory")];
        let photons = PhotonMap::new(clouds, PhotonCounts::default());
        let tables = FocusedTables::of(&job, &Focused { lenses: Lenses::default(), photons }).expect("photons");
        assert_eq!((tables.described.count, tables.described.cloud_count), (0, 1));
        assert_eq!((tables.by_sphere.as_slice(), tables.list.len()), (&[0; 5][..], 0));
    }
}
