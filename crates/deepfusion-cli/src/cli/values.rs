//! Values of options that are more than a word or a number.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};
use deepfusion_eval::Scaling;
use deepfusion_geometry::HFOV_DEG;
pub(crate) use deepfusion_jobs::bulk::Shard;
use deepfusion_model::InputSize;

/// Width and height in pixels, written `640x192`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
}

/// As the size of a network's input.
impl From<Size> for InputSize {
    fn from(size: Size) -> Self {
        Self {
            width: size.width as usize,
            height: size.height as usize,
        }
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once(['x', 'X', '×']);
        let number = |s: &str| s.trim().parse::<u32>().ok().filter(|n| *n > 0);
        match parts.and_then(|(w, h)| number(w).zip(number(h))) {
            Some((width, height)) => Ok(Self { width, height }),
            None => Err("expected WIDTHxHEIGHT in pixels, such as 640x192".into()),
        }
    }
}

/// A checkerboard's inner corners, written `9x6`.
pub(super) fn board(text: &str) -> Result<Size, String> {
    text.parse::<Size>()
        .map_err(|_| "expected inner corners as WIDTHxHEIGHT, such as 9x6".into())
}

/// A camera's numbers as given on the command line, in pixels of the input image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraIntrinsics {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
}

impl CameraIntrinsics {
    /// fx, fy, cx, cy.
    pub(crate) fn numbers(self) -> [f64; 4] {
        [self.fx, self.fy, self.cx, self.cy]
    }
}

impl FromStr for CameraIntrinsics {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|s| s.trim().parse().ok())
            .collect();
        match numbers[..] {
            [fx, fy, cx, cy]
                if text.split(',').count() == 4
                    && fx > 0.0
                    && fy > 0.0
                    && numbers.iter().all(|n| n.is_finite()) =>
            {
                Ok(Self { fx, fy, cx, cy })
            }
            _ => Err("expected fx,fy,cx,cy in pixels, such as 721.5,721.5,609.6,172.9".into()),
        }
    }
}

/// The request to learn the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LearnCamera;

/// Parses `learn`, the only value that training takes for a camera.
pub(super) fn learn_camera(text: &str) -> Result<LearnCamera, String> {
    if text == "learn" {
        return Ok(LearnCamera);
    }
    Err("expected learn; a camera that is known is given beside its recording, in calibration.yaml or dataset.toml \
         (intrinsics = [fx, fy, cx, cy] or hfov_deg)"
        .into())
}

/// `none`, `median` or `fixed=F`.
pub(super) fn scaling(text: &str) -> Result<Scaling, String> {
    match text {
        "none" => Ok(Scaling::None),
        "median" => Ok(Scaling::Median),
        _ => text
            .strip_prefix("fixed=")
            .and_then(|factor| factor.parse().ok())
            .filter(|factor: &f64| factor.is_finite() && *factor > 0.0)
            .map(Scaling::Fixed)
            .ok_or_else(|| {
                "expected none, median or fixed=F with F above 0, such as fixed=5.4".into()
            }),
    }
}

/// How far the camera's clock is ahead of the vehicle's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ClockOffset {
    /// Given, in seconds.
    Seconds(f64),
    /// Measured when the recordings are opened.
    Auto,
}

impl FromStr for ClockOffset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            _ => text
                .parse()
                .ok()
                .filter(|ms: &f64| ms.is_finite())
                .map(|ms| Self::Seconds(1e-3 * ms))
                .ok_or_else(|| "expected milliseconds, such as -60, or auto".into()),
        }
    }
}

/// A field of view from left to right, in degrees.
pub(super) fn hfov(text: &str) -> Result<f64, String> {
    let (least, most) = HFOV_DEG;
    text.parse()
        .ok()
        .filter(|degrees: &f64| *degrees > least && *degrees < most)
        .ok_or_else(|| {
            format!("expected degrees above {least} and below {most}, such as 69; a wider lens needs a calibration file")
        })
}

/// A file to be written, whose name has the ending of its format: with another one it would be taken for something else.
pub(super) fn file_ending_in(ending: &'static str) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path| {
        let own = path.extension().unwrap_or_default();
        if own.eq_ignore_ascii_case(ending) {
            Ok(path)
        } else {
            Err(format!("expected a name that ends in .{ending}"))
        }
    })
}

/// A number from 0 to 1.
pub(super) fn share(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|n: &f64| (0.0..=1.0).contains(n))
        .ok_or_else(|| "expected a number from 0 to 1".into())
}

/// A number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|n: &f64| n.is_finite() && *n > 0.0)
        .ok_or_else(|| "expected a number above 0".into())
}

/// A number of 0 or more.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|n: &f64| n.is_finite() && *n >= 0.0)
        .ok_or_else(|| "expected 0 or a number above it".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(
            "640x192".parse(),
            Ok(Size {
                width: 640,
                height: 192
            })
        );
        for bad in ["640", "640x", "0x5", "axb", "640x192x3", "-1x5"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
    }

    #[test]
    fn boards() {
        let corners = Size {
            width: 9,
            height: 6,
        };
        assert_eq!(board("9x6"), Ok(corners));
        assert!(board("9").unwrap_err().contains("such as 9x6"));
    }

    #[test]
    fn intrinsics() {
        assert!(
            "721.5,721.5,609.6,172.9"
                .parse::<CameraIntrinsics>()
                .is_ok()
        );
        for bad in [
            "1,2,3",
            "1,2,3,4,5",
            "1,2,x,4,5",
            "0,1,2,3",
            "1,2,x,4",
            "nan,1,2,3",
        ] {
            assert!(bad.parse::<CameraIntrinsics>().is_err(), "{bad}");
        }
    }

    #[test]
    fn fields_of_view() {
        assert_eq!(hfov("69.5"), Ok(69.5));
        for bad in ["0", "0.01", "-60", "170", "nan", "69deg", ""] {
            assert!(hfov(bad).unwrap_err().contains("below 170"), "{bad}");
        }
    }

    #[test]
    fn offsets_of_clocks() {
        assert_eq!("-60".parse(), Ok(ClockOffset::Seconds(-0.06)));
        assert_eq!("auto".parse(), Ok(ClockOffset::Auto));
        for bad in ["", "60ms", "nan", "inf"] {
            assert!(bad.parse::<ClockOffset>().is_err(), "{bad}");
        }
    }

    #[test]
    fn scalings() {
        assert_eq!(scaling("fixed=5.4"), Ok(Scaling::Fixed(5.4)));
        assert_eq!(scaling("median"), Ok(Scaling::Median));
        for bad in [
            "fixed",
            "fixed=",
            "fixed=0",
            "fixed=-1",
            "fixed=nan",
            "medium",
        ] {
            assert!(scaling(bad).is_err(), "{bad}");
        }
    }
}
