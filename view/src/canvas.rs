//! Zoom and position of a picture in the window, and its pixels.

use egui::{Pos2, Rect, Vec2, pos2, vec2};

/// If a pixel of the picture is at least this number of screen pixels wide, it is drawn as a square.
pub const SQUARES: f32 = 4.0;
/// If a pixel of the picture is at least this number of points wide, its values are written into it.
pub const VALUES: f32 = 48.0;

const LEAST: f32 = 1.0 / 64.0;
const MOST: f32 = 256.0;

/// Zoom and position of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Canvas {
    /// Points per pixel, and offset of the picture's centre from the centre of the area in points; `None` fits the whole picture into the area.
    place: Option<(f32, Vec2)>,
    /// Screen pixels per point.
    density: f32,
}

impl Default for Canvas {
    fn default() -> Self {
        Self { place: None, density: 1.0 }
    }
}

impl Canvas {
    /// Sets the number of screen pixels per point.
    pub fn set_density(&mut self, density: f32) {
        self.density = density;
    }

    /// Shows all of the picture.
    pub fn fit(&mut self) {
        self.place = None;
    }

    /// Shows each pixel of the picture as one pixel of the screen; the offset of the picture's centre stays.
    pub fn one_to_one(&mut self) {
        self.place = Some((1.0 / self.density, self.place.map_or(Vec2::ZERO, |(_, offset)| offset)));
    }

    /// Points per pixel.
    #[must_use]
    pub fn scale(&self, area: Rect, [width, height]: [u32; 2]) -> f32 {
        let fitting = (area.width() / width.max(1) as f32).min(area.height() / height.max(1) as f32);
        self.place.map_or(fitting, |(scale, _)| scale)
    }

    /// The rectangle of the whole picture.
    #[must_use]
    pub fn rect(&self, area: Rect, size: [u32; 2]) -> Rect {
        let offset = self.place.map_or(Vec2::ZERO, |(_, offset)| offset);
        let scale = self.scale(area, size);
        let rect = Rect::from_center_size(area.center() + offset, vec2(size[0] as f32, size[1] as f32) * scale);
        // At this scale the pixels of the picture lie on those of the screen, so they are not filtered.
        if scale == 1.0 / self.density {
            Rect::from_min_size(rounded(rect.min * self.density) / self.density, rect.size())
        } else {
            rect
        }
    }

    /// Zooms by a factor around the point `at`, which keeps its place.
    pub fn zoom(&mut self, area: Rect, size: [u32; 2], at: Pos2, factor: f32) {
        let (scale, rect) = (self.scale(area, size), self.rect(area, size));
        let new = (scale * factor).clamp(LEAST, MOST);
        let center = at + (rect.center() - at) * (new / scale);
        self.place = Some((new, center - area.center()));
    }

    /// Moves the picture.
    pub fn pan(&mut self, area: Rect, size: [u32; 2], by: Vec2) {
        let offset = self.rect(area, size).center() - area.center();
        self.place = Some((self.scale(area, size), offset + by));
    }

    /// The pixel at a point, column and row from the top left; `None` outside the picture.
    #[must_use]
    pub fn pixel(&self, area: Rect, size: [u32; 2], at: Pos2) -> Option<[u32; 2]> {
        let from = (at - self.rect(area, size).min) / self.scale(area, size);
        let inside = from.x >= 0.0 && from.y >= 0.0 && from.x < size[0] as f32 && from.y < size[1] as f32;
        inside.then_some([from.x as u32, from.y as u32])
    }

    /// The point of the window at coordinates of the picture, in pixels from its top left.
    #[must_use]
    pub fn point(&self, area: Rect, size: [u32; 2], x: f32, y: f32) -> Pos2 {
        let scale = self.scale(area, size);
        self.rect(area, size).min + vec2(x, y) * scale
    }

    /// The rectangle of a pixel.
    #[must_use]
    pub fn pixel_rect(&self, area: Rect, size: [u32; 2], [x, y]: [u32; 2]) -> Rect {
        let (x, y) = (x as f32, y as f32);
        Rect::from_min_max(self.point(area, size, x, y), self.point(area, size, x + 1.0, y + 1.0))
    }
}

/// The nearest point with whole coordinates, where texts and pixels are sharp.
#[must_use]
pub fn rounded(at: Pos2) -> Pos2 {
    pos2(at.x.round(), at.y.round())
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Rect = Rect { min: pos2(100.0, 50.0), max: pos2(500.0, 250.0) };
    const SIZE: [u32; 2] = [100, 100];

    #[test]
    fn a_fitted_picture_fills_the_shorter_side() {
        let canvas = Canvas::default();
        assert_eq!(canvas.scale(AREA, SIZE), 2.0);
        assert_eq!(canvas.rect(AREA, SIZE), Rect::from_min_max(pos2(200.0, 50.0), pos2(400.0, 250.0)));
        assert_eq!(canvas.pixel(AREA, SIZE, pos2(201.0, 51.0)), Some([0, 0]));
        assert_eq!(canvas.pixel(AREA, SIZE, pos2(399.0, 249.0)), Some([99, 99]));
        assert_eq!(canvas.pixel(AREA, SIZE, pos2(199.0, 51.0)), None);
    }

    #[test]
    fn one_to_one_pixels_lie_on_those_of_the_screen() {
        for density in [1.0_f32, 1.25, 1.5, 2.0] {
            let mut canvas = Canvas::default();
            canvas.set_density(density);
            canvas.one_to_one();
            canvas.pan(AREA, SIZE, vec2(0.3, 0.7));
            let rect = canvas.rect(AREA, SIZE);
            for side in [rect.min.x, rect.min.y, rect.max.x, rect.max.y] {
                let screen = side * density;
                assert!((screen - screen.round()).abs() < 1e-3, "{screen} at {density}");
            }
            assert!((rect.width() * density - SIZE[0] as f32).abs() < 1e-3, "{rect} at {density}");
        }
    }

    #[test]
    fn what_is_under_the_pointer_stays_there() {
        let mut canvas = Canvas::default();
        let at = pos2(321.0, 77.0);
        let before = canvas.pixel(AREA, SIZE, at);
        for factor in [1.7, 3.0, 0.4] {
            canvas.zoom(AREA, SIZE, at, factor);
            assert_eq!(canvas.pixel(AREA, SIZE, at), before);
        }
        assert!((canvas.scale(AREA, SIZE) - 2.0 * 1.7 * 3.0 * 0.4).abs() < 1e-4);
        canvas.pan(AREA, SIZE, vec2(5.0, -3.0));
        assert_eq!(canvas.pixel(AREA, SIZE, at + vec2(5.0, -3.0)), before);
        canvas.zoom(AREA, SIZE, at, 1e9);
        assert_eq!(canvas.scale(AREA, SIZE), MOST);
        canvas.fit();
        assert_eq!(canvas, Canvas::default());
    }
}
