use crate::Motion;
use burn::tensor::Tensor;

/// Standard deviation of a distance, as a share of it, at which its pair has half the weight.
const HALF_WEIGHT_SHARE: f64 = 0.05;

/// The weight of a pair in [`speed`] from the uncertainty of its distance: 1 / (1 + (σ / 0.05 d)²), or 1 where σ is not known. It is the
/// weight of this distance in a mean, weighted by inverse variance, with a distance known to 5 %. So slow pairs, whose distances a GPS
/// receiver measures poorly, count less than fast ones.
#[must_use]
pub fn distance_weight(distance_m: f64, sigma_m: Option<f64>) -> f64 {
    match sigma_m.filter(|sigma| *sigma > 0.0) {
        None => 1.0,
        Some(sigma) => {
            let half = HALF_WEIGHT_SHARE * distance_m.abs();
            half * half / (half * half + sigma * sigma)
        }
    }
}

/// The speed loss (Eq. 32–39): mean over pairs of w·|‖t̂‖ − d| + β_R·angle(R̂ᵀ·R), d and R from the
/// vehicle's sensors, w as [`distance_weight`] or 0 for a pair that does not count. It fixes the metric scale.
///
/// # Shapes
/// - `motion`: N predicted motions
/// - `distance_m`: `[N]`, length of the camera's true translation
/// - `weight`: `[N]`, w; `None`: 1
/// - `rotation`: `[N, 3, 3]`, the true rotation in the same direction; read only where β_R > 0
/// - output: one value, in metres
#[must_use]
pub fn speed(
    motion: &Motion,
    distance_m: Tensor<1>,
    weight: Option<Tensor<1>>,
    rotation: &Tensor<3>,
    rotation_weight: f64,
) -> Tensor<1> {
    let off = motion.distance().sub(distance_m).abs();
    let translation = match weight {
        Some(weight) => off.mul(weight).mean(),
        None => off.mean(),
    };
    if rotation_weight == 0.0 {
        return translation;
    }
    let angle = angle(&motion.rotation, rotation);
    translation + angle.mean().mul_scalar(rotation_weight)
}

/// The angles between rotations, N. ‖R̂ − R‖_F = 2√2·sin(angle/2): for the small angles between two frames the angle is
/// ‖R̂ − R‖_F/√2 to third order, and the square root is kept away from zero.
fn angle(predicted: &Tensor<3>, measured: &Tensor<3>) -> Tensor<1> {
    let [n, _, _] = measured.dims();
    let squares = predicted.clone().sub(measured.clone()).powi_scalar(2);
    let sum = squares.reshape([n, 9]).sum_dim(1).reshape([n]);
    sum.mul_scalar(0.5).add_scalar(1e-12).sqrt()
}

/// Weight of a radian in [`motion`], in metres: the distance that it moves a point ten metres away.
const METRES_PER_RADIAN: f64 = 10.0;

/// The distance of predicted motions from measured ones: mean over pairs of ‖t̂ − t‖ + 10 m·angle(R̂ᵀ·R).
/// PoseNet learns from it when the measured motion synthesises the views.
///
/// # Shapes
/// - `predicted`, `measured`: N motions in the same direction
/// - `weight`: `[N]`, 1 for the pairs that count and 0 for the others, which stay in the mean; `None`: all count
/// - output: one value, in metres
#[must_use]
pub fn motion(predicted: &Motion, measured: &Motion, weight: Option<Tensor<1>>) -> Tensor<1> {
    // A motion whose length is the distance between the two translations.
    let apart = Motion {
        rotation: predicted.rotation.clone(),
        translation: predicted
            .translation
            .clone()
            .sub(measured.translation.clone()),
    };
    let angle = angle(&predicted.rotation, &measured.rotation);
    let off = apart.distance() + angle.mul_scalar(METRES_PER_RADIAN);
    match weight {
        Some(weight) => off.mul(weight).mean(),
        None => off.mean(),
    }
}

