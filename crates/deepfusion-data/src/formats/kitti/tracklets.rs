//! Reads `tracklet_labels.xml`: boxes around traffic, tracked over a drive's frames.

use crate::{Error, MissingPart, TrackletPart, TrackletPlace, TrackletsProblem};
use nalgebra::Vector3;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::io::BufRead;
use std::path::Path;

/// A labelled object: a box of constant size with a pose in each of several consecutive frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracklet {
    /// KITTI's name for its class: `Car`, `Van`, `Pedestrian`, `Cyclist`, …
    pub object: String,
    /// Length, width and height, in metres.
    pub size_m: [f64; 3],
    /// Number of the frame that its first pose belongs to.
    pub first_frame: u64,
    /// Its poses, one per frame.
    pub poses: Vec<TrackletPose>,
}

/// Pose of a box in one frame, in the velodyne's axes (x forward, y left, z up).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackletPose {
    /// Centre of the box's bottom, in metres.
    pub bottom_m: Vector3<f64>,
    /// Turn about z from the velodyne's x to the box's length, in radians.
    pub yaw_rad: f64,
}

impl Tracklet {
    /// Name of the file in a drive's folder.
    pub const FILE: &str = "tracklet_labels.xml";

    /// The object's pose in a frame; `None` if it has none there.
    #[must_use]
    pub fn pose(&self, frame: u64) -> Option<TrackletPose> {
        let index = usize::try_from(frame.checked_sub(self.first_frame)?).ok()?;
        self.poses.get(index).copied()
    }

    /// Reads a tracklet file, element by element.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is no such file; [`Error::Tracklets`] with the tracklet, pose and
    /// field if the text is not XML, is truncated, lacks a number or has fewer entries than its count.
    pub fn read(path: &Path) -> crate::Result<Vec<Self>> {
        let file = std::fs::File::open(path).map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Error::Missing {
                path: path.to_owned(),
                part: MissingPart::Tracklets,
            },
            _ => Error::file(path, e),
        })?;
        Self::parse(std::io::BufReader::new(file)).map_err(|(place, problem)| Error::Tracklets {
            path: path.to_owned(),
            place,
            problem,
        })
    }

    fn parse(text: impl BufRead) -> Result<Vec<Self>, (TrackletPlace, TrackletsProblem)> {
        let mut reader = Reader::from_reader(text);
        let (mut buffer, mut document) = (Vec::new(), Document::default());
        loop {
            let event = reader.read_event_into(&mut buffer);
            let at_byte = || TrackletPlace::Byte(reader.buffer_position());
            match event.map_err(|e| (at_byte(), TrackletsProblem::Xml(Box::new(e))))? {
                Event::Start(tag) => document.open(&String::from_utf8_lossy(tag.name().as_ref())),
                Event::Text(text) => document.text += &String::from_utf8_lossy(&text),
                Event::End(_) => document.close()?,
                Event::Eof => return document.finish().map_err(|problem| (at_byte(), problem)),
                _ => {}
            }
            buffer.clear();
        }
    }
}

/// The tracklets read so far, and the element being read.
#[derive(Default)]
struct Document {
    /// Names of the open elements, from the outermost to the innermost.
    path: Vec<String>,
    /// Text of the innermost element.
    text: String,
    tracklets: Vec<Tracklet>,
    announced: Option<usize>,
    tracklet: OpenTracklet,
    pose: OpenPose,
}

/// A tracklet being read.
#[derive(Default)]
struct OpenTracklet {
    object: Option<String>,
    length: Option<f64>,
    width: Option<f64>,
    height: Option<f64>,
    first_frame: Option<u64>,
    announced: Option<usize>,
    poses: Vec<TrackletPose>,
}

/// A pose being read.
#[derive(Default)]
struct OpenPose {
    tx: Option<f64>,
    ty: Option<f64>,
    tz: Option<f64>,
    rz: Option<f64>,
}

impl Document {
    fn open(&mut self, name: &str) {
        self.path.push(name.to_owned());
        self.text.clear();
    }

