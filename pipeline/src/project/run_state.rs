//! State of a pipeline's scripts and mip levels while the pipeline is read.

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

/// State of the pipeline that is being read.
#[derive(Default)]
pub(super) struct Running {
    /// The loaded scripts; `None` until a script is needed.
    #[cfg(feature = "glsl")]
    pub scripts: Option<Loaded>,
    /// Number of runs of passes that test scripts have requested so far.
    pub runs: u32,
    /// Targets to which shaders have stored so far, among them those that hold mip levels.
    pub stored: HashSet<usize>,
}

/// The scripts of a pipeline, and the files that were read.
#[cfg(feature = "glsl")]
pub(super) struct Loaded {
    pub scripts: Scripts,
    /// The loader's attributes, while a script runs.
    pub attributes: Rc<RefCell<Attributes>>,
    /// Indices of the files in the report; `None` for a file that failed.
    pub files: HashMap<PathBuf, Option<u32>>,
}
