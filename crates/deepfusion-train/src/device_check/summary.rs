//! What a device is good for, by all of its operations together.

use super::{NeededBy, OperationCheck};

/// What was found of a device.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DeviceCheck {
    /// Its operations, each beside the same on the processor.
    pub operations: Vec<OperationCheck>,
}

impl DeviceCheck {
    /// Whether every operation that something needs is the processor's, forward and backward.
    #[must_use]
    pub fn is_right(&self, needs: NeededBy) -> bool {
        self.of(needs).all(OperationCheck::is_right)
    }

    /// Whether the ResNet presets' depth is the processor's.
    #[must_use]
    pub fn predicts(&self) -> bool {
        self.of(NeededBy::Network)
            .all(OperationCheck::forward_is_right)
    }

    /// Whether they learn from video as on the processor.
    #[must_use]
    pub fn trains(&self) -> bool {
        [NeededBy::Network, NeededBy::Views, NeededBy::Learning]
            .into_iter()
            .all(|needs| self.is_right(needs))
    }

    /// How many operations are not the processor's, or failed.
    #[must_use]
    pub fn wrong(&self) -> usize {
        let operations = self.operations.iter();
        operations.filter(|check| !check.is_right()).count()
    }

    /// The operations that something needs.
    fn of(&self, needs: NeededBy) -> impl Iterator<Item = &OperationCheck> {
        let operations = self.operations.iter();
        operations.filter(move |check| check.needed_by == needs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Operations that are right, and one that is wrong in its result or in its gradients alone.
    fn check(wrong: NeededBy, forward: bool) -> DeviceCheck {
        let needed = [
            NeededBy::Network,
            NeededBy::Views,
            NeededBy::Learning,
            NeededBy::Flow,
        ];
        let operation = |needed_by| OperationCheck {
            operation: "any",
            needed_by,
            forward: if needed_by == wrong && forward {
                0.1
            } else {
                0.0
            },
            backward: Some(if needed_by == wrong { 0.1 } else { 0.0 }),
            failure: None,
        };
        DeviceCheck {
            operations: needed.map(operation).to_vec(),
        }
    }

    #[test]
    fn what_a_device_is_good_for_follows_from_what_is_wrong() {
        for (wrong, forward, predicts, trains) in [
            (NeededBy::Network, true, false, false),
            (NeededBy::Network, false, true, false),
            (NeededBy::Views, true, true, false),
            (NeededBy::Learning, false, true, false),
            (NeededBy::Flow, true, true, true),
            // None of these operations is one of R-MSFM's.
            (NeededBy::RMsfm, true, true, true),
        ] {
            let found = check(wrong, forward);
            assert_eq!((found.predicts(), found.trains()), (predicts, trains));
            let all_right = wrong == NeededBy::RMsfm;
            assert_eq!(found.is_right(wrong), all_right);
            assert_eq!(found.wrong(), usize::from(!all_right));
        }
    }
}