    fn close(&mut self) -> Result<(), (TrackletPlace, TrackletsProblem)> {
        let path: Vec<&str> = self.path.iter().map(String::as_str).collect();
        let outcome = match path.as_slice() {
            ["boost_serialization", "tracklets", inner @ ..] => match inner {
                ["count"] => number(&self.text).map(|n| self.announced = Some(n)),
                ["item"] => self.tracklet.take().map(|t| self.tracklets.push(t)),
                ["item", "poses", "item"] => {
                    self.pose.take().map(|pose| self.tracklet.poses.push(pose))
                }
                ["item", "poses", "item", field] => self.pose.set(field, &self.text),
                ["item", "poses", "count"] => {
                    number(&self.text).map(|n| self.tracklet.announced = Some(n))
                }
                ["item", field] => self.tracklet.set(field, &self.text),
                _ => Ok(()),
            },
            _ => Ok(()),
        };
        let outcome = outcome.map_err(|problem| (self.place(&path), problem));
        self.path.pop();
        self.text.clear();
        outcome
    }

    /// The current place in the document.
    fn place(&self, path: &[&str]) -> TrackletPlace {
        let name = path.last().filter(|name| **name != "item");
        let field = name.map(|&name| name.to_owned());
        match path.get(2) {
            Some(&"item") => TrackletPlace::Tracklet {
                number: self.tracklets.len(),
                pose: (path.get(4) == Some(&"item")).then_some(self.tracklet.poses.len()),
                field,
            },
            _ => TrackletPlace::List { field },
        }
    }

    fn finish(self) -> Result<Vec<Tracklet>, TrackletsProblem> {
        match (self.path.is_empty(), self.announced) {
            (false, _) => Err(TrackletsProblem::Ends { within: self.path }),
            (true, None) => Err(TrackletsProblem::NoTracklets),
            (true, Some(count)) => {
                let found = self.tracklets.len();
                enough(count, found, TrackletPart::Tracklets).map(|()| self.tracklets)
            }
        }
    }
}

impl OpenTracklet {
    fn set(&mut self, field: &str, text: &str) -> Result<(), TrackletsProblem> {
        match field {
            "objectType" => self.object = Some(text.trim().to_owned()),
            "l" => self.length = Some(length(text)?),
            "w" => self.width = Some(length(text)?),
            "h" => self.height = Some(length(text)?),
            "first_frame" => self.first_frame = Some(number::<u32>(text)?.into()),
            _ => {}
        }
        Ok(())
    }

    fn take(&mut self) -> Result<Tracklet, TrackletsProblem> {
        let open = std::mem::take(self);
        let count = required(open.announced, "poses")?;
        enough(count, open.poses.len(), TrackletPart::Poses)?;
        Ok(Tracklet {
            object: required(open.object, "objectType")?,
            size_m: [
                required(open.length, "l")?,
                required(open.width, "w")?,
                required(open.height, "h")?,
            ],
            first_frame: required(open.first_frame, "first_frame")?,
            poses: open.poses,
        })
    }
}

impl OpenPose {
    fn set(&mut self, field: &str, text: &str) -> Result<(), TrackletsProblem> {
        let place = match field {
            "tx" => &mut self.tx,
            "ty" => &mut self.ty,
            "tz" => &mut self.tz,
            "rz" => &mut self.rz,
            _ => return Ok(()),
        };
        *place = Some(finite(text)?);
        Ok(())
    }

    fn take(&mut self) -> Result<TrackletPose, TrackletsProblem> {
        let open = std::mem::take(self);
        Ok(TrackletPose {
            bottom_m: Vector3::new(
                required(open.tx, "tx")?,
                required(open.ty, "ty")?,
                required(open.tz, "tz")?,
            ),
            yaw_rad: required(open.rz, "rz")?,
        })
    }
}

fn required<T>(part: Option<T>, element: &'static str) -> Result<T, TrackletsProblem> {
    part.ok_or(TrackletsProblem::Lacks { element })
}

fn number<T: std::str::FromStr>(text: &str) -> Result<T, TrackletsProblem> {
    let problem = |_| TrackletsProblem::NotACount {
        text: shortened(text),
    };
    text.trim().parse().map_err(problem)
}

fn finite(text: &str) -> Result<f64, TrackletsProblem> {
    let value: Option<f64> = text.trim().parse().ok().filter(|v: &f64| v.is_finite());
    value.ok_or_else(|| TrackletsProblem::NotANumber {
        text: shortened(text),
    })
}

