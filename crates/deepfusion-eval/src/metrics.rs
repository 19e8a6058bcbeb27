use serde::{Deserialize, Serialize};

/// The field's seven metrics. Errors: lower is better; accuracies a1…a3: higher is better.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Metrics {
    /// mean |gt − pred| / gt.
    pub abs_rel: f64,
    /// mean (gt − pred)² / gt, in metres.
    pub sq_rel: f64,
    /// √mean (gt − pred)², in metres.
    pub rmse: f64,
    /// √mean (ln gt − ln pred)².
    pub rmse_log: f64,
    /// Share of pixels with max(gt/pred, pred/gt) < 1.25.
    pub a1: f64,
    /// Share of pixels with max(gt/pred, pred/gt) < 1.25².
    pub a2: f64,
    /// Share of pixels with max(gt/pred, pred/gt) < 1.25³.
    pub a3: f64,
}

impl Metrics {
    /// Metrics over pixels: `ground_truth[i]` and `prediction[i]` are depths in metres, all above 0. `None` without any pixel. If the
    /// slices differ in length, the longer one is cut.
    #[must_use]
    pub fn of(ground_truth: &[f64], prediction: &[f64]) -> Option<Self> {
        let mut sums = Sums::default();
        for (&gt, &pred) in ground_truth.iter().zip(prediction) {
            sums.push(gt, pred);
        }
        sums.metrics()
    }

    /// The mean of several images' metrics, which the field's tables print; `None` without images.
    #[must_use]
    pub fn mean<'a>(images: impl IntoIterator<Item = &'a Metrics>) -> Option<Self> {
        let mut total = [0.0; 7];
        let mut n = 0usize;
        for metrics in images {
            for (sum, value) in total.iter_mut().zip(metrics.to_array()) {
                *sum += value;
            }
            n += 1;
        }
        (n > 0).then(|| Self::from_array(total.map(|sum| sum / n as f64)))
    }

    /// The values in the order of the field's tables: abs_rel, sq_rel, rmse, rmse_log, a1, a2, a3.
    #[must_use]
    pub fn to_array(&self) -> [f64; 7] {
        [
            self.abs_rel,
            self.sq_rel,
            self.rmse,
            self.rmse_log,
            self.a1,
            self.a2,
            self.a3,
        ]
    }

    /// The names in the same order.
    pub const NAMES: [&'static str; 7] =
        ["abs_rel", "sq_rel", "rmse", "rmse_log", "a1", "a2", "a3"];

    fn from_array([abs_rel, sq_rel, rmse, rmse_log, a1, a2, a3]: [f64; 7]) -> Self {
        Self {
            abs_rel,
            sq_rel,
            rmse,
            rmse_log,
            a1,
            a2,
            a3,
        }
    }
}

/// Running sums of the metrics over pixels.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    pub(crate) n: usize,
    abs_rel: f64,
    sq_rel: f64,
    squared: f64,
    squared_log: f64,
    below: [usize; 3],
}

impl Sums {
    /// Adds one pixel: depths in metres, both above 0.
    pub(crate) fn push(&mut self, gt: f64, pred: f64) {
        let difference = gt - pred;
        self.n += 1;
        self.abs_rel += difference.abs() / gt;
        self.sq_rel += difference * difference / gt;
        self.squared += difference * difference;
        self.squared_log += (gt.ln() - pred.ln()).powi(2);
        let ratio = (gt / pred).max(pred / gt);
        for (count, threshold) in self
            .below
            .iter_mut()
            .zip([1.25, 1.25 * 1.25, 1.25 * 1.25 * 1.25])
        {
            *count += usize::from(ratio < threshold);
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.abs_rel += other.abs_rel;
        self.sq_rel += other.sq_rel;
        self.squared += other.squared;
        self.squared_log += other.squared_log;
        for (count, more) in self.below.iter_mut().zip(other.below) {
            *count += more;
        }
    }

    pub(crate) fn metrics(&self) -> Option<Metrics> {
        (self.n > 0).then(|| {
            let n = self.n as f64;
            let [a1, a2, a3] = self.below.map(|count| count as f64 / n);
            Metrics {
                abs_rel: self.abs_rel / n,
                sq_rel: self.sq_rel / n,
                rmse: (self.squared / n).sqrt(),
                rmse_log: (self.squared_log / n).sqrt(),
                a1,
                a2,
                a3,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn two_pixels_by_hand() {
        // gt 10 → 12 (+20 %, ratio 1.2), gt 20 → 10 (−50 %, ratio 2).
        let m = Metrics::of(&[10.0, 20.0], &[12.0, 10.0]).unwrap();
        assert_relative_eq!(m.abs_rel, 0.35, epsilon = 1e-12);
        assert_relative_eq!(m.sq_rel, (0.4 + 5.0) / 2.0, epsilon = 1e-12);
        assert_relative_eq!(m.rmse, 52.0f64.sqrt(), epsilon = 1e-12);
        let log = (1.2f64.ln().powi(2) + 2.0f64.ln().powi(2)) / 2.0;
        assert_relative_eq!(m.rmse_log, log.sqrt(), epsilon = 1e-12);
        assert_eq!([m.a1, m.a2, m.a3], [0.5, 0.5, 0.5]);
    }

    #[test]
    fn no_pixel_gives_no_metrics() {
        assert_eq!(Metrics::of(&[], &[]), None);
        assert_eq!(Metrics::mean([]), None);
    }
}
