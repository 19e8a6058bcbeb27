//! Refines all parameters together: the Levenberg–Marquardt method over the camera and every board's pose.

use crate::model::{Camera, MOST};
use nalgebra::{DMatrix, DVector, Matrix6, Rotation3, SMatrix, Vector2, Vector3, Vector6};

/// Greatest number of steps; about ten are usual.
const MAX_STEPS: usize = 200;
/// A step that reduces the cost by less than this share is the last.
const SMALL: f64 = 1e-13;
/// Greatest damping: beyond it no step changes anything.
const MOST_DAMPING: f64 = 1e12;

/// A board's pose cam_from_board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    pub(crate) turn: Rotation3<f64>,
    /// Translation, in the board's unit.
    pub(crate) shift: Vector3<f64>,
}

/// A camera and the poses of the boards.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fit {
    pub(crate) camera: Camera,
    pub(crate) poses: Vec<Pose>,
}

/// A view's part of the normal equations: coupling of camera and pose, the pose's own part, and the pose's right side.
struct Block {
    mixed: SMatrix<f64, MOST, 6>,
    pose: Matrix6<f64>,
    right: Vector6<f64>,
}

/// The normal equations JᵀJ δ = −Jᵀr; the poses are not coupled with each other.
struct Normal {
    camera: DMatrix<f64>,
    right: DVector<f64>,
    blocks: Vec<Block>,
}

impl Fit {
    /// Sum of squared errors in px²; `None` if a corner is behind the camera.
    pub(crate) fn cost(&self, views: &[&[Vector2<f64>]], board: &[Vector3<f64>]) -> Option<f64> {
        let costs = views.iter().zip(&self.poses);
        let cost = costs.map(|(view, pose)| self.cost_of(view, pose, board));
        cost.sum()
    }

    /// Sum of squared errors of a view in px².
    pub(crate) fn cost_of(
        &self,
        view: &[Vector2<f64>],
        pose: &Pose,
        board: &[Vector3<f64>],
    ) -> Option<f64> {
        let errors = board.iter().zip(view).map(|(p, seen)| {
            let point = pose.turn * p + pose.shift;
            let pixel = self.camera.project(&point)?.pixel;
            Some((pixel - seen).norm_squared()).filter(|e| e.is_finite())
        });
        errors.sum()
    }

    /// The least-squares fit reached from this one, and its cost in px²; `None` if none is reached.
    pub(crate) fn refined(
        mut self,
        views: &[&[Vector2<f64>]],
        board: &[Vector3<f64>],
        most_steps: Option<usize>,
    ) -> Option<(Self, f64)> {
        let mut cost = self.cost(views, board)?;
        let mut damping = 1e-3;
        for _ in 0..most_steps.unwrap_or(MAX_STEPS) {
            let normal = self.normal(views, board)?;
            let before = cost;
            // Increase the damping until a step reduces the cost.
            while damping < MOST_DAMPING {
                let tried = normal
                    .solved(damping)
                    .map(|(camera, poses)| self.moved(&camera, &poses));
                let better = tried.and_then(|fit| {
                    let new = fit.cost(views, board)?;
                    (new <= cost).then_some((fit, new))
                });
                if let Some((fit, new)) = better {
                    (self, cost) = (fit, new);
                    damping = (damping / 10.0).max(1e-15);
                    break;
                }
                damping *= 10.0;
            }
            if before - cost <= SMALL * before || damping >= MOST_DAMPING {
                break;
            }
        }
        Some((self, cost))
    }

    /// (JᵀJ)⁻¹ of the camera's parameters, with free poses; `None` if the views do not determine them.
    pub(crate) fn camera_covariance(
        &self,
        views: &[&[Vector2<f64>]],
        board: &[Vector3<f64>],
    ) -> Option<DMatrix<f64>> {
        let (reduced, _) = self.normal(views, board)?.reduced(0.0)?;
        // Scaled to a unit diagonal, so that pixels and coefficients of r⁶ are comparable.
        let scales = reduced.diagonal().map(|d| 1.0 / d.sqrt());
        let scaled = DMatrix::from_fn(reduced.nrows(), reduced.ncols(), |i, j| {
            reduced[(i, j)] * scales[i] * scales[j]
        });
        if !scaled.iter().all(|n| n.is_finite()) {
            return None;
        }
        let eigen = scaled.clone().symmetric_eigenvalues();
        if eigen.min() < 1e-12 * eigen.max() {
            return None;
        }
        let inverse = scaled.cholesky()?.inverse();
        Some(DMatrix::from_fn(
            inverse.nrows(),
            inverse.ncols(),
            |i, j| inverse[(i, j)] * scales[i] * scales[j],
        ))
    }

