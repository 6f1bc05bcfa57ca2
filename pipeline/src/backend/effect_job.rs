//! Inputs and statistics of effect passes.

use super::shade::Shade;
use super::view::{Sun, View};
use crate::raster_effects::{EffectParams, EffectProgram, Missing};
use crate::scene::RenderScene;
use std::time::Duration;

/// One effect pass. All images have the same size.
#[derive(Debug, Clone, Copy)]
pub struct EffectJob<'a> {
    /// The scene that the effect draws into its maps; the rasteriser holds it already.
    pub scene: &'a RenderScene,
    /// The program that runs per pixel.
    pub program: EffectProgram,
    /// Constants of the program.
    pub params: EffectParams,
    /// Seed of the random numbers.
    pub seed: u32,
    /// The camera that drew the G-buffer; the G-buffer covers its whole viewport.
    pub view: View,
    /// The single directional light, for programs that read it; otherwise `None`.
    pub sun: Option<Sun>,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Whether the G-buffer is the unchanged result of this rasteriser's last draw, with every attachment that the program reads.
    /// The rasteriser may then use its own copy, and if it needs read-back the slices below are empty.
    pub resident: bool,
    /// World position, and light cosine in the fourth component; 0 where no surface is seen. Empty if the program does not read it.
    pub position: &'a [[f32; 4]],
    /// Shading normal. Empty if the program does not read it.
    pub normal: &'a [[f32; 4]],
    /// Shaded colour. Empty if the program does not read it.
    pub color: &'a [[f32; 4]],
    /// Triangle ids. Empty if the program does not distinguish glass.
    pub triangle: &'a [u32],
    /// Colours with which materials are drawn into maps, by material index.
    pub shades: &'a [Shade],
    /// Whether a material is glass, by material index. Glass is not drawn into cube maps and mirrors.
    pub glass: &'a [bool],
}

/// Time of one part of an effect pass: its maps or its pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Part {
    /// Host time with synchronisation.
    pub host: Duration,
    /// Time on the device's own clock, where it has one.
    pub device: Option<Duration>,
}

/// Statistics of an effect pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectStats {
    /// Time to draw the maps; `None` if no map was drawn.
    pub maps: Option<Part>,
    /// Time to compute the pixels.
    pub pixels: Part,
    /// Time to copy the G-buffer to the device and the result back; `None` for a rasteriser in host memory.
    pub transfer: Option<Duration>,
    /// Number of maps drawn; a cube map counts as one.
    pub map_count: u32,
    /// Triangles submitted for the maps.
    pub triangles: u64,
    /// Bytes of the maps.
    pub bytes: u64,
    /// Number of glass pixels, and number of glass pixels that no mirror covers and that keep their colour. `[0, 0]` for programs without
    /// mirrors.
    pub glass_pixels: [u64; 2],
    /// Numbers of glass pixels by the source of their colours; only for programs that march rays through screen space.
    pub answers: Option<Answers>,
}

/// Numbers of glass pixels, by the source of the colours that their reflected and refracted rays see. With
/// [`Missing::Rays`](crate::raster_effects::Missing) the rasteriser marks the pixels counted in [`Answers::rays`] with an alpha of
/// [`Answers::LEFT`], and the executor traces these pixels. Other pixels have alpha 1. With [`Border::Rays`](crate::raster_effects::Border)
/// the pixels of a shadow's border are marked in the same way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Answers {
    /// Pixels whose rays all hit something in screen space.
    pub screen: u64,
    /// Pixels with at least one ray whose colour is read from a cube map.
    pub cube: u64,
    /// Pixels left to the counterpart program on the ray backend.
    pub rays: u64,
    /// Pixels with at least one ray that hits nothing in screen space and has no other source; the ray has the glass's own colour.
    pub kept: u64,
}

impl Answers {
    /// Alpha that marks a pixel for the ray backend.
    pub const LEFT: f32 = -1.0;

    /// Number of all glass pixels.
    #[must_use]
    pub fn glass(self) -> u64 {
        self.screen + self.cube + self.rays + self.kept
    }

    /// Counts of `glass` pixels. The rays of `screen` pixels hit in screen space, and `kept` pixels show some of their own colour.
    /// `missing` says from where the other pixels get their colours.
    #[must_use]
    pub fn new([glass, screen, kept]: [u64; 3], missing: Missing) -> Self {
        let left = glass.saturating_sub(screen + kept);
        let mut answers = Self { screen, kept, ..Self::default() };
        match missing {
            Missing::Cube => answers.cube = left,
            Missing::Rays => answers.rays = left,
            Missing::Own => answers.kept += left,
        }
        answers
    }
}

impl std::fmt::Display for Answers {
    /// Such as `1000 pixels of glass: screen 41.20 %, cube 58.80 %`. Counts of 0 are left out.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let all = self.glass();
        let ways = [(self.screen, "screen"), (self.cube, "cube"), (self.rays, "rays"), (self.kept, "kept")];
        write!(f, "{all} pixels of glass")?;
        let shown = ways.into_iter().filter(|(count, _)| *count > 0);
        for (index, (count, way)) in shown.enumerate() {
            let percent = 100.0 * count as f64 / all as f64;
            write!(f, "{} {way} {percent:.2} %", if index == 0 { ":" } else { "," })?;
        }
        Ok(())
    }
}
