use burn::tensor::Tensor;

/// Rigid motions of a batch, named `a_from_b`: x_a = R·x_b + t.
#[derive(Debug, Clone)]
pub struct Motion {
    /// R, N×3×3.
    pub rotation: Tensor<3>,
    /// t, N×3, in metres.
    pub translation: Tensor<2>,
}

impl Motion {
    /// From axis-angle vectors (radians) and translations (metres), each N×3.
    #[must_use]
    pub fn new(axis_angle: Tensor<2>, translation: Tensor<2>) -> Self {
        Self {
            rotation: rotation_from_axis_angle(axis_angle),
            translation,
        }
    }

    /// `b_from_a`: (Rᵀ, −Rᵀ·t).
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.clone().swap_dims(1, 2);
        let [n, _] = self.translation.dims();
        let moved = rotation
            .clone()
            .matmul(self.translation.clone().reshape([n, 3, 1]))
            .reshape([n, 3]);
        Self {
            rotation,
            translation: moved.neg(),
        }
    }

    /// All motions of `parts`, one after the other along the batch.
    #[must_use]
    pub fn cat(parts: Vec<Self>) -> Self {
        let (rotations, translations) = parts
            .into_iter()
            .map(|m| (m.rotation, m.translation))
            .unzip();
        Self {
            rotation: Tensor::cat(rotations, 0),
            translation: Tensor::cat(translations, 0),
        }
    }

    /// Motions `first..first + count` of the batch.
    #[must_use]
    pub fn narrow(&self, first: usize, count: usize) -> Self {
        Self {
            rotation: self.rotation.clone().narrow(0, first, count),
            translation: self.translation.clone().narrow(0, first, count),
        }
    }

    /// The same rotations and directions with translations of these lengths (N, in metres).
    #[must_use]
    pub fn with_distance(&self, distance_m: Tensor<1>) -> Self {
        let [n, _] = self.translation.dims();
        let factor = distance_m.div(self.distance()).reshape([n, 1]);
        Self {
            rotation: self.rotation.clone(),
            translation: self.translation.clone().mul(factor),
        }
    }

    /// These motions where `chosen` (N, 1 or 0) is 1, the `other` ones where it is 0.
    #[must_use]
    pub fn or(&self, other: &Self, chosen: Tensor<1>) -> Self {
        let [n] = chosen.dims();
        let not_chosen = chosen.clone().neg().add_scalar(1.0);
        let (here, there) = (chosen.reshape([n, 1]), not_chosen.reshape([n, 1]));
        let part = |of: &Self, share: Tensor<2>| Self {
            rotation: of.rotation.clone().mul(share.clone().reshape([n, 1, 1])),
            translation: of.translation.clone().mul(share),
        };
        let (a, b) = (part(self, here), part(other, there));
        Self {
            rotation: a.rotation + b.rotation,
            translation: a.translation + b.translation,
        }
    }

    /// ‖t‖ as √(‖t‖² + 1e-8), N: its gradient at 0 is finite.
    #[must_use]
    pub fn distance(&self) -> Tensor<1> {
        let [n, _] = self.translation.dims();
        self.translation
            .clone()
            .powi_scalar(2)
            .sum_dim(1)
            .add_scalar(1e-8)
            .sqrt()
            .reshape([n])
    }
}

/// Rodrigues' formula, R = I + (sin θ/θ)·V + ((1 − cos θ)/θ²)·V², V the cross matrix of v, θ = √(‖v‖² + 1e-12).
///
/// # Shapes
/// - `axis_angle`: `[N, 3]`, radians
/// - output: `[N, 3, 3]`
#[must_use]
pub fn rotation_from_axis_angle(axis_angle: Tensor<2>) -> Tensor<3> {
    let [n, _] = axis_angle.dims();
    let device = axis_angle.device();
    let theta = axis_angle
        .clone()
        .powi_scalar(2)
        .sum_dim(1)
        .add_scalar(1e-12)
        .sqrt()
        .reshape([n, 1, 1]);
    let skew = cross_matrix(axis_angle);
    let a = theta.clone().sin().div(theta.clone());
    let b = theta
        .clone()
        .cos()
        .neg()
        .add_scalar(1.0)
        .div(theta.powi_scalar(2));
    let square = skew.clone().matmul(skew.clone());
    let identity = Tensor::<2>::eye(3, &device).reshape([1, 3, 3]);
    skew.mul(a).add(square.mul(b)).add(identity)
}