    fn normal(&self, views: &[&[Vector2<f64>]], board: &[Vector3<f64>]) -> Option<Normal> {
        let n = self.camera.model.numbers();
        let mut camera = SMatrix::<f64, MOST, MOST>::zeros();
        let mut right = SMatrix::<f64, MOST, 1>::zeros();
        let mut blocks = Vec::with_capacity(views.len());
        for (view, pose) in views.iter().zip(&self.poses) {
            let mut block = Block {
                mixed: SMatrix::zeros(),
                pose: Matrix6::zeros(),
                right: Vector6::zeros(),
            };
            for (p, seen) in board.iter().zip(view.iter()) {
                let turned = pose.turn * p;
                let at = self.camera.project(&(turned + pose.shift))?;
                let error = at.pixel - seen;
                let by_pose = by_pose(&at.by_point, &turned);
                camera += at.by_camera.transpose() * at.by_camera;
                right -= at.by_camera.transpose() * error;
                block.mixed += at.by_camera.transpose() * by_pose;
                block.pose += by_pose.transpose() * by_pose;
                block.right -= by_pose.transpose() * error;
            }
            blocks.push(block);
        }
        Some(Normal {
            camera: DMatrix::from_fn(n, n, |i, j| camera[(i, j)]),
            right: DVector::from_fn(n, |i, _| right[i]),
            blocks,
        })
    }

    fn moved(&self, camera: &DVector<f64>, poses: &[Vector6<f64>]) -> Self {
        let mut fit = self.clone();
        for (number, step) in fit.camera.numbers.iter_mut().zip(camera.iter()) {
            *number += step;
        }
        for (pose, step) in fit.poses.iter_mut().zip(poses) {
            let [a, b, c, x, y, z] = step.data.0[0];
            pose.turn = Rotation3::new(Vector3::new(a, b, c)) * pose.turn;
            pose.turn.renormalize();
            pose.shift += Vector3::new(x, y, z);
        }
        fit
    }
}

/// ∂ pixel / ∂ (ω, t) of exp(ω) R p + t at ω = 0: ∂/∂ω = −[R p]ₓ, ∂/∂t = 1.
fn by_pose(by_point: &nalgebra::Matrix2x3<f64>, turned: &Vector3<f64>) -> SMatrix<f64, 2, 6> {
    let by_turn = -by_point * turned.cross_matrix();
    let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
    by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_turn);
    by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(by_point);
    by_pose
}

impl Normal {
    /// The equations of the camera's parameters alone: the poses are eliminated (Schur complement), with damping on the diagonals.
    fn reduced(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let n = self.camera.nrows();
        let mut matrix = self.camera.clone();
        for i in 0..n {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut right = self.right.clone();
        for block in &self.blocks {
            let inverse = block.damped(damping).try_inverse()?;
            let through = block.mixed * inverse;
            let less = through * block.mixed.transpose();
            let shift = through * block.right;
            matrix -= less.view((0, 0), (n, n));
            right -= shift.rows(0, n);
        }
        Some((matrix, right))
    }

    fn solved(&self, damping: f64) -> Option<(DVector<f64>, Vec<Vector6<f64>>)> {
        let (matrix, right) = self.reduced(damping)?;
        let camera = matrix.cholesky()?.solve(&right);
        let mut all = SMatrix::<f64, MOST, 1>::zeros();
        all.rows_mut(0, camera.len()).copy_from(&camera);
        let poses: Option<Vec<_>> = self
            .blocks
            .iter()
            .map(|block| {
                let rest = block.right - block.mixed.transpose() * all;
                Some(block.damped(damping).try_inverse()? * rest)
            })
            .collect();
        Some((camera, poses?))
    }
}

impl Block {
    fn damped(&self, damping: f64) -> Matrix6<f64> {
        let mut pose = self.pose;
        for i in 0..6 {
            pose[(i, i)] *= 1.0 + damping;
        }
        pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::LensModel;

    /// The derivatives by a pose, compared with central differences.
    #[test]
    fn pose_derivatives_match_finite_differences() {
        let mut camera =
            Camera::without_distortion(LensModel::BrownConrady, [400.0, 390.0, 320.0, 240.0]);
        camera.numbers[4..].copy_from_slice(&[-0.2, 0.1, 0.001, -0.002, 0.01]);
        let pose = Pose {
            turn: Rotation3::from_euler_angles(0.3, -0.4, 0.1),
            shift: Vector3::new(0.05, -0.1, 0.6),
        };
        let fit = Fit {
            camera,
            poses: vec![pose],
        };
        let p = Vector3::new(0.12, 0.07, 0.0);
        let turned = pose.turn * p;
        let at = camera.project(&(turned + pose.shift)).unwrap();
        let slopes = by_pose(&at.by_point, &turned);
        let h = 1e-6;
        for i in 0..6 {
            let moved = |by: f64| {
                let mut step = Vector6::zeros();
                step[i] = by;
                let moved = fit.moved(&DVector::zeros(9), &[step]).poses[0];
                camera
                    .project(&(moved.turn * p + moved.shift))
                    .unwrap()
                    .pixel
            };
            let measured = (moved(h) - moved(-h)) / (2.0 * h);
            assert!(
                (measured - slopes.column(i)).norm() < 1e-5,
                "{i} {measured}"
            );
        }
    }
}
