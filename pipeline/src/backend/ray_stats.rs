//! Statistics of ray passes and acceleration structures.

use std::time::Duration;

/// Number of rays traced, by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RayCounts {
    /// Shadow rays towards the light.
    pub shadow: u64,
    /// Ambient occlusion rays.
    pub occlusion: u64,
    /// Reflected rays.
    pub reflected: u64,
    /// Refracted rays.
    pub refracted: u64,
    /// Camera rays.
    #[serde(default)]
    pub camera: u64,
    /// Rays of a storage buffer.
    #[serde(default)]
    pub buffer: u64,
    /// Occlusion rays that were skipped because they certainly miss. Not part of the total.
    pub certain: u64,
    /// Paths in glass with a wrong colour: paths given up as black after too many surfaces, and paths inside more nested bodies
    /// than are tracked. Not part of the total.
    #[serde(default)]
    pub lost: u64,
    /// Counts of photons, and of the rays traced for them.
    #[serde(default, skip_serializing_if = "PhotonCounts::is_empty")]
    pub photons: PhotonCounts,
}

/// What became of the photons that were shot at bodies of glass. Photons that neither landed nor were lost missed the body, were stopped
/// by an occluder in front of it, or left the scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PhotonCounts {
    /// Photons shot.
    pub shot: u64,
    /// Photons that a body of glass sent to a surface.
    pub landed: u64,
    /// Photons given up after too many surfaces, and paths inside more nested bodies than are tracked.
    pub lost: u64,
    /// Rays traced for photons.
    pub rays: u64,
}

impl PhotonCounts {
    /// Whether all counts are 0.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl std::ops::AddAssign for PhotonCounts {
    fn add_assign(&mut self, other: Self) {
        self.shot += other.shot;
        self.landed += other.landed;
        self.lost += other.lost;
        self.rays += other.rays;
    }
}

impl std::fmt::Display for PhotonCounts {
    /// Such as `1000000 photons shot with 4100000 rays, 960000 landed, 12 lost`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { shot, landed, lost, rays } = self;
        write!(f, "{shot} photons shot with {rays} rays, {landed} landed, {lost} lost")
    }
}

impl RayCounts {
    /// Number of all rays traced.
    #[must_use]
    pub fn total(self) -> u64 {
        self.shadow + self.occlusion + self.reflected + self.refracted + self.camera + self.buffer + self.photons.rays
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.shadow += other.shadow;
        self.occlusion += other.occlusion;
        self.reflected += other.reflected;
        self.refracted += other.refracted;
        self.camera += other.camera;
        self.buffer += other.buffer;
        self.certain += other.certain;
        self.lost += other.lost;
        self.photons += other.photons;
    }
}

/// Paths that adaptive sampling of stochastic glass spent, and the error that it reached.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PathsSpent {
    /// The error that was asked for.
    pub asked: f32,
    /// The error reached: the root mean square over [`Self::pixels`] and their red, green and blue, estimated from two independent halves
    /// of the paths.
    pub error: f64,
    /// Whether the error is at most [`Self::asked`], with a probability of 95 %. If not, some pixels reached the greatest number of paths
    /// that the pass allows before the error was met.
    pub met: bool,
    /// Pixels whose glass is stochastic.
    pub pixels: u64,
    /// Number of paths of all [`Self::pixels`] together.
    pub paths: u64,
    /// Greatest number of paths of a pixel whose glass is stochastic.
    pub most: u32,
    /// Pixels that used all paths that the pass allows.
    pub exhausted: u64,
}

impl PathsSpent {
    /// Mean number of paths of a pixel whose glass is stochastic; 0 without such pixels.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.paths as f64 / self.pixels.max(1) as f64
    }

    /// Combines the statistics of two pictures: sums of the counts, the larger error, and whether both pictures met their error.
    #[must_use]
    pub fn together(self, other: Self) -> Self {
        Self {
            asked: self.asked.max(other.asked),
            error: self.error.max(other.error),
            met: self.met && other.met,
            pixels: self.pixels + other.pixels,
            paths: self.paths + other.paths,
            most: self.most.max(other.most),
            exhausted: self.exhausted + other.exhausted,
        }
    }
}

impl std::fmt::Display for PathsSpent {
    /// Such as `error 0.0098 for 0.01 asked, 37.2 paths a pixel at 12000 pixels of stochastic glass, at most 512`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { asked, error, met, pixels, most, exhausted, .. } = self;
        if *pixels == 0 {
            return write!(f, "no stochastic glass is seen: nothing was sampled to the error of {asked}");
        }
        if !met {
            write!(f, "ERROR NOT MET, paths ran out at {exhausted} pixels: ")?;
        }
        let mean = self.mean();
        write!(
            f,
            "error {error:.2e} for {asked} asked, {mean:.1} paths a pixel at {pixels} pixels of stochastic glass, at most {most}"
        )
    }
}

/// Statistics of a ray pass.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RayStats {
    /// Rays traced.
    pub rays: RayCounts,
    /// What adaptive sampling spent; `None` where every pixel has the same number of paths.
    pub adaptive: Option<PathsSpent>,
    /// Time to copy the G-buffer to the device: host time, or the clock of the drawing device for a copy between two devices.
    /// `None` if nothing was copied.
    pub upload: Option<Duration>,
    /// Time to copy the picture back, on the host; `None` in host memory.
    pub read_back: Option<Duration>,
    /// Time on the device's own clock, if it has one.
    pub device_time: Option<Duration>,
    /// Device memory that the backend keeps between passes, in bytes: pictures, tables, lists. The acceleration structure is not
    /// included. 0 for the processor.
    pub held_bytes: u64,
}

/// Size of an acceleration structure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BuildStats {
    /// Bytes of the structure.
    pub bytes: u64,
    /// Number of nodes.
    pub nodes: u64,
}
