//! What a device can be used for, from the checks of all operations.

use super::{NeededBy, OperationCheck};

/// The checks of a device.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DeviceCheck {
    /// Its operations, each compared with the processor.
    pub operations: Vec<OperationCheck>,
}

/// What a device can be used for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DeviceUse {
    /// Nothing: its depth would differ from the trained network's.
    Nothing,
    /// Prediction only: its gradients or losses are unreliable.
    Prediction,
    /// Prediction and training, except for these; everything if the list is empty.
    TrainingWithout(Vec<NeededBy>),
}

/// What training can do without, in the order in which it is listed.
const OPTIONAL: [NeededBy; 7] = [
    NeededBy::Flow,
    NeededBy::Affine,
    NeededBy::MixedPrecision,
    NeededBy::Depth,
    NeededBy::LiteMono,
    NeededBy::RMsfm,
    NeededBy::DispNet,
];

impl DeviceCheck {
    /// Whether every operation needed for `needs` equals the processor's, forward and backward.
    #[must_use]
    pub fn is_right(&self, needs: NeededBy) -> bool {
        self.of(needs).all(OperationCheck::is_right)
    }

    /// Whether the ResNet presets predict the same depth as on the processor.
    #[must_use]
    pub fn predicts(&self) -> bool {
        self.of(NeededBy::Network)
            .all(OperationCheck::forward_is_right)
    }

    /// Whether the ResNet presets learn from video as on the processor.
    #[must_use]
    pub fn trains(&self) -> bool {
        [NeededBy::Network, NeededBy::Views, NeededBy::Learning]
            .into_iter()
            .all(|needs| self.is_right(needs))
    }

    /// What the device can be used for.
    #[must_use]
    pub fn usable_for(&self) -> DeviceUse {
        if !self.predicts() {
            return DeviceUse::Nothing;
        }
        if !self.trains() {
            return DeviceUse::Prediction;
        }
        let wrong = OPTIONAL.into_iter().filter(|needs| !self.is_right(*needs));
        DeviceUse::TrainingWithout(wrong.collect())
    }

    /// Number of operations that differ from the processor's or failed.
    #[must_use]
    pub fn wrong(&self) -> usize {
        let operations = self.operations.iter();
        operations.filter(|check| !check.is_right()).count()
    }

    /// The operations needed for `needs`.
    fn of(&self, needs: NeededBy) -> impl Iterator<Item = &OperationCheck> {
        let operations = self.operations.iter();
        operations.filter(move |check| check.needed_by == needs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Operations that are right, except for one that is wrong in its result (`forward`) or only in its gradients.
    fn check(wrong: NeededBy, forward: bool) -> DeviceCheck {
        checks(&[(wrong, forward)])
    }

    /// As [`check`], with several wrong operations.
    fn checks(wrong: &[(NeededBy, bool)]) -> DeviceCheck {
        let needed = [
            NeededBy::Network,
            NeededBy::Views,
            NeededBy::Learning,
            NeededBy::Flow,
            NeededBy::Affine,
            NeededBy::MixedPrecision,
        ];
        let operation = |needed_by| {
            let wrong = wrong.iter().find(|(needs, _)| *needs == needed_by);
            let off = |is_off: bool| if is_off { 0.1 } else { 0.0 };
            OperationCheck {
                operation: "any",
                needed_by,
                forward: off(wrong.is_some_and(|(_, forward)| *forward)),
                backward: Some(off(wrong.is_some())),
                failure: None,
            }
        };
        DeviceCheck {
            operations: needed.map(operation).to_vec(),
        }
    }

    #[test]
    fn one_wrong_operation_limits_the_use_of_a_device() {
        for (wrong, forward, predicts, trains) in [
            (NeededBy::Network, true, false, false),
            (NeededBy::Network, false, true, false),
            (NeededBy::Views, true, true, false),
            (NeededBy::Learning, false, true, false),
            (NeededBy::Flow, true, true, true),
            // R-MSFM uses none of these operations.
            (NeededBy::RMsfm, true, true, true),
        ] {
            let found = check(wrong, forward);
            assert_eq!((found.predicts(), found.trains()), (predicts, trains));
            let all_right = wrong == NeededBy::RMsfm;
            assert_eq!(found.is_right(wrong), all_right);
            assert_eq!(found.wrong(), usize::from(!all_right));
        }
    }

    #[test]
    fn optional_parts_with_wrong_operations_are_left_out() {
        let of = |wrong: &[(NeededBy, bool)]| checks(wrong).usable_for();
        let without = |parts: &[NeededBy]| DeviceUse::TrainingWithout(parts.to_vec());
        assert_eq!(of(&[(NeededBy::Network, true)]), DeviceUse::Nothing);
        assert_eq!(of(&[(NeededBy::Network, false)]), DeviceUse::Prediction);
        assert_eq!(of(&[(NeededBy::Views, true)]), DeviceUse::Prediction);
        assert_eq!(
            of(&[(NeededBy::Affine, false), (NeededBy::Flow, true)]),
            without(&[NeededBy::Flow, NeededBy::Affine])
        );
        let mixed = NeededBy::MixedPrecision;
        assert_eq!(of(&[(mixed, true)]), without(&[mixed]));
        assert_eq!(of(&[]), without(&[]));
    }
}
