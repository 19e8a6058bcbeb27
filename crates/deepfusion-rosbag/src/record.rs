//! The format's one building block: `<header length><header><data length><data>`, the header being fields
//! `<length><name>=<value>`; all lengths are little-endian u32. <http://wiki.ros.org/Bags/Format/2.0>

use crate::problem::{BagProblem, Fault, RecordPart, RecordProblem};
use crate::{Time, op};

/// A record as it is stored in `bytes`; nothing is copied or allocated, whatever its lengths claim.
#[derive(Clone, Copy)]
pub(crate) struct Record<'a> {
    /// Position of the record.
    pub at: usize,
    pub fields: Fields<'a>,
    /// Position of its data.
    pub data_at: usize,
    /// The stated length of its data; [`Record::read`] has checked it, [`Record::read_header`] has not.
    pub data_len: usize,
    pub data: &'a [u8],
}

impl<'a> Record<'a> {
    /// Reads the complete record at `at`.
    pub(crate) fn read(bytes: &'a [u8], at: usize) -> Result<Self, Fault> {
        let record = Self::read_header(bytes, at)?;
        if record.data.len() < record.data_len {
            return Err(record.fault(RecordProblem::DataCut {
                stated: record.data_len,
                left: record.data.len(),
            }));
        }
        Ok(record)
    }

    /// Reads the record at `at`, with the part of its data that exists.
    pub(crate) fn read_header(bytes: &'a [u8], at: usize) -> Result<Self, Fault> {
        let cut = |part| {
            let bytes = bytes.len();
            Fault::new(at, RecordProblem::BeyondEnd { part, bytes })
        };
        let header_len = u32_at(bytes, at).ok_or_else(|| cut(RecordPart::HeaderLength))? as usize;
        let header_at = at + 4;
        let header = bytes
            .get(header_at..)
            .and_then(|rest| rest.get(..header_len))
            .ok_or_else(|| cut(RecordPart::Header { bytes: header_len }))?;
        let length_at = header_at + header_len;
        let data_len =
            u32_at(bytes, length_at).ok_or_else(|| cut(RecordPart::DataLength))? as usize;
        let data_at = length_at + 4;
        let left = bytes.len() - data_at;
        Ok(Self {
            at,
            fields: Fields(header),
            data_at,
            data_len,
            data: &bytes[data_at..data_at + data_len.min(left)],
        })
    }

    /// Position of the next record.
    pub(crate) fn end(&self) -> usize {
        self.data_at + self.data.len()
    }

    /// A fault of this record.
    pub(crate) fn fault(&self, problem: impl Into<BagProblem>) -> Fault {
        Fault::new(self.at, problem)
    }

    pub(crate) fn op(&self) -> Option<u8> {
        match self.fields.get("op") {
            Some(&[op]) => Some(op),
            _ => None,
        }
    }

    pub(crate) fn expect_op(&self, expected: u8) -> Result<(), Fault> {
        match self.op() {
            Some(found) if found == expected => Ok(()),
            found => Err(self.fault(RecordProblem::Kind { expected, found })),
        }
    }

    pub(crate) fn u32(&self, name: &'static str) -> Result<u32, Fault> {
        self.fixed(name).map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&self, name: &'static str) -> Result<u64, Fault> {
        self.fixed(name).map(u64::from_le_bytes)
    }

    pub(crate) fn time(&self, name: &'static str) -> Result<Time, Fault> {
        self.fixed(name).map(time)
    }

    pub(crate) fn text(&self, name: &'static str) -> Result<String, Fault> {
        let value = self.fields.get(name).ok_or_else(|| self.missing(name))?;
        Ok(String::from_utf8_lossy(value).into_owned())
    }

    fn fixed<const N: usize>(&self, name: &'static str) -> Result<[u8; N], Fault> {
        let value = self.fields.get(name).ok_or_else(|| self.missing(name))?;
        value.try_into().map_err(|_| {
            self.fault(RecordProblem::FieldLength {
                field: name,
                bytes: value.len(),
                expected: N,
            })
        })
    }

