//! Random numbers from a seed, the same on every machine.

use curitiba::passes::sampling::hash::{dimensions, pixel_key, unit};
use glam::Vec3;
use std::f32::consts::TAU;

/// A sequence of random numbers.
pub struct Numbers {
    key: u32,
    next: u32,
}

impl Numbers {
    pub fn new(seed: u32) -> Self {
        Self { key: pixel_key(0, 0, seed), next: 0 }
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.next += 1;
        unit(dimensions(self.key, self.next)[0])
    }

    /// A uniform point of the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        let (z, angle) = (2.0 * self.unit() - 1.0, TAU * self.unit());
        let radius = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    }
}
