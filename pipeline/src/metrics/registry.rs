//! The metrics by name, with their formulas, for help texts, tables and limits.

use super::Comparison;

/// Which values of a metric are good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Lower is better; 0 for equal pictures.
    Lower,
    /// Higher is better; equal pictures have the largest value.
    Higher,
    /// Nearer to 1 is better; 1 for equal pictures.
    NearOne,
}

/// One metric.
#[derive(Debug, Clone, Copy)]
pub struct MetricInfo {
    /// Name on the command line.
    pub name: &'static str,
    /// Name in a table.
    pub title: &'static str,
    /// Formula: `t` is a value of the test, `r` of the reference, `n` the number of values.
    pub formula: &'static str,
    /// Which values are good.
    pub better: Better,
    /// Reads the metric from a comparison.
    pub value: fn(&Comparison) -> f64,
}

/// All metrics, in the order in which they are printed.
pub const METRICS: &[MetricInfo] = &[
    MetricInfo {
        name: "rmse",
        title: "RMSE",
        formula: "sqrt(sum((t - r)^2) / n), linear values",
        better: Better::Lower,
        value: |comparison| comparison.rmse,
    },
    MetricInfo {
        name: "relmse",
        title: "relative MSE",
        formula: "sum((t - r)^2 / (r^2 + 0.01)) / n, linear values",
        better: Better::Lower,
        value: |comparison| comparison.relative_mse,
    },
    MetricInfo {
        name: "max",
        title: "largest difference",
        formula: "max(|t - r|), linear values",
        better: Better::Lower,
        value: |comparison| comparison.max,
    },
    MetricInfo {
        name: "psnr",
        title: "PSNR, dB",
        formula: "-20 log10(RMSE), for a peak of 1; infinite where the pictures are equal",
        better: Better::Higher,
        value: |comparison| comparison.psnr,
    },
    MetricInfo {
        name: "ssim",
        title: "SSIM",
        formula: "mean of (2 mt mr + C1)(2 ctr + C2) / ((mt^2 + mr^2 + C1)(vt + vr + C2)) over all 11 x 11 windows inside \
                  the picture, Gaussian of 1.5 pixels, C1 = 0.01^2, C2 = 0.03^2, of 0.2126 R + 0.7152 G + 0.0722 B of \
                  displayed values (Wang et al. 2004)",
        better: Better::Higher,
        value: |comparison| comparison.ssim,
    },
    MetricInfo {
        name: "flip",
        title: "FLIP",
        formula: "mean of dEc^(1 - dEf), colour and feature difference of displayed values (Andersson et al. 2020, LDR)",
        better: Better::Lower,
        value: |comparison| comparison.flip,
    },
    MetricInfo {
        name: "energy",
        title: "energy ratio",
        formula: "sum(t) / sum(r), linear values; 1 where both are 0",
        better: Better::NearOne,
        value: |comparison| comparison.energy_ratio,
    },
    MetricInfo {
        name: "outliers",
        title: "outlier share",
        formula: "share of pixels with |t - r| above the outlier threshold in a channel, linear values",
        better: Better::Lower,
        value: |comparison| comparison.outliers,
    },
];
