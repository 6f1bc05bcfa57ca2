//! How the window looks: its style, its colours, and numbers as text.

use egui::{Color32, Context, FontFamily, FontId, TextStyle, Theme};

/// Colour of errors.
pub const RED: Color32 = Color32::from_rgb(240, 110, 100);
/// Colour of warnings.
pub const YELLOW: Color32 = Color32::from_rgb(232, 184, 80);
/// Colour of what is chosen.
pub const BLUE: Color32 = Color32::from_rgb(96, 165, 230);

/// Colours of passes, in the order of the passes and repeated after eight, with similar lightness.
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

/// Sets a dark and dense style, so that the picture dominates.
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

/// Milliseconds as text with three digits, or more from 1000 on.
pub fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.2} ms"),
        ms if ms < 100.0 => format!("{ms:.1} ms"),
        ms => format!("{ms:.0} ms"),
    }
}

/// A value of a pixel as text.
pub fn number(value: f32) -> String {
    match value.abs() {
        size if size != 0.0 && !(1e-3..1e5).contains(&size) => format!("{value:.3e}"),
        _ => format!("{value:.5}"),
    }
}
