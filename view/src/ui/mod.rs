//! The parts of the window.

pub mod graph;
pub mod help;
pub mod keys;
pub mod overlay;
pub mod parameters;
pub mod passes;
pub mod picture;
pub mod side;
pub mod status;
pub mod top;

use crate::app::Slot;
use crate::worker::Picture;
use egui::{Color32, ColorImage, Context, FontFamily, FontId, TextStyle, TextureHandle, TextureOptions, Theme};
use std::sync::Arc;

/// Of errors.
pub const RED: Color32 = Color32::from_rgb(240, 110, 100);
/// Of warnings.
pub const YELLOW: Color32 = Color32::from_rgb(232, 184, 80);
/// Of what is chosen.
pub const BLUE: Color32 = Color32::from_rgb(96, 165, 230);

/// Colours of passes, in order; their lightness is alike.
const PASSES: [Color32; 8] = [
    Color32::from_rgb(92, 150, 220),
    Color32::from_rgb(226, 140, 72),
    Color32::from_rgb(110, 178, 110),
    Color32::from_rgb(190, 120, 190),
    Color32::from_rgb(208, 178, 80),
    Color32::from_rgb(90, 180, 185),
    Color32::from_rgb(214, 110, 120),
    Color32::from_rgb(150, 150, 160),
];

/// The colour of a pass.
pub fn color(pass: usize) -> Color32 {
    PASSES[pass % PASSES.len()]
}

/// Dark and dense, so that the picture is what one sees.
pub fn style(context: &Context) {
    context.set_theme(Theme::Dark);
    context.all_styles_mut(|style| {
        let font = |size| FontId::new(size, FontFamily::Proportional);
        style.text_styles.insert(TextStyle::Body, font(13.0));
        style.text_styles.insert(TextStyle::Button, font(13.0));
        style.text_styles.insert(TextStyle::Small, font(11.0));
        style.text_styles.insert(TextStyle::Heading, font(15.0));
        style.text_styles.insert(TextStyle::Monospace, FontId::new(11.5, FontFamily::Monospace));
        style.spacing.item_spacing = egui::vec2(6.0, 4.0);
        style.spacing.slider_width = 90.0;
        style.visuals.panel_fill = Color32::from_gray(30);
        style.visuals.window_fill = Color32::from_gray(36);
        style.visuals.selection.bg_fill = BLUE.gamma_multiply(0.45);
    });
}

/// The texture of a picture: made again where the picture, or how it is enlarged, is another.
pub fn texture<'a>(context: &Context, slot: &'a mut Slot, picture: &Arc<Picture>, squares: bool) -> &'a TextureHandle {
    let serves = slot.held.as_ref().is_some_and(|(held, how, _)| Arc::ptr_eq(held, picture) && *how == squares);
    if !serves {
        let mut options = TextureOptions::LINEAR;
        if squares {
            options.magnification = egui::TextureFilter::Nearest;
        }
        let image = color_image(picture, context.input(|input| input.max_texture_side));
        let texture = match slot.held.take() {
            Some((_, _, mut texture)) => {
                texture.set(image, options);
                texture
            }
            None => context.load_texture("picture", image, options),
        };
        slot.held = Some((Arc::clone(picture), squares, texture));
    }
    &slot.held.as_ref().expect("it was made above").2
}

/// The picture for the device; every n-th pixel where it is larger than the device's textures.
fn color_image(picture: &Picture, most: usize) -> ColorImage {
    let (width, height) = (picture.image.width as usize, picture.image.height as usize);
    let step = width.max(height).div_ceil(most.max(1)).max(1);
    if step == 1 {
        return ColorImage::from_rgba_premultiplied([width, height], picture.bytes.as_flattened());
    }
    let rows = picture.bytes.chunks_exact(width).step_by(step);
    let pixels: Vec<[u8; 4]> = rows.flat_map(|row| row.iter().step_by(step).copied()).collect();
    ColorImage::from_rgba_premultiplied([width.div_ceil(step), height.div_ceil(step)], pixels.as_flattened())
}

/// Milliseconds with three digits.
pub fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.2} ms"),
        ms if ms < 100.0 => format!("{ms:.1} ms"),
        ms => format!("{ms:.0} ms"),
    }
}

/// A number of a pixel.
pub fn number(value: f32) -> String {
    match value.abs() {
        size if size != 0.0 && !(1e-3..1e5).contains(&size) => format!("{value:.3e}"),
        _ => format!("{value:.5}"),
    }
}
