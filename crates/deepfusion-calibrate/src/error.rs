use crate::Board;
use deepfusion_geometry::NoDistortion;
use deepfusion_hint::{Hint, count_of};

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A board that cannot be used.
    #[error(
        "a board of {}x{} inner corners{}: expected {} to {} corners along each side, and squares above 0 m",
        board.columns, board.rows, board.of_squares(), Board::LEAST, Board::MOST
    )]
    Board {
        /// What was asked for.
        board: Board,
    },
    /// No picture shows the board.
    #[error("no board of {}x{} inner corners in any of {}{}", board.columns, board.rows, count_of(*pictures, "picture"), instead(*seen))]
    NoBoard {
        /// What was looked for.
        board: Board,
        /// How many pictures were looked at.
        pictures: usize,
        /// Columns and rows of the whole grid that was seen most often instead, and in how many pictures.
        seen: Option<(usize, usize, usize)>,
    },
    /// Too few pictures show the board.
    #[error(
        "the board of {}x{} inner corners is whole in {found} of {}, and {needed} are needed{}",
        board.columns, board.rows, count_of(*pictures, "picture"), instead(*seen)
    )]
    TooFewViews {
        /// What was looked for.
        board: Board,
        /// Pictures that show it.
        found: usize,
        /// Pictures that were looked at.
        pictures: usize,
        /// How many views a calibration needs.
        needed: usize,
        /// As in [`Error::NoBoard`].
        seen: Option<(usize, usize, usize)>,
    },
    /// Pictures of several sizes.
    #[error("{picture}: {}x{} pixels, but {}x{} in {first}", size.0, size.1, first_size.0, first_size.1)]
    MixedSizes {
        /// The picture.
        picture: String,
        /// Its width and height.
        size: (u32, u32),
        /// The first picture.
        first: String,
        /// Its width and height.
        first_size: (u32, u32),
    },
    /// Pictures that the camera was held differently for.
    #[error("{picture}: EXIF turns it by {turned}, but {first} by {first_turned}")]
    MixedOrientations {
        /// The picture.
        picture: String,
        /// How it is turned to be upright.
        turned: &'static str,
        /// The first picture.
        first: String,
        /// How that is turned.
        first_turned: &'static str,
    },
    /// A view whose corners are not those of the board.
    #[error("{name}: {}, the board has {expected}", count_of(*corners, "corner"))]
    Corners {
        /// The view.
        name: String,
        /// How many it has.
        corners: usize,
        /// How many it should have.
        expected: usize,
    },
    /// Many cameras explain the views equally well.
    #[error("the views do not determine the camera: {problem}")]
    Undetermined {
        /// In what respect.
        problem: Undetermined,
    },
}

/// What the views leave open.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Undetermined {
    /// No camera's numbers fit them.
    #[error("no camera explains them")]
    NoCamera,
    /// The camera that fits them would have a board behind it.
    #[error("a board would be behind the camera")]
    Behind,
    /// A longer lens farther away would show the same.
    #[error("the focal length and the boards' distances explain each other")]
    Distance,
    /// The lens that fits them is none.
    #[error(transparent)]
    Lens(#[from] NoDistortion),
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

fn instead(seen: Option<(usize, usize, usize)>) -> String {
    match seen {
        Some((columns, rows, 1)) => format!("; a grid of {columns}x{rows} is in one"),
        Some((columns, rows, n)) => format!("; a grid of {columns}x{rows} is in {n}"),
        None => String::new(),
    }
}

const INNER: &str =
    "a board's size counts inner corners, where four squares meet: one of 10x7 squares has 9x6";

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Board { .. } => format!("{INNER}; measure the side of a square in metres: 0.025"),
            Self::NoBoard {
                seen: Some((c, r, _)),
                ..
            }
            | Self::TooFewViews {
                seen: Some((c, r, _)),
                ..
            } => format!("{INNER}; if the board that was seen is yours, its size is {c}x{r}"),
            Self::NoBoard { .. } => format!(
                "{INNER}; the whole board must be seen, sharp, evenly lit, with a white margin about it"
            ),
            Self::TooFewViews { .. } => {
                "film the whole board from more sides: sharp, tilted, near, and in every corner of the image".into()
            }
            Self::MixedSizes { .. } => {
                "a calibration is of one image size: keep the pictures of one size, not zoomed or cut".into()
            }
            Self::MixedOrientations { .. } => {
                "keep the pictures for which the camera was held one way: turned by half, its principal point lies elsewhere".into()
            }
            Self::Corners { .. } => "give every corner of the board, row after row".into(),
            Self::Undetermined { .. } => {
                "tilt the board by 20 to 45 degrees, about both of its axes, in half of the views".into()
            }
        })
    }
}
