//! The limits at which a pass stops following paths.

use super::branch::Branch;
use super::media::Media;
use super::walk::{Path, Walk};
use super::ways::{Met, Ways};
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::{Coverage, Workspace};
use crate::sampling::hash::{ROULETTE, dimensions, path_key, unit};
use crate::trace::{Hit, Purpose, Tracer};
use curitiba_pipeline::glass::{CutoffColor, Roulette};
use glam::Vec3;

impl<T, C, F, W> Walk<'_, '_, T, C, F, W>
where
    T: Tracer,
    C: Coverage,
    F: Fn(&Hit, FootprintOf<C>, &Surface, Media, u32, &mut Workspace) -> Vec3,
    W: Ways,
{
    /// Factor of a branch's weight: 1, or if Russian roulette decided, 0 or more than 1. `None` if the branch is cut off. `path` is the path along
    /// the branch; its numbers of bounces and its importance are updated.
    #[inline(always)]
    pub(super) fn kept(&self, branch: &Branch<C::Cone>, path: &mut Path<C::Cone>) -> Option<f32> {
        if !self.pass.job.params.limits.cut() {
            return Some(1.0);
        }
        self.kept_within_limits(branch, path)
    }

    #[inline(never)]
    fn kept_within_limits(&self, branch: &Branch<C::Cone>, path: &mut Path<C::Cone>) -> Option<f32> {
        let limits = &self.pass.job.params.limits;
        let (kind, most) = match branch.purpose {
            Purpose::Reflected => (0, limits.reflections),
            _ => (1, limits.refractions),
        };
        path.bounces[kind] += 1;
        if path.bounces[kind] > most {
            return None;
        }
        // Weights of wavelengths may be negative.
        path.importance *= branch.weight.abs().max_element();
        if path.importance >= limits.cutoff {
            return Some(1.0);
        }
        match limits.roulette {
            Roulette::Off => None,
            Roulette::On => {
                self.ways.note(Met::CHANCE);
                let chance = path.importance / limits.cutoff;
                let chosen = self.chance(path) < chance;
                path.importance = limits.cutoff;
                // A branch that roulette drops adds nothing: the colour of a cut-off branch does not replace it.
                Some(if chosen { 1.0 / chance } else { 0.0 })
            }
        }
    }

    /// A random number from 0 to 1 for a path. It also depends on the path's wavelength and way, and on the numbers of the first sample and of the
    /// first path of the pass.
    fn chance(&self, path: &Path<C::Cone>) -> f32 {
        let params = &self.pass.job.params;
        let wavelength = path.wavelength.map_or(0, f32::to_bits);
        let sample = params.first ^ params.first_path.rotate_left(16);
        unit(dimensions(path_key(path_key(self.own_key(path), wavelength), sample), ROULETTE)[0])
    }

    /// The colour that replaces a branch that is cut off.
    pub(super) fn cut_off(&self, branch: &Branch<C::Cone>) -> Vec3 {
        match self.pass.job.params.limits.cutoff_color {
            CutoffColor::Black => Vec3::ZERO,
            CutoffColor::Background => branch.weight * self.pass.job.beyond,
        }
    }
}
