use std::collections::HashSet;

/// Names for outputs of which no two are the same, not even to a file system for which `A` is `a`.
#[derive(Debug, Default)]
pub(crate) struct UniqueNames {
    lowercase: HashSet<String>,
}

impl UniqueNames {
    /// This name, with a number where it is taken: `a`, `a-2`, `a-3`.
    pub(crate) fn take(&mut self, name: &str) -> String {
        self.take_if(name, |_| true)
    }

    /// The same, among the names that `free` allows in small letters.
    pub(crate) fn take_if(&mut self, name: &str, free: impl Fn(&str) -> bool) -> String {
        let mut candidate = name.to_owned();
        let mut number = 1;
        loop {
            let lowercase = candidate.to_lowercase();
            if free(&lowercase) && self.lowercase.insert(lowercase) {
                return candidate;
            }
            number += 1;
            candidate = format!("{name}-{number}");
        }
    }
}
