//! Access to a point cloud's values by field name, for any layout.

use super::{Header, LayoutProblem, MessageError, MessagePart, PointCloud2, PointField};
use std::borrow::Cow;

/// The number type of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Datatype {
    /// i8.
    Int8 = 1,
    /// u8.
    Uint8,
    /// i16.
    Int16,
    /// u16.
    Uint16,
    /// i32.
    Int32,
    /// u32.
    Uint32,
    /// f32.
    Float32,
    /// f64.
    Float64,
}

impl Datatype {
    /// From its code in a [`PointField`].
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Int8,
            2 => Self::Uint8,
            3 => Self::Int16,
            4 => Self::Uint16,
            5 => Self::Int32,
            6 => Self::Uint32,
            7 => Self::Float32,
            8 => Self::Float64,
            _ => return None,
        })
    }

    /// Size in bytes.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// The number in the first bytes of `bytes`; exact, as each of these types fits into an f64. Missing bytes count
    /// as 0; [`PointCloud2::column`] has checked that there are none.
    #[inline]
    fn read(self, bytes: &[u8], big: bool) -> f64 {
        #[inline]
        fn first<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
            let mut number = bytes.first_chunk().copied().unwrap_or([0; N]);
            if big {
                number.reverse();
            }
            number
        }
        match self {
            Self::Int8 => f64::from(i8::from_le_bytes(first(bytes, big))),
            Self::Uint8 => f64::from(u8::from_le_bytes(first(bytes, big))),
            Self::Int16 => f64::from(i16::from_le_bytes(first(bytes, big))),
            Self::Uint16 => f64::from(u16::from_le_bytes(first(bytes, big))),
            Self::Int32 => f64::from(i32::from_le_bytes(first(bytes, big))),
            Self::Uint32 => f64::from(u32::from_le_bytes(first(bytes, big))),
            Self::Float32 => f64::from(f32::from_le_bytes(first(bytes, big))),
            Self::Float64 => f64::from_le_bytes(first(bytes, big)),
        }
    }
}

/// One field of all points of a cloud, in the cloud's order: row by row.
#[derive(Debug, Clone, Copy)]
pub struct Column<'a> {
    data: &'a [u8],
    datatype: Datatype,
    big: bool,
    width: usize,
    height: usize,
    point_step: usize,
    row_step: usize,
}

impl<'a> Column<'a> {
    /// The type of its numbers in the message.
    #[must_use]
    pub fn datatype(&self) -> Datatype {
        self.datatype
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values, exactly.
    pub fn f64s(&self) -> impl Iterator<Item = f64> + 'a {
        let Self {
            data,
            datatype,
            big,
            width,
            height,
            point_step,
            row_step,
        } = *self;
        (0..height).flat_map(move |row| {
            let row = data.get(row * row_step..).unwrap_or_default();
            (0..width).map(move |point| {
                datatype.read(row.get(point * point_step..).unwrap_or_default(), big)
            })
        })
    }

    /// The values, rounded to the nearest f32 if they are wider.
    pub fn f32s(&self) -> impl Iterator<Item = f32> + 'a {
        self.f64s().map(|number| number as f32)
    }
}

impl PointCloud2<'_> {
    /// Number of points in the cloud.
    ///
    /// # Errors
    /// [`MessageError::Layout`] if its data is too short for them.
    pub fn points(&self) -> Result<usize, MessageError> {
        let (width, height) = (u64::from(self.width), u64::from(self.height));
        if width == 0 || height == 0 {
            return Ok(0);
        }
        let row = width * u64::from(self.point_step);
        let wrong = |problem| MessageError::Layout {
            of: MessagePart::Cloud,
            problem,
        };
        if height > 1 && u64::from(self.row_step) < row {
            return Err(wrong(LayoutProblem::PointRow {
                points: width,
                point_step: self.point_step,
                row_step: self.row_step,
            }));
        }
        // The last row needs no padding after it. Below 2⁶⁴: 2³² rows of 2³² bytes, less the first.
        let needed = u128::from(height - 1) * u128::from(self.row_step) + u128::from(row);
        if self.point_step == 0 || needed > self.data.len() as u128 {
            return Err(wrong(LayoutProblem::Points {
                width,
                height,
                point_step: self.point_step,
                needed,
                left: self.data.len(),
            }));
        }
        // Every point takes at least one byte, so there are fewer points than bytes of data.
        Ok((width * height) as usize)
    }

    /// The field `name` of all points: any datatype, offset, padding and byte order.
    ///
    /// # Errors
    /// [`MessageError::NoField`] naming the available fields, [`MessageError::Datatype`], [`MessageError::Layout`] if
    /// the field lies outside its point or the points outside the data.
    pub fn column(&self, name: &str) -> Result<Column<'_>, MessageError> {
        self.column_at(name, 0)
    }

    /// As [`PointCloud2::column`], for element `element` of a field with several values (`count`).
    ///
    /// # Errors
    /// As [`PointCloud2::column`]; [`MessageError::Layout`] if the field has fewer values.
    pub fn column_at(&self, name: &str, element: u32) -> Result<Column<'_>, MessageError> {
        let field = self.field(name)?;
        let datatype =
            Datatype::from_number(field.datatype).ok_or_else(|| MessageError::Datatype {
                field: name.to_owned(),
                datatype: field.datatype,
            })?;
        let wrong = |problem| MessageError::Layout {
            of: MessagePart::Field(name.to_owned()),
            problem,
        };
        let count = field.count.max(1);
        if element >= count {
            return Err(wrong(LayoutProblem::Element { count, element }));
        }
        let offset = u64::from(field.offset) + u64::from(element) * datatype.size() as u64;
        let end = offset + datatype.size() as u64;
        let points = self.points()?;
        if points > 0 && end > u64::from(self.point_step) {
            return Err(wrong(LayoutProblem::Outside {
                offset,
                end,
                point_step: self.point_step,
            }));
        }
        Ok(Column {
            data: self.data.get(offset as usize..).unwrap_or_default(),
            datatype,
            big: self.is_bigendian,
            width: if points > 0 { self.width as usize } else { 0 },
            height: if points > 0 { self.height as usize } else { 0 },
            point_step: self.point_step as usize,
            row_step: self.row_step as usize,
        })
    }

    fn field(&self, name: &str) -> Result<&PointField, MessageError> {
        let found = self.fields.iter().find(|field| field.name == name);
        found.ok_or_else(|| MessageError::NoField {
            field: name.to_owned(),
            fields: self.fields.iter().map(|field| field.name.clone()).collect(),
        })
    }
}

