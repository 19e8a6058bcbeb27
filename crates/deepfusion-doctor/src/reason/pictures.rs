//! What is wrong with the pictures.

use deepfusion_hint::count_of;
use std::fmt;

/// What is wrong with the pictures.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PicturesReason {
    /// The pictures hardly change from frame to frame.
    #[error(
        "the picture hardly moves from frame to frame: the parallax is below the images' noise"
    )]
    LittleParallax,
    /// Neighbours differ in brightness.
    #[error(
        "{jumps} of {} {} by more than {:.0} % in brightness, the first at frame {first} ({:+.0} %): the photometric error then measures the exposure",
        count_of(*neighbours, "neighbour"),
        if *jumps == 1 { "differs" } else { "differ" },
        100.0 * more_than,
        100.0 * (first_ratio - 1.0)
    )]
    BrightnessJumps {
        /// Number of neighbours that differ.
        jumps: usize,
        /// Number of neighbours.
        neighbours: u32,
        /// Least difference in brightness that counts, as a share.
        more_than: f64,
        /// The number of the first frame that does.
        first: u64,
        /// Its brightness over that of the frame before.
        first_ratio: f64,
    },
    /// The pictures are dark.
    #[error("most of the picture is black: nothing can be compared there")]
    Dark,
    /// The pictures are overexposed.
    #[error("much of the picture is white: nothing can be compared there")]
    White,
    /// All pictures lack the finest detail.
    #[error("the pictures lack the finest detail, as out of focus, shaken or enlarged ones do")]
    Soft,
    /// Some pictures are blurred.
    #[error(
        "{blurred} of {} {} less than half the drive's usual sharpness, the first of them frame {first}",
        count_of(*frames, "frame"),
        if *blurred == 1 { "has" } else { "have" }
    )]
    Blurred {
        /// Number of blurred frames.
        blurred: usize,
        /// Number of frames.
        frames: usize,
        /// The number of the first blurred frame.
        first: u64,
    },
    /// A part of the pictures belongs to the ego vehicle.
    #[error(
        "{pixels} pixels at the {side} do not change while the vehicle moves (over {:.0} % of that side): training on them teaches that this part of the vehicle is infinitely far",
        100.0 * share
    )]
    StillRim {
        /// Side of the picture.
        side: ImageSide,
        /// How far the part reaches inward, pixels.
        pixels: u32,
        /// Share of the side that it covers.
        share: f64,
        /// Size of the image from that side to the opposite one, pixels.
        across: u32,
    },
}

impl PicturesReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::LittleParallax => {
                "take frames further apart (frames = [3], or frame_distance_m = 0.2, in the training's configuration), or faster drives"
            }
            Self::BrightnessJumps { .. } => {
                "record again with fixed exposure and gain, or let them change slowly"
            }
            Self::Dark => "use a longer exposure, or leave out the darkest drives",
            Self::White => "use a shorter exposure",
            Self::Soft => {
                "focus the lens, clean the windscreen or use a shorter exposure; use enlarged pictures at half their size"
            }
            Self::Blurred { .. } => {
                "use a shorter exposure, fix the mount, or leave out these frames"
            }
            Self::StillRim {
                side,
                pixels,
                across,
                ..
            } => {
                let last = across.saturating_sub(pixels + 1);
                let keep = match side {
                    ImageSide::Bottom => format!("rows 0 to {last}"),
                    ImageSide::Top => format!("rows from {pixels}, and subtract {pixels} from cy"),
                    ImageSide::Left => {
                        format!("columns from {pixels}, and subtract {pixels} from cx")
                    }
                    ImageSide::Right => format!("columns 0 to {last}"),
                };
                return format!("crop the images: keep {keep}");
            }
        };
        text.to_owned()
    }
}

/// A side of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageSide {
    /// The last rows.
    Bottom,
    /// The first rows.
    Top,
    /// The first columns.
    Left,
    /// The last columns.
    Right,
}

impl fmt::Display for ImageSide {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bottom => "bottom",
            Self::Top => "top",
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picture_problems_have_their_messages() {
        let jumps = |jumps, first_ratio| PicturesReason::BrightnessJumps {
            jumps,
            neighbours: 99,
            more_than: 0.12,
            first: 5,
            first_ratio,
        };
        let blurred = |blurred| PicturesReason::Blurred {
            blurred,
            frames: 99,
            first: 3,
        };
        let rim = |side| PicturesReason::StillRim {
            side,
            pixels: 14,
            share: 0.993,
            across: 96,
        };
        for (reason, message) in [
            (
                PicturesReason::LittleParallax,
                "the picture hardly moves from frame to frame: the parallax is below the images' noise",
            ),
            (
                jumps(1, 1.3),
                "1 of 99 neighbours differs by more than 12 % in brightness, the first at frame 5 (+30 %): the photometric error then \
                 measures the exposure",
            ),
            (
                jumps(2, 0.7),
                "2 of 99 neighbours differ by more than 12 % in brightness, the first at frame 5 (-30 %): the photometric error then \
                 measures the exposure",
            ),
            (
                PicturesReason::White,
                "much of the picture is white: nothing can be compared there",
            ),
            (
                PicturesReason::Soft,
                "the pictures lack the finest detail, as out of focus, shaken or enlarged ones do",
            ),
            (
                blurred(1),
                "1 of 99 frames has less than half the drive's usual sharpness, the first of them frame 3",
            ),
            (
                blurred(9),
                "9 of 99 frames have less than half the drive's usual sharpness, the first of them frame 3",
            ),
            (
                rim(ImageSide::Bottom),
                "14 pixels at the bottom do not change while the vehicle moves (over 99 % of that side): training on them teaches that this part of the vehicle is infinitely far",
            ),
            (
                rim(ImageSide::Left),
                "14 pixels at the left do not change while the vehicle moves (over 99 % of that side): training on them teaches that this part of the vehicle is infinitely far",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }

    #[test]
    fn hints_name_the_rows_and_columns_to_keep() {
        let rim = |side, across| PicturesReason::StillRim {
            side,
            pixels: 12,
            share: 0.99,
            across,
        };
        for (reason, hint) in [
            (
                rim(ImageSide::Bottom, 94),
                "crop the images: keep rows 0 to 81",
            ),
            (
                rim(ImageSide::Top, 94),
                "crop the images: keep rows from 12, and subtract 12 from cy",
            ),
            (
                rim(ImageSide::Left, 320),
                "crop the images: keep columns from 12, and subtract 12 from cx",
            ),
            (
                rim(ImageSide::Right, 320),
                "crop the images: keep columns 0 to 307",
            ),
        ] {
            assert_eq!(reason.hint(), hint);
        }
    }
}
