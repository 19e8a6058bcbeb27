//! Conversion of YUV to RGB.
//!
//! BT.601 in its limited range: brightness 16 to 235, differences 16 to 240 around 128, as in OpenCV's `COLOR_YUV2RGB_UYVY` and `_YUYV`,
//! which cv_bridge uses for `yuv422` and `yuv422_yuy2`. A camera that sends the full range gets a little too much contrast. The integer
//! arithmetic is OpenCV's, so that the results are the same to the last digit:
//!
//! R = 1.164 (Y − 16) + 1.596 V, G = 1.164 (Y − 16) − 0.813 V − 0.391 U, B = 1.164 (Y − 16) + 2.018 U, with U and V less 128

/// Fractional bits of the factors.
const SHIFT: u32 = 20;
const FROM_Y: i32 = 1_220_542;
const R_FROM_V: i32 = 1_673_527;
const G_FROM_V: i32 = -852_492;
const G_FROM_U: i32 = -409_993;
const B_FROM_U: i32 = 2_116_026;

/// Two pixels, which share their colour differences, as RGB.
pub(super) fn pair([y0, y1]: [u8; 2], u: u8, v: u8) -> [u8; 6] {
    let (u, v) = (i32::from(u) - 128, i32::from(v) - 128);
    let half = 1 << (SHIFT - 1);
    let colour = [R_FROM_V * v, G_FROM_V * v + G_FROM_U * u, B_FROM_U * u];
    let pixel = |y: u8| {
        let brightness = FROM_Y * (i32::from(y) - 16).max(0);
        colour.map(|part| ((brightness + part + half) >> SHIFT).clamp(0, 255) as u8)
    };
    let ([r0, g0, b0], [r1, g1, b1]) = (pixel(y0), pixel(y1));
    [r0, g0, b0, r1, g1, b1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limited_range_spans_black_to_white() {
        assert_eq!(pair([16, 235], 128, 128), [0, 0, 0, 255, 255, 255]);
        assert_eq!(pair([0, 255], 128, 128), [0, 0, 0, 255, 255, 255]);
    }

    /// The pure colours of BT.601: red is (81, 90, 240), blue (41, 240, 110).
    #[test]
    fn pure_colours_round_trip() {
        assert_eq!(pair([81, 81], 90, 240)[..3], [254, 0, 0]);
        assert_eq!(pair([41, 41], 240, 110)[..3], [0, 0, 255]);
    }
}
