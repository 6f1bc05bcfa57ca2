//! Overlays of the picture: values of pixels, rays, names.

use crate::canvas::{Canvas, VALUES, rounded};
use crate::theme::RED;
use crate::theme::number;
use crate::worker::{Picture, PixelRays, Segment};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, pos2};
use glam::{Mat4, Vec3, Vec4};

/// Greatest number of rays that are drawn.
const RAYS: usize = 4096;

/// Writes the value of each pixel into it, if pixels are drawn large enough and the picture has its full resolution.
pub fn values(painter: &Painter, canvas: &Canvas, area: Rect, picture: &Picture) {
    let size = [picture.image.width, picture.image.height];
    if canvas.scale(area, size) < VALUES || picture.is_reduced() {
        return;
    }
    let whole = canvas.rect(area, size).intersect(area);
    let inside = |at: Pos2| canvas.pixel(area, size, at.clamp(whole.min, whole.max - egui::vec2(0.01, 0.01)));
    let (Some([left, top]), Some([right, bottom])) = (inside(whole.min), inside(whole.max)) else { return };
    for (y, x) in (top..=bottom).flat_map(|y| (left..=right).map(move |x| (y, x))) {
        let Some(value) = picture.pixel([x, y]) else { continue };
        let rect = canvas.pixel_rect(area, size, [x, y]);
        let [r, g, b, _] = picture.shown[(x as usize, y as usize)].to_array().map(u32::from);
        let ink = if 3 * r + 6 * g + b > 1200 { Color32::BLACK } else { Color32::WHITE };
        for (row, value) in value[..3].iter().enumerate() {
            let at = rect.center() + egui::vec2(0.0, (row as f32 - 1.0) * 12.0);
            painter.text(rounded(at), Align2::CENTER_CENTER, number(*value), FontId::monospace(9.5), ink);
        }
    }
}

/// Writes a name into a corner of the picture.
pub fn name(painter: &Painter, at: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(12.0), Color32::from_gray(235));
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand2(egui::vec2(5.0, 3.0)), 3.0, Color32::from_black_alpha(170));
    painter.galley(rect.min, galley, Color32::WHITE);
}

/// Says in the middle of a part why a picture is missing there.
pub fn missing(painter: &Painter, part: Rect, why: &str) {
    let galley = painter.layout(why.to_owned(), FontId::proportional(12.0), RED, part.width());
    painter.with_clip_rect(part).galley(
        Align2::CENTER_CENTER.anchor_size(part.center(), galley.size()).min,
        galley,
        RED,
    );
}

/// The colour of a ray, by its purpose.
fn ink(segment: &Segment) -> Color32 {
    let color = match segment.purpose {
        "shadow" => Color32::from_rgb(255, 220, 90),
        "occlusion" => Color32::from_rgb(110, 200, 255),
        "reflected" => Color32::from_rgb(255, 120, 200),
        _ => Color32::from_rgb(140, 255, 150),
    };
    if segment.meets { color } else { color.gamma_multiply(0.55) }
}

/// Draws a pixel's outline and, if `clip` is known, its rays as the camera sees them.
pub fn rays(painter: &Painter, canvas: &Canvas, area: Rect, size: [u32; 2], clip: Option<&Mat4>, rays: &PixelRays) {
    let rect = canvas.pixel_rect(area, size, rays.pixel);
    painter.rect_stroke(rect.expand(2.0), 1.0, Stroke::new(1.5, Color32::WHITE), egui::StrokeKind::Outside);
    let Some(clip) = clip else { return };
    for segment in rays.segments.iter().take(RAYS) {
        if let Some(line) = projected(clip, segment.from, segment.to) {
            let ends = line.map(|[x, y]| canvas.point(area, size, x * size[0] as f32, y * size[1] as f32));
            painter.line_segment(ends, Stroke::new(1.2, ink(segment)));
            if segment.meets {
                painter.circle_filled(ends[1], 2.0, ink(segment));
            }
        }
    }
}

/// Both ends of a line as shares of the picture from its top left, clipped at the camera; `None` if all of the line is behind the camera,
/// or an end is not finite.
fn projected(clip: &Mat4, from: Vec3, to: Vec3) -> Option<[[f32; 2]; 2]> {
    /// Least distance along the view, in units of clip space.
    const NEAR: f32 = 1e-4;
    let (a, b) = (*clip * from.extend(1.0), *clip * to.extend(1.0));
    if a.w < NEAR && b.w < NEAR {
        return None;
    }
    let cut = |inside: Vec4, outside: Vec4| inside + (outside - inside) * ((inside.w - NEAR) / (inside.w - outside.w));
    let a_in = if a.w < NEAR { cut(b, a) } else { a };
    let b_in = if b.w < NEAR { cut(a, b) } else { b };
    let share = |v: Vec4| [0.5 + 0.5 * v.x / v.w, 0.5 - 0.5 * v.y / v.w];
    let ends = [share(a_in), share(b_in)];
    ends.as_flattened().iter().all(|value| value.is_finite()).then_some(ends)
}

/// The rectangles of the two halves of a wipe.
pub fn halves(rect: Rect, wipe: f32) -> [Rect; 2] {
    let line = rect.left() + rect.width() * wipe;
    [Rect::from_min_max(rect.min, pos2(line, rect.bottom())), Rect::from_min_max(pos2(line, rect.top()), rect.max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::camera::rh;

    #[test]
    fn a_line_ends_where_it_goes_behind_the_camera() {
        let view = rh::view::look_to_mat4(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y);
        let clip = rh::proj::directx::perspective(1.0, 1.0, 100.0, 0.1) * view;
        let ahead = projected(&clip, Vec3::new(0.0, 0.0, -5.0), Vec3::new(0.0, 1.0, -5.0)).expect("it is in front");
        assert!((ahead[0][0] - 0.5).abs() < 1e-6 && (ahead[0][1] - 0.5).abs() < 1e-6);
        assert!(ahead[1][1] < 0.5, "up is up");
        assert_eq!(projected(&clip, Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, 0.0, 2.0)), None);
        let crossing =
            projected(&clip, Vec3::new(0.0, 0.0, -5.0), Vec3::new(1.0, 0.0, 5.0)).expect("a part is in front");
        assert!(crossing[1][0] > 0.5, "what goes to the right stays on the right");
    }
}
