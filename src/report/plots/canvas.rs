//! Items that all plots share: colours that follow the page, text, legends, marks, logarithmic axes.

use super::Plot;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A colour of the page, as an index into [`VARIABLES`]. plotters supports fixed colours only, so each is
/// drawn in a unique fixed colour, which the finished SVG replaces by the page's variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ink(u8);

/// Text and axes.
pub const INK: Ink = Ink(0);
/// Less prominent text.
pub const MUTED: Ink = Ink(1);
/// Grid lines.
pub const GRID: Ink = Ink(2);
/// Rays: the main colour, and two more for further series.
pub const RAYS: [Ink; 3] = [Ink(3), Ink(4), Ink(5)];
/// Raster: the main colour, and two more for further series.
pub const RASTER: [Ink; 3] = [Ink(6), Ink(7), Ink(8)];
/// Neither rays nor raster.
pub const NEUTRAL: Ink = Ink(9);

/// Name, light and dark value of each colour. Against its background, each series has a contrast of at least 3, and text one of 4.5
/// (WCAG 2.2, 1.4.3 and 1.4.11); a test computes them.
pub const VARIABLES: [(&str, &str, &str); 10] = [
    ("--ink", "#1c1e21", "#e6e4df"),
    ("--muted", "#5b6068", "#a3a7ad"),
    ("--grid", "#d9d7d0", "#3a3e44"),
    ("--rays", "#1f5fae", "#7fb3f2"),
    ("--rays-2", "#0f766e", "#58c7ba"),
    ("--rays-3", "#5a4fcf", "#aca5f5"),
    ("--raster", "#b8500c", "#f2a065"),
    ("--raster-2", "#94316f", "#e592c4"),
    ("--raster-3", "#7a6a00", "#d2bf4a"),
    ("--neutral", "#6b7078", "#9aa0a8"),
];
/// Light and dark background of the page.
pub const GROUND: [&str; 2] = ["#fbfaf7", "#16181b"];

impl Ink {
    /// The fixed colour in which plotters draws it.
    pub const fn color(self) -> RGBColor {
        RGBColor(1, 2, 16 + self.0)
    }
}

/// Height of a line of text of [`FONT`], pixels.
pub const LINE: i32 = 18;
/// Size of text.
pub const FONT: i32 = 13;

pub type Root<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Failed = DrawingAreaErrorKind<std::io::Error>;

/// A text style with a colour and an anchor.
pub fn text(size: i32, ink: Ink, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&ink.color()).pos(Pos::new(horizontal, vertical))
}

/// Approximate width of text in a sans-serif font, pixels.
pub fn text_width(text: &str, size: i32) -> i32 {
    (text.chars().count() as f64 * f64::from(size) * 0.55).ceil() as i32
}

/// Draws a plot of `size` pixels, and replaces its colours by the page's. `None` if plotters fails, which it does for empty
/// ranges only; no caller passes an empty range.
pub fn draw(size: (u32, u32), title: &str, paint: impl FnOnce(&Root<'_>) -> Result<(), Failed>) -> Option<Plot> {
    let mut svg = String::new();
    let painted = {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        paint(&root).and_then(|()| root.present())
    };
    painted.ok()?;
    Some(finish(&svg, size, title))
}

fn finish(svg: &str, (width, height): (u32, u32), title: &str) -> Plot {
    let mut body = svg.split_once('>').map_or("", |(_, body)| body).trim_end().trim_end_matches("</svg>").to_owned();
    for (index, (name, _, _)) in VARIABLES.iter().enumerate() {
        body = body.replace(&format!("\"#0102{:02X}\"", 16 + index), &format!("\"var({name})\""));
    }
    body = body.replace("font-family=\"sans-serif\" ", "");
    let title = maud::html! { (title) }.into_string();
    let open = |extra: &str| {
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\"{extra}>")
    };
    let label = format!(" aria-label=\"{title}\" style=\"--w:{width}px\"");
    let style = |values: &dyn Fn(&(&str, &str, &str)) -> String, ground: &str| {
        let colors: String = VARIABLES.iter().map(values).collect();
        format!("svg{{{colors}background:{ground};font-family:system-ui,sans-serif}}")
    };
    let light = style(&|(name, light, _)| format!("{name}:{light};"), GROUND[0]);
    let dark = style(&|(name, _, dark)| format!("{name}:{dark};"), GROUND[1]);
    Plot {
        inline: format!("{}{body}</svg>", open(&label).replace(" xmlns=\"http://www.w3.org/2000/svg\"", "")),
        file: format!(
            "{}\n<title>{title}</title>\n<style>{light}@media (prefers-color-scheme:dark){{{dark}}}</style>{body}</svg>\n",
            open(&format!(" width=\"{width}\" height=\"{height}\""))
        ),
    }
}

