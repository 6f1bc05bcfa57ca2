//! Opening a project, and opening it again with other engines.

use super::session::Session;
use super::{Activity, lock};
use crate::camera::Bounds;
use curitiba::Choice;
use curitiba::pipeline::executor::{Renderer, Silent};
use std::sync::Arc;

impl Session {
    /// Opens what the command line names; where that fails, waits for its files to change.
    pub(super) fn open(&mut self) {
        self.opening = false;
        self.shared.change(|state| state.activity = Activity::Opening);
        let source = &self.source;
        let opened = curitiba::open(&source.path, source.settings.clone(), source.choice, &mut Silent);
        self.watch.remember(&source.path);
        match opened {
            Ok(renderer) => self.adopt(renderer, source.choice),
            Err(error) => {
                let error = error.to_string();
                self.shared.change(|state| (state.error, state.activity) = (Some(error), Activity::Failed));
            }
        }
    }

    /// Opens it again with other engines; where one cannot be had, nothing changes.
    pub(super) fn change_engines(&mut self, choice: Choice) -> Result<(), String> {
        let Some(renderer) = &self.renderer else {
            self.source.choice = choice;
            self.opening = true;
            return Ok(());
        };
        // The files' own project: what was moved is set again, so that reading it again keeps it.
        let (mut project, settings) = (renderer.project().clone(), renderer.settings().clone());
        if self.source.watch {
            project = settings.open(&self.source.path).map_err(|error| error.to_string())?;
        }
        let mut renderer =
            curitiba::open_project(project, settings, choice, &mut Silent).map_err(|error| error.to_string())?;
        for (camera, pose) in &self.poses {
            renderer.set_pose(camera, *pose).map_err(|error| error.to_string())?;
        }
        self.adopt(renderer, choice);
        Ok(())
    }

    /// Shows another renderer from now on.
    pub(super) fn adopt(&mut self, renderer: Renderer, choice: Choice) {
        lock(&self.shared.busy).cancellation = renderer.cancellation();
        self.choice = choice;
        self.renderer = Some(renderer);
        self.scene_changed();
        self.changed();
        self.shared.change(|state| state.error = None);
    }

    /// Notes the bounds where other triangles are there.
    pub(super) fn scene_changed(&mut self) {
        let ids: Vec<usize> =
            self.renderer.iter().flat_map(Renderer::scenes).map(|scene| Arc::as_ptr(scene).addr()).collect();
        if ids == self.scenes {
            return;
        }
        self.scenes = ids;
        let scenes = self.renderer.iter().flat_map(Renderer::scenes);
        let boxes: Vec<_> = scenes
            // Cameras stand in the world, wherever the scenes' own origin is.
            .filter_map(|scene| Some((Bounds::around(&scene.geometry.positions)?, scene.origin)))
            .flat_map(|(b, origin)| [b.low, b.high].map(|corner| (corner.as_dvec3() + origin).as_vec3()))
            .collect();
        self.bounds = Bounds::around(&boxes);
    }
}
