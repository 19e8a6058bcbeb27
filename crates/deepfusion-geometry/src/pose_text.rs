//! Poses and numbers in the text format of KITTI's files.

use crate::Se3;

/// A number in the format of C's `%.12e`, as printed by KITTI's tools (with fewer digits): `7.215377000000e+02`.
#[must_use]
pub fn scientific(value: f64) -> String {
    let text = format!("{value:.12e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let (sign, digits) = match exponent.strip_prefix('-') {
                Some(digits) => ('-', digits),
                None => ('+', exponent),
            };
            format!("{mantissa}e{sign}{digits:0>2}")
        }
        None => text,
    }
}

/// A pose as a line of KITTI's format, without line end: the upper three rows of the matrix, 12 numbers separated by spaces.
#[must_use]
pub fn kitti_line(pose: &Se3) -> String {
    let matrix = pose.matrix();
    let words: Vec<String> = (0..12)
        .map(|i| scientific(matrix[(i / 4, i % 4)]))
        .collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn numbers_have_kittis_format() {
        assert_eq!(scientific(721.5377), "7.215377000000e+02");
        assert_eq!(scientific(-0.00125), "-1.250000000000e-03");
        assert_eq!(scientific(0.0), "0.000000000000e+00");
    }

    #[test]
    fn a_line_has_the_rows_one_after_the_other() {
        let pose = Se3::from_axis_angle(Vector3::zeros(), Vector3::new(1.5, -2.0, 0.25));
        let numbers: Vec<f64> = kitti_line(&pose)
            .split(' ')
            .map(|word| word.parse().unwrap())
            .collect();
        let expected = [1.0, 0.0, 0.0, 1.5, 0.0, 1.0, 0.0, -2.0, 0.0, 0.0, 1.0, 0.25];
        assert_eq!(numbers, expected);
    }
}
