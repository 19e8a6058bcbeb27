//! Identifies the machine: on a shared file system, one machine may not see what another has locked.

use std::fs;

/// A machine from one start to the next: its name, and a random number drawn at each start. Empty if the system does not provide them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Machine {
    name: String,
    boot: String,
}

impl Machine {
    /// The machine that this process runs on.
    pub(crate) fn this() -> Self {
        let content = |path: &str| {
            let text = fs::read_to_string(path).unwrap_or_default();
            text.trim().to_owned()
        };
        let mut name = content("/proc/sys/kernel/hostname");
        if name.is_empty() {
            // Windows has the name there.
            name = std::env::var("COMPUTERNAME").unwrap_or_default();
        }
        Self {
            name,
            boot: content("/proc/sys/kernel/random/boot_id"),
        }
    }

    /// The text form: one line for each field.
    pub(crate) fn to_text(&self) -> String {
        format!("{}\n{}\n", self.name, self.boot)
    }

    /// Reads [`Self::to_text`]; `None` if the text is incomplete.
    pub(crate) fn from_text(text: &str) -> Option<Self> {
        let mut lines = text.split_terminator('\n').map(str::to_owned);
        Some(Self {
            name: lines.next()?,
            boot: lines.next()?,
        })
    }

    /// Whether locks held by living processes of `other` are visible on this machine. They are if both run under one kernel, as containers
    /// do, or if `other` is this machine before a restart, whose processes have ended.
    pub(crate) fn sees_locks_of(&self, other: &Self) -> bool {
        let same_start = !self.boot.is_empty() && self.boot == other.boot;
        let same_name = is_own_name(&self.name) && self.name == other.name;
        same_start || same_name || self == other
    }
}

/// Whether a name distinguishes a machine from others.
fn is_own_name(name: &str) -> bool {
    !name.is_empty() && !name.starts_with("localhost") && name != "(none)"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(name: &str, boot: &str) -> Machine {
        Machine {
            name: name.to_owned(),
            boot: boot.to_owned(),
        }
    }

    #[test]
    fn a_machine_is_identified_by_its_start_or_its_name() {
        let this = machine("a", "1");
        for (other, expected) in [
            (machine("a", "1"), true),
            (machine("a", "2"), true),
            (machine("container", "1"), true),
            (machine("b", "2"), false),
            (machine("", ""), false),
            (machine("a", ""), true),
        ] {
            assert_eq!(this.sees_locks_of(&other), expected, "{other:?}");
        }
        // Nothing is known, and a name that many machines have.
        assert!(machine("", "").sees_locks_of(&machine("", "")));
        assert!(!machine("", "").sees_locks_of(&this));
        assert!(!machine("localhost", "1").sees_locks_of(&machine("localhost", "2")));
    }

    #[test]
    fn a_machine_is_read_back_from_its_text() {
        for machine in [Machine::this(), machine("a", "1"), machine("", "")] {
            let text = machine.to_text();
            assert_eq!(Machine::from_text(&text), Some(machine));
        }
        for cut in ["", "a\n", "a"] {
            assert_eq!(Machine::from_text(cut), None, "{cut:?}");
        }
    }
}
