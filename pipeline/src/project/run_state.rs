//! What is known of the scripts and of the mip levels of a pipeline while it is read.

#[cfg(feature = "glsl")]
use super::attributes::Attributes;
#[cfg(feature = "glsl")]
use crate::script::Scripts;
#[cfg(feature = "glsl")]
use std::cell::RefCell;
#[cfg(feature = "glsl")]
use std::collections::HashMap;
use std::collections::HashSet;
#[cfg(feature = "glsl")]
use std::path::PathBuf;
#[cfg(feature = "glsl")]
use std::rc::Rc;

/// The scripts of a pipeline.
#[derive(Default)]
pub(super) struct Running {
    /// Once one was asked for.
    #[cfg(feature = "glsl")]
    pub scripts: Option<Loaded>,
    /// How often they have let passes run.
    pub runs: u32,
    /// Targets that hold mip levels to which passes have stored.
    pub stored: HashSet<usize>,
}

/// The scripts of a pipeline, and the files that were read.
#[cfg(feature = "glsl")]
pub(super) struct Loaded {
    pub scripts: Scripts,
    /// The loader's own, while a script runs.
    pub attributes: Rc<RefCell<Attributes>>,
    /// Places of the files in the report; `None` of one that failed.
    pub files: HashMap<PathBuf, Option<u32>>,
}