impl PointCloud2<'static> {
    /// An unordered cloud of f32 fields, packed and little-endian, as LiDAR drivers publish it. `columns` are names and
    /// values, one per point.
    ///
    /// # Errors
    /// [`MessageError::Layout`] for columns of different lengths, or more points than the message's length fields can hold.
    pub fn from_columns(header: Header, columns: &[(&str, &[f32])]) -> Result<Self, MessageError> {
        let points = columns.first().map_or(0, |(_, numbers)| numbers.len());
        let wrong = |name: &str, problem| MessageError::Layout {
            of: MessagePart::Field(name.to_owned()),
            problem,
        };
        if let Some((name, numbers)) = columns.iter().find(|(_, numbers)| numbers.len() != points) {
            return Err(wrong(
                name,
                LayoutProblem::Columns {
                    numbers: numbers.len(),
                    first: columns[0].0.to_owned(),
                    points,
                },
            ));
        }
        let point_step = 4 * columns.len();
        let bytes = u32::try_from(points * point_step)
            .map_err(|_| wrong(columns[0].0, LayoutProblem::TooMany { points, point_step }))?;
        let mut data = Vec::with_capacity(points * point_step);
        for point in 0..points {
            for (_, numbers) in columns {
                data.extend_from_slice(&numbers[point].to_le_bytes());
            }
        }
        let field = |(i, (name, _)): (usize, &(&str, &[f32]))| PointField {
            name: (*name).to_owned(),
            offset: 4 * i as u32,
            datatype: Datatype::Float32 as u8,
            count: 1,
        };
        Ok(Self {
            header,
            height: 1,
            width: points as u32,
            fields: columns.iter().enumerate().map(field).collect(),
            is_bigendian: false,
            point_step: point_step as u32,
            row_step: bytes,
            data: Cow::Owned(data),
            is_dense: columns
                .iter()
                .all(|(_, numbers)| numbers.iter().all(|n| n.is_finite())),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> PointCloud2<'static> {
        let columns: [(&str, &[f32]); 2] =
            [("x", &[1.0, 2.0, 3.0]), ("velocity", &[-0.5, 0.0, 7.25])];
        PointCloud2::from_columns(Header::default(), &columns).unwrap()
    }

    #[test]
    fn columns_are_read_by_name() {
        let velocity: Vec<f32> = cloud().column("velocity").unwrap().f32s().collect();
        assert_eq!(velocity, [-0.5, 0.0, 7.25]);
        let error = cloud().column("Velocity").unwrap_err().to_string();
        assert!(
            error.contains("Velocity") && error.contains("x, velocity"),
            "{error}"
        );
    }

    #[test]
    fn wrong_layouts_are_errors() {
        let broken = |change: fn(&mut PointCloud2<'_>)| {
            let mut cloud = cloud();
            change(&mut cloud);
            cloud
                .column("velocity")
                .map(|column| column.f64s().count())
                .unwrap_err()
                .to_string()
        };
        assert!(broken(|c| c.width = 4).contains("need 32 bytes, there are 24"));
        assert!(broken(|c| (c.height, c.width) = (u32::MAX, u32::MAX)).contains("fit"));
        assert!(broken(|c| c.point_step = 0).contains("0 bytes"));
        assert!(broken(|c| (c.height, c.row_step) = (2, 8)).contains("do not fit into a row of 8"));
        assert!(broken(|c| c.fields[1].offset = 5).contains("bytes 5 to 9 of a point of 8"));
        assert!(broken(|c| c.fields[1].offset = u32::MAX).contains("velocity"));
        assert!(broken(|c| c.fields[1].datatype = 9).contains("datatype 9"));
        assert!(
            cloud()
                .column_at("x", 1)
                .unwrap_err()
                .to_string()
                .contains("1 number,")
        );
    }

    #[test]
    fn rows_may_be_padded_and_a_cloud_empty() {
        // Two rows of one point, with 4 bytes of padding after the first.
        let mut cloud = cloud();
        (cloud.height, cloud.width, cloud.row_step) = (2, 1, 16);
        assert_eq!(
            cloud.column("x").unwrap().f64s().collect::<Vec<_>>(),
            [1.0, 3.0]
        );
        (cloud.height, cloud.data) = (0, Cow::Owned(Vec::new()));
        assert_eq!(cloud.column("x").unwrap().f64s().count(), 0);
        assert!(cloud.column("x").unwrap().is_empty());
    }
}
