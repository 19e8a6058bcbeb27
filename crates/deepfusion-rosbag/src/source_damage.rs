//! The part of a recording that cannot be read, in any format.

use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// The damage that a reader found: [`Damage`](crate::Damage) for a ROS 1 bag, a type of its own crate for
/// any other format. Two are equal if their messages are.
#[derive(Debug, Clone)]
pub struct SourceDamage(Arc<dyn Error + Send + Sync>);

impl SourceDamage {
    /// Wraps the damage that a reader found.
    pub fn new(found: impl Error + Send + Sync + 'static) -> Self {
        Self(Arc::new(found))
    }

    /// The reader's damage, if it is of that type.
    #[must_use]
    pub fn downcast_ref<T: Error + 'static>(&self) -> Option<&T> {
        self.0.downcast_ref()
    }
}

impl PartialEq for SourceDamage {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_string() == other.0.to_string()
    }
}

impl Eq for SourceDamage {}

impl fmt::Display for SourceDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&*self.0, f)
    }
}

impl Error for SourceDamage {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Damage, ScanReason};

    #[test]
    fn damage_keeps_its_type_message_and_equality() {
        let at = |offset| Damage {
            offset,
            reason: ScanReason::NoIndex,
            problem: None,
            chunks_lost: None,
            messages_without_connection: 0,
        };
        let found = SourceDamage::new(at(7));
        assert_eq!(found.downcast_ref::<Damage>(), Some(&at(7)));
        assert!(found.downcast_ref::<std::io::Error>().is_none());
        assert_eq!(found.to_string(), at(7).to_string());
        assert_eq!(found, SourceDamage::new(at(7)));
        assert_ne!(found, SourceDamage::new(at(8)));
    }
}
