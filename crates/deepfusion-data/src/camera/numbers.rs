//! A calibration as plain numbers: fx, fy, cx, cy, or a camera matrix row by row.

use crate::CalibrationFileProblem;
use deepfusion_geometry::Distortion;

/// The numbers in a calibration file, which may lack the image size.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Numbers {
    /// fx, fy, cx, cy.
    pub(super) pinhole: [f64; 4],
    pub(super) distortion: Distortion,
    pub(super) size: Option<(u32, u32)>,
}

/// Reads four or nine numbers, separated by commas, spaces or line breaks; `#` begins a comment.
pub(super) fn parse(text: &str) -> Result<Numbers, CalibrationFileProblem> {
    let lines = text.lines().map(|l| l.split('#').next().unwrap_or(""));
    let mut numbers = Vec::new();
    for word in lines
        .flat_map(|l| l.split([',', ' ', '\t', ';', '[', ']']))
        .filter(|w| !w.is_empty())
    {
        let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
        let Some(value) = value else {
            let text = word.chars().take(40).collect();
            return Err(CalibrationFileProblem::NotANumber { text });
        };
        if numbers.len() == 9 {
            return Err(CalibrationFileProblem::TooManyNumbers);
        }
        numbers.push(value);
    }
    let pinhole = match numbers.as_slice() {
        [fx, fy, cx, cy] => [*fx, *fy, *cx, *cy],
        [fx, skew, cx, _, fy, cy, _, _, _] => {
            if skew.abs() > 1e-6 * fx.abs() || numbers[3] != 0.0 || numbers[6..] != [0.0, 0.0, 1.0]
            {
                return Err(CalibrationFileProblem::NotAMatrix);
            }
            [*fx, *fy, *cx, *cy]
        }
        other => {
            let found = other.len();
            return Err(CalibrationFileProblem::Numbers { found });
        }
    };
    Ok(Numbers {
        pinhole,
        distortion: Distortion::default(),
        size: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn four_numbers_or_a_matrix_are_read() {
        let four = parse("585, 586, 320, 240\n").unwrap().pinhole;
        assert_eq!(four, [585.0, 586.0, 320.0, 240.0]);
        assert_eq!(
            parse("585 0 320 # first row\n0 586 240\n0 0 1")
                .unwrap()
                .pinhole,
            four
        );
        for (bad, why) in [
            ("1 2 3", "3 numbers"),
            ("1 2 x 4", "'x'"),
            ("1 2 3 4 5 6 7 8 9", "not of the form"),
            ("1 2 nan 4", "'nan'"),
            ("1 2 3 4 5 6 7 8 9 10", "more than nine"),
        ] {
            let problem = parse(bad).unwrap_err().to_string();
            assert!(problem.contains(why), "{problem}");
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,80}") {
            let _ = parse(&text);
        }
    }
}
