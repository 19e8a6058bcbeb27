//! A clean simulated drive in KITTI's layout, and faults planted into copies of it.

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_doctor::{Diagnosis, doctor};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use image::RgbImage;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Indices of values in an OXTS packet.
pub(crate) mod oxts {
    pub(crate) const VN: usize = 6;
    pub(crate) const VE: usize = 7;
    pub(crate) const VF: usize = 8;
    pub(crate) const VL: usize = 9;
}

/// A copy of the clean drive.
pub(crate) struct Drive {
    folder: tempfile::TempDir,
}

impl Drive {
    /// The drive is simulated once and copied for each test.
    pub(crate) fn clean() -> Self {
        static CLEAN: OnceLock<tempfile::TempDir> = OnceLock::new();
        let clean = CLEAN.get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let config = SimConfig {
                width: 320,
                height: 96,
                scan_every: 20,
                ..SimConfig::default()
            };
            let simulation = Simulation::new(&config).unwrap();
            write_kitti(&simulation, &folder.path().join("kitti"), &mut |_, _| {
                ControlFlow::Continue(())
            })
            .unwrap();
            folder
        });
        let folder = tempfile::tempdir().unwrap();
        copy(clean.path(), folder.path());
        Self { folder }
    }

    pub(crate) fn diagnose(&self) -> Diagnosis {
        doctor(&self.folder.path().join("kitti"), None)
    }

    pub(crate) fn open(&self) -> Dataset {
        let root = self.folder.path().join("kitti");
        Dataset::open(&root, &OpenOptions::default())
            .unwrap()
            .remove(0)
    }

    fn date(&self) -> PathBuf {
        self.folder.path().join("kitti/2026_01_01")
    }

    fn drive(&self) -> PathBuf {
        self.date().join("2026_01_01_drive_0001_sync")
    }

    fn image(&self, number: usize) -> PathBuf {
        self.drive().join(format!("image_02/data/{number:010}.png"))
    }

    /// Changes fx, 0, cx, 0, fy, cy, 0, 0, 1 of camera 2.
    pub(crate) fn camera(&self, change: impl FnOnce(&mut [f64; 9])) {
        let path = self.date().join("calib_cam_to_cam.txt");
        let text = std::fs::read_to_string(&path).unwrap();
        let line = |key: &str| -> Vec<f64> {
            let line = text.lines().find(|l| l.starts_with(key)).unwrap();
            line[key.len()..]
                .split_whitespace()
                .map(|w| w.parse().unwrap())
                .collect()
        };
        let mut k: [f64; 9] = line("K_02:").try_into().unwrap();
        let before = k;
        change(&mut k);
        let mut p = line("P_rect_02:");
        p[3] *= k[0] / before[0];
        (p[0], p[2], p[5], p[6]) = (k[0], k[2], k[4], k[5]);
        let words: Vec<String> = p.iter().map(|v| format!("{v:.9e}")).collect();
        let lines = text.lines().map(|l| {
            if l.starts_with("P_rect_02:") {
                format!("P_rect_02: {}\n", words.join(" "))
            } else {
                format!("{l}\n")
            }
        });
        std::fs::write(&path, lines.collect::<String>()).unwrap();
    }

    /// Pitches the vehicle's axes nose down against the sensors', in degrees.
    pub(crate) fn pitch_vehicle(&self, degrees: f64) {
        let path = self.date().join("calib_imu_to_velo.txt");
        let text = std::fs::read_to_string(&path).unwrap();
        let lines = text.lines().map(|line| {
            let Some(words) = line.strip_prefix("R:") else {
                return format!("{line}\n");
            };
            let r: Vec<f64> = words
                .split_whitespace()
                .map(|w| w.parse().unwrap())
                .collect();
            let r = nalgebra::Matrix3::from_row_slice(&r);
            let turn = nalgebra::Rotation3::from_euler_angles(0.0, degrees.to_radians(), 0.0);
            let turned = r * turn.matrix();
            let words: Vec<String> = turned
                .transpose()
                .iter()
                .map(|v| format!("{v:.9e}"))
                .collect();
            format!("R: {}\n", words.join(" "))
        });
        std::fs::write(&path, lines.collect::<String>()).unwrap();
    }

    /// Changes the values of every OXTS packet.
    pub(crate) fn oxts(&self, change: impl Fn(usize, &mut [f64])) {
        for number in 0..SimConfig::default().frames {
            let path = self.drive().join(format!("oxts/data/{number:010}.txt"));
            let text = std::fs::read_to_string(&path).unwrap();
            let words: Vec<&str> = text.split_whitespace().collect();
            let mut values: Vec<f64> = words.iter().map(|w| w.parse().unwrap()).collect();
            let before = values.clone();
            change(number, &mut values);
            let changed = words.iter().enumerate().map(|(i, word)| {
                if values[i] == before[i] {
                    (*word).to_owned()
                } else {
                    format!("{:.9}", values[i])
                }
            });
            std::fs::write(&path, changed.collect::<Vec<_>>().join(" ")).unwrap();
        }
    }

    /// Moves the camera's clock ahead of the vehicle's.
    pub(crate) fn camera_clock_ahead(&self, seconds: f64) {
        let path = self.drive().join("image_02/timestamps.txt");
        let text = std::fs::read_to_string(&path).unwrap();
        let lines = text.lines().map(|line| {
            let (head, tail) = line.split_at(line.len() - "00:00.000000000".len());
            let (minutes, rest) = tail.split_once(':').unwrap();
            let minutes: f64 = minutes.parse().unwrap();
            let total = 60.0 * minutes + rest.parse::<f64>().unwrap() + seconds;
            format!(
                "{head}{:02}:{:012.9}\n",
                (total / 60.0).floor(),
                total % 60.0
            )
        });
        std::fs::write(&path, lines.collect::<String>()).unwrap();
    }

    /// Changes every image.
    pub(crate) fn images(&self, change: impl Fn(usize, &mut RgbImage)) {
        for number in 0..SimConfig::default().frames {
            let path = self.image(number);
            let mut image = image::open(&path).unwrap().into_rgb8();
            change(number, &mut image);
            image.save(&path).unwrap();
        }
    }

    /// Adds a second camera beside the first. It sees everything `shift` pixels farther to the right; a camera to the right of the first
    /// sees it farther to the left (negative).
    pub(crate) fn second_camera(&self, shift: i64) {
        let second = self.drive().join("image_03");
        std::fs::create_dir(&second).unwrap();
        copy(&self.drive().join("image_02"), &second);
        for number in 0..SimConfig::default().frames {
            let seen = image::open(self.image(number)).unwrap().into_rgb8();
            let last = i64::from(seen.width()) - 1;
            let moved = RgbImage::from_fn(seen.width(), seen.height(), |x, y| {
                *seen.get_pixel((i64::from(x) - shift).clamp(0, last) as u32, y)
            });
            let path = second.join(format!("data/{number:010}.png"));
            moved.save(path).unwrap();
        }
        let path = self.date().join("calib_cam_to_cam.txt");
        let text = std::fs::read_to_string(&path).unwrap();
        if !text.contains("P_rect_03:") {
            let again = text.lines().filter(|line| line.contains("_02:"));
            let again: String = again
                .map(|line| line.replacen("_02:", "_03:", 1) + "\n")
                .collect();
            std::fs::write(&path, text + &again).unwrap();
        }
    }

    pub(crate) fn remove_images(&self, numbers: &[usize]) {
        for number in numbers {
            std::fs::remove_file(self.image(*number)).unwrap();
        }
    }

    pub(crate) fn remove_oxts(&self, numbers: std::ops::Range<usize>) {
        for number in numbers {
            let path = self.drive().join(format!("oxts/data/{number:010}.txt"));
            std::fs::remove_file(path).unwrap();
        }
    }

    /// Repeats each of these images in place of the next one.
    pub(crate) fn repeat_images(&self, numbers: &[usize]) {
        for number in numbers {
            std::fs::copy(self.image(*number), self.image(*number + 1)).unwrap();
        }
    }

    /// Truncates an image's file to half of its length.
    pub(crate) fn cut_image(&self, number: usize) {
        let bytes = std::fs::read(self.image(number)).unwrap();
        std::fs::write(self.image(number), &bytes[..bytes.len() / 2]).unwrap();
    }
}

fn copy(from: &Path, to: &Path) {
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            std::fs::create_dir(&target).unwrap();
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).unwrap();
        }
    }
}
