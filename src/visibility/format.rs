//! File formats of rows.

use crate::passes::visibility::Row;
use std::fmt::Write as _;

/// File format of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Text: a comment with the options, a line of column names, and a line for each pair. Numbers are the shortest that are read
    /// back as the same `f64`; missing values are empty.
    Csv,
    /// A NumPy array of records; missing values are NaN.
    Npy,
}

/// Size of the header of an array in bytes: fixed, so that the number of rows can be filled in at the end.
const HEADER: usize = 512;

impl Format {
    /// The format for a file's extension.
    ///
    /// # Errors
    /// A message that says what would be valid.
    pub fn of(path: &std::path::Path) -> Result<Self, String> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
        match extension.as_str() {
            "csv" => Ok(Self::Csv),
            "npy" => Ok(Self::Npy),
            _ => Err(format!("{}: rows are written as .csv or .npy", path.display())),
        }
    }

    /// The header of a file with `rows` rows.
    #[must_use]
    pub fn header(self, about: &str, form_factors: bool, rows: u64) -> Vec<u8> {
        match self {
            Self::Csv => {
                let more = if form_factors { ",f_ab,f_ba,f_ab_error,f_ba_error" } else { "" };
                format!("# {about}\na,b,class,visibility,error,samples,valid{more}\n").into_bytes()
            }
            Self::Npy => {
                let mut fields =
                    vec![("a", "<u4"), ("b", "<u4"), ("class", "|u1"), ("visibility", "<f8"), ("error", "<f8")];
                fields.extend([("samples", "<u4"), ("valid", "<u4")]);
                if form_factors {
                    fields.extend(["f_ab", "f_ba", "f_ab_error", "f_ba_error"].map(|name| (name, "<f8")));
                }
                let fields: Vec<String> = fields.iter().map(|(name, kind)| format!("('{name}', '{kind}')")).collect();
                let text =
                    format!("{{'descr': [{}], 'fortran_order': False, 'shape': ({rows},), }}", fields.join(", "));
                let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
                bytes.extend(((HEADER - 10) as u16).to_le_bytes());
                bytes.extend(text.as_bytes());
                bytes.resize(HEADER - 1, b' ');
                bytes.push(b'\n');
                bytes
            }
        }
    }

    /// Whether the header contains the number of rows.
    #[must_use]
    pub fn counts(self) -> bool {
        self == Self::Npy
    }

    /// Appends a row.
    pub fn write(self, row: &Row, bytes: &mut Vec<u8>) {
        let Row { pair: [a, b], class, visibility, error, form_factors, form_factor_errors, samples, valid } = row;
        match self {
            Self::Csv => {
                let mut text = String::with_capacity(120);
                let seen = visibility.map_or(String::new(), |seen| seen.to_string());
                let error = visibility.map_or(String::new(), |_| error.to_string());
                let _ = write!(text, "{a},{b},{},{seen},{error},{samples},{valid}", class.name());
                if let Some([ab, ba]) = form_factors {
                    let [e, f] = form_factor_errors;
                    let _ = write!(text, ",{ab},{ba},{e},{f}");
                }
                text.push('\n');
                bytes.extend_from_slice(text.as_bytes());
            }
            Self::Npy => {
                bytes.extend(a.to_le_bytes());
                bytes.extend(b.to_le_bytes());
                bytes.push(*class as u8);
                bytes.extend(visibility.unwrap_or(f64::NAN).to_le_bytes());
                bytes.extend(visibility.map_or(f64::NAN, |_| *error).to_le_bytes());
                bytes.extend(samples.to_le_bytes());
                bytes.extend(valid.to_le_bytes());
                if let Some(factors) = form_factors {
                    factors.iter().chain(form_factor_errors).for_each(|value| bytes.extend(value.to_le_bytes()));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::visibility::Class;

    fn row() -> Row {
        Row {
            pair: [3, 70_000],
            class: Class::Sampled,
            visibility: Some(0.1),
            error: 0.025,
            form_factors: Some([1e-7, 0.25]),
            form_factor_errors: [0.0, 1e-3],
            samples: 64,
            valid: 60,
        }
    }

    #[test]
    fn text_reads_back_and_what_is_absent_is_empty() {
        let mut bytes = Format::Csv.header("x", true, 0);
        Format::Csv.write(&row(), &mut bytes);
        Format::Csv.write(&Row { visibility: None, form_factors: None, class: Class::Never, ..row() }, &mut bytes);
        let text = String::from_utf8(bytes).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "# x");
        assert_eq!(lines[1], "a,b,class,visibility,error,samples,valid,f_ab,f_ba,f_ab_error,f_ba_error");
        assert_eq!(lines[2], "3,70000,sampled,0.1,0.025,64,60,0.0000001,0.25,0,0.001");
        assert_eq!(lines[3], "3,70000,never,,,64,60");
    }

    #[test]
    fn arrays_have_one_size_of_header_and_of_rows() {
        for (form_factors, size) in [(false, 33), (true, 65)] {
            for rows in [0, u64::MAX] {
                let header = Format::Npy.header("", form_factors, rows);
                assert_eq!((header.len(), header[511]), (512, b'\n'));
                assert_eq!(&header[..10], b"\x93NUMPY\x01\x00\xf6\x01");
                assert!(String::from_utf8_lossy(&header[10..]).contains(&format!("'shape': ({rows},), }}")));
            }
            let mut bytes = Vec::new();
            Format::Npy.write(&Row { form_factors: row().form_factors.filter(|_| form_factors), ..row() }, &mut bytes);
            assert_eq!(bytes.len(), size);
        }
    }
}
