//! PLY, binary little-endian: `x y z` as float, then, if the cloud has them, `red green blue` as uchar, and `intensity`, `radial_velocity`,
//! `confidence` and `sigma` as float.

use super::{PlyProblem, PointCloud, Result};
use std::io::{BufRead, Read, Write};

/// Longest header line accepted, so that a binary file of another format is not read completely as one line.
const MAX_HEADER_LINE: u64 = 4096;
/// Number of points read at a time, so that a wrong vertex count in the header does not allocate memory.
const CHUNK_POINTS: usize = 4096;

impl PointCloud {
    /// Writes the cloud as a binary little-endian PLY.
    ///
    /// # Errors
    /// [`Error::Stream`](super::Error::Stream) if writing fails, [`Error::Size`](super::Error::Size) if a column does not fit.
    pub fn write_ply(&self, mut out: impl Write) -> Result<()> {
        self.check()?;
        let mut header = format!(
            "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex {}\n\
             property float x\nproperty float y\nproperty float z\n",
            self.len()
        );
        if self.rgb.is_some() {
            header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        }
        if self.intensity.is_some() {
            header += "property float intensity\n";
        }
        if self.radial_velocity.is_some() {
            header += "property float radial_velocity\n";
        }
        if self.confidence.is_some() {
            header += "property float confidence\n";
        }
        if self.sigma.is_some() {
            header += "property float sigma\n";
        }
        header += "end_header\n";
        let mut bytes = header.into_bytes();
        bytes.reserve(self.len() * 23);
        for (i, point) in self.xyz.iter().enumerate() {
            for value in point {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
            if let Some(rgb) = &self.rgb {
                bytes.extend_from_slice(&rgb[i]);
            }
            let columns = [
                &self.intensity,
                &self.radial_velocity,
                &self.confidence,
                &self.sigma,
            ];
            for column in columns.into_iter().flatten() {
                bytes.extend_from_slice(&column[i].to_le_bytes());
            }
        }
        Ok(out.write_all(&bytes)?)
    }

    /// Reads a binary little-endian PLY whose first element is `vertex` with scalar properties, among them `x`, `y`, `z`. Unknown
    /// properties and later elements are skipped.
    ///
    /// # Errors
    /// [`Error::Ply`](super::Error::Ply) for any other file and for one that ends early.
    pub fn read_ply(mut input: impl BufRead) -> Result<Self> {
        let header = Header::read(&mut input)?;
        let stride = header.properties.iter().map(|p| p.kind.bytes()).sum();
        let position = [
            header.require("x")?,
            header.require("y")?,
            header.require("z")?,
        ];
        let colour = ["red", "green", "blue"].map(|name| header.find(name));
        let colour = match colour {
            [Some(r), Some(g), Some(b)] => Some([r, g, b]),
            _ => None,
        };
        let intensity = header.find("intensity");
        let radial_velocity = header.find("radial_velocity");
        let confidence = header.find("confidence");
        let sigma = header.find("sigma");
        let mut cloud = Self {
            rgb: colour.map(|_| Vec::new()),
            intensity: intensity.map(|_| Vec::new()),
            radial_velocity: radial_velocity.map(|_| Vec::new()),
            confidence: confidence.map(|_| Vec::new()),
            sigma: sigma.map(|_| Vec::new()),
            ..Self::default()
        };
        let mut left = header.vertices;
        let mut buffer = Vec::new();
        while left > 0 {
            let now = left.min(CHUNK_POINTS);
            buffer.resize(now * stride, 0);
            input.read_exact(&mut buffer).map_err(|_| PlyProblem::Cut {
                vertex: header.vertices - left + now,
                vertices: header.vertices,
            })?;
            for vertex in buffer.chunks_exact(stride) {
                cloud.xyz.push(position.map(|p| p.value(vertex) as f32));
                if let (Some(rgb), Some(properties)) = (&mut cloud.rgb, colour) {
                    rgb.push(properties.map(|p| p.colour(vertex)));
                }
                if let (Some(column), Some(p)) = (&mut cloud.intensity, intensity) {
                    column.push(p.value(vertex) as f32);
                }
                if let (Some(column), Some(p)) = (&mut cloud.radial_velocity, radial_velocity) {
                    column.push(p.value(vertex) as f32);
                }
                if let (Some(column), Some(p)) = (&mut cloud.confidence, confidence) {
                    column.push(p.value(vertex) as f32);
                }
                if let (Some(column), Some(p)) = (&mut cloud.sigma, sigma) {
                    column.push(p.value(vertex) as f32);
                }
            }
            left -= now;
        }
        Ok(cloud)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Property {
    kind: Kind,
    offset: usize,
}

impl Property {
    fn value(self, vertex: &[u8]) -> f64 {
        let at = |i: usize| vertex[self.offset + i];
        match self.kind {
            Kind::I8 => f64::from(at(0) as i8),
            Kind::U8 => f64::from(at(0)),
            Kind::I16 => f64::from(i16::from_le_bytes([at(0), at(1)])),
            Kind::U16 => f64::from(u16::from_le_bytes([at(0), at(1)])),
            Kind::I32 => f64::from(i32::from_le_bytes([at(0), at(1), at(2), at(3)])),
            Kind::U32 => f64::from(u32::from_le_bytes([at(0), at(1), at(2), at(3)])),
            Kind::F32 => f64::from(f32::from_le_bytes([at(0), at(1), at(2), at(3)])),
            Kind::F64 => {
                f64::from_le_bytes([at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7)])
            }
        }
    }

    /// A colour channel as a byte; floating-point colours are in [0, 1] by convention.
    fn colour(self, vertex: &[u8]) -> u8 {
        let value = self.value(vertex);
        let scaled = match self.kind {
            Kind::F32 | Kind::F64 => value * 255.0,
            _ => value,
        };
        scaled.round().clamp(0.0, 255.0) as u8
    }
}

struct Header {
    vertices: usize,
    properties: Vec<NamedProperty>,
}

struct NamedProperty {
    name: String,
    kind: Kind,
    property: Property,
}

impl Header {
    fn read(input: &mut impl BufRead) -> Result<Self> {
        if next_line(input)? != "ply" {
            return Err(PlyProblem::NoPly.into());
        }
        let mut vertices: Option<usize> = None;
        let mut properties: Vec<NamedProperty> = Vec::new();
        let (mut in_vertex, mut format_seen) = (false, false);
        loop {
            let line = next_line(input)?;
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                ["format", "binary_little_endian", _] => format_seen = true,
                ["format", other, ..] => {
                    return Err(PlyProblem::Format((*other).to_owned()).into());
                }
                ["element", "vertex", count] if vertices.is_none() => {
                    let count = count
                        .parse()
                        .map_err(|_| PlyProblem::Count((*count).to_owned()))?;
                    vertices = Some(count);
                    in_vertex = true;
                }
                ["element", name, _] => {
                    if vertices.is_none() {
                        return Err(PlyProblem::Order((*name).to_owned()).into());
                    }
                    in_vertex = false;
                }
                ["property", "list", ..] if in_vertex => {
                    return Err(PlyProblem::List.into());
                }
                ["property", kind, name] if in_vertex => {
                    let kind = Kind::of(kind).ok_or_else(|| PlyProblem::Type {
                        name: (*name).to_owned(),
                        kind: (*kind).to_owned(),
                    })?;
                    let offset = properties.iter().map(|p| p.kind.bytes()).sum();
                    properties.push(NamedProperty {
                        name: (*name).to_owned(),
                        kind,
                        property: Property { kind, offset },
                    });
                }
                ["end_header"] => break,
                ["comment" | "obj_info", ..] | ["property", ..] | [] => {}
                _ => return Err(PlyProblem::Line(line).into()),
            }
        }
        if !format_seen {
            return Err(PlyProblem::NoFormat.into());
        }
        let vertices = vertices.ok_or(PlyProblem::NoVertices)?;
        Ok(Self {
            vertices,
            properties,
        })
    }

    fn find(&self, name: &str) -> Option<Property> {
        let found = self.properties.iter().find(|p| p.name == name)?;
        Some(found.property)
    }

    fn require(&self, name: &'static str) -> std::result::Result<Property, PlyProblem> {
        self.find(name).ok_or(PlyProblem::NoProperty(name))
    }
}

/// The next header line without its line end; anything that is not text is an error.
fn next_line(input: &mut impl BufRead) -> Result<String> {
    let mut line = Vec::new();
    input
        .by_ref()
        .take(MAX_HEADER_LINE)
        .read_until(b'\n', &mut line)?;
    if line.pop() != Some(b'\n') {
        return Err(PlyProblem::HeaderCut.into());
    }
    let line = String::from_utf8(line).map_err(|_| PlyProblem::NoText)?;
    Ok(line.trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cloud(n: usize) -> PointCloud {
        let x = |i: usize| i as f32 * 0.25;
        PointCloud {
            xyz: (0..n).map(|i| [x(i), -x(i), 1.0]).collect(),
            rgb: Some((0..n).map(|i| [i as u8, 7, 255]).collect()),
            intensity: Some((0..n).map(x).collect()),
            radial_velocity: Some((0..n).map(|i| 3.0 - x(i)).collect()),
            confidence: Some(vec![0.5; n]),
            sigma: Some((0..n).map(|i| 0.01 + x(i)).collect()),
        }
    }

    #[test]
    fn a_cloud_survives_the_file() {
        // More points than one chunk holds; with and without the optional columns.
        for cloud in [
            cloud(0),
            cloud(5000),
            PointCloud {
                rgb: None,
                intensity: None,
                ..cloud(3)
            },
        ] {
            let mut bytes = Vec::new();
            cloud.write_ply(&mut bytes).unwrap();
            assert_eq!(PointCloud::read_ply(bytes.as_slice()).unwrap(), cloud);
        }
    }

    #[test]
    fn other_writers_types_and_extra_properties_are_read() {
        let mut bytes = b"ply\r\nformat binary_little_endian 1.0\r\nelement vertex 1\r\nproperty double x\r\nproperty float nx\r\nproperty double y\r\nproperty double z\r\nelement face 0\r\nproperty list uchar int vertex_indices\r\nend_header\r\n".to_vec();
        bytes.extend(2.5_f64.to_le_bytes());
        bytes.extend(9.0_f32.to_le_bytes());
        bytes.extend((-1.0_f64).to_le_bytes());
        bytes.extend(4.0_f64.to_le_bytes());
        let cloud = PointCloud::read_ply(bytes.as_slice()).unwrap();
        assert_eq!(cloud.xyz, vec![[2.5, -1.0, 4.0]]);
        assert_eq!(cloud.rgb, None);
    }

    #[test]
    fn unsupported_files_are_errors_with_the_reason() {
        let message = |bytes: &[u8]| PointCloud::read_ply(bytes).unwrap_err().to_string();
        assert!(message(b"P6\n").contains("begin with 'ply'"));
        assert!(message(b"ply\nformat ascii 1.0\nend_header\n").contains("ascii"));
        let huge = b"ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        assert!(message(huge).contains("999999999999"));
    }

    proptest! {
        #[test]
        fn garbage_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = PointCloud::read_ply(bytes.as_slice());
        }

        /// Every truncation of a valid file is an error, never a shorter cloud.
        #[test]
        fn a_cut_file_is_an_error(cut in 0.0..1.0f64) {
            let mut bytes = Vec::new();
            cloud(20).write_ply(&mut bytes).unwrap();
            let length = (bytes.len() as f64 * cut) as usize;
            prop_assert!(PointCloud::read_ply(&bytes[..length]).is_err());
        }
    }
}
