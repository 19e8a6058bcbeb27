//! The address of a live source, and how it is passed to ffmpeg.

use super::camera_mode::CameraMode;
use crate::{Error, LiveProblem, Result, SourceKind};
use std::fmt;
use std::path::PathBuf;

/// A camera, the address of a stream, or standard input. Displayed without its password.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    text: String,
    kind: SourceKind,
    /// Width and height requested from a camera if its text requests none.
    size: Option<(u32, u32)>,
}

/// Prefix of a camera's number or name.
const CAMERA: &str = "camera:";

impl Address {
    /// `camera:0`, `/dev/video0`, `-`, or anything with a scheme (`rtsp://…`); `None` is for files. Settings may follow a camera's name, any
    /// part of `?size=1920x1080&fps=30&format=mjpeg`; [`Self::check`] tests whether they are understood.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let kind = if text == "-" {
            SourceKind::Stdin
        } else if text.starts_with(CAMERA) || text.starts_with("/dev/video") {
            SourceKind::Camera
        } else if scheme(text).is_some() {
            SourceKind::Stream
        } else {
            return None;
        };
        let text = text.to_owned();
        Some(Self {
            text,
            kind,
            size: None,
        })
    }

    /// The same address, with images of this width and height requested from a camera, unless its text requests others already.
    #[must_use]
    pub fn or_of_size(self, size: (u32, u32)) -> Self {
        let size = Some(size);
        Self { size, ..self }
    }

    /// Checks, before the source is opened, that a camera is named and its settings are understood.
    ///
    /// # Errors
    /// [`Error::NoCameraName`], [`Error::CameraMode`].
    pub fn check(&self) -> Result<()> {
        if self.is_camera() {
            self.camera()?;
        }
        Ok(())
    }

    /// A camera's number or name, and its settings.
    fn camera(&self) -> Result<(&str, CameraMode)> {
        let name = self.text.strip_prefix(CAMERA).unwrap_or(&self.text);
        let (name, asked) = name.split_once('?').unwrap_or((name, ""));
        if name.is_empty() {
            let address = self.to_string();
            return Err(Error::NoCameraName { address });
        }
        let mut mode = CameraMode::parse(asked).map_err(|problem| Error::CameraMode {
            address: self.to_string(),
            problem,
        })?;
        mode.size = mode.size.or(self.size);
        Ok((name, mode))
    }

    /// Whether it is standard input.
    #[must_use]
    pub fn is_stdin(&self) -> bool {
        self.kind == SourceKind::Stdin
    }

    /// Whether it is a camera of this machine.
    #[must_use]
    pub fn is_camera(&self) -> bool {
        self.kind == SourceKind::Camera
    }

    pub(super) fn kind(&self) -> SourceKind {
        self.kind
    }

    /// Whether its end may be intended: that of a camera, local or over the network, is not.
    pub(super) fn may_end(&self) -> bool {
        self.kind != SourceKind::Camera && !self.is_rtsp()
    }

    fn is_rtsp(&self) -> bool {
        scheme(&self.text).is_some_and(|s| s.to_ascii_lowercase().starts_with("rtsp"))
    }

    /// The same text with the address's password, if it contains that, replaced.
    pub(super) fn without_password(&self, text: &str) -> String {
        match self.credentials() {
            Some(secret) => text.replace(secret, "***"),
            None => text.to_owned(),
        }
    }

    /// Name and password, between `://` and the host's `@`.
    fn credentials(&self) -> Option<&str> {
        let rest = &self.text[scheme(&self.text)?.len() + 3..];
        let host = rest.split(['/', '?', '#']).next()?;
        let (secret, _) = host.rsplit_once('@')?;
        (!secret.is_empty()).then_some(secret)
    }

    /// ffmpeg's arguments up to and including `-i`, on this system (as [`std::env::consts::OS`] names it).
    ///
    /// # Errors
    /// [`Error::Program`] if a camera is not named as this system does; as [`Self::check`].
    pub(super) fn input(&self, system: &str) -> Result<Vec<String>> {
        let words = |words: &[&str]| -> Vec<String> {
            words.iter().map(|word| (*word).to_owned()).collect()
        };
        Ok(match self.kind {
            SourceKind::Stdin => words(&["-i", "pipe:0"]),
            // Over UDP, pictures are torn if the network loses a packet.
            SourceKind::Stream if self.is_rtsp() => {
                words(&["-rtsp_transport", "tcp", "-i", &self.text])
            }
            SourceKind::Stream => words(&["-i", &self.text]),
            SourceKind::Camera => {
                let (name, mode) = self.camera()?;
                let number = name.parse::<u32>().is_ok();
                let (device, input) = match system {
                    "linux" if number => ("v4l2", format!("/dev/video{name}")),
                    "linux" => ("v4l2", name.to_owned()),
                    "macos" => ("avfoundation", format!("{name}:none")),
                    "windows" if !number => ("dshow", format!("video={name}")),
                    "windows" => return Err(self.error(LiveProblem::CameraNumber)),
                    _ => return Err(self.error(LiveProblem::NoCameras)),
                };
                let mut arguments = words(&["-f", device]);
                arguments.extend(mode.options(device));
                arguments.extend(words(&["-i", &input]));
                arguments
            }
        })
    }

    /// An error of ffmpeg about this source.
    pub(super) fn error(&self, problem: LiveProblem) -> Error {
        Error::Program {
            path: PathBuf::from(self.to_string()),
            program: "ffmpeg",
            problem: problem.into(),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.kind {
            SourceKind::Stdin => f.write_str("standard input"),
            _ => f.write_str(&self.without_password(&self.text)),
        }
    }
}

