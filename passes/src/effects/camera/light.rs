//! The light that arrives at a point of a surface.

use super::{CLEAR, SHADOW_GLASS, Walk};
use crate::effects::coverage::Coverage;
use crate::effects::light::distinct;
use crate::effects::lights::BEFORE_LIGHT;
use crate::effects::surface::Surface;
use crate::effects::workspace::Workspace;
use crate::trace::{Hit, Purpose, Ray, Tracer};
use curitiba_pipeline::camera_programs::SurfaceKind;
use glam::{Vec2, Vec3};

/// A point of the light, seen from a point of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// Unit direction to the point of the light.
    direction: Vec3,
    /// Distance; infinite for a directional light.
    distance: f32,
    /// Position; `None` for a directional light.
    place: Option<Vec3>,
}

impl<T: Tracer, C: Coverage> Walk<'_, '_, T, C> {
    /// Unit direction to the middle of the light, and the light's colour; both are 0 where there is no light.
    pub(super) fn towards(&self, position: Vec3) -> (Vec3, Vec3) {
        match self.camera.lamp {
            Some(lamp) => ((lamp.position - position).normalize_or(Vec3::ZERO), lamp.color),
            None => (self.pass.to_light, self.pass.light_color),
        }
    }

    /// Whether the light is a rectangle, which faces down.
    fn is_rectangle(&self) -> bool {
        self.camera.lamp.is_some() && self.params.camera.light_width + self.params.camera.light_depth > 0.0
    }

    /// The point of the light for a point of the unit square.
    fn seen(&self, position: Vec3, at: Vec2) -> Seen {
        let Some(lamp) = self.camera.lamp else {
            return Seen { direction: self.pass.to_light, distance: f32::INFINITY, place: None };
        };
        let aside = (at - 0.5) * Vec2::new(self.params.camera.light_width, self.params.camera.light_depth);
        let place = lamp.position + Vec3::new(aside.x, 0.0, aside.y);
        let distance = (place - position).length();
        let direction = (place - position).normalize_or(Vec3::ZERO);
        Seen { direction, distance, place: Some(place) }
    }

    /// The colour of the light on a side of a surface, times the cosine. Colour and cosine are those of the light's
    /// middle; visibility is tested for one point of the light. The light of a rectangle is also multiplied by the cosine
    /// at the rectangle.
    pub(super) fn arriving(
        &self,
        hit: &Hit,
        surface: &Surface,
        at: impl FnOnce() -> Vec2,
        work: &mut Workspace,
    ) -> Vec3 {
        let (to_middle, color) = self.towards(surface.position());
        let cosine = surface.normal.dot(to_middle);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        let rectangle = self.is_rectangle();
        let seen = self.seen(surface.position(), if rectangle { at() } else { Vec2::splat(0.5) });
        let aside = if rectangle { seen.direction.y.max(0.0) } else { 1.0 };
        if aside == 0.0 {
            return Vec3::ZERO;
        }
        color * (cosine * aside * self.visible(hit, surface, &seen, work))
    }

    /// Radiance that a white diffuse surface reflects of the light, estimated from one point of the light by area sampling:
    /// `L cos cos' A / (π d²)` for a rectangle of radiance `L`, `I cos / (π d²)` for a point of intensity `I`, and `E cos`
    /// for a directional light. The colour of a directional light is the radiance of a white surface that faces it.
    pub(super) fn reflected(
        &self,
        hit: &Hit,
        surface: &Surface,
        at: impl FnOnce() -> Vec2,
        work: &mut Workspace,
    ) -> Vec3 {
        use std::f32::consts::FRAC_1_PI;
        let rectangle = self.is_rectangle();
        let seen = self.seen(surface.position(), if rectangle { at() } else { Vec2::splat(0.5) });
        let cosine = surface.normal.dot(seen.direction);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        let params = &self.params.camera;
        let arriving = match (self.camera.lamp, rectangle) {
            (None, _) => self.pass.light_color * cosine,
            (Some(lamp), false) => {
                lamp.color * (params.radiance * cosine * FRAC_1_PI / (seen.distance * seen.distance))
            }
            (Some(lamp), true) => {
                let aside = seen.direction.y.max(0.0);
                let area = params.light_width * params.light_depth;
                lamp.color * (params.radiance * cosine * aside * area * FRAC_1_PI / (seen.distance * seen.distance))
            }
        };
        if arriving == Vec3::ZERO || !arriving.is_finite() {
            return Vec3::ZERO;
        }
        arriving * self.visible(hit, surface, &seen, work)
    }

    /// The share of the light that arrives from one of its points: 0 where the surface is in its own shadow, and behind opaque surfaces (with
    /// `glass_stops`, behind glass too). Clear panes and other glass dim the light.
    fn visible(&self, hit: &Hit, surface: &Surface, seen: &Seen, work: &mut Workspace) -> f32 {
        let pass = self.pass;
        let passes = |kind: SurfaceKind| kind.passes_light() && !(self.glass_stops && kind == SurfaceKind::Glass);
        let stops = |hit: &Hit| !passes(self.kind(hit)) && pass.covers(hit);
        let origin = if surface.facing.dot(seen.direction) > 0.0 {
            surface.origin(seen.direction)
        } else {
            let lifted = pass.lifted(hit.triangle, surface.point(), (surface.facing, seen.direction));
            match lifted {
                Some(lifted) if !pass.is_cut_off(&lifted, &mut work.rays.shadow, stops) => lifted.origin(),
                _ => return 0.0,
            }
        };
        let (direction, t_max) = match seen.place {
            None => (seen.direction, seen.distance),
            Some(place) => {
                let way = place - origin;
                (way.normalize_or(Vec3::ZERO), way.length() * (1.0 - BEFORE_LIGHT))
            }
        };
        work.rays.shadow += 1;
        pass.announce_visibility(Purpose::Shadow, 1.0);
        let (glass, panes) = (&mut work.crossings, &mut work.panes);
        glass.clear();
        panes.clear();
        let blocked = pass.tracer.occluded(&Ray { origin, direction, t_min: 0.0, t_max }, |hit| {
            let kind = self.kind(hit);
            if kind == SurfaceKind::Light || !pass.covers(hit) {
                return false;
            }
            match kind {
                SurfaceKind::Glass if !self.glass_stops => glass.push(hit.t),
                SurfaceKind::Clear => panes.push(hit.t),
                _ => return true,
            }
            false
        });
        if blocked {
            return 0.0;
        }
        SHADOW_GLASS.powi(distinct(glass) as i32) * CLEAR.powi(distinct(panes) as i32)
    }
}
