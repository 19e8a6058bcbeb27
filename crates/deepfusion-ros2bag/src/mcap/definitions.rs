//! Schemas and channels: the definitions of messages.

use super::record::{Fields, op};
use crate::storage::Channel;
use std::collections::HashMap;

/// Schemas and channels, collected from all parts of the file.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    /// Type and definition by number.
    schemas: HashMap<u16, (String, String)>,
    pub channels: Vec<Channel>,
    pub places: HashMap<u16, usize>,
}

impl Definitions {
    /// How many schemas there are.
    pub(super) fn schemas(&self) -> usize {
        self.schemas.len()
    }

    /// Adds a record; `None` if it is malformed. The first channel with a number counts.
    pub(super) fn add(&mut self, op: u8, content: &[u8]) -> Option<()> {
        let mut fields = Fields(content);
        let id = fields.u16()?;
        if op == op::SCHEMA {
            let (name, _encoding, text) = (fields.text()?, fields.text()?, fields.text()?);
            self.schemas.insert(id, (name, text));
            return Some(());
        }
        let schema = fields.u16()?;
        let (topic, encoding) = (fields.text()?, fields.text()?);
        if !self.places.contains_key(&id) {
            let none = (String::new(), String::new());
            let (name, definition) = self.schemas.get(&schema).unwrap_or(&none);
            self.places.insert(id, self.channels.len());
            let channel = Channel::new(u32::from(id), topic, name, &encoding, definition.clone());
            self.channels.push(channel);
        }
        Some(())
    }
}
