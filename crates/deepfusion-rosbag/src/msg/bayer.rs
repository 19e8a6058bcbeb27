//! Bilinear demosaicing of Bayer images.
//!
//! A missing colour is the mean of the two or four nearest pixels that have it, rounded half up. This equals OpenCV's
//! `COLOR_Bayer…2RGB`, used by cv_bridge, to the last digit. At the image's edge the neighbours outside are those inside,
//! mirrored at the edge's own pixels, which keeps every colour in its place; OpenCV copies the pixels one further in.

use super::BayerPattern;

/// Row and column of red within a pattern's square of four.
fn red(pattern: BayerPattern) -> (usize, usize) {
    match pattern {
        BayerPattern::Rggb => (0, 0),
        BayerPattern::Grbg => (0, 1),
        BayerPattern::Gbrg => (1, 0),
        BayerPattern::Bggr => (1, 1),
    }
}

/// The neighbours of an index below `count`, which is at least 2.
fn neighbours(index: usize, count: usize) -> (usize, usize) {
    let before = if index == 0 { 1 } else { index - 1 };
    let after = if index + 1 == count {
        index - 1
    } else {
        index + 1
    };
    (before, after)
}

fn mean<const N: usize>(values: [u8; N]) -> u8 {
    let sum: usize = values.iter().map(|value| usize::from(*value)).sum();
    ((sum + N / 2) / N) as u8
}

/// RGB from rows of equal length; nothing for fewer than two rows or columns, which cannot be interpolated.
pub(super) fn to_rgb8(rows: &[&[u8]], pattern: BayerPattern) -> Option<Vec<u8>> {
    let (red_row, red_column) = red(pattern);
    let (height, width) = (rows.len(), rows.first()?.len());
    if height < 2 || width < 2 {
        return None;
    }
    let mut rgb = Vec::with_capacity(height * width * 3);
    for (y, row) in rows.iter().enumerate() {
        let (above, below) = neighbours(y, height);
        let (above, below) = (rows[above], rows[below]);
        let on_red_row = y % 2 == red_row;
        for (x, &here) in row.iter().enumerate() {
            let (left, right) = neighbours(x, width);
            let across = || mean([row[left], row[right]]);
            let along = || mean([above[x], below[x]]);
            let cross = || mean([row[left], row[right], above[x], below[x]]);
            let corners = || mean([above[left], above[right], below[left], below[right]]);
            rgb.extend(match (on_red_row, x % 2 == red_column) {
                (true, true) => [here, cross(), corners()],
                (true, false) => [across(), here, along()],
                (false, true) => [along(), here, across()],
                (false, false) => [corners(), cross(), here],
            });
        }
    }
    Some(rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [BayerPattern; 4] = [
        BayerPattern::Rggb,
        BayerPattern::Bggr,
        BayerPattern::Gbrg,
        BayerPattern::Grbg,
    ];

    /// A scene of one colour, seen through the filters, is that colour everywhere, also at edges and corners.
    #[test]
    fn a_plain_colour_stays_plain_up_to_the_edge() {
        let colour = [200, 90, 7];
        for pattern in ALL {
            let (red_row, red_column) = red(pattern);
            for (height, width) in [(2, 2), (3, 5), (6, 4)] {
                let filter = |y: usize, x: usize| match (y % 2 == red_row, x % 2 == red_column) {
                    (true, true) => 0,
                    (false, false) => 2,
                    _ => 1,
                };
                let rows: Vec<Vec<u8>> = (0..height)
                    .map(|y| (0..width).map(|x| colour[filter(y, x)]).collect())
                    .collect();
                let rows: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
                let rgb = to_rgb8(&rows, pattern).unwrap();
                assert_eq!(rgb, colour.repeat(height * width), "{pattern:?}");
            }
        }
    }

    #[test]
    fn one_row_or_column_shows_no_colour() {
        for pattern in ALL {
            assert_eq!(to_rgb8(&[&[1, 2, 3]], pattern), None);
            assert_eq!(to_rgb8(&[&[1], &[2], &[3]], pattern), None);
            assert_eq!(to_rgb8(&[], pattern), None);
        }
    }
}
