//! Opening a project, and opening it again with other engines.

use super::session::Session;
use super::{Activity, lock};
use crate::camera::Bounds;
use curitiba::Choice;
use curitiba::pipeline::executor::{Renderer, Silent};
use std::sync::Arc;

impl Session {
    /// Opens the source that the command line names. After a failure, the thread waits for a command or a change of the files.
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

    /// Opens the project again with other engines. If an engine is not available, the present renderer stays.
    pub(super) fn change_engines(&mut self, choice: Choice) -> Result<(), String> {
        let Some(renderer) = &self.renderer else {
            self.source.choice = choice;
            self.opening = true;
            return Ok(());
        };
        // If files are watched, the new renderer starts from the project as its files have it, and the poses of moved cameras are set afterwards. A
        // later reload then keeps these poses.
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

    /// Replaces the renderer.
    pub(super) fn adopt(&mut self, renderer: Renderer, choice: Choice) {
        lock(&self.shared.busy).cancellation = renderer.cancellation();
        self.choice = choice;
        self.renderer = Some(renderer);
        self.scene_changed();
        self.changed();
        self.shared.change(|state| state.error = None);
    }

    /// Computes the bounds again if the renderer holds other scenes than before.
    pub(super) fn scene_changed(&mut self) {
        let ids: Vec<usize> =
            self.renderer.iter().flat_map(Renderer::scenes).map(|scene| Arc::as_ptr(scene).addr()).collect();
        if ids == self.scenes {
            return;
        }
        self.scenes = ids;
        let scenes = self.renderer.iter().flat_map(Renderer::scenes);
        let boxes: Vec<_> = scenes
            // Cameras have world coordinates, so the scenes' own origins are added.
            .filter_map(|scene| Some((Bounds::around(&scene.geometry.positions)?, scene.origin)))
            .flat_map(|(b, origin)| [b.low, b.high].map(|corner| (corner.as_dvec3() + origin).as_vec3()))
            .collect();
        self.bounds = Bounds::around(&boxes);
    }
}
