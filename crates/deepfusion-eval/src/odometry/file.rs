use super::pose_text::{Line, parse_line};
use super::{PoseFileError, PoseLineProblem, TrackError, TrackPair};
use deepfusion_fs::FileError;
use deepfusion_geometry::Se3;
use std::path::{Path, PathBuf};

/// Two times that differ by less than this are the same moment, in seconds: less than half a frame at 25 Hz.
const SAME_MOMENT_S: f64 = 0.01;

/// The format of a pose file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseFormat {
    /// KITTI's odometry benchmark: the upper three rows of `world_from_cam`, 12 numbers per line, no time.
    Kitti,
    /// TUM's RGB-D benchmark: `time tx ty tz qx qy qz qw` of `world_from_cam`, in seconds and metres.
    Tum,
}

/// A file of poses.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFile {
    /// Path the file was read from.
    pub path: PathBuf,
    /// The format, recognised by the number of columns.
    pub format: PoseFormat,
    /// `world_from_cam`, in the file's order.
    pub poses: Vec<Se3>,
    /// Times in seconds, strictly increasing; empty for KITTI's format.
    pub times_s: Vec<f64>,
}

impl PoseFile {
    /// Reads a file in either format. Empty lines and lines that start with `#` are skipped.
    ///
    /// # Errors
    /// [`PoseFileError`], with the line, if the number of columns changes, a value is not a finite number, a matrix or a quaternion is not
    /// a rotation, or a time does not increase.
    pub fn read(path: &Path) -> Result<Self, PoseFileError> {
        let bytes = std::fs::read(path).map_err(|source| FileError::new(path, source))?;
        Self::parse(path, &String::from_utf8_lossy(&bytes))
    }

    fn parse(path: &Path, text: &str) -> Result<Self, PoseFileError> {
        let mut file: Option<Self> = None;
        for (i, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let bad = |problem| PoseFileError::Line {
                path: path.to_owned(),
                line: i + 1,
                problem,
            };
            let format = file.as_ref().map(|f| f.format);
            let Line {
                format,
                pose,
                time_s,
            } = parse_line(line, format).map_err(bad)?;
            let file = file.get_or_insert_with(|| Self {
                path: path.to_owned(),
                format,
                poses: Vec::new(),
                times_s: Vec::new(),
            });
            if let Some(time_s) = time_s {
                if let Some(last) = file.times_s.last().filter(|last| **last >= time_s) {
                    return Err(bad(PoseLineProblem::Time {
                        time_s,
                        before_s: *last,
                    }));
                }
                file.times_s.push(time_s);
            }
            file.poses.push(pose);
        }
        file.ok_or_else(|| PoseFileError::Empty {
            path: path.to_owned(),
        })
    }

    /// Pairs the predicted poses of `self` with the true ones of `truth`. If both files have times, each pose is matched with the nearest
    /// time within 10 ms, at most once, and poses without a match are left out. Otherwise they are matched line by line.
    ///
    /// # Errors
    /// [`TrackError`] if the numbers of lines differ, or fewer than two times agree.
    pub fn beside(&self, truth: &Self) -> Result<TrackPair, TrackError> {
        let name = self
            .path
            .file_stem()
            .map_or_else(|| "poses".into(), |s| s.to_string_lossy().into_owned());
        if self.times_s.is_empty() || truth.times_s.is_empty() {
            let pair = TrackPair::new(name, truth.poses.clone(), self.poses.clone())?;
            let times_s = if self.times_s.is_empty() {
                &truth.times_s
            } else {
                &self.times_s
            };
            return Ok(pair.with_times(times_s.clone()));
        }
        let (mut true_poses, mut predicted, mut times_s) = (Vec::new(), Vec::new(), Vec::new());
        for (i, (pose, time_s)) in self.poses.iter().zip(&self.times_s).enumerate() {
            // If several share a nearest true pose, as in a trajectory with a higher rate, keep the nearest.
            if let Some(partner) = nearest(&truth.times_s, *time_s)
                && nearest(&self.times_s, truth.times_s[partner]) == Some(i)
            {
                predicted.push(*pose);
                times_s.push(*time_s);
                true_poses.push(truth.poses[partner]);
            }
        }
        if predicted.len() < 2 {
            return Err(TrackError::Times {
                name,
                matched: predicted.len(),
                predicted: self.poses.len(),
                truth: truth.poses.len(),
                within_s: SAME_MOMENT_S,
            });
        }
        Ok(TrackPair::new(name, true_poses, predicted)?.with_times(times_s))
    }
}

