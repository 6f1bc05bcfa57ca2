//! Parameters and materials of ray programs whose rays start at the camera.

use glam::Vec3;

/// How a ray from the camera behaves at a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SurfaceKind {
    /// An opaque surface: the material's colour, lit.
    #[default]
    Painted,
    /// As [`Self::Painted`], with holes where the texture's alpha is below the material's cutoff, by default [`CUT_OUT`].
    CutOut,
    /// A light source: it shows the light's radiance, and shadow rays pass through it.
    Light,
    /// A glass body: reflection and refraction with Fresnel weights; shadow rays pass, dimmed.
    Glass,
    /// A clear pane: rays pass straight through, dimmed; shadow rays too.
    Clear,
    /// A mirror, dimmed; rough if `gloss` is set.
    Metal,
}

/// Alpha cutoff of cut-out surfaces whose material has no other.
pub const CUT_OUT: f32 = 0.25;

impl SurfaceKind {
    /// The kinds, each with the name of the element in which a pass lists its materials. No element lists painted surfaces.
    pub const NAMED: [(&'static str, Self); 5] = [
        ("cutOut", Self::CutOut),
        ("light", Self::Light),
        ("glass", Self::Glass),
        ("clear", Self::Clear),
        ("metal", Self::Metal),
    ];

    /// Name of the kind; `painted` for painted surfaces, which no element lists.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, kind)| *kind == self).map_or("painted", |(name, _)| name)
    }

    /// Whether shadow rays pass through such a surface.
    #[must_use]
    pub fn passes_light(self) -> bool {
        matches!(self, Self::Light | Self::Glass | Self::Clear)
    }
}

/// Background of rays that miss, in the tutorials of the current descendant of the report's engine.
pub const BLUE: Vec3 = Vec3::Z;

/// Parameters of programs whose rays start at the camera, in addition to those shared with other programs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraParams {
    /// Side of the light along x, scene units. If this and [`Self::light_depth`] are 0, it is a point light.
    pub light_width: f32,
    /// Side of the light along z, scene units.
    pub light_depth: f32,
    /// Emission of the light: radiance of a rectangle, radiant intensity of a point.
    pub radiance: f32,
    /// Ambient light, as a share of white.
    pub ambient: f32,
    /// Exponent of the Phong lobe of a rough mirror; 0 for a smooth mirror.
    pub gloss: f32,
    /// Radius of the lens, scene units; 0 for a pinhole camera.
    pub aperture: f32,
    /// Distance of the focal plane along the viewing direction, scene units.
    pub focus: f32,
    /// Output gamma: the written colour is raised to the power of 1 / gamma.
    pub gamma: f32,
}

impl CameraParams {
    /// A point light of intensity 1, smooth mirrors, a pinhole camera, and gamma 1.
    pub const DEFAULT: Self = Self {
        light_width: 0.0,
        light_depth: 0.0,
        radiance: 1.0,
        ambient: 0.3,
        gloss: 0.0,
        aperture: 0.0,
        focus: 1.0,
        gamma: 1.0,
    };
}

/// A linear colour to the power of 1 / `gamma`, with negative components as 0; unchanged if `gamma` is 1.
#[inline]
#[must_use]
pub fn with_gamma(color: Vec3, gamma: f32) -> Vec3 {
    if gamma == 1.0 { color } else { color.max(Vec3::ZERO).powf(gamma.recip()) }
}

impl Default for CameraParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Largest side of the light and largest lens radius, scene units.
pub const LONGEST: f32 = 1e5;
/// Largest value of [`CameraParams::gloss`].
pub const MOST_GLOSS: f32 = 1e5;

impl CameraParams {
    /// The parameter with this name, and its least and largest value; `None` for an unknown name.
    fn field(&mut self, name: &str) -> Option<(&mut f32, f32, f32)> {
        Some(match name {
            "lightwidth" => (&mut self.light_width, 0.0, LONGEST),
            "lightdepth" => (&mut self.light_depth, 0.0, LONGEST),
            "radiance" => (&mut self.radiance, f32::MIN_POSITIVE, f32::MAX),
            "ambient" => (&mut self.ambient, 0.0, 1.0),
            "gloss" => (&mut self.gloss, 0.0, MOST_GLOSS),
            "aperture" => (&mut self.aperture, 0.0, LONGEST),
            "focus" => (&mut self.focus, f32::MIN_POSITIVE, f32::MAX),
            "gamma" => (&mut self.gamma, 0.1, 10.0),
            _ => return None,
        })
    }

    /// Sets a parameter by its name. Returns `false` if the name is unknown or the value invalid.
    #[must_use]
    pub fn set(&mut self, name: &str, value: &str) -> bool {
        let Some((field, low, high)) = self.field(name) else { return false };
        let valid = value.parse::<f32>().ok().filter(|value| (low..=high).contains(value));
        valid.map(|value| *field = value).is_some()
    }

    /// The value of a parameter as text; `None` for an unknown name.
    #[must_use]
    pub fn get(mut self, name: &str) -> Option<String> {
        self.field(name).map(|(value, ..)| value.to_string())
    }
}