/// The shape of a mark, so that series differ without colour too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    Circle,
    Square,
    Diamond,
    Triangle,
    Bar,
}

impl Mark {
    /// The mark at an index; the marks repeat.
    pub fn of(index: usize) -> Self {
        [Self::Circle, Self::Square, Self::Diamond, Self::Triangle, Self::Bar][index % 5]
    }

    /// Its outline around a pixel; `None` for a circle.
    fn outline(self, (x, y): (i32, i32)) -> Option<Vec<(i32, i32)>> {
        let corners: &[(i32, i32)] = match self {
            Self::Circle => return None,
            Self::Square => &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
            Self::Diamond => &[(0, -6), (6, 0), (0, 6), (-6, 0)],
            Self::Triangle => &[(0, -6), (6, 5), (-6, 5)],
            Self::Bar => &[(-2, -7), (2, -7), (2, 7), (-2, 7)],
        };
        Some(corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect())
    }

    /// Draws the mark.
    pub fn draw(self, root: &Root<'_>, at: (i32, i32), ink: Ink) -> Result<(), Failed> {
        let style = ink.color().filled();
        match self.outline(at) {
            None => root.draw(&Circle::new(at, 5, style)),
            Some(outline) => root.draw(&Polygon::new(outline, style)),
        }
    }
}

/// An entry of a legend.
pub struct Entry {
    pub mark: Mark,
    pub ink: Ink,
    pub label: String,
}

/// Positions of the entries of a legend in lines of at most `width` pixels, and the height of all lines.
pub fn lay_out(entries: &[Entry], width: i32) -> (Vec<(i32, i32)>, i32) {
    let (mut x, mut y) = (0, 0);
    let mut places = Vec::with_capacity(entries.len());
    for entry in entries {
        let needed = 18 + text_width(&entry.label, FONT) + 22;
        if x > 0 && x + needed > width {
            (x, y) = (0, y + LINE + 2);
        }
        places.push((x, y));
        x += needed;
    }
    (places, y + LINE + 6)
}

/// Draws a legend with its corner at `at`, with the positions that [`lay_out`] returned.
pub fn legend(root: &Root<'_>, entries: &[Entry], places: &[(i32, i32)], at: (i32, i32)) -> Result<(), Failed> {
    for (entry, (x, y)) in entries.iter().zip(places) {
        let (x, y) = (at.0 + x, at.1 + y);
        entry.mark.draw(root, (x + 7, y + LINE / 2), entry.ink)?;
        root.draw_text(&entry.label, &text(FONT, INK, HPos::Left, VPos::Center), (x + 18, y + LINE / 2))?;
    }
    Ok(())
}

/// A logarithmic axis. Its coordinate is the decimal logarithm, so that we can choose the ticks.
#[derive(Clone)]
pub struct LogAxis {
    /// Logarithms of the ends.
    pub range: (f64, f64),
    /// Logarithms of the ticks.
    pub ticks: Vec<f64>,
}

impl LogAxis {
    /// An axis around the positive finite values, with some margin; `None` if there are none.
    pub fn around(values: impl Iterator<Item = f64>) -> Option<Self> {
        let logs = values.filter(|value| *value > 0.0 && value.is_finite()).map(f64::log10);
        let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if low > high {
            return None;
        }
        // At least 0.12 decades on each side, so that a single value also has an axis.
        let room = ((high - low) * 0.07).max(0.12);
        let (low, high) = (low - room, high + room);
        let steps: &[f64] = match high - low {
            span if span > 3.2 => &[1.0],
            span if span > 1.6 => &[1.0, 3.0],
            span if span > 0.5 => &[1.0, 2.0, 5.0],
            _ => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
        };
        let decades = low.floor() as i32..=high.ceil() as i32;
        let ticks = decades.flat_map(|decade| steps.iter().map(move |step| f64::from(decade) + step.log10()));
        Some(Self { range: (low, high), ticks: ticks.filter(|tick| (low..=high).contains(tick)).collect() })
    }
}

