//! Why an engine could not do its work.

/// Why a backend could not do its work.
#[derive(Debug, Clone, thiserror::Error)]
pub enum BackendError {
    /// The backend lacks the feature; the message names the reason and a remedy.
    #[error("{backend} cannot run {what}: {why}")]
    Unsupported {
        /// Name of the backend.
        backend: &'static str,
        /// Pass or feature.
        what: String,
        /// Reason and remedy.
        why: String,
    },
    /// The device reported a failure.
    #[error("{backend}: {message}")]
    Device {
        /// Name of the backend.
        backend: &'static str,
        /// What the device said.
        message: String,
    },
}

impl BackendError {
    /// The error of a backend without exact spheres. `what` names the pass, `place` the declaration of its first sphere, `help` a
    /// remedy.
    #[must_use]
    pub fn no_spheres(backend: &'static str, what: &str, place: &str, help: &str) -> Self {
        let why = format!("it knows triangles only; {help}, or declare them without exact=\"true\"");
        Self::Unsupported { backend, what: format!("{what} with exact spheres ({place})"), why }
    }

    /// The error of a backend that shoots no photons. `what` names the pass's program, `target` the first material whose meshes they are shot at.
    #[must_use]
    pub fn no_photons(backend: &'static str, what: &str, photons: u32, target: &str) -> Self {
        let why = "it shoots none; set photons=0 on the pass, so that light goes straight through meshes, use --backend cpu, or allow it with \
                   --fallback cpu";
        let what = format!("{what} with photons={photons} at the glass meshes of material `{target}`");
        Self::Unsupported { backend, what, why: why.to_owned() }
    }

    /// The error of a rasteriser that runs no GLSL, for a pass with own shaders; `place` is where the first of them is named.
    #[must_use]
    pub fn no_shaders(backend: &'static str, place: &str) -> Self {
        let why = "it runs no GLSL; draw with --raster wgpu, on any Vulkan, Metal or DirectX 12 driver".to_owned();
        Self::Unsupported { backend, what: format!("own shaders ({place})"), why }
    }

    /// The name of the backend that failed.
    #[must_use]
    pub fn backend(&self) -> &'static str {
        match self {
            Self::Unsupported { backend, .. } | Self::Device { backend, .. } => backend,
        }
    }

    /// The message for a line that already names the backend.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::Device { message, .. } => message.clone(),
            Self::Unsupported { .. } => self.to_string(),
        }
    }
}

/// The error of an engine whose pictures are always in host memory.
pub(super) fn not_in_place(backend: &'static str) -> BackendError {
    let (what, why) = ("pictures that stay on a device".to_owned(), "it leaves them in host memory".to_owned());
    BackendError::Unsupported { backend, what, why }
}
