//! Whether the intrinsics are plausible for a camera on a car, and fit the images' size.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::{CameraReason, CentreCoordinate};
use deepfusion_geometry::Intrinsics;

/// Fields of view of cameras on cars, degrees. KITTI's is 81, UMAD's 49, the simulator's 81.
const VIEW_DEG: Limit = Limit::Within(20.0, 140.0);
/// Distance of the principal point from the centre, percent of the image's size. KITTI's is 3.9, UMAD's printed row 25.
const MOST_OFF: f64 = 12.0;
/// f_x / f_y of square pixels is 1; of images resized with another aspect ratio it is not. UMAD's is 0.97, and
/// 640×192 of KITTI's 1.01.
const RATIO: Limit = Limit::Within(0.8, 1.25);
/// Usual image sizes of cameras and data sets.
const SIZES: [(u32, u32); 25] = [
    (320, 240),
    (416, 128),
    (512, 256),
    (640, 192),
    (640, 360),
    (640, 480),
    (800, 600),
    (1024, 320),
    (1024, 768),
    (1164, 874),
    (1224, 370),
    (1226, 370),
    (1238, 374),
    (1242, 375),
    (1280, 384),
    (1280, 720),
    (1280, 800),
    (1280, 960),
    (1600, 900),
    (1920, 1080),
    (1920, 1200),
    (1936, 1216),
    (2048, 1024),
    (2448, 2048),
    (3840, 2160),
];
/// How near twice the principal point has to be to a size, as a share of it.
const NEAR: f64 = 0.06;

pub(super) fn check(k: &Intrinsics) -> Outcome {
    let mut outcome = Outcome::new("intrinsics");
    let (width, height) = (f64::from(k.width), f64::from(k.height));
    let view = 2.0 * (0.5 * width / k.fx).atan().to_degrees();
    outcome.judge(
        Severity::Error,
        Figure::new("field of view", view, "degrees", VIEW_DEG),
        || CameraReason::View {
            fx: k.fx,
            view_deg: view,
            width: k.width,
        },
    );
    let ratio = k.fx / k.fy;
    outcome.judge(
        Severity::Warning,
        Figure::new("fx / fy", ratio, "", RATIO),
        || CameraReason::PixelShape { fx: k.fx, fy: k.fy },
    );
    let off = |c: f64, size: f64| 100.0 * (c - 0.5 * (size - 1.0)) / size;
    let (off_x, off_y) = (off(k.cx, width), off(k.cy, height));
    let other = other_size(k);
    let limit = Limit::Within(-MOST_OFF, MOST_OFF);
    // Far to the right or below in both: intrinsics of another image size, so the focal length is wrong as well.
    let severity = match other {
        Some(_) => Severity::Error,
        None => Severity::Warning,
    };
    let (cx, cy) = (CentreCoordinate::Cx, CentreCoordinate::Cy);
    let both = [
        ("cx from the middle", cx, k.cx, off_x, k.width),
        ("cy from the middle", cy, k.cy, off_y, k.height),
    ];
    for (quantity, coordinate, value, off, size) in both {
        let figure = Figure::new(quantity, off, "% of the size", limit);
        outcome.judge(severity, figure, || match other {
            Some((w, h)) => CameraReason::OtherSize {
                coordinate,
                value,
                size,
                other: [w, h],
                image: [k.width, k.height],
            },
            None => CameraReason::OffCentre {
                coordinate,
                value,
                size,
            },
        });
    }
    outcome
}

/// The image size that a principal point off the centre in both axes fits, if any: a usual size, or
/// this one times a factor.
fn other_size(k: &Intrinsics) -> Option<(u32, u32)> {
    let (w, h) = (2.0 * k.cx + 1.0, 2.0 * k.cy + 1.0);
    let (rx, ry) = (w / f64::from(k.width), h / f64::from(k.height));
    let same = |r: f64| (r - 1.0).abs() < 2.0 * MOST_OFF / 100.0;
    if same(rx) || same(ry) || rx <= 0.0 || ry <= 0.0 {
        return None;
    }
    let miss = |(a, b): &(u32, u32)| {
        let off = |a: f64, b: f64| (a / b - 1.0).abs();
        // The row of the principal point lies less exactly in the centre.
        off(w, f64::from(*a)).max(0.6 * off(h, f64::from(*b)))
    };
    let usual = SIZES.iter().min_by(|a, b| miss(a).total_cmp(&miss(b)));
    let scaled = ((rx / ry - 1.0).abs() < 2.0 * NEAR).then(|| (w.round() as u32, h.round() as u32));
    usual.copied().filter(|size| miss(size) < NEAR).or(scaled)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KITTI: Intrinsics = Intrinsics {
        fx: 721.5377,
        fy: 721.5377,
        cx: 609.5593,
        cy: 172.854,
        width: 1242,
        height: 375,
    };

    #[test]
    fn kitti_s_camera_passes_at_any_size() {
        for (w, h) in [(1242, 375), (640, 192), (320, 96), (416, 128)] {
            assert_eq!(check(&KITTI.resized(w, h)).findings, []);
        }
    }

    #[test]
    fn the_intrinsics_printed_for_umad_are_flagged() {
        let umad = Intrinsics {
            fx: 703.64,
            fy: 724.82,
            cx: 322.55,
            cy: 117.6,
            width: 640,
            height: 480,
        };
        let outcome = check(&umad);
        let [finding] = &outcome.findings[..] else {
            panic!("{outcome:?}")
        };
        assert_eq!(finding.severity, Severity::Warning);
        let off = finding.figure.as_ref().unwrap().value;
        assert!((off + 25.4).abs() < 0.1, "{off}");
        let what = finding.what.to_string();
        assert!(what.contains("cy 117.6"), "{what}");
    }

    #[test]
    fn intrinsics_of_another_image_size_are_named() {
        let wrong = Intrinsics {
            width: 640,
            height: 192,
            ..KITTI
        };
        let finding = &check(&wrong).findings[0];
        assert_eq!(finding.severity, Severity::Error);
        let what = finding.what.to_string();
        assert!(
            what.contains("about 1242x375")
                || what.contains("about 1226x370")
                || what.contains("about 1224x370"),
            "{what}"
        );
        assert!(
            finding.hint.contains("0.52") || finding.hint.contains("0.515"),
            "{}",
            finding.hint
        );
        // Half of everything is not a usual size; the factor is still found.
        let half = Intrinsics {
            width: 640,
            height: 192,
            ..KITTI.resized(300, 90)
        };
        assert!(
            check(&half).findings[0]
                .what
                .to_string()
                .contains("about 29"),
            "{:?}",
            check(&half).findings
        );
    }

    #[test]
    fn impossible_focal_lengths_are_errors() {
        for fx in [7.2, 40_000.0, f64::NAN] {
            let worst = check(&Intrinsics { fx, ..KITTI }).findings;
            assert!(worst.iter().any(|f| f.severity == Severity::Error), "{fx}");
        }
    }
}
