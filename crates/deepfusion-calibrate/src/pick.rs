//! Chooses the frames of a video that are used for the calibration.

use image::GrayImage;
use nalgebra::Vector2;

/// Boards count as the same view if they are nearer than this share of the image's diagonal.
const SAME: f64 = 0.02;

/// A frame that shows the whole board.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The board's inner corners, in pixels.
    pub corners: Vec<Vector2<f64>>,
    /// Sharpness of the frame, by [`sharpness`].
    pub sharpness: f64,
}

/// Sharpness of a picture, for comparison with others of the same scene: the mean square of its Laplacian, in grey values².
#[must_use]
pub fn sharpness(image: &GrayImage) -> f64 {
    let (width, height) = (image.width() as usize, image.height() as usize);
    if width < 3 || height < 3 {
        return 0.0;
    }
    let pixels = image.as_raw();
    let mut sum = 0.0;
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let at = y * width + x;
            let grey = |i: usize| i32::from(pixels[i]);
            let around = grey(at - 1) + grey(at + 1) + grey(at - width) + grey(at + width);
            sum += f64::from(around - 4 * grey(at)).powi(2);
        }
    }
    sum / ((width - 2) * (height - 2)) as f64
}

/// Indices of at most `most` of the candidates, in ascending order. The first choice is the sharpest candidate, and each next one the
/// farthest from all chosen before. None shows the board at the same place as another.
#[must_use]
pub fn pick(candidates: &[Candidate], image_size: (u32, u32), most: usize) -> Vec<usize> {
    let diagonal = f64::from(image_size.0).hypot(f64::from(image_size.1));
    let sharpest = (0..candidates.len()).max_by(|a, b| {
        candidates[*a]
            .sharpness
            .total_cmp(&candidates[*b].sharpness)
    });
    let Some(first) = sharpest.filter(|_| most > 0) else {
        return Vec::new();
    };
    let mut picked = vec![first];
    let mut away: Vec<f64> = candidates
        .iter()
        .map(|c| greatest_move(c, &candidates[first]))
        .collect();
    while picked.len() < most {
        let Some(next) = (0..candidates.len()).max_by(|a, b| away[*a].total_cmp(&away[*b])) else {
            break;
        };
        if away[next] < SAME * diagonal {
            break;
        }
        picked.push(next);
        for (i, candidate) in candidates.iter().enumerate() {
            away[i] = away[i].min(greatest_move(candidate, &candidates[next]));
        }
    }
    picked.sort_unstable();
    picked
}

/// Greatest distance by which a board's corner moves from one view to the other, in pixels; a board turned by half a turn is the same.
fn greatest_move(a: &Candidate, b: &Candidate) -> f64 {
    let farthest = |pairs: &mut dyn Iterator<Item = (&Vector2<f64>, &Vector2<f64>)>| {
        pairs.map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
    };
    let same = farthest(&mut a.corners.iter().zip(&b.corners));
    let turned = farthest(&mut a.corners.iter().zip(b.corners.iter().rev()));
    same.min(turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    fn at(x: f64, sharpness: f64) -> Candidate {
        let corners = vec![Vector2::new(x, 0.0), Vector2::new(x + 50.0, 10.0)];
        Candidate { corners, sharpness }
    }

    #[test]
    fn the_sharpest_and_distant_views_are_picked() {
        let candidates = [at(0.0, 1.0), at(1.0, 5.0), at(300.0, 2.0), at(100.0, 2.0)];
        assert_eq!(pick(&candidates, (400, 300), 3), [1, 2, 3]);
        assert_eq!(pick(&candidates, (400, 300), 2), [1, 2]);
        assert_eq!(
            pick(&candidates, (400, 300), 9),
            [1, 2, 3],
            "the first and the second are the same view"
        );
        assert!(pick(&[], (400, 300), 9).is_empty());
        // The same view, with corners from the other end.
        let mut turned = at(1.0, 0.1);
        turned.corners.reverse();
        assert_eq!(pick(&[at(1.0, 1.0), turned], (400, 300), 9), [0]);
    }

    #[test]
    fn blur_reduces_sharpness() {
        let edge = |width: f64| {
            GrayImage::from_fn(40, 20, |x, _| {
                let grey = 127.0 + 100.0 * ((f64::from(x) - 20.0) / width).tanh();
                Luma([grey as u8])
            })
        };
        assert!(sharpness(&edge(0.5)) > 2.0 * sharpness(&edge(2.0)));
        assert_eq!(sharpness(&GrayImage::new(2, 2)), 0.0);
    }
}
