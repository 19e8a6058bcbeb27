//! PCD, the file format of the Point Cloud Library, version 0.7.

use std::io::Write;

use super::{PointCloud, Result};

impl PointCloud {
    /// Writes the cloud as a binary PCD: x, y, z as f32, and if the cloud has them `rgb` (packed as PCL does, 0x00RRGGBB in the bits of an
    /// f32), `intensity`, `radial_velocity`, `confidence` and `sigma`.
    ///
    /// # Errors
    /// [`Error::Stream`](super::Error::Stream) if writing fails, [`Error::Size`](super::Error::Size) if a column does not
    /// fit.
    pub fn write_pcd(&self, mut out: impl Write) -> Result<()> {
        self.check()?;
        let columns = [
            ("intensity", &self.intensity),
            ("radial_velocity", &self.radial_velocity),
            ("confidence", &self.confidence),
            ("sigma", &self.sigma),
        ];
        let columns: Vec<(&str, &Vec<f32>)> = columns
            .into_iter()
            .filter_map(|(name, column)| Some((name, column.as_ref()?)))
            .collect();
        let mut fields = vec!["x", "y", "z"];
        fields.extend(self.rgb.as_ref().map(|_| "rgb"));
        fields.extend(columns.iter().map(|(name, _)| name));
        let each = |word: &str| vec![word; fields.len()].join(" ");
        let header = format!(
            "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {n}\nHEIGHT 1\n\
             VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n",
            fields.join(" "),
            each("4"),
            each("F"),
            each("1"),
            n = self.len()
        );
        let mut bytes = header.into_bytes();
        bytes.reserve(self.len() * 4 * fields.len());
        for (i, point) in self.xyz.iter().enumerate() {
            for value in point {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
            if let Some(rgb) = &self.rgb {
                let [r, g, b] = rgb[i];
                bytes.extend_from_slice(&[b, g, r, 0]);
            }
            for (_, column) in &columns {
                bytes.extend_from_slice(&column[i].to_le_bytes());
            }
        }
        Ok(out.write_all(&bytes)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> PointCloud {
        PointCloud {
            xyz: vec![[1.0, -2.5, 3.25], [0.0, 0.5, 40.0]],
            rgb: Some(vec![[255, 128, 1], [2, 3, 4]]),
            confidence: Some(vec![0.5, 0.25]),
            ..PointCloud::default()
        }
    }

    /// The file that `tests/reference/pcd.py` (pypcd4) writes for the same points.
    #[test]
    fn files_equal_those_of_pypcd4() {
        let mut bytes = Vec::new();
        cloud().write_pcd(&mut bytes).unwrap();
        let reference = include_bytes!("../../tests/reference/cloud.pcd");
        let split = |bytes: &[u8]| {
            let mark = b"DATA binary\n";
            let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap();
            let (head, body) = bytes.split_at(at + mark.len());
            let head = String::from_utf8(head.to_vec()).unwrap();
            let lines = head.lines().filter(|line| !line.starts_with('#'));
            (
                lines.map(|l| l.trim().to_owned()).collect::<Vec<_>>(),
                body.to_vec(),
            )
        };
        let ((head, body), (expected_head, expected_body)) = (split(&bytes), split(reference));
        assert_eq!(body, expected_body);
        // The viewpoint may be written 0 or 0.0.
        let same = |line: &String| !line.starts_with("VIEWPOINT");
        let kept = |lines: Vec<String>| lines.into_iter().filter(same).collect::<Vec<_>>();
        assert_eq!(kept(head), kept(expected_head));
    }

    #[test]
    fn columns_that_do_not_fit_are_refused() {
        let wrong = PointCloud {
            confidence: Some(vec![0.5]),
            ..cloud()
        };
        assert!(wrong.write_pcd(Vec::new()).is_err());
        let mut bytes = Vec::new();
        PointCloud::default().write_pcd(&mut bytes).unwrap();
        assert!(String::from_utf8(bytes).unwrap().contains("FIELDS x y z\n"));
    }
}
