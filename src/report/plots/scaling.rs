//! Time against the number of triangles, pixels, lights, samples or threads, with the fitted exponent.

use super::Plot;
use super::canvas::{Entry, LogAxis, Mark, draw, lay_out, legend, log_chart};
use super::speed::colors;
use crate::report::model::{Against, ReportData, Scaling, ScalingSeries};
use plotters::prelude::*;

const SIZE: (u32, u32) = (760, 420);

/// A power law through points: `y = 10^intercept * x^slope`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// The exponent.
    pub slope: f64,
    /// Decimal logarithm of the factor.
    pub intercept: f64,
    /// Root mean square distance of the points from the line, as a factor; 1 for a perfect fit.
    pub spread: f64,
}

/// Least squares fit of the logarithms. `None` for fewer than three different quantities, to which any line fits.
#[must_use]
pub fn fit(points: &[(f64, f64)]) -> Option<Fit> {
    let logs: Vec<(f64, f64)> =
        points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0).map(|(x, y)| (x.log10(), y.log10())).collect();
    let mut places: Vec<f64> = logs.iter().map(|(x, _)| *x).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    if places.len() < 3 {
        return None;
    }
    let n = logs.len() as f64;
    let (mean_x, mean_y) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let variance: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let slope = covariance / variance;
    let intercept = mean_y - slope * mean_x;
    let residuals: f64 = logs.iter().map(|(x, y)| (y - intercept - slope * x).powi(2)).sum();
    Some(Fit { slope, intercept, spread: 10_f64.powf((residuals / n).sqrt()) })
}

/// The points of a line: quantity and median frame time in milliseconds.
#[must_use]
pub fn points(data: &ReportData, against: Against, series: &ScalingSeries) -> Vec<(f64, f64)> {
    data.points(against, series).map(|(row, amount)| (amount, row.frame.median)).collect()
}

/// Draws the lines on logarithmic axes; the legend has the exponents. `None` without a point.
#[must_use]
pub fn scaling_plot(data: &ReportData, scaling: &Scaling) -> Option<Plot> {
    let mut lines = Vec::new();
    let mut entries: Vec<Entry> = Vec::new();
    for series in &scaling.series {
        let points = points(data, scaling.against, series);
        if points.is_empty() {
            continue;
        }
        let fitted = fit(&points);
        let exponent = fitted.map(|fit| format!(" (exponent {:.2})", fit.slope)).unwrap_or_default();
        let inks = colors(series.technique);
        let before = entries.iter().filter(|entry| inks.contains(&entry.ink)).count();
        let ink = inks[before % inks.len()];
        entries.push(Entry { mark: Mark::of(entries.len()), ink, label: format!("{}{exponent}", series.label) });
        lines.push((points, fitted));
    }
    let all = || lines.iter().flat_map(|(points, _)| points.iter());
    let x = LogAxis::around(all().map(|point| point.0))?;
    let y = LogAxis::around(all().map(|point| point.1))?;
    let (title, axis) = match scaling.against {
        Against::Triangles => ("Frame time against triangles", "triangles of the scene"),
        Against::Pixels => ("Frame time against pixels", "pixels of the window"),
        Against::Lights => ("Frame time against lights", "lights"),
        Against::Samples => ("Frame time against samples", "rays, or depths read, for each point"),
        Against::Threads => ("Frame time against threads", "threads"),
    };
    draw(SIZE, title, |root| {
        let (places, height) = lay_out(&entries, SIZE.0 as i32 - 80);
        legend(root, &entries, &places, (70, 8))?;
        let (_, body) = root.split_vertically(height + 10);
        let mut chart = log_chart(&body, 28, [&x, &y], [axis, "time of a frame, ms"])?;
        for ((points, fitted), entry) in lines.iter().zip(&entries) {
            let color = entry.ink.color();
            let logs: Vec<_> = points.iter().map(|(x, y)| (x.log10(), y.log10())).collect();
            if let (Some(fit), Some(first), Some(last)) = (fitted, logs.first(), logs.last()) {
                let on = |x: f64| (x, (fit.intercept + fit.slope * x).clamp(y.range.0, y.range.1));
                chart.draw_series(DashedLineSeries::new([on(first.0), on(last.0)], 3, 4, color.into()))?;
            }
            chart.draw_series(LineSeries::new(logs.iter().copied(), color.stroke_width(2)))?;
            for place in logs {
                entry.mark.draw(root, chart.plotting_area().map_coordinate(&place), entry.ink)?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_exactly_and_two_points_are_no_law() {
        let law = |exponent: f64| [10.0, 100.0, 500.0, 1e4].map(|x: f64| (x, 3.0 * x.powf(exponent)));
        for exponent in [0.0, 0.31, 1.0, 2.0] {
            let found = fit(&law(exponent)).expect("a fit");
            assert!((found.slope - exponent).abs() < 1e-12 && (found.intercept - 3.0_f64.log10()).abs() < 1e-12);
            assert!((found.spread - 1.0).abs() < 1e-6);
        }
        assert_eq!(fit(&law(1.0)[..2]), None);
        assert_eq!(fit(&[(10.0, 1.0), (10.0, 2.0), (10.0, 3.0), (20.0, 3.0)]), None);
        let mut bent = law(1.0);
        bent[3].1 *= 4.0;
        assert!(fit(&bent).expect("a fit").spread > 1.2);
    }
}
