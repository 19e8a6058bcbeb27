//! What to do about how the pictures look.

use std::fmt;

/// What to do about how the pictures look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PicturesRemedy {
    /// Pictures that hardly change.
    FurtherApart,
    /// A brightness that jumps.
    FixExposure,
    /// Dark pictures.
    ExposeLonger,
    /// Overexposed pictures.
    ExposeShorter,
    /// Pictures without the finest detail.
    Focus,
    /// Blurred pictures among sharp ones.
    HoldStill,
    /// The vehicle's own part at the bottom.
    CutBottom {
        /// The last row that is kept, from 0.
        last_row: u32,
    },
    /// The vehicle's own part at the top.
    CutTop {
        /// How many rows are cut off.
        rows: u32,
    },
    /// The vehicle's own part at the left.
    CutLeft {
        /// How many columns are cut off.
        columns: u32,
    },
    /// The vehicle's own part at the right.
    CutRight {
        /// The last column that is kept, from 0.
        last_column: u32,
    },
}

impl fmt::Display for PicturesRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FurtherApart => f.write_str(
                "take frames further apart (frames = [3], or frame_distance_m = 0.2, in the training's configuration), or drives at more speed",
            ),
            Self::FixExposure => f.write_str(
                "fix the camera's exposure and gain, or let them change slowly; record anew",
            ),
            Self::ExposeLonger => f.write_str("expose longer, or leave the darkest drives out"),
            Self::ExposeShorter => f.write_str("expose shorter"),
            Self::Focus => f.write_str(
                "focus the lens, clean the windscreen, expose shorter; enlarged pictures train as well at half their size",
            ),
            Self::HoldStill => {
                f.write_str("expose shorter, fix the mount, or leave these frames out")
            }
            Self::CutBottom { last_row } => write!(f, "cut them off: keep rows 0 to {last_row}"),
            Self::CutTop { rows } => write!(
                f,
                "cut them off: keep rows from {rows}, and subtract {rows} from cy"
            ),
            Self::CutLeft { columns } => write!(
                f,
                "cut them off: keep columns from {columns}, and subtract {columns} from cx"
            ),
            Self::CutRight { last_column } => {
                write!(f, "cut them off: keep columns 0 to {last_column}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_to_cut_off_is_said() {
        for (remedy, said) in [
            (
                PicturesRemedy::CutBottom { last_row: 81 },
                "cut them off: keep rows 0 to 81",
            ),
            (
                PicturesRemedy::CutTop { rows: 12 },
                "cut them off: keep rows from 12, and subtract 12 from cy",
            ),
            (
                PicturesRemedy::CutLeft { columns: 12 },
                "cut them off: keep columns from 12, and subtract 12 from cx",
            ),
            (
                PicturesRemedy::CutRight { last_column: 307 },
                "cut them off: keep columns 0 to 307",
            ),
        ] {
            assert_eq!(remedy.to_string(), said);
        }
    }
}