fn length(text: &str) -> Result<f64, TrackletsProblem> {
    match finite(text)? {
        value if value > 0.0 => Ok(value),
        value => Err(TrackletsProblem::NotALength { value }),
    }
}

/// A text, shortened for a message.
fn shortened(text: &str) -> String {
    text.trim().chars().take(40).collect()
}

fn enough(announced: usize, found: usize, of: TrackletPart) -> Result<(), TrackletsProblem> {
    if announced == found {
        Ok(())
    } else {
        Err(TrackletsProblem::Count {
            of,
            found,
            announced,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(poses: &str, count: usize) -> String {
        format!(
            r#"<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<!DOCTYPE boost_serialization>
<boost_serialization signature="serialization::archive" version="9">
<tracklets class_id="0" tracking_level="0" version="0">
	<count>1</count>
	<item_version>1</item_version>
	<item class_id="1" tracking_level="0" version="1">
		<objectType>Van</objectType>
		<h>2</h>
		<w>1.8</w>
		<l>4.5</l>
		<first_frame>7</first_frame>
		<poses class_id="2" tracking_level="0" version="0">
			<count>{count}</count>
			<item_version>2</item_version>
			{poses}
		</poses>
		<finished>1</finished>
	</item>
</tracklets>
</boost_serialization>"#
        )
    }

    const POSE: &str = "<item><tx>13.7</tx><ty>4.5</ty><tz>-1.74</tz><rx>0</rx><ry>0</ry>\
                        <rz>0.54</rz><state>2</state><occlusion>0</occlusion></item>";

    fn parse(text: &str) -> Result<Vec<Tracklet>, (TrackletPlace, TrackletsProblem)> {
        Tracklet::parse(text.as_bytes())
    }

    #[test]
    fn poses_and_sizes_are_read() {
        let read = parse(&file(&POSE.repeat(2), 2)).unwrap();
        let van = &read[0];
        assert_eq!((read.len(), van.object.as_str()), (1, "Van"));
        assert_eq!(van.size_m, [4.5, 1.8, 2.0]);
        assert_eq!(van.pose(6), None);
        assert_eq!(van.pose(9), None);
        let pose = van.pose(8).unwrap();
        assert_eq!(pose.bottom_m, Vector3::new(13.7, 4.5, -1.74));
        assert_eq!(pose.yaw_rad, 0.54);
    }

    /// The text of a complete file up to the first `mark`.
    fn cut_at(mark: &str) -> String {
        let whole = file(POSE, 1);
        whole[..whole.find(mark).unwrap()].to_owned()
    }

    #[test]
    fn errors_name_the_tracklet_pose_and_field() {
        let cases = [
            (
                file(&POSE.replace("13.7", "NaN"), 1),
                "tracklet 0, pose 0, tx",
                "'NaN' is not a finite number",
            ),
            (
                file(&POSE.replace("<tz>-1.74</tz>", ""), 1),
                "tracklet 0, pose 0",
                "no <tz>",
            ),
            (file(POSE, 3), "tracklet 0", "1 pose, but <count> is 3"),
            (
                file(POSE, 1).replace("<l>4.5</l>", "<l>-4.5</l>"),
                "tracklet 0, l",
                "-4.5 is not a length",
            ),
            (
                file(POSE, 1).replacen("<count>1</count>", "<count>2</count>", 1),
                "byte",
                "1 tracklet, but <count> is 2",
            ),
            (file(POSE, 1).replace("</tx>", "</ty>"), "byte", "tx"),
            (cut_at("</item>"), "byte", "ends within"),
            (cut_at("tem>"), "byte", "not closed"),
            ("<html></html>".to_owned(), "byte", "not a tracklet file"),
        ];
        for (text, place, problem) in cases {
            let error = parse(&text).unwrap_err();
            assert!(error.0.to_string().starts_with(place), "{error:?}");
            assert!(error.1.to_string().contains(problem), "{error:?}");
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,200}", at in 0..900usize) {
            let _ = parse(&text);
            let whole = file(POSE, 1);
            let (a, b) = whole.split_at(at.min(whole.len()));
            let _ = parse(&format!("{a}{text}{b}"));
        }
    }
}
