//! The settings of a camera: `size=1920x1080&fps=30&format=mjpeg`, as they follow the `?` after its name.

use crate::CameraModeProblem as Problem;

/// The settings requested from a camera; its driver chooses the others.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct CameraMode {
    /// Width and height of its images.
    pub(super) size: Option<(u32, u32)>,
    /// Frames per second, as they were written.
    fps: Option<String>,
    /// Format of its images, by ffmpeg's name.
    format: Option<String>,
}

/// Formats that are codecs, for which DirectShow has another option than for pixel formats.
const CODECS: [&str; 3] = ["mjpeg", "h264", "hevc"];
/// The highest frame rate that is requested from a camera, 1/s.
const FASTEST: f64 = 1000.0;

impl CameraMode {
    /// Parses the settings; each may be missing, and an empty text requests nothing.
    pub(super) fn parse(text: &str) -> Result<Self, Problem> {
        let mut mode = Self::default();
        for setting in text.split('&').filter(|setting| !setting.is_empty()) {
            let (key, value) = setting.split_once('=').unwrap_or((setting, ""));
            let again = match key {
                "size" => mode.size.replace(size_of(value)?).is_some(),
                "fps" => mode.fps.replace(rate_of(value)?).is_some(),
                "format" => mode.format.replace(format_of(value)?).is_some(),
                _ => return Err(Problem::Unknown(key.to_owned())),
            };
            if again {
                return Err(Problem::Again(key.to_owned()));
            }
        }
        Ok(mode)
    }

    /// ffmpeg's options for them, for a camera read through this input device of ffmpeg's.
    pub(super) fn options(&self, device: &str) -> Vec<String> {
        let mut options = Vec::new();
        let mut add = |name: &str, value: String| options.extend([name.to_owned(), value]);
        if let Some(format) = &self.format {
            let name = match device {
                "v4l2" => "-input_format",
                "dshow" if CODECS.contains(&format.as_str()) => "-vcodec",
                _ => "-pixel_format",
            };
            add(name, format.clone());
        }
        match &self.fps {
            Some(fps) => add("-framerate", fps.clone()),
            // The device's default of 29.97 frames per second is one that cameras do not have.
            None if device == "avfoundation" => add("-framerate", "30".to_owned()),
            None => {}
        }
        if let Some((width, height)) = self.size {
            add("-video_size", format!("{width}x{height}"));
        }
        options
    }
}

fn size_of(value: &str) -> Result<(u32, u32), Problem> {
    let sides = value.split_once('x');
    let sides = sides.and_then(|(width, height)| {
        Some((width.parse::<u32>().ok()?, height.parse::<u32>().ok()?))
    });
    sides
        .filter(|(width, height)| *width > 0 && *height > 0)
        .ok_or_else(|| Problem::Size(value.to_owned()))
}

fn rate_of(value: &str) -> Result<String, Problem> {
    let is_rate = |fps: f64| fps > 0.0 && fps <= FASTEST;
    if value.parse::<f64>().is_ok_and(is_rate) {
        Ok(value.to_owned())
    } else {
        Err(Problem::Rate(value.to_owned()))
    }
}

fn format_of(value: &str) -> Result<String, Problem> {
    let is_of_a_name = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
    if !value.is_empty() && value.chars().all(is_of_a_name) {
        Ok(value.to_owned())
    } else {
        Err(Problem::Format(value.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(text: &str, device: &str) -> String {
        CameraMode::parse(text).unwrap().options(device).join(" ")
    }

    #[test]
    fn each_device_has_its_own_options() {
        let all = "size=1920x1080&fps=29.97&format=mjpeg";
        let sizes = "-framerate 29.97 -video_size 1920x1080";
        assert_eq!(options(all, "v4l2"), format!("-input_format mjpeg {sizes}"));
        assert_eq!(options(all, "dshow"), format!("-vcodec mjpeg {sizes}"));
        assert_eq!(
            options("format=nv12", "avfoundation"),
            "-pixel_format nv12 -framerate 30"
        );
        assert_eq!(options("format=nv12", "dshow"), "-pixel_format nv12");
        assert_eq!(options("fps=5", "avfoundation"), "-framerate 5");
        assert_eq!(options("", "v4l2"), "");
    }

    #[test]
    fn invalid_settings_are_named() {
        let problem = |text: &str| CameraMode::parse(text).unwrap_err();
        assert_eq!(
            problem("size=1x1&rate=5"),
            Problem::Unknown("rate".to_owned())
        );
        assert_eq!(problem("fps=5&fps=6"), Problem::Again("fps".to_owned()));
        for size in ["", "1920", "0x5", "1920x", "-1x5", "1920x1080x3"] {
            let expected = Problem::Size(size.to_owned());
            assert_eq!(problem(&format!("size={size}")), expected);
        }
        for rate in ["", "0", "NaN", "inf", "-5", "fast", "1e9"] {
            let expected = Problem::Rate(rate.to_owned());
            assert_eq!(problem(&format!("fps={rate}")), expected);
        }
        for format in ["", "mjpeg -i x"] {
            let expected = Problem::Format(format.to_owned());
            assert_eq!(problem(&format!("format={format}")), expected);
        }
    }
}