/// The text before `://`, if that is a scheme.
fn scheme(text: &str) -> Option<&str> {
    let (scheme, rest) = text.split_once("://")?;
    let word = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    (word && !rest.is_empty()).then_some(scheme)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    fn input(text: &str, system: &str) -> String {
        Address::parse(text)
            .unwrap()
            .input(system)
            .unwrap()
            .join(" ")
    }

    #[test]
    fn addresses_are_distinguished_from_files() {
        for live in [
            "-",
            "camera:0",
            "camera:Integrated Webcam",
            "/dev/video2",
            "rtsp://host/1",
            "udp://@:5000",
            "http://host:80/a.mjpg?x=[1]",
        ] {
            assert!(Address::parse(live).is_some(), "{live}");
        }
        for file in [
            "a.png",
            "drive/*.png",
            "C:\\a.mp4",
            "camera",
            "://x",
            "a b://c",
            "--",
            "rtsp://",
        ] {
            assert!(Address::parse(file).is_none(), "{file}");
        }
    }

    #[test]
    fn each_system_names_its_cameras() {
        assert_eq!(input("camera:1", "linux"), "-f v4l2 -i /dev/video1");
        assert_eq!(input("/dev/video1", "linux"), "-f v4l2 -i /dev/video1");
        assert_eq!(
            input("camera:0", "macos"),
            "-f avfoundation -framerate 30 -i 0:none"
        );
        assert_eq!(input("camera:Cam A", "windows"), "-f dshow -i video=Cam A");
        let by_number = Address::parse("camera:0").unwrap().input("windows");
        assert!(by_number.unwrap_err().hint().unwrap().contains("dshow"));
        assert_eq!(input("-", "windows"), "-i pipe:0");
        assert_eq!(input("udp://@:5000", "linux"), "-i udp://@:5000");
    }

    #[test]
    fn settings_after_a_cameras_name_are_requested() {
        let full = "-f v4l2 -input_format mjpeg -framerate 30 -video_size 1920x1080 -i /dev/video0";
        for name in ["camera:0", "/dev/video0"] {
            let asked = format!("{name}?size=1920x1080&fps=30&format=mjpeg");
            assert_eq!(input(&asked, "linux"), full);
        }
        // A calibration's size is requested if the text requests none, and of cameras alone.
        let sized = |text: &str| {
            let address = Address::parse(text).unwrap().or_of_size((640, 480));
            address.input("linux").unwrap().join(" ")
        };
        let of_size = |size: &str| format!("-f v4l2 -video_size {size} -i /dev/video0");
        assert_eq!(sized("camera:0"), of_size("640x480"));
        assert_eq!(sized("camera:0?size=320x240"), of_size("320x240"));
        assert_eq!(sized("udp://@:5000?size=1"), "-i udp://@:5000?size=1");
        let wrong = Address::parse("camera:0?sise=1x1").unwrap();
        let error = wrong.check().unwrap_err();
        assert_eq!(
            error.to_string(),
            "camera:0?sise=1x1: unknown setting `sise`"
        );
        assert!(error.hint().unwrap().contains("size="), "{error:?}");
        assert!(wrong.input("linux").is_err());
        for nameless in ["camera:", "camera:?fps=5"] {
            let address = Address::parse(nameless).unwrap();
            let error = address.check().unwrap_err();
            assert_eq!(
                error.to_string(),
                format!("{nameless} does not name a camera")
            );
            assert!(error.hint().unwrap().contains("camera:0"), "{error:?}");
            assert!(address.input("linux").is_err());
        }
        for right in ["camera:0?fps=5", "udp://@:5000?sise=1", "-"] {
            Address::parse(right).unwrap().check().unwrap();
        }
    }

    #[test]
    fn cameras_may_not_end() {
        let may_end = |text| Address::parse(text).unwrap().may_end();
        assert!(may_end("-") && may_end("http://host/a.ts") && may_end("tcp://host:1"));
        assert!(!may_end("camera:0") && !may_end("/dev/video0") && !may_end("RTSP://host/1"));
    }

    #[test]
    fn passwords_are_not_shown() {
        let address = Address::parse("rtsp://me:p@ss@cam.local:554/live").unwrap();
        assert_eq!(address.to_string(), "rtsp://***@cam.local:554/live");
        let shown =
            address.without_password("rtsp://me:p@ss@cam.local:554/live: Connection refused");
        assert_eq!(shown, "rtsp://***@cam.local:554/live: Connection refused");
        assert_eq!(
            input("rtsp://me:p@ss@cam.local:554/live", "linux"),
            "-rtsp_transport tcp -i rtsp://me:p@ss@cam.local:554/live"
        );
        assert_eq!(
            Address::parse("udp://@:5000").unwrap().to_string(),
            "udp://@:5000"
        );
        let mail = "http://host/?to=a@b";
        assert_eq!(Address::parse(mail).unwrap().to_string(), mail);
    }
}
