//! Encodes records; [`record`](crate::record) reads them.

use crate::Time;
use crate::op;

/// The bag header takes 4 KiB with its padding, so that it can be rewritten with the position of the index.
const BAG_HEADER_BYTES: usize = 4096;

/// The version of chunk information and index data.
pub(crate) const VERSION: [u8; 4] = 1_u32.to_le_bytes();

pub(crate) fn bag_header(index_pos: u64, connections: u32, chunks: u32) -> Vec<u8> {
    let (index_pos, counts) = (
        index_pos.to_le_bytes(),
        [connections, chunks].map(u32::to_le_bytes),
    );
    let fields: [(&str, &[u8]); 3] = [
        ("index_pos", &index_pos),
        ("conn_count", &counts[0]),
        ("chunk_count", &counts[1]),
    ];
    let mut bytes = Vec::new();
    record(&mut bytes, op::BAG_HEADER, &fields, &[]);
    let padding = BAG_HEADER_BYTES - bytes.len();
    bytes.clear();
    record(&mut bytes, op::BAG_HEADER, &fields, &vec![b' '; padding]);
    bytes
}

pub(crate) fn record(out: &mut Vec<u8>, op: u8, fields: &[(&str, &[u8])], data: &[u8]) {
    record_header(out, op, fields, data.len());
    out.extend_from_slice(data);
}

pub(crate) fn record_header(out: &mut Vec<u8>, op: u8, fields: &[(&str, &[u8])], data_len: usize) {
    let start = out.len();
    out.extend_from_slice(&[0; 4]);
    field(out, "op", &[op]);
    for (name, value) in fields {
        field(out, name, value);
    }
    let length = (out.len() - start - 4) as u32;
    out[start..start + 4].copy_from_slice(&length.to_le_bytes());
    out.extend_from_slice(&(data_len as u32).to_le_bytes());
}

pub(crate) fn field(out: &mut Vec<u8>, name: &str, value: &[u8]) {
    let length = (name.len() + 1 + value.len()) as u32;
    out.extend_from_slice(&length.to_le_bytes());
    out.extend_from_slice(name.as_bytes());
    out.push(b'=');
    out.extend_from_slice(value);
}

pub(crate) fn time_bytes(time: Time) -> [u8; 8] {
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&time.sec.to_le_bytes());
    bytes[4..].copy_from_slice(&time.nsec.to_le_bytes());
    bytes
}

pub(crate) fn entry(time: Time, offset: u32) -> [u8; 12] {
    let mut bytes = [0; 12];
    bytes[..8].copy_from_slice(&time_bytes(time));
    bytes[8..].copy_from_slice(&offset.to_le_bytes());
    bytes
}
