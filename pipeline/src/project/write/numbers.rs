//! Numbers as texts that the loader reads back bit for bit.

/// An angle in radians as text in degrees.
pub(super) fn degrees(radians: f32) -> String {
    let near = radians.to_degrees();
    // Prefers a number with few decimals, as a person would write it.
    let short = (0..=3).map(|digits| format!("{near:.digits$}"));
    let short = short.filter_map(|text| text.parse::<f32>().ok());
    let mut short = short.filter(|degrees| degrees.to_radians() == radians);
    let neighbours = (-4..=4).map(|step: i32| f32::from_bits(near.to_bits().wrapping_add_signed(step)));
    let found = short.next().or_else(|| neighbours.into_iter().find(|degrees| degrees.to_radians() == radians));
    found.unwrap_or(near).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn angles_are_read_as_they_were(degrees_written in 0.001_f32..179.99) {
            let radians = degrees_written.to_radians();
            let read: f32 = degrees(radians).parse().expect("a number");
            prop_assert_eq!(read.to_radians(), radians);
        }
    }

    #[test]
    fn whole_degrees_are_written_whole() {
        for (degrees_written, text) in [(60.0_f32, "60"), (45.0, "45"), (46.5, "46.5")] {
            assert_eq!(degrees(degrees_written.to_radians()), text);
        }
    }
}