/// The index of the time nearest to `time_s`, if both are the same moment.
fn nearest(times_s: &[f64], time_s: f64) -> Option<usize> {
    let after = times_s.partition_point(|t| *t < time_s);
    let candidates = after.saturating_sub(1)..(after + 1).min(times_s.len());
    let off = |i: &usize| (times_s[*i] - time_s).abs();
    candidates
        .min_by(|a, b| off(a).total_cmp(&off(b)))
        .filter(|i| off(i) <= SAME_MOMENT_S)
}

#[cfg(test)]
mod tests {
    use super::super::{kitti_text, tum_text};
    use super::*;
    use deepfusion_hint::Hint;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn path(n: usize) -> Vec<Se3> {
        let pose = |i: usize| {
            let t = i as f64;
            Se3::from_axis_angle(
                Vector3::new(0.01 * t, 0.3 * t, -0.02),
                Vector3::new(t, 0.1, 1.7 * t),
            )
        };
        (0..n).map(pose).collect()
    }

    fn parse(text: &str) -> Result<PoseFile, PoseFileError> {
        PoseFile::parse(Path::new("p.txt"), text)
    }

    fn same(a: &[Se3], b: &[Se3]) -> bool {
        let near = |(a, b): (&Se3, &Se3)| (a.matrix() - b.matrix()).norm() < 1e-9;
        a.len() == b.len() && a.iter().zip(b).all(near)
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = PoseFile::read(Path::new("nowhere.txt")).unwrap_err();
        assert_eq!(error.to_string(), "nowhere.txt: no such file or folder");
    }

    #[test]
    fn written_files_are_read_back() {
        let poses = path(9);
        let read = parse(&kitti_text(&poses)).unwrap();
        assert_eq!(read.format, PoseFormat::Kitti);
        assert!(same(&read.poses, &poses) && read.times_s.is_empty());
        let times: Vec<f64> = (0..9).map(|i| f64::from(i) * 0.103).collect();
        let read = parse(&format!("# a comment\n\n{}", tum_text(&poses, &times))).unwrap();
        assert_eq!(read.format, PoseFormat::Tum);
        assert!(same(&read.poses, &poses));
        assert_eq!(read.times_s, times);
    }

    #[test]
    fn errors_name_the_line() {
        let good = kitti_text(&path(2));
        let scaled = "2 0 0 0 0 2 0 0 0 0 2 0\n";
        let mirrored = "-1 0 0 0 0 1 0 0 0 0 1 0\n";
        let cases = [
            (
                format!("{good}1 2 3\n"),
                "p.txt:3: 3 columns, expected 12 as in the lines before",
            ),
            (
                "1 2 3\n".into(),
                "p.txt:1: 3 columns, expected 12 (KITTI) or 8 (TUM)",
            ),
            (
                good.replacen("0.000000000000e+00", "NaN", 1),
                "p.txt:1: NaN",
            ),
            (
                good.replacen("0.000000000000e+00", "left", 1),
                "'left' is not a number",
            ),
            (scaled.into(), "not a rotation"),
            (mirrored.into(), "not a rotation"),
            ("0 1 2 3 0 0 0 2\n".into(), "length 2"),
            (
                "1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n".into(),
                "p.txt:2: time 1 is not after 1",
            ),
            ("# nothing\n".into(), "no poses"),
        ];
        for (text, expected) in cases {
            let error = parse(&text).unwrap_err();
            assert!(error.to_string().contains(expected), "{error} / {expected}");
            assert!(error.hint().is_some());
        }
    }

    #[test]
    fn files_are_matched_by_time_or_line() {
        let poses = path(6);
        let file = |times_s: Vec<f64>, poses: &[Se3]| PoseFile {
            path: "p.txt".into(),
            format: PoseFormat::Tum,
            poses: poses.to_vec(),
            times_s,
        };
        let truth = file((0..6).map(|i| f64::from(i) * 0.1).collect(), &poses);
        let predicted = file(vec![0.104, 0.296, 0.35, 0.5], &path(4));
        let pair = predicted.beside(&truth).unwrap();
        assert!(same(&pair.truth, &[poses[1], poses[3], poses[5]]));
        assert_eq!(pair.predicted.len(), 3);
        let strange = file(vec![7.0, 8.0], &path(2));
        let error = strange.beside(&truth).unwrap_err();
        assert!(error.to_string().contains("only 0 of 2"), "{error}");
        let error = file(vec![], &path(5)).beside(&truth).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("5 predicted poses, 6 true poses"),
            "{error}"
        );
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "[-0-9eNa. #\n]{0,200}") {
            let _ = parse(&text);
        }
    }
}
