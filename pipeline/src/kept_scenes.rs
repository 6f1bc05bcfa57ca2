//! Scenes that renderers share, so that each is read and decoded once.

use crate::color::ColorSpace;
use crate::diagnostic::Warnings;
use crate::project::{MaterialPattern, SceneDecl};
use crate::scene::{Needs, Placement, RenderScene, Shape};
use glam::DVec3;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Largest number of sets of scenes that are kept.
const MOST: usize = 2;

/// Scenes that successive renderers share, if their [settings](crate::plan::Settings) hold clones of this value.
///
/// A set of scenes is read, decoded and built once for all renderers with the same needs. Files that change meanwhile are not read again.
/// The two sets that were used last are kept, for as long as a clone of this value exists. By default nothing is kept.
#[derive(Debug, Clone, Default)]
pub struct KeptScenes(Option<Arc<Mutex<Sets>>>);

/// The sets, least recently used first.
type Sets = Vec<(Built, Kept)>;

/// What a set of scenes was built from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Built {
    scenes: Vec<Declared>,
    needs: Needs,
    color: ColorSpace,
    thesis: bool,
    /// World position of the origin, if an earlier set chose it.
    origin: Option<DVec3>,
}

#[derive(Debug, Clone, PartialEq)]
struct Declared {
    files: Vec<PathBuf>,
    shapes: Vec<Shape>,
    place: Placement,
    swap_yz: bool,
    unitize: bool,
    sky: Vec<MaterialPattern>,
}

/// A set of scenes.
#[derive(Debug, Clone)]
pub(crate) struct Kept {
    pub scene: Arc<RenderScene>,
    pub warnings: Warnings,
    /// Time that reading and building took.
    pub took: Duration,
}

impl Built {
    /// `None` if a scene was made in memory, since no file names identify its contents.
    pub fn new<'a>(
        scenes: impl Iterator<Item = &'a SceneDecl>,
        (needs, color, thesis): (Needs, ColorSpace, bool),
        origin: Option<DVec3>,
    ) -> Option<Self> {
        let declared = |scene: &SceneDecl| {
            let SceneDecl { name: _, files, memory, shapes, exact: _, place, swap_yz, unitize, sky } = scene;
            memory.is_none().then(|| Declared {
                files: files.iter().map(|file| file.path.clone()).collect(),
                shapes: shapes.clone(),
                place: *place,
                swap_yz: *swap_yz,
                unitize: *unitize,
                sky: sky.clone(),
            })
        };
        Some(Self { scenes: scenes.map(declared).collect::<Option<_>>()?, needs, color, thesis, origin })
    }
}

impl KeptScenes {
    /// Keeps scenes for the renderers whose settings hold clones of the returned value.
    #[must_use]
    pub fn shared() -> Self {
        Self(Some(Arc::default()))
    }

    /// Drops the kept scenes. Renderers that use them are not affected.
    pub fn clear(&self) {
        self.with(Vec::clear);
    }

    /// The kept set that was built from `built`; `None` if there is none.
    pub(crate) fn find(&self, built: &Built) -> Option<Kept> {
        self.with(|kept| {
            let index = kept.iter().position(|(of, _)| of == built)?;
            kept[index..].rotate_left(1);
            kept.last().map(|(_, found)| found.clone())
        })?
    }

    /// Keeps a set. If two sets are kept already, it replaces the least recently used one.
    pub(crate) fn keep(&self, built: Built, set: Kept) {
        self.with(|kept| {
            kept.drain(..(kept.len() + 1).saturating_sub(MOST));
            kept.push((built, set));
        });
    }

    fn with<T>(&self, work: impl FnOnce(&mut Sets) -> T) -> Option<T> {
        // A poisoned lock is accepted: the list is complete between two calls.
        self.0.as_ref().map(|kept| work(&mut kept.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built(needs: Needs) -> Built {
        Built::new(std::iter::empty(), (needs, ColorSpace::Report, false), None).expect("none is in memory")
    }

    fn keep(scenes: &KeptScenes, needs: Needs) {
        let set = Kept { scene: Arc::default(), warnings: Warnings::default(), took: Duration::ZERO };
        scenes.keep(built(needs), set);
    }

    #[test]
    fn the_two_that_were_used_last_are_kept() {
        let [a, b, c] = [Needs::NOTHING, Needs::ALL, Needs { colors: true, ..Needs::NOTHING }];
        let scenes = KeptScenes::shared();
        let clone = scenes.clone();
        keep(&scenes, a);
        keep(&scenes, b);
        assert!(clone.find(&built(a)).is_some());
        keep(&clone, c);
        assert_eq!([a, b, c].map(|needs| scenes.find(&built(needs)).is_some()), [true, false, true]);
        clone.clear();
        assert!(scenes.find(&built(a)).is_none());
    }

    #[test]
    fn nothing_is_kept_without_being_asked() {
        let scenes = KeptScenes::default();
        keep(&scenes, Needs::ALL);
        assert!(scenes.find(&built(Needs::ALL)).is_none());
    }
}
