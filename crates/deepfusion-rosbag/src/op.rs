//! The kinds of records: values of their field `op`.

pub(crate) const MESSAGE: u8 = 2;
pub(crate) const BAG_HEADER: u8 = 3;
pub(crate) const INDEX_DATA: u8 = 4;
pub(crate) const CHUNK: u8 = 5;
pub(crate) const CHUNK_INFO: u8 = 6;
pub(crate) const CONNECTION: u8 = 7;

/// Name of a kind of record, for messages about what was expected.
pub(crate) fn name_of(op: u8) -> &'static str {
    match op {
        BAG_HEADER => "the bag header",
        INDEX_DATA => "index data of the chunk",
        CHUNK => "a chunk",
        CHUNK_INFO => "a chunk's entry of the index",
        CONNECTION => "a connection of the index",
        _ => "a message",
    }
}