/// A chart with two logarithmic axes.
pub type LogChart<'b, 'a> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<LogAxis, LogAxis>>;

/// Draws two logarithmic axes with their grid and titles; `right` pixels are left free for labels of points.
pub fn log_chart<'b, 'a>(
    body: &'b Root<'a>,
    right: u32,
    [x, y]: [&LogAxis; 2],
    [x_title, y_title]: [&str; 2],
) -> Result<LogChart<'b, 'a>, Failed> {
    let mut chart = ChartBuilder::on(body)
        .margin_left(10)
        .margin_right(right)
        .margin_top(6)
        .x_label_area_size(46)
        .y_label_area_size(70)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .axis_style(MUTED.color())
        .bold_line_style(GRID.color())
        .light_line_style(TRANSPARENT)
        .label_style(text(FONT, INK, HPos::Left, VPos::Top))
        .axis_desc_style(text(FONT, INK, HPos::Left, VPos::Top))
        .x_desc(x_title)
        .y_desc(y_title)
        .x_label_formatter(&|value| tick(*value))
        .y_label_formatter(&|value| tick(*value))
        .draw()?;
    Ok(chart)
}

impl Ranged for LogAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (value - self.range.0) / (self.range.1 - self.range.0);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.range.0..self.range.1
    }
}

/// Text of a tick of a [`LogAxis`]: two digits, without rounding errors of floats.
pub fn tick(logarithm: f64) -> String {
    let value = 10_f64.powf(logarithm);
    if value >= 999.5 {
        super::super::number::short_count((value / 10.0).round() * 10.0)
    } else if value >= 0.000_95 {
        let digits = (1.0 - value.log10().floor()).clamp(0.0, 5.0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance (WCAG 2.2).
    fn luminance(hex: &str) -> f64 {
        let channel = |at: usize| {
            let value = f64::from(u8::from_str_radix(&hex[at..at + 2], 16).expect("hex")) / 255.0;
            if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    fn contrast(a: &str, b: &str) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn every_colour_stands_out_from_the_light_and_the_dark_ground() {
        assert!((contrast("#000000", "#ffffff") - 21.0).abs() < 1e-9);
        assert!(contrast("#bbbbbb", GROUND[0]) < 3.0, "a pale grey must not pass");
        for (index, (name, light, dark)) in VARIABLES.iter().enumerate() {
            let needed = match Ink(index as u8) {
                GRID => continue,
                INK | MUTED => 4.5,
                _ => 3.0,
            };
            assert!(contrast(light, GROUND[0]) >= needed, "{name} light {}", contrast(light, GROUND[0]));
            assert!(contrast(dark, GROUND[1]) >= needed, "{name} dark {}", contrast(dark, GROUND[1]));
        }
    }

    #[test]
    fn logarithmic_ticks_are_round_numbers_inside_the_axis() {
        let axis = LogAxis::around([3.0, 700.0].into_iter()).expect("an axis");
        let printed: Vec<String> = axis.ticks.iter().map(|value| tick(*value)).collect();
        assert_eq!(printed, ["3", "10", "30", "100", "300", "1\u{202f}k"]);
        assert!(LogAxis::around([0.0, -1.0, f64::NAN].into_iter()).is_none());
        assert_eq!(LogAxis::around([16.0].into_iter()).expect("an axis").ticks.len(), 2);
        assert_eq!([-4.0, -3.0, 4.0, 7.0].map(tick), ["1e-4", "0.001", "10\u{202f}k", "10\u{202f}M"]);
    }

    #[test]
    fn a_plot_follows_the_page_and_its_file_brings_the_colours_along() {
        let plot = draw((90, 40), "A <plot>", |root| {
            Mark::Square.draw(root, (20, 20), RAYS[0])?;
            root.draw_text("a < b", &text(FONT, INK, HPos::Left, VPos::Center), (30, 20))
        })
        .expect("a plot");
        assert!(plot.inline.contains("var(--rays)") && plot.inline.contains("var(--ink)"), "{}", plot.inline);
        assert!(!plot.inline.contains("#0102") && !plot.inline.contains("A <plot>"), "{}", plot.inline);
        assert!(plot.file.contains("--rays:#1f5fae") && plot.file.contains("prefers-color-scheme:dark"));
        assert!(plot.file.contains("a &lt; b"), "{}", plot.file);
    }
}
