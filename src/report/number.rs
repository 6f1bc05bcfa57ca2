//! Numbers as the page prints them.

/// A time as [`significant`] prints it, with its unit: `0.870 ms`, `16.7 ms`, `2354 ms`.
#[must_use]
pub fn milliseconds(ms: f64) -> String {
    format!("{} ms", significant(ms))
}

/// Three significant digits from 1 to 100, three decimals below 1, and whole numbers from 100 on. Without an exponent.
#[must_use]
pub fn significant(value: f64) -> String {
    let magnitude = value.abs();
    if !value.is_finite() {
        "–".to_owned()
    } else if magnitude >= 99.95 {
        format!("{value:.0}")
    } else if magnitude >= 9.995 {
        format!("{value:.1}")
    } else if magnitude >= 0.9995 {
        format!("{value:.2}")
    } else {
        format!("{value:.3}")
    }
}

/// An error with two significant digits; `0` only if it is exactly 0.
#[must_use]
pub fn error(value: f64) -> String {
    let magnitude = value.abs();
    if !value.is_finite() {
        "–".to_owned()
    } else if value == 0.0 {
        "0".to_owned()
    } else if magnitude < 9.5e-5 {
        format!("{value:.1e}")
    } else {
        // Digits after the point so that two significant ones remain.
        let digits = (1.0 - magnitude.log10().floor()).clamp(0.0, 5.0) as usize;
        format!("{value:.digits$}")
    }
}

/// `55 954`, in groups of three with a narrow no-break space.
#[must_use]
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::with_capacity(digits.len() * 2);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// A large quantity, abbreviated: `56 k`, `1.05 M`.
#[must_use]
pub fn short_count(value: f64) -> String {
    let (scaled, unit) = if value >= 999_500.0 {
        (value / 1e6, "\u{202f}M")
    } else if value >= 999.5 {
        (value / 1e3, "\u{202f}k")
    } else {
        (value, "")
    };
    let text = significant(scaled);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text}{unit}")
}

/// Bytes in binary units.
#[must_use]
pub fn bytes(value: u64) -> String {
    const UNITS: [&str; 4] = ["B", "KiB", "MiB", "GiB"];
    let mut scaled = value as f64;
    let mut unit = 0;
    while scaled >= 1024.0 && unit + 1 < UNITS.len() {
        scaled /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{value} B") } else { format!("{} {}", significant(scaled), UNITS[unit]) }
}

/// `3 min 20 s`, `41 s`.
#[must_use]
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    if whole >= 60 { format!("{} min {} s", whole / 60, whole % 60) } else { format!("{whole} s") }
}

/// Seconds since 1970 as `2026-11-21 03:00 UTC` (Howard Hinnant, "chrono-Compatible Low-Level Date Algorithms").
#[must_use]
pub fn date(unix_s: u64) -> String {
    let days = unix_s / 86_400;
    let shifted = days + 719_468;
    let era = shifted / 146_097;
    let day_of_era = shifted % 146_097;
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let minutes = unix_s % 86_400 / 60;
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02} UTC", minutes / 60, minutes % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_errors_keep_their_significant_digits() {
        assert_eq!(
            ["0.001", "0.870", "1.00", "16.7", "100", "2354"].map(str::to_owned),
            [0.001, 0.87, 0.9996, 16.67, 99.96, 2354.3].map(significant)
        );
        assert_eq!(
            [0.0, 0.0123, 0.5, 0.000_012, 0.000_95, 12.0].map(error),
            ["0", "0.012", "0.50", "1.2e-5", "0.00095", "12"]
        );
        assert_eq!((significant(f64::NAN), error(f64::INFINITY)), ("–".to_owned(), "–".to_owned()));
    }

    #[test]
    fn counts_bytes_and_durations_read_well() {
        assert_eq!(grouped(1_048_576), "1\u{202f}048\u{202f}576");
        assert_eq!((grouped(0), grouped(999)), ("0".to_owned(), "999".to_owned()));
        assert_eq!(short_count(10_000.0), "10\u{202f}k");
        assert_eq!(short_count(1_048_576.0), "1.05\u{202f}M");
        assert_eq!(short_count(64.0), "64");
        assert_eq!((bytes(512), bytes(3 << 20)), ("512 B".to_owned(), "3.00 MiB".to_owned()));
        assert_eq!((duration(41.4), duration(200.0)), ("41 s".to_owned(), "3 min 20 s".to_owned()));
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(date(0), "1970-01-01 00:00 UTC");
        assert_eq!(date(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(date(1_709_251_199), "2024-02-29 23:59 UTC");
        assert_eq!(date(4_107_542_400), "2100-03-01 00:00 UTC");
    }
}
