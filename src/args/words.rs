//! Quoting for shells, and parsing that several commands share.

/// A word for a POSIX shell, quoted if the shell would otherwise split it or expand something in it.
#[must_use]
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// Parses the largest error that a picture may have: a number from 0 on.
///
/// # Errors
/// A message that says what would be valid.
pub fn parse_error_bound(text: &str) -> Result<f64, String> {
    let error = text.parse::<f64>().ok().filter(|error| error.is_finite() && *error >= 0.0);
    error.ok_or_else(|| format!("`{text}` is not an error; valid: a number from 0 on, such as 0.02"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_a_shell_would_take_apart_are_quoted() {
        assert_eq!(quoted("a/b.xml"), "a/b.xml");
        assert_eq!(quoted("pass2.samples=4"), "pass2.samples=4");
        assert_eq!(quoted("my scene.xml"), "'my scene.xml'");
        assert_eq!(quoted("it's $HOME"), "'it'\\''s $HOME'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn errors_are_finite_and_not_negative() {
        assert_eq!(parse_error_bound("0.02"), Ok(0.02));
        assert_eq!(parse_error_bound("0"), Ok(0.0));
        for wrong in ["", "-1", "inf", "nan", "2%"] {
            assert!(parse_error_bound(wrong).is_err_and(|error| error.contains("0.02")), "{wrong}");
        }
    }
}