/// [v]×, the matrix that multiplies like the cross product with v.
///
/// # Shapes
/// - `v`: `[N, 3]`
/// - output: `[N, 3, 3]`
#[must_use]
pub(crate) fn cross_matrix(v: Tensor<2>) -> Tensor<3> {
    let [n, _] = v.dims();
    // It is linear in v: row i of this matrix is the cross matrix of unit vector i.
    let units: [[f32; 9]; 3] = [
        [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ];
    let units = Tensor::<2>::from_data(units, &v.device());
    v.matmul(units).reshape([n, 3, 3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;
    use deepfusion_geometry::Se3;
    use nalgebra::Vector3;

    fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
        tensor.into_data().try_into_vec().unwrap()
    }

    #[test]
    fn equals_the_plain_motion_and_its_inverse() {
        let device = Device::flex();
        let (v, t) = (Vector3::new(0.3, -0.2, 0.05), Vector3::new(0.1, 0.2, -0.9));
        let expected = Se3::from_axis_angle(v, t);
        let motion = Motion::new(
            Tensor::from_data([[0.3, -0.2, 0.05], [0.0, 0.0, 0.0]], &device),
            Tensor::from_data([[0.1, 0.2, -0.9], [1.0, 2.0, 3.0]], &device),
        );
        for (ours, expected) in [
            (motion.clone(), expected),
            (motion.inverse(), expected.inverse()),
        ] {
            let rotation = values(ours.rotation);
            let translation = values(ours.translation);
            for i in 0..3 {
                assert!((f64::from(translation[i]) - expected.translation()[i]).abs() < 1e-6);
                for j in 0..3 {
                    let r = f64::from(rotation[3 * i + j]);
                    assert!((r - expected.rotation()[(i, j)]).abs() < 1e-6);
                    let identity = if i == j { 1.0 } else { 0.0 };
                    assert!((f64::from(rotation[9 + 3 * i + j]) - identity).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn setting_the_distance_keeps_the_direction() {
        let device = Device::flex();
        let t = Tensor::<2>::from_data([[3.0, 0.0, -4.0], [0.0, 0.5, 0.0]], &device);
        let motion = Motion::new(Tensor::zeros([2, 3], &device), t);
        let distance = Tensor::<1>::from_data([1.0, 2.0], &device);
        let scaled = values(motion.with_distance(distance).translation);
        for (ours, expected) in scaled.iter().zip([0.6, 0.0, -0.8, 0.0, 2.0, 0.0]) {
            assert!((ours - expected).abs() < 1e-6, "{scaled:?}");
        }
    }

    /// At zero motion a plain norm has a kink; the other points are ordinary. Central differences in f32 with step 1e-2: the function is
    /// smooth, so the error of the step is below 1e-4 and that of rounding about 1e-5.
    #[test]
    fn gradients_equal_finite_differences() {
        let device = Device::flex().autodiff();
        let weights: Vec<f32> = (0..9).map(|i| (i as f32 * 1.7).sin()).collect();
        let loss = |v: [f32; 3], grad: bool| {
            let v = Tensor::<2>::from_data([v], &device).require_grad();
            let w = Tensor::<1>::from_data(weights.as_slice(), &device).reshape([1, 3, 3]);
            let motion = Motion::new(v.clone(), v.clone());
            let loss = motion.rotation.clone().mul(w).sum() + motion.distance().sum();
            let gradient = grad.then(|| values(v.grad(&loss.backward()).unwrap()));
            (loss.into_scalar::<f32>(), gradient)
        };
        for point in [[0.3, -0.2, 0.05], [1.2, 0.4, -0.7]] {
            let gradient = loss(point, true).1.unwrap();
            for i in 0..3 {
                let at = |step: f32| {
                    let mut moved = point;
                    moved[i] += step;
                    loss(moved, false).0
                };
                let numeric = (at(1e-2) - at(-1e-2)) / 2e-2;
                assert!(
                    (numeric - gradient[i]).abs() < 1e-3,
                    "{numeric} {}",
                    gradient[i]
                );
            }
        }
        let at_rest = loss([0.0; 3], true).1.unwrap();
        assert!(at_rest.iter().all(|g| g.is_finite()), "{at_rest:?}");
    }
}