    fn missing(&self, name: &'static str) -> Fault {
        self.fault(RecordProblem::NoField { field: name })
    }

    /// Connection and time of a message's record, in one pass over its fields: this runs for every message.
    #[inline]
    pub(crate) fn message(&self) -> Result<(u32, Time), Fault> {
        let (mut op, mut connection, mut stamp) = (None, None, None);
        for (name, value) in self.fields {
            match name {
                b"op" => op = value.first(),
                b"conn" => connection = value.try_into().ok().map(u32::from_le_bytes),
                b"time" => stamp = value.try_into().ok().map(time),
                _ => {}
            }
        }
        match (op, connection, stamp) {
            (Some(&op::MESSAGE), Some(connection), Some(stamp)) => Ok((connection, stamp)),
            _ => Err(self.fault(RecordProblem::NoMessage)),
        }
    }
}

/// The fields of a header: an iterator over names and values that ends at the first invalid field.
#[derive(Clone, Copy)]
pub(crate) struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// The value of the first field called `name`.
    pub(crate) fn get(mut self, name: &str) -> Option<&'a [u8]> {
        self.find(|(found, _)| *found == name.as_bytes())
            .map(|(_, value)| value)
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = (&'a [u8], &'a [u8]);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let (length, rest) = self.0.split_first_chunk()?;
        let (field, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        // A value may contain the separator, a name may not.
        let equals = field.iter().position(|&byte| byte == b'=')?;
        self.0 = rest;
        Some((&field[..equals], &field[equals + 1..]))
    }
}

/// The u32 at `at`, if there are four bytes.
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_le_bytes(*four))
}

/// Seconds and nanoseconds, as times are written.
pub(crate) fn time(bytes: [u8; 8]) -> Time {
    let [a, b, c, d, e, f, g, h] = bytes;
    Time {
        sec: u32::from_le_bytes([a, b, c, d]),
        nsec: u32::from_le_bytes([e, f, g, h]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(name: &str, value: &[u8]) -> Vec<u8> {
        let length = (name.len() + 1 + value.len()) as u32;
        [&length.to_le_bytes(), name.as_bytes(), b"=", value].concat()
    }

    fn record(header: &[u8], data: &[u8]) -> Vec<u8> {
        let lengths = [header.len() as u32, data.len() as u32].map(u32::to_le_bytes);
        [&lengths[0], header, &lengths[1], data].concat()
    }

    #[test]
    fn fields_are_found_by_name_and_values_may_hold_the_separator() {
        let header = [field("topic", b"/a=b"), field("op", &[7])].concat();
        let bytes = record(&header, b"xyz");
        let record = Record::read(&bytes, 0).unwrap();
        assert_eq!(record.text("topic").unwrap(), "/a=b");
        assert_eq!(record.op(), Some(7));
        assert_eq!(record.data, b"xyz");
        assert_eq!(record.end(), bytes.len());
        let missing = record.u32("conn").unwrap_err();
        let problem = RecordProblem::NoField { field: "conn" };
        assert_eq!(missing.problem, problem.into());
        assert_eq!(missing.problem.to_string(), "field conn is missing");
    }

    #[test]
    fn wrong_lengths_are_faults() {
        let sound = record(&field("op", &[5]), b"data");
        for (at, what) in [(0, "header"), (4, "op"), (12, "data")] {
            let mut bytes = sound.clone();
            bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            match Record::read(&bytes, 0) {
                // A field with a wrong length ends the fields; the record around it can still be read.
                Ok(record) => assert!(at == 4 && record.op().is_none()),
                Err(fault) => assert!(fault.problem.to_string().contains(what), "{fault:?}"),
            }
        }
        assert!(Record::read(&sound, sound.len()).is_err());
        assert!(Record::read(&sound, usize::MAX).is_err());
    }
}
