//! Homographies from the board's plane to points at z = 1.

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

/// H with p' ~ H (x, y, 1)ᵀ by the direct linear transformation, both sides normalised first (Hartley and Zisserman, 4.4). `None` for fewer
/// than four pairs, or if the points are on a line.
pub(crate) fn homography(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let from = normaliser(pairs.iter().map(|p| p.0))?;
    let to = normaliser(pairs.iter().map(|p| p.1))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (a, b) in pairs {
        let a = from * a.push(1.0);
        let b = to * b.push(1.0);
        let mut add = |row: [f64; 9]| {
            let row = SMatrix::<f64, 9, 1>::from(row);
            normal += row * row.transpose();
        };
        let (x, y) = (a.x, a.y);
        add([x, y, 1.0, 0.0, 0.0, 0.0, -b.x * x, -b.x * y, -b.x]);
        add([0.0, 0.0, 0.0, x, y, 1.0, -b.y * x, -b.y * y, -b.y]);
    }
    let eigen = normal.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    // If another direction explains the pairs as well, the points are on a line.
    let mut values: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    if values[1] < 1e-10 * values[8] {
        return None;
    }
    let h = eigen.eigenvectors.column(least);
    let h = Matrix3::from_row_slice(h.as_slice());
    let h = to.try_inverse()? * h * from;
    h.iter().all(|n| n.is_finite()).then(|| h / h.norm())
}

/// Moves the mean to the origin and the mean distance to √2.
fn normaliser(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector2<f64>>() / n;
    let spread = points.map(|p| (p - mean).norm()).sum::<f64>() / n;
    let s = 2.0_f64.sqrt() / spread;
    s.is_finite()
        .then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

/// The board's pose cam_from_board from a homography to z = 1: rotation, and translation in the board's unit.
pub(crate) fn pose(h: &Matrix3<f64>) -> Option<(nalgebra::Rotation3<f64>, Vector3<f64>)> {
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    if !scale.is_finite() {
        return None;
    }
    // The board is in front of the camera.
    let scale = if h[(2, 2)] < 0.0 { -scale } else { scale };
    let (first, second) = (h.column(0) * scale, h.column(1) * scale);
    let third = first.cross(&second);
    let near = Matrix3::from_columns(&[first, second, third]);
    let svd = near.svd(true, true);
    let turn = svd.u? * svd.v_t?;
    if turn.determinant() < 0.0 {
        return None;
    }
    let turn = nalgebra::Rotation3::from_matrix_unchecked(turn);
    Some((turn, h.column(2) * scale))
}
