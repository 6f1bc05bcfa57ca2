//! The exact spheres of a scene that focus the light of the sun.

use super::ball::Ball;
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::scene::{Geometry, Sphere};
use glam::{DVec3, Vec3};

/// Greatest number of glass spheres of an index above 1 in a scene whose light is focused: every lens is tested at every lit point.
pub const MOST_LENSES: usize = 1024;

/// A sphere of glass that focuses light.
#[derive(Debug, Clone, Copy)]
pub struct Lens {
    /// Its id.
    pub id: u32,
    /// Its centre, world.
    pub center: DVec3,
    /// Its radius, world.
    pub radius: f64,
    /// Its material.
    pub material: u32,
    ball: usize,
}

/// The spheres that focus light, and the refraction by each index among them.
#[derive(Debug, Default)]
pub struct Lenses {
    list: Vec<Lens>,
    balls: Vec<Ball>,
    /// For each sphere of the scene, whether it focuses light.
    focuses: Vec<bool>,
    /// Id of the first sphere.
    first: u32,
}

impl Lenses {
    /// The lenses of a scene: spheres that are bodies of glass with an index above 1 and stand alone. `in_body` says whether a sphere's centre
    /// also lies in another body of glass.
    ///
    /// # Errors
    /// If the scene has more than 1024 spheres that are such bodies, whether or not they stand alone.
    pub fn of(geometry: &Geometry, dielectrics: &[Dielectric], in_body: impl Fn(Vec3) -> bool) -> Result<Self, String> {
        let first = geometry.triangles.len() as u32;
        let is_body = |material: u32| dielectrics[material as usize].shape == Shape::Solid;
        let bends = |material: u32| dielectrics[material as usize].bends_light();
        let count = geometry.spheres.iter().filter(|sphere| bends(sphere.material)).count();
        if count > MOST_LENSES {
            return Err(format!(
                "shadow=caustic follows light through {MOST_LENSES} exact spheres of glass at most, and the scene has {count}: \
                 set shadow=straight"
            ));
        }
        let mut lenses = Self { first, focuses: vec![false; geometry.spheres.len()], ..Self::default() };
        let mut indices: Vec<f32> = Vec::new();
        for (index, sphere) in geometry.spheres.iter().enumerate() {
            let id = first + index as u32;
            let touches = |(other, body): (usize, &Sphere)| {
                let distance = body.center.as_dvec3().distance(sphere.center.as_dvec3());
                other != index && is_body(body.material) && distance < f64::from(body.radius) + f64::from(sphere.radius)
            };
            let valid = sphere.radius > 0.0 && sphere.radius.is_finite() && sphere.center.is_finite();
            let alone = || !geometry.spheres.iter().enumerate().any(touches) && !in_body(sphere.center);
            if !(bends(sphere.material) && valid && alone()) {
                continue;
            }
            let refraction = dielectrics[sphere.material as usize].index;
            let ball = indices.iter().position(|known| *known == refraction).unwrap_or_else(|| {
                indices.push(refraction);
                lenses.balls.push(Ball::new(f64::from(refraction)));
                indices.len() - 1
            });
            let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
            lenses.list.push(Lens { id, center, radius, material: sphere.material, ball });
            lenses.focuses[index] = true;
        }
        Ok(lenses)
    }

    /// Whether a triangle or sphere focuses light.
    #[inline]
    #[must_use]
    pub fn contains(&self, id: u32) -> bool {
        id.checked_sub(self.first).is_some_and(|index| self.focuses.get(index as usize) == Some(&true))
    }

    /// Each lens with the refraction by its index.
    pub fn iter(&self) -> impl Iterator<Item = (&Lens, &Ball)> {
        self.list.iter().map(|lens| (lens, &self.balls[lens.ball]))
    }

    /// One `Ball` for each index of refraction among the lenses.
    #[must_use]
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// The index in [`Self::balls`] of the refraction by a lens.
    #[must_use]
    pub fn ball_of(&self, lens: &Lens) -> usize {
        lens.ball
    }

    /// For each sphere of the scene, whether it focuses light.
    #[must_use]
    pub fn by_sphere(&self) -> &[bool] {
        &self.focuses
    }

    /// Whether there are no lenses.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}
