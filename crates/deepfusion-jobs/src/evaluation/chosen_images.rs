//! Chooses the images of an evaluation to look at.

use std::fmt;

use deepfusion_eval::ImageScore;

/// How many of the best and of the worst images are chosen.
const BEST: usize = 2;
const WORST: usize = 3;

/// A chosen image of an evaluation, and its rank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChosenImage {
    /// Its index in [`super::Evaluated::images`].
    pub image: usize,
    /// Its rank among all images.
    pub standing: Standing,
}

/// The rank of an image among all, by unscaled Abs Rel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Standing {
    /// Among the best.
    Best,
    /// The median.
    Median,
    /// Among the worst.
    Worst,
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Best => "Best",
            Self::Median => "Median",
            Self::Worst => "Worst",
        })
    }
}

/// The best images, the median one and the worst, in this order, by unscaled Abs Rel; each only once.
#[must_use]
pub fn chosen_images(images: &[ImageScore]) -> Vec<ChosenImage> {
    let error = |i: &usize| images[*i].unscaled.abs_rel;
    let mut order: Vec<usize> = (0..images.len()).collect();
    order.sort_by(|a, b| error(a).total_cmp(&error(b)));
    let n = order.len();
    let middle = n / 2;
    let best = (0..BEST.min(middle)).map(|rank| (rank, Standing::Best));
    let worst = (n.saturating_sub(WORST).max(middle + 1)..n).map(|rank| (rank, Standing::Worst));
    let typical = (n > 0).then_some((middle, Standing::Median));
    let ranks = best.chain(typical).chain(worst.rev());
    ranks
        .map(|(rank, standing)| ChosenImage {
            image: order[rank],
            standing,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_eval::{Evaluator, Grid, Prediction, Protocol};

    fn scores(images: usize) -> Vec<ImageScore> {
        let mut evaluator = Evaluator::new(Protocol::default()).unwrap();
        let truth = Grid::new(2, 1, vec![10.0, 20.0]).unwrap();
        for i in 0..images {
            let depth = Grid::new(2, 1, vec![10.0 + i as f64, 20.0]).unwrap();
            let name = format!("{i}");
            evaluator
                .add(&name, &Prediction::Depth(depth), &truth)
                .unwrap();
        }
        evaluator.images().to_vec()
    }

    #[test]
    fn best_median_and_worst_are_chosen_once() {
        for (images, expected) in [
            (0, vec![]),
            (1, vec![0]),
            (2, vec![0, 1]),
            (3, vec![0, 1, 2]),
            (10, vec![0, 1, 5, 9, 8, 7]),
        ] {
            let chosen = chosen_images(&scores(images));
            let places: Vec<usize> = chosen.iter().map(|c| c.image).collect();
            assert_eq!(places, expected);
            let medians = chosen.iter().filter(|c| c.standing == Standing::Median);
            assert_eq!(medians.count(), images.min(1));
        }
    }
}
