//! What the ray programs have of their own whose rays start at the camera: parameters, and what rays do at a material.

use glam::Vec3;

/// What a ray from the camera does where it meets a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SurfaceKind {
    /// It shows the material's colour in the light that arrives.
    #[default]
    Painted,
    /// The same, and the surface is a hole where the texture has less than [`CUT_OUT`] alpha.
    CutOut,
    /// It shows the light itself, and shadow rays pass.
    Light,
    /// A body of glass: reflection and refraction by Fresnel's share; shadow rays pass, dimmed.
    Glass,
    /// A pane that is seen through straight on, dimmed; shadow rays likewise.
    Clear,
    /// A mirror, dimmed; a rough one with `gloss`.
    Metal,
}

/// Alpha below which a surface that is cut out is a hole, where its material names no other.
pub const CUT_OUT: f32 = 0.25;

impl SurfaceKind {
    /// Each with the element of a pass that lists its materials.
    pub const NAMED: [(&'static str, Self); 5] = [
        ("cutOut", Self::CutOut),
        ("light", Self::Light),
        ("glass", Self::Glass),
        ("clear", Self::Clear),
        ("metal", Self::Metal),
    ];

    /// Its name; that of painted surfaces, which no element lists, is `painted`.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, kind)| *kind == self).map_or("painted", |(name, _)| name)
    }

    /// Whether shadow rays pass through it.
    #[must_use]
    pub fn passes_light(self) -> bool {
        matches!(self, Self::Light | Self::Glass | Self::Clear)
    }
}

/// The background that the tutorials of the engine's descendant write where a ray meets nothing.
pub const BLUE: Vec3 = Vec3::Z;

/// Parameters of programs whose rays start at the camera, beside those that other programs read as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraParams {
    /// Side of the light along x, scene units; with [`Self::light_depth`] 0 as well the light is a point.
    pub light_width: f32,
    /// Side of the light along z, scene units.
    pub light_depth: f32,
    /// What the light sends out: of a rectangle radiance, of a point radiant intensity.
    pub radiance: f32,
    /// Light that is everywhere, as a share of white.
    pub ambient: f32,
    /// Exponent of the lobe of a rough mirror; 0 is a smooth one.
    pub gloss: f32,
    /// Radius of the lens, scene units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance of the plane that is sharp, along the viewing direction, scene units.
    pub focus: f32,
    /// What is written is the colour to the power of 1 / gamma.
    pub gamma: f32,
}

impl CameraParams {
    /// A point of intensity 1, smooth mirrors, a pinhole, and colours as they are.
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

impl Default for CameraParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Longest side of the light and widest lens, scene units.
pub const LONGEST: f32 = 1e5;
/// Largest [`CameraParams::gloss`].
pub const MOST_GLOSS: f32 = 1e5;

impl CameraParams {
    /// The parameter of a name, with its least and its greatest value.
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

    /// Sets a parameter by its name; false if there is none of that name, or the value is not valid.
    #[must_use]
    pub fn set(&mut self, name: &str, value: &str) -> bool {
        let Some((field, low, high)) = self.field(name) else { return false };
        let valid = value.parse::<f32>().ok().filter(|value| (low..=high).contains(value));
        valid.map(|value| *field = value).is_some()
    }

    /// The value of a parameter as it is written; `None` if there is none of that name.
    #[must_use]
    pub fn get(mut self, name: &str) -> Option<String> {
        self.field(name).map(|(value, ..)| value.to_string())
    }
}
