//! The verdict as text for people.

use std::fmt;

use super::{
    Check, Evidence, NoCertificate, ScaleCertificate, ScaleVerdict, SourceName, SpeedRow,
    TOLERANCE, Verdict,
};
use deepfusion_hint::count_of;

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = count_of(self.without_truth.frames, "frame");
        writeln!(f, "without ground truth ({frames})")?;
        match (&self.scale_certificate, &self.no_certificate) {
            (Some(certificate), _) => write!(f, "{certificate}")?,
            (None, Some(why)) => writeln!(f, "  scale           no certificate: {why}")?,
            (None, None) => {}
        }
        write!(f, "{}", self.without_truth)
    }
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(r) = &self.reprojection {
            let share = 100.0 * (1.0 - r.warped / r.unwarped);
            writeln!(
                f,
                "  reprojection    {:.4}, unwarped {:.4} ({share:.0} % explained), {}",
                r.warped,
                r.unwarped,
                count_of(r.pairs, "pair")
            )?;
        }
        if let Some(consistency) = self.consistency {
            let percent = 100.0 * consistency;
            writeln!(f, "  frame to frame  depths differ by {percent:.1} %")?;
        }
        if let Some(flip) = self.flip {
            writeln!(
                f,
                "  mirrored        depths differ by {:.1} %",
                100.0 * flip
            )?;
        }
        if !self.ranges.is_empty() {
            writeln!(f, "\n  predicted depth   points  scale")?;
            for row in &self.ranges {
                writeln!(
                    f,
                    "  {:>4} to {:>3} m     {:>6}  {:.3}",
                    row.from_m, row.to_m, row.n, row.scale
                )?;
            }
        }
        let ranges = self.speed_ranges();
        if !ranges.is_empty() {
            let others = [
                ("from the road", &self.road_speeds),
                ("from PoseNet", &self.pose_speeds),
            ];
            let others: Vec<_> = others
                .into_iter()
                .filter(|(_, rows)| !rows.is_empty())
                .collect();
            write!(f, "\n  vehicle's speed   pairs  from depth")?;
            others
                .iter()
                .try_for_each(|(name, _)| write!(f, "  {name}"))?;
            writeln!(f)?;
            for (from_mps, to_mps) in ranges {
                let of = |rows: &[SpeedRow]| {
                    let row = rows.iter().find(|row| row.from_mps == from_mps);
                    row.map_or("–".to_owned(), |row| format!("× {:.3}", row.ratio))
                };
                let pairs = self.speeds.iter().find(|row| row.from_mps == from_mps);
                let pairs = pairs.map_or("–".to_owned(), |row| row.n.to_string());
                let to = to_mps.map_or("  up".to_owned(), |to| format!("{to:>4}"));
                let depth = of(&self.speeds);
                let mut line = format!("  {from_mps:>2} to {to} m/s    {pairs:>5}  {depth:<10}");
                for (name, rows) in &others {
                    line += &format!("  {:<width$}", of(rows), width = name.len());
                }
                writeln!(f, "{}", line.trim_end())?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for ScaleCertificate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match (self.verdict, self.ci95) {
            (ScaleVerdict::Open, None) => "open: too little road for an interval".to_owned(),
            (verdict, _) => verdict.to_string(),
        };
        let between = match self.scale_ci95 {
            Some([low, high]) => format!(" ({low:.3} to {high:.3}, 95 %)"),
            None => String::new(),
        };
        writeln!(
            f,
            "  scale           {:.3}{between}, {verdict}; {}, {}",
            self.scale,
            count_of(self.blocks, "block"),
            count_of(self.points, "point")
        )?;
        let sources: Vec<String> = self
            .sources
            .iter()
            .map(|source| format!("{} {:.1} %", source.name, 100.0 * source.sd))
            .collect();
        writeln!(f, "  its errors      {} (1 σ)", sources.join(", "))
    }
}

impl fmt::Display for ScaleVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * TOLERANCE;
        match self {
            Self::Trusted => write!(f, "trusted: within {percent:.0} %"),
            Self::Open => f.write_str("open: the interval is too wide to tell"),
            Self::Wrong => write!(f, "wrong: off by more than {percent:.0} %"),
        }
    }
}

impl fmt::Display for SourceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Blocks => "differences along the way",
            Self::Ranges => "near against far",
            Self::Speed => "the speed itself, as given",
        })
    }
}

impl fmt::Display for NoCertificate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::MotionUnknown => "the recordings do not contain speed and turns",
            Self::NoMovement => "the camera hardly moves between frames",
            Self::AllSeen => "training saw all of these frames: evaluate on another drive",
            Self::SeenNotKnown => "it is not known whether training saw these frames",
            Self::FewPoints => "the scene has too few points that can be tracked",
        })
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reprojection => "reprojection error",
            Self::Consistency => "depth against the frame before",
            Self::Flip => "depth against the mirrored image",
            Self::Scale => "scale bias",
        })
    }
}
