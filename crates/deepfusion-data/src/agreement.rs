//! A topic of dynamic points against radial velocities.

/// How many points of some scans move by a topic of dynamic points, by their radial velocities, and by both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DynamicAgreement {
    /// Scans compared.
    pub scans: usize,
    /// Points that the topic lists.
    pub listed: usize,
    /// Of these, points of the scan: the same place, up to 1 cm.
    pub in_scan: usize,
    /// Points of the scans that move by their radial velocity.
    pub fast: usize,
    /// Points that move by both.
    pub both: usize,
}

impl DynamicAgreement {
    /// Share of the listed points that move by their radial velocity too; NaN where none is listed.
    #[must_use]
    pub fn precision(&self) -> f64 {
        self.both as f64 / self.listed as f64
    }

    /// Share of the points that move by their radial velocity that are listed too; NaN where none moves.
    #[must_use]
    pub fn recall(&self) -> f64 {
        self.both as f64 / self.fast as f64
    }
}
