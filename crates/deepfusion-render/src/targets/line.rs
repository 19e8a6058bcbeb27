use image::{Rgb, RgbImage};

/// Draws a line of `thickness` pixels; parts outside the picture are not drawn.
pub(super) fn line(
    picture: &mut RgbImage,
    from: [f64; 2],
    to: [f64; 2],
    thickness: u32,
    colour: Rgb<u8>,
) {
    let Some((from, to)) = within(picture, from, to) else {
        return;
    };
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let steps = dx.abs().max(dy.abs()).ceil().max(1.0) as usize;
    let half = (f64::from(thickness) - 1.0) / 2.0;
    for i in 0..=steps {
        let share = i as f64 / steps as f64;
        let (x, y) = (from[0] + share * dx - half, from[1] + share * dy - half);
        for (a, b) in (0..thickness).flat_map(|a| (0..thickness).map(move |b| (a, b))) {
            let (x, y) = (x + f64::from(a), y + f64::from(b));
            if x >= 0.0
                && y >= 0.0
                && let Some(pixel) = picture.get_pixel_mut_checked(x as u32, y as u32)
            {
                *pixel = colour;
            }
        }
    }
}

/// The part of a line that can touch the picture, so that a corner a kilometre away does not cost a kilometre of pixels
/// (Liang and Barsky).
fn within(picture: &RgbImage, from: [f64; 2], to: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
    const MARGIN: f64 = 8.0;
    let high = [picture.width(), picture.height()].map(|s| f64::from(s) + MARGIN);
    let (mut start, mut end) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let step = to[axis] - from[axis];
        if !step.is_finite() || !from[axis].is_finite() {
            return None;
        }
        for (towards, room) in [
            (-step, from[axis] + MARGIN),
            (step, high[axis] - from[axis]),
        ] {
            if towards == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if towards < 0.0 {
                start = start.max(room / towards);
            } else {
                end = end.min(room / towards);
            }
        }
    }
    let at = |t: f64| [0, 1].map(|k| from[k] + t * (to[k] - from[k]));
    (start <= end).then(|| (at(start), at(end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_runs_far_out_is_drawn_where_it_crosses() {
        let mut picture = RgbImage::new(20, 10);
        let red = Rgb([255, 0, 0]);
        line(&mut picture, [-1e9, 5.0], [1e9, 5.0], 1, red);
        assert!((0..20).all(|x| *picture.get_pixel(x, 5) == red));
        assert_eq!(picture.pixels().filter(|p| **p == red).count(), 20);
        line(&mut picture, [f64::NAN, 0.0], [5.0, 5.0], 1, red);
        line(&mut picture, [100.0, 0.0], [100.0, 9.0], 3, red);
        assert_eq!(picture.pixels().filter(|p| **p == red).count(), 20);
    }
}
