//! The schedule of worlds over views.

/// Views take turns over `worlds` slots, so that this many consecutive views are of different worlds. The world of a slot is replaced after
/// `views` views. Replacements are spread evenly over time, so that two worlds never have to be built at once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Schedule {
    worlds: u64,
    views: u64,
}

/// A view of a world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ScheduledView {
    /// Number of the world, from 0.
    pub world: u64,
    /// Number of the view within its world.
    pub view: u64,
}

impl Schedule {
    /// A schedule with `worlds` at a time and `views` of each, both at least 1.
    pub(super) fn new(worlds: usize, views: usize) -> Self {
        Self {
            worlds: (worlds as u64).max(1),
            views: (views as u64).max(1),
        }
    }

    /// The world and the view at an index.
    pub(super) fn view_at(&self, index: u64) -> ScheduledView {
        let (slot, round) = (index % self.worlds, index / self.worlds);
        let shifted = round + slot * self.views / self.worlds;
        ScheduledView {
            world: shifted / self.views * self.worlds + slot,
            view: shifted % self.views,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{HashMap, HashSet};

    #[test]
    fn neighbours_have_different_worlds_and_each_world_has_all_its_views() {
        let schedule = Schedule::new(16, 24);
        let turns: Vec<ScheduledView> = (0..16 * 24 * 5).map(|i| schedule.view_at(i)).collect();
        for window in turns.windows(16) {
            let worlds: HashSet<u64> = window.iter().map(|t| t.world).collect();
            assert_eq!(worlds.len(), 16);
        }
        let mut seen: HashMap<u64, Vec<u64>> = HashMap::new();
        for view in &turns {
            seen.entry(view.world).or_default().push(view.view);
        }
        let complete = seen.values().filter(|views| views.len() == 24).count();
        assert!(complete >= 16 * 4);
        for views in seen.values() {
            let distinct: HashSet<&u64> = views.iter().collect();
            assert_eq!(distinct.len(), views.len());
        }
    }

    #[test]
    fn worlds_are_replaced_one_at_a_time() {
        let schedule = Schedule::new(16, 24);
        let mut known: HashSet<u64> = (0..64).map(|i| schedule.view_at(i).world).collect();
        for start in (64..64 + 16 * 48).step_by(16) {
            let new = (start..start + 16)
                .filter(|i| known.insert(schedule.view_at(*i).world))
                .count();
            assert!(new <= 1, "{new} new worlds from view {start}");
        }
    }
}
