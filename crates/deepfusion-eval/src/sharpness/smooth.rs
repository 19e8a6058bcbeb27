/// Radius of the kernel in standard deviations, as in SciPy's and scikit-image's Gaussian filters.
const REACH: f64 = 4.0;

/// Gaussian smoothing of H×W values that uses only known pixels: Σ g·v / Σ g over the known pixels within the kernel (normalised
/// convolution), so that neither holes nor the image's border bias a value. 0 if none is within the kernel.
pub(super) fn gaussian(
    values: &[f64],
    known: &[bool],
    (width, height): (usize, usize),
    sigma: f64,
) -> Vec<f64> {
    let kernel = kernel(sigma);
    let masked: Vec<f64> = (values.iter().zip(known))
        .map(|(v, k)| if *k { *v } else { 0.0 })
        .collect();
    let weight: Vec<f64> = known.iter().map(|k| f64::from(u8::from(*k))).collect();
    let both = |of: &[f64]| {
        let across = convolve(of, (width, height), &kernel, true);
        convolve(&across, (width, height), &kernel, false)
    };
    let divide = |(sum, weight): (f64, f64)| if weight > 0.0 { sum / weight } else { 0.0 };
    both(&masked)
        .into_iter()
        .zip(both(&weight))
        .map(divide)
        .collect()
}

/// exp(−x² / 2σ²) for x = 0, 1, … up to the radius, normalised so that both sides together sum to 1.
fn kernel(sigma: f64) -> Vec<f64> {
    let radius = (REACH * sigma + 0.5) as usize;
    let mut half: Vec<f64> = (0..=radius)
        .map(|x| (-0.5 * (x as f64 / sigma).powi(2)).exp())
        .collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter_mut().for_each(|w| *w /= sum);
    half
}

/// Convolution with a symmetric kernel along rows or columns; 0 beyond the border.
fn convolve(
    values: &[f64],
    (width, height): (usize, usize),
    half: &[f64],
    across: bool,
) -> Vec<f64> {
    let (length, step) = if across { (width, 1) } else { (height, width) };
    let mut out = vec![0.0; values.len()];
    for (i, out) in out.iter_mut().enumerate() {
        let at = if across { i % width } else { i / width };
        let mut sum = half[0] * values[i];
        for (offset, weight) in half.iter().enumerate().skip(1) {
            if offset <= at {
                sum += weight * values[i - offset * step];
            }
            if at + offset < length {
                sum += weight * values[i + offset * step];
            }
        }
        *out = sum;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_map_stays_constant_beside_holes_and_borders() {
        let known: Vec<bool> = (0..63).map(|i| i % 9 != 4).collect();
        let values: Vec<f64> = known.iter().map(|k| if *k { 7.0 } else { 1e9 }).collect();
        for v in gaussian(&values, &known, (9, 7), 1.4) {
            assert!((v - 7.0).abs() < 1e-12, "{v}");
        }
        assert_eq!(gaussian(&[3.0], &[false], (1, 1), 1.4), [0.0]);
    }
}
