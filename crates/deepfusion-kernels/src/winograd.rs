//! The transforms of Winograd's F(4×4, 3×3), for training's convolutions here and for an inference engine: Y = Aᵀ [ (G g Gᵀ) ⊙ (Bᵀ d B) ] A
//! for a tile of 6×6 inputs d, kernel g and 4×4 outputs Y, at the points 0, 1, −1, 2, −2, ∞ (Lavin and Gray, "Fast Algorithms for
//! Convolutional Neural Networks", 2016).

use pulp::Simd;

/// Outputs of a tile along one side.
pub const OUT: usize = 4;
/// Inputs of a tile along one side.
pub const IN: usize = 6;
/// Products of a tile.
pub const AREA: usize = IN * IN;

/// Bᵀ d along one axis of a tile.
#[inline(always)]
pub fn input_axis<S: Simd>(simd: S, d: [S::f32s; IN]) -> [S::f32s; IN] {
    let by = |factor: f32| simd.splat_f32s(factor);
    let (two, four, five) = (by(2.0), by(4.0), by(5.0));
    let madd = |a, b, c| simd.mul_add_f32s(a, b, c);
    let sub = |a, b| simd.sub_f32s(a, b);
    // d4 − 4 d2 and d3 − 4 d1, d4 − d2 and 2 (d3 − d1).
    let even = sub(d[4], simd.mul_f32s(four, d[2]));
    let odd = sub(d[3], simd.mul_f32s(four, d[1]));
    let far_even = sub(d[4], d[2]);
    let far_odd = simd.mul_f32s(two, sub(d[3], d[1]));
    [
        sub(madd(four, d[0], d[4]), simd.mul_f32s(five, d[2])),
        simd.add_f32s(even, odd),
        sub(even, odd),
        simd.add_f32s(far_even, far_odd),
        sub(far_even, far_odd),
        sub(madd(four, d[1], d[5]), simd.mul_f32s(five, d[3])),
    ]
}

/// Aᵀ m along one axis of a tile's products.
#[inline(always)]
pub fn output_axis<S: Simd>(simd: S, m: [S::f32s; IN]) -> [S::f32s; OUT] {
    let by = |factor: f32| simd.splat_f32s(factor);
    let (near, near_odd) = (simd.add_f32s(m[1], m[2]), simd.sub_f32s(m[1], m[2]));
    let (far, far_odd) = (simd.add_f32s(m[3], m[4]), simd.sub_f32s(m[3], m[4]));
    let madd = |a, b, c| simd.mul_add_f32s(a, b, c);
    [
        simd.add_f32s(simd.add_f32s(m[0], near), far),
        madd(by(2.0), far_odd, near_odd),
        madd(by(4.0), far, near),
        simd.add_f32s(madd(by(8.0), far_odd, near_odd), m[5]),
    ]
}