/// λ_v at a step (counted from 0): it rises linearly over one epoch or `warmup_steps`, whichever is
/// longer, but over at most a tenth of the run.
#[must_use]
pub fn speed_weight(
    weight: f64,
    step: usize,
    steps: usize,
    epoch_steps: usize,
    warmup_steps: usize,
) -> f64 {
    let warmup = epoch_steps.max(warmup_steps).min(steps / 10).max(1);
    weight * ((step + 1) as f64 / warmup as f64).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn the_right_distance_costs_nothing_in_any_direction() {
        let device = Device::flex();
        let zeros = Tensor::<2>::zeros([2, 3], &device);
        let translation = Tensor::<2>::from_data([[0.0, 0.6, 0.8], [3.0, 0.0, -4.0]], &device);
        let motion = Motion::new(zeros, translation);
        let rotation = motion.rotation.clone();
        let loss = |d: [f32; 2]| {
            let d = Tensor::<1>::from_data(d, &device);
            speed(&motion, d, None, &rotation, 0.5).into_scalar::<f32>()
        };
        assert!(loss([1.0, 5.0]) < 1e-5);
        assert!((loss([1.5, 4.0]) - 0.75).abs() < 1e-5);
    }

    #[test]
    fn an_uncertain_distance_has_less_weight() {
        assert!((distance_weight(2.0, None) - 1.0).abs() < 1e-12);
        assert!((distance_weight(2.0, Some(0.0)) - 1.0).abs() < 1e-12);
        // 5 % gives a weight of a half, 15 % of a tenth.
        assert!((distance_weight(2.0, Some(0.1)) - 0.5).abs() < 1e-12);
        assert!((distance_weight(-2.0, Some(0.3)) - 0.1).abs() < 1e-12);
        assert!(distance_weight(0.0, Some(0.3)).abs() < 1e-12);
        let device = Device::flex();
        let zeros = Tensor::<2>::zeros([2, 3], &device);
        let translation = Tensor::<2>::from_data([[0.0, 0.6, 0.8], [3.0, 0.0, -4.0]], &device);
        let motion = Motion::new(zeros, translation);
        let d = Tensor::<1>::from_data([1.5, 4.0], &device);
        let weight = Tensor::<1>::from_data([0.5, 0.1], &device);
        let loss = speed(&motion, d, Some(weight), &motion.rotation, 0.0);
        // (0.5 · 0.5 + 0.1 · 1) / 2.
        assert!((loss.into_scalar::<f32>() - 0.175).abs() < 1e-5);
    }

    #[test]
    fn a_motion_costs_its_distance_and_ten_metres_per_radian() {
        let device = Device::flex();
        let of = |v: [f32; 3], t: [f32; 3]| {
            Motion::new(
                Tensor::<2>::from_data([v], &device),
                Tensor::<2>::from_data([t], &device),
            )
        };
        let measured = of([0.0, 0.01, 0.0], [0.0, 0.0, -1.0]);
        let predicted = of([0.0, 0.03, 0.0], [0.3, 0.0, -1.4]);
        let loss = motion(&predicted, &measured, None).into_scalar::<f32>();
        assert!((loss - 0.7).abs() < 1e-4, "{loss}");
        // The norm's ε is 1e-4 m.
        assert!(motion(&measured, &measured, None).into_scalar::<f32>() < 2e-4);
        let two = |a: &Motion, b: &Motion| Motion::cat(vec![a.clone(), b.clone()]);
        let pairs = (two(&predicted, &predicted), two(&measured, &measured));
        let first = Tensor::<1>::from_data([1.0, 0.0], &device);
        let half = motion(&pairs.0, &pairs.1, Some(first)).into_scalar::<f32>();
        assert!((half - 0.35).abs() < 1e-4, "{half}");
    }

    #[test]
    fn the_rotation_term_is_the_angle() {
        let device = Device::flex();
        let translation = Tensor::<2>::from_data([[0.0, 0.0, 1.0]], &device);
        let turned = Tensor::<2>::from_data([[0.0, 0.02, 0.0]], &device);
        let motion = Motion::new(turned, translation.clone());
        let straight = Motion::new(Tensor::zeros([1, 3], &device), translation);
        let one = Tensor::<1>::ones([1], &device);
        let loss = speed(&motion, one, None, &straight.rotation, 1.0).into_scalar::<f32>();
        assert!((loss - 0.02).abs() < 1e-5, "{loss}");
    }

    /// The gradient of `loss` with respect to a motion's axis-angle and translation equals central differences. In f32 a step of 1e-2 on a
    /// smooth function of order 1 leaves 1e-4; the losses are evaluated away from their kinks.
    fn check_gradient(what: &str, point: [f32; 6], loss: &dyn Fn(&Motion) -> Tensor<1>) {
        let device = Device::flex().autodiff();
        let at = |point: [f32; 6]| {
            let v = Tensor::<1>::from_data(point, &device).require_grad();
            let part = |first| v.clone().narrow(0, first, 3).reshape([1, 3]);
            let value = loss(&Motion::new(part(0), part(3)));
            (v, value)
        };
        let (v, value) = at(point);
        let gradient = v.grad(&value.backward()).unwrap().into_data();
        let gradient: Vec<f32> = gradient.try_into_vec().unwrap();
        for i in 0..6 {
            let moved = |step: f32| {
                let mut moved = point;
                moved[i] += step;
                at(moved).1.into_scalar::<f32>()
            };
            let numeric = (moved(1e-2) - moved(-1e-2)) / 2e-2;
            let ours = gradient[i];
            let tolerance = 2e-3 * (1.0 + ours.abs());
            assert!(
                (numeric - ours).abs() < tolerance,
                "{what}[{i}]: {ours} instead of {numeric}"
            );
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let device = Device::flex().autodiff();
        let point = [0.2, -0.1, 0.15, 0.4, -0.2, 1.1];
        let distance = || Tensor::<1>::from_data([0.7], &device);
        let measured = Motion::new(
            Tensor::<2>::from_data([[0.1, 0.0, -0.05]], &device),
            Tensor::<2>::from_data([[0.1, 0.3, 0.4]], &device),
        );
        // ‖t̂‖ is 1.19, not 0.7.
        check_gradient("speed", point, &|motion| {
            speed(motion, distance(), None, &measured.rotation, 0.3)
        });
        check_gradient("weighted speed", point, &|motion| {
            let weight = Tensor::<1>::from_data([0.4], &device);
            speed(motion, distance(), Some(weight), &measured.rotation, 0.3)
        });
        // Neither the same translation nor the same rotation.
        check_gradient("motion", point, &|predicted| {
            motion(predicted, &measured, None)
        });
        check_gradient("weighted motion", point, &|predicted| {
            let weight = Tensor::<1>::from_data([0.4], &device);
            motion(predicted, &measured, Some(weight))
        });
        // As used for warping: a weighted sum, so that every component has a gradient of its own.
        let weights = Tensor::<2>::from_data([[0.9, -1.3, 0.4]], &device);
        check_gradient("with_distance", point, &|motion| {
            let views = motion.with_distance(distance());
            let turned = views
                .rotation
                .reshape([3, 3])
                .matmul(weights.clone().swap_dims(0, 1));
            views.translation.mul(weights.clone()).sum() + turned.sum()
        });
    }

    #[test]
    fn the_weight_rises_over_at_most_a_tenth_of_the_run() {
        assert!((speed_weight(0.2, 0, 10_000, 100, 500) - 0.2 / 500.0).abs() < 1e-12);
        assert!((speed_weight(0.2, 9_999, 10_000, 100, 500) - 0.2).abs() < 1e-12);
        assert!((speed_weight(0.2, 49, 1000, 200, 500) - 0.1).abs() < 1e-12);
        assert!((speed_weight(0.2, 0, 5, 200, 500) - 0.2).abs() < 1e-12);
    }
}
